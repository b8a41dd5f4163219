"""CFOAM, the complete first-order approximate model: all of the kinetic energy, summed over points of mass."""

from dataclasses import dataclass
from typing import NamedTuple, final

import numpy as np

from boomctl.arrays import Array
from boomctl.rotating_beam.modal.equations import Equations, Inertia, Tangents, Tip
from boomctl.rotating_beam.modal.first_order import foam, without_axial_modes
from boomctl.rotating_beam.modal.integrals import MassPoints, ModalIntegrals


class _Kinematics(NamedTuple):
    """Kinematics of the p points at k times; Su is ``S q_2'``; J is k x 2 x p x N."""

    J: Array
    Su: Array
    bias: Array


@final
@dataclass(frozen=True)
class CompleteEquations(Equations):
    """Equations of motion of CFOAM, Eqs. (24)-(39) of Bai et al. (2009), by the principle of virtual power.

    A point of the beam has the velocity ``J(q) y'`` in the hub's frame, with
    ``J = [[-v, f_1, -(S q_2)^T], [X, 0, f_2]]``, ``X = r_A + x + w_1 + w_c`` and ``v = f_2 q_2``, and the acceleration
    ``J y'' + b``; the equations are ``J_h a + sum m J^T (J y'' + b) + C q' + K q = tau``, without truncation.

    Attributes
    ----------
    hub_inertia : float
        J_h, kg m^2.
    points : MassPoints
        The masses summed over.
    M, C, K : ndarray, 2 n x 2 n
        Mass matrix of the straight beam, damping, stiffness.
    tip : Tip
    """

    hub_inertia: float
    points: MassPoints
    M: Array
    C: Array
    K: Array
    tip: Tip

    def inertia(self, y: Array) -> Inertia:
        mass = self._mass(self._kinematics(y, np.zeros_like(y)).J)
        return Inertia(mass[:, 0, 0], mass[:, 0, 1:], mass[:, 1:, 1:])

    def residual(self, y: Array, rate: Array, acceleration: Array) -> Array:
        moving = self._kinematics(y, rate)
        total = moving.bias + np.einsum("kdpi,ki->kdp", moving.J, acceleration)
        result = np.einsum("kdpi,kdp->ki", moving.J, self.points.mass * total)
        result[:, 0] += self.hub_inertia * acceleration[:, 0]
        result[:, 1:] += rate[:, 1:] @ self.C + y[:, 1:] @ self.K
        return result

    def tangents(self, y: Array, rate: Array, acceleration: Array) -> Tangents:
        moving = self._kinematics(y, rate)
        total = moving.bias + np.einsum("kdpi,ki->kdp", moving.J, acceleration)
        weighted = self.points.mass[:, None] * moving.J
        damping = _pair(weighted, self._bias_by_rate(moving, y, rate))
        stiffness = _pair(weighted, self._acceleration_by_coordinates(moving, rate, acceleration))
        stiffness += self._jacobian_by_coordinates(moving, self.points.mass * total)
        damping[:, 1:, 1:] += self.C
        stiffness[:, 1:, 1:] += self.K
        return Tangents(self._mass(moving.J), damping, stiffness)

    def inertia_torque(self, y: Array, rate: Array) -> Array:
        """Q_theta, Eqs. (32) and (37), k."""
        moving = self._kinematics(y, rate)
        return -np.einsum("kdp,kdp->k", moving.J[..., 0], self.points.mass * moving.bias)

    def _kinematics(self, y: Array, rate: Array) -> _Kinematics:
        points, n = self.points, self.points.f1.shape[1]
        q1, q2, u1, u2 = y[:, 1 : n + 1], y[:, n + 1 :], rate[:, 1 : n + 1], rate[:, n + 1 :]
        speed = rate[:, :1]
        Sq, Su = _times(points.S, q2), _times(points.S, u2)
        reach = points.radius + q1 @ points.f1.T - 0.5 * np.einsum("kpi,ki->kp", Sq, q2)
        deflection, rising = q2 @ points.f2.T, u2 @ points.f2.T
        sliding = u1 @ points.f1.T - np.einsum("kpi,ki->kp", Sq, u2)
        J = np.zeros((y.shape[0], 2, points.mass.size, self.size))
        J[:, 0, :, 0], J[:, 1, :, 0] = -deflection, reach
        J[:, 0, :, 1 : n + 1], J[:, 1, :, n + 1 :] = points.f1, points.f2
        J[:, 0, :, n + 1 :] = -Sq
        along = -np.einsum("kpi,ki->kp", Su, u2) - 2.0 * speed * rising - speed**2 * reach
        across = 2.0 * speed * sliding - speed**2 * deflection
        return _Kinematics(J, Su, np.stack([along, across], axis=1))

    def _mass(self, J: Array) -> Array:
        result = _pair(self.points.mass[:, None] * J, J)
        result[:, 0, 0] += self.hub_inertia
        return result

    def _bias_by_rate(self, moving: _Kinematics, y: Array, rate: Array) -> Array:
        """``db / dy'``, k x 2 x p x N."""
        n, speed = self.points.f1.shape[1], rate[:, :1, None]
        velocity = np.einsum("kdpi,ki->kdp", moving.J[..., 1:], rate[:, 1:])
        result = np.empty_like(moving.J)
        result[:, 0, :, 0] = -2.0 * (velocity[:, 1] + rate[:, :1] * moving.J[:, 1, :, 0])
        result[:, 1, :, 0] = 2.0 * (velocity[:, 0] + rate[:, :1] * moving.J[:, 0, :, 0])
        result[:, 0, :, 1:] = -2.0 * speed * moving.J[:, 1, :, 1:]
        result[:, 1, :, 1:] = 2.0 * speed * moving.J[:, 0, :, 1:]
        result[:, 0, :, n + 1 :] -= 2.0 * moving.Su
        return result

    def _acceleration_by_coordinates(self, moving: _Kinematics, rate: Array, acceleration: Array) -> Array:
        """``d(J y'' + b) / dy`` at given rates and accelerations, k x 2 x p x N."""
        n, speed, turning = self.points.f1.shape[1], rate[:, :1, None], acceleration[:, :1, None]
        along, across = moving.J[:, 0, :, 1:], moving.J[:, 1, :, 1:]  # also d(X, v) / dq
        result = np.zeros_like(moving.J)
        result[:, 0, :, 1:] = -turning * across - speed**2 * along
        result[:, 1, :, 1:] = turning * along - speed**2 * across
        result[:, 0, :, n + 1 :] -= _times(self.points.S, acceleration[:, n + 1 :])
        result[:, 1, :, n + 1 :] -= 2.0 * speed * moving.Su
        return result

    def _jacobian_by_coordinates(self, moving: _Kinematics, force: Array) -> Array:
        """``d(J^T force) / dy`` at a given force on the points, k x N x N."""
        n = self.points.f1.shape[1]
        result = np.zeros((force.shape[0], self.size, self.size))
        result[:, 0, 1:] = np.einsum("kpi,kp->ki", moving.J[:, 0, :, 1:], force[:, 1])
        result[:, 0, 1:] -= np.einsum("kpi,kp->ki", moving.J[:, 1, :, 1:], force[:, 0])
        transverse = self.points.f2.shape[1]
        flat = self.points.S.reshape(force.shape[2], transverse**2)
        result[:, n + 1 :, n + 1 :] = -(force[:, 0] @ flat).reshape(-1, transverse, transverse)
        return result


def cfoam(integrals: ModalIntegrals, points: MassPoints, hub_inertia: float) -> CompleteEquations:
    """CFOAM, Eqs. (24)-(39) of Bai et al. (2009).

    Parameters
    ----------
    integrals : ModalIntegrals
    points : MassPoints
        Of the same parameters and number of modes; without axial ones the beam does not stretch.
    hub_inertia : float
        J_h, kg m^2.
    """
    linear = foam(integrals)
    if not points.f1.size:
        linear = without_axial_modes(linear)
    return CompleteEquations(hub_inertia, points, linear.M, linear.C, linear.K, linear.tip)


def _times(S: Array, q: Array) -> Array:
    """Return ``S q`` at all points and times, k x p x n."""
    p, n, _ = S.shape
    return (q @ S.reshape(p * n, n).T).reshape(-1, p, n)


def _pair(left: Array, right: Array) -> Array:
    """Sum of ``left^T right`` over directions and points, k x N x N."""
    k, _, _, size = left.shape
    return left.reshape(k, -1, size).swapaxes(1, 2) @ right.reshape(k, -1, size)
