"""Minimum time of a nonlinear plant: the durations of a bang-bang torque's stretches, to the accuracy of the integration.

``min sum d_i`` such that the end conditions hold, with the durations d_i of the stretches as only unknowns. Its multipliers
give the costate; carried back along the motion it gives the switching function, whose sign must be the torque's.
"""

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
        if np.any(durations <= 1e-7 * durations.sum()):
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
        if answer is None or np.any(answer[0] <= 1e-7 * answer[0].sum()):
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


def _motion(problem: SlewProblem, count: int, sign: float, steps: Indices, share: float) -> "casadi.Function":
    """``durations -> end state``."""
    import casadi as ca

    d, ends, first = ca.MX.sym("d", count), [], 0
    for plant in problem.plants:
        z = ca.MX(problem.start[first : first + plant.n])
        one = _single(plant, share)
        for k, many in enumerate(int(each) for each in steps):
            u = sign * problem.torque_limit * (-1.0) ** k
            stretch = one.mapaccum("stretch", many)
            z = stretch(z, ca.repmat(ca.MX(u), 1, many), ca.repmat(d[k] / many, 1, many))[:, -1]
        ends.append(z)
        first += plant.n
    return ca.Function("motion", [d], [ca.vertcat(*ends)])


def _single(plant: Plant, share: float = 1.0) -> "casadi.Function":
    """``(z, u, h) -> z`` after a step under a constant torque."""
    import casadi as ca

    z, u, h = ca.SX.sym("z", plant.n), ca.SX.sym("u"), ca.SX.sym("h")
    return ca.Function("single", [z, u, h], [shooting_step(plant, 1, share)(z, u, u, h)])


def _durations(
    problem: SlewProblem, durations: Array, sign: float, sizes: Array, steps: Indices, share: float = 1.0
) -> tuple[Array, Array] | None:
    """Durations of least sum, and weights of the end conditions in the costate."""
    import casadi as ca

    rows = problem.ends * sizes
    rows = problem.ends / np.abs(rows).max(axis=1, keepdims=True)
    d = ca.MX.sym("d", durations.size)
    unit = float(durations.sum())
    end = _motion(problem, durations.size, sign, steps, share)(d * unit)
    lack = ca.mtimes(ca.DM(rows), end - ca.DM(problem.target))
    options = {
        "ipopt.print_level": 0, "ipopt.sb": "yes", "print_time": False, "error_on_fail": False,
        "ipopt.tol": 1e-12, "ipopt.constr_viol_tol": 1e-12, "ipopt.max_iter": 60, "ipopt.mu_init": 1e-8,
        "ipopt.warm_start_init_point": "yes", "ipopt.warm_start_bound_push": 1e-12,
        "ipopt.warm_start_mult_bound_push": 1e-12, "ipopt.acceptable_tol": 1e-10, "ipopt.bound_relax_factor": 0.0,
        "ipopt.nlp_scaling_method": "none",
    }  # fmt: skip
    solver = ca.nlpsol("stretches", "ipopt", {"x": d, "f": ca.sum1(d), "g": lack}, options)
    answer = solver(x0=durations / unit, lbx=0.0, ubx=10.0, lbg=0.0, ubg=0.0)
    if not np.abs(np.array(answer["g"])).max() <= 1e-9:
        return None
    return np.array(answer["x"]).ravel() * unit, np.array(answer["lam_g"]).ravel() @ rows * unit


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
