"""The verified error is that of the system given: clusters, light damping and bad coordinates against 40 digits."""

import warnings

import control
import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

import boomctl as bc
from boomctl.reduction.result import LowerOrderWarning, ReductionError
from tests.forty_digits import hard_system, largest_error, poles, resonances
from tests.profiles import examples
from tests.strategies import seeds

METHODS = ("balanced", "singular-perturbation", "hankel", "modal")


@pytest.mark.slow
@examples(40)
@given(seeds, st.sampled_from(METHODS))
def test_the_verified_error_is_at_or_above_the_truth(seed, method):
    full = hard_system(seed)
    assume(max(p.real for p in poles(full)) < 0)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", LowerOrderWarning)
            reduced = bc.reduce(full, full.nstates // 2, method)
    except (ReductionError, ValueError):
        return  # refused, not wrong
    assert largest_error(full, reduced.system) <= reduced.measured_error * (1.0 + 1e-6)


# of odd seeds, weakly damped oscillators of one frequency are in a chain
@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, *(pytest.param(seed, marks=pytest.mark.slow) for seed in range(2, 16, 2))])
def test_damping_above_a_millionth_is_reduced_and_not_refused(seed):
    full = hard_system(seed, damping=(-5.0, -1.0))
    reduced = bc.reduce(full, full.nstates // 2)
    assert largest_error(full, reduced.system) <= reduced.measured_error * (1.0 + 1e-6)
    assert reduced.truncation_bound <= 1e-3 * bc.hinf_norm(full).lower


@pytest.mark.slow
@examples(30)
@given(seeds)
def test_what_splitting_off_a_kept_part_loses_is_in_the_error(seed):
    """Beside an integrator and an unstable pole, in mixed coordinates; seen at the resonances of the stable part."""
    rng = np.random.default_rng(seed)
    stable = hard_system(3 * seed + 1, damping=(-5.0, -1.0))
    A = np.zeros((stable.nstates + 2, stable.nstates + 2))
    A[:-2, :-2], A[-1, -1] = stable.A, 0.5
    A[-2, :-2] = rng.standard_normal(stable.nstates)
    Q = np.linalg.qr(rng.standard_normal(A.shape))[0]
    B, C = rng.standard_normal((len(A), 2)), rng.standard_normal((2, len(A)))
    full = control.ss(Q @ A @ Q.T, Q @ B, C @ Q.T, 0.0)
    try:
        reduced = bc.reduce(full, 2 + stable.nstates // 2)
    except (ReductionError, ValueError):
        return  # refused, not wrong
    assert reduced.kept == 2
    at = [w for w in resonances(stable) if w > 0]
    size = max(largest_error(full, control.ss([], [], [], np.zeros((2, 2))), at), reduced.measured_error)
    # the integrator itself is kept to rounding
    assert largest_error(full, reduced.system, at) <= reduced.measured_error * (1.0 + 1e-6) + 1e-12 * size


@pytest.mark.slow
@pytest.mark.parametrize(
    "distance", [0.0, *(pytest.param(distance, marks=pytest.mark.slow) for distance in (1e-3, 1e-6, 1e-9, 1e-12))]
)
def test_poles_that_draw_together_in_mixed_coordinates(distance):
    """A chain of lags whose poles are nearly equal: its modes cancel, the nearer the more."""
    for seed in range(3):
        rng = np.random.default_rng(seed)
        A = -np.diag(1.0 + distance * np.arange(6.0)) + np.diag(np.full(5, 3.0), 1)
        Q = np.linalg.qr(rng.standard_normal((6, 6)))[0]
        full = control.ss(Q @ A @ Q.T, Q @ rng.standard_normal((6, 1)), rng.standard_normal((1, 6)) @ Q.T, 0.0)
        reduced = bc.reduce(full, 3)
        truth = largest_error(full, reduced.system)
        assert truth <= reduced.measured_error * (1.0 + 1e-6)
        assert reduced.measured_error <= reduced.error_bound * (1.0 + 1e-3)


def test_an_error_below_rounding_is_at_most_rounding():
    """Orders from the one on at which nothing is lost: each has an error, that of rounding."""
    full = control.ss(
        np.diag([-1.0, -2.0, -5.0, -9.0]), [[1.0], [1.0], [1e-9], [1e-10]], [[1.0, 1.0, 1e-9, 1e-10]], 0.0
    )
    for order in (2, 3, 4):
        with pytest.warns(LowerOrderWarning) if order > 2 else warnings.catch_warnings():
            assert bc.reduce(full, order).measured_error <= 1e-6
