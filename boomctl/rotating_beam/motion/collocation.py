"""Newton's method for the collocation equations of many steps at once.

The unknowns are the rates V at the nodes of a step; with the step h, coordinates and accelerations at the nodes are
``Q = q_0 + h A V`` and ``A^-1 (V - v_0) / h``, so stiff systems stay well scaled. One iteration linearizes all nodes of
a window of steps in one vectorised call, solves each step for its transition matrix and runs through the steps.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import final

import numpy as np
from numpy.polynomial import legendre

from boomctl.arrays import Array
from boomctl.exceptions import SimulationError
from boomctl.gauss import CollocationMethod, integrated_legendre
from boomctl.lti.rounding import SOLVED
from boomctl.progress import tell
from boomctl.rotating_beam.modal.equations import Tangents
from boomctl.rotating_beam.motion.problems import Problem

WINDOW = 64  # Steps solved at once; with 8 a run takes half as long again, 256 gain nothing.
_ITERATIONS = 12  # Most iterations of Newton's method: one to three are normal, more mean that the window is too long.
_SMALLEST_STEP = 1e-7  # Shortest step relative to the full duration; if it fails, there is no solution.


@final
@dataclass(frozen=True)
class Trajectory:
    """Coordinates and rates over m steps.

    Attributes
    ----------
    method : CollocationMethod
    edges : ndarray, m + 1
        Ends of the steps, s.
    q, v : ndarray, (m + 1) x n
        Coordinates and rates at the ends.
    stages : ndarray, m x s x n
        Rates at the nodes.
    """

    method: CollocationMethod
    edges: Array
    q: Array
    v: Array
    stages: Array

    def __call__(self, timepts: Array) -> tuple[Array, Array]:
        """Interpolate coordinates and rates at times within the steps, k x n each.

        The rates are interpolated between ends and nodes; the coordinates are the integral of the rates, so that both match
        the values at the ends.
        """
        timepts = np.asarray(timepts, dtype=float)
        step = np.clip(np.searchsorted(self.edges, timepts, side="right") - 1, 0, self.edges.size - 2)
        length = np.diff(self.edges)
        position = 2.0 * (timepts - self.edges[step]) / length[step] - 1.0
        coefficients = self._rate_coefficients()[step]
        degree = self.method.stages + 1
        v = np.einsum("kj,kjn->kn", legendre.legvander(position, degree), coefficients)
        moved = np.einsum("kj,kjn->kn", integrated_legendre(position, degree), coefficients)
        return self.q[step] + 0.5 * length[step, None] * moved, v

    def at_positions(self, positions: tuple[float, ...]) -> Array:
        """Return coordinates at the same relative positions in [0, 1] of every step; steps x positions x n."""
        moved = integrated_legendre(2.0 * np.array(positions) - 1.0, self.method.stages + 1)
        length = np.diff(self.edges)[:, None, None]
        return self.q[:-1, None] + 0.5 * length * (moved @ self._rate_coefficients())

    def highest_terms(self) -> Array:
        """Return the contribution of the two highest Legendre terms of the rates to each coordinate in a step, m x n."""
        highest = np.abs(self._rate_coefficients()[:, -2:]).max(axis=1)
        return 0.5 * np.diff(self.edges)[:, None] * highest

    def stage_rates(self, edges: Array) -> Array:
        """Return rates at the nodes of other steps over the same time, as start of a finer solution."""
        nodes = edges[:-1, None] + np.diff(edges)[:, None] * self.method.nodes
        _, v = self(nodes.ravel())
        return v.reshape(*nodes.shape, -1)

    def _rate_coefficients(self) -> Array:
        values = np.concatenate([self.v[:-1, None], self.stages, self.v[1:, None]], axis=1)
        return self.method.coefficients @ values


@final
@dataclass(frozen=True)
class _Window:
    """A few steps; q and v are at their ends."""

    q: Array
    v: Array
    stages: Array


def march(
    problem: Problem,
    method: CollocationMethod,
    edges: Array,
    start: tuple[Array, Array],
    guess: Trajectory | None,
    tolerance: float,
) -> Trajectory:
    """Solve the collocation equations over all steps, a window of steps at a time.

    If Newton's method fails, the window shrinks to one step, and then the step is halved.

    Parameters
    ----------
    problem : Problem
    method : CollocationMethod
    edges : ndarray, m + 1
        Ends of the steps, s.
    start : pair of ndarray, n
        Coordinates and rates at ``edges[0]``.
    guess : Trajectory or None
        A coarser solution over the same time.
    tolerance : float
        Largest change of a coordinate at which Newton's method stops.

    Raises
    ------
    SimulationError
        If the equations have no solution from some time on, even after the step is halved.
    """
    smallest = _SMALLEST_STEP * (edges[-1] - edges[0])
    windows, ends, first, wanted = [], [edges[:1]], 0, WINDOW
    q, v = start
    while first < edges.size - 1:
        tell("steps", first, edges.size - 1)
        last = min(first + wanted, edges.size - 1)
        here = edges[first : last + 1]
        window = _solve_window(problem, method, here, (q, v), guess, tolerance)
        if window is not None:
            windows.append(window)
            ends.append(here[1:])
            q, v, first, wanted = window.q[-1], window.v[-1], last, min(2 * wanted, WINDOW)
        elif last - first > 1:
            wanted = max(1, (last - first) // 4)
        elif here[1] - here[0] < smallest:
            raise SimulationError(problem.why(float(here[0])))
        else:
            edges = np.insert(edges, first + 1, 0.5 * (here[0] + here[1]))
    q = np.concatenate([windows[0].q[:1], *(window.q[1:] for window in windows)])
    v = np.concatenate([windows[0].v[:1], *(window.v[1:] for window in windows)])
    return Trajectory(method, np.concatenate(ends), q, v, np.concatenate([window.stages for window in windows]))


def _solve_window(
    problem: Problem,
    method: CollocationMethod,
    edges: Array,
    start: tuple[Array, Array],
    guess: Trajectory | None,
    tolerance: float,
) -> _Window | None:
    """Newton's method over the steps of a window; None if it does not converge to an admissible motion."""
    h = np.diff(edges)
    nodes = edges[:-1, None] + h[:, None] * method.nodes
    known = None if problem.linear else guess
    stages = problem.first_guess(nodes, edges[0], start[1]) if known is None else known.stage_rates(edges)
    for change, current in _newton(problem, method, nodes, h, _continued(method, h, start, stages)):
        if not np.isfinite(change):
            return None
        if problem.linear or change <= tolerance:
            at_nodes = current.q[:-1, None] + h[:, None, None] * (method.A @ current.stages)
            return current if problem.is_admissible(at_nodes.reshape(-1, at_nodes.shape[-1])) else None
    return None


def _continued(method: CollocationMethod, h: Array, start: tuple[Array, Array], stages: Array) -> _Window:
    """Return the ends of the steps that follow from the rates at the nodes."""
    q = start[0] + np.concatenate(
        [np.zeros((1, stages.shape[2])), np.cumsum(h[:, None] * (method.weights @ stages), 0)]
    )
    v = np.empty_like(q)
    v[0], keep, gains = start[1], 1.0 - method.carry.sum(), method.carry @ stages
    for k, gain in enumerate(gains):
        v[k + 1] = keep * v[k] + gain
    return _Window(q, v, stages)


def _newton(
    problem: Problem, method: CollocationMethod, nodes: Array, h: Array, current: _Window
) -> Iterator[tuple[float, _Window]]:
    """Return the iterates of Newton's method, each with the largest change that the next one is expected to make."""
    previous = np.inf
    for _ in range(_ITERATIONS):
        try:
            with np.errstate(over="ignore", invalid="ignore"):
                step = _newton_step(problem, method, nodes, h, current)
        except np.linalg.LinAlgError:
            return
        change = max(np.abs(step.q).max(), (h[:, None, None] * np.abs(step.stages)).max())
        current = _Window(current.q + step.q, current.v + step.v, current.stages + step.stages)
        size = max(np.abs(current.q).max(), (h[:, None, None] * np.abs(current.stages)).max(), 1e-300)
        expected = change * min(1.0, change / size if previous == np.inf else change / previous)
        if change <= SOLVED * size:  # change, relative to the motion, below which rounding is all that is left
            expected = 0.0
        yield float(expected), current
        previous = change


def _newton_step(problem: Problem, method: CollocationMethod, nodes: Array, h: Array, current: _Window) -> _Window:
    """Return the changes of ends and nodes that satisfy the linearized equations of all steps."""
    m, s, n = current.stages.shape
    item = h[:, None, None]
    q = current.q[:-1, None] + item * (method.A @ current.stages)
    a = method.A_inverse @ (current.stages - current.v[:-1, None]) / item
    flat = nodes.ravel(), q.reshape(-1, n), current.stages.reshape(-1, n), a.reshape(-1, n)
    residual = problem.residual(*flat)
    responses = _stage_responses(problem.tangents(*flat), residual.reshape(m, s * n), method, h, (m, s, n))
    dq, dv = _run_through(responses, method, h)
    state = np.concatenate([dq[:-1], dv[:-1], np.ones((m, 1))], axis=1)
    return _Window(dq, dv, (responses @ state[..., None]).reshape(m, s, n))


def _stage_responses(
    tangents: Tangents, residual: Array, method: CollocationMethod, h: Array, shape: tuple[int, int, int]
) -> Array:
    """Return the changes of a step's nodes by its initial coordinates and rates and the residual, m x s n x (2 n + 1)."""
    m, s, n = shape
    mass, damping, stiffness = (np.broadcast_to(item, (m * s, n, n)).reshape(m, s, n, n) for item in tangents)
    item = h[:, None, None, None]
    system = np.empty((m, s, n, s, n))
    right = np.empty((m, s, n, 2 * n + 1))
    for j in range(s):
        system[:, :, :, j] = (method.A_inverse[:, j, None, None] / item) * mass
        system[:, :, :, j] += (method.A[:, j, None, None] * item) * stiffness
        system[:, j, :, j] += damping[:, j]
    right[..., :n] = -stiffness
    right[..., n : 2 * n] = (method.A_inverse.sum(axis=1)[:, None, None] / item) * mass
    right[..., 2 * n] = -residual.reshape(m, s, n)
    return np.linalg.solve(system.reshape(m, s * n, s * n), right.reshape(m, s * n, 2 * n + 1))


def _run_through(responses: Array, method: CollocationMethod, h: Array) -> tuple[Array, Array]:
    """Return the changes at the ends of the steps, from none at the start."""
    m, n = responses.shape[0], (responses.shape[2] - 1) // 2
    stages = responses.reshape(m, method.stages, n, 2 * n + 1)
    transition = np.empty((m, 2 * n, 2 * n + 1))
    transition[:, :n] = h[:, None, None] * np.tensordot(method.weights, stages, (0, 1))
    transition[:, n:] = np.tensordot(method.carry, stages, (0, 1))
    index = np.arange(n)
    transition[:, index, index] += 1.0
    transition[:, n + index, n + index] += 1.0 - method.carry.sum()
    state = np.zeros((m + 1, 2 * n))
    for k in range(m):
        state[k + 1] = transition[k, :, :-1] @ state[k] + transition[k, :, -1]
    return state[:, :n], state[:, n:]
