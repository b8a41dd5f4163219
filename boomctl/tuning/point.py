"""What the search sees of the loops: values and gradients of peaks, H2 norms and bounds on poles and gains.

Norms count as logarithms, over their budget where they have one, so that units do not matter.  A piece lies nowhere above
what it stands for and touches it here: one singular value at one frequency, one pole.  What controls and physical parameters
change is carried by the chain rule.
"""

from collections.abc import Callable
from functools import cached_property
from math import exp, inf, isfinite, log
from typing import NamedTuple

import numpy as np
from scipy import linalg

from boomctl.arrays import Array
from boomctl.tuning.loops import Closed, ScaledPlant, close
from boomctl.tuning.problem import CONTROLLER, DAMPING, DECAY, EDGE, FASTEST_POLE, GAIN_LIMIT, Problem
from boomctl.tuning.responses import BELOW, Passage, Response, same_place

_TINY = 1e-100  # norm that stands for zero, whose logarithm is a number
# share of its frequency by which a peak may lie beside another frequency and stand for it: its bend is that of all so near
BESIDE = 1e-3  # (measured: with 1e-6 twice the steps, with 1e-4 to 1e-2 as many)
_MIXED = (1.0, -1.0, 1j, -1j)  # phases in which two singular vectors of like values are mixed (a choice)
_ALIKE_POLES = 0.05  # how near to the highest a pole's bound must come to be a piece (a choice)
_NEAR_EDGE = 4.0  # times as far from the edge of stability as asked for, up to which a pole is a piece (a choice)


class Height(NamedTuple):
    """A norm or a bound, and where it is.

    Attributes
    ----------
    model, channel : int
        Which plant, and which channel; a negative channel is a bound, `CONTROLLER` as model the controller itself.
    omega : float
        Frequency [rad/s], infinity included; nan of an H2 norm.
    value : float
        A logarithm of a norm, over its budget if it has one; of a bound, below zero where it is kept.
    pole : complex
        The pole of a bound on poles.
    """

    model: int
    channel: int
    omega: float
    value: float
    pole: complex = 0.0


class Piece(NamedTuple):
    """One function that is to be small: a `Height` of the largest singular value, of one below it, or of a pole.

    Attributes
    ----------
    model, channel, omega, value
        As of `Height`.
    gradient : ndarray
        By the free numbers.
    limit : bool
        Whether it is only to stay below zero.
    top : bool
        Whether it is the largest singular value itself.
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
    """The loops at one choice of the free numbers.

    Parameters
    ----------
    problem : Problem
    x : ndarray
        Free numbers.
    known : dict, optional
        Frequencies at which channels of models are looked at besides those that the poles show.
    edge : float, optional
        How far from the edge of stability the search keeps for now: decay of a pole over its size.
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
        self._slopes: dict[int, Array] = {}

    def beside(self, x: Array) -> "Point":
        """Return the loops at other free numbers."""
        return Point(self.problem, x, self._known, self.edge)

    # -- loops -----------------------------------------------------------------------------------------------------
    @cached_property
    def controller(self) -> Array:
        """The controller's matrices ``[[A, B], [C, D]]``."""
        return self.problem.matrix.value(self.x)

    @cached_property
    def plants(self) -> tuple[ScaledPlant, ...]:
        """The plants at these physical parameters."""
        return self.problem.plants.scaled(self.x[self.problem.physical], self.problem.order)

    @cached_property
    def loops(self) -> list[Closed | None]:
        """The closed loops, None where one is not well-posed; last the controller by itself."""
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

    def slopes(self, model: int) -> Array:
        """Return derivatives, as rows, of what moves in a loop: the controller's matrices, and the plant's beside them."""
        if model not in self._slopes:
            result = self.problem.matrix.slopes(self.x)
            moving = None if model == CONTROLLER else self.plants[model].slopes
            if moving is not None:
                (r, c), (p, q) = self.controller.shape, moving.shape[1:]
                both = np.zeros((len(result), r + p, c + q))
                both[:, :r, :c] = result.reshape(len(result), r, c)
                both[self.problem.physical, r:, c:] = moving
                result = both.reshape(len(result), -1)
            self._slopes[model] = result
        return self._slopes[model]

    def bends(self, model: int, weights: Array) -> Array:
        """Return second derivatives of the sum of the entries of the same times weights."""
        r, c = self.controller.shape
        result = self.problem.matrix.bends(self.x, weights[:r, :c])
        moving = None if model == CONTROLLER else self.plants[model].bends
        if moving is not None:
            result[np.ix_(self.problem.physical, self.problem.physical)] += np.tensordot(moving, weights[r:, c:], 2)
        return result

    @cached_property
    def well_posed(self) -> bool:
        """Whether all loops are."""
        finite = bool(np.isfinite(self.controller).all())
        return finite and all(loop is not None and np.isfinite(loop.A).all() for loop in self.loops)

    @cached_property
    def stable(self) -> bool:
        """Whether all loops of plants are."""
        if not self.well_posed:
            return False
        for model in self._models:
            loop = self.loop(model)
            if self.curves:
                _ = loop.coordinates  # which peaks ask for next, and hold the poles
            if not loop.abscissa < -loop.margin:
                return False
        return True

    # -- poles -----------------------------------------------------------------------------------------------------
    def abscissa(self) -> "tuple[float, Callable[[], Array]]":
        """Return the largest real part of all loops' poles, over the plant's rate, and its gradient.

        A pole of the controller that is faster than allowed counts too.
        """
        if not self.well_posed:
            return inf, lambda: np.zeros_like(self.x)
        rate, loops = self.problem.ports.rate, map(self.loop, self._models)
        slowest = [max(loop.poles, key=lambda pole: pole.real, default=-inf + 0j) for loop in loops]
        heights = [Height(i, DECAY, abs(pole), pole.real / rate, pole) for i, pole in enumerate(slowest)]
        worst = max([*heights, *self._of_kind(CONTROLLER, FASTEST_POLE)], key=lambda item: item.value)
        return worst.value, lambda: self._gradient(worst)

    def _distances(self, poles: Array) -> Array:
        """Return how far poles are from the axis, over their size and the plant's slowest rate together."""
        return -poles.real / (np.abs(poles) + self.problem.ports.slowest)

    @cached_property
    def apart(self) -> float:
        """How far the loops are from the edge of stability."""
        return min(float(self._distances(self.loop(i).poles).min(initial=1.0)) for i in self._models)

    def _bound(self, kind: int, poles: Array) -> tuple[Array, Array]:
        """Return how poles keep to a bound, and ``w``: a change ``d`` of a pole changes that by the real part of ``w* d``."""
        ports, size, limit = self.problem.ports, np.maximum(np.abs(poles), _TINY), self._limits[kind]
        if kind == FASTEST_POLE:
            return size / limit - 1.0, poles / size / limit
        if kind == DAMPING:
            return poles.real / size + limit, 1.0 / size - poles.real * poles / size**3
        if kind == DECAY:
            return (poles.real + limit) / ports.rate, np.full(len(poles), 1.0 / ports.rate)
        apart = np.maximum(self._distances(poles), _TINY)
        return np.log(limit / apart), poles / size / (size + ports.slowest) - 1.0 / poles.real

    def _of_kind(self, model: int, kind: int) -> list[Height]:
        """Return how the poles nearest to a bound of some kind keep to it."""
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
        """The channels whose H-infinity norm counts by model and channel, the controller's own last."""
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
        """Return the logarithm of a norm, over its budget."""
        return log(max(value, _TINY)) - self.problem.offset(channel)

    def _peak(self, pair: tuple[int, int]) -> Height:
        """Return the highest peak of a channel."""
        at, values = self.curves[pair].peaks
        return Height(*pair, float(at[0]), self._scaled(pair[1], float(values[0])))

    @cached_property
    def norms(self) -> list[Height]:
        """All norms."""
        return [*map(self._peak, self.curves), *self.squares]

    def _highest(self, limits: bool) -> Height | None:
        """Return the highest objective, or the highest of what is limited."""
        pairs = [pair for pair in self.curves if self.problem.is_limit(pair[1]) == limits]
        rough = [(self._scaled(pair[1], self.curves[pair].coarse[2]), pair) for pair in pairs]
        of_poles = self.bounds if limits else []
        found = [*(item for item in self.squares if self.problem.is_limit(item.channel) == limits), *of_poles]
        best = max(found, key=lambda item: item.value, default=None)
        for seen, pair in sorted(rough, reverse=True):
            if best is not None and seen < best.value + log(BELOW):
                break  # the grid shows so much of a peak that none of these is higher
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
        """The worst of what is limited."""
        return self._highest(limits=True)

    @property
    def aim(self) -> float:
        """The largest objective, as a logarithm."""
        return self.top.value

    @property
    def excess(self) -> float:
        """By how much the worst bound is exceeded; zero or less where all are kept."""
        return -inf if self.over is None else self.over.value

    def merit(self, weight: float) -> "tuple[float, Callable[[], Array]]":
        """Return the largest objective plus ``weight`` times what the worst bound is exceeded by, and its gradient."""
        if not self.stable or not isfinite(self.aim) or not self.excess < inf:
            return inf, lambda: np.zeros_like(self.x)
        over = self.over if self.excess > 0.0 else None
        if over is None:
            return self.aim, lambda: self._gradient(self.top)
        return self.aim + weight * over.value, lambda: self._gradient(self.top) + weight * self._gradient(over)

    # -- pieces ----------------------------------------------------------------------------------------------------
    def pieces(
        self, window: float, asked: "set[tuple[int, int, float]] | None" = None, between: float = 0.0
    ) -> list[Piece]:
        """Return the pieces within a share of what counts: of the highest objective, and of budgets nearly used up.

        Beside the peaks these are frequencies that are asked for, and those of the grid within the share ``between``.
        """
        result: list[Piece] = []
        for pair, curve in self.curves.items():
            high = self._near(pair, window)[0]
            others = sorted(at for *there, at in asked or () if tuple(there) == pair)
            if between and high:
                omega, seen, _ = curve.coarse
                others += omega[seen >= (1.0 - between) * exp(self._level(pair[1]))].tolist()
            others = [at for at in others if not any(same_place(at, peak, BESIDE) for peak in high)]
            result += self._singular(pair, [(at, window) for at in high] + [(at, 0.0) for at in others])
        for item in (*self.squares, *self.bounds):
            result.append(Piece(*item[:4], self._gradient(item), self.problem.is_limit(item.channel)))
        return result

    def tops(self, window: float) -> list[Height]:
        """Return the pieces of a window that are the largest singular value itself, without their gradients."""
        result = []
        for pair in self.curves:
            near = zip(*self._near(pair, window), strict=True)
            result += [Height(*pair, at, self._scaled(pair[1], value)) for at, value in near]
        return [*result, *self.squares, *self.bounds]

    def _near(self, pair: tuple[int, int], window: float) -> tuple[list[float], list[float]]:
        """Return frequencies and values of a channel's peaks within a share of what counts."""
        level, curve = self._level(pair[1]), self.curves[pair]
        if log(max(curve.coarse[2], _TINY)) < level + log((1.0 - window) * BELOW):
            return [], []
        at, values = curve.peaks
        kept = values >= (1.0 - window) * max(values[0], exp(level))
        return at[kept].tolist(), values[kept].tolist()

    def _level(self, channel: int) -> float:
        """Return the logarithm of the norm of a channel that counts: the highest objective's, or the budget."""
        return self.problem.offset(channel) + (0.0 if self.problem.is_limit(channel) else self.aim)

    def _singular(self, pair: tuple[int, int], wanted: list[tuple[float, float]]) -> list[Piece]:
        """Return the largest singular values at frequencies, and with a window those near them and mixtures of the two."""
        if not wanted:
            return []
        seen: list[tuple[Passage, float, Array, Array, float, bool]] = []
        passages = self.curves[pair].passages(np.array([at for at, _ in wanted]))
        for (at, window), passage in zip(wanted, passages, strict=True):
            U, V, values = passage.U.T, passage.Vh.conj(), passage.values.tolist()
            seen.append((passage, at, U[0], V[0], values[0], True))
            for k in range(1, len(values) if window else 1):
                if values[k] < (1.0 - window) * values[0]:
                    break
                seen.append((passage, at, U[k], V[k], values[k], False))
                for phase in _MIXED if 0.0 < at < inf else _MIXED[:2]:
                    u, v = (U[0] + phase * U[k]) / 2**0.5, (V[0] + phase * V[k]) / 2**0.5
                    seen.append((passage, at, u, v, 0.5 * (values[0] + values[k]), False))
        lefts, rights = (np.array([getattr(item[0], side) for item in seen]) for side in ("left", "right"))
        us, vs = np.array([item[2] for item in seen]).conj(), np.array([item[3] for item in seen])
        outer = (us[:, None, :] @ lefts).swapaxes(1, 2) * (rights @ vs[:, :, None]).swapaxes(1, 2)
        gradients = np.real(outer).reshape(len(seen), -1) @ self.slopes(pair[0]).T
        limit = self.problem.is_limit(pair[1])
        return [
            Piece(*pair, at, self._scaled(pair[1], value), gradient / max(value, _TINY), limit, top, passage)
            for (passage, at, _, _, value, top), gradient in zip(seen, gradients, strict=True)
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
        return self.slopes(model) @ np.real(np.conj(factor) * change).ravel()

    def h2(self, model: int, channel: int) -> tuple[float, Array]:
        """Return an H2 norm and the gradient of its logarithm."""
        if (model, channel) not in self._squares:
            self._squares[model, channel] = self._h2_and_gradient(model, channel)
        return self._squares[model, channel]

    def _h2_and_gradient(self, model: int, channel: int) -> tuple[float, Array]:
        loop, rows, columns = self.loop(model), self.problem.rows[channel], self.problem.columns[channel]
        B, C, n = loop.B[:, columns], loop.C[rows], len(loop.A)
        P, Q = _gramian(loop.A, B), _gramian(loop.A.T, C.T)
        square = max(float(np.sum((C @ P) * C)), _TINY**2)
        full = np.zeros((n + len(loop.C), n + loop.B.shape[1]))
        full[:n, :n] = Q @ P
        full[np.ix_(np.arange(n), n + columns)] = Q @ B
        full[np.ix_(n + rows, np.arange(n))] = C @ P
        gradient = self.slopes(model) @ (loop.before.T @ full @ loop.after.T).ravel() / square
        return float(np.sqrt(square)), gradient


def _gramian(A: Array, B: Array) -> Array:
    """Return ``P`` with ``A P + P A^T + B B^T = 0``."""
    if not len(A):
        return np.zeros((0, 0))
    return np.asarray(linalg.solve_continuous_lyapunov(A, -B @ B.T))
