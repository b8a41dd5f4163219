"""Sweeps over a window of steps: every mode's motion is exact for known forces, which depend on the motion.

A sweep evaluates the forces at all nodes of the window, integrates the modes through it and evaluates the forces again
(Picard's iteration in the frame that moves with the linear motion). The nonlinear terms are weak, and the error falls with
the factorial of the number of sweeps.
"""

from dataclasses import dataclass
from typing import final

import numpy as np

from boomctl.arrays import Array
from boomctl.rotating_beam.motion.free_modes import FreeModes
from boomctl.rotating_beam.motion.oscillators import Flow, coordinates

_ITERATIONS = 40  # Most sweeps of a window: 6 to 25 are normal, and a shorter window takes fewer.
_NEAR = 10.0  # Change over the tolerance at which sweeps stop if it also fell by this factor in the last sweep.


@final
@dataclass(frozen=True, eq=False)
class Swept:
    """Motion through a window of m equal steps with s nodes.

    Attributes
    ----------
    flow : Flow
    torque : ndarray, m s
        Torque at the nodes, N m.
    force : ndarray, (1 + n) x m x s
        Modal forces at the nodes.
    states : complex ndarray, (1 + n) x (m + 1)
        Modal states at the ends of the steps.
    z, rate : ndarray, (1 + n) x (m s)
        Modal coordinates and rates at the nodes, without the vibrations of fast modes.
    sweeps : int
    """

    flow: Flow
    torque: Array
    force: Array
    states: Array
    z: Array
    rate: Array
    sweeps: int


def settle(
    modes: FreeModes, flow: Flow, start: Array, torque: Array, watched: tuple[Array, Array], force: Array
) -> Swept | None:
    """Sweep until the change is below the tolerance; return None if it stays above.

    Parameters
    ----------
    modes : FreeModes
    flow : Flow
    start : complex ndarray, 1 + n
        Modal state at the beginning.
    torque : ndarray, m s
        Torque at the nodes, N m.
    watched : tuple of ndarray, r x (1 + n) each
        Rows over coordinates, and over rates, scaled so that a change of 1 is the tolerance.
    force : ndarray, (1 + n) x m x s
        Initial modal forces.
    """
    change, values, impulses = np.inf, None, None
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        for sweep in range(1, _ITERATIONS + 1):
            states = flow.states(force, start, impulses)
            z, rate = flow.at_nodes(force, states)
            if flow.fast.any():
                begin = flow.beginning(flow.vibrations(force, states))
                impulses = modes.impulses(coordinates(modes.rates, states)[0], begin)
            following, solvable = modes.forces(z, rate, torque)
            last, before, values = values, change, np.concatenate([watched[0] @ z, watched[1] @ rate])
            if last is not None:
                change = float(np.abs(values - last).max())
            if change <= 1.0 or (before < np.inf and change <= min(_NEAR, before / _NEAR)):
                return Swept(flow, torque, force, states, z, rate, sweep) if (solvable > 0.0).all() else None
            if np.isnan(change):
                return None
            force = following.reshape(force.shape)
    return None
