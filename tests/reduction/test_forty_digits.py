"""The verified error is that of the system given: clusters, light damping and bad coordinates against 40 digits."""

import warnings

import control
import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

import boomctl as bc
from boomctl.reduction.result import LowerOrderWarning, ReductionError
from tests.forty_digits import hard_system, largest_error, poles
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


def test_an_error_below_rounding_is_at_most_rounding():
    """Orders from the one on at which nothing is lost: each has an error, that of rounding."""
    full = control.ss(
        np.diag([-1.0, -2.0, -5.0, -9.0]), [[1.0], [1.0], [1e-9], [1e-10]], [[1.0, 1.0, 1e-9, 1e-10]], 0.0
    )
    for order in (2, 3, 4):
        with pytest.warns(LowerOrderWarning) if order > 2 else warnings.catch_warnings():
            assert bc.reduce(full, order).measured_error <= 1e-6
