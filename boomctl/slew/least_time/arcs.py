"""All steps of a slew's plants under a torque that is held on each, and what moves the end: first and second derivatives."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from boomctl.arrays import Array
from boomctl.slew.least_time.stepping import shooting_step
from boomctl.slew.plant import SlewPlant
from boomctl.slew.problem import SlewProblem

if TYPE_CHECKING:
    import casadi


@dataclass(frozen=True, eq=False)
class Reach:
    """Where steps lead, in m rows over the end state, and how that depends on the K steps.

    Attributes
    ----------
    end : ndarray, m
    by_torque, by_width : ndarray, m x K
        Derivatives by the torque [N m] and the width [s] of each step.
    passed : tuple of (ndarray, ndarray)
        Of each plant, the states n x (K + 1) and the derivatives K x n x (n + 2) of the steps.
    """

    end: Array
    by_torque: Array
    by_width: Array
    passed: tuple[tuple[Array, Array], ...]

    def weights(self, moved: Array) -> Array:
        """Multipliers of the end conditions with which all parameters, that move the widths by K x q, cost no time."""
        return np.linalg.lstsq((self.by_width @ moved).T, -moved.sum(axis=0), rcond=None)[0]


@dataclass(frozen=True, eq=False)
class _Stepper:
    """A plant's step ``(z, u, h) -> z``, its derivatives n x (n + 2), and second derivatives of l^T z by (z, h)."""

    plant: SlewPlant
    step: "casadi.Function"
    first: "casadi.Function"
    second: "casadi.Function"

    def motion(self, start: Array, u: Array, h: Array) -> Array:
        """States before and after all steps, n x (K + 1)."""
        return np.column_stack([start, np.array(self.step.mapaccum(u.size)(start, u[None, :], h[None, :]))])

    def slopes(self, z: Array, u: Array, h: Array) -> Array:
        """K x n x (n + 2)."""
        each = np.array(self.first.map(u.size)(z[:, :-1], u[None, :], h[None, :]))
        return each.reshape(self.plant.n, u.size, self.plant.n + 2).transpose(1, 0, 2)

    def bends(self, z: Array, u: Array, h: Array, after: Array) -> Array:
        """K x (n + 1) x (n + 1), of the costates K x n after the steps."""
        size = self.plant.n + 1
        each = np.array(self.second.map(u.size)(z[:, :-1], u[None, :], h[None, :], after.T))
        return each.reshape(size, u.size, size).transpose(1, 0, 2)


@dataclass(frozen=True, eq=False)
class Course:
    """The plants of a problem on their way."""

    problem: SlewProblem
    steppers: tuple[_Stepper, ...]
    rows: Array

    @property
    def pace(self) -> float:
        """Frequency that steps are to turn by about one radian, rad/s.

        That of the fastest mode that the torque moves; of the others the slowest is followed in steps of two.
        """
        return max(_pace(stepper.plant) for stepper in self.steppers)

    def _parts(self) -> list[tuple[_Stepper, slice]]:
        parts, first = [], 0
        for stepper in self.steppers:
            parts.append((stepper, slice(first, first + stepper.plant.n)))
            first += stepper.plant.n
        return parts

    def lack(self, u: Array, h: Array) -> Array:
        """What torques u [N m] held for times h [s] lack at the end."""
        end = -self.rows @ self.problem.target
        for stepper, own in self._parts():
            end += self.rows[:, own] @ stepper.motion(self.problem.start[own], u, h)[:, -1]
        return end

    def reach(self, u: Array, h: Array) -> Reach:
        """Where torques u [N m] held for times h [s] lead."""
        m = self.rows.shape[0]
        end, by_torque, by_width, passed = np.zeros(m), np.zeros((m, u.size)), np.zeros((m, u.size)), []
        for stepper, own in self._parts():
            z = stepper.motion(self.problem.start[own], u, h)
            steep = stepper.slopes(z, u, h)
            after = _costates(steep, self.rows[:, own])
            end += self.rows[:, own] @ z[:, -1]
            by_torque += np.einsum("kmn,kn->mk", after, steep[:, :, -2])
            by_width += np.einsum("kmn,kn->mk", after, steep[:, :, -1])
            passed.append((z, steep))
        return Reach(end, by_torque, by_width, tuple(passed))

    def curvature(self, u: Array, h: Array, reach: Reach, weights: Array, moved: Array) -> Array:
        """Second derivatives of the weighted end by q parameters that move the widths: `moved` is K x q."""
        total = np.zeros((moved.shape[1], moved.shape[1]))
        for (stepper, own), (z, steep) in zip(self._parts(), reach.passed, strict=True):
            n = stepper.plant.n
            after = _costates(steep, weights[None, :] @ self.rows[:, own])[:, 0, :]
            shifted = np.zeros((u.size, n + 1, moved.shape[1]))
            shifted[:, n, :] = moved
            for k in range(u.size - 1):
                shifted[k + 1, :n] = steep[k, :, :n] @ shifted[k, :n] + np.outer(steep[k, :, -1], moved[k])
            total += np.einsum("kiq,kir->qr", shifted, stepper.bends(z, u, h, after) @ shifted)
        return 0.5 * (total + total.T)


def _pace(plant: SlewPlant) -> float:
    reach = plant.controllable
    size = float(np.abs(np.linalg.eigvals(plant.A[np.ix_(reach, reach)])).max())
    if plant.frequencies is None or reach.all():
        return size
    return max(size, 0.5 * float(plant.frequencies[~reach[: plant.n // 2]].min()))


def stretches(torques: Array, durations: Array, steps: Array) -> tuple[Array, Array, Array]:
    """Torques and widths of all steps of stretches, and how the widths follow the durations, K x q."""
    moved = np.repeat(np.eye(durations.size) / steps, steps, axis=0)
    return np.repeat(torques, steps), moved @ durations, moved


def _costates(steep: Array, rows: Array) -> Array:
    """Rows carried back to the ends of the steps, K x m x n."""
    n = rows.shape[1]
    after = np.empty((steep.shape[0], *rows.shape))
    for k in range(steep.shape[0] - 1, -1, -1):
        after[k] = rows
        rows = rows @ steep[k, :, :n]
    return after


def course(problem: SlewProblem, sizes: Array) -> Course:
    """Prepare the steps of a problem; rows of its end are scaled by typical sizes of the states."""
    rows = problem.ends / np.abs(problem.ends * sizes).max(axis=1, keepdims=True)
    return Course(problem, tuple(_stepper(plant) for plant in problem.plants), rows)


def _stepper(plant: SlewPlant) -> _Stepper:
    import casadi as ca

    z, u, h, l = ca.SX.sym("z", plant.n), ca.SX.sym("u"), ca.SX.sym("h"), ca.SX.sym("l", plant.n)
    after = shooting_step(plant, 1)(z, u, u, h)
    slopes = ca.densify(ca.jacobian(after, ca.vertcat(z, u, h)))
    bends = ca.densify(ca.hessian(ca.dot(l, after), ca.vertcat(z, h))[0])
    return _Stepper(
        plant,
        ca.Function("step", [z, u, h], [after]),
        ca.Function("first", [z, u, h], [slopes]),
        ca.Function("second", [z, u, h, l], [bends]),
    )
