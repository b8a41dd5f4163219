"""The beam's motion at constant hub speed in closed form, for the models that are then linear."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from boomctl.arrays import Array
from boomctl.exceptions import SimulationError
from boomctl.maneuvers import PrescribedMotion
from boomctl.rotating_beam.modal.equations import BeamSpeedTerms

# Condition number of the eigenvectors: half of the digits remain, as the default tolerance needs.
_WORST_CONDITION = 1e8

Pair = tuple[Array, Array]
"""Coordinates and rates of the beam, n or k x n each."""


class SteadyRotation(NamedTuple):
    """Motion of the beam at a constant hub speed, exact to rounding error.

    Attributes
    ----------
    begin : float
        Start time, s.
    speed : float
        Hub speed, rad/s.
    flow : callable
        Returns coordinates and rates after elapsed times [s], from the values at the start.
    name : str
        Name of the closed form.
    """

    begin: float
    speed: float
    flow: Callable[[Pair, Array], Pair]
    name: str

    def __call__(self, start: Pair, timepts: Array) -> Pair:
        """Return coordinates and rates at times [s].

        Raises
        ------
        SimulationError
            If they overflow.
        """
        with np.errstate(over="ignore", invalid="ignore"):
            q, v = self.flow(start, timepts - self.begin)
        finite = np.isfinite(q).all(axis=1) & np.isfinite(v).all(axis=1)
        if not finite.all():
            time = timepts[np.argmin(finite)]
            raise SimulationError(
                f"the deflection exceeds every number by t = {time:.6g} s: the model has lost its stiffness"
            )
        return q, v


def steady_rotation(terms: BeamSpeedTerms, maneuver: PrescribedMotion) -> SteadyRotation | None:
    """Return the closed form at the speed at which a maneuver ends; None where its eigenvectors are ill-conditioned."""
    if not np.isfinite(maneuver.steady_from):
        return None
    speed = float(maneuver.speed(maneuver.steady_from))
    stiffness, damping, force = terms.K + speed**2 * terms.K_w, terms.C + speed * terms.G, speed**2 * terms.f_w
    if np.any(damping) or np.any(force):
        flow, name = _by_eigenvectors(terms, stiffness, damping, force), "eigenvectors"
    else:
        flow, name = _by_modes(terms.M, stiffness), "modes"
    return None if flow is None else SteadyRotation(maneuver.steady_from, speed, flow, f"steady rotation by {name}")


def vibration_amplitudes(terms: BeamSpeedTerms, speed: float, tip: Array) -> Pair:
    """Rows from coordinates and from rates to the amplitudes of the modes at the free end, n x n each.

    Modes of ``K + w^2 K_w`` without damping and gyroscopic terms; a mode without stiffness counts with 1 rad/s.

    Parameters
    ----------
    terms : BeamSpeedTerms
    speed : float
        Hub speed w, rad/s.
    tip : ndarray, n
        Row of the free end's displacement.
    """
    from scipy.linalg import eigh

    squares, shapes = eigh(terms.K + speed**2 * terms.K_w, terms.M)
    rate = np.sqrt(np.where(squares > 0.0, squares, 1.0))
    rows = (tip @ shapes)[:, None] * (shapes.T @ terms.M)
    return rows, rows / rate[:, None]


def _by_modes(mass: Array, stiffness: Array) -> Callable[[Pair, Array], Pair]:
    """Return the flow without damping and gyroscopic terms: decoupled modes of any stiffness."""
    from scipy.linalg import eigh

    squares, shapes = eigh(stiffness, mass)
    rate, stiff = np.sqrt(np.abs(squares)), squares > 0.0

    def flow(start: Pair, elapsed: Array) -> Pair:
        q, v = (shapes.T @ mass @ item for item in start)
        phase = np.multiply.outer(elapsed, rate)
        cosine = np.where(stiff, np.cos(phase), np.cosh(np.where(stiff, 0.0, phase)))
        growing = np.sinh(np.where(stiff, 0.0, phase))
        sine = np.where(stiff, np.sin(phase), growing) / np.where(rate > 0.0, rate, 1.0)
        sine = np.where(rate > 0.0, sine, elapsed[:, None])
        return (q * cosine + v * sine) @ shapes.T, (v * cosine - squares * q * sine) @ shapes.T

    return flow


def _by_eigenvectors(
    terms: BeamSpeedTerms, stiffness: Array, damping: Array, force: Array
) -> Callable[[Pair, Array], Pair] | None:
    """Return the flow in coordinates with unit mass and stiffness at rest, or None if it is ill-conditioned."""
    n = force.size
    mass_root: Array = np.linalg.cholesky(terms.M)
    stiffness_root: Array = np.linalg.cholesky(terms.K)
    to_q, to_v = np.linalg.inv(stiffness_root).T, np.linalg.inv(mass_root).T
    system = np.zeros((2 * n, 2 * n))
    system[:n, n:] = stiffness_root.T @ to_v
    system[n:, :n] = -to_v.T @ stiffness @ to_q
    system[n:, n:] = -to_v.T @ damping @ to_v
    values, vectors = np.linalg.eig(system)
    if np.linalg.cond(vectors) >= _WORST_CONDITION or np.abs(values).min() == 0.0:
        return None
    rest = -np.linalg.solve(system, np.concatenate([np.zeros(n), to_v.T @ force]))

    def flow(start: Pair, elapsed: Array) -> Pair:
        state = np.concatenate([stiffness_root.T @ start[0], mass_root.T @ start[1]])
        modes = np.exp(np.multiply.outer(elapsed, values)) * np.linalg.solve(vectors, state - rest)
        states = rest + (modes @ vectors.T).real
        return states[:, :n] @ to_q.T, states[:, n:] @ to_v.T

    return flow
