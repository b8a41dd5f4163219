"""The geometrically exact beam as CasADi expressions: its energies, and the points of its axis."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from boomctl.arrays import Array
from boomctl.rotating_beam.exact.basis import StrainBasis, place_rows
from boomctl.rotating_beam.modal.energy import Lagrangian
from boomctl.rotating_beam.modal.forced import Place, Places
from boomctl.rotating_beam.parameters import HubBeamParameters

if TYPE_CHECKING:
    import casadi


def exact_lagrangian(basis: StrainBasis, damping: Array | None) -> Lagrangian:
    """Return the energies; the kinetic one in the frame of the hub, whose angle it does not depend on."""
    import casadi as ca

    rows, size = basis.integration, basis.coordinates
    kernel = ca.DM(rows.T @ (basis.point_masses[:, None] * rows))
    rotation, stretch = (ca.sparsify(ca.DM(each)) for each in (basis.rotation, basis.stretch))

    def kinetic(y: casadi.SX, rate: casadi.SX) -> casadi.SX:
        angle = ca.mtimes(rotation[:, 1:], y[1:])
        long, longer = 1.0 + ca.mtimes(stretch, y), ca.mtimes(stretch, rate)
        turned, cosine, sine = ca.mtimes(rotation, rate) * long, ca.cos(angle), ca.sin(angle)
        along, across = longer * cosine - turned * sine, longer * sine + turned * cosine
        energy = ca.bilin(kernel, along, along) + ca.bilin(kernel, across, across)
        return 0.5 * (energy + basis.hub_inertia * rate[0] ** 2)

    return Lagrangian(
        kinetic=kinetic,
        stiffness=np.diag(basis.stiffness[1:]),
        damping=np.zeros((size - 1, size - 1)) if damping is None else damping[1:, 1:],
        tip=np.zeros(size - 1),
        keeps_inertia_torque=True,
    )


def exact_places(parameters: HubBeamParameters, basis: StrainBasis, modes: int) -> Places:
    """Return the points of the beam's axis."""
    import casadi as ca

    def place(q: casadi.SX, x: float) -> Place:
        here = place_rows(parameters, modes, x)
        angle = ca.mtimes(ca.DM(basis.rotation[:, 1:]), q)
        long = 1.0 + ca.mtimes(ca.DM(basis.stretch[:, 1:]), q)
        row = ca.DM(here.integration[None])
        return Place(
            along=ca.mtimes(row, long * ca.cos(angle)),
            across=ca.mtimes(row, long * ca.sin(angle)),
            slope=ca.mtimes(ca.DM(here.rotation[None]), q),
            curvature=ca.mtimes(ca.DM(here.curvature[None]), q),
            stretch=ca.mtimes(ca.DM(here.stretch[None]), q),
        )

    return place
