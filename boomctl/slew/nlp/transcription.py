"""A slew as a nonlinear program: one stage function, mapped over equal intervals, with its exact derivatives.

Each interval is integrated by Gauss-Legendre collocation; d points have order 2 d. The torque is linear on it.
Unknowns, stage after stage: states z_k of all plants, torque u_k, rates at the collocation points; then the last states
(and torque), the duration and the bound of the tip. All are scaled to about one. Jacobian and Hessian of the Lagrangian
are assembled from those of one stage, and these, by the chain rule, from those of the equations of motion, which all
meshes and orders of all plants of a kind share: other meshes are inexpensive to build.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import casadi as ca
import numpy as np

from boomctl.arrays import Array
from boomctl.gauss import gauss_method
from boomctl.slew.dynamics import kind_of, rate_hessian_of, rate_jacobian_of, rates_of
from boomctl.slew.objectives import OBJECTIVES, Interval, Parts, Units
from boomctl.slew.plant import SlewPlant
from boomctl.slew.problem import SlewProblem


@dataclass(frozen=True, eq=False)
class Layout:
    """Indices of the unknowns.

    Attributes
    ----------
    states : ndarray of int, (N + 1) x n
    torques : ndarray of int, N or N + 1
    rates : ndarray of int, N x (n d)
    duration, bound : int or None
    size : int
    """

    states: Array
    torques: Array
    rates: Array
    duration: int | None
    bound: int | None
    size: int

    @property
    def local(self) -> Array:
        """Unknowns of each stage, N x local: z, u, rates, next z, next u where it ramps, duration, bound."""
        N = self.rates.shape[0]
        parts = [self.states[:-1], self.torques[:N, None], self.rates, self.states[1:]]
        if self.torques.size > N:
            parts.append(self.torques[1:, None])
        return np.hstack([*parts, *(np.full((N, 1), i) for i in (self.duration, self.bound) if i is not None)])


@dataclass(frozen=True, eq=False)
class Transcription:
    """A nonlinear program that can be solved for any data.

    Attributes
    ----------
    problem : SlewProblem
        The problem it was built for; it can be solved for other data.
    intervals, points : int
        Number of intervals, and of collocation points on each.
    units : Units
    layout : Layout
    nlp : casadi.Function
        ``(x, p) -> f, g``. Parameters: scaled duration, then the limits other than the torque's. Conditions: for each
        stage the defects (= 0) and the inequalities (<= 0); then the end.
    derivatives : dict of str to casadi.Function
        Derivatives as options of CasADi's solvers.
    defects : int
        Number of defects of a stage.
    names : tuple of str
        Names of the inequalities of a stage.
    ends : ndarray, m x n
        Rows of the prescribed end, over scaled states.
    """

    problem: SlewProblem
    intervals: int
    points: int
    units: Units
    layout: Layout
    nlp: ca.Function = field(repr=False)
    derivatives: dict[str, Any] = field(repr=False)
    defects: int
    names: tuple[str, ...]
    ends: Array

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle the arguments only, a few kilobytes, in place of megabytes of CasADi functions."""
        return transcribe, (self.problem, self.intervals, self.points, self.units)


def transcribe(problem: SlewProblem, intervals: int, points: int, units: Units) -> Transcription:
    """Build the nonlinear program of a problem on a mesh of equal intervals with collocation points on each."""
    N, layout = intervals, _layout(problem, intervals, points)
    stage, local = _stage(problem, intervals, points, units, layout), layout.local
    x, p = ca.MX.sym("x", layout.size), ca.MX.sym("p", 1 + len(problem.limits.without_torque))
    every, data = ca.reshape(x[local.ravel().tolist()], local.shape[1], N), ca.repmat(p, 1, N)
    values, costs = stage.value.map(N)(every, data)
    scaled = problem.ends * units.states
    scaled /= np.maximum(np.abs(scaled).max(axis=1, keepdims=True), 1e-300)
    g = ca.vertcat(ca.vec(values), ca.mtimes(ca.DM(scaled), x[layout.states[-1].tolist()]))
    total, rows = ca.sum2(costs), int(stage.value.size1_out(0))

    gradients = ca.vec(stage.gradient.map(N)(every, data))
    gradient = ca.densify(_assembled([local.ravel()], [np.zeros(local.size, int)], (layout.size, 1), gradients))
    r, c = (np.array(item, int) for item in stage.jacobian_pattern.get_triplet())
    er, ec = np.nonzero(scaled)
    g_rows, g_columns = [np.arange(N)[:, None] * rows + r, N * rows + er], [local[:, c], layout.states[-1][ec]]
    entries = ca.vertcat(ca.vec(stage.jacobian.map(N)(every, data)), ca.DM(scaled[er, ec]))
    jacobian = _assembled(g_rows, g_columns, (int(g.shape[0]), layout.size), entries)
    weight, multipliers = ca.MX.sym("w"), ca.MX.sym("m", g.shape[0])
    per_stage = ca.reshape(multipliers[: N * rows], rows, N)
    nonzeros = stage.hessian.map(N)(every, data, ca.repmat(weight, 1, N), per_stage)
    hr, hc = (np.array(item, int) for item in stage.hessian_pattern.get_triplet())
    a, b = local[:, hr], local[:, hc]
    hessian = _assembled([np.minimum(a, b)], [np.maximum(a, b)], (layout.size, layout.size), ca.vec(nonzeros))
    signature = ["x", "p", "lam_f", "lam_g"]
    return Transcription(
        problem=problem,
        intervals=intervals,
        points=points,
        units=units,
        layout=layout,
        nlp=ca.Function("nlp", [x, p], [total, g], ["x", "p"], ["f", "g"]),
        derivatives={
            "grad_f": ca.Function("grad_f", [x, p], [total, gradient], ["x", "p"], ["f", "grad_f_x"]),
            "jac_g": ca.Function("jac_g", [x, p], [g, jacobian], ["x", "p"], ["g", "jac_g_x"]),
            "hess_lag": ca.Function(
                "hess_lag", [x, p, weight, multipliers], [hessian], signature, ["triu_hess_gamma_x_x"]
            ),
        },
        defects=rows - len(stage.names),
        names=stage.names,
        ends=scaled,
    )


def _layout(problem: SlewProblem, N: int, points: int) -> Layout:
    n = problem.start.size
    first = np.arange(N) * (n + 1 + n * points)
    last = N * (n + 1 + n * points)
    torques, more = first + n, last + n
    if problem.ramps:
        torques, more = np.append(torques, more), more + 1
    duration = bound = None
    if problem.duration is None:
        duration, more = more, more + 1
    if OBJECTIVES[problem.objective].bounds_tip:
        bound, more = more, more + 1
    return Layout(
        states=np.append(first, last)[:, None] + np.arange(n),
        torques=torques,
        rates=first[:, None] + n + 1 + np.arange(n * points),
        duration=duration,
        bound=bound,
        size=more,
    )


@dataclass(frozen=True, eq=False)
class _Stage:
    """Functions of the unknowns of a stage and the parameters: conditions and cost with their derivatives, by nonzeros."""

    value: ca.Function
    jacobian: ca.Function
    gradient: ca.Function
    hessian: ca.Function
    jacobian_pattern: Any
    hessian_pattern: Any
    names: tuple[str, ...]


class _Point:
    """A point at which a stage evaluates the rates of a plant: states and torque, and symbols for rates and derivatives."""

    def __init__(self, plant: SlewPlant, arguments: ca.SX, number: int) -> None:
        self.arguments, (self.kind, self.constants) = arguments, kind_of(plant)
        self.rates, self.weights = (ca.SX.sym(f"{name}{number}", plant.n) for name in ("rates", "weights"))
        self.jacobian = ca.SX.sym(f"jacobian{number}", rate_jacobian_of(self.kind).sparsity_out(1))
        self.hessian = ca.SX.sym(f"hessian{number}", rate_hessian_of(self.kind).sparsity_out(2))
        first = [self.rates, self.jacobian]
        self.by_order = [self.rates], first, [self.weights, *first, self.hessian]


def _stage(problem: SlewProblem, intervals: int, points: int, units: Units, layout: Layout) -> _Stage:
    """Return the stage function, scaled, and its derivatives."""
    n, extra, parts, objective = problem.start.size, layout.rates.shape[1], problem.parts, OBJECTIVES[problem.objective]
    v, p = ca.SX.sym("v", layout.local.shape[1]), ca.SX.sym("p", 1 + len(problem.limits.without_torque))
    at = 2 * n + 1 + extra
    limits = {kind: p[1 + i] for i, kind in enumerate(problem.limits.without_torque)}
    time = (v[at + problem.ramps] if problem.duration is None else p[0]) * units.time
    evaluations: list[_Point] = []

    def rates(plant: SlewPlant, z: ca.SX, u: ca.SX) -> ca.SX:
        evaluations.append(_Point(plant, ca.vertcat(z, u), len(evaluations)))
        return evaluations[-1].rates

    s = Interval(
        z=v[:n],
        u=v[n],
        k=v[n + 1 : n + 1 + extra],
        z1=v[n + 1 + extra : at],
        u1=v[at] if problem.ramps else v[n],
        h=time / intervals,
        bound=v[-1] if objective.bounds_tip else None,
        rates=rates,
    )
    limited, names = _limited(parts, units, s, limits)
    value = ca.vertcat(_defects(parts, points, units, s), limited)
    of_defects = len(evaluations)
    cost = objective.cost(parts, units, s, intervals)
    every = ca.vertcat(*(item.rates for item in evaluations))
    rate_jacobian = ca.vertcat(*(ca.mtimes(item.jacobian, ca.jacobian(item.arguments, v)) for item in evaluations))
    jacobian, gradient = (
        ca.jacobian(item, v) + ca.mtimes(ca.jacobian(item, every), rate_jacobian) for item in (value, cost)
    )
    inputs = [v, p, ca.SX.sym("w"), ca.SX.sym("m", value.shape[0])]
    lagrangian = inputs[2] * cost + ca.dot(inputs[3], value)
    hessian = ca.triu(_total_hessian(lagrangian, v, every, evaluations, rate_jacobian))
    weights = _evaluated("weights", inputs, evaluations, [ca.gradient(lagrangian, item.rates) for item in evaluations])
    return _Stage(
        value=_evaluated("stage", [v, p], evaluations, [value, cost]),
        jacobian=_evaluated("jacobian", [v, p], evaluations[:of_defects], [_nonzeros(jacobian)], 1),
        gradient=_evaluated("gradient", [v, p], evaluations[of_defects:], [ca.densify(gradient.T)], 1),
        hessian=_evaluated("hessian", inputs, evaluations, [_nonzeros(hessian)], 2, weights),
        jacobian_pattern=jacobian.sparsity(),
        hessian_pattern=hessian.sparsity(),
        names=names,
    )


def _nonzeros(matrix: ca.SX) -> ca.SX:
    return ca.sparsity_cast(matrix, ca.Sparsity.dense(matrix.nnz(), 1))


def _total_hessian(lagrangian: ca.SX, v: ca.SX, rates: ca.SX, points: Sequence[_Point], rate_jacobian: ca.SX) -> ca.SX:
    """Return the Hessian by v, through the rates too; slopes are the derivatives of the rates by v."""
    along = ca.vertcat(ca.SX.eye(v.shape[0]), rate_jacobian)
    total = ca.mtimes([along.T, ca.hessian(lagrangian, ca.vertcat(v, rates))[0], along])
    bent = ca.SX(0)
    for item in points:
        moved = ca.jacobian(item.arguments, v)
        total += ca.mtimes([moved.T, item.hessian, moved])
        bent += ca.dot(ca.mtimes(item.jacobian.T, item.weights), item.arguments)
    return total + ca.hessian(bent, v)[0]


def _evaluated(
    name: str, inputs: list[ca.SX], points: Sequence[_Point], values: list[ca.SX], order: int = 0, weights: Any = None
) -> ca.Function:
    """Return a function of v, p (and multipliers) from expressions with the symbols of points up to an order.

    The equations of motion are called, not expanded.  ``weights`` returns the weights of the rates at each point.
    """
    symbols = [symbol for item in points for symbol in item.by_order[order]]
    inner = ca.Function(name, [*inputs, *symbols], values)
    x, equations, results = inner.mx_in()[: len(inputs)], (rates_of, rate_jacobian_of, rate_hessian_of)[order], []
    states = ca.Function("arguments", inputs[:2], [item.arguments for item in points]).call(x[:2])
    given = [[] for _ in points] if weights is None else [[item] for item in weights.call(x)]
    for item, at, weight in zip(points, states, given, strict=True):
        results += [*weight, *equations(item.kind).call([at[:-1], at[-1], ca.DM(item.constants), *weight])]
    return ca.Function(name, x, inner.call([*x, *results]))


def _defects(parts: Parts, points: int, units: Units, s: Interval) -> ca.SX:
    """Return the defects of the equations of motion: of the rates at the collocation points and of the next states."""
    u, u1, rule = s.u * units.torque, s.u1 * units.torque, gauss_method(points)
    defects, first = [], 0
    for plant, own in parts:
        unit = ca.DM(units.states[own])
        z, k = s.z[own] * unit, ca.reshape(s.k[first : first + plant.n * points], plant.n, points)
        k *= ca.repmat(unit / units.time, 1, points)
        for i, c in enumerate(rule.nodes):
            inner = z + s.h * ca.mtimes(k, ca.DM(rule.A[i]))
            defects.append((s.rates(plant, inner, u + c * (u1 - u)) - k[:, i]) / (unit / units.time))
        defects.append((z + s.h * ca.mtimes(k, ca.DM(rule.weights))) / unit - s.z1[own])
        first += plant.n * points
    return ca.vertcat(*defects)


def _limited(parts: Parts, units: Units, s: Interval, limits: dict[str, ca.SX]) -> tuple[ca.SX, tuple[str, ...]]:
    """Return the inequalities (<= 0) at the end of the interval and of the torque rate, and their names."""
    pairs = []
    for plant, own in parts:
        for kind in (kind for kind in limits if kind in plant.rows):
            row = plant.rows[kind] * units.states[own]
            size = float(np.abs(row).max())
            pairs.append((f"{kind}_limit", ca.dot(ca.DM(row / size), s.z1[own]), limits[kind] / size))
        if s.bound is not None:
            row = plant.rows["tip"] * units.states[own] / units.tip
            pairs.append(("the bound of the tip", ca.dot(ca.DM(row), s.z1[own]), s.bound))
    if "torque_rate" in limits:
        pairs.append(("torque_rate_limit", s.u1 - s.u, limits["torque_rate"] * s.h / units.torque))
    lines = [line for _, value, most in pairs for line in (value - most, -value - most)]
    return ca.vertcat(ca.SX(0, 1), *lines), tuple(name for name, _, _ in pairs for _ in range(2))


def _assembled(rows: list[Array], columns: list[Array], shape: tuple[int, int], entries: ca.MX) -> ca.MX:
    """Return a sparse matrix with entries at (rows, columns); entries with equal indices are added."""
    row = np.concatenate([np.ravel(item) for item in rows]).astype(np.int64)
    column = np.concatenate([np.ravel(item) for item in columns]).astype(np.int64)
    position, inverse = np.unique(column * shape[0] + row, return_inverse=True)
    pattern = ca.Sparsity.triplet(*shape, (position % shape[0]).tolist(), (position // shape[0]).tolist())
    adding = ca.Sparsity.triplet(position.size, row.size, inverse.tolist(), list(range(row.size)))
    return ca.MX(pattern, ca.mtimes(ca.DM(adding, np.ones(row.size)), entries))
