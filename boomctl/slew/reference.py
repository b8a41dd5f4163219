"""The linear part's own slew: where every programme starts, and for linear plants the answer itself."""

from dataclasses import dataclass, replace

import numpy as np

from boomctl.arrays import Array
from boomctl.slew.least_time.flow import LinearFlow
from boomctl.slew.nlp.programme import Guess
from boomctl.slew.problem import SlewProblem
from boomctl.slew.torque import TorqueHistory, held


@dataclass(frozen=True, eq=False)
class LinearSlew:
    """A slew of the linear part: the torque, and the costate c at the end: ``u = c^T exp(A (T - t)) B`` within the limit."""

    history: TorqueHistory
    costate: Array


def cheapest(problem: SlewProblem, duration: float, intervals: int) -> LinearSlew:
    """Least effort of the linear part in a given time, the torque held on equal intervals and within its limit.

    ``u = clip(G^T c)`` with as many unknowns c as there are end conditions: Newton's method on ``G u = d``, which is the
    gradient of a convex function of c. Where the limit is too low for the time, the best of it is returned.
    """
    flow = LinearFlow(problem.A, problem.B)
    G = problem.ends @ flow.responses(duration, intervals)
    E = flow.step(duration)[0]
    d = problem.ends @ (problem.target - E @ problem.start)
    scale = np.linalg.norm(G, axis=1)
    rows, wanted, limit = G / scale[:, None], d / scale, problem.torque_limit

    def dual(c: Array) -> float:
        free = rows.T @ c
        u = np.clip(free, -limit, limit)
        return float(np.sum(u * free - 0.5 * u**2) - c @ wanted)

    c = np.linalg.lstsq(rows @ rows.T, wanted, rcond=1e-13)[0]
    for _ in range(60):
        free = rows.T @ c
        lack = wanted - rows @ np.clip(free, -limit, limit)
        if np.abs(lack).max() <= 1e-13 * np.abs(wanted).max():
            break
        inner = rows[:, np.abs(free) < limit]
        move = np.linalg.lstsq(inner @ inner.T + 1e-12 * np.eye(c.size), lack, rcond=1e-14)[0]
        size, before = 1.0, dual(c)
        while size > 1e-6 and dual(c + size * move) > before - 1e-4 * size * float(move @ lack):
            size *= 0.5
        if size <= 1e-6:
            break
        c = c + size * move
    values = np.clip(rows.T @ c, -limit, limit)
    costate = (c / scale) @ problem.ends * (duration / intervals)
    return LinearSlew(held(np.linspace(0.0, duration, intervals + 1), values), costate)


def guess_from(problem: SlewProblem, history: TorqueHistory, intervals: int, ramp: bool) -> Guess:
    """Sample a torque and the linear motion under it on a mesh."""
    edges = np.linspace(0.0, history.duration, intervals + 1)
    means = history.means(edges)
    states = LinearFlow(problem.A, problem.B).sampled(problem.start, edges, means)[1]
    if ramp:
        means = np.concatenate([[0.0], 0.5 * (means[1:] + means[:-1]), [0.0]])
    return Guess(history.duration, means, states)


def effort_guess(problem: SlewProblem, duration: float, intervals: int) -> Guess:
    """The linear part's least effort with its costates, where every programme of least effort starts best."""
    linear = cheapest(problem, duration, intervals)
    guess = guess_from(problem, linear.history, intervals, False)
    E, push = LinearFlow(problem.A, problem.B).step(duration / intervals)
    costates = np.empty((intervals, problem.start.size))
    costates[-1] = linear.costate
    for k in range(intervals - 1, 0, -1):
        costates[k - 1] = costates[k] @ E
    free = costates @ push * (intervals / duration)
    return replace(guess, costates=costates, free=free)


def typical_sizes(guess: Guess) -> Array:
    """Largest size of each state along a guess; where that is nothing, what the others suggest."""
    sizes = np.abs(guess.states).max(axis=0)
    return np.where(sizes > 1e-9 * sizes.max(), sizes, 1e-6 * sizes.max())
