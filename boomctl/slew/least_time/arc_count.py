"""Number of arcs of a nonlinear plant's minimum-time torque, by successive linear programming."""

from itertools import groupby
from operator import itemgetter

import numpy as np
from scipy.optimize import linprog

from boomctl.arrays import Array
from boomctl.exceptions import SlewError
from boomctl.slew.end_map import EndMap, Steps
from boomctl.slew.problem import AT_LIMIT
from boomctl.slew.torque import TorqueProfile, held

_TURNS = 25  # linear programs at most
_FARTHEST = 0.05  # trust region: largest relative change of the duration by one linear program
_PENALTY = 100.0  # penalty of a scaled terminal residual, relative to that of a relative change of the duration
_STEP = 1.5  # largest phase of the fastest mode in a step [rad]: coarser than for the final durations
_SETTLED, _MET = 1e-7, 1e-5  # relative change of the duration, and scaled terminal residual, at convergence


def counted(ends: EndMap, first: TorqueProfile, intervals: int) -> TorqueProfile | None:
    """Return a bang-bang torque that reaches the target to within the error of the grid; None if none is found.

    The torque values on equal intervals and the duration are improved by linear programs, which minimize the duration
    subject to the terminal conditions linearized along the current motion. Their solutions are at the torque limit on all
    but a few intervals, so few iterations are needed.
    """
    duration, limit = first.duration, ends.problem.limits.torque
    values = first.interval_means(np.linspace(0.0, duration, intervals + 1)) / limit
    parts = max(1, int(np.ceil(duration * ends.step_frequency / intervals / _STEP)))
    for _ in range(_TURNS):
        ends.problem.deadline.check(f"counting arcs on {intervals} intervals")
        count = intervals * parts
        steps = Steps(np.repeat(values * limit, parts), np.full(count, duration / count), np.zeros((count, 0)))
        result = ends.sensitivity(steps)
        if not (np.isfinite(result.by_torque).all() and np.isfinite(result.by_width).all()):
            raise SlewError(
                f"torque_limit = {limit:g} N m: bends the plant until its motion overflows; expected a smaller one, or "
                "a start nearer to rest"
            )
        defect = result.end - ends.target
        push = result.by_torque.reshape(defect.size, intervals, parts).sum(axis=2) * limit
        change = _linear_program(defect, push, result.by_width.sum(axis=1) * duration / count, values)
        if change is None:
            return None
        values, longer = np.clip(values + change[:-1], -1.0, 1.0), float(change[-1])
        duration *= 1.0 + longer
        if abs(longer) < _SETTLED and np.abs(defect).max() < _MET:
            break
    return arcs_behind(values, duration, limit)


def _linear_program(defect: Array, push: Array, longer: Array, values: Array) -> Array | None:
    """Return the changes of the values and the relative change of the duration; a terminal residual is penalized."""
    m, count = push.shape
    scale = np.maximum(np.linalg.norm(push, axis=1), 1e-300)[:, None]
    matrix = np.column_stack([push / scale, longer / scale[:, 0], np.eye(m), -np.eye(m)])
    cost = np.concatenate([np.zeros(count), [1.0], np.full(2 * m, _PENALTY)])
    bounds = np.vstack(
        [
            np.column_stack([-1.0 - values, 1.0 - values]),
            [[-_FARTHEST, _FARTHEST]],
            np.column_stack([np.zeros(2 * m), np.full(2 * m, np.inf)]),
        ]
    )
    answer = linprog(cost, A_eq=matrix, b_eq=-defect / scale[:, 0], bounds=bounds, method="highs-ds")
    return answer.x[: count + 1] if answer.status == 0 else None


def arcs_behind(values: Array, duration: float, limit: float) -> TorqueProfile:
    """Return the bang-bang torque for torque fractions on equal intervals: partial ones set switches by their mean."""
    kind = np.where(np.abs(values) > AT_LIMIT, np.sign(values), 0.0)
    first = np.flatnonzero(np.diff(kind, prepend=np.nan))
    signs, counts = kind[first], np.diff(first, append=values.size)
    arcs: list[tuple[float, float]] = []  # signs and lengths
    for k, (sign, mean) in enumerate(zip(signs, np.add.reduceat(values, first) / counts, strict=True)):
        length = float(counts[k]) * duration / values.size
        before = arcs[-1][0] if arcs else float(sign or np.sign(values[0]) or 1.0)
        after = float(signs[k + 1]) if k + 1 < signs.size else before
        own = 0.5 * length * (1.0 + before * mean)  # length with the sign before
        if sign:
            arcs.append((float(sign), length))
        elif before == after:
            arcs += [(before, 0.5 * own), (-before, length - own), (before, 0.5 * own)]
        else:
            arcs += [(before, own), (after, length - own)]
    joined = [(sign, sum(length for _, length in same)) for sign, same in groupby(arcs, key=itemgetter(0))]
    edges = np.cumsum([0.0, *(length for _, length in joined)])
    return held(edges, limit * np.array([sign for sign, _ in joined]))
