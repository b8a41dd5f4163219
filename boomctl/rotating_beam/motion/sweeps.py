"""Sweeps over a window of steps: every mode's motion is exact for given forces, and these follow from the motion.

A sweep takes the forces at all nodes of the window, moves the modes through it and takes the forces anew (Picard's
iteration in the frame that moves with the linear motion). What is not linear is weak, and a sweep's error goes down with
the factorial of their number.
"""

from dataclasses import dataclass
from typing import Self, final

import numpy as np

from boomctl.arrays import Array
from boomctl.rotating_beam.motion.free_modes import FreeModes
from boomctl.rotating_beam.motion.oscillators import Flow

_SWEEPS = 40  # where a window is given up: 6 to 25 are taken (measured), and a shorter window takes fewer
_NEAR = 10.0  # times what may be left: such a change is the last where it was also smaller by that than the one before


@final
@dataclass(frozen=True, eq=False)
class Window:
    """Equal steps of b scenes, each with its own beginning, length, torque and modes.

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

    def take(self, which: Array) -> Self:
        """The window of some of the scenes."""
        kept = (each[which] for each in (self.start, self.torque, self.rows, self.speed))
        return type(self)(self.modes.take(which), self.flow.take(which), *kept)


@final
@dataclass(frozen=True, eq=False)
class Swept:
    """Motion through a window.

    Attributes
    ----------
    settled : ndarray of bool, b
        Whether the sweeps have; where not, all else is meaningless.
    force : ndarray, b x (1 + n) x m x s
        Modal forces at the nodes.
    states : complex ndarray, b x (1 + n) x (m + 1)
        Modal states at the ends of the steps.
    z, rate : ndarray, b x (1 + n) x (m s)
        Modal coordinates and rates at the nodes, without the vibrations of fast modes.
    sweeps : ndarray of int, b
    """

    settled: Array
    force: Array
    states: Array
    z: Array
    rate: Array
    sweeps: Array


def settle(window: Window, force: Array) -> Swept:
    """Sweep until the next sweep would change too little; each scene is left alone once it has settled.

    Parameters
    ----------
    window : Window
    force : ndarray, b x (1 + n) x m x s
        Where to begin.
    """
    left, active, shape = window, np.arange(force.shape[0]), force.shape
    settled, sweeps = np.zeros(active.size, dtype=bool), np.zeros(active.size, dtype=int)
    kept: list[tuple[Array, tuple[Array, Array, Array, Array]]] = []
    change = np.full(active.size, np.inf)
    watched: Array | None = None
    impulses: Array | None = None
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        for sweep in range(1, _SWEEPS + 1):
            states = left.flow.states(force, left.start, impulses)
            z, rate = left.flow.at_nodes(force, states)
            if left.flow.any_fast:
                begin = left.flow.beginning(left.flow.vibrations(force, states))
                impulses = left.modes.impulses(left.modes.oscillators.coordinates(states)[0], begin)
            following, solvable = left.modes.forces(z, rate, left.torque)
            seen = np.concatenate([left.rows @ z, left.speed[:, None, None] * left.modes.hub_speed(rate)], axis=1)
            before = change
            if watched is not None:
                change = np.abs(seen - watched).reshape(len(seen), -1).max(axis=1)
            watched = seen
            done = (change <= 1.0) | (change <= np.minimum(_NEAR, before / _NEAR)) & (before < np.inf)
            stop = done | np.isnan(change) | (sweep == _SWEEPS)
            if stop.any():
                which = active[stop]
                valid = (solvable > 0.0).all(axis=(1, 2))
                settled[which], sweeps[which] = (done & valid)[stop], sweep
                if stop.all():
                    kept.append((which, (force, states, z, rate)))
                    break
                kept.append((which, (force[stop], states[stop], z[stop], rate[stop])))
                stay = ~stop
                active, left, change, watched = active[stay], left.take(stay), change[stay], watched[stay]
                following = following[stay]
                impulses = None if impulses is None else impulses[stay]
            force = following.reshape(-1, *shape[1:])
    if len(kept) == 1:
        return Swept(settled, *kept[0][1], sweeps)
    order = np.argsort(np.concatenate([which for which, _ in kept]))
    force, states, z, rate = (np.concatenate([arrays[i] for _, arrays in kept])[order] for i in range(4))
    return Swept(settled, force, states, z, rate, sweeps)
