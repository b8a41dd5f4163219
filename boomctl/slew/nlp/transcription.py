"""A slew as a nonlinear programme: one stage function, mapped over equal intervals, with its exact derivatives.

Each interval is integrated by Gauss-Legendre collocation; d points are of order 2 d. The torque is a straight line on it.
Unknowns, stage after stage: states z_k of all plants, torque u_k, rates at the collocation points; then the last states
(and torque), the duration and the bound of the tip. All are scaled to about one. Jacobian and Hessian of the Lagrangian
are assembled from those of one stage, and these, by the chain rule, from those of the equations of motion, which all
meshes and orders of all plants of a kind share: another mesh costs next to nothing to build.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import casadi as ca
import numpy as np

from boomctl.arrays import Array
from boomctl.gauss import gauss_method
from boomctl.slew.dynamics import Kind, kind_of, rate_hessian_of, rate_jacobian_of, rates_of
from boomctl.slew.nlp.interval import Interval, Units
from boomctl.slew.objectives import OBJECTIVES, Parts
from boomctl.slew.plant import SlewPlant

_AT_NODES = ("speed", "tip", "moment")
"""Limits that are kept at the nodes; that of the torque is a bound, that of its slope a condition of each interval."""


@dataclass(frozen=True)
class Scheme:
    """How a slew is made finite.

    Attributes
    ----------
    objective : str
    intervals : int
    points : int
        Collocation points on each interval.
    ramp : bool
        Whether the torque is continuous and straight between nodes; else it is constant on each interval.
    free_time : bool
    limits : tuple of str
        Which of "torque_rate", "speed", "tip", "moment" are limited.
    """

    objective: str
    intervals: int
    points: int
    ramp: bool = False
    free_time: bool = False
    limits: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class Layout:
    """Where what stands among the unknowns.

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

    @property
    def last(self) -> Array:
        """Unknowns of the last node: z, bound."""
        return np.append(self.states[-1], [] if self.bound is None else self.bound).astype(int)


@dataclass(frozen=True, eq=False)
class Transcription:
    """A nonlinear programme ready to be solved with any data.

    Attributes
    ----------
    scheme : Scheme
    units : Units
    layout : Layout
    nlp : casadi.Function
        ``(x, p) -> f, g``. Parameters: duration over its unit, then the limits of the scheme. Conditions: of each stage the
        defects, which are zero, and the inequalities, which are at most zero; inequalities of the last node; the end.
    derivatives : dict of str to casadi.Function
        As options of CasADi's solvers.
    defects : int
        Of a stage.
    names : tuple of str
        What the inequalities of a stage are.
    last : int
        Inequalities of the last node.
    ends : ndarray, m x n
        Rows of the prescribed end, over scaled states.
    blocks : tuple of slice
        Places of the plants in the states.
    made_of : tuple
        What `transcribe` was given.
    """

    scheme: Scheme
    units: Units
    layout: Layout
    nlp: ca.Function
    derivatives: dict[str, Any]
    defects: int
    names: tuple[str, ...]
    last: int
    ends: Array
    blocks: tuple[slice, ...]
    made_of: tuple[Any, ...] = field(repr=False)

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle what it was made of: a few kilobytes and 0.1 s, in place of megabytes of CasADi functions."""
        return transcribe, self.made_of

    @property
    def stage_rows(self) -> int:
        """Conditions of a stage."""
        return self.defects + len(self.names)

    @property
    def stages_end(self) -> int:
        """Where the conditions of all stages end."""
        return self.stage_rows * self.scheme.intervals


def transcribe(parts: Parts, ends: Array, scheme: Scheme, units: Units) -> Transcription:
    """Build the programme.

    Parameters
    ----------
    parts : tuple of (SlewPlant, slice)
    ends : ndarray, m x n
        Rows over all states that are prescribed at the end.
    scheme : Scheme
    units : Units
    """
    N, layout = scheme.intervals, _layout(scheme, units.states.size)
    stage, local = _stage(parts, scheme, units, layout), layout.local
    x, p = ca.MX.sym("x", layout.size), ca.MX.sym("p", 1 + len(scheme.limits))
    every, data = ca.reshape(x[local.ravel().tolist()], local.shape[1], N), ca.repmat(p, 1, N)
    last = ca.vertcat(*[x[int(i)] for i in layout.last])
    values, costs = stage.value.map(N)(every, data)
    paths = stage.path(last, p)
    scaled = ends * units.states / np.maximum(np.abs(ends * units.states).max(axis=1, keepdims=True), 1e-300)
    g = ca.vertcat(ca.vec(values), paths, ca.mtimes(ca.DM(scaled), x[layout.states[-1].tolist()]))
    total, rows, last_rows = ca.sum2(costs), int(stage.value.size1_out(0)), int(paths.shape[0])

    gradients = ca.vec(stage.gradient.map(N)(every, data))
    gradient = ca.densify(_assembled([local.ravel()], [np.zeros(local.size, int)], (layout.size, 1), gradients))
    r, c = (np.array(item) for item in stage.jacobian_pattern.get_triplet())
    pr, pc = (np.array(item) for item in stage.path_pattern.get_triplet())
    er, ec = np.nonzero(scaled)
    g_rows = [np.arange(N)[:, None] * rows + r, N * rows + pr, N * rows + last_rows + er]
    g_columns = [
        local[:, c] if c.size else np.zeros((N, 0), int),
        layout.last[pc] if pc.size else pc,
        layout.states[-1][ec],
    ]
    entries = ca.vertcat(
        ca.vec(stage.jacobian.map(N)(every, data)),
        stage.path_jacobian(x[layout.last.tolist()], p),
        ca.DM(scaled[er, ec]),
    )
    jacobian = _assembled(g_rows, g_columns, (int(g.shape[0]), layout.size), entries)
    weight, multipliers = ca.MX.sym("w"), ca.MX.sym("m", g.shape[0])
    per_stage = ca.reshape(multipliers[: N * rows], rows, N)
    nonzeros = stage.hessian.map(N)(every, data, ca.repmat(weight, 1, N), per_stage)
    hr, hc = (np.array(item) for item in stage.hessian_pattern.get_triplet())
    a, b = local[:, hr], local[:, hc]
    hessian = _assembled([np.minimum(a, b)], [np.maximum(a, b)], (layout.size, layout.size), ca.vec(nonzeros))
    given = ["x", "p", "lam_f", "lam_g"]
    return Transcription(
        scheme=scheme,
        units=units,
        layout=layout,
        nlp=ca.Function("nlp", [x, p], [total, g], ["x", "p"], ["f", "g"]),
        derivatives={
            "grad_f": ca.Function("grad_f", [x, p], [total, gradient], ["x", "p"], ["f", "grad_f_x"]),
            "jac_g": ca.Function("jac_g", [x, p], [g, jacobian], ["x", "p"], ["g", "jac_g_x"]),
            "hess_lag": ca.Function("hess_lag", [x, p, weight, multipliers], [hessian], given, ["triu_hess_gamma_x_x"]),
        },
        defects=rows - len(stage.names),
        names=stage.names,
        last=last_rows,
        ends=scaled,
        blocks=tuple(own for _, own in parts),
        made_of=(parts, ends, scheme, units),
    )


def _layout(scheme: Scheme, n: int) -> Layout:
    N, extra = scheme.intervals, n * scheme.points
    width = n + 1 + extra
    first = np.arange(N) * width
    states = np.vstack([first[:, None] + np.arange(n), N * width + np.arange(n)])
    torques = first + n
    size = N * width + n
    if scheme.ramp:
        torques, size = np.append(torques, size), size + 1
    duration = bound = None
    if scheme.free_time:
        duration, size = size, size + 1
    if OBJECTIVES[scheme.objective].bounds_tip:
        bound, size = size, size + 1
    return Layout(
        states=states,
        torques=torques,
        rates=first[:, None] + n + 1 + np.arange(extra),
        duration=duration,
        bound=bound,
        size=size,
    )


@dataclass(frozen=True, eq=False)
class _Stage:
    """Functions of the unknowns of a stage and the parameters: conditions and cost with their derivatives, by nonzeros."""

    value: ca.Function
    jacobian: ca.Function
    gradient: ca.Function
    hessian: ca.Function
    path: ca.Function
    path_jacobian: ca.Function
    jacobian_pattern: Any
    hessian_pattern: Any
    path_pattern: Any
    names: tuple[str, ...]


class _Point:
    """A place where a stage needs the rates of a plant: its states and torque, and symbols for rates and derivatives."""

    def __init__(self, plant: SlewPlant, place: ca.SX, number: int) -> None:
        self.place, (self.kind, self._constants) = place, kind_of(plant)
        self.rates, self.weights = (ca.SX.sym(f"{name}{number}", plant.n) for name in ("rates", "weights"))
        self.jacobian = ca.SX.sym(f"jacobian{number}", rate_jacobian_of(self.kind).sparsity_out(1))
        self.hessian = ca.SX.sym(f"hessian{number}", rate_hessian_of(self.kind).sparsity_out(1))

    def evaluated(self, equations: Callable[[Kind], ca.Function], place: ca.MX, *more: ca.MX) -> Any:
        """Return what functions of the kind are at a place; they are called and not expanded."""
        return equations(self.kind)(place[:-1], place[-1], ca.DM(self._constants), *more)


def _stage(parts: Parts, scheme: Scheme, units: Units, layout: Layout) -> _Stage:
    """Return the stage function, scaled, and its derivatives."""
    n, extra = units.states.size, layout.rates.shape[1]
    v, p = ca.SX.sym("v", layout.local.shape[1]), ca.SX.sym("p", 1 + len(scheme.limits))
    at = 2 * n + 1 + extra
    limits = {kind: p[1 + i] for i, kind in enumerate(scheme.limits)}
    time = (v[at + scheme.ramp] if scheme.free_time else p[0]) * units.time
    points: list[_Point] = []

    def rates(plant: SlewPlant, z: ca.SX, u: ca.SX) -> ca.SX:
        points.append(_Point(plant, ca.vertcat(z, u), len(points)))
        return points[-1].rates

    s = Interval(
        z=v[:n],
        u=v[n],
        k=v[n + 1 : n + 1 + extra],
        z1=v[n + 1 + extra : at],
        u1=v[at] if scheme.ramp else v[n],
        h=time / scheme.intervals,
        bound=v[layout.local.shape[1] - 1] if OBJECTIVES[scheme.objective].bounds_tip else None,
        rates=rates,
    )
    path, names = _path(parts, units, s, limits)
    conditions = [_defects(parts, scheme.points, units, s), path]
    if "torque_rate" in limits:
        change, most = s.u1 - s.u, limits["torque_rate"] * s.h / units.torque
        conditions += [change - most, -change - most]
        names += ["torque_rate_limit"] * 2
    value, of_defects = ca.vertcat(*conditions), len(points)
    cost = OBJECTIVES[scheme.objective].cost(parts, units, s, scheme.intervals)
    slopes = ca.vertcat(*(ca.mtimes(item.jacobian, ca.jacobian(item.place, v)) for item in points))
    jacobian, gradient = (
        ca.jacobian(item, v) + ca.mtimes(ca.jacobian(item, _rates(points)), slopes) for item in (value, cost)
    )
    weight, multipliers = ca.SX.sym("w"), ca.SX.sym("m", value.shape[0])
    lagrangian = weight * cost + ca.dot(multipliers, value)
    hessian = ca.triu(_total_hessian(lagrangian, v, points, slopes))
    node = s.z if s.bound is None else ca.vertcat(s.z, s.bound)
    path_jacobian = ca.jacobian(path, node)
    return _Stage(
        value=_with_rates("stage", v, p, points, [value, cost]),
        jacobian=_with_jacobians("jacobian", v, p, points[:of_defects], _nonzeros(jacobian)),
        gradient=_with_jacobians("gradient", v, p, points[of_defects:], ca.densify(gradient.T)),
        hessian=_with_hessians(v, p, points, weight, multipliers, lagrangian, _nonzeros(hessian)),
        path=ca.Function("path", [node, p], [path]),
        path_jacobian=ca.Function("path_jacobian", [node, p], [_nonzeros(path_jacobian)]),
        jacobian_pattern=jacobian.sparsity(),
        hessian_pattern=hessian.sparsity(),
        path_pattern=path_jacobian.sparsity(),
        names=tuple(names),
    )


def _rates(points: Sequence[_Point]) -> ca.SX:
    return ca.vertcat(*(item.rates for item in points))


def _nonzeros(matrix: ca.SX) -> ca.SX:
    return ca.sparsity_cast(matrix, ca.Sparsity.dense(matrix.nnz(), 1))


def _total_hessian(lagrangian: ca.SX, v: ca.SX, points: Sequence[_Point], slopes: ca.SX) -> ca.SX:
    """Return the Hessian by v, through the rates too; slopes are the derivatives of the rates by v."""
    along = ca.vertcat(ca.SX.eye(v.shape[0]), slopes)
    total = ca.mtimes([along.T, ca.hessian(lagrangian, ca.vertcat(v, _rates(points)))[0], along])
    bent = ca.SX(0)
    for item in points:
        moved = ca.jacobian(item.place, v)
        total += ca.mtimes([moved.T, item.hessian, moved])
        bent += ca.dot(ca.mtimes(item.jacobian.T, item.weights), item.place)
    return total + ca.hessian(bent, v)[0]


def _with_rates(name: str, v: ca.SX, p: ca.SX, points: Sequence[_Point], values: list[ca.SX]) -> ca.Function:
    """Return a function of v and p of expressions in which rates at points stand."""
    inner = ca.Function(name, [v, p, _rates(points)], values)
    x, data = inner.mx_in()[:2]
    result = [item.evaluated(rates_of, place) for item, place in _places(v, p, points, x, data)]
    return ca.Function(name, [x, data], inner.call([x, data, ca.vertcat(*result)]))


def _with_jacobians(name: str, v: ca.SX, p: ca.SX, points: Sequence[_Point], value: ca.SX) -> ca.Function:
    """Return a function of v and p of an expression in which rates at points and their Jacobians stand."""
    inner = ca.Function(name, [v, p, _rates(points), *(item.jacobian for item in points)], [value])
    x, data = inner.mx_in()[:2]
    result = [item.evaluated(rate_jacobian_of, place) for item, place in _places(v, p, points, x, data)]
    return ca.Function(name, [x, data], [inner(x, data, ca.vertcat(*(f for f, _ in result)), *(J for _, J in result))])


def _with_hessians(
    v: ca.SX, p: ca.SX, points: Sequence[_Point], weight: ca.SX, multipliers: ca.SX, lagrangian: ca.SX, value: ca.SX
) -> ca.Function:
    """Return a function of v, p and multipliers of an expression in which derivatives of the rates by v stand."""
    of_rates = [v, p, _rates(points), weight, multipliers]
    weights = ca.Function("weights", of_rates, [ca.gradient(lagrangian, item.rates) for item in points])
    symbols = [(item.weights, item.jacobian, item.hessian) for item in points]
    inner = ca.Function("hessian", [*of_rates, *(item for three in symbols for item in three)], [value])
    x, data, w, m = (
        ca.MX.sym(name, item.shape[0]) for name, item in zip("xpwm", (v, p, weight, multipliers), strict=True)
    )
    places = _places(v, p, points, x, data)
    given = x, data, ca.vertcat(*(item.evaluated(rates_of, place) for item, place in places)), w, m
    result = weights.call(given)
    derivatives = [
        item
        for (point, place), l in zip(places, result, strict=True)
        for item in (l, *point.evaluated(rate_hessian_of, place, l))
    ]
    return ca.Function("hessian", [x, data, w, m], [inner(*given, *derivatives)])


def _places(v: ca.SX, p: ca.SX, points: Sequence[_Point], x: ca.MX, data: ca.MX) -> list[tuple[_Point, ca.MX]]:
    """Return points with their places as functions of v and p."""
    return list(
        zip(points, ca.Function("places", [v, p], [item.place for item in points]).call([x, data]), strict=True)
    )


def _defects(parts: Parts, points: int, units: Units, s: Interval) -> ca.SX:
    """By how much the next states, and the rates at the collocation points, miss the equations of motion."""
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


def _path(parts: Parts, units: Units, s: Interval, limits: dict[str, ca.SX]) -> tuple[ca.SX, list[str]]:
    """What is to be <= 0 at the nodes, and what it is called."""
    lines, names = [], []
    for plant, own in parts:
        for kind in _AT_NODES:
            if kind in limits:
                row = plant.rows[kind] * units.states[own]
                size = float(np.abs(row).max())
                value = ca.dot(ca.DM(row / size), s.z[own])
                lines += [value - limits[kind] / size, -value - limits[kind] / size]
                names += [f"{kind}_limit"] * 2
        if s.bound is not None:
            value = ca.dot(ca.DM(plant.rows["tip"] * units.states[own] / units.tip), s.z[own])
            lines += [value - s.bound, -value - s.bound]
            names += ["the bound of the tip"] * 2
    return ca.vertcat(*lines) if lines else ca.SX(0, 1), names


def _assembled(rows: list[Array], columns: list[Array], shape: tuple[int, int], entries: ca.MX) -> ca.MX:
    """A sparse matrix with entries at (rows, columns), those of one place added."""
    row = np.concatenate([np.ravel(item) for item in rows]).astype(np.int64)
    column = np.concatenate([np.ravel(item) for item in columns]).astype(np.int64)
    place, inverse = np.unique(column * shape[0] + row, return_inverse=True)
    pattern = ca.Sparsity.triplet(*shape, (place % shape[0]).tolist(), (place // shape[0]).tolist())
    if place.size == row.size:
        values = entries[np.argsort(inverse).tolist()]
    else:
        adding = ca.Sparsity.triplet(place.size, row.size, inverse.tolist(), list(range(row.size)))
        values = ca.mtimes(ca.DM(adding, np.ones(row.size)), entries)
    return ca.MX(pattern, values)
