"""Costs that no torque can beat, for linear plants: weak duality, with nothing of the planning's mesh in it."""

import numpy as np

from boomctl.arrays import Array
from boomctl.slew.least_time.flow import LinearFlow
from boomctl.slew.least_time.switching import Extremal, LinearTimeProblem, lower_bound, misfit
from boomctl.slew.problem import SlewProblem
from boomctl.slew.reference import cheapest
from boomctl.slew.torque import TorqueHistory

_POINTS = 4


def time_gap(problem: LinearTimeProblem, found: Extremal) -> float:
    """Time that might still be gained, relative: by weak duality, and where the torque has the wrong sign; at most all."""
    return min(1.0, max(1.0 - lower_bound(problem, found) / found.duration, misfit(problem, found)))


def effort_bound(problem: SlewProblem, duration: float, intervals: int) -> float:
    """Effort that no torque within the limit can beat, N^2 m^2 s.

    For any c: ``int u^2 >= c^T d - int max_u (p u - u^2) dt`` with ``p = c^T exp(A (T - t)) B``; the maximum is ``p^2 / 4``
    within ``|p| <= 2 limit`` and ``limit |p| - limit^2`` beyond. The integral is summed in Gauss points.
    """
    linear = cheapest(problem, duration, intervals)
    c = 2.0 * linear.costate
    flow = LinearFlow(problem.A, problem.B)
    nodes, weights = np.polynomial.legendre.leggauss(_POINTS)
    h, limit = duration / intervals, problem.torque_limit
    places = 0.5 * h * (1.0 - nodes)  # before the end of an interval
    ahead: Array = np.array([flow.step(float(s))[0] @ problem.B for s in places])
    E = flow.step(h)[0]
    row, total = c, 0.0
    for _ in range(intervals):
        p = np.abs(ahead @ row)
        conjugate = np.where(p <= 2.0 * limit, 0.25 * p**2, limit * p - limit**2)
        total += 0.5 * h * float(weights @ conjugate)
        row = row @ E
    combination = np.linalg.lstsq(problem.ends.T, c, rcond=None)[0]
    return float(combination @ (problem.ends @ problem.target) - row @ problem.start - total)


def effort_gap(problem: SlewProblem, history: TorqueHistory) -> float:
    """How far an effort is above what cannot be beaten, relative."""
    bound = effort_bound(problem, history.duration, max(800, history.left.size))
    return history.effort / bound - 1.0
