"""The motion of hub and beam under a torque on the hub, as a problem for the collocation."""

from dataclasses import dataclass

import numpy as np

from boomctl.arrays import Array
from boomctl.rotating_beam.manoeuvres import TorqueDriven
from boomctl.rotating_beam.modal.equations import Equations, Tangents


@dataclass(frozen=True)
class TorqueDrivenProblem:
    """Equations of hub and beam under a torque.

    Attributes
    ----------
    equations : Equations
    manoeuvre : TorqueDriven
    """

    equations: Equations
    manoeuvre: TorqueDriven

    @property
    def linear(self) -> bool:
        """No: the hub's speed is one of the unknowns."""
        return False

    def residual(self, t: Array, q: Array, v: Array, a: Array) -> Array:
        """Residual of the equations of motion, k x N."""
        result = self.equations.residual(q, v, a)
        result[:, 0] -= self.manoeuvre.torque(t)
        return result

    def tangents(self, t: Array, q: Array, v: Array, a: Array) -> Tangents:
        """Derivatives of the residual with respect to accelerations, rates and coordinates."""
        return self.equations.tangents(q, v, a)

    def first_guess(self, t: Array, start: float, v: Array) -> Array:
        """The motion of hub and beam if the beam were rigid and stayed as it is."""
        inertia = self.equations.inertia(np.zeros((1, v.size))).hub[0]
        times = np.concatenate([[start], t.ravel()])
        torque = self.manoeuvre.torque(times)
        impulse = np.cumsum(0.5 * np.diff(times) * (torque[1:] + torque[:-1]))
        guess = np.zeros((*t.shape, v.size))
        guess[..., 0] = v[0] + impulse.reshape(t.shape) / inertia
        return guess

    def is_admissible(self, q: Array) -> bool:
        """Whether the mass matrix is positive definite at all of k coordinates."""
        return bool(np.all(self.equations.inertia(q).margin() > 0.0))
