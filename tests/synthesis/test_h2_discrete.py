"""Discrete H2 synthesis, generalized plants and smaller controllers: optimality by trial, sums of pulses, exact parts."""

import control
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import linalg

import boomctl as bc
from tests.profiles import examples
from tests.synthesis.test_lqr import random_system


def random_plant(seed, dt=0.1):
    """Return a generalized plant, stable or not, with direct ways everywhere that its norm is finite with."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 6))
    A = rng.standard_normal((n, n))
    A *= rng.uniform(0.3, 1.2) / np.abs(np.linalg.eigvals(A)).max()
    B, C, D = rng.standard_normal((n, 3)), rng.standard_normal((3, n)), rng.standard_normal((3, 3))
    D[:2, :2] *= dt > 0.0
    return control.ss(A, B, C, D, dt, inputs=["w1", "w2", "u"], outputs=["z1", "z2", "y"])


def square_of_pulses(loop):
    """Return the sum of the squares of all pulse responses, step by step."""
    total, x = float(np.sum(loop.D**2)), np.asarray(loop.B)
    for _ in range(20_000):
        total += float(np.sum((loop.C @ x) ** 2))
        x = loop.A @ x
        if np.abs(x).max() < 1e-12:
            break
    return total


@pytest.mark.parametrize("dt", [0.0, 0.1])
@given(seed=st.integers(0, 10**6))
@examples(60)
def test_h2_norm_is_that_of_pulses_and_no_neighbor_has_less(dt, seed):
    P = random_plant(seed, dt)
    try:
        design = bc.h2(P, 1, 1)
    except bc.exceptions.SynthesisError as error:
        assert any(word in str(error) for word in ("zero on the unit circle", "moved", "seen"))  # noqa: PT017
        return
    K, rng = design.controller, np.random.default_rng(seed)
    assert K.dt == design.closed_loop.dt == dt
    assert design.norm == pytest.approx(design.optimal_norm, rel=1e-6)
    if dt:
        assert square_of_pulses(design.closed_loop) == pytest.approx(design.norm**2, rel=1e-6)
    names = {"inputs": K.input_labels, "outputs": K.output_labels}
    for size in (1e-4, 1e-2):
        for _ in range(4):
            A, B, C, D = (
                np.asarray(part) + size * np.abs(part).max() * rng.standard_normal(part.shape)
                for part in (K.A, K.B, K.C, K.D)
            )
            other = bc.h2_norm(bc.lft(P, control.ss(A, B, C, D, dt, **names)))
            assert other.value >= design.norm * (1.0 - 1e-9)


@given(st.integers(0, 10**6))
@examples(20)
def test_h2_with_late_measurement_matches_lqg(seed):
    """``lqg`` uses the measurements before a sample: it is ``h2`` of the plant whose measurement is one sample late."""
    n, plant = 3, random_system(seed, 3, 1, 1, dt=0.1)
    best = bc.lqg(plant, 1.0, 1.0, 1.0, 1.0)
    A = linalg.block_diag(plant.A, 0.0)
    A[n, :n] = plant.C[0]
    B = np.hstack([np.eye(n + 1), np.zeros((n + 1, 1)), np.vstack([plant.B, [[0.0]]])])
    C = np.vstack([np.eye(n, n + 1), np.zeros((1, n + 1)), np.eye(1, n + 1, n)])
    D = np.zeros((n + 2, n + 3))
    D[n, n + 2], D[n + 1, n + 1] = 1.0, 1e-6  # the late reading itself is all but exact: the noise is in its state
    found = bc.h2(control.ss(A, B, C, D, 0.1), 1, 1)
    assert found.norm**2 == pytest.approx(best.cost, rel=1e-5)
