"""Orders that are there are found: all modes for a wanted error, small errors, equal Hankel singular values."""

import re
import warnings

import control
import numpy as np
import pytest

import boomctl as bc
from boomctl.exceptions import LowerOrderWarning
from tests.reduction.test_hard_cases import chain


def ladder(count):
    """Lags in a row, each driven by its neighbors: the Hankel singular values fall by tens."""
    A = -2.0 * np.eye(count) + np.diag(np.ones(count - 1), -1) + np.diag(np.ones(count - 1), 1)
    return control.ss(A, np.eye(count)[:, :1], np.eye(count)[-1:], 0.0)


@pytest.mark.parametrize(
    "share", [1e-2, *(pytest.param(share, marks=pytest.mark.slow) for share in (1e-3, 1e-4)), 1e-6]
)
@pytest.mark.parametrize("masses", [20, pytest.param(30, marks=pytest.mark.slow)])
def test_modes_are_added_until_a_wanted_error_is_reached(masses, share):
    model = chain(masses, 1e-2)
    wanted = share * bc.sigma(model).peak
    reduced = bc.reduce(model, max_error=wanted, method="modal")
    assert reduced.error_norm <= wanted
    assert reduced.order <= 2 * masses


@pytest.mark.parametrize("method", ["balanced", "singular-perturbation"])
@pytest.mark.parametrize("count", [12, *(pytest.param(count, marks=pytest.mark.slow) for count in (60, 100))])
def test_every_order_has_an_error_also_below_rounding(method, count):
    full = ladder(count)
    size = bc.hinf_norm(full).lower_bound
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", LowerOrderWarning)
        found = [bc.reduce(full, order, method) for order in range(6, 13)]
    assert max(one.error_norm for one in found[6 - 2 :]) <= 1e-5 * size
    assert all(one.error_norm <= one.error_bound * (1.0 + 1e-3) for one in found)


@pytest.mark.parametrize(
    ("sizes", "kept"), [((3, 3, 3, 3), 0), ((5, 2, 2, 2, 1), 0), ((4, 4, 1), 1), ((3, 3, 2, 2), 2)]
)
def test_the_orders_offered_for_equal_hankel_values_are_there(sizes, kept):
    n = len(sizes)
    A = np.diag([*(-1.0 for _ in sizes), *(0.0 for _ in range(kept))])
    B = np.diag([*np.sqrt(sizes), *(1.0 for _ in range(kept))])
    full = control.ss(A, B, B, 0.0)
    for order in range(kept, n + kept):
        try:
            bc.reduce(full, order, "hankel")
        except ValueError as refused:
            offered = [int(each) for each in re.search(r"take (\d+) or (\d+)", str(refused)).groups()]
            assert order not in offered
            for each in offered:
                assert bc.reduce(full, each, "hankel").order == each


def test_an_error_below_rounding_is_at_most_rounding():
    """Orders from the one on at which nothing is lost: each has an error, that of rounding."""
    full = control.ss(
        np.diag([-1.0, -2.0, -5.0, -9.0]), [[1.0], [1.0], [1e-9], [1e-10]], [[1.0, 1.0, 1e-9, 1e-10]], 0.0
    )
    for order in (2, 3, 4):
        with (
            pytest.warns(LowerOrderWarning, match=rf"order = {order}: 2 states returned; .* rounding")
            if order > 2
            else warnings.catch_warnings()
        ):
            found = bc.reduce(full, order)
        assert found.order == 2
        assert found.error_norm <= 1e-6
