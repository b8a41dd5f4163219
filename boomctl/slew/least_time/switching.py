"""Minimum time of a linear system under a torque limit: exact switching times, and the proof that they are optimal.

The problem is convex and normal, so Pontryagin's principle is sufficient: a torque ``u = limit sign(p)``, with the
switching function ``p(t) = costate^T exp(A (T - t)) B``, that reaches the end state takes the least time. A linear
programme on a grid shows how often p changes its sign; Newton's method on the end conditions, ``p(t_i) = 0`` and
``H(T) = 1`` then gives the switching times to rounding, for matrix exponentials have no time step.
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from boomctl.arrays import Array
from boomctl.slew.least_time.flow import LinearFlow
from boomctl.slew.result import SlewError

_GRIDS = (200, 600, 2000, 6000)
_NEWTON = 60
_STRETCH = 0.1
_HOPELESS = 1e9
_PARTS = 2000
_BLIND, _SEEN = 3.0, 0.3  # rad that the fastest vibration turns in an interval of the grid


class SwitchesNotFound(SlewError):
    """A torque leads to the end, but the switching times of the fastest were not found."""


@dataclass(frozen=True, eq=False)
class LinearTimeProblem:
    """From z = start to ``wanted z(T) = target`` in least time.

    Attributes
    ----------
    flow : LinearFlow
    start : ndarray, n
    wanted : ndarray, m x n
        Rows of the end state that are prescribed, independent.
    target : ndarray, m
    limit : float
        Of the torque, N m.
    """

    flow: LinearFlow
    start: Array
    wanted: Array
    target: Array
    limit: float


@dataclass(frozen=True, eq=False)
class Extremal:
    """A bang-bang torque and its costate.

    Attributes
    ----------
    switches : ndarray
        Instants at which the torque changes its sign, s.
    duration : float
        s.
    sign : float
        Of the first stretch.
    costate : ndarray, n
        At the end, such that the Hamiltonian is 1.
    residual : float
        What the conditions lack, relative.
    """

    switches: Array
    duration: float
    sign: float
    costate: Array
    residual: float


def fastest(problem: LinearTimeProblem, guess: float) -> Extremal:
    """Return the least time from a guess of it [s].

    Raises
    ------
    SlewError
        If no torque within the limit leads there, or the switching times are not found.
    """
    best, quickest = None, _quickest(problem.flow)
    for intervals in _GRIDS:
        turn = quickest * guess / intervals
        if turn > _BLIND and intervals != _GRIDS[-1]:
            continue
        try:
            duration, values, costate = _grid_solution(problem, guess, intervals)
        except SlewError:
            if turn < _SEEN or intervals == _GRIDS[-1]:
                raise
            continue
        guess = duration
        for count_from in (_from_costate, _from_values):
            first = count_from(problem, duration, values, costate)
            found = None if first is None else _merged(problem, _sharpened(problem, first))
            if found is not None and _agrees(problem, found):
                return found
            best = found or best
    missing = "none converged" if best is None else f"conditions are missed by {best.residual:.1e}"
    raise SwitchesNotFound(f"minimum time: the switching times could not be found; {missing}")


def polished(problem: LinearTimeProblem, near: Extremal) -> Extremal | None:
    """The least time from that of a problem nearby; None if its switches do not lead there."""
    found = _merged(problem, _sharpened(problem, _fitted(problem, near)))
    return found if found is not None and _agrees(problem, found) else None


def _quickest(flow: LinearFlow) -> float:
    """Frequency of the fastest vibration that the torque moves, rad/s."""
    values, left = np.linalg.eig(flow.A.T)
    felt = np.abs(left.T @ flow.B) > 1e-12 * np.linalg.norm(left, axis=0) * np.linalg.norm(flow.B)
    return float(np.abs(np.imag(values[felt])).max(initial=0.0))


def switching_function(problem: LinearTimeProblem, found: Extremal, t: Array) -> Array:
    """``p(t) = costate^T exp(A (T - t)) B`` at instants t [s], 1/(N m s); the torque follows its sign."""
    order = np.argsort(-t)
    row, before, values = found.costate, found.duration, np.empty(t.size)
    steps: dict[float, Array] = {}
    for k in order:
        gap = float(f"{before - t[k]:.13g}")
        if gap not in steps:
            steps[gap] = problem.flow.step(gap)[0]
        row, before = row @ steps[gap], t[k]
        values[k] = row @ problem.flow.B
    return values


def lower_bound(problem: LinearTimeProblem, found: Extremal) -> float:
    """A time that no torque within the limit can beat, s, by weak duality.

    With ``c`` the costate, any torque that leads from start to target in the time T has
    ``c^T (target - exp(A T) start) = int p u dt <= limit int |p| dt``. At the time found the two sides differ by rounding
    and by what the switching times lack; that difference over the Hamiltonian (1 at the end) is a time. Where the plant
    can wait at its start or its target, less time than that is impossible too.
    """
    row, most = found.costate, 0.0
    for stretch in np.diff(np.concatenate([[0.0], found.switches, [found.duration]]))[::-1]:
        parts = math.ceil(_PARTS * stretch / found.duration)
        E, push = problem.flow.step(stretch / parts)
        for _ in range(parts):
            most += problem.limit * abs(float(row @ push))
            row = row @ E
    weights = np.linalg.lstsq(problem.wanted.T, found.costate, rcond=None)[0]
    needed = float(weights @ problem.target - row @ problem.start)
    return found.duration - abs(needed - most)


def _grid_solution(problem: LinearTimeProblem, guess: float, intervals: int) -> tuple[float, Array, Array]:
    """Least time [s] of torques held on equal intervals, the torque over its limit, and the costate."""
    from scipy.optimize import brentq

    def excess(logarithm: float) -> float:
        return math.log(_least_peak(problem, math.exp(logarithm), intervals)[0])

    low = high = math.log(guess)
    value = excess(low)
    for _ in range(200):
        if value == 0.0:
            break
        further = (high if value > 0.0 else low) + math.copysign(_STRETCH, value)
        last, value = value, excess(further)
        low, high = (high, further) if last > 0.0 else (further, low)
        if last * value <= 0.0:
            break
    else:
        raise SlewError("torque_limit: no torque within it leads to the end state in any time tried")
    found = brentq(excess, low, high, xtol=1e-11, rtol=1e-11) if low < high else low
    duration = math.exp(float(found))
    _, values, costate = _least_peak(problem, duration, intervals)
    return duration, values, costate


def _least_peak(problem: LinearTimeProblem, duration: float, intervals: int) -> tuple[float, Array, Array]:
    """Least peak of the torque over its limit, the torque over its limit, and the costate, for a given time."""
    from scipy.optimize import linprog

    G = problem.wanted @ problem.flow.responses(duration, intervals) * problem.limit
    E = problem.flow.step(duration)[0]
    d = problem.target - problem.wanted @ (E @ problem.start)
    scale = np.linalg.norm(G, axis=1)
    if not np.any(d):
        raise SlewError("angle: the plant is at its end state already; expected a slew that leads somewhere")
    G, d = G / scale[:, None], d / scale
    if not np.isfinite(d).all() or scale.min() == 0.0:
        raise SlewError("torque_limit: no torque within it leads to the end state before the motion overflows")
    answer = None
    for method in ("highs-ds", "highs-ipm"):
        answer = linprog(
            np.append(np.zeros(intervals), -1.0),
            A_eq=np.column_stack([G, -d]),
            b_eq=np.zeros(d.size),
            bounds=[(-1.0, 1.0)] * intervals + [(0.0, None)],
            method=method,
        )
        if answer.status == 0:
            break
    # no torque at all, and none of the way, is always a solution: what fails is arithmetic, in times far too short
    if answer is None or answer.status != 0 or answer.x[-1] <= 1.0 / _HOPELESS:
        return _HOPELESS, np.zeros(intervals), np.zeros(problem.start.size)
    costate = (-answer.eqlin.marginals / scale) @ problem.wanted
    return 1.0 / float(answer.x[-1]), answer.x[:-1], costate


def _from_costate(problem: LinearTimeProblem, duration: float, values: Array, costate: Array) -> Extremal | None:
    """Switches where the grid's costate has its switching function change sign."""
    if values[np.abs(values) > 0.5].size == 0:
        return None
    rough = Extremal(np.zeros(0), duration, 1.0, costate, np.inf)
    t = np.linspace(0.0, duration, 2 * values.size + 1)
    p = switching_function(problem, rough, t)
    sign = np.sign(values[np.abs(values) > 0.5][0])
    if np.sign(np.sum(p[:-1:2] * values)) < 0.0:
        costate, p = -costate, -p
    change = np.flatnonzero(np.sign(p[:-1]) * np.sign(p[1:]) < 0)
    share = p[change] / (p[change] - p[change + 1])
    switches = t[change] + share * (t[1] - t[0])
    return _normalised(problem, replace(rough, switches=switches, costate=costate, sign=float(sign)))


def _from_values(problem: LinearTimeProblem, duration: float, values: Array, costate: Array) -> Extremal | None:
    """Switches where the grid's torque changes sign, placed so that they have its mean."""
    h = duration / values.size
    switches, sign = [], 0.0
    for k, value in enumerate(values):
        if abs(value) < 0.999:
            before = values[k - 1] if k else -(values[k + 1] if k + 1 < values.size else -1.0)
            if k + 1 < values.size and before * values[k + 1] < 0.0:
                switches.append((k + 0.5 * (1.0 + value * np.sign(before))) * h)
        elif k and abs(values[k - 1]) >= 0.999 and value * values[k - 1] < 0.0:
            switches.append(k * h)
        sign = sign or float(np.sign(value) if abs(value) > 0.999 else 0.0)
    rough = Extremal(np.array(switches), duration, sign or 1.0, costate, np.inf)
    return _fitted(problem, rough)


def _fitted(problem: LinearTimeProblem, rough: Extremal) -> Extremal:
    """The costate whose switching function vanishes at the switches, its Hamiltonian 1; the grid's may not be unique."""
    _, rate = _end(problem, rough)
    later = [problem.flow.step(rough.duration - float(t))[0] @ problem.flow.B for t in rough.switches]
    lines = np.array([*later, rate]) @ problem.wanted.T
    columns = np.maximum(np.abs(lines).max(axis=0), 1e-300)
    sizes = np.maximum(np.abs(lines / columns).max(axis=1), 1e-300)
    right = np.append(np.zeros(rough.switches.size), 1.0) / sizes
    weights = np.linalg.lstsq(lines / columns / sizes[:, None], right, rcond=1e-12)[0] / columns
    return replace(rough, costate=weights @ problem.wanted)


def _normalised(problem: LinearTimeProblem, rough: Extremal) -> Extremal | None:
    """The costate scaled and turned such that the Hamiltonian at the end is 1."""
    _, rate = _end(problem, rough)
    size = float(rough.costate @ rate)
    if not np.isfinite(size) or size == 0.0:
        return None
    return replace(rough, costate=rough.costate / size)


def _end(problem: LinearTimeProblem, found: Extremal) -> tuple[Array, Array]:
    """End state and its rate."""
    edges = np.concatenate([[0.0], found.switches, [found.duration]])
    z, value = problem.start, found.sign * problem.limit
    for k, h in enumerate(np.diff(edges)):
        E, push = problem.flow.step(float(h))
        z = E @ z + push * value * (-1.0) ** k
    last = value * (-1.0) ** found.switches.size
    return z, problem.flow.A @ z + problem.flow.B * last


def _merged(problem: LinearTimeProblem, found: Extremal | None) -> Extremal | None:
    """Leave out pairs of switches that coincide, and sharpen the rest again."""
    while found is not None and found.switches.size > 1:
        gaps = np.diff(found.switches)
        k = int(np.argmin(gaps))
        if gaps[k] > 1e-7 * found.duration:
            break
        found = _sharpened(problem, replace(found, switches=np.delete(found.switches, [k, k + 1])))
    return found


def _sharpened(problem: LinearTimeProblem, first: Extremal) -> Extremal | None:
    """Newton's method on all of Pontryagin's conditions; None if the switches cross or it does not converge."""
    found, wanted = first, problem.wanted
    weights = np.linalg.lstsq(wanted.T, first.costate, rcond=None)[0]
    best, size = None, np.inf
    for _ in range(_NEWTON):
        residual, slope = _conditions(problem, found, weights)
        columns = np.maximum(np.abs(slope).max(axis=0), 1e-300)
        lines = np.maximum(np.abs(slope / columns).max(axis=1), 1e-300)
        move = np.linalg.lstsq(slope / columns / lines[:, None], -residual / lines, rcond=1e-14)[0] / columns
        count = found.switches.size
        step = float(np.abs(move[: count + 1]).max() / found.duration)
        if step < size:
            best, size = replace(found, costate=weights @ wanted, residual=float(step)), step
        elif size < 1e-11:
            break
        damping = 1.0
        while damping > 1e-4:
            times = np.append(found.switches, found.duration) + damping * move[: count + 1]
            if np.all(np.diff(np.concatenate([[0.0], times])) > 0.0):
                break
            damping *= 0.5
        else:
            return None
        found = replace(found, switches=times[:-1], duration=float(times[-1]))
        weights = weights + damping * move[count + 1 :]
    return best if size < 1e-9 else None


def _conditions(problem: LinearTimeProblem, found: Extremal, weights: Array) -> tuple[Array, Array]:
    """What end conditions, switching function and Hamiltonian lack, and the derivatives (switches, time, weights)."""
    A, B, wanted = problem.flow.A, problem.flow.B, problem.wanted
    m, k = wanted.shape[0], found.switches.size
    z, rate = _end(problem, found)
    moved = np.empty((B.size, k + 1))  # d z(T) / d (switches, T)
    later = np.empty((B.size, k))  # exp(A (T - t_i)) B
    for i, t in enumerate(found.switches):
        later[:, i] = problem.flow.step(found.duration - float(t))[0] @ B
        moved[:, i] = later[:, i] * 2.0 * found.sign * problem.limit * (-1.0) ** i
    moved[:, k] = rate
    row = weights @ wanted
    residual = np.concatenate([wanted @ z - problem.target, row @ later, [row @ rate - 1.0]])
    slope = np.zeros((m + k + 1, k + 1 + m))
    slope[:m, : k + 1] = wanted @ moved
    turn = row @ A @ later
    slope[m : m + k, :k], slope[m : m + k, k], slope[m : m + k, k + 1 :] = -np.diag(turn), turn, (wanted @ later).T
    slope[-1, : k + 1], slope[-1, k + 1 :] = row @ A @ moved, wanted @ rate
    return residual, slope


def _agrees(problem: LinearTimeProblem, found: Extremal) -> bool:
    """Whether the torque has the sign of the switching function everywhere."""
    return misfit(problem, found) < 1e-6


def misfit(problem: LinearTimeProblem, found: Extremal, samples: int = 4000) -> float:
    """Largest size of the switching function where the torque has the other sign, over its largest size."""
    t = (np.arange(samples) + 0.5) * found.duration / samples
    p = switching_function(problem, found, t)
    sign = found.sign * (-1.0) ** np.searchsorted(found.switches, t, side="right")
    return float(max(0.0, (-p * sign).max()) / np.abs(p).max())
