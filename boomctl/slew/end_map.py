"""The end of a slew as a function of its steps, on each of which the torque is held: value, sensitivity and Hessian.

A bang-bang torque consists of arcs, on which it is at its limit; every arc is cut into equal steps. The end's sensitivity
to the torques, weighted by the multipliers of the end conditions, is the switching function.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property, lru_cache

import casadi as ca
import numpy as np

from boomctl.arrays import Array
from boomctl.slew.dynamics import Kind, kind_of, step_of
from boomctl.slew.linear import guess_from
from boomctl.slew.problem import SlewProblem
from boomctl.slew.torque import TorqueProfile

STEP_FRACTION = 0.5  # fraction of the tolerance by which halved steps may change the end; their error is 1/15 of it
_AT_ONCE = 3 * 10**7  # instructions of CasADi between two checks of the deadline: a tenth of a second
CHORDS = 6  # corrections with the derivatives of coarser steps at most: one or two are usual
MOST_STEPS = 20000  # steps of a motion at most; rounding errors grow with their number


@dataclass(frozen=True, eq=False)
class Steps:
    """K steps: torques u [N m], widths h [s], and how the widths follow q durations of arcs, K x q."""

    u: Array
    h: Array
    moved: Array


@dataclass(frozen=True, eq=False)
class Sensitivity:
    """Terminal state after steps, in m rows, and its derivatives.

    Attributes
    ----------
    steps : Steps
    end : ndarray, m
    by_torque, by_width : ndarray, m x K
        Derivatives by the torque [N m] and the width [s] of each step.
    motions : tuple of (ndarray, ndarray)
        States n x (K + 1) and Jacobians K x n x (n + 2) of the steps, for each plant.
    """

    steps: Steps
    end: Array
    by_torque: Array
    by_width: Array
    motions: tuple[tuple[Array, Array], ...]

    @cached_property
    def by_duration(self) -> Array:
        """Derivatives by the durations of the arcs, m x q."""
        return self.by_width @ self.steps.moved

    @cached_property
    def multipliers(self) -> Array:
        """Multipliers of the end conditions at which the sum of the durations is stationary."""
        return np.linalg.lstsq(self.by_duration.T, -self.steps.moved.sum(axis=0), rcond=None)[0]

    @cached_property
    def switching_function(self) -> Array:
        """Time that a unit of torque saves in a unit of time, K."""
        return -(self.multipliers @ self.by_torque) / self.steps.h


def _parts(function: ca.Function, count: int) -> Iterator[slice]:
    """Divide steps into parts of about a tenth of a second; the deadline is checked between them."""
    size = max(1, _AT_ONCE // function.n_instructions())
    return (slice(first, first + size) for first in range(0, count, size))


@lru_cache
def _repeated(function: ca.Function, count: int) -> ca.Function:
    """Return the function of consecutive steps."""
    return function.mapaccum(count)


@lru_cache
def _jacobian(kind: Kind) -> ca.Function:
    """``(z, u, h, constants) -> z`` and its Jacobian n x (n + 2)."""
    z, u, h, constants = step_of(kind).sx_in()
    after = step_of(kind)(z, u, h, constants)
    jacobian = ca.densify(ca.jacobian(after, ca.vertcat(z, u, h)))
    return ca.Function("jacobian", [z, u, h, constants], [after, jacobian])


@lru_cache
def _hessian(kind: Kind) -> ca.Function:
    """``(z, u, h, constants, l) ->`` the Hessian of l^T z by (z, h)."""
    (z, u, h, constants), l = step_of(kind).sx_in(), ca.SX.sym("l", kind.n)
    second = ca.densify(ca.hessian(ca.dot(l, step_of(kind)(z, u, h, constants)), ca.vertcat(z, h))[0])
    return ca.Function("hessian", [z, u, h, constants, l], [second])


@dataclass(frozen=True, eq=False)
class EndMap:
    """Prescribed rows of the terminal state, as a function of the steps.

    Attributes
    ----------
    problem : SlewProblem
    rows : ndarray, m x n
        Rows of the terminal conditions, each scaled to about one.
    """

    problem: SlewProblem
    rows: Array

    @cached_property
    def target(self) -> Array:
        """Target values of the rows."""
        return self.rows @ self.problem.target

    @cached_property
    def step_frequency(self) -> float:
        """Frequency of the fastest mode [rad/s]; a step spans about one radian of it."""
        return max(float(np.abs(np.linalg.eigvals(plant.A)).max()) for plant in self.problem.plants)

    def steps(self, sign: float, durations: Array, counts: Array) -> Steps:
        """Divide arcs into equal steps, from the sign of the first torque and the durations [s] and counts of all arcs."""
        torques = sign * self.problem.limits.torque * (-1.0) ** np.arange(durations.size)
        moved = np.repeat(np.eye(durations.size) / counts, counts, axis=0)
        return Steps(np.repeat(torques, counts), moved @ durations, moved)

    def defect(self, steps: Steps) -> Array:
        """Return the terminal state after steps less the target."""
        end = -self.target
        for plant, own in self.problem.parts:
            kind, constants = kind_of(plant)
            move = _repeated(step_of(kind), steps.u.size)
            z = move(self.problem.start[own], steps.u[None], steps.h[None], constants).full()
            end += self.rows[:, own] @ z[:, -1]
        return end

    def sensitivity(self, steps: Steps) -> Sensitivity:
        """Return the terminal state after steps with its first derivatives."""
        u, h, m = steps.u, steps.h, self.rows.shape[0]
        end, by_torque, by_width, motions = np.zeros(m), np.zeros((m, u.size)), np.zeros((m, u.size)), []
        for plant, own in self.problem.parts:
            kind, constants = kind_of(plant)
            states, pieces, n = [self.problem.start[own][:, None]], [], plant.n
            for part in _parts(_jacobian(kind), u.size):
                self.problem.deadline.check(f"sensitivity of the end to {u.size} steps")
                move = _repeated(_jacobian(kind), u[part].size)
                following, item = move(states[-1][:, -1], u[None, part], h[None, part], constants)
                states.append(following.full())
                pieces.append(item.full().reshape(n, -1, n + 2).transpose(1, 0, 2))
            z, jacobians = np.hstack(states), np.concatenate(pieces)
            after = _carried_back(jacobians, self.rows[:, own])
            end += self.rows[:, own] @ z[:, -1]
            by_torque += np.einsum("kmi,ki->mk", after, jacobians[:, :, n])
            by_width += np.einsum("kmi,ki->mk", after, jacobians[:, :, n + 1])
            motions.append((z, jacobians))
        return Sensitivity(steps, end, by_torque, by_width, tuple(motions))

    def hessian(self, linearization: Sensitivity, weights: Array) -> Array:
        """Return the second derivatives of the weighted terminal state by the durations of the arcs, q x q."""
        u, h, moved = linearization.steps.u, linearization.steps.h, linearization.steps.moved
        total = np.zeros((moved.shape[1], moved.shape[1]))
        for (plant, own), (z, jacobians) in zip(self.problem.parts, linearization.motions, strict=True):
            (kind, constants), n, pieces = kind_of(plant), plant.n, []
            after = _carried_back(jacobians, weights[None, :] @ self.rows[:, own])[:, 0, :]
            for part in _parts(_hessian(kind), u.size):
                self.problem.deadline.check(f"curvature of the end over {u.size} steps")
                steps = _hessian(kind).map(u[part].size)
                item = np.array(steps(z[:, :-1][:, part], u[None, part], h[None, part], constants, after[part].T))
                pieces.append(item.reshape(n + 1, -1, n + 1).transpose(1, 0, 2))
            shifted = np.zeros((u.size, n + 1, moved.shape[1]))
            shifted[:, n, :] = moved
            for k in range(u.size - 1):
                shifted[k + 1, :n] = jacobians[k, :, :n] @ shifted[k, :n] + np.outer(jacobians[k, :, -1], moved[k])
            total += np.einsum("kiq,kir->qr", shifted, np.concatenate(pieces) @ shifted)
        return 0.5 * (total + total.T)


def _carried_back(jacobians: Array, rows: Array) -> Array:
    """Return the costates: rows of the terminal state propagated back to the ends of the steps, K x m x n."""
    n = rows.shape[1]
    after = np.empty((jacobians.shape[0], *rows.shape))
    for k in range(jacobians.shape[0] - 1, -1, -1):
        after[k] = rows
        rows = rows @ jacobians[k, :, :n]
    return after


def end_map(problem: SlewProblem, first: TorqueProfile) -> EndMap:
    """Prepare the steps of a problem; rows of its end are scaled by the largest states under a first torque."""
    rows = problem.ends / np.abs(problem.ends * guess_from(problem, first).sizes).max(axis=1, keepdims=True)
    return EndMap(problem, rows)
