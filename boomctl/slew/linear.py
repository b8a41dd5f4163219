"""The linear part of a slew: its motion under a held torque, its least effort, and the effort that no torque can beat."""

from dataclasses import dataclass

import numpy as np

from boomctl.arrays import Array
from boomctl.gauss import gauss_method
from boomctl.lti.hold import observability, recursion, zero_order_hold
from boomctl.lti.rounding import SOLVED
from boomctl.slew.problem import SlewProblem
from boomctl.slew.torque import TorqueHistory, held

_NEWTON = 60  # steps of Newton's method on the dual at most; a safeguard, for it is damped
_REGULAR = 1e-12  # of a matrix of unit rows, where few intervals are inside the limit: keeps Newton's equation solvable
_ARMIJO = 1e-4  # share of the decrease promised that a step of Newton's method has to bring: customary
_SHORTEST = 1e-6  # of a step of Newton's method; below it the torque limit is too low for the time
_UNSEEN = 1e-9, 1e-6  # a state below the first share of the largest is taken to be of the second: it scales, no more
_MESH = 800  # intervals at least for the bound of the effort, which their number brings nearer; a choice
_POINTS = 4  # Gauss points an interval: order 8, rounding on such a mesh


@dataclass(frozen=True, eq=False)
class LinearFlow:
    """``z' = A z + B u`` with a torque u that is held; A is n x n, B has n entries."""

    A: Array
    B: Array

    def step(self, h: float) -> tuple[Array, Array]:
        """``exp(A h)`` and the response ``int_0^h exp(A s) ds B`` to unit torque."""
        Phi, push = zero_order_hold(self.A, self.B[:, None], h)
        return Phi, push[:, 0]

    def carried(self, vector: Array, h: float, count: int) -> Array:
        """A vector v and what an unforced motion makes of it in equal steps: ``v, exp(A h) v, ...``, n x count."""
        return observability(self.step(h)[0].T, vector[None], count)[0][:, 0].T

    def responses(self, duration: float, intervals: int) -> Array:
        """End states that unit torque on each of equal intervals causes, n x intervals."""
        h = duration / intervals
        return self.carried(self.step(h)[1], h, intervals)[:, ::-1]

    def motion(self, start: Array, duration: float, torques: Array) -> Array:
        """States, (N + 1) x n, between N equal intervals on which torques are held."""
        Phi, push = self.step(duration / torques.size)
        return recursion(Phi, push[:, None] * torques, start).T


def flow(problem: SlewProblem) -> LinearFlow:
    """Linear part of all plants of a problem."""
    return LinearFlow(problem.A, problem.B)


@dataclass(frozen=True, eq=False)
class LeastEffort:
    """The linear part's slew of least effort: the torque, and the costate c at the end.

    ``u = c^T exp(A (T - t)) B`` within the limit.  ``missed`` is what it misses of the end conditions, relative to the
    largest of them: rounding, unless the limit is too low for the time.
    """

    history: TorqueHistory
    costate: Array
    missed: float


def least_effort(problem: SlewProblem, duration: float, intervals: int) -> LeastEffort:
    """Least effort of the linear part in a given time, the torque held on equal intervals and within its limit.

    ``u = clip(G^T c)`` with as many unknowns c as there are end conditions: Newton's method on ``G u = d``, which is the
    gradient of a convex function of c. Where the limit is too low for the time, the best of it is returned.
    """
    linear = flow(problem)
    G = problem.ends @ linear.responses(duration, intervals)
    d = problem.ends @ (problem.target - linear.step(duration)[0] @ problem.start)
    scale = np.linalg.norm(G, axis=1)
    rows, wanted, limit = G / scale[:, None], d / scale, problem.limits.torque

    def dual(c: Array) -> float:
        free = rows.T @ c
        u = np.clip(free, -limit, limit)
        return float(np.sum(u * free - 0.5 * u**2) - c @ wanted)

    c = np.linalg.lstsq(rows @ rows.T, wanted, rcond=1e-13)[0]  # rcond: directions below rounding are left alone
    for _ in range(_NEWTON):
        free = rows.T @ c
        defect = wanted - rows @ np.clip(free, -limit, limit)
        if np.abs(defect).max() <= SOLVED * np.abs(wanted).max():  # of the end conditions, relative: rounding
            break
        inner = rows[:, np.abs(free) < limit]
        move = np.linalg.lstsq(inner @ inner.T + _REGULAR * np.eye(c.size), defect, rcond=1e-14)[0]
        size, before = 1.0, dual(c)
        while size > _SHORTEST and dual(c + size * move) > before - _ARMIJO * size * float(move @ defect):
            size *= 0.5
        if size <= _SHORTEST:
            break
        c = c + size * move
    values = np.clip(rows.T @ c, -limit, limit)
    costate = (c / scale) @ problem.ends * (duration / intervals)
    missed = float(np.abs(wanted - rows @ values).max() / np.abs(wanted).max())
    return LeastEffort(held(np.linspace(0.0, duration, intervals + 1), values), costate, missed)


@dataclass(frozen=True, eq=False)
class Guess:
    """Where planning starts: a torque, and the linear motion under it.

    Attributes
    ----------
    duration : float
        s.
    torques : ndarray
        At intervals or nodes, N m.
    states : ndarray, (N + 1) x n
        At nodes.
    costates : ndarray, N x n, or None
        Of least effort, at the ends of the intervals: the free torque is ``costate^T B``.
    free : ndarray, N, or None
        The torque of least effort without limit, N m.
    """

    duration: float
    torques: Array
    states: Array
    costates: Array | None = None
    free: Array | None = None

    @property
    def sizes(self) -> Array:
        """Largest size of each state on the way; where that is nothing, what the others suggest."""
        sizes = np.abs(self.states).max(axis=0)
        seen, instead = _UNSEEN
        return np.where(sizes > seen * sizes.max(), sizes, instead * sizes.max())


def guess_from(problem: SlewProblem, history: TorqueHistory, intervals: int = 200, ramp: bool = False) -> Guess:
    """Sample a torque and the linear motion under it on a mesh."""
    means = history.means(np.linspace(0.0, history.duration, intervals + 1))
    states = flow(problem).motion(problem.start, history.duration, means)
    if ramp:
        means = np.concatenate([[0.0], 0.5 * (means[1:] + means[:-1]), [0.0]])
    return Guess(history.duration, means, states)


def effort_guess(problem: SlewProblem, duration: float, intervals: int) -> Guess:
    """The linear part's least effort with its costates, where every programme of least effort starts best."""
    least = least_effort(problem, duration, intervals)
    guess = guess_from(problem, least.history, intervals)
    Phi, push = flow(problem).step(duration / intervals)
    costates = np.empty((intervals, problem.start.size))
    costates[-1] = least.costate
    for k in range(intervals - 1, 0, -1):
        costates[k - 1] = costates[k] @ Phi
    free = costates @ push * (intervals / duration)
    return Guess(duration, guess.torques, guess.states, costates, free)


def effort_gap(problem: SlewProblem, history: TorqueHistory) -> float:
    """How far an effort is above what no torque within the limit can beat, relative: weak duality, on a mesh of its own.

    For any c: ``int u^2 >= c^T d - int max_u (p u - u^2) dt`` with ``p = c^T exp(A (T - t)) B``; the maximum is ``p^2 / 4``
    within ``|p| <= 2 limit`` and ``limit |p| - limit^2`` beyond. The integral is summed in Gauss points.
    """
    intervals = max(_MESH, history.left.size)
    c = 2.0 * least_effort(problem, history.duration, intervals).costate
    linear, gauss = flow(problem), gauss_method(_POINTS)
    h, limit = history.duration / intervals, problem.limits.torque
    ahead: Array = np.array([linear.step(float(s))[0] @ problem.B for s in h * (1.0 - gauss.nodes)])
    rows, beyond = observability(linear.step(h)[0], c[None], intervals)
    p = np.abs(rows[:, 0] @ ahead.T)
    conjugate = np.where(p <= 2.0 * limit, 0.25 * p**2, limit * p - limit**2)
    total = h * float((conjugate @ gauss.weights).sum())
    multipliers = np.linalg.lstsq(problem.ends.T, c, rcond=None)[0]
    bound = float(multipliers @ (problem.ends @ problem.target) - c @ beyond @ problem.start - total)
    return history.effort / bound - 1.0
