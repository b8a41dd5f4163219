"""Problems of the collocation: the beam at a prescribed hub motion, or hub and beam under a torque.

These are second-order equations ``residual(t, q, v, a) = 0`` in n unknown coordinates at k times. `drive` is the hub's
acceleration or the torque on the hub, `first_guess` returns rates at m x s nodes as start of Newton's method, and `why`
describes the cause if no solution exists from a time on.
"""

from dataclasses import dataclass
from typing import ClassVar, final

import numpy as np

from boomctl.arrays import Array
from boomctl.maneuvers import PrescribedMotion, TorqueDriven
from boomctl.rotating_beam.modal.equations import Equations, Tangents


@final
@dataclass(frozen=True)
class PrescribedProblem:
    """Beam equations at the hub's prescribed speed and acceleration; linear for all models but CFOAM.

    Attributes
    ----------
    equations : Equations
    maneuver : PrescribedMotion
    """

    equations: Equations
    maneuver: PrescribedMotion

    @property
    def linear(self) -> bool:
        """True if the residual is affine in q, v and a."""
        return self.equations.beam_speed_terms is not None

    def drive(self, t: Array) -> Array:
        return self.maneuver.acceleration(t)

    def residual(self, t: Array, q: Array, v: Array, a: Array) -> Array:
        return self.equations.residual(*self._whole(t, q, v, a))[:, 1:]

    def tangents(self, t: Array, q: Array, v: Array, a: Array) -> Tangents:
        terms = self.equations.beam_speed_terms
        if terms is None:
            whole = self.equations.tangents(*self._whole(t, q, v, a))
            return Tangents(*(item[:, 1:, 1:] for item in whole))
        speed = self.maneuver.speed(t)[:, None, None]
        stiffness = terms.K + speed**2 * terms.K_w
        if not np.any(terms.G):
            return Tangents(terms.M, terms.C, stiffness)
        stiffness += self.maneuver.acceleration(t)[:, None, None] * terms.K_a
        return Tangents(terms.M, terms.C + speed * terms.G, stiffness)

    def first_guess(self, t: Array, start: float, v: Array) -> Array:
        """Return zero rates of the beam."""
        return np.zeros((*t.shape, v.size))

    def is_admissible(self, q: Array) -> bool:
        """Return True: the equations can be solved for the accelerations at any coordinates."""
        return True

    def why(self, time: float) -> str:
        return f"the deflection grows beyond all bounds from t = {time:.6g} s on: the model has lost its stiffness"

    def _whole(self, t: Array, q: Array, v: Array, a: Array) -> tuple[Array, Array, Array]:
        hub = np.zeros_like(t), self.maneuver.speed(t), self.maneuver.acceleration(t)
        y, rate, acceleration = (np.column_stack([h, beam]) for h, beam in zip(hub, (q, v, a), strict=True))
        return y, rate, acceleration


@final
@dataclass(frozen=True)
class TorqueDrivenProblem:
    """Equations of hub and beam under a torque.

    Attributes
    ----------
    equations : Equations
    maneuver : TorqueDriven
    """

    equations: Equations
    maneuver: TorqueDriven
    linear: ClassVar[bool] = False  # the hub's speed is one of the unknowns

    def drive(self, t: Array) -> Array:
        return self.maneuver.torque(t)

    def residual(self, t: Array, q: Array, v: Array, a: Array) -> Array:
        result = self.equations.residual(q, v, a)
        result[:, 0] -= self.maneuver.torque(t)
        return result

    def tangents(self, t: Array, q: Array, v: Array, a: Array) -> Tangents:
        return self.equations.tangents(q, v, a)

    def first_guess(self, t: Array, start: float, v: Array) -> Array:
        """Return the motion of hub and beam if the beam were rigid."""
        inertia = self.equations.inertia(np.zeros((1, v.size))).hub[0]
        times = np.concatenate([[start], t.ravel()])
        torque = self.maneuver.torque(times)
        impulse = np.cumsum(0.5 * np.diff(times) * (torque[1:] + torque[:-1]))
        guess = np.zeros((*t.shape, v.size))
        guess[..., 0] = v[0] + impulse.reshape(t.shape) / inertia
        return guess

    def is_admissible(self, q: Array) -> bool:
        """Return True if the mass matrix is positive definite at all k sets of coordinates."""
        return bool(np.all(self.equations.inertia(q).margin() > 0.0))

    def why(self, time: float) -> str:
        return (
            f"the model's mass matrix ceases to be positive definite at t = {time:.6g} s: the torque drives it out of "
            "the deformations it is valid for; use less torque or model='geometrically-exact'"
        )


Problem = PrescribedProblem | TorqueDrivenProblem
