"""Kinetic and elastic energy of every model as CasADi expressions: what all equations follow from."""

from typing import TYPE_CHECKING

from boomctl.arrays import Array
from boomctl.rotating_beam.modal.integrals import MassPoints, ModalIntegrals

if TYPE_CHECKING:
    import casadi


def first_order_energy(
    integrals: ModalIntegrals, y: "casadi.SX", rate: "casadi.SX", *, stiffening: bool, axial: bool
) -> "casadi.SX":
    """Kinetic energy to second order in the beam's coordinates, Eq. (21) of Bai et al. (2009) less its last integral.

    Parameters
    ----------
    integrals : ModalIntegrals
    y, rate : casadi.SX, N
        Coordinates (hub angle, axial ones if there are, transverse ones) and their rates.
    stiffening : bool
        Whether D is kept: TLAM leaves it out.
    axial : bool
        Whether there are axial coordinates.

    Returns
    -------
    casadi.SX
        Energy, J.
    """
    import casadi as ca

    m, n = integrals, integrals.V2.size
    w, q2, u2 = rate[0], y[-n:], rate[-n:]
    mass2 = m.M2 - m.D if stiffening else m.M2
    energy = 0.5 * w**2 * (m.inertia + ca.bilin(mass2, q2, q2)) + w * ca.dot(m.V2, u2) + 0.5 * ca.bilin(m.M2, u2, u2)
    if axial:
        q1, u1 = y[1 : n + 1], rate[1 : n + 1]
        energy += w**2 * (ca.dot(m.V1, q1) + 0.5 * ca.bilin(m.M1, q1, q1)) + 0.5 * ca.bilin(m.M1, u1, u1)
        energy += w * (ca.bilin(m.R, q1, u2) - ca.bilin(m.R, u1, q2))
    return energy


def complete_energy(points: MassPoints, hub_inertia: float, y: "casadi.SX", rate: "casadi.SX") -> "casadi.SX":
    """All of the kinetic energy, Eqs. (3), (8) and (9) of Bai et al. (2009) with (7) and (9) mended.

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
        place = radius + ca.dot(f1, q1) - 0.5 * ca.bilin(S, q2, q2)
        sliding = ca.dot(f1, u1) - ca.bilin(S, q2, u2)
        along = sliding - w * ca.dot(f2, q2)
        across = ca.dot(f2, u2) + w * place
        energy += 0.5 * mass * (along**2 + across**2)
    return energy


def elastic_energy(stiffness: Array, y: "casadi.SX") -> "casadi.SX":
    """Elastic energy ``1/2 q^T K q``, Eq. (22), J.

    Parameters
    ----------
    stiffness : ndarray, N - 1 x N - 1
        Of the beam's coordinates.
    y : casadi.SX, N
        Coordinates.
    """
    import casadi as ca

    return 0.5 * ca.bilin(stiffness, y[1:], y[1:])
