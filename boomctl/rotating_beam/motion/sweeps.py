"""Sweeps over a window of steps: every mode's motion is exact for known forces, which depend on the motion.

Two orders are swept on the same nodes: in the lower one the forces lack their two highest Legendre terms.  It joins when the
higher one has nearly converged, for both are nearly the same motion.

A sweep evaluates the forces at all nodes of the window, integrates the modes through it and evaluates the forces again
(Picard's iteration in the frame that moves with the linear motion). The nonlinear terms are weak, and the error falls with
the factorial of the number of sweeps.
"""

from typing import NamedTuple

import numpy as np

from boomctl.arrays import Array
from boomctl.gauss import gauss_method
from boomctl.rotating_beam.motion.free_modes import FreeModes
from boomctl.rotating_beam.motion.oscillators import Flow, coordinates

_ITERATIONS = 40  # Most sweeps of a window: 6 to 25 are normal, and a shorter window takes fewer.
_CLOSE = 100.0  # Change over the tolerance at which the lower order joins: both then take three or four more sweeps.
_LEFT = 0.1  # Predicted error over the tolerance at which sweeps stop: the change falls at the rate of the last sweep.


class Swept(NamedTuple):
    """Motion through a window of m equal steps with s nodes, in k orders: the higher one, or both.

    Attributes
    ----------
    force : ndarray, (1 + n) x k x m x s
        Modal forces at the nodes.
    states : complex ndarray, (1 + n) x k x (m + 1)
        Modal states at the ends of the steps.
    both : ndarray, 2 x (1 + n) x (k m s)
        Modal coordinates, and rates, at the nodes, without the vibrations of fast modes.
    """

    force: Array
    states: Array
    both: Array


def swept(flow: Flow, start: Array, force: Array, impulses: Array | None = None) -> Swept:
    """Return the motion by known forces.

    Parameters
    ----------
    flow : Flow
    start : complex ndarray, (1 + n) x 2
        Modal state of both orders at the beginning.
    force : ndarray, (1 + n) x k x m x s
        Modal forces at the nodes; of the lower order, the two highest terms are removed here.
    impulses : ndarray, (1 + n) x k x (m + 1), optional
        As for `Flow.states`.
    """
    orders = force.shape[1]
    if orders > 1:
        force[:, 1] -= force[:, 1] @ gauss_method(force.shape[-1]).highest.T
    states = flow.states(force, start[:, :orders], impulses)
    return Swept(force, states, flow.at_nodes(force, states))


def settle(
    modes: FreeModes, flow: Flow, start: Array, motion: Swept, torque: Array, watched: Array
) -> tuple[Swept, int] | None:
    """Sweep until the change is below the tolerance; return both orders and number of sweeps, None if it stays above.

    Parameters
    ----------
    modes : FreeModes
    flow : Flow
    start : complex ndarray, (1 + n) x 2
        As for `swept`.
    motion : Swept
        Motion of the higher order without nonlinear forces.
    torque : ndarray, m s
        Torque at the nodes, N m.
    watched : ndarray, r x 2 x (1 + n)
        Rows over coordinates and rates, scaled so that a change of 1 is the tolerance.
    """
    impulses, vibrating, orders, rows = None, bool(flow.fast.any()), 1, watched.reshape(len(watched), -1)
    change, values = np.inf, rows @ motion.both.reshape(rows.shape[1], -1)
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        for sweep in range(2, _ITERATIONS + 1):
            if vibrating:
                begin = flow.beginning(flow.vibrations(motion.force, motion.states))
                z = coordinates(modes.rates, motion.states)[0]
                impulses = modes.impulses(z.reshape(len(z), -1), begin.reshape(len(begin), -1)).reshape(z.shape)
            force, solvable = modes.forces(*motion.both, torque)
            force = force.reshape(motion.force.shape)
            if orders == 1 and change <= _CLOSE:
                orders, torque, values, force = 2, np.tile(torque, 2), np.tile(values, 2), np.repeat(force, 2, axis=1)
            motion = swept(flow, start, force, impulses)
            last, before, values = values, change, rows @ motion.both.reshape(rows.shape[1], -1)
            change = float(np.abs(values - last).max())
            if orders == 2 and (change <= _LEFT or change * change <= _LEFT * before):
                return (motion, sweep) if (solvable > 0.0).all() else None
            if np.isnan(change):
                return None
    return None
