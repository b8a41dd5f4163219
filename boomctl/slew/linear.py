"""The linear part of a slew: its motion under a held torque, its least effort, and a lower bound on the effort."""

from dataclasses import dataclass

import numpy as np

from boomctl.arrays import Array
from boomctl.gauss import gauss_method
from boomctl.lti.hold import observability, recursion, zero_order_hold
from boomctl.lti.rounding import SOLVED, SUMMED
from boomctl.slew.problem import SlewProblem
from boomctl.slew.torque import TorqueProfile, held

_NEWTON = 60  # damped Newton steps on the dual at most
_ARMIJO = 1e-4  # accept a Newton step if the decrease is at least this fraction of the predicted one
_NEARER = 0.5  # accept a full Newton step without line search if it reduces the residual by this factor
_SHORTEST = 1e-6  # smallest damping factor of a Newton step; below it the torque limit is too low for the time
_NEGLIGIBLE = 1e-9, 1e-6  # states below the first fraction of the largest are scaled by the second fraction of it
_MESH = 800  # intervals at least for the lower bound on the effort; more of them tighten it
_POINTS = 4  # Gauss points per interval: order 8, rounding error on such a mesh


@dataclass(frozen=True, eq=False)
class LinearFlow:
    """``z' = A z + B u`` with a torque u that is held; A is n x n, B has n entries."""

    A: Array
    B: Array

    def step(self, h: float) -> tuple[Array, Array]:
        """Return ``exp(A h)`` and the response ``int_0^h exp(A s) ds B`` to unit torque."""
        Phi, push = zero_order_hold(self.A, self.B[:, None], h)
        return Phi, push[:, 0]

    def carried(self, vector: Array, h: float, count: int) -> Array:
        """Return the unforced motion from a vector v in equal steps: ``v, exp(A h) v, ...``, n x count."""
        return observability(self.step(h)[0].T, vector[None], count)[0][:, 0].T

    def responses(self, duration: float, intervals: int) -> Array:
        """Return the end states due to unit torque on each of equal intervals, n x intervals."""
        h = duration / intervals
        return self.carried(self.step(h)[1], h, intervals)[:, ::-1]


def flow(problem: SlewProblem) -> LinearFlow:
    """Return the linear part of all plants of a problem."""
    return LinearFlow(problem.A, problem.B)


@dataclass(frozen=True, eq=False)
class LeastEffort:
    """Minimum-effort slew of the linear part: the torque, and the costate c at the end.

    ``u = c^T exp(A (T - t)) B``, clipped at the limit.  ``residual`` is that of the end conditions, relative to the
    largest of them: rounding error, unless the limit is too low for the time.
    """

    profile: TorqueProfile
    costate: Array
    residual: float


def least_effort(problem: SlewProblem, duration: float, intervals: int) -> LeastEffort:
    """Compute the minimum-effort slew of the linear part, the torque held on equal intervals and within its limit.

    If the limit is too low for the duration, the last iterate is returned, with its residual.
    """
    linear = flow(problem)
    G = problem.ends @ linear.responses(duration, intervals)
    d = problem.ends @ (problem.target - linear.step(duration)[0] @ problem.start)
    result = clipped(G, d, problem.limits.torque)
    costate = result.weights @ problem.ends * (duration / intervals)
    return LeastEffort(held(np.linspace(0.0, duration, intervals + 1), result.torques), costate, result.residual)


@dataclass(frozen=True, eq=False)
class Clipped:
    """Torques ``u = clip(G^T c)``, the weights c, and the residual of ``G u = d`` over the largest of d."""

    torques: Array
    weights: Array
    residual: float


def clipped(G: Array, d: Array, limit: float | Array, first: Array | None = None) -> Clipped:
    """Minimize ``|u|`` subject to ``G u = d`` and ``|u_k| <= limit``, a scalar or one limit per entry.

    One unknown c per row of G: Newton's method on ``G clip(G^T c) = d``, the gradient of a convex function of c, from
    initial weights, if any.
    """
    scale = np.linalg.norm(G, axis=1)
    rows, wanted = G / scale[:, None], d / scale

    def dual(c: Array) -> float:
        free = rows.T @ c
        u = np.clip(free, -limit, limit)
        return float(np.sum(u * free - 0.5 * u**2) - c @ wanted)

    # rcond: directions below rounding error are ignored
    c = np.linalg.lstsq(rows @ rows.T, wanted, rcond=1e-13)[0] if first is None else first * scale

    def missing(c: Array) -> tuple[Array, Array, float]:
        free = rows.T @ c
        u = np.clip(free, -limit, limit)
        defect = wanted - rows @ u
        return u, defect, float(np.abs(defect).max() / np.abs(wanted).max())

    u, defect, residual = missing(c)
    for _ in range(_NEWTON):
        if residual <= SOLVED:  # relative residual at rounding level
            break
        inner = rows[:, np.abs(u) < limit]
        move = np.linalg.lstsq(inner @ inner.T + SUMMED * np.eye(c.size), defect, rcond=1e-14)[0]
        whole = missing(c + move)
        if whole[2] > _NEARER * residual:  # insufficient decrease by the full step: line search on the dual
            size, before = 1.0, dual(c)
            while size > _SHORTEST and dual(c + size * move) > before - _ARMIJO * size * float(move @ defect):
                size *= 0.5
            if size <= _SHORTEST:
                break
            move, whole = size * move, missing(c + size * move)
        c, (u, defect, residual) = c + move, whole
    return Clipped(u, c / scale, residual)


@dataclass(frozen=True, eq=False)
class Guess:
    """Initial guess: a torque, and the linear motion under it.

    Attributes
    ----------
    duration : float
        Duration, s.
    torques : ndarray
        Torques on intervals or at nodes, N m.
    states : ndarray, (N + 1) x n
        States at nodes.
    """

    duration: float
    torques: Array
    states: Array

    @property
    def sizes(self) -> Array:
        """Largest absolute value of each state; a fraction of the largest state where it is zero."""
        sizes = np.abs(self.states).max(axis=0)
        negligible, instead = _NEGLIGIBLE
        return np.where(sizes > negligible * sizes.max(), sizes, instead * sizes.max())


def guess_from(problem: SlewProblem, profile: TorqueProfile, intervals: int = 200, ramp: bool = False) -> Guess:
    """Sample a torque and the linear motion under it on a mesh."""
    means = profile.interval_means(np.linspace(0.0, profile.duration, intervals + 1))
    Phi, push = flow(problem).step(profile.duration / intervals)
    states = recursion(Phi, push[:, None] * means, problem.start).T
    if ramp:
        means = np.concatenate([[0.0], 0.5 * (means[1:] + means[:-1]), [0.0]])
    return Guess(profile.duration, means, states)


def effort_gap(problem: SlewProblem, profile: TorqueProfile) -> float:
    """Return the relative gap between an effort and its lower bound within the limit: weak duality, on a separate mesh.

    For any c: ``int u^2 >= c^T d - int max_u (p u - u^2) dt`` with ``p = c^T exp(A (T - t)) B``; the maximum is ``p^2 / 4``
    within ``|p| <= 2 limit`` and ``limit |p| - limit^2`` beyond. The integral is summed in Gauss points.
    """
    intervals = max(_MESH, profile.start_values.size)
    c = 2.0 * least_effort(problem, profile.duration, intervals).costate
    linear, gauss = flow(problem), gauss_method(_POINTS)
    h, limit = profile.duration / intervals, problem.limits.torque
    ahead: Array = np.array([linear.step(float(s))[0] @ problem.B for s in h * (1.0 - gauss.nodes)])
    rows, beyond = observability(linear.step(h)[0], c[None], intervals)
    p = np.abs(rows[:, 0] @ ahead.T)
    conjugate = np.where(p <= 2.0 * limit, 0.25 * p**2, limit * p - limit**2)
    total = h * float((conjugate @ gauss.weights).sum())
    multipliers = np.linalg.lstsq(problem.ends.T, c, rcond=None)[0]
    bound = float(multipliers @ (problem.ends @ problem.target) - c @ beyond @ problem.start - total)
    return profile.effort / bound - 1.0
