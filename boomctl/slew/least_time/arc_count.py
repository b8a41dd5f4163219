"""How often a nonlinear plant's fastest torque changes its sign: linear programmes along its motion, one after the other."""

import numpy as np

from boomctl.arrays import Array
from boomctl.slew.least_time.arcs import Course
from boomctl.slew.result import SlewError
from boomctl.slew.torque import TorqueHistory, held

_TURNS = 25
_FARTHEST = 0.05
_PENALTY = 100.0
_FULL = 0.999


class Overflows(SlewError):
    """The motion on the way grows beyond all numbers."""


def steered(way: Course, first: TorqueHistory, intervals: int) -> TorqueHistory | None:
    """A bang-bang torque that leads to the end but for the grid's coarseness; None if none is found.

    On a grid of equal intervals the torque's values and the duration are improved by linear programmes: the end's
    derivatives along the motion so far, and the least duration that they allow. Their solutions sit at the torque's limit on
    all but a few intervals, so they settle in few turns.
    """
    duration, limit = first.duration, way.problem.torque_limit
    values = first.means(np.linspace(0.0, duration, intervals + 1)) / limit
    parts = max(1, int(np.ceil(duration * way.pace / intervals / 1.5)))
    for _ in range(_TURNS):
        count = intervals * parts
        reach = way.reach(np.repeat(values * limit, parts), np.full(count, duration / count))
        if not (np.isfinite(reach.by_torque).all() and np.isfinite(reach.by_width).all()):
            raise Overflows(
                f"torque_limit = {limit:g} N m: bends the plant until its motion overflows; expected a smaller one, or "
                "a start nearer to rest"
            )
        lack = reach.end - way.rows @ way.problem.target
        push = reach.by_torque.reshape(lack.size, intervals, parts).sum(axis=2) * limit
        change = _programme(lack, push, reach.by_width.sum(axis=1) * duration / count, values)
        if change is None:
            return None
        values, stretch = np.clip(values + change[:-1], -1.0, 1.0), float(change[-1])
        duration *= 1.0 + stretch
        if abs(stretch) < 1e-7 and np.abs(lack).max() < 1e-5:
            break
    return stretched(values, duration, limit)


def _programme(lack: Array, push: Array, stretch: Array, values: Array) -> Array | None:
    """Changes of the values and, relative, of the duration; what the end lacks may be left, at a price."""
    from scipy.optimize import linprog

    m, count = push.shape
    scale = np.maximum(np.linalg.norm(push, axis=1), 1e-300)[:, None]
    matrix = np.column_stack([push / scale, stretch / scale[:, 0], np.eye(m), -np.eye(m)])
    cost = np.concatenate([np.zeros(count), [1.0], np.full(2 * m, _PENALTY)])
    bounds = np.vstack(
        [
            np.column_stack([-1.0 - values, 1.0 - values]),
            [[-_FARTHEST, _FARTHEST]],
            np.column_stack([np.zeros(2 * m), np.full(2 * m, np.inf)]),
        ]
    )
    answer = linprog(cost, A_eq=matrix, b_eq=-lack / scale[:, 0], bounds=bounds, method="highs-ds")
    return answer.x[: count + 1] if answer.status == 0 else None


def stretched(values: Array, duration: float, limit: float) -> TorqueHistory:
    """The bang-bang torque behind shares of the limit held on equal intervals: between full ones the mean decides."""
    h, full = duration / values.size, np.abs(values) > _FULL
    edges, signs, k = [0.0], [], 0
    while k < values.size:
        if full[k]:
            _join(edges, signs, h, float(np.sign(values[k])))
            k += 1
            continue
        last = k
        while last + 1 < values.size and not full[last + 1]:
            last += 1
        before = signs[-1] if signs else float(np.sign(values[k]) or 1.0)
        after = float(np.sign(values[last + 1])) if last + 1 < values.size else before
        length, mean = (last + 1 - k) * h, float(np.mean(values[k : last + 1]))
        own = 0.5 * length * (1.0 + before * mean)  # of the sign before
        if before == after:
            for part, sign in ((0.5 * own, before), (length - own, -before), (0.5 * own, before)):
                _join(edges, signs, part, sign)
        else:
            _join(edges, signs, own, before)
            _join(edges, signs, length - own, after)
        k = last + 1
    return held(np.array(edges), limit * np.array(signs))


def _join(edges: list[float], signs: list[float], length: float, sign: float) -> None:
    """Lengthen a torque."""
    if signs and signs[-1] == sign:
        edges[-1] += length
    elif length > 0.0:
        edges.append(edges[-1] + length)
        signs.append(sign)
