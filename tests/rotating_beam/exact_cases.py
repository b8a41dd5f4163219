"""Beams and states that the tests of the geometrically exact beam share."""

import numpy as np
from hypothesis import strategies as st
from scipy.linalg import eigh

from boomctl.rotating_beam import HubBeamParameters

BAI = HubBeamParameters()
LOADED = HubBeamParameters(tip_mass=0.4, tip_mass_position=5.0)
SIMO = HubBeamParameters(
    length=10.0,
    density=1.2,
    area=1.0,
    youngs_modulus=2.8e7,
    second_moment=5e-4,
    hub_radius=0.0,
    hub_inertia=1.0,
)
"""Simo & Vu-Quoc 1987: EI = 1.4e4, EA = 2.8e7, rho A = 1.2, L = 10; the hub's motion is prescribed."""


def states(coordinates, strain=0.02, rate=0.3):
    """Random coordinates and velocities of moderate bending, small stretch."""
    scale = np.full(coordinates, strain)
    scale[0] = 3.0
    scale[1 + (coordinates - 1) // 2 :] *= 1e-3
    speeds = scale * rate / strain
    speeds[0] = 2.0
    return st.integers(0, 2**32 - 1).map(
        lambda seed: tuple(np.random.default_rng(seed).uniform(-1, 1, (2, coordinates)) * (scale, speeds))
    )


def bent(model, tip, hub_speed=0.0):
    """Steady rotation, bent in the first clamped mode of the beam at rest to a tip displacement (by linear theory)."""
    own, dynamics = model._basis.bending, model.dynamics
    _, shapes = eigh(np.diag(model._basis.stiffness[own]), dynamics.rest_mass[own, own])
    row = np.imag(dynamics.tip_row(np.zeros(model._basis.coordinates)))[own]
    state = model.steady_state(hub_speed)
    state[own] = shapes[:, 0] * tip / (row @ shapes[:, 0])
    return state
