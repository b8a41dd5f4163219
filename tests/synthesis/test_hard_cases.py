"""Plants on which synthesis tends to hang or to lie: each ends in time, with a right answer."""

import control
import numpy as np
import pytest
from numpy.testing import assert_allclose

import boomctl as bc
from tests.synthesis.plants import assert_verified, lower_loop_norm, resonators, two_modes, weighed


@pytest.mark.parametrize(
    "plant",
    [
        two_modes((1, 1, 1, 1), (1, 1, 1, 1)),
        *(pytest.param(resonators(40, damping, 40), marks=pytest.mark.slow) for damping in (1e-5, 1e-2, 5e-4)),
    ],
    ids=lambda plant: f"{plant.nstates} states",
)
def test_design_of_hard_plant_is_near_its_bound(plant):
    """Undamped modes, and eighty lightly damped states."""
    P = weighed(plant)
    design, passive = bc.h_infinity(P, 1, 1), bc.sigma(P, inputs="w_d", outputs="z_q").peak
    assert design.gamma <= 1.01 * design.certificate.lower_bound
    assert design.gamma < 0.1 * passive
    assert_verified(P, design.controller, design.gamma, design.certificate.norm_bounds.peak_omega)


def test_the_plant_of_the_slicot_library():
    """Data of the examples of SB10FD (for gamma = 15); python-control's ``hinfsyn`` reaches 10.18427."""
    A = [
        [-1, 0, 4, 5, -3, -2], [-2, 4, -7, -2, 0, 3], [-6, 9, -5, 0, 2, -1],
        [-8, 4, 7, -1, -3, 0], [2, 5, 8, -9, 1, -4], [3, -5, 8, 0, 2, -6],
    ]  # fmt: skip
    B = [
        [-3, -4, -2, 1, 0], [2, 0, 1, -5, 2], [-5, -7, 0, 7, -2],
        [4, -6, 1, 1, -2], [-3, 9, -8, 0, 5], [1, -2, 3, -6, -2],
    ]  # fmt: skip
    C = [[1, -1, 2, -4, 0, -3], [-3, 0, 5, -1, 1, 1], [-7, 5, 0, -8, 2, -2], [9, -3, 4, 0, 3, 7], [0, 1, -2, 1, -6, -2]]
    D = [[1, -2, -3, 0, 0], [0, 4, 0, 1, 0], [5, -3, -4, 0, 1], [0, 1, 0, 1, -3], [0, 0, 1, 7, 1]]
    P = control.ss(A, B, C, D)
    best, enough = bc.h_infinity(P, 2, 2), bc.h_infinity(P, 2, 2, gamma=15.0)
    assert 10.18 < best.certificate.lower_bound <= 10.18427
    assert best.gamma <= 1.01 * best.certificate.lower_bound
    assert best.gamma < enough.gamma <= 15.0
    assert_verified(P, enough.controller, enough.gamma, enough.certificate.norm_bounds.peak_omega)


@pytest.mark.parametrize(("unit", "leak"), [(1.0, 0.0), (30.0, 0.0), (1.0, 1e-4), (10.0, 1e-4)])
@pytest.mark.parametrize("count", [1, 2, 4, 6])
def test_chains_of_integrators(count, unit, leak):
    """Also leaky ones, and with states in units that grow along the chain and fall again."""
    A, units = np.diag(np.ones(count - 1), 1) - leak * np.eye(count), unit ** np.sin(np.arange(count))
    B, C = np.eye(count)[:, -1:] / units[-1], np.eye(count)[:1] * units[0]
    A, B, C = A / units[:, None] * units, np.hstack([B, B]), np.vstack([C, C])
    P = weighed(control.ss(A, B, C, 0.0, inputs=["d", "u"], outputs=["q", "y"]))
    design = bc.h_infinity(P, 1, 1)
    assert design.gamma <= 1.01 * design.certificate.lower_bound
    assert_allclose(lower_loop_norm(P, design.controller), design.gamma, rtol=1e-4)
