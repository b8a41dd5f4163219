"""Functions of the search at one point: values and gradients of peaks, H2 norms and bounds on poles and gains.

Norms are logarithms, over their limit if any, so that units do not matter.  An active function is a lower bound of a norm
or bound, equal to it at the point: one singular value at one frequency, or one pole.  Derivatives by the parameters of
controller and plant follow from the chain rule.
"""

from collections.abc import Callable
from functools import cached_property
from math import exp, inf, isfinite, log
from typing import NamedTuple

import numpy as np
from scipy import linalg

from boomctl.arrays import Array
from boomctl.checks import SMALLEST
from boomctl.lti.rounding import ALIKE
from boomctl.tuning.loops import Closed, ScaledPlant, close
from boomctl.tuning.problem import CONTROLLER, DAMPING, DECAY, EDGE, FASTEST_POLE, GAIN_LIMIT, Problem
from boomctl.tuning.responses import BELOW, Passage, Response, same_frequency

# relative distance within which a peak represents another frequency: their second derivatives are nearly equal
PEAK_RTOL = 1e-3  # with 1e-6 the search needs twice the steps
_MIXED = (1.0, -1.0, 1j, -1j)  # phases of combinations of two singular vectors with nearly equal values
_ALIKE_POLES = 0.05  # distance to the highest bound on poles within which a pole is an active function
_NEAR_EDGE = 4.0  # ratio to the required distance from the edge of stability up to which a pole is an active function


class Height(NamedTuple):
    """Norm or bound, with its model, channel and frequency.

    Attributes
    ----------
    model, channel : int
        Indices of plant and channel; a negative channel is a bound, the model `CONTROLLER` is the controller itself.
    omega : float
        Frequency [rad/s], possibly infinite; nan for an H2 norm.
    value : float
        Logarithm of a norm, over its limit if any; or a bound, at most zero if it is satisfied.
    pole : complex
        The pole of a bound on poles.
    """

    model: int
    channel: int
    omega: float
    value: float
    pole: complex = 0.0


class ActiveFunction(NamedTuple):
    """Active function: a `Height` of the largest singular value, of a smaller one, or of a pole.

    Attributes
    ----------
    model, channel, omega, value
        See `Height`.
    gradient : ndarray
        Gradient by the free parameters.
    limit : bool
        True for a constraint (<= 0), False for an objective.
    top : bool
        True for the largest singular value itself.
    passage : Passage or None
        The channel at that frequency.
    """

    model: int
    channel: int
    omega: float
    value: float
    gradient: Array
    limit: bool
    top: bool = True
    passage: Passage | None = None


class Point:
    """Closed loops at given free parameters.

    Parameters
    ----------
    problem : Problem
    x : ndarray
        Free parameters.
    known : dict, optional
        Additional frequencies of the grid, by model and channel.
    edge : float, optional
        Current smallest distance from the edge of stability: decay rate of a pole over its modulus.
    """

    def __init__(
        self,
        problem: Problem,
        x: Array,
        known: "dict[tuple[int, int], Array] | None" = None,
        edge: float | None = None,
    ) -> None:
        self.problem, self.x, self.edge = problem, x, edge
        self._limits = dict(problem.limits) if edge is None else {**problem.limits, EDGE: edge}
        self._known = {} if known is None else known
        self._squares: dict[tuple[int, int], tuple[float, Array]] = {}
        self._jacobians: dict[int, Array] = {}

    def with_parameters(self, x: Array) -> "Point":
        """Return the loops at other free parameters."""
        return Point(self.problem, x, self._known, self.edge)

    # -- loops -----------------------------------------------------------------------------------------------------
    @cached_property
    def controller(self) -> Array:
        """The controller's matrices ``[[A, B], [C, D]]``."""
        return self.problem.matrix.value(self.x)

    @cached_property
    def plants(self) -> tuple[ScaledPlant, ...]:
        """The plants at these plant parameters."""
        return self.problem.plants.scaled(self.x[self.problem.physical], self.problem.order)

    @cached_property
    def loops(self) -> list[Closed | None]:
        """Closed loops, None if not well-posed; the last one is the controller itself."""
        K, n = self.controller, self.problem.order
        around = np.eye(K.shape[0]), np.eye(K.shape[1]), np.zeros(K.T.shape)
        alone = Closed(K[:n, :n], K[:n, n:], K[n:, :n], K[n:, n:], *around)
        return [*(close(plant, K) for plant in self.plants), alone]

    @property
    def _models(self) -> range:
        return range(len(self.loops) - 1)

    def loop(self, model: int) -> Closed:
        """Return a loop that is well-posed."""
        result = self.loops[model]
        assert result is not None
        return result

    def jacobian(self, model: int) -> Array:
        """Return the derivatives of the controller's matrices, and of the plant's if it depends on parameters, as rows."""
        if model not in self._jacobians:
            result = self.problem.matrix.jacobian(self.x)
            moving = None if model == CONTROLLER else self.plants[model].jacobian
            if moving is not None:
                (r, c), (p, q) = self.controller.shape, moving.shape[1:]
                both = np.zeros((len(result), r + p, c + q))
                both[:, :r, :c] = result.reshape(len(result), r, c)
                both[self.problem.physical, r:, c:] = moving
                result = both.reshape(len(result), -1)
            self._jacobians[model] = result
        return self._jacobians[model]

    def hessian(self, model: int, weights: Array) -> Array:
        """Return second derivatives of the weighted sum of the entries of these matrices."""
        r, c = self.controller.shape
        result = self.problem.matrix.hessian(self.x, weights[:r, :c])
        moving = None if model == CONTROLLER else self.plants[model].hessian
        if moving is not None:
            result[np.ix_(self.problem.physical, self.problem.physical)] += np.tensordot(moving, weights[r:, c:], 2)
        return result

    @cached_property
    def well_posed(self) -> bool:
        """True if all loops are well-posed."""
        finite = bool(np.isfinite(self.controller).all())
        return finite and all(loop is not None and np.isfinite(loop.A).all() for loop in self.loops)

    @cached_property
    def stable(self) -> bool:
        """True if all loops of plants are stable."""
        if not self.well_posed:
            return False
        for model in self._models:
            loop = self.loop(model)
            if not loop.abscissa < -ALIKE * float(np.abs(loop.poles).max(initial=0.0)):
                return False
        return True

    # -- poles -----------------------------------------------------------------------------------------------------
    def abscissa(self) -> "tuple[float, Callable[[], Array]]":
        """Return the largest real part of all loops' poles, over the plant's rate, and its gradient.

        A controller pole that is faster than allowed is included.
        """
        if not self.well_posed:
            return inf, lambda: np.zeros_like(self.x)
        rate, loops = self.problem.ports.rate, map(self.loop, self._models)
        slowest = [max(loop.poles, key=lambda pole: pole.real, default=-inf + 0j) for loop in loops]
        heights = [Height(i, DECAY, abs(pole), pole.real / rate, pole) for i, pole in enumerate(slowest)]
        worst = max([*heights, *self._of_kind(CONTROLLER, FASTEST_POLE)], key=lambda item: item.value)
        return worst.value, lambda: self._gradient(worst)

    def _distances(self, poles: Array) -> Array:
        """Return the distances of poles from the axis, over the sum of modulus and the plant's slowest rate."""
        return -poles.real / (np.abs(poles) + self.problem.ports.slowest)

    @cached_property
    def edge_distance(self) -> float:
        """Smallest relative distance of the loops from the edge of stability."""
        return min(float(self._distances(self.loop(i).poles).min(initial=1.0)) for i in self._models)

    def _bound(self, kind: int, poles: Array) -> tuple[Array, Array]:
        """Return the values of a bound on poles, and ``w``: for a change ``d`` of a pole they change by ``Re(w* d)``."""
        ports, size, limit = self.problem.ports, np.maximum(np.abs(poles), SMALLEST), self._limits[kind]
        if kind == FASTEST_POLE:
            return size / limit - 1.0, poles / size / limit
        if kind == DAMPING:
            return poles.real / size + limit, 1.0 / size - poles.real * poles / size**3
        if kind == DECAY:
            return (poles.real + limit) / ports.rate, np.full(len(poles), 1.0 / ports.rate)
        distances = np.maximum(self._distances(poles), SMALLEST)
        return np.log(limit / distances), poles / size / (size + ports.slowest) - 1.0 / poles.real

    def _of_kind(self, model: int, kind: int) -> list[Height]:
        """Return the values of a bound of some kind for the poles nearest to it."""
        poles = self.loop(model).poles
        if kind not in self._limits or not len(poles):
            return []
        values = self._bound(kind, poles)[0]
        alike = _ALIKE_POLES * (1.0 + values.max() if kind == FASTEST_POLE else 1.0)
        least = -log(_NEAR_EDGE) if kind == EDGE else values.max() - alike
        near = np.flatnonzero((values >= least) & (poles.imag >= 0.0))
        return [Height(model, kind, float(abs(poles[k])), float(values[k]), complex(poles[k])) for k in near]

    @cached_property
    def bounds(self) -> list[Height]:
        """Bounds on poles."""
        kinds = [(i, kind) for i in self._models for kind in (DAMPING, DECAY, EDGE)]
        return [height for pair in [(CONTROLLER, FASTEST_POLE), *kinds] for height in self._of_kind(*pair)]

    # -- norms -----------------------------------------------------------------------------------------------------
    @cached_property
    def curves(self) -> dict[tuple[int, int], Response]:
        """Responses of channels with H-infinity norms by model and channel; the controller's is last."""
        problem, result = self.problem, {}
        for i in self._models:
            for c, channel in enumerate(problem.channels):
                if channel.norm == "hinf":
                    known = self._known.get((i, c), np.zeros(0))
                    result[i, c] = Response(self.loop(i), problem.rows[c], problem.columns[c], known)
        if GAIN_LIMIT in self._limits:
            rows, columns = map(np.arange, problem.ports.shape)
            result[CONTROLLER, GAIN_LIMIT] = Response(self.loop(CONTROLLER), rows, columns, np.zeros(0))
        return result

    @cached_property
    def squares(self) -> list[Height]:
        """H2 norms."""
        pairs = [(i, c) for c, item in enumerate(self.problem.channels) if item.norm == "h2" for i in self._models]
        return [Height(i, c, np.nan, self._scaled(c, self.h2(i, c)[0])) for i, c in pairs]

    def _scaled(self, channel: int, value: float) -> float:
        """Return the logarithm of a norm, over its limit."""
        return log(max(value, SMALLEST)) - self.problem.offset(channel)

    def _peak(self, pair: tuple[int, int]) -> Height:
        """Return the highest peak of a channel."""
        at, values = self.curves[pair].peaks
        return Height(*pair, float(at[0]), self._scaled(pair[1], float(values[0])))

    @cached_property
    def norms(self) -> list[Height]:
        """All norms."""
        return [*map(self._peak, self.curves), *self.squares]

    def _highest(self, limits: bool) -> Height | None:
        """Return the highest objective, or the highest constraint."""
        others = [item for item in (*self.squares, *self.bounds) if self.problem.is_limit(item.channel) == limits]
        best = max(others, key=lambda item: item.value, default=None)
        pairs = [pair for pair in self.curves if self.problem.is_limit(pair[1]) == limits]
        rough = [(self._scaled(pair[1], self.curves[pair].coarse[2]), pair) for pair in pairs]
        for level, pair in sorted(rough, reverse=True):
            if best is not None and level < best.value + log(BELOW):
                break  # the grid bounds the peaks: none of these is higher
            peak = self._peak(pair)
            best = peak if best is None or peak.value > best.value else best
        return best

    @cached_property
    def top(self) -> Height:
        """The highest objective."""
        result = self._highest(limits=False)
        assert result is not None
        return result

    @cached_property
    def over(self) -> Height | None:
        """The worst constraint."""
        return self._highest(limits=True)

    @property
    def aim(self) -> float:
        """The largest objective, as a logarithm."""
        return self.top.value

    @property
    def excess(self) -> float:
        """Value of the worst constraint; at most zero if all are satisfied."""
        return -inf if self.over is None else self.over.value

    def merit(self, weight: float) -> "tuple[float, Callable[[], Array]]":
        """Return the largest objective plus ``weight`` times the worst violation, and its gradient."""
        if not self.stable or not isfinite(self.aim) or not self.excess < inf:
            return inf, lambda: np.zeros_like(self.x)
        over = self.over if self.excess > 0.0 else None
        if over is None:
            return self.aim, lambda: self._gradient(self.top)
        return self.aim + weight * over.value, lambda: self._gradient(self.top) + weight * self._gradient(over)

    # -- pieces ----------------------------------------------------------------------------------------------------
    def active_functions(
        self, window: float, requested: "set[tuple[int, int, float]] | None" = None, between: float = 0.0
    ) -> list[ActiveFunction]:
        """Return the active functions within a relative window of the highest objective, or of constraints.

        These are peaks, requested frequencies, and frequencies of the grid within the fraction ``between``.
        """
        result: list[ActiveFunction] = []
        for pair, curve in self.curves.items():
            high = self._near(pair, window)[0]
            others = sorted(at for *there, at in requested or () if tuple(there) == pair)
            if between and high:
                omega, values, _ = curve.coarse
                others += omega[values >= (1.0 - between) * exp(self._level(pair[1]))].tolist()
            others = [at for at in others if not any(same_frequency(at, peak, PEAK_RTOL) for peak in high)]
            result += self._singular(pair, [(at, window) for at in high] + [(at, 0.0) for at in others])
        for item in (*self.squares, *self.bounds):
            result.append(ActiveFunction(*item[:4], self._gradient(item), self.problem.is_limit(item.channel)))
        return result

    def tops(self, window: float) -> list[Height]:
        """Return the active functions of a window that are the largest singular value, without gradients."""
        result = []
        for pair in self.curves:
            near = zip(*self._near(pair, window), strict=True)
            result += [Height(*pair, at, self._scaled(pair[1], value)) for at, value in near]
        return [*result, *self.squares, *self.bounds]

    def _near(self, pair: tuple[int, int], window: float) -> tuple[list[float], list[float]]:
        """Return frequencies and values of a channel's peaks within a relative window of the level."""
        level, curve = self._level(pair[1]), self.curves[pair]
        if log(max(curve.coarse[2], SMALLEST)) < level + log((1.0 - window) * BELOW):
            return [], []
        at, values = curve.peaks
        near = values >= (1.0 - window) * max(values[0], exp(level))
        return at[near].tolist(), values[near].tolist()

    def _level(self, channel: int) -> float:
        """Return the level of a channel as a logarithm of its norm: the highest objective, or the limit."""
        return self.problem.offset(channel) + (0.0 if self.problem.is_limit(channel) else self.aim)

    def _singular(self, pair: tuple[int, int], wanted: list[tuple[float, float]]) -> list[ActiveFunction]:
        """Return the largest singular values at frequencies; within a window also smaller ones and their combinations."""
        if not wanted:
            return []
        vectors: list[tuple[Passage, float, Array, Array, float, bool]] = []
        passages = self.curves[pair].passages(np.array([at for at, _ in wanted]))
        for (at, window), passage in zip(wanted, passages, strict=True):
            U, V, values = passage.U.T, passage.Vh.conj(), passage.values.tolist()
            vectors.append((passage, at, U[0], V[0], values[0], True))
            for k in range(1, len(values) if window else 1):
                if values[k] < (1.0 - window) * values[0]:
                    break
                vectors.append((passage, at, U[k], V[k], values[k], False))
                for phase in _MIXED if 0.0 < at < inf else _MIXED[:2]:
                    u, v = (U[0] + phase * U[k]) / 2**0.5, (V[0] + phase * V[k]) / 2**0.5
                    vectors.append((passage, at, u, v, 0.5 * (values[0] + values[k]), False))
        lefts, rights = (np.array([getattr(item[0], side) for item in vectors]) for side in ("left", "right"))
        us, vs = np.array([item[2] for item in vectors]).conj(), np.array([item[3] for item in vectors])
        outer = (us[:, None, :] @ lefts).swapaxes(1, 2) * (rights @ vs[:, :, None]).swapaxes(1, 2)
        gradients = np.real(outer).reshape(len(vectors), -1) @ self.jacobian(pair[0]).T
        limit = self.problem.is_limit(pair[1])
        return [
            ActiveFunction(
                *pair, at, self._scaled(pair[1], value), gradient / max(value, SMALLEST), limit, top, passage
            )
            for (passage, at, _, _, value, top), gradient in zip(vectors, gradients, strict=True)
        ]

    def _gradient(self, height: Height) -> Array:
        """Return the gradient of a norm or of a bound."""
        model, channel, omega, _, pole = height
        if channel >= GAIN_LIMIT:
            if np.isnan(omega):
                return self.h2(model, channel)[1]
            return self._singular((model, channel), [(omega, 0.0)])[0].gradient
        loop = self.loop(model)
        poles, left, right = loop.modes
        k, n = int(np.argmin(np.abs(poles - pole))), len(loop.A)
        change = np.outer(left[k] @ loop.before[:n], loop.after[:, :n] @ right[:, k])
        factor = 1.0 / self.problem.ports.rate if channel == DECAY else self._bound(channel, poles[[k]])[1][0]
        return self.jacobian(model) @ np.real(np.conj(factor) * change).ravel()

    def h2(self, model: int, channel: int) -> tuple[float, Array]:
        """Return an H2 norm and the gradient of its logarithm."""
        if (model, channel) in self._squares:
            return self._squares[model, channel]
        loop, rows, columns = self.loop(model), self.problem.rows[channel], self.problem.columns[channel]
        B, C, n = loop.B[:, columns], loop.C[rows], len(loop.A)
        P, Q = _gramian(loop.A, B), _gramian(loop.A.T, C.T)
        square = max(float(np.sum((C @ P) * C)), SMALLEST**2)
        full = np.zeros((n + len(loop.C), n + loop.B.shape[1]))
        full[:n, :n] = Q @ P
        full[np.ix_(np.arange(n), n + columns)] = Q @ B
        full[np.ix_(n + rows, np.arange(n))] = C @ P
        gradient = self.jacobian(model) @ (loop.before.T @ full @ loop.after.T).ravel() / square
        self._squares[model, channel] = float(np.sqrt(square)), gradient
        return self._squares[model, channel]


def _gramian(A: Array, B: Array) -> Array:
    """Return ``P`` with ``A P + P A^T + B B^T = 0``."""
    if not len(A):
        return np.zeros((0, 0))
    return np.asarray(linalg.solve_continuous_lyapunov(A, -B @ B.T))
