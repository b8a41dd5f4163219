"""Orders that are there are found, none comes back unsaid, and rigid motion is kept whatever the friction."""

import re
import warnings

import control
import numpy as np
import pytest

import boomctl as bc
from boomctl.exceptions import LowerOrderWarning
from boomctl.lti.system import of
from tests.reduction.test_reduce import METHODS


def ladder(count):
    """Lags in a row, each driven by its neighbors: the Hankel singular values fall by tens."""
    A = -2.0 * np.eye(count) + np.diag(np.ones(count - 1), -1) + np.diag(np.ones(count - 1), 1)
    return control.ss(A, np.eye(count)[:, :1], np.eye(count)[-1:], 0.0)


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


def cart(friction, masses=2, coordinates="plain", seed=0):
    """Masses in a row, springs and dampers between them, each with friction to the ground; displacements are read."""
    rng = np.random.default_rng(seed)
    K = 2.0 * np.eye(masses) - np.diag(np.ones(masses - 1), 1) - np.diag(np.ones(masses - 1), -1)
    K[0, 0] = K[-1, -1] = 1.0
    A = np.block([[np.zeros((masses, masses)), np.eye(masses)], [-K, -friction * np.eye(masses) - 0.1 * K]])
    B, C = np.eye(2 * masses)[:, [masses]], np.eye(2 * masses)[:masses]
    T = np.eye(2 * masses)
    if coordinates == "orthogonal":
        T = np.linalg.qr(rng.standard_normal(T.shape))[0]
    elif coordinates == "mixed":
        T = rng.standard_normal(T.shape)
    inverse = np.linalg.inv(T)
    return control.ss(T @ A @ inverse, T @ B, C @ inverse, 0.0)


@pytest.mark.parametrize("coordinates", ["plain", "orthogonal", "mixed"])
def test_a_cart_keeps_its_integrator_at_every_friction(coordinates):
    for seed, friction in enumerate(np.geomspace(1e-5, 10.0, 15)):
        reduced = bc.reduce(cart(friction, coordinates=coordinates, seed=seed), 3)
        assert (reduced.order, reduced.retained_order) == (3, 1)
        # a push of one moves both masses by 1/(2 friction), in the end
        slow = 1e-6j * friction
        end = (slow * of(reduced.system).response(np.array([abs(slow)]))[:, 0, 0]).real
        assert end == pytest.approx(np.full(2, 0.5 / friction), rel=1e-4 if coordinates == "mixed" else 1e-6)


@pytest.mark.parametrize("masses", [2, 3, 4])
@pytest.mark.parametrize("coordinates", ["plain", "orthogonal", "mixed"])
def test_rigid_motion_is_double_integrator(masses, coordinates):
    reduced = bc.reduce(cart(0.0, masses, coordinates), 3 if masses == 2 else 4)
    assert reduced.retained_order == 2
    slow = 1e-3
    assert of(reduced.system).response(np.array([slow]))[:, 0, 0] == pytest.approx(-1.0 / (masses * slow**2), rel=1e-4)


@pytest.mark.parametrize("method", METHODS)
def test_an_order_not_asked_for_is_said(method):
    system = cart(0.3, masses=4, coordinates="orthogonal")
    for order in range(1, system.nstates + 1):
        with warnings.catch_warnings(record=True) as said:
            warnings.simplefilter("always")
            reduced = bc.reduce(system, order, method)
        assert reduced.requested_order == order
        assert (reduced.order < order) == any(one.category is LowerOrderWarning for one in said)
        assert (f"{order} requested" in repr(reduced)) == (reduced.order < order)
