"""The beam's motion when the hub's is prescribed, as a problem for the collocation."""

from dataclasses import dataclass

import numpy as np

from boomctl.arrays import Array
from boomctl.rotating_beam.manoeuvres import PrescribedMotion
from boomctl.rotating_beam.modal.equations import Equations, Tangents


@dataclass(frozen=True)
class PrescribedProblem:
    """Beam equations at the hub's prescribed speed and acceleration; linear for all models but CFOAM.

    Attributes
    ----------
    equations : Equations
    motion : PrescribedMotion
    """

    equations: Equations
    motion: PrescribedMotion

    @property
    def linear(self) -> bool:
        """Whether the beam's equations are linear."""
        return self.equations.beam_speed_terms is not None

    def residual(self, t: Array, q: Array, v: Array, a: Array) -> Array:
        """Residual of the beam's equations, k x (N - 1)."""
        return self.equations.residual(*self._whole(t, q, v, a))[:, 1:]

    def tangents(self, t: Array, q: Array, v: Array, a: Array) -> Tangents:
        """Derivatives of the residual with respect to accelerations, rates and coordinates."""
        terms = self.equations.beam_speed_terms
        if terms is None:
            whole = self.equations.tangents(*self._whole(t, q, v, a))
            return Tangents(*(each[:, 1:, 1:] for each in whole))
        speed = self.motion.speed(t)[:, None, None]
        stiffness = terms.K + speed**2 * terms.K_w
        if not np.any(terms.G):
            return Tangents(terms.M, terms.C, stiffness)
        stiffness += self.motion.acceleration(t)[:, None, None] * terms.K_a
        return Tangents(terms.M, terms.C + speed * terms.G, stiffness)

    def first_guess(self, t: Array, start: float, v: Array) -> Array:
        """No motion of the beam."""
        return np.zeros((*t.shape, v.size))

    def is_admissible(self, q: Array) -> bool:
        """Always: the beam's own mass matrix is positive definite."""
        return True

    def _whole(self, t: Array, q: Array, v: Array, a: Array) -> tuple[Array, Array, Array]:
        hub = np.zeros_like(t), self.motion.speed(t), self.motion.acceleration(t)
        y, rate, acceleration = (np.column_stack([h, beam]) for h, beam in zip(hub, (q, v, a), strict=True))
        return y, rate, acceleration
