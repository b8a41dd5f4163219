"""Minimum time of a linear system under a torque limit: exact switching times, and the proof that they are optimal.

Only the linear part of a problem and its torque limit are used.

The problem is convex and normal, so Pontryagin's principle is sufficient: a torque ``u = limit sign(p)``, with the
switching function ``p(t) = costate^T exp(A (T - t)) B``, that reaches the end state takes the least time. Reweighted
least squares on a grid, or a linear program if they fail, give the number of sign changes of p; Newton's method on the
end conditions, ``p(t_i) = 0`` and ``H(T) = 1`` then gives the switching times to rounding error, since matrix exponentials
have no time step.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np
from scipy.optimize import brentq, linprog

from boomctl.arrays import Array
from boomctl.exceptions import SlewError
from boomctl.lti.rounding import ROOT
from boomctl.slew.linear import flow
from boomctl.slew.problem import RTOL, SlewProblem
from boomctl.slew.torque import TorqueProfile, bang_bang

_GRIDS = (200, 600, 2000, 6000)  # intervals; the next finer grid if Newton's method fails from the arcs of one grid
_BLIND = 3.0  # phase of the fastest vibration in an interval above which a grid does not resolve it [rad]
_LIMIT_FACTORS = (0.999, 1.001, 0.99, 1.01)  # factors of the torque limit for other starts of Newton's method
_HOPELESS = 1e9  # torque over its limit above which a duration counts as infeasible
_SECANTS = 12  # secant steps at most until the least peak on a grid is about the limit; about five are usual
_CAREFUL = 0.05  # step of log(time), if more time may be infeasible
_FAR = 20.0  # range of log(time) of that search: the guess may be far below the least time
_ROUGHLY = 1e-3  # tolerance of log(peak), enough for Newton's method: a fifth of an interval of the grid
_REWEIGHTED = 20  # reweighted least-squares iterations for a duration; weights carry over to the next duration
_THIN = 1e-6  # fraction of the largest |G^T y| below which weights are bounded
_NEWTON = 60  # Newton steps at most; it is damped and slow near a change of the number of arcs
_CONVERGED, _ROUNDED = 1e-9, 1e-11  # last step of a time over the duration: to accept the result; to stop at once
_SHORTEST = 1e-4  # smallest damping factor of a Newton step; below it switching times cross
_SAMPLES = 4000  # times at which the signs of torque and switching function are compared
_PARTS = 2000  # parts of the duration for the quadrature of |p|, which is smooth between switches


@dataclass(frozen=True, eq=False)
class Extremal:
    """A bang-bang torque and its costate.

    Attributes
    ----------
    switches : ndarray
        Times at which the torque changes its sign, s.
    duration : float
        Duration, s.
    sign : float
        Sign of the first arc.
    limit : float
        Torque limit, N m.
    costate : ndarray, n
        Costate at the end, scaled to a Hamiltonian of 1.
    """

    switches: Array
    duration: float
    sign: float
    limit: float
    costate: Array

    @property
    def profile(self) -> TorqueProfile:
        """The torque."""
        return bang_bang(self.switches, self.duration, self.limit, self.sign)


def least_time(problem: SlewProblem) -> Extremal:
    """Compute the minimum-time slew of the linear part: the solution for linear plants, a starting point for others.

    Raises
    ------
    SlewError
        If no torque within the limit leads to the end, or the switching times are not found.
    """
    first = rigid_and_slowest(problem)
    guess = problem.rigid_time if first is None else first.duration
    extremal, feasible = _fastest(problem, guess)
    # where the number of arcs changes, no grid resolves it; a slightly different torque limit may
    for factor in _LIMIT_FACTORS if extremal is None else ():
        limits = replace(problem.limits, torque=factor * problem.limits.torque)
        near, reached = _fastest(replace(problem, limits=limits), guess)
        feasible |= reached
        if near is not None:
            near = replace(near, limit=problem.limits.torque)
            extremal = _agreeing(problem, _newton(problem, _fitted(problem, near)))
        if extremal is not None:
            break
    if extremal is None and not feasible:
        limit = problem.plants[0].with_unit("torque", f"{problem.limits.torque:g}")
        raise SlewError(
            f"torque_limit = {limit}: no duration was found in which a torque within it leads to the end state; expected a"
            " larger one, or a start and an end nearer to rest"
        )
    if extremal is None:
        raise SlewError("minimum time: the switching times were not found; they may exist within the torque limit")
    return extremal


def time_gap(problem: SlewProblem, extremal: Extremal) -> float:
    """Return the relative optimality gap: by weak duality, or by wrong signs of the torque if larger; at most 1."""
    return min(1.0, max(1.0 - lower_bound(problem, extremal) / extremal.duration, misfit(problem, extremal)))


def _fastest(problem: SlewProblem, guess: float) -> tuple[Extremal | None, bool]:
    """Compute the least time from a guess of it [s], started by reweighted least squares on a grid or linear programs.

    The result is verified by the convergence of Newton's method and the signs of the switching function. Also return whether
    the end can be reached on a grid.
    """
    feasible = False
    grids = _GRIDS if problem.can_wait else _GRIDS[:1]
    for intervals, least_sum in ((_GRIDS[0], _reweighted), *((count, _programmed) for count in grids)):
        if problem.fastest_vibration * guess / intervals > _BLIND and intervals != _GRIDS[-1]:
            continue
        first = _on_grid(problem, guess, intervals, least_sum)
        if first is not None:
            guess, feasible = first.duration, True
            extremal = _agreeing(problem, _newton(problem, first))
            if extremal is not None:
                return extremal, True
    return None, feasible


_LeastSum: TypeAlias = Callable[[Array, Array, Array], tuple[Array, Array] | None]
"""The y with ``d^T y = 1`` and the least ``sum |G^T y|``, and weights to continue from; None if there is none."""


def _on_grid(problem: SlewProblem, guess: float, intervals: int, least_sum: _LeastSum) -> Extremal | None:
    """Return the switches of a torque held on a grid, for the duration [s] at which the least peak is about the limit.

    The least peak for a duration is the largest ``d^T y`` with ``sum |G^T y| <= 1``, with one unknown y per terminal
    condition; the torque has the sign of ``G^T y``.
    """
    logarithms, peaks, weights = [math.log(guess)], [], np.ones(intervals)
    # where more time may be infeasible, the least time is approached from below
    longest, tries = (1.0, _SECANTS) if problem.can_wait else (_CAREFUL, int(_FAR / _CAREFUL))
    while len(peaks) < tries:
        problem.deadline.check(f"switching times of the linear part on {intervals} intervals")
        duration = math.exp(logarithms[-1])
        G = problem.ends @ flow(problem).responses(duration, intervals) * problem.limits.torque
        d = problem.ends @ (problem.target - flow(problem).step(duration)[0] @ problem.start)
        scale = np.linalg.norm(G, axis=1)
        if not np.isfinite(G).all() or not np.isfinite(d).all() or scale.min() == 0.0:
            return None
        result = least_sum(G / scale[:, None], d / scale, weights)
        if result is None:
            return None
        y, weights = result
        sums = y / scale @ G
        peaks.append(-math.log(float(np.abs(sums).sum())))
        if len(peaks) == 1:
            further = 0.5 * peaks[0]  # for a rigid body the least peak falls with the square of the time
        elif abs(peaks[-1]) < _ROUGHLY:
            return _from_costate(problem, duration, (y / scale) @ problem.ends, 2 * intervals)
        elif peaks[-1] == peaks[-2]:
            return None
        else:
            further = -peaks[-1] * (logarithms[-1] - logarithms[-2]) / (peaks[-1] - peaks[-2])
        if len(peaks) > 1 and further * (logarithms[-1] - logarithms[-2]) < 0.0:
            longest *= 0.5  # shorter than the range of feasible times, which it may have stepped over
        logarithms.append(logarithms[-1] + float(np.clip(further, -longest, longest)))
    return None


def _reweighted(G: Array, d: Array, weights: Array) -> tuple[Array, Array] | None:
    """Approximate the least sum by least squares with weights ``1/|G^T y|``, ten times as fast as a linear program."""
    y = np.zeros(d.size)
    for _ in range(_REWEIGHTED):
        try:
            y = np.linalg.solve((G * weights) @ G.T, d)
        except np.linalg.LinAlgError:
            return None
        reached = float(d @ y)
        if not np.isfinite(reached) or reached <= 0.0:
            return None
        y /= reached
        size = np.abs(y @ G)
        weights = 1.0 / np.maximum(size, _THIN * size.max())
    return y, weights


def _programmed(G: Array, d: Array, weights: Array) -> tuple[Array, Array] | None:
    """Compute the least sum by a linear program for the torque over its limit that leads farthest towards d."""
    answer = linprog(
        np.append(np.zeros(weights.size), -1.0),
        A_eq=np.column_stack([G, -d]),
        b_eq=np.zeros(d.size),
        bounds=[(-1.0, 1.0)] * weights.size + [(0.0, None)],
        method="highs-ds",
    )
    # a zero torque is always feasible: a failure is numerical, at far too short durations
    y = answer.eqlin.marginals if answer.status == 0 else np.zeros(d.size)
    reached = abs(float(y @ d))
    return (y * np.sign(y @ d) / reached, weights) if reached > 1.0 / _HOPELESS else None


def rigid_and_slowest(problem: SlewProblem) -> TorqueProfile | None:
    """Return the fastest turn of a beam with its slowest vibration only, undamped; None if it is not a turn of one beam.

    Switches are in the middle, at H, and b before and after it: ``limit / inertia (H^2 - 2 b^2)`` is the angle, and the
    vibration vanishes if ``cos(w H) - 2 cos(w b) + 1 = 0``, which is <= 0 at b = 0 and >= 0 at a quarter of a period.
    """
    plant = problem.plants[0]
    if len(problem.plants) > 1 or plant.frequencies is None or plant.inertia is None or problem.angle is None:
        return None
    if problem.final_speed:
        return None
    turn = problem.angle
    area, w = abs(turn) * plant.inertia / problem.limits.torque, float(plant.frequencies[1])
    vibration = lambda b: math.cos(w * math.sqrt(area + 2.0 * b * b)) - 2.0 * math.cos(w * b) + 1.0  # noqa: E731
    b = float(brentq(vibration, 0.0, 0.5 * math.pi / w))
    half = math.sqrt(area + 2.0 * b * b)
    return bang_bang(np.array([half - b, half, half + b]), 2.0 * half, problem.limits.torque, math.copysign(1.0, turn))


def switching_function(problem: SlewProblem, extremal: Extremal, t: Array) -> Array:
    """Return ``p(t) = costate^T exp(A (T - t)) B`` at evenly spaced times t [s], 1/(N m s); the torque has its sign."""
    last = flow(problem).step(extremal.duration - float(t[-1]))[0] @ flow(problem).B
    return (extremal.costate @ flow(problem).carried(last, float(t[-1] - t[0]) / (t.size - 1), t.size))[::-1]


def lower_bound(problem: SlewProblem, extremal: Extremal) -> float:
    """Return a lower bound on the duration within the torque limit, s, by weak duality.

    With ``c`` the costate, any torque that leads from start to target in the time T has
    ``c^T (target - exp(A T) start) = int p u dt <= limit int |p| dt``. At the computed time the two sides differ by rounding
    and by the error of the switching times; that difference over the Hamiltonian (1 at the end) is a time. If the plant
    can wait at its start or its target, shorter durations are infeasible too.
    """
    row, most = extremal.costate, 0.0
    for arc in np.diff(np.concatenate([[0.0], extremal.switches, [extremal.duration]]))[::-1]:
        parts = math.ceil(_PARTS * arc / extremal.duration)
        Phi, push = flow(problem).step(arc / parts)
        most += problem.limits.torque * float(np.abs(row @ flow(problem).carried(push, arc / parts, parts)).sum())
        row = row @ np.linalg.matrix_power(Phi, parts)
    weights = np.linalg.lstsq(problem.ends.T, extremal.costate, rcond=None)[0]
    needed = float(weights @ problem.ends @ problem.target - row @ problem.start)
    return extremal.duration - abs(needed - most)


def _from_costate(problem: SlewProblem, duration: float, costate: Array, samples: int) -> Extremal | None:
    """Return the switches at sign changes of a costate's switching function; None without a nonzero, finite Hamiltonian."""
    rough = Extremal(np.zeros(0), duration, 1.0, problem.limits.torque, costate)
    t = np.linspace(0.0, duration, samples + 1)
    p = switching_function(problem, rough, t)
    change = np.flatnonzero(np.sign(p[:-1]) * np.sign(p[1:]) < 0)
    fraction = p[change] / (p[change] - p[change + 1])
    rough = replace(rough, switches=t[change] + fraction * (t[1] - t[0]), sign=float(np.sign(p[0]) or np.sign(p[1])))
    hamiltonian = float(costate @ _end(problem, rough)[1])
    if not np.isfinite(hamiltonian) or hamiltonian == 0.0:
        return None
    return replace(rough, costate=costate / hamiltonian)


def _fitted(problem: SlewProblem, rough: Extremal) -> Extremal:
    """Compute the costate whose switching function vanishes at the switches, with Hamiltonian 1, by least squares."""
    _, rate, later = _end(problem, rough)
    lines = np.vstack([later.T, rate]) @ problem.ends.T
    weights = _least_squares(lines, np.append(np.zeros(rough.switches.size), 1.0), 1e-12)
    return replace(rough, costate=weights @ problem.ends)


def _least_squares(matrix: Array, right: Array, rcond: float) -> Array:
    """Solve least squares after scaling columns and rows to unit maximum."""
    columns = np.maximum(np.abs(matrix).max(axis=0), 1e-300)
    lines = np.maximum(np.abs(matrix / columns).max(axis=1), 1e-300)
    return np.linalg.lstsq(matrix / columns / lines[:, None], right / lines, rcond=rcond)[0] / columns


def _end(problem: SlewProblem, extremal: Extremal) -> tuple[Array, Array, Array]:
    """Return the end state, its rate, and ``exp(A (T - t_i)) B``, n x k: the effect of an impulse at each switch."""
    edges = np.concatenate([[0.0], extremal.switches, [extremal.duration]])
    linear, z, value = flow(problem), problem.start, extremal.sign * problem.limits.torque
    later = np.empty((z.size, 0))
    for h in np.diff(edges):
        Phi, push = linear.step(float(h))
        z, value = Phi @ z + push * value, -value
        later = Phi @ np.column_stack([later, linear.B])
    return z, linear.A @ z - linear.B * value, later[:, 1:]


def _agreeing(problem: SlewProblem, extremal: Extremal | None) -> Extremal | None:
    """Remove pairs of coincident switches and solve for the others; None if the signs of torque and costate differ."""
    while extremal is not None and extremal.switches.size > 1:
        gaps = np.diff(extremal.switches)
        k = int(np.argmin(gaps))
        if gaps[k] > ROOT * extremal.duration:
            break
        extremal = _newton(problem, replace(extremal, switches=np.delete(extremal.switches, [k, k + 1])))
    return extremal if extremal is not None and misfit(problem, extremal) < RTOL else None


def _newton(problem: SlewProblem, first: Extremal) -> Extremal | None:
    """Solve all of Pontryagin's conditions by Newton's method; None if the switches cross or it does not converge.

    With too few switches, its least-squares steps may converge to a point that violates the end conditions: also None.
    """
    result, ends = first, problem.ends
    weights = np.linalg.lstsq(ends.T, first.costate, rcond=None)[0]
    best, size, error = None, np.inf, np.inf
    reached = max(float(np.abs(ends @ problem.target).max()), float(np.abs(ends @ problem.start).max()))
    for _ in range(_NEWTON):
        problem.deadline.check(f"{result.switches.size} switching times of the linear part", result.duration)
        residual, slope = _conditions(problem, result, weights)
        move = _least_squares(slope, -residual, 1e-14)
        count = result.switches.size
        step = float(np.abs(move[: count + 1]).max() / result.duration)
        if step < size:
            best, size = replace(result, costate=weights @ ends), step
            error = float(np.abs(residual[: ends.shape[0]]).max()) / reached
        elif size < _ROUNDED:
            break
        damping = 1.0
        while damping > _SHORTEST:
            times = np.append(result.switches, result.duration) + damping * move[: count + 1]
            if np.all(np.diff(np.concatenate([[0.0], times])) > 0.0):
                break
            damping *= 0.5
        else:
            return None
        result = replace(result, switches=times[:-1], duration=float(times[-1]))
        weights = weights + damping * move[count + 1 :]
    return best if size < _CONVERGED and error < RTOL else None


def _conditions(problem: SlewProblem, extremal: Extremal, weights: Array) -> tuple[Array, Array]:
    """Defects of end conditions, switching function and Hamiltonian, and their derivatives (switches, time, weights)."""
    A, ends = problem.A, problem.ends
    m, k = ends.shape[0], extremal.switches.size
    z, rate, later = _end(problem, extremal)
    jumps = 2.0 * extremal.sign * problem.limits.torque * (-1.0) ** np.arange(k)
    moved = np.column_stack([later * jumps, rate])  # d z(T) / d (switches, T)
    row = weights @ ends
    residual = np.concatenate([ends @ (z - problem.target), row @ later, [row @ rate - 1.0]])
    slope = np.zeros((m + k + 1, k + 1 + m))
    slope[:m, : k + 1] = ends @ moved
    turn = row @ A @ later
    slope[m : m + k, :k], slope[m : m + k, k], slope[m : m + k, k + 1 :] = -np.diag(turn), turn, (ends @ later).T
    slope[-1, : k + 1], slope[-1, k + 1 :] = row @ A @ moved, ends @ rate
    return residual, slope


def misfit(problem: SlewProblem, extremal: Extremal) -> float:
    """Return the largest modulus of the switching function where the torque has the other sign, over its maximum."""
    t = (np.arange(_SAMPLES) + 0.5) * extremal.duration / _SAMPLES
    p = switching_function(problem, extremal, t)
    sign = extremal.sign * (-1.0) ** np.searchsorted(extremal.switches, t, side="right")
    return float(max(0.0, (-p * sign).max()) / np.abs(p).max())
