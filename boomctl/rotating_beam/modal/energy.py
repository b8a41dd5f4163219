"""Energies of every model as CasADi expressions, and the equations of motion that follow by differentiation."""

from collections.abc import Callable
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from boomctl.arrays import Array
from boomctl.rotating_beam.modal.integrals import MassPoints, ModalIntegrals

if TYPE_CHECKING:
    import casadi


class Lagrangian(NamedTuple):
    """Energies from which Lagrange's equations (23) of Bai et al. (2009) are derived.

    Attributes
    ----------
    kinetic : callable
        Kinetic energy [J] of coordinates and rates, N each, as CasADi expressions.
    stiffness, damping : ndarray or casadi.SX, N - 1 x N - 1
        Matrices over the beam's coordinates: the elastic energy is ``1/2 q^T K q``, Eq. (22).
    tip : ndarray, N - 1
        Row of the free end's transverse displacement.
    keeps_inertia_torque : bool
        If False, the hub's equation omits the terms in the rates, as Eq. (40) does.
    """

    kinetic: "Callable[[casadi.SX, casadi.SX], casadi.SX]"
    stiffness: "Array | casadi.SX"
    damping: "Array | casadi.SX"
    tip: Array
    keeps_inertia_torque: bool


def first_order_energy(
    integrals: ModalIntegrals, y: "casadi.SX", rate: "casadi.SX", *, stiffening: bool, axial: bool
) -> "casadi.SX":
    """Return the kinetic energy to second order, Eq. (21) of Bai et al. (2009) without its last integral.

    Parameters
    ----------
    integrals : ModalIntegrals
    y, rate : casadi.SX, N
        Coordinates (hub angle, axial coordinates if any, transverse coordinates) and their rates.
    stiffening : bool
        Include D; TLAM omits it.
    axial : bool
        True if there are axial coordinates.

    Returns
    -------
    casadi.SX
        Energy, J.
    """
    import casadi as ca

    m, n = integrals, integrals.V2.shape[0]
    w, q2, u2 = rate[0], y[-n:], rate[-n:]
    mass2 = m.M2 - m.D if stiffening else m.M2
    energy = 0.5 * w**2 * (m.inertia + ca.bilin(mass2, q2, q2)) + w * ca.dot(m.V2, u2) + 0.5 * ca.bilin(m.M2, u2, u2)
    if axial:
        q1, u1 = y[1 : n + 1], rate[1 : n + 1]
        energy += w**2 * (ca.dot(m.V1, q1) + 0.5 * ca.bilin(m.M1, q1, q1)) + 0.5 * ca.bilin(m.M1, u1, u1)
        energy += w * (ca.bilin(m.R, q1, u2) - ca.bilin(m.R, u1, q2))
    return energy


def complete_energy(points: MassPoints, hub_inertia: float, y: "casadi.SX", rate: "casadi.SX") -> "casadi.SX":
    """Return the full kinetic energy, Eqs. (3), (8) and (9) of Bai et al. (2009) with (7) and (9) corrected.

    Parameters
    ----------
    points : MassPoints
        The masses summed over.
    hub_inertia : float
        J_h, kg m^2.
    y, rate : casadi.SX, N
        Coordinates and rates.

    Returns
    -------
    casadi.SX
        Energy, J.
    """
    import casadi as ca

    n = points.f1.shape[1]
    w, q1, q2, u1, u2 = rate[0], y[1 : n + 1], y[n + 1 :], rate[1 : n + 1], rate[n + 1 :]
    energy = 0.5 * hub_inertia * w**2
    for mass, radius, f1, f2, S in zip(points.mass, points.radius, points.f1, points.f2, points.S, strict=True):
        reach = radius + ca.dot(f1, q1) - 0.5 * ca.bilin(S, q2, q2)
        sliding = ca.dot(f1, u1) - ca.bilin(S, q2, u2)
        along = sliding - w * ca.dot(f2, q2)
        across = ca.dot(f2, u2) + w * reach
        energy += 0.5 * mass * (along**2 + across**2)
    return energy


def equations_of_motion(lagrangian: Lagrangian) -> tuple["casadi.SX", "casadi.SX", "casadi.SX", "casadi.SX"]:
    """Coordinates, rates, accelerations, and the left-hand sides of Lagrange's equations in them."""
    import casadi as ca

    size = lagrangian.tip.shape[0] + 1
    y, rate, acceleration = (ca.SX.sym(name, size) for name in ("y", "rate", "acceleration"))
    kinetic = lagrangian.kinetic(y, rate)
    elastic = 0.5 * ca.bilin(lagrangian.stiffness, y[1:], y[1:])
    momenta = ca.gradient(kinetic, rate)
    residual = ca.jtimes(momenta, ca.vertcat(y, rate), ca.vertcat(rate, acceleration))
    residual += ca.gradient(elastic - kinetic, y)
    if not lagrangian.keeps_inertia_torque:
        residual[0] = ca.substitute(residual[0], rate, ca.SX.zeros(size))
    residual[1:] += ca.mtimes(ca.SX(lagrangian.damping), rate[1:])
    return y, rate, acceleration, residual


def accelerations(
    lagrangian: Lagrangian,
) -> tuple["casadi.SX", "casadi.SX", "casadi.SX", "casadi.SX", "casadi.SX"]:
    """Coordinates, rates, forces on the coordinates, accelerations, and the margin of the mass matrix in them."""
    import casadi as ca

    y, rate, acceleration, residual = equations_of_motion(lagrangian)
    forces, size = ca.SX.sym("forces", y.numel()), y.numel()
    mass = ca.jacobian(residual, acceleration)
    force = forces - ca.substitute(residual, acceleration, ca.SX.zeros(size))
    reduced = _solve_beam(mass[1:, 1:], ca.horzcat(force[1:], mass[1:, 0]))
    margin = mass[0, 0] - ca.mtimes(mass[0, 1:], reduced[:, 1])
    turning = (force[0] - ca.mtimes(mass[0, 1:], reduced[:, 0])) / margin
    return y, rate, forces, ca.vertcat(turning, reduced[:, 0] - reduced[:, 1] * turning), margin


def state_function(lagrangian: Lagrangian, name: str, constants: "casadi.SX | None" = None) -> "casadi.Function":
    """Equations of motion as a CasADi function ``(x, torque, constants) -> (xdot, y)`` of that name.

    The state x has coordinates and rates; y is hub angle, hub speed and the displacement of the free end.  The constants
    are symbols in the energies; by default there are none.
    """
    import casadi as ca

    y, rate, forces, result, _ = accelerations(lagrangian)
    torque, size = ca.SX.sym("torque"), y.numel()
    result = ca.substitute(result, forces, ca.vertcat(torque, ca.SX.zeros(size - 1)))
    xdot = ca.vertcat(rate, result)
    outputs = ca.vertcat(y[0], rate[0], ca.dot(lagrangian.tip, y[1:]))
    x = ca.vertcat(y, rate)
    state = ca.SX.sym("x", 2 * size)
    xdot, outputs = ca.substitute([xdot, outputs], [x], [state])
    arguments = [state, torque, ca.SX(0, 1) if constants is None else constants]
    return ca.Function(name, arguments, [xdot, outputs], ["x", "torque", "constants"], ["xdot", "y"])


def _solve_beam(mass: "casadi.SX", right: "casadi.SX") -> "casadi.SX":
    """``mass^-1 right``; by a constant inverse if the beam's mass matrix is constant."""
    import casadi as ca

    if mass.is_constant():
        return ca.mtimes(ca.SX(np.linalg.inv(np.array(ca.DM(mass)))), right)
    diagonal, factor, order = ca.ldl(ca.densify(mass), False)
    return ca.ldl_solve(right, diagonal, factor, order)
