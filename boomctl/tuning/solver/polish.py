"""Polishing by sequential quadratic programming over all peaks near the highest, including clustered singular values.

Second derivatives of a peak at its frequency: a change ``d`` of the matrices of controller and plant changes a response by
``L d (I - S d)^-1 R``, so that all derivatives are known in closed form; a simple singular value is an eigenvalue of
``[[0, G], [G^H, 0]]``, whose second derivative is that of perturbation theory (Lancaster 1964).
"""

from collections.abc import Callable
from math import inf, isfinite

import numpy as np
from scipy.linalg import lapack
from scipy.optimize import nnls

from boomctl.arrays import Array
from boomctl.lti.rounding import LEVEL, SUMMED, TINY
from boomctl.tuning.point import PEAK_RTOL, ActiveFunction, Height, Point
from boomctl.tuning.problem import GAIN_LIMIT
from boomctl.tuning.responses import WINDOW, same_frequency
from boomctl.tuning.solver.descent import Ended

_BETWEEN = 0.03  # relative window below the highest within which grid frequencies are active functions
_TRIALS = 14  # trials of a step; each adds an active function or shortens the step
_CORRECTIONS = 2  # second-order corrections of a step at most
_FALL = 0.1  # accept a step if the decrease is at least this fraction of the predicted one
_GOOD = 0.6  # fraction of the predicted decrease above which the next step may be longer
_ACTIVE = 1e-6  # multiplier above which a function contributes to the curvature
_NEAR = 0.1  # relative change of a peak's frequency in a step up to which it is the same peak
_DAMPING, _LEAST, _LARGEST = (
    1.0,
    1e-9,
    1e9,
)  # damping of a step in natural sizes: initial, smallest, largest
# smallest next damping after a step to unstable loops, over the curvature along it: shortens the step to a quarter
_SHORTER = 3.0
_FLAT = 1e-10  # fraction of the largest squared inverse natural size that is the least for all parameters
# softness of the constraints for the multipliers of the curvature: nearly equal functions share them
_SHARED = 1e-7
_HEAVIER = (10.0, 100.0)  # factors by which a step may raise the penalty weight
_SLIGHT = 0.01  # largest violation at which it is raised: far from feasible points a heavy penalty leads to poor minima
_LITTLE = 1e-6  # finite-difference step of an H2 norm's gradient
_ROUNDS = 60  # iterations of a quadratic program at most; two or three are usual
# regularization of variables without curvature in a quadratic program: larger values cost iterations, smaller ones accuracy
_CURVED = 1e-2
_ENOUGH = 1e-11  # gradient residual, relative to the costs, at which a quadratic program ends
_SEPARATION = 1e-3  # relative distance of other singular values to include; nearer ones are separate active functions


class Polish:
    """Local search for a stationary point of the maximum over all peaks near the highest.

    Parameters
    ----------
    point_at : function
        Maps free parameters to the loops.
    x : ndarray
        Initial parameters.
    weight : float
        Initial penalty weight of constraint violations; the attribute ``weight`` may grow.
    gain : float
        Predicted decrease of a step below which the search ends; it also ends if six steps decrease by less than ten
        times this.
    """

    def __init__(self, point_at: Callable[[Array], Point], x: Array, *, weight: float, gain: float) -> None:
        self._point_at, self.weight, self._gain = point_at, weight, gain
        self._point, self._damping = point_at(x), _DAMPING
        self._H = np.zeros((len(x), len(x)))

    def run(self, steps: int) -> Ended:
        """Return the result after at most ``steps`` steps."""
        value = self._point.merit(self.weight)[0]
        if not isfinite(value):
            return Ended(self._point.x, value, 0)
        history = [value]
        for k in range(steps):
            requested: set[tuple[int, int, float]] = set()
            functions = self._point.active_functions(WINDOW, requested, _BETWEEN)
            if not functions:  # the norm is zero
                return Ended(self._point.x, value, k, stationary=True)
            self._sizes = _sizes(functions, self._H)
            multipliers = self._step(functions, value, _SHARED)[2]
            self._H = _curvature(self._point, functions, multipliers, self._sizes)
            self._sizes = _sizes(functions, self._H)
            if self._heavier(functions, value):
                value = self._point.merit(self.weight)[0]
                history = [value]
            for trial in range(_TRIALS):
                d, predicted, _ = self._step(functions, value)
                if predicted <= self._gain:
                    return Ended(self._point.x, value, k, self._damping < 1e3 * _DAMPING)
                there, result = self._corrected(d, functions, value, predicted)
                if result <= value - _FALL * predicted:
                    if trial == 0:
                        good = value - result >= _GOOD * predicted
                        self._damping = max((0.1 if good else 0.4) * self._damping, _LEAST)
                    break
                more = _new_peaks(there, functions) - requested if isfinite(result) else set()
                if more:
                    requested |= more
                    functions = self._point.active_functions(WINDOW, requested, _BETWEEN)
                shorter = 0.0 if isfinite(result) else _SHORTER * float(d @ self._H @ d) / float(d @ (self._sizes * d))
                self._damping = min(max((2.0 if more else 6.0) * self._damping, shorter), _LARGEST)
            else:
                return Ended(self._point.x, value, k)
            self._point, value = there, result
            history.append(value)
            if len(history) > 6 and history[-7] - value < 10.0 * self._gain:
                return Ended(self._point.x, value, k + 1)
        return Ended(self._point.x, value, steps)

    def _heavier(self, functions: list[ActiveFunction], value: float) -> bool:
        """Raise the penalty weight if that lets a step halve a slight violation; return whether it was raised.

        A violation that costs more than the step gains would otherwise remain at the minimum.
        """
        limits, light = [item for item in functions if item.limit], self.weight
        violation = max((item.value for item in limits), default=0.0)
        if not LEVEL < violation <= _SLIGHT:
            return False

        def halved(d: Array) -> bool:
            return max(item.value + float(item.gradient @ d) for item in limits) <= 0.5 * violation

        d, predicted, _ = self._step(functions, value)
        if predicted > light * violation or halved(d):
            return False
        for factor in _HEAVIER:
            self.weight = factor * light
            if halved(self._step(functions, value)[0]):
                return True
        self.weight = light
        return False

    def _trial(self, d: Array) -> tuple[Point, float]:
        """Return the loops after a step, and their merit."""
        there = self._point_at(self._point.problem.clipped(self._point.x + d))
        return there, there.merit(self.weight)[0]

    def _corrected(
        self, d: Array, functions: list[ActiveFunction], value: float, predicted: float
    ) -> tuple[Point, float]:
        """Return the loops after a step, with second-order corrections while they lower the merit."""
        there, result = self._trial(d)
        for _ in range(_CORRECTIONS):
            if not isfinite(result) or result <= value - _GOOD * predicted:
                break
            bent = _corrected_functions(functions, there, there.x - self._point.x)
            further, lower = self._trial(self._step(bent, value)[0])
            if lower >= result:
                break
            there, result = further, lower
        return there, result

    def _step(self, functions: list[ActiveFunction], value: float, softness: float = 0.0) -> tuple[Array, float, Array]:
        """Return the step of a quadratic program, its predicted decrease, and the multipliers of the active functions."""
        x, problem, root = self._point.x, self._point.problem, np.sqrt(self._sizes)  # steps count in natural sizes
        values, gradients = np.array([p.value for p in functions]), np.array([p.gradient for p in functions]) / root
        limits, n, count = np.array([p.limit for p in functions]), len(x), len(functions)
        top, some = values[~limits].max(), int(limits.any())
        curved = self._H / root / root[:, None]
        # variables: the step, the highest objective, and with constraints the cost of the worst violation
        m = n + 1 + some
        Q, c, unit = np.zeros((m, m)), np.zeros(m), np.eye(m)
        Q[:n, :n] = curved + self._damping * np.eye(n)
        c[n:] = 1.0
        rows = np.hstack([gradients, (limits - 1.0)[:, None], limits[:, None] * np.full(some, -1.0 / self.weight)])
        up, down = np.maximum((problem.high - x) * root, 0.0), np.maximum((x - problem.low) * root, 0.0)
        rows = np.vstack([rows, -unit[n + 1 :], unit[:n], -unit[:n]])
        sides = np.concatenate([np.where(limits, 0.0, top) - values, np.zeros(some), up, down])
        y, z = least(Q, c, rows, sides, softness)
        there = values + gradients @ y[:n]
        merit = float(there[~limits].max()) + self.weight * float(there[limits].max(initial=0.0))
        return y[:n] / root, value - merit - 0.5 * float(y[:n] @ curved @ y[:n]), z[:count]


def _sizes(functions: list[ActiveFunction], H: Array) -> Array:
    """Return squared inverse natural sizes of the free parameters, from gradients and curvatures."""
    squares = np.max([p.gradient**2 for p in functions], axis=0) + np.abs(np.diag(H))
    return np.maximum(squares, _FLAT * max(float(squares.max(initial=0.0)), TINY))


def _curvature(point: Point, functions: list[ActiveFunction], multipliers: Array, sizes: Array) -> Array:
    """Return the Hessian of the Lagrangian with negative eigenvalues reversed, so that steps leave saddle points."""
    n = len(point.x)
    H = np.zeros((n, n))
    for multiplier, function in zip(multipliers, functions, strict=True):
        if multiplier <= _ACTIVE or function.channel < GAIN_LIMIT or not function.top:
            continue
        if np.isnan(function.omega):  # H2 norm: finite differences of its gradient
            moved = [point.with_parameters(point.x + step) for step in _LITTLE * np.eye(n)]
            stable = [item.well_posed and item.loop(function.model).abscissa < 0.0 for item in moved]
            there = [
                item.h2(function.model, function.channel)[1] if decays else function.gradient
                for item, decays in zip(moved, stable, strict=True)
            ]
            H += multiplier * (np.array(there) - function.gradient) / _LITTLE
        else:
            H += multiplier * peak_hessian(point, function)
    if not np.isfinite(H).all():
        return np.zeros((n, n))
    root = np.sqrt(sizes)
    values, vectors = np.linalg.eigh(0.5 * (H + H.T) / root / root[:, None])
    return (root[:, None] * vectors * np.abs(values)) @ (vectors.T * root)


def peak_hessian(point: Point, function: ActiveFunction) -> Array:
    """Return the second derivatives of the logarithm of a peak."""
    assert function.passage is not None
    model, omega, (U, values, Vh, left, right, around) = function.model, function.omega, function.passage
    k, (p, r), (c, m) = len(point.x), left.shape, right.shape
    jacobian = point.jacobian(model).reshape(k, r, c)
    u, v, top = U[:, 0], Vh[0].conj(), float(values[0])
    before, after = u.conj() @ left, right @ v
    a, b = before @ jacobian, jacobian @ after  # derivatives by every free parameter, from the left and from the right
    alpha, beta = a @ right, b @ left.T  # u^H G_i and G_i v
    mixed = a @ around @ b.T
    second = np.real(mixed + mixed.T) + point.hessian(model, np.real(np.outer(before, after)))
    gradient = np.real(a @ after)
    curve = point.curves[model, function.channel]
    moving = np.isfinite(omega) and omega > 0.0 and len(curve.A) > 0
    if moving:
        twofold = -1j * curve.through_states(np.array([omega]), 2)[0]
        threefold = -2.0 * curve.through_states(np.array([omega]), 3)[0, :p, :m]
        by_omega = twofold[:p, :m]
        alpha, beta = np.vstack([alpha, u.conj() @ by_omega]), np.vstack([beta, by_omega @ v])
        turned = np.real((u.conj() @ twofold[:p, m:]) @ jacobian @ after + a @ (twofold[p:, :m] @ v))
        whole = np.empty((k + 1, k + 1))
        whole[:k, :k], whole[:k, k], whole[k, :k] = second, turned, turned
        whole[k, k] = np.real(u.conj() @ threefold @ v)
        second, gradient = whole, np.append(gradient, np.real(u.conj() @ by_omega @ v))
    second = second + _from_others(alpha, beta, U, values, Vh)
    whole = second / top - np.outer(gradient, gradient) / top**2
    if not moving:
        return whole
    bend = whole[k, k]
    if bend >= -SUMMED / max(omega, 1.0) ** 2:
        return whole[:k, :k]
    return whole[:k, :k] - np.outer(whole[:k, k], whole[k, :k]) / bend


def _from_others(alpha: Array, beta: Array, U: Array, values: Array, Vh: Array) -> Array:
    """Return the contribution of other singular vectors to the second derivatives; ``alpha`` is u^H G_i, ``beta`` G_i v."""
    top = float(values[0])
    along, across = alpha @ Vh.conj().T, (beta @ U.conj()).conj()
    both = 0.5 * np.concatenate([across + along, across - along], axis=1)
    gaps = np.concatenate([top - values, top + values])
    separate = gaps > _SEPARATION * top
    result = 2.0 * _squared(both[:, separate], 1.0 / gaps[separate])
    for vectors, inside in ((alpha, along), (beta, across)):
        if vectors.shape[1] > len(values):  # vectors without a singular value
            result += (_squared(vectors) - _squared(inside)) / top
    return result


def _squared(c: Array, weights: Array | float = 1.0) -> Array:
    """Return the real part of ``c diag(weights) c^H``."""
    return (c.real * weights) @ c.real.T + (c.imag * weights) @ c.imag.T


def _corrected_functions(functions: list[ActiveFunction], trial: Point, d: Array) -> list[ActiveFunction]:
    """Return active functions with values shifted such that their linearizations are exact at a trial point."""
    return [
        function
        if near is None or not function.top
        else function._replace(value=near.value - float(function.gradient @ d))
        for function, near in zip(functions, _nearest(functions, trial.tops(WINDOW)), strict=True)
    ]


def _nearest(functions: list[ActiveFunction], others: list[Height]) -> list[Height | None]:
    """Match active functions with those of another point; None if one has no counterpart."""
    if not others or not functions:
        return [None] * len(functions)
    mine, theirs = np.array([item[:3] for item in functions])[:, None], np.array([item[:3] for item in others])
    a, b = mine[..., 2], theirs[:, 2]
    with np.errstate(invalid="ignore"):  # infinity minus infinity, and nan
        distance = np.abs(a - b) / np.maximum(np.maximum(np.abs(a), np.abs(b)), TINY)
    distance[(a == b) | np.isnan(a)] = 0.0
    distance[(mine[..., :2] != theirs[:, :2]).any(axis=2) | np.isnan(distance)] = inf
    return [others[k] if row[k] <= _NEAR else None for row, k in zip(distance, distance.argmin(axis=1), strict=True)]


def _new_peaks(trial: Point, functions: list[ActiveFunction]) -> "set[tuple[int, int, float]]":
    """Return the highest peaks at a trial point that are not among the active functions."""
    result = set()
    for model, channel, omega, *_ in (trial.top, *([trial.over] if trial.over else [])):
        there = [p.omega for p in functions if (p.model, p.channel) == (model, channel)]
        at_peak = channel >= GAIN_LIMIT and not np.isnan(omega)
        if at_peak and not any(same_frequency(omega, item, PEAK_RTOL) for item in there):
            result.add((model, channel, omega))
    return result


def stationarity(functions: list[ActiveFunction], point: Point, low: Array, high: Array) -> float:
    """Return the norm of the smallest element of the convex hull of gradients over the largest gradient norm.

    Parameters are in natural sizes, components out of active bounds are removed.  It is 0 at a stationary point and 1 if all
    functions decrease.  For a single function it is the norm of its gradient, with natural sizes that include its
    curvature: 0 at a smooth minimum.
    """
    x = point.x
    if not functions or not len(x):
        return 0.0
    H = np.zeros((len(x), len(x)))
    if len(functions) == 1:
        H = _curvature(point, functions, np.ones(1), _sizes(functions, H))
    gradients = np.array([p.gradient for p in functions]) / np.sqrt(_sizes(functions, H))
    longest = 1.0 if H.any() else float(np.linalg.norm(gradients, axis=1).max())
    if longest == 0.0:
        return 0.0
    n = len(x)
    H = np.diag([*np.ones(n), 0.0])
    c = np.append(np.zeros(n), 1.0)
    aims = np.array([not p.limit for p in functions])
    rows = np.column_stack([gradients / longest, np.where(aims, -1.0, 0.0)])
    unit = np.eye(n + 1)[:n]
    G = np.vstack([rows, unit[x >= high], -unit[x <= low]])
    y, _ = least(H, c, G, np.zeros(len(G)))
    return float(np.linalg.norm(y[:n]))


def least(H: Array, c: Array, G: Array, h: Array, softness: float = 0.0) -> tuple[Array, Array]:
    """Minimize ``1/2 y^T H y + c^T y`` subject to ``G y <= h``; return ``y`` and the multipliers of the rows of ``G``.

    In coordinates with unit Hessian, this is the projection of the unconstrained minimum on a polyhedron: the multipliers
    solve a nonnegative least-squares problem.  Variables without curvature are regularized around their last values
    (proximal iteration) until the step vanishes.

    ``H`` is positive definite except for variables without any curvature, which rows bound.  The problem must be feasible.
    Rows of unit length are exceeded by ``softness`` times their multipliers.
    """
    n, m = len(c), len(h)
    size = np.sqrt((G * G).sum(axis=1))
    size = np.maximum(size, max(SUMMED * float(size.max(initial=0.0)), TINY))
    G, h, y, z = G / size[:, None], h / size, np.zeros(n), np.zeros(m)
    lent = np.where(H.diagonal() == 0.0, _CURVED, 0.0)
    root, wrong = lapack.dpotrf(H + np.diag(lent), lower=1)
    if wrong:
        return y, z
    soft = softness**0.5 * np.eye(m if softness else 0, m)
    rows = np.concatenate([-lapack.dtrtrs(root, G.T, lower=1)[0], np.zeros((1, m)), soft])
    end = np.zeros(len(rows))
    end[n] = 1.0
    for _ in range(_ROUNDS):
        free = lapack.dtrtrs(root, -(H @ y + c), lower=1)[0]  # the step without rows
        rows[n] = G @ y - h - free @ rows[:n]
        if not np.isfinite(rows).all():
            break
        try:
            result = nnls(rows, end)[0]
        except RuntimeError:  # iteration limit
            break
        z = result / (end[n] - rows[n] @ result)
        step = lapack.dtrtrs(root, free + rows[:n] @ z, lower=1, trans=1)[0]
        y = y + step
        if float(np.abs(lent * step).max(initial=0.0)) <= _ENOUGH * float(np.abs(c).max(initial=0.0)):
            break
    return y, z / size
