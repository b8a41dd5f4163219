"""Minimum time of a nonlinear plant: the durations of a bang-bang torque's stretches, to the accuracy of the integration.

``min sum d_i`` such that the end conditions hold, with the durations d_i of the stretches as only unknowns. Its multipliers
give the costate; carried back along the motion it gives the switching function, whose sign must be the torque's.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from boomctl.arrays import Array, Indices
from boomctl.slew.dynamics import rates, shooting_step
from boomctl.slew.plant import Plant
from boomctl.slew.problem import SlewProblem
from boomctl.slew.torque import TorqueHistory, bang_bang

if TYPE_CHECKING:
    import casadi

__all__ = ["Sharpened", "sharpened"]

_MOST_STEPS = 8192
_NEWTON = 25
_EMPTY = 1e-6
_INSTANT = 1e-9
_SHARES = (0.0, 0.25, 0.5, 0.75, 1.0)


@dataclass(frozen=True, eq=False)
class Sharpened:
    """A bang-bang slew of a nonlinear plant.

    Attributes
    ----------
    history : TorqueHistory
    gain : float
        Time that the switching function says could be gained where its sign is not the torque's, over the duration.
    time, switching : ndarray
        The switching function, its Hamiltonian 1.
    step_error : float
        Change of the duration when the steps were halved, relative.
    """

    history: TorqueHistory
    gain: float
    time: Array
    switching: Array
    step_error: float


def sharpened(problem: SlewProblem, first: TorqueHistory, sizes: Array, tolerance: float) -> Sharpened | None:
    """Sharpen a bang-bang torque; None if no such torque with its number of switches leads to the end."""
    durations, sign = np.diff(first.edges), float(np.sign(first.left[0]))
    before, finer = None, 1
    while True:
        if durations.size < problem.ends.shape[0]:
            return None
        steps = finer * _steps(problem, durations)
        answer = _durations(problem, durations, sign, sizes, steps)
        if answer is None and before is None:
            answer = _led(problem, durations, sign, sizes, steps)
        if answer is None:
            return None
        durations, weights = answer
        if np.any(durations <= _EMPTY * durations.sum()):
            durations, sign = _without_empty(durations, sign)
            before = None
            continue
        change = np.inf if before is None else float(np.abs(durations - before).max() / durations.sum())
        if change < 0.002 * tolerance or 2 * steps.sum() > _MOST_STEPS:
            break
        before, finer = durations, 2 * finer
    edges = np.concatenate([[0.0], np.cumsum(durations)])
    history = bang_bang(edges[1:-1], float(edges[-1]), problem.torque_limit, sign)
    t, p = _switching_function(problem, history, weights, steps)
    torque = history(t)
    lost = np.maximum(-p * torque, 0.0)
    gain = 2.0 * float(np.sum(0.5 * (lost[1:] + lost[:-1]) * np.diff(t))) / history.duration
    return Sharpened(history, gain, t, p, change)


def _led(
    problem: SlewProblem, durations: Array, sign: float, sizes: Array, steps: Indices
) -> tuple[Array, Array] | None:
    """The same, led there from the linear plant through plants in between."""
    answer = None
    for share in _SHARES:
        answer = _durations(problem, durations, sign, sizes, steps, share)
        if answer is None or np.any(answer[0] <= _EMPTY * answer[0].sum()):
            return None
        durations = answer[0]
    return answer


def _steps(problem: SlewProblem, durations: Array) -> Indices:
    """Steps of each stretch such that the fastest mode that the torque moves turns by about one radian a step."""
    fastest = max(
        np.abs(np.linalg.eigvals(plant.A[np.ix_(plant.reach, plant.reach)])).max() for plant in problem.plants
    )
    return np.maximum(4, np.ceil(durations * fastest)).astype(int)


def _without_empty(durations: Array, sign: float) -> tuple[Array, float]:
    """Leave out a stretch of no length; its neighbours become one."""
    k = int(np.argmin(durations))
    if k == 0:
        return durations[1:], -sign
    if k == durations.size - 1:
        return durations[:-1], sign
    return np.concatenate([durations[: k - 1], [durations[k - 1] + durations[k + 1]], durations[k + 2 :]]), sign


@dataclass(frozen=True, eq=False)
class _Chain:
    """All steps of a plant under a bang-bang torque: end state, costates, rates at the ends of the stretches."""

    advance: "casadi.Function"
    slopes: "casadi.Function"
    rate: "casadi.Function"
    start: Array
    torques: Array
    last: Indices

    def motion(self, h: Array) -> Array:
        """States after all steps, n x (k + 1)."""
        z = np.array(self.advance(self.start, self.torques[None, :], h[None, :]))
        return np.column_stack([self.start, z])

    def moved(self, h: Array, z: Array, rows: Array) -> Array:
        """Derivatives of ``rows z(end)`` with respect to the durations of the stretches."""
        n, steps = self.start.size, self.torques.size
        steep = np.array(self.slopes(z[:, :-1], self.torques[None, :], h[None, :]))
        columns = np.empty((rows.shape[0], self.last.size))
        stretch, weights = self.last.size - 1, rows
        for k in range(steps - 1, -1, -1):
            if k == self.last[stretch]:
                columns[:, stretch] = weights @ np.array(self.rate(z[:, k + 1], self.torques[k], _INSTANT)).ravel()
                stretch -= 1
            weights = weights @ steep[:, k * n : (k + 1) * n]
        return columns


def _chains(problem: SlewProblem, count: int, sign: float, steps: Indices, share: float) -> list[_Chain]:
    import casadi as ca

    chains, first = [], 0
    torques = np.repeat(sign * problem.torque_limit * (-1.0) ** np.arange(count), steps)
    for plant in problem.plants:
        z, u, h = ca.SX.sym("z", plant.n), ca.SX.sym("u"), ca.SX.sym("h")
        one = _single(plant, share)
        slopes = ca.Function("slopes", [z, u, h], [ca.densify(ca.jacobian(one(z, u, h), z))])
        rate = ca.Function("rate", [z, u, h], [ca.densify(ca.jacobian(one(z, u, h), h))])
        start = problem.start[first : first + plant.n]
        advance, every = one.mapaccum("advance", torques.size), slopes.map(torques.size)
        chains.append(_Chain(advance, every, rate, start, torques, np.cumsum(steps) - 1))
        first += plant.n
    return chains


def _single(plant: Plant, share: float = 1.0) -> "casadi.Function":
    """``(z, u, h) -> z`` after a step under a constant torque."""
    import casadi as ca

    z, u, h = ca.SX.sym("z", plant.n), ca.SX.sym("u"), ca.SX.sym("h")
    return ca.Function("single", [z, u, h], [shooting_step(plant, 1, share)(z, u, u, h)])


def _durations(
    problem: SlewProblem, durations: Array, sign: float, sizes: Array, steps: Indices, share: float = 1.0
) -> tuple[Array, Array] | None:
    """Durations of least sum, and weights of the end conditions in the costate: Newton's method on both.

    The Lagrangian's second derivatives are differences of its first; they only steer. A stretch that would vanish is
    returned as it vanishes.
    """
    rows = problem.ends / np.abs(problem.ends * sizes).max(axis=1, keepdims=True)
    chains = _chains(problem, durations.size, sign, steps, share)
    blocks = np.split(rows, np.cumsum([plant.n for plant in problem.plants])[:-1], axis=1)

    def conditions(d: Array) -> tuple[Array, Array]:
        h = np.repeat(d / steps, steps)
        lack, slope = -rows @ problem.target, np.zeros((rows.shape[0], d.size))
        for chain, block in zip(chains, blocks, strict=True):
            z = chain.motion(h)
            lack = lack + block @ z[:, -1]
            slope += chain.moved(h, z, block)
        return lack, slope

    d, total, weights, size = durations, float(durations.sum()), np.zeros(0), np.inf
    for turn in range(_NEWTON):
        lack, slope = conditions(d)
        if not np.isfinite(slope).all():
            return None
        if turn == 0:
            weights = np.linalg.lstsq(slope.T, -np.ones(d.size), rcond=None)[0]
        move, weights = _newton_step(d, lack, slope, weights, conditions)
        before, size = size, float(np.abs(move).max() / total)
        if size < 1e-12 or (size < 1e-9 and size > 0.5 * before):
            return d, weights @ rows
        shrink = float(np.max(np.maximum(-move, 0.0) / d))
        d = d + move * min(1.0, 0.7 / shrink if shrink > 0.0 else 1.0, 0.1 / size)
        if d.min() < _EMPTY * total:
            return d, weights @ rows
    return None


def _newton_step(
    d: Array, lack: Array, slope: Array, weights: Array, conditions: Callable[[Array], tuple[Array, Array]]
) -> tuple[Array, Array]:
    """Change of the durations, and new weights."""
    count, m = d.size, lack.size
    curvature = np.zeros((count, count))
    if count > m:
        gap = 1e-6 * float(d.sum())
        for i in range(count):
            aside = d.copy()
            aside[i] += gap
            curvature[:, i] = weights @ (conditions(aside)[1] - slope) / gap
        curvature = 0.5 * (curvature + curvature.T)
    system = np.block([[curvature, slope.T], [slope, np.zeros((m, m))]])
    right = np.concatenate([-np.ones(count), -lack])
    scale = np.maximum(np.abs(system).max(axis=1), 1e-300)
    answer = np.linalg.lstsq(system / scale[:, None], right / scale, rcond=1e-14)[0]
    return answer[:count], answer[count:]


def _switching_function(
    problem: SlewProblem, history: TorqueHistory, weights: Array, steps: Indices
) -> tuple[Array, Array]:
    """Instants and switching function, from the costate carried back over the steps."""
    import casadi as ca

    widths = np.diff(history.edges)
    h, u = np.repeat(widths / steps, steps), np.repeat(history.left, steps)
    t = np.concatenate([[0.0], np.cumsum(h)])
    total, hamiltonian, first = np.zeros((2, t.size)), 0.0, 0
    for plant in problem.plants:
        own = slice(first, first + plant.n)
        one = _single(plant)
        z = np.array(one.mapaccum("all", u.size)(problem.start[own], u[None, :], h[None, :]))
        z = np.column_stack([problem.start[own], z])
        zs, us, hs = ca.SX.sym("z", plant.n), ca.SX.sym("u"), ca.SX.sym("h")
        slopes = ca.Function("slope", [zs, us, hs], [ca.jacobian(one(zs, us, hs), zs)])
        steep = np.array(ca.densify(slopes.map(u.size)(z[:, :-1], u[None, :], h[None, :])))
        f = rates(plant)
        push = ca.Function("push", [zs, us], [ca.densify(ca.jacobian(f(zs, us), us))])
        # just before and just after each instant
        sides = [np.array(push.map(t.size)(z, w[None, :])) for w in (np.append(u[0], u), np.append(u, u[-1]))]
        costate = np.empty((t.size, plant.n))
        costate[-1] = weights[own]
        for k in range(u.size - 1, -1, -1):
            costate[k] = costate[k + 1] @ steep[:, k * plant.n : (k + 1) * plant.n]
        for side in range(2):
            total[side] += np.sum(costate * sides[side].T, axis=1)
        hamiltonian += float(costate[-1] @ np.array(f(z[:, -1], u[-1])).ravel())
        first += plant.n
    return t, 0.5 * (total[0] + total[1]) / hamiltonian
