"""The closed form shared by the models whose kinetic energy is of second order in the beam's coordinates."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from boomctl.arrays import Array
from boomctl.rotating_beam.modal.equations import (
    BeamSpeedTerms,
    Inertia,
    NormalForm,
    Tangents,
    Tip,
    frequency_range,
    normal_form,
)


@dataclass(frozen=True)
class FirstOrderEquations:
    """Equations of motion of TLAM, SFOAM and FOAM, Eqs. (24)-(34), (40) and (42) of Bai et al. (2009), print mended.

    With all the beam's coordinates in q, hub speed w and hub acceleration a the kinetic energy is
    ``T = 1/2 w^2 (J + 2 V q + q^T N q) + w (W q' + q^T B q') + 1/2 q'^T M q'``, B skew, and the equations are

    ``(J + 2 V q + q^T N q) a + (W - B q) q'' + 2 w (V q' + q^T N q') = tau``
    ``M q'' + (W - B q) a + (C - 2 w B) q' + (K - w^2 N) q = w^2 V``.

    Attributes
    ----------
    rigid_inertia : float
        J, of everything, undeformed, kg m^2.
    M, N, B, C, K : ndarray, n x n
    V, W : ndarray, n
    keeps_inertia_torque : bool
        Whether the hub's equation has the term ``Q_theta = -2 w (V q' + q^T N q')``; SFOAM as printed leaves it out.
    has_axial : bool
        Whether B and V are there at all; otherwise no operation is spent on them.
    tip : Tip
    """

    rigid_inertia: float
    M: Array
    N: Array
    B: Array
    C: Array
    K: Array
    V: Array
    W: Array
    keeps_inertia_torque: bool
    has_axial: bool
    tip: Tip

    @property
    def size(self) -> int:
        """Number of coordinates, the hub's included."""
        return self.W.size + 1

    @property
    def beam_mass(self) -> Array:
        """M."""
        return self.M

    @property
    def beam_stiffness(self) -> Array:
        """K."""
        return self.K

    @property
    def frequency_range(self) -> tuple[float, float]:
        """Lowest and highest natural frequency of the beam at rest, rad/s."""
        return self._frequency_range

    @cached_property
    def _frequency_range(self) -> tuple[float, float]:
        return frequency_range(self.beam_mass, self.beam_stiffness)

    @property
    def beam_speed_terms(self) -> BeamSpeedTerms:
        """Beam equations at a given hub motion."""
        return self._beam_speed_terms

    @cached_property
    def _beam_speed_terms(self) -> BeamSpeedTerms:
        return BeamSpeedTerms(self.M, self.C, -2.0 * self.B, self.K, -self.N, -self.B, self.V, -self.W)

    @property
    def normal_form(self) -> NormalForm | None:
        """Beam equations at a given hub motion, without axial modes and damping."""
        return self._normal_form

    @cached_property
    def _normal_form(self) -> NormalForm | None:
        return normal_form(self._beam_speed_terms)

    def inertia(self, y: Array) -> Inertia:
        """Mass matrix in its blocks."""
        q = y[:, 1:]
        return Inertia(self._hub_inertia(q), self._coupling(q), self.M)

    def residual(self, y: Array, rate: Array, acceleration: Array) -> Array:
        """Left-hand sides of the equations of motion, k x N."""
        q, u, a = y[:, 1:], rate[:, 1:], acceleration[:, 1:]
        speed, turning = rate[:, :1], acceleration[:, :1]
        coupling = self._coupling(q)
        result = np.empty_like(y)
        result[:, 0] = self._hub_inertia(q) * turning[:, 0] + np.sum(coupling * a, axis=1)
        if self.keeps_inertia_torque:
            result[:, 0] -= self.inertia_torque(y, rate)
        result[:, 1:] = a @ self.M + coupling * turning + u @ self.C + q @ self.K - speed**2 * (q @ self.N)
        if self.has_axial:
            result[:, 1:] -= 2.0 * speed * (u @ self.B.T) + speed**2 * self.V
        return result

    def tangents(self, y: Array, rate: Array, acceleration: Array) -> Tangents:
        """Derivatives of the residual with respect to accelerations, rates and coordinates."""
        q, u, a = y[:, 1:], rate[:, 1:], acceleration[:, 1:]
        speed, turning = rate[:, :1], acceleration[:, :1]
        Nq, Nu = q @ self.N, u @ self.N
        damping = np.zeros((y.shape[0], self.size, self.size))
        stiffness = np.zeros_like(damping)
        damping[:, 1:, 0] = -2.0 * speed * Nq
        damping[:, 1:, 1:] = self.C
        stiffness[:, 0, 1:] = 2.0 * turning * Nq
        stiffness[:, 1:, 1:] = self.K - (speed**2)[..., None] * self.N
        if self.keeps_inertia_torque:
            damping[:, 0, 0] = 2.0 * np.sum(q * Nu, axis=1)
            damping[:, 0, 1:] = 2.0 * speed * Nq
            stiffness[:, 0, 1:] += 2.0 * speed * Nu
        if self.has_axial:
            damping[:, 1:, 0] -= 2.0 * (u @ self.B.T + speed * self.V)
            damping[:, 1:, 1:] -= 2.0 * speed[..., None] * self.B
            stiffness[:, 0, 1:] += 2.0 * turning * self.V - a @ self.B
            stiffness[:, 1:, 1:] -= turning[..., None] * self.B
            if self.keeps_inertia_torque:
                damping[:, 0, 0] += 2.0 * (u @ self.V)
                damping[:, 0, 1:] += 2.0 * speed * self.V
        mass = np.empty_like(damping)
        mass[:, 0, 0], mass[:, 1:, 1:] = self._hub_inertia(q), self.M
        mass[:, 0, 1:] = mass[:, 1:, 0] = self._coupling(q)
        return Tangents(mass, damping, stiffness)

    def inertia_torque(self, y: Array, rate: Array) -> Array:
        """``Q_theta = -2 w (V q' + q^T N q')``, Eq. (32), k."""
        q, u = y[:, 1:], rate[:, 1:]
        lever = np.sum((q @ self.N) * u, axis=1)
        return -2.0 * rate[:, 0] * (lever + u @ self.V if self.has_axial else lever)

    def dissipation(self, rate: Array) -> Array:
        """Power lost in damping, k."""
        u = rate[:, 1:]
        return np.sum((u @ self.C) * u, axis=1)

    def _hub_inertia(self, q: Array) -> Array:
        inertia = self.rigid_inertia + np.sum((q @ self.N) * q, axis=1)
        return inertia + 2.0 * (q @ self.V) if self.has_axial else inertia

    def _coupling(self, q: Array) -> Array:
        return self.W - q @ self.B.T if self.has_axial else np.broadcast_to(self.W, q.shape)
