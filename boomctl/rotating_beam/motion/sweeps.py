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
from boomctl.rotating_beam.motion.oscillators import Flow

_SWEEPS = 40  # where a window is given up: 6 to 25 are taken (measured), and a shorter window takes fewer
_NEAR = 10.0  # times what may be left: such a change is the last where it was also smaller by that than the one before


@final
@dataclass(frozen=True, eq=False)
class Window:
    """Equal steps of b = 1 window.

    Attributes
    ----------
    modes : FreeModes
    flow : Flow
        Of m steps and s nodes.
    start : complex ndarray, b x (1 + n)
        Modal state at the beginning.
    torque : ndarray, b x 1 x (m s)
        At the nodes, N m.
    rows : ndarray, b x r x (1 + n)
        Displacements that are watched, over what may be left of their change: 1 is enough.
    speed : ndarray, b
        Likewise the hub speed, over rad/s.
    """

    modes: FreeModes
    flow: Flow
    start: Array
    torque: Array
    rows: Array
    speed: Array


@final
@dataclass(frozen=True, eq=False)
class Swept:
    """Motion through a window.

    Attributes
    ----------
    force : ndarray, b x (1 + n) x m x s
        Modal forces at the nodes.
    states : complex ndarray, b x (1 + n) x (m + 1)
        Modal states at the ends of the steps.
    z, rate : ndarray, b x (1 + n) x (m s)
        Modal coordinates and rates at the nodes, without the vibrations of fast modes.
    sweeps : int
    """

    force: Array
    states: Array
    z: Array
    rate: Array
    sweeps: int


def settle(window: Window, force: Array) -> Swept | None:
    """Sweep until the next sweep would change too little; None where that does not happen.

    Parameters
    ----------
    window : Window
    force : ndarray, b x (1 + n) x m x s
        Where to begin.
    """
    moved, modes, shape = window.flow, window.modes, force.shape
    change, watched, impulses = np.inf, None, None
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        for sweep in range(1, _SWEEPS + 1):
            states = moved.states(force, window.start, impulses)
            z, rate = moved.at_nodes(force, states)
            if moved.any_fast:
                begin = moved.beginning(moved.vibrations(force, states))
                impulses = modes.impulses(modes.oscillators.coordinates(states)[0], begin)
            following, solvable = modes.forces(z, rate, window.torque)
            seen = np.concatenate([window.rows @ z, window.speed[:, None, None] * modes.hub_speed(rate)], axis=1)
            before = change
            if watched is not None:
                change = float(np.abs(seen - watched).max())
            watched = seen
            if change <= 1.0 or (before < np.inf and change <= min(_NEAR, before / _NEAR)):
                return Swept(force, states, z, rate, sweep) if (solvable > 0.0).all() else None
            if np.isnan(change):
                return None
            force = following.reshape(shape)
    return None
