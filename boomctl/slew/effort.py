"""Least effort of a nonlinear plant within the torque's limit: a torque held on equal intervals.

Torques u lead to an end e(u). About any of them the least effort that the first derivatives G allow is a closed form,
clipped at the limit; it is taken again and again (Gauss and Newton's method). What is not linear in a slew is weak: each
turn gains two digits (measured, also with tips that go out to half of the length). Where it ends, ``u = clip(G^T c)``
leads to the target: the conditions of the optimum on the mesh. They are exact, for G is.
"""

import numpy as np

from boomctl.arrays import Array
from boomctl.lti.rounding import ALIKE
from boomctl.slew.least_time.arcs import Steps, end_map
from boomctl.slew.linear import clipped, least_effort
from boomctl.slew.problem import SlewProblem
from boomctl.slew.torque import TorqueHistory, held

_TURNS = 20  # at most; a safeguard
_STATIONARY = 1e-6  # of the torque limit, that another turn would change: of the effort it is worth the square of that
_CHORDS = 6  # corrections with derivatives of coarser steps at most; one or none does
_CLOSED = 1e-3  # of the tolerance: defect of the scaled end after them
_STEP_SHARE = 0.5  # of the tolerance, for what half as long steps change; what remains is a sixteenth of it
_MOST_STEPS = 20000  # of a motion: a safeguard, for rounding grows with them


def effort_on_mesh(problem: SlewProblem, duration: float, intervals: int) -> tuple[TorqueHistory, float] | None:
    """The torque of least effort in a given time [s] on a mesh; None where it was not found, or the limit is too low.

    Steps are halved until the end stays where it is, within the tolerance. With the torque comes by how much more effort
    it would take, relative, if it were held on two intervals at a time: by the derivatives along its motion, infinite
    where that does not lead to the end.
    """
    limit, tolerance = problem.limits.torque, problem.tolerance
    first = least_effort(problem, duration, intervals).history
    ends = end_map(problem, first)
    u, weights, size = first.left, None, np.inf
    parts = max(1, int(np.ceil(duration * ends.step_frequency / intervals)))

    def steps(parts: int) -> Steps:
        count = intervals * parts
        return Steps(np.repeat(u, parts), np.full(count, duration / count), np.zeros((count, 0)))

    for _ in range(_TURNS):
        reached = ends.sensitivity(steps(parts))
        G = reached.by_torque.reshape(-1, intervals, parts).sum(axis=2)
        if not np.isfinite(G).all():
            return None
        found = clipped(G, G @ u + ends.target - reached.end, limit, weights)
        before, size = size, float(np.abs(found.torques - u).max()) / limit
        if found.missed > ALIKE or size > before:
            return None
        u, weights = found.torques, found.weights
        if size * (size / before if before < np.inf else 1.0) <= _STATIONARY:  # what the next turn would change
            break
    else:
        return None
    while True:
        parts *= 2
        if parts * intervals > _MOST_STEPS:
            return None
        defects = [ends.defect(steps(parts))]
        while np.abs(defects[-1]).max() > _CLOSED * tolerance and len(defects) <= _CHORDS:
            found = clipped(G, G @ u - defects[-1], limit, weights)
            u, weights = found.torques, found.weights
            defects.append(ends.defect(steps(parts)))
        before, after = (float(np.abs(defects[k]).max()) for k in (0, -1))
        if not after <= _STEP_SHARE * tolerance:
            return None
        if before <= _STEP_SHARE * tolerance:
            break
    return held(np.linspace(0.0, duration, intervals + 1), u), _joined(G, u, limit)


def _joined(G: Array, u: Array, limit: float) -> float:
    """More effort, relative, of torques on two intervals at a time (the last of an odd number is left alone)."""
    first = np.arange(0, u.size, 2)
    root = np.sqrt(np.diff(np.append(first, u.size)))
    found = clipped(np.add.reduceat(G, first, axis=1) / root, G @ u, limit * root)
    return float(np.sum(found.torques**2) / np.sum(u**2)) - 1.0 if found.missed <= ALIKE else np.inf
