"""A slew as a nonlinear programme: one stage function, mapped over equal intervals, with its exact derivatives.

Unknowns, stage after stage: states z_k of all plants, torque u_k, stage rates of the collocation; then the last states
(and torque), the duration and the bound of the tip. All are scaled to about one. Jacobian and Hessian of the Lagrangian
are put together from those of one stage, so that nothing is differentiated twice and building costs next to nothing.
"""

import itertools
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from boomctl.arrays import Array
from boomctl.slew.least_time.stepping import shooting_step
from boomctl.slew.nlp.dynamics import collocation_defects, rates
from boomctl.slew.plant import Plant

if TYPE_CHECKING:
    import casadi


@dataclass(frozen=True)
class Scheme:
    """How a slew is made finite.

    Attributes
    ----------
    method : str
        "collocation" (Gauss-Legendre), "radau" or "shooting".
    objective : str
    intervals : int
    order : int
        Collocation points, or substeps of shooting, on each interval.
    ramp : bool
        Whether the torque is continuous and straight between nodes; else it is constant on each interval.
    free_time : bool
    limits : tuple of str
        Which of "rate", "speed", "tip", "moment" are limited.
    """

    method: str
    objective: str
    intervals: int
    order: int
    ramp: bool
    free_time: bool
    limits: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class Layout:
    """Where what stands among the unknowns, and units.

    Attributes
    ----------
    states : ndarray of int, (N + 1) x n
    torques : ndarray of int, N or N + 1
    rates : ndarray of int, N x (n d)
    duration, bound : int or None
    size : int
    unit : ndarray, n
        Of the states.
    torque_unit, time_unit : float
    tip_unit : float
    """

    states: Array
    torques: Array
    rates: Array
    duration: int | None
    bound: int | None
    size: int
    unit: Array
    torque_unit: float
    time_unit: float
    tip_unit: float


@dataclass(frozen=True, eq=False)
class Transcription:
    """A nonlinear programme ready to be solved with any data.

    Parameters of the programme: duration over its unit, limits of rate, speed, tip and moment.
    Constraints: (defects, paths) of each stage, paths of the last, end conditions.
    """

    scheme: Scheme
    layout: Layout
    nlp: "casadi.Function"
    options: dict[str, Any]
    defects: int
    paths: int
    ends: Array
    count: int
    blocks: tuple[slice, ...]
    names: tuple[str, ...]
    made_of: tuple[Any, ...] = field(repr=False)

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle what it was made of: a few kilobytes and 0.1 s, in place of megabytes of CasADi functions."""
        return transcribe, self.made_of


def transcribe(
    plants: tuple[Plant, ...], scheme: Scheme, units: Array, torque: float, time: float, ends: Array
) -> "Transcription":
    """Build the programme.

    Parameters
    ----------
    plants : tuple of Plant
        All are driven by the one torque.
    scheme : Scheme
    units : ndarray, n
        Typical sizes of all states.
    torque, time : float
        Typical torque [N m] and duration [s].
    ends : ndarray, m x n
        Rows over all states that are prescribed at the end.
    """
    import casadi as ca

    n = sum(plant.n for plant in plants)
    layout = _layout(scheme, n, units, torque, time, _tip_unit(plants, units))
    stage = _stage(plants, scheme, layout)
    N, local = scheme.intervals, _local_indices(scheme, layout)
    x, p = ca.MX.sym("x", layout.size), ca.MX.sym("p", 5)
    every = _gather(x, local)
    values, costs = stage.value.map(N)(every, ca.repmat(p, 1, N))
    last = ca.vertcat(*[x[int(i)] for i in _last_indices(layout)])
    end_rows = ca.DM(ends * units / np.maximum(np.abs(ends * units).max(axis=1, keepdims=True), 1e-300))
    final_paths = stage.paths(last, p)
    g = ca.vertcat(ca.vec(values), final_paths, ca.mtimes(end_rows, x[layout.states[-1].tolist()]))
    total = ca.sum2(costs)
    nlp = ca.Function("nlp", [x, p], [total, g], ["x", "p"], ["f", "g"])
    shape = (int(stage.value.size1_out(0)), int(final_paths.shape[0]))
    options = _derivatives(stage, scheme, layout, local, x, p, end_rows, shape, (total, g))
    scaled_ends = np.array(end_rows)
    defects = shape[0] - shape[1] - _rate_rows(scheme)
    firsts = np.cumsum([0, *(plant.n for plant in plants)])
    blocks = tuple(slice(int(a), int(b)) for a, b in itertools.pairwise(firsts))
    names = _names(plants, scheme)
    made_of = (plants, scheme, units, torque, time, ends)
    return Transcription(
        scheme, layout, nlp, options, defects, shape[1], scaled_ends, int(g.shape[0]), blocks, names, made_of
    )


@dataclass(frozen=True, eq=False)
class _Stage:
    value: "casadi.Function"
    paths: "casadi.Function"
    jacobian: "casadi.Function"
    gradient: "casadi.Function"
    hessian: "casadi.Function"
    jacobian_pattern: Any
    hessian_pattern: Any
    path_jacobian: "casadi.Function"
    path_pattern: Any


def _names(plants: tuple[Plant, ...], scheme: Scheme) -> tuple[str, ...]:
    """What the inequalities of a stage are."""
    one = [f"{kind}_limit" for kind in ("speed", "tip", "moment") if kind in scheme.limits for _ in range(2)]
    one += ["the bound of the tip"] * (2 if scheme.objective == "tip" else 0)
    return (*(one * len(plants)), *(["torque_rate_limit"] * _rate_rows(scheme)))


def _rate_rows(scheme: Scheme) -> int:
    return 2 if "rate" in scheme.limits else 0


def _tip_unit(plants: tuple[Plant, ...], units: Array) -> float:
    if "tip" not in plants[0].rows:
        return 1.0
    row = np.concatenate([plant.rows["tip"] for plant in plants])
    return float(max(np.abs(row * units).max(), 1e-12))


def _layout(scheme: Scheme, n: int, units: Array, torque: float, time: float, tip: float) -> Layout:
    N, extra = scheme.intervals, 0 if scheme.method == "shooting" else n * scheme.order
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
    if scheme.objective == "tip":
        bound, size = size, size + 1
    inner = first[:, None] + n + 1 + np.arange(extra)
    return Layout(states, torques, inner, duration, bound, size, units, torque, time, tip)


def _local_indices(scheme: Scheme, layout: Layout) -> Array:
    """Unknowns of each stage, N x local: z, u, rates, next z, next u, duration, bound."""
    N = scheme.intervals
    parts = [layout.states[:-1], layout.torques[:N, None], layout.rates, layout.states[1:]]
    if scheme.ramp:
        parts.append(layout.torques[1:, None])
    parts += [np.full((N, 1), i) for i in (layout.duration, layout.bound) if i is not None]
    return np.hstack(parts)


def _last_indices(layout: Layout) -> Array:
    return np.append(layout.states[-1], [] if layout.bound is None else layout.bound).astype(int)


def _gather(x: "casadi.MX", local: Array) -> "casadi.MX":
    import casadi as ca

    return ca.reshape(x[local.ravel().tolist()], local.shape[1], local.shape[0])


def _stage(plants: tuple[Plant, ...], scheme: Scheme, layout: Layout) -> _Stage:
    """The stage function, scaled, and its derivatives."""
    import casadi as ca

    n, extra = layout.unit.size, layout.rates.shape[1]
    count = 2 * n + 1 + extra + scheme.ramp + scheme.free_time + (scheme.objective == "tip")
    v, p = ca.SX.sym("v", count), ca.SX.sym("p", 5)
    z, u, k, z1 = v[:n], v[n], v[n + 1 : n + 1 + extra], v[n + 1 + extra : 2 * n + 1 + extra]
    at = 2 * n + 1 + extra
    u1 = v[at] if scheme.ramp else u
    at += scheme.ramp
    time = (v[at] if scheme.free_time else p[0]) * layout.time_unit
    bound = v[count - 1] if scheme.objective == "tip" else None
    h = time / scheme.intervals
    value = [_defects(plants, scheme, layout, (z, k, u, u1, h, z1))]
    path = _paths(plants, scheme, layout, z, p, bound)
    value.append(path)
    if "rate" in scheme.limits:
        change, most = u1 - u, p[1] * h / layout.torque_unit
        value += [change - most, -change - most]
    value = ca.vertcat(*value)
    cost = _cost(plants, scheme, layout, (z, u, u1, z1, h, bound))
    multipliers, weight = ca.SX.sym("m", value.shape[0]), ca.SX.sym("w")
    jacobian = ca.jacobian(value, v)
    lagrangian = weight * cost + ca.dot(multipliers, value)
    hessian = ca.triu(ca.hessian(lagrangian, v)[0])
    ends = v[:n] if bound is None else ca.vertcat(v[:n], bound)
    path_jacobian = ca.jacobian(path, ends)
    return _Stage(
        ca.Function("stage", [v, p], [value, cost]),
        ca.Function("paths", [ends, p], [path]),
        ca.Function("jacobian", [v, p], [value, cost, _nonzeros(jacobian)]),
        ca.Function("gradient", [v, p], [cost, ca.gradient(cost, v)]),
        ca.Function("hessian", [v, p, weight, multipliers], [_nonzeros(hessian)]),
        jacobian.sparsity(),
        hessian.sparsity(),
        ca.Function("path_jacobian", [ends, p], [_nonzeros(path_jacobian)]),
        path_jacobian.sparsity(),
    )


def _nonzeros(matrix: "casadi.SX") -> "casadi.SX":
    import casadi as ca

    pattern = ca.Sparsity.dense(matrix.nnz(), 1)
    return ca.sparsity_cast(matrix, pattern)


def _defects(plants: tuple[Plant, ...], scheme: Scheme, layout: Layout, parts: tuple[Any, ...]) -> "casadi.SX":
    import casadi as ca

    z, k, u, u1, h, z1 = parts
    torque, torque1 = u * layout.torque_unit, u1 * layout.torque_unit
    defects, first, inner = [], 0, 0
    for plant in plants:
        own = slice(first, first + plant.n)
        unit = ca.DM(layout.unit[own])
        place, place1 = z[own] * unit, z1[own] * unit
        if scheme.method == "shooting":
            step = shooting_step(plant, scheme.order)
            defects.append(step(place, torque, torque1, h) / unit - z1[own])
        else:
            whole = ca.repmat(unit / layout.time_unit, scheme.order, 1)
            rate = k[inner : inner + plant.n * scheme.order] * whole
            lack = collocation_defects(plant, scheme.order, scheme.method)(place, rate, torque, torque1, h, place1)
            defects.append(lack / ca.vertcat(whole, unit))
            inner += plant.n * scheme.order
        first += plant.n
    return ca.vertcat(*defects)


def _paths(plants: tuple[Plant, ...], scheme: Scheme, layout: Layout, z: Any, p: Any, bound: Any) -> "casadi.SX":
    """What is to be <= 0 at the nodes."""
    import casadi as ca

    lines, first = [], 0
    for plant in plants:
        own = slice(first, first + plant.n)
        for index, name in ((2, "speed"), (3, "tip"), (4, "moment")):
            if name in scheme.limits:
                row = plant.rows[name] * layout.unit[own]
                size = float(np.abs(row).max())
                value = ca.dot(ca.DM(row / size), z[own])
                lines += [value - p[index] / size, -value - p[index] / size]
        if bound is not None:
            value = ca.dot(ca.DM(plant.rows["tip"] * layout.unit[own] / layout.tip_unit), z[own])
            lines += [value - bound, -value - bound]
        first += plant.n
    return ca.vertcat(*lines) if lines else ca.SX(0, 1)


def _cost(plants: tuple[Plant, ...], scheme: Scheme, layout: Layout, parts: tuple[Any, ...]) -> "casadi.SX":
    import casadi as ca

    z, u, u1, z1, h, bound = parts
    N, share = scheme.intervals, h / layout.time_unit
    effort = share * (u**2 + u * u1 + u1**2) / 3.0
    if scheme.objective == "time":
        return share + 0.0 * u
    if scheme.objective == "effort":
        return effort
    if scheme.objective == "tip":
        # where the tip stays at its bound the torque is free to chatter; a small price on its changes keeps it from that
        return bound / N + 1e-6 * (effort + (u1 - u) ** 2)
    if scheme.objective == "torque-rate":
        return (u1 - u) ** 2 / share
    first, total = 0, ca.SX(0)
    for plant in plants:
        own = slice(first, first + plant.n)
        unit, f = ca.DM(layout.unit[own]), rates(plant)
        row = ca.DM(plant.rows["speed"])
        turning = [
            ca.dot(row, f(place[own] * unit, torque * layout.torque_unit)) for place, torque in ((z, u), (z1, u1))
        ]
        inertia = plant.inertia or 1.0
        total += ((turning[1] - turning[0]) * (inertia / layout.torque_unit)) ** 2 / share
        first += plant.n
    return total


def _derivatives(
    stage: _Stage,
    scheme: Scheme,
    layout: Layout,
    local: Array,
    x: "casadi.MX",
    p: "casadi.MX",
    end_rows: "casadi.DM",
    shape: tuple[int, int],
    values: tuple["casadi.MX", "casadi.MX"],
) -> dict[str, "casadi.Function"]:
    """Gradient, Jacobian and Hessian as CasADi's solvers take them."""
    import casadi as ca

    N, rows = scheme.intervals, shape[0]
    every, data = _gather(x, local), ca.repmat(p, 1, N)
    last = x[_last_indices(layout).tolist()]
    r, c = (np.array(each) for each in stage.jacobian_pattern.get_triplet())
    pr, pc = (np.array(each) for each in stage.path_pattern.get_triplet())
    er, ec = np.nonzero(np.array(end_rows))
    g_rows = [np.arange(N)[:, None] * rows + r, N * rows + pr, N * rows + shape[1] + er]
    g_cols = [
        local[:, c] if c.size else np.zeros((N, 0), int),
        _last_indices(layout)[pc] if pc.size else pc,
        layout.states[-1][ec],
    ]
    entries = ca.vertcat(
        ca.vec(stage.jacobian.map(N)(every, data)[2]),
        stage.path_jacobian(last, p),
        ca.DM(np.array(end_rows)[er, ec]),
    )
    total_rows = N * rows + shape[1] + end_rows.shape[0]
    J = _assembled(g_rows, g_cols, (total_rows, layout.size), entries)
    gradients = ca.vec(stage.gradient.map(N)(every, data)[1])
    where = [local.ravel()], [np.zeros(local.size, int)]
    gradient = ca.densify(_assembled(where[0], where[1], (layout.size, 1), gradients))
    weight, multipliers = ca.MX.sym("w"), ca.MX.sym("m", total_rows)
    per_stage = ca.reshape(multipliers[: N * rows], rows, N)
    nonzeros = stage.hessian.map(N)(every, data, ca.repmat(weight, 1, N), per_stage)
    hr, hc = (np.array(each) for each in stage.hessian_pattern.get_triplet())
    a, b = local[:, hr], local[:, hc]
    H = _assembled([np.minimum(a, b)], [np.maximum(a, b)], (layout.size, layout.size), ca.vec(nonzeros))
    total, g = values
    names = ["x", "p", "lam_f", "lam_g"]
    return {
        "grad_f": ca.Function("grad_f", [x, p], [total, gradient], ["x", "p"], ["f", "grad_f_x"]),
        "jac_g": ca.Function("jac_g", [x, p], [g, J], ["x", "p"], ["g", "jac_g_x"]),
        "hess_lag": ca.Function("hess_lag", [x, p, weight, multipliers], [H], names, ["triu_hess_gamma_x_x"]),
    }


def _assembled(rows: list[Array], columns: list[Array], shape: tuple[int, int], entries: "casadi.MX") -> "casadi.MX":
    """A sparse matrix with entries at (rows, columns), those of one place added."""
    import casadi as ca

    row = np.concatenate([np.ravel(each) for each in rows]).astype(np.int64)
    column = np.concatenate([np.ravel(each) for each in columns]).astype(np.int64)
    place, inverse = np.unique(column * shape[0] + row, return_inverse=True)
    pattern = ca.Sparsity.triplet(*shape, (place % shape[0]).tolist(), (place // shape[0]).tolist())
    if place.size == row.size:
        values = entries[np.argsort(inverse).tolist()]
    else:
        adding = ca.Sparsity.triplet(place.size, row.size, inverse.tolist(), list(range(row.size)))
        values = ca.mtimes(ca.DM(adding, np.ones(row.size)), entries)
    return ca.MX(pattern, values)
