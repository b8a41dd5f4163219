"""TLAM, SFOAM and FOAM: one closed form, for their kinetic energy is of second order in the beam's coordinates.

They differ in its matrices: FOAM has all of them, SFOAM no axial coordinates, TLAM no shortening due to bending.
"""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import final

import numpy as np

from boomctl.arrays import Array, blocks
from boomctl.rotating_beam.modal.equations import (
    BeamSpeedTerms,
    Equations,
    FreeHubForm,
    Inertia,
    NormalForm,
    Tangents,
    Tip,
    block_diagonal,
)
from boomctl.rotating_beam.modal.integrals import ModalIntegrals


@final
@dataclass(frozen=True)
class FirstOrderEquations(Equations):
    """Equations of motion of TLAM, SFOAM, FOAM: Eqs. (24)-(34), (40), (42) of Bai et al. (2009), misprints corrected.

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
        True if the hub's equation has the term ``Q_theta = -2 w (V q' + q^T N q')``; SFOAM as printed omits it.
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

    @cached_property
    def beam_speed_terms(self) -> BeamSpeedTerms:
        return BeamSpeedTerms(self.M, self.C, -2.0 * self.B, self.K, -self.N, -self.B, self.V, -self.W)

    @cached_property
    def normal_form(self) -> NormalForm | None:
        """Form without axial modes and damping; None with either, whose terms it does not contain."""
        terms = self.beam_speed_terms
        if np.any(terms.G) or np.any(terms.C) or np.any(terms.K_a) or np.any(terms.f_w):
            return None
        root: Array = np.linalg.cholesky(terms.M)
        to_q = np.linalg.inv(root).T
        return NormalForm(to_q, root.T, to_q.T @ terms.K @ to_q, to_q.T @ terms.K_w @ to_q, to_q.T @ terms.f_a)

    @cached_property
    def free_hub_form(self) -> FreeHubForm | None:
        """None where the straight beam's mass matrix is not positive definite, or a mode is damped too much to vibrate."""
        try:
            root: Array = np.linalg.cholesky(self.M - np.outer(self.W, self.W) / self.rigid_inertia)
        except np.linalg.LinAlgError:
            return None
        to_q = np.linalg.inv(root).T
        stiffness, slope, gyro, damping = (to_q.T @ item @ to_q for item in (self.K, self.N, self.B, self.C))
        lean = -(self.W @ to_q) / self.rigid_inertia
        squares, shapes = np.linalg.eigh(stiffness)
        if np.any(squares <= np.einsum("ji,jk,ki->i", shapes, 0.5 * damping, shapes) ** 2):
            return None
        return FreeHubForm(
            inertia=self.rigid_inertia,
            to_q=to_q,
            lean=lean,
            softest=float(squares[0]),
            stiffness=stiffness,
            slope=slope,
            gyro=gyro,
            damping=damping,
            axial=self.V @ to_q,
            keeps_inertia_torque=self.keeps_inertia_torque,
            has_axial=self.has_axial,
            decay=0.5 * float(np.linalg.eigvalsh(damping)[-1]) if np.any(damping) else 0.0,
        )

    def inertia(self, y: Array) -> Inertia:
        q = y[:, 1:]
        hub = self.rigid_inertia + np.sum((q @ self.N) * q, axis=1)
        if not self.has_axial:
            return Inertia(hub, np.broadcast_to(self.W, q.shape), self.M)
        return Inertia(hub + 2.0 * (q @ self.V), self.W - q @ self.B.T, self.M)

    def residual(self, y: Array, rate: Array, acceleration: Array) -> Array:
        q, u, a = y[:, 1:], rate[:, 1:], acceleration[:, 1:]
        speed, turning = rate[:, :1], acceleration[:, :1]
        hub, coupling, _ = self.inertia(y)
        result = np.empty_like(y)
        result[:, 0] = hub * turning[:, 0] + np.sum(coupling * a, axis=1)
        if self.keeps_inertia_torque:
            result[:, 0] -= self.inertia_torque(y, rate)
        result[:, 1:] = a @ self.M + coupling * turning + u @ self.C + q @ self.K - speed**2 * (q @ self.N)
        if self.has_axial:
            result[:, 1:] -= 2.0 * speed * (u @ self.B.T) + speed**2 * self.V
        return result

    def tangents(self, y: Array, rate: Array, acceleration: Array) -> Tangents:
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
        mass[:, 0, 0], coupling, mass[:, 1:, 1:] = self.inertia(y)
        mass[:, 0, 1:] = mass[:, 1:, 0] = coupling
        return Tangents(mass, damping, stiffness)

    def inertia_torque(self, y: Array, rate: Array) -> Array:
        """``Q_theta = -2 w (V q' + q^T N q')``, Eq. (32), k."""
        q, u = y[:, 1:], rate[:, 1:]
        lever = np.sum((q @ self.N) * u, axis=1)
        return -2.0 * rate[:, 0] * (lever + u @ self.V if self.has_axial else lever)


def foam(integrals: ModalIntegrals) -> FirstOrderEquations:
    """FOAM, Eqs. (24)-(34) without (35)-(39) of Bai et al. (2009): axial and transverse coordinates, stiffening."""
    m = integrals
    zero = np.zeros_like(m.M1)
    return FirstOrderEquations(
        rigid_inertia=m.inertia,
        M=block_diagonal(m.M1, m.M2),
        N=block_diagonal(m.M1, m.M2 - m.D),
        B=blocks([[zero, m.R], [-m.R.T, zero]]),
        C=block_diagonal(m.C1, m.C2),
        K=block_diagonal(m.K1, m.K2),
        V=np.concatenate([m.V1, np.zeros_like(m.V2)]),
        W=np.concatenate([np.zeros_like(m.V1), m.V2]),
        keeps_inertia_torque=True,
        has_axial=True,
        tip=Tip(
            transverse=np.concatenate([np.zeros_like(m.tip1), m.tip2]),
            axial=np.concatenate([m.tip1, np.zeros_like(m.tip2)]),
            shortening=block_diagonal(zero, m.S_tip),
        ),
    )


def sfoam(integrals: ModalIntegrals, *, consistent: bool = False) -> FirstOrderEquations:
    """SFOAM, Eq. (40) of Bai et al. (2009), or its energy-consistent variant.

    Parameters
    ----------
    integrals : ModalIntegrals
    consistent : bool
        Include ``Q_theta`` of Eq. (32), which Eq. (40) omits: energy and angular momentum are then conserved.
    """
    return replace(without_axial_modes(foam(integrals)), keeps_inertia_torque=consistent)


def without_axial_modes(equations: FirstOrderEquations) -> FirstOrderEquations:
    """Return the equations of an inextensible beam: the transverse coordinates, which are the last half."""
    n = len(equations.M) // 2
    tip = equations.tip
    return replace(
        equations,
        **{name: getattr(equations, name)[n:, n:] for name in "MNBCK"},
        V=equations.V[n:],
        W=equations.W[n:],
        has_axial=False,
        tip=Tip(transverse=tip.transverse[n:], axial=tip.axial[n:], shortening=tip.shortening[n:, n:]),
    )


def tlam(integrals: ModalIntegrals) -> FirstOrderEquations:
    """TLAM, FOAM of Bai et al. (2009) without the underlined terms in Eqs. (25), (31) and (32): no matrix D."""
    whole = foam(integrals)
    shapeless = whole.tip._replace(shortening=np.zeros_like(whole.tip.shortening))
    return replace(whole, N=block_diagonal(integrals.M1, integrals.M2), tip=shapeless)
