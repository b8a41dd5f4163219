"""What the planning of a slew asks of a hub-beam: rest, energy left, root moment, shape, siblings."""

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from boomctl.arrays import Array
from boomctl.rotating_beam.modal.frequencies import steady_rotation
from boomctl.rotating_beam.modal.shapes import axial_modes, transverse_modes
from boomctl.rotating_beam.parameters import HubBeamParameters

if TYPE_CHECKING:
    from boomctl.rotating_beam.beam import HubBeam


def steady_state(beam: "HubBeam", hub_speed: float) -> Array:
    """State of the beam that turns steadily at a hub speed [rad/s], the hub angle 0."""
    size = beam.equations.size
    state = np.zeros(2 * size)
    state[1:size], state[size] = steady_rotation(beam.equations, hub_speed)[0], hub_speed
    return state


def residual_energy(beam: "HubBeam", state: ArrayLike, hub_speed: float) -> float:
    """Energy of a state's deviation from steady rotation at a hub speed [rad/s], hub angle aside, J.

    ``1/2 r^T M r + 1/2 q^T K q`` with the differences r of the rates and q of the beam's coordinates.
    """
    size = beam.equations.size
    x = np.asarray(state, dtype=float)
    gap = x - steady_state(beam, hub_speed)
    rate, q = gap[None, size:], gap[1:size]
    momenta = beam.equations.inertia(x[None, :size]).momenta(rate)
    return float(0.5 * np.sum(momenta * rate) + 0.5 * q @ beam.equations.beam_stiffness @ q)


def root_moment_row(beam: "HubBeam") -> Array:
    """Row that reads the bending moment ``EI v''(0)`` at the clamp off the states, N m."""
    p, size, n = beam.parameters, beam.equations.size, beam.modes
    row = np.zeros(2 * size)
    row[size - n : size] = p.bending_stiffness * transverse_modes(n, p.length)(0.0, 2)
    return row


def shape(beam: "HubBeam", states: ArrayLike, points: int = 41) -> Array:
    """Positions x + i y along the beam in fixed axes, from clamp to free end, k x points, m."""
    p, size, n = beam.parameters, beam.equations.size, beam.modes
    y = np.atleast_2d(np.asarray(states, dtype=float))[:, :size]
    x = np.linspace(0.0, p.length, points)
    bending = y[:, size - n :]
    across = bending @ transverse_modes(n, p.length)(x).T
    along = np.broadcast_to(x, across.shape).copy()
    if beam.model != "tlam":
        along -= 0.5 * np.einsum("ki,pij,kj->kp", bending, transverse_modes(n, p.length).shortening(x), bending)
    if beam.has_axial_modes:
        along += y[:, 1 : n + 1] @ axial_modes(n, p.length)(x).T
    return (p.hub_radius + along + 1j * across) * np.exp(1j * y[:, :1])


def with_tip_mass(parameters: HubBeamParameters, tip_mass: float) -> HubBeamParameters:
    """The same machine with another tip mass [kg]."""
    return replace(parameters, tip_mass=tip_mass)


def with_stiffness(parameters: HubBeamParameters, factor: float) -> HubBeamParameters:
    """The same machine with its bending stiffness multiplied by a factor; its axial stiffness stays."""
    return replace(parameters, second_moment=factor * parameters.second_moment)
