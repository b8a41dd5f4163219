"""Sweeps over a window of steps: every mode's motion is exact for given forces, and these follow from the motion.

A sweep takes the forces at all nodes of the window, moves the modes through it and takes the forces anew (Picard's
iteration in the frame that moves with the linear motion). What is not linear is weak, and a sweep's error goes down with
the factorial of their number.
"""

from dataclasses import dataclass
from typing import final

import numpy as np

from boomctl.arrays import Array
from boomctl.rotating_beam.motion.free_modes import FreeModes
from boomctl.rotating_beam.motion.oscillators import Flow, coordinates

_SWEEPS = 40  # where a window is given up: 6 to 25 are taken (measured), and a shorter window takes fewer
_NEAR = 10.0  # times what may be left: such a change is the last where it was also smaller by that than the one before


@final
@dataclass(frozen=True, eq=False)
class Swept:
    """Motion through a window of m equal steps with s nodes.

    Attributes
    ----------
    flow : Flow
    torque : ndarray, m s
        At the nodes, N m.
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
    """Sweep until the next sweep would change too little; None where that does not happen.

    Parameters
    ----------
    modes : FreeModes
    flow : Flow
    start : complex ndarray, 1 + n
        Modal state at the beginning.
    torque : ndarray, m s
        At the nodes, N m.
    watched : tuple of ndarray, r x (1 + n) each
        Rows over coordinates, and over rates, over what may be left of their change: 1 is enough.
    force : ndarray, (1 + n) x m x s
        Where to begin.
    """
    change, seen, impulses = np.inf, None, None
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        for sweep in range(1, _SWEEPS + 1):
            states = flow.states(force, start, impulses)
            z, rate = flow.at_nodes(force, states)
            if flow.fast.any():
                begin = flow.beginning(flow.vibrations(force, states))
                impulses = modes.impulses(coordinates(modes.rates, states)[0], begin)
            following, solvable = modes.forces(z, rate, torque)
            last, before, seen = seen, change, np.concatenate([watched[0] @ z, watched[1] @ rate])
            if last is not None:
                change = float(np.abs(seen - last).max())
            if change <= 1.0 or (before < np.inf and change <= min(_NEAR, before / _NEAR)):
                return Swept(flow, torque, force, states, z, rate, sweep) if (solvable > 0.0).all() else None
            if np.isnan(change):
                return None
            force = following.reshape(force.shape)
    return None
