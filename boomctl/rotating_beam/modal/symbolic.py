"""Equations of motion derived from the energies by CasADi's automatic differentiation."""

from typing import TYPE_CHECKING

import numpy as np

from boomctl.rotating_beam.modal.energy import complete_energy, elastic_energy, first_order_energy
from boomctl.rotating_beam.modal.equations import block_diagonal
from boomctl.rotating_beam.modal.integrals import mass_points

if TYPE_CHECKING:
    import casadi

    from boomctl.rotating_beam.beam import HubBeam


def residual_function(beam: "HubBeam") -> "casadi.Function":
    """Left-hand sides of Lagrange's equations (23) as a CasADi function ``(y, rate, acceleration) -> residual``.

    Parameters
    ----------
    beam : HubBeam
        SFOAM as printed gets its hub equation without the terms in the rates, as in Eq. (40).
    """
    import casadi as ca

    y, rate, acceleration, residual = _lagrange(beam)
    return ca.Function("residual", [y, rate, acceleration], [residual], ["y", "rate", "acceleration"], ["residual"])


def energy_function(beam: "HubBeam") -> "casadi.Function":
    """Kinetic and elastic energy [J] as a CasADi function ``(y, rate) -> (kinetic, elastic)``."""
    import casadi as ca

    y, rate = ca.SX.sym("y", beam.equations.size), ca.SX.sym("rate", beam.equations.size)
    return ca.Function("energy", [y, rate], list(_energies(beam, y, rate)), ["y", "rate"], ["kinetic", "elastic"])


def state_function(beam: "HubBeam") -> "casadi.Function":
    """The model as a CasADi function ``(x, torque) -> (xdot, y)``; see `HubBeam.casadi_function`."""
    import casadi as ca

    y, rate, acceleration, residual = _lagrange(beam)
    torque, size = ca.SX.sym("torque"), beam.equations.size
    mass = ca.jacobian(residual, acceleration)
    force = -ca.substitute(residual, acceleration, ca.SX.zeros(size))
    force[0] += torque
    reduced = _solve_beam(mass[1:, 1:], ca.horzcat(force[1:], mass[1:, 0]))
    margin = mass[0, 0] - ca.mtimes(mass[0, 1:], reduced[:, 1])
    turning = (force[0] - ca.mtimes(mass[0, 1:], reduced[:, 0])) / margin
    xdot = ca.vertcat(rate, turning, reduced[:, 0] - reduced[:, 1] * turning)
    outputs = ca.vertcat(y[0], rate[0], ca.dot(beam.equations.tip.transverse, y[1:]))
    x = ca.vertcat(y, rate)
    state = ca.SX.sym("x", 2 * size)
    xdot, outputs = ca.substitute([xdot, outputs], [x], [state])
    return ca.Function(f"hub_beam_{beam.model.replace('-', '_')}", [state, torque], [xdot, outputs], *_STATE_NAMES)


_STATE_NAMES = ["x", "torque"], ["xdot", "y"]


def _solve_beam(mass: "casadi.SX", right: "casadi.SX") -> "casadi.SX":
    """``mass^-1 right``; by a constant inverse if the beam's mass matrix is constant."""
    import casadi as ca

    if mass.is_constant():
        return ca.mtimes(ca.SX(np.linalg.inv(np.array(ca.DM(mass)))), right)
    diagonal, factor, order = ca.ldl(ca.densify(mass), False)
    return ca.ldl_solve(right, diagonal, factor, order)


def _lagrange(beam: "HubBeam") -> tuple["casadi.SX", "casadi.SX", "casadi.SX", "casadi.SX"]:
    import casadi as ca

    size = beam.equations.size
    y, rate, acceleration = (ca.SX.sym(name, size) for name in ("y", "rate", "acceleration"))
    kinetic, elastic = _energies(beam, y, rate)
    momenta = ca.gradient(kinetic, rate)
    residual = ca.jtimes(momenta, ca.vertcat(y, rate), ca.vertcat(rate, acceleration))
    residual += ca.gradient(elastic - kinetic, y)
    if beam.model == "sfoam":
        residual[0] = ca.substitute(residual[0], rate, ca.SX.zeros(size))
    m = beam.integrals
    damping = block_diagonal(m.C1, m.C2) if beam.has_axial_modes else m.C2
    residual[1:] += ca.mtimes(ca.DM(damping), rate[1:])
    return y, rate, acceleration, residual


def _energies(beam: "HubBeam", y: "casadi.SX", rate: "casadi.SX") -> tuple["casadi.SX", "casadi.SX"]:
    m, axial = beam.integrals, beam.has_axial_modes
    elastic = elastic_energy(block_diagonal(m.K1, m.K2) if axial else m.K2, y)
    if beam.model == "cfoam":
        points = mass_points(beam.parameters, beam.modes)
        return complete_energy(points, beam.parameters.hub_inertia, y, rate), elastic
    return first_order_energy(m, y, rate, stiffening=beam.model != "tlam", axial=axial), elastic
