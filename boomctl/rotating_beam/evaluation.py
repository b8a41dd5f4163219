"""Everything a result shows, computed from coordinates and rates at the instants asked for."""

import numpy as np

from boomctl.arrays import Array
from boomctl.rotating_beam.manoeuvres import Free, PrescribedMotion, SineTorque, Torque, TorqueDriven
from boomctl.rotating_beam.modal.equations import Equations
from boomctl.rotating_beam.motion.run import ModalMotion, Motion
from boomctl.rotating_beam.result import Details

_CHUNK = 2048


def details(
    equations: Equations,
    manoeuvre: PrescribedMotion | TorqueDriven,
    timepts: Array,
    motion: Motion | ModalMotion,
) -> Details:
    """Evaluate a motion.

    Parameters
    ----------
    equations : Equations
    manoeuvre : PrescribedMotion or TorqueDriven
    timepts : ndarray, k
        Instants, s.
    motion : Motion or ModalMotion
    """
    y, rate = motion.y, motion.rate
    pieces = [
        _inertial(equations, manoeuvre, timepts[at], y[at], rate[at])
        for at in (slice(first, first + _CHUNK) for first in range(0, timepts.size, _CHUNK))
    ]
    torque, turning, inertia_torque, energy, momentum, margin = (
        np.concatenate(each) for each in zip(*pieces, strict=True)
    )
    q, tip = y[:, 1:], equations.tip
    return Details(
        axial_tip_displacement=q @ tip.axial,
        foreshortening=-0.5 * np.sum((q @ tip.shortening) * q, axis=1),
        hub_angle=y[:, 0],
        hub_speed=rate[:, 0],
        hub_acceleration=turning,
        torque=torque,
        inertia_torque=inertia_torque,
        energy=energy,
        angular_momentum=momentum,
        mass_matrix_margin=margin,
        states=np.hstack([y, rate]),
    )


def _inertial(
    equations: Equations,
    manoeuvre: PrescribedMotion | TorqueDriven,
    timepts: Array,
    y: Array,
    rate: Array,
) -> tuple[Array, ...]:
    """Torque, hub acceleration, Q_theta, energy, angular momentum and margin, each k."""
    inertia = equations.inertia(y)
    free = -equations.residual(y, rate, np.zeros_like(y))
    if isinstance(manoeuvre, SineTorque | Torque | Free):
        torque = manoeuvre.torque(timepts)
        free[:, 0] += torque
        loose = free[:, 0] - np.sum(inertia.coupling * inertia.solve_beam(free[:, 1:]), axis=1)
        turning = loose / inertia.margin()
    else:
        turning = manoeuvre.acceleration(timepts)
        bending = inertia.solve_beam(free[:, 1:] - inertia.coupling * turning[:, None])
        torque = inertia.hub * turning + np.sum(inertia.coupling * bending, axis=1) - free[:, 0]
    momenta = inertia.momenta(rate)
    q = y[:, 1:]
    energy = 0.5 * np.sum(momenta * rate, axis=1) + 0.5 * np.sum((q @ equations.beam_stiffness) * q, axis=1)
    return torque, turning, equations.inertia_torque(y, rate), energy, momenta[:, 0], inertia.margin()
