"""Discrete H-infinity synthesis: against the continuous problem, SLICOT's discrete one, and the loop's own response."""

from contextlib import suppress

import control
import numpy as np
import pytest
import slycot
from hypothesis import given
from hypothesis import strategies as st
from slycot.exceptions import SlycotError

import boomctl as bc
from boomctl.synthesis.plants.partition import normalized, partition
from tests.profiles import examples
from tests.synthesis import test_h2_discrete


def random_plant(seed):
    """Return a discrete generalized plant of which D12 and D21 are one, and no other direct way is there."""
    P = test_h2_discrete.random_plant(seed)
    P.D = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 1.0, 0.0]])
    return P


@pytest.mark.slow
@examples(25)
@given(st.integers(0, 10_000))
def test_discrete_norm_and_bound_against_slicot(seed):
    P = random_plant(seed)
    found = bc.h_infinity(P, 1, 1)
    K, loop = found.controller, found.closed_loop
    assert loop.dt == K.dt == 0.1
    assert found.certificate.norm_bounds.certified
    assert found.gamma <= 1.02 * found.certificate.lower_bound
    z = np.exp(1j * np.linspace(0.0, np.pi, 1001))[:, None, None]
    G = P.C @ np.linalg.solve(z * np.eye(P.nstates) - P.A, P.B + 0j) + P.D
    Kz = K.C @ np.linalg.solve(z * np.eye(K.nstates) - K.A, K.B + 0j) + K.D
    closed = G[:, :2, :2] + G[:, :2, 2:] @ np.linalg.solve(1.0 - Kz @ G[:, 2:, 2:], Kz @ G[:, 2:, :2])
    values = np.linalg.svd(closed, compute_uv=False)[:, 0]
    assert values.max() <= found.certificate.norm_bounds.upper_bound * (1.0 + 1e-9)
    assert values.max() >= 0.98 * found.gamma
    assert np.abs(loop.poles()).max() < 1.0
    # SLICOT's own may refuse a level or miss it, but nothing it gives goes below what no controller beats
    for level in (0.9 * found.certificate.lower_bound, 0.98 * found.certificate.lower_bound, 1.05 * found.gamma):
        with suppress(SlycotError):
            _, *matrices = slycot.sb10dd(P.nstates, 3, 3, 1, 1, level, P.A, P.B, P.C, P.D)[:5]
            other = bc.hinf_norm(bc.lft(P, control.ss(*matrices, 0.1)))
            assert other.upper_bound >= found.certificate.lower_bound * (1.0 - 1e-6)


def test_tustin_plant_has_continuous_level():
    slow = control.ss(-1.0, [[1.0, 0.0, 1.0]], [[1.0], [0.0], [1.0]], [[0, 0, 0], [0, 0, 1], [0, 0.1, 0]])
    exact = bc.h_infinity(slow, 1, 1)
    found = bc.h_infinity(control.sample_system(slow, 0.1, "tustin"), 1, 1)
    assert found.certificate.lower_bound == pytest.approx(exact.certificate.lower_bound, rel=5e-3)
    assert found.gamma == pytest.approx(exact.gamma, rel=2e-2)


@pytest.mark.parametrize("split", [0.0, 1e-28, -1e-28])
def test_normalized_double_pole_stays_bounded(split):
    """A double pole that rounding splits into a complex pair has eigenvectors that are parallel but for rounding."""
    A = np.array([[-120.0, 30.0 * split], [30.0, -120.0]])
    B, C = [[1.0, 0.0, 1.0], [0.0, 0.0, 0.0]], [[0.0, 1.0], [0.0, 0.0], [0.0, 1.0]]
    P = control.ss(A, B, C, [[0, 0, 0], [0, 0, 1], [0, 1, 0]])
    ready = normalized(partition(P, 1, 1))
    assert max(np.linalg.norm(X) for X in (ready.A, ready.system.B, ready.system.C)) < 1e4
    assert bc.h2(P, 1, 1).certificate.norm_bounds.certified
