"""Minimum time of a nonlinear plant: the durations of a bang-bang torque's stretches, to the accuracy of the integration.

``min sum d_i`` such that the end conditions hold, with the durations d_i of the stretches as only unknowns. Its multipliers
give the costate; carried back along the motion it gives the switching function, whose sign must be the torque's. Where it
is not, the torque has too few stretches: linear programmes along the motion then tell how many there are.
"""

from dataclasses import dataclass, field, replace

import numpy as np

from boomctl.arrays import Array
from boomctl.slew.least_time.arc_count import Overflows, steered
from boomctl.slew.least_time.arcs import Course, Reach, course, stretches
from boomctl.slew.least_time.reductions import doubled, first_half, halved, without_axial_modes
from boomctl.slew.problem import SlewProblem
from boomctl.slew.reference import guess_from, typical_sizes
from boomctl.slew.torque import TorqueHistory, bang_bang

_GRIDS = (200, 600, 1800)  # intervals on which stretches are looked for
_MOST_STEPS = 20000
_NEWTON = 40
_PATIENCE = 5  # turns without nearing the end, as long as it is _FAR
_FAR = 1e-3
_EMPTY = 3e-6  # share of the duration below which a stretch is left out; _NOTHING where the end needs it
_NOTHING = 1e-11
_STEP_SHARE = 0.5  # of the tolerance, for what half as long steps change; what remains is a sixteenth of it
_CHORDS = 6
_FOLLOWED = 2
_SERVES = 0.2  # shrinking of the moves by which second derivatives that are kept still serve
_SETTLED = 1e-11
_FLAT = 1e-12  # share of the duration that other durations may promise; _ROUGH with axial vibration
_ROUGH = 1e-8
_ENOUGH = 0.1  # of the tolerance, for what a switching function of the wrong sign promises
_SAMPLES = 200


@dataclass(frozen=True, eq=False)
class Sharpened:
    """A bang-bang slew of a nonlinear plant.

    Attributes
    ----------
    history : TorqueHistory
    gain : float
        Time that the switching function says could be gained where its sign is not the torque's, that what the end lacks
        is worth, and that other durations promise, over the duration.
    step_error : float
        What the end lacks when the steps are halved, relative.
    """

    history: TorqueHistory
    gain: float
    step_error: float


@dataclass(frozen=True, eq=False)
class _Stretches:
    """Durations of a bang-bang torque [s] and the sign of the first; what is known of its optimality.

    Derivatives of the end by the durations, weights of the end conditions in the costate, second derivatives of the
    weighted end, what time these still promise, and what a switching function of the wrong sign does [s].
    """

    durations: Array
    sign: float
    slope: Array = field(default_factory=lambda: np.zeros((0, 0)))
    weights: Array = field(default_factory=lambda: np.zeros(0))
    curvature: Array = field(default_factory=lambda: np.zeros((0, 0)))
    promised: float = np.inf
    wrong: float = np.inf


def sharpened(problem: SlewProblem, first: TorqueHistory) -> Sharpened | None:
    """Sharpen a bang-bang torque; None if none is found that leads to the end; `Overflows` if the motion has no bounds."""
    quick = without_axial_modes(problem)
    near = None if quick is None else sharpened(quick, first)
    first, half = first if near is None else near.history, halved(problem)
    way = course(half or problem, typical_sizes(guess_from(problem, first, _SAMPLES, False)))
    if near is not None:
        found = _finished(way, _weighed(way, _stretches(first), _FOLLOWED), half=False, finer=_FOLLOWED, exact=False)
        if found is not None and found.gain < problem.tolerance:
            return found
    start = first_half(first) if half else first
    best, gain, overflow = None, np.inf, None
    for intervals in (0, *_GRIDS):
        try:
            torque = start if intervals == 0 else steered(way, start, intervals)
        except Overflows as error:
            overflow = error
            continue
        found = None if torque is None else _settled(way, _stretches(torque), 1)
        if found is not None:
            now = found.wrong / float(found.durations.sum())
            if now < gain:
                best, gain, start = found, now, _history(problem, found)
        if gain < _ENOUGH * problem.tolerance:
            break
    if best is None and overflow is not None:
        raise overflow
    return None if best is None else _finished(way, best, half is not None)


def _finished(way: Course, found: _Stretches, half: bool, finer: int = 1, exact: bool = True) -> Sharpened | None:
    """Halve the steps until the end stays where it is; if not exact, durations are led to the end, not to the least sum."""
    error = np.inf
    while error > _STEP_SHARE * way.problem.tolerance and finer * _steps(way, found.durations).sum() < _MOST_STEPS:
        finer *= 2
        near, error = _corrected(way, found, finer)
        if near is None and exact:
            near = _settled(way, found, finer)
        if near is None:
            return None
        found = near
    settled = _settled(way, found, finer) if exact else _weighed(way, found, finer)
    if settled is None:
        return None
    history = _history(way.problem, settled)
    worth = float(np.abs(settled.weights).sum()) * error / 15.0  # the scheme is of fourth order
    gain = (settled.wrong + settled.promised + worth) / history.duration
    return Sharpened(doubled(history) if half else history, gain, error)


def _weighed(way: Course, found: _Stretches, finer: int) -> _Stretches:
    """Derivatives and weights of durations that are all but the best; the switching function tells what others promise.

    Where it is p at a switch, and p' its slope, the switch moved to its zero would gain the time ``limit p^2 / |p'|``.
    """
    u, h, moved = _course_of(way, found, finer * _steps(way, found.durations))
    reach = way.reach(u, h)
    slope, weights = reach.by_width @ moved, reach.weights(moved)
    p, k = -(weights @ reach.by_torque) / h, np.flatnonzero(np.diff(u))
    middle, change = 0.5 * (p[k] + p[k + 1]), 2.0 * (p[k + 1] - p[k]) / (h[k] + h[k + 1])
    promised = way.problem.torque_limit * float(np.sum(middle**2 / np.maximum(np.abs(change), 1e-300)))
    return replace(found, slope=slope, weights=weights, promised=promised, wrong=_wrong(weights, reach, u))


def _corrected(way: Course, found: _Stretches, finer: int) -> tuple[_Stretches | None, float]:
    """Lead to the end with finer steps by the derivatives of the coarser; None if they do not; what the end lacked."""
    steps, d, errors = finer * _steps(way, found.durations), found.durations, []
    for _ in range(_CHORDS):
        u, h, _moved = _course_of(way, replace(found, durations=d), steps)
        lack = way.lack(u, h)
        errors.append(float(np.abs(lack).max()))
        d = d - np.linalg.lstsq(found.slope, lack, rcond=None)[0]
        if not errors[-1] <= errors[0] or d.min() <= _least(way, d):
            return None, errors[0]
        if errors[-1] < _SETTLED:
            break
    return replace(found, durations=d), errors[0]


def _stretches(history: TorqueHistory) -> _Stretches:
    return _Stretches(np.diff(history.edges), float(np.sign(history.left[0])))


def _history(problem: SlewProblem, found: _Stretches) -> TorqueHistory:
    edges = np.cumsum(found.durations)
    return bang_bang(edges[:-1], float(edges[-1]), problem.torque_limit, found.sign)


def _steps(way: Course, durations: Array) -> Array:
    return np.maximum(2, np.ceil(durations * way.pace)).astype(int)


def _settled(way: Course, found: _Stretches, finer: int) -> _Stretches | None:
    """Stationary durations, stretches of no length left out; None where there are too few, or Newton's method fails."""
    while found.durations.size >= way.rows.shape[0]:
        steps = finer * _steps(way, found.durations)
        answer = _durations(way, found, steps)
        if answer is None:
            return None
        if answer.durations.min() > _least(way, answer.durations):
            return answer
        found = _without_empty(answer)
    return None


def _least(way: Course, d: Array) -> float:
    """Duration below which a stretch is left out; where the end needs every one, only next to nothing is too short."""
    return float(d.sum()) * (_EMPTY if d.size >= way.rows.shape[0] + 2 else _NOTHING)


def _without_empty(found: _Stretches) -> _Stretches:
    """Leave out the shortest stretch; its neighbours become one."""
    d, k = found.durations, int(np.argmin(found.durations))
    if k == 0:
        return replace(found, durations=d[1:], sign=-found.sign)
    if k == d.size - 1:
        return replace(found, durations=d[:-1])
    return replace(found, durations=np.concatenate([d[: k - 1], [d[k - 1] + d[k + 1]], d[k + 2 :]]))


def _course_of(way: Course, found: _Stretches, steps: Array) -> tuple[Array, Array, Array]:
    """Torques and widths of all steps, and how the widths follow the durations, K x q."""
    torques = found.sign * way.problem.torque_limit * (-1.0) ** np.arange(found.durations.size)
    return stretches(torques, found.durations, steps)


def _durations(way: Course, found: _Stretches, steps: Array) -> _Stretches | None:
    """Durations of least sum: Newton's method. A stretch that would vanish is returned as it vanishes.

    Second derivatives are kept as long as they serve. Axial vibration ripples them: there a small promise is enough.
    """
    smooth = all(plant.controllable.all() for plant in way.problem.plants)
    size, before, total, count = np.inf, np.inf, float(found.durations.sum()), found.durations.size
    least, patience = np.inf, _PATIENCE
    for _ in range(_NEWTON):
        u, h, moved = _course_of(way, found, steps)
        reach = way.reach(u, h)
        lack, slope = reach.end - way.rows @ way.problem.target, reach.by_width @ moved
        patience = _PATIENCE if np.abs(lack).max() < 0.7 * least else patience - 1
        least = min(least, float(np.abs(lack).max()))
        if not np.isfinite(slope).all() or (patience == 0 and least > _FAR):
            return None
        weights = reach.weights(moved)
        found = replace(found, slope=slope, weights=weights)
        if count > lack.size and (found.curvature.shape[0] != count or size > _SERVES * before):
            found = replace(found, curvature=way.curvature(u, h, reach, weights, moved))
        onto, beside, promised = _newton_step(lack, slope, found.curvature)
        before, size = size, float(np.abs(onto + beside).max() / total)
        flat = promised < (_FLAT if smooth else _ROUGH) * total
        if flat and np.abs(onto).max() < _SETTLED * total:
            return replace(found, promised=promised, wrong=_wrong(weights, reach, u))
        d = _moved(found.durations, onto)
        found = replace(found, durations=d if flat else _moved(d, beside))
        if found.durations.min() < _least(way, found.durations):
            return found
    return None


def _moved(d: Array, move: Array) -> Array:
    """Durations changed by as much of a move as keeps them positive, and changes none by more than a tenth of all."""
    shrink = float(np.max(np.maximum(-move, 0.0) / d))
    far = float(np.abs(move).max() / d.sum())
    return d + move * min(1.0, 0.8 / max(shrink, 0.8), 0.1 / max(far, 0.1))


def _newton_step(lack: Array, slope: Array, curvature: Array) -> tuple[Array, Array, float]:
    """Changes of the durations that lead to the end, and beside it to the least sum; what the latter promises, s."""
    m, q = slope.shape
    whole, triangle = np.linalg.qr(slope.T, mode="complete")
    onto = whole[:, :m] @ np.linalg.lstsq(triangle[:m].T, -lack, rcond=1e-14)[0]
    if q == m:
        return onto, np.zeros(q), 0.0
    free = whole[:, m:]
    values, vectors = np.linalg.eigh(free.T @ curvature @ free)
    values = np.maximum(np.abs(values), 1e-8 * np.abs(values).max() + 1e-300)
    downhill = vectors.T @ (free.T @ (np.ones(q) + curvature @ onto))
    return onto, -free @ (vectors @ (downhill / values)), 0.5 * float(np.sum(downhill**2 / values))


def _wrong(weights: Array, reach: Reach, u: Array) -> float:
    """Time that the torque turned round where the switching function has the other sign promises, s."""
    return 2.0 * float(np.sum(np.maximum((weights @ reach.by_torque) * u, 0.0)))
