"""Free-floating machines: their rigid motion is kept whatever the friction, and no order comes back unsaid."""

import warnings

import control
import numpy as np
import pytest

import boomctl as bc
from boomctl.exceptions import LowerOrderWarning
from boomctl.lti.system import of
from tests.reduction.test_reduce import METHODS


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
