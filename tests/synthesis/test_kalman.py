"""Filters: duality with the regulator, variance of the error, names."""

import control
import numpy as np
import pytest
from hypothesis import given
from scipy import linalg

import boomctl as bc
from tests.profiles import examples
from tests.strategies import seeds
from tests.synthesis.test_lqr import random_system, random_weight, variance


@pytest.mark.parametrize("dt", [0.0, 0.1])
@given(seed=seeds)
@examples(60)
def test_covariance_is_that_of_error_and_no_gain_has_less(dt, seed):
    """The gain is that of the dual regulator, and that of python-control."""
    rng = np.random.default_rng(seed)
    system, W, V = random_system(seed, dt=dt), random_weight(seed, 5), random_weight(seed + 1, 2)
    design = bc.kalman(system, W, V)
    dual = control.ss(system.A.T, system.C.T, np.eye(5), np.zeros((5, 2)), dt)
    assert pytest.approx(bc.lqr(dual, W, V).gain, rel=1e-9, abs=1e-10) == design.gain.T
    peer = (control.dlqe if dt else control.lqe)(system.A, np.eye(5), system.C, W, V)[0]
    assert np.allclose(design.gain, peer, rtol=1e-7, atol=1e-8)
    for size in (0.0, 1e-3, 1e-1):
        L = design.gain + size * rng.standard_normal(design.gain.shape)
        P = variance(system.A - L @ system.C, W + L @ V @ L.T, dt)
        if size == 0.0:
            assert design.covariance == pytest.approx(P, rel=1e-7, abs=1e-8)
        if P is not None:
            assert np.linalg.eigvalsh(P - design.covariance).min() > -1e-8 * np.abs(P).max()


@given(seeds)
@examples(40)
def test_noise_fed_through_to_a_measurement_is_noise_on_both(seed):
    rng = np.random.default_rng(seed)
    bare = random_system(seed, unstable=False)
    D = rng.standard_normal((2, 2))
    fed = control.ss(bare.A, bare.B, bare.C, D, inputs=["u0", "u1"], outputs=["y0", "y1"])
    design = bc.kalman(fed, {"u0": 2.0, "u1": 0.3}, 0.1)
    # the same noise through gains of our own: the error obeys e' = (A - L C) e + (B - L D) w - L v
    W = np.diag([2.0, 0.3])
    A, B = fed.A - design.gain @ fed.C, fed.B - design.gain @ fed.D
    P = linalg.solve_continuous_lyapunov(A, -(B @ W @ B.T + 0.1 * design.gain @ design.gain.T))
    assert design.covariance == pytest.approx(P, rel=1e-6, abs=1e-8 * np.abs(P).max())
    innovation = P @ fed.C.T + B @ W @ fed.D.T - 0.1 * design.gain
    assert np.abs(innovation).max() < 1e-7 * (1.0 + np.abs(P).max())  # error and innovation are orthogonal


@given(seeds)
@examples(40)
def test_the_estimator_follows_a_known_input_without_error(seed):
    system = random_system(seed, unstable=False)
    design = bc.kalman(system, {"u0": 1.0}, 1.0, measurements=["y0", "y1"])
    assert design.estimator.input_labels == ["y0", "y1", "u1"]
    assert design.estimator.output_labels == ["x0", "x1", "x2", "x3", "x4"]
    for w in (0.1, 1.0, 10.0):
        estimate = design.estimator(1j * w)
        response = system(1j * w)[:, 1:]
        state = np.linalg.solve(1j * w * np.eye(5) - system.A, system.B[:, 1:])
        assert estimate[:, :2] @ response + estimate[:, 2:] == pytest.approx(state, rel=1e-7, abs=1e-9)


def test_inputs_may_be_named_as_disturbances():
    system = random_system(3)
    by_name = bc.kalman(system, {"u1": 2.0}, 1.0)
    assert bc.kalman(system, 2.0, 1.0, disturbances="u1").gain == pytest.approx(by_name.gain)
    assert bc.kalman(system, [2.0], 1.0, disturbances=["u1"]).gain == pytest.approx(by_name.gain)
    assert bc.kalman(system, {"u1": 2.0}, {"y1": 1.0, "y0": 1.0}).gain == pytest.approx(by_name.gain)
    on_states = bc.kalman(system, 2.0 * system.B[:, 1:] @ system.B[:, 1:].T, 1.0)
    assert on_states.gain == pytest.approx(by_name.gain, rel=1e-6)
    assert on_states.estimator.input_labels == ["y0", "y1", "u0", "u1"]
