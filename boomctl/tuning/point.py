"""What the search sees of the loops: values and gradients of peaks, H2 norms and bounds on poles and gains.

Norms count as logarithms, over their budget where they have one, so that units do not matter.  A piece lies nowhere above
what it stands for and touches it here: one singular value at one frequency, one pole.  What controls change is carried by
the chain rule, and so is what physical parameters change where the plant is a polynomial of them; where it may come about in
any way, by differences of fourth order of the response at that frequency.
"""

from collections.abc import Callable
from functools import cached_property, partial
from math import exp, inf, isfinite, log
from typing import NamedTuple

import numpy as np
from scipy import linalg

from boomctl.arrays import Array
from boomctl.tuning.problem import Closed, Problem, ScaledPlant, close
from boomctl.tuning.responses import BELOW, Passage, Paths, Response, coarse, grid, peaks, same_place

WINDOW = 0.1  # share below the highest within which peaks are looked at (a choice)
_STEP = 1e-3  # of differences, in halves of a parameter's range: rounding and what is left out are 1e-12 then (derived)
_BEND = 1e-5  # of differences of a controller's derivatives: they need to be right to some digits alone
_STENCIL = np.arange(5) - 2  # places of a difference of fourth order
_TINY = 1e-100  # norm that stands for zero, whose logarithm is a number
# share of its frequency by which a peak may lie beside another frequency and stand for it: its bend is that of all so near
BESIDE = 1e-3  # (measured: with 1e-6 twice the steps, with 1e-4 to 1e-2 as many)
_MIXED = (1.0, -1.0, 1j, -1j)  # phases in which two singular vectors of like values are mixed (a choice)
_ALIKE_POLES = 0.05  # how near to the highest a pole's bound must come to be a piece (a choice)
_NEAR_EDGE = 4.0  # times as far from the edge of stability as asked for, up to which a pole is a piece (a choice)
GAIN_LIMIT, FASTEST_POLE, DAMPING, DECAY, EDGE = -1, -2, -3, -4, -5  # what stands in place of a channel


class Piece(NamedTuple):
    """One function that is to be small.

    Attributes
    ----------
    model, channel : int
        Which plant, and which channel; a negative channel is a bound, -1 as model the controller itself.
    omega : float
        Frequency [rad/s], infinity included; nan of an H2 norm.
    value : float
        A logarithm of a norm, over its budget if it has one; of a bound, below zero where it is kept.
    gradient : ndarray
        By the free numbers.
    limit : bool
        Whether it is only to stay below zero.
    top : bool
        Whether it is the largest singular value itself.
    """

    model: int
    channel: int
    omega: float
    value: float
    gradient: Array
    limit: bool
    top: bool = True


class Bound(NamedTuple):
    """How a pole keeps to what is asked of it: a piece whose gradient is not yet known."""

    model: int
    kind: int
    omega: float
    value: float
    gradient: Callable[[], Array]


class Point:
    """The loops at one choice of the free numbers."""

    def __init__(self, problem: Problem, x: Array, known: "dict[tuple[int, int], Array] | None" = None) -> None:
        self.problem, self.x = problem, x
        self._known = {} if known is None else known
        self._responses: dict[tuple[int, int], Response] = {}
        self._paths: dict[tuple[int, int], Paths] = {}
        self._passages: dict[tuple[int, int, float], Passage] = {}
        self._pieces: dict[tuple[int, int, float, float], list[Piece]] = {}
        self._peaks: dict[tuple[int, int], tuple[float, Array, Array]] = {}
        self._grids: dict[tuple[int, int], tuple[Array, Array, float]] = {}
        self._moved: dict[tuple[int, int, int], Closed | None] = {}
        self._squares: dict[tuple[int, int], tuple[float, Array]] = {}
        self._slopes: dict[int, Array] = {}

    @cached_property
    def controller(self) -> tuple[Array, Array]:
        """The controller's matrices, and their derivatives as rows."""
        jet = self.problem.controller(self.x)
        return jet.value, jet.slopes.reshape(len(self.x), -1)

    @cached_property
    def plants(self) -> tuple[ScaledPlant, ...]:
        """The plants at these physical parameters."""
        return self.problem.plants(self.x[self.problem.physical])

    @property
    def exact(self) -> bool:
        """Whether all derivatives are known, those by physical parameters too."""
        return not len(self.problem.physical) or all(plant.slopes is not None for plant in self.plants)

    def slopes(self, model: int) -> Array:
        """Return derivatives, as rows, of what moves in a loop: the controller's matrices, and the plant's beside them."""
        if model not in self._slopes:
            result, moving = self.controller[1], self.plants[model].slopes if model >= 0 else None
            if moving is not None:
                own = np.zeros((len(result), *moving.shape[1:]))
                own[self.problem.physical] = moving
                result = _diagonal(result.reshape(len(result), *self.controller[0].shape), own).reshape(len(result), -1)
            self._slopes[model] = result
        return self._slopes[model]

    def bends(self, model: int) -> Array | None:
        """Return second derivatives of the same; None where there are none."""
        result, moving = self._controller_bends, self.plants[model].bends if model >= 0 else None
        if moving is None:
            return result
        k = len(self.x)
        own = np.zeros((k, k, *moving.shape[2:]))
        own[np.ix_(self.problem.physical, self.problem.physical)] = moving
        return _diagonal(np.zeros((k, k, *self.controller[0].shape)) if result is None else result, own)

    @cached_property
    def _controller_bends(self) -> Array | None:
        problem, k = self.problem, len(self.x)
        if problem.linear:
            return None
        result = np.zeros((k, k, *self.controller[0].shape))
        for i, step in enumerate(_BEND * np.eye(k)):
            up, down = problem.controller(self.x + step), problem.controller(self.x - step)
            result[i] = (up.slopes - down.slopes) / (2.0 * _BEND)
        return 0.5 * (result + result.swapaxes(0, 1))

    @cached_property
    def loops(self) -> tuple[Closed | None, ...]:
        """The closed loops; None where one is not well-posed."""
        return tuple(close(plant, self.controller[0], self.problem.order) for plant in self.plants)

    @cached_property
    def well_posed(self) -> bool:
        """Whether all loops are."""
        finite = bool(np.isfinite(self.controller[0]).all())
        return finite and all(loop is not None and np.isfinite(loop.A).all() for loop in self.loops)

    @cached_property
    def stable(self) -> bool:
        """Whether all loops are."""
        if not self.well_posed:
            return False
        for loop in self.loops:
            assert loop is not None
            if self._sums:
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
        rate, values = self.problem.ports.rate, [loop.abscissa if loop else inf for loop in self.loops]
        worst = int(np.argmax(values))
        value = values[worst] / rate
        fastest = max(self._controller_poles(), key=lambda bound: bound.value, default=None)
        if fastest is not None and fastest.value > value:
            return fastest.value, fastest.gradient

        def gradient() -> Array:
            poles, left, right = self._eigen(worst)
            k = int(np.argmax(poles.real))
            return self._of_pole(worst, poles[k], left[:, k], right[:, k], lambda change: np.real(change)) / rate

        return value, gradient

    def _eigen(self, model: int) -> tuple[Array, Array, Array]:
        """Return poles of a loop, left and right eigenvectors."""
        loop = self.loops[model]
        assert loop is not None
        values, inverse, vectors = loop.coordinates
        return (values, inverse.conj().T, vectors) if values.ndim == 1 else _eigen(loop.A)

    def _of_pole(self, model: int, pole: complex, left: Array, right: Array, of: Callable[[Array], Array]) -> Array:
        """Return the gradient of a function of a pole, which is a real part of a multiple of its change."""
        scale = left.conj() @ right
        l, r = left.conj() / scale, right
        loop = self.loops[model]
        assert loop is not None
        n = len(loop.A)
        outer = np.outer(l @ loop.before[:n], loop.after[:, :n] @ r)
        result = self.slopes(model) @ outer.ravel()
        for axis, place in self._by_differences(model):
            result = result.astype(complex)
            offsets, weights = self._stencil(axis)
            changes = []
            for offset in offsets:
                moved = self._loop_at(model, axis, offset)
                poles = np.linalg.eigvals(moved.A) if moved is not None else np.array([np.nan + 0j])
                changes.append(poles[np.argmin(np.abs(poles - pole))])
            result[place] = weights @ np.array(changes)
        return of(result)

    def _of_own_pole(self, pole: complex, of: Callable[[Array], Array]) -> Array:
        """Return the gradient of such a function of a pole of the controller."""
        n = self.problem.order
        poles, left, right = _eigen(self.controller[0][:n, :n])
        k = int(np.argmin(np.abs(poles - pole)))
        change = np.zeros(self.controller[0].shape, complex)
        change[:n, :n] = np.outer(left[:, k].conj() / (left[:, k].conj() @ right[:, k]), right[:, k])
        return of(self.controller[1] @ change.ravel())

    def _controller_poles(self) -> list[Bound]:
        """Return how much faster than allowed the controller's fastest poles are."""
        n, limit = self.problem.order, self.problem.fastest_pole
        if limit is None or not n:
            return []
        poles = np.linalg.eigvals(self.controller[0][:n, :n])
        result = []
        for k in np.flatnonzero((np.abs(poles) >= (1.0 - _ALIKE_POLES) * np.abs(poles).max()) & (poles.imag >= 0.0)):
            pole = poles[k]
            if abs(pole) == 0.0:
                continue

            def of(change: Array, pole: complex = pole) -> Array:
                return (pole.conjugate() * change).real / abs(pole) / limit

            gradient = partial(self._of_own_pole, pole, of)
            result.append(Bound(-1, FASTEST_POLE, float(abs(pole)), abs(pole) / limit - 1.0, gradient))
        return result

    @cached_property
    def _bounds(self) -> list[Bound]:
        return self._controller_poles() + self._loop_poles() + self._edge_poles()

    @cached_property
    def bounds(self) -> list[Piece]:
        """Bounds on poles."""
        return [Piece(*item[:4], item.gradient(), True) for item in self._bounds]

    def _loop_poles(self) -> list[Bound]:
        """Return how far poles of the loops are from the damping and decay asked for."""
        damping, decay = self.problem.min_damping_ratio, self.problem.min_decay_rate
        result: list[Bound] = []
        rate = self.problem.ports.rate
        if damping is None and decay is None:
            return result
        for i, loop in enumerate(self.loops):
            assert loop is not None
            poles, left, right = self._eigen(i)
            size = np.maximum(np.abs(poles), _TINY)
            if damping is not None:
                values = poles.real / size + damping

                def of_damping(change: Array, pole: complex) -> Array:
                    s = abs(pole)
                    return np.real(change) / s - pole.real * (pole.conjugate() * change).real / s**3

                result += self._poles_near_top(i, DAMPING, values, (poles, left, right), of_damping)
            if decay is not None:
                values = (poles.real + decay) / rate
                result += self._poles_near_top(
                    i, DECAY, values, (poles, left, right), lambda change, pole: np.real(change) / rate
                )
        return result

    @cached_property
    def _distances(self) -> list[Array]:
        """How far each pole of each loop is from the axis, over its size and the plant's slowest rate together."""
        slowest = self.problem.ports.slowest
        return [-loop.poles.real / (np.abs(loop.poles) + slowest) for loop in self.loops if loop is not None]

    @cached_property
    def apart(self) -> float:
        """How far the loops are from the edge of stability."""
        return min((float(item.min(initial=1.0)) for item in self._distances), default=1.0)

    def _edge_poles(self) -> list[Bound]:
        """Return poles near the edge of stability: logarithms of how far they are to stay from it, over how far they are."""
        edge, slowest = self.problem.edge, self.problem.ports.slowest
        result: list[Bound] = []
        if edge is None or self.apart > _NEAR_EDGE * edge:
            return result
        for i, apart in enumerate(self._distances):
            if apart.min(initial=1.0) > _NEAR_EDGE * edge:
                continue
            poles, left, right = self._eigen(i)
            apart = -poles.real / (
                np.abs(poles) + slowest
            )  # of other poles where the coordinates are not the eigenvectors
            for k in np.flatnonzero((apart <= _NEAR_EDGE * edge) & (poles.imag >= 0.0)):
                pole, size = poles[k], abs(poles[k]) + slowest

                def of(change: Array, pole: complex = pole, size: float = size) -> Array:
                    return (pole.conjugate() * change).real / max(abs(pole), _TINY) / size - np.real(change) / pole.real

                gradient = partial(self._of_pole, i, pole, left[:, k], right[:, k], of)
                result.append(Bound(i, EDGE, float(abs(pole)), log(edge / max(float(apart[k]), _TINY)), gradient))
        return result

    def _poles_near_top(
        self,
        model: int,
        kind: int,
        values: Array,
        eigen: tuple[Array, Array, Array],
        of: Callable[[Array, complex], Array],
    ) -> list[Bound]:
        poles, left, right = eigen
        chosen = np.flatnonzero((values >= values.max() - _ALIKE_POLES) & (poles.imag >= 0.0))
        return [
            Bound(
                model,
                kind,
                float(abs(poles[k])),
                float(values[k]),
                partial(
                    self._of_pole, model, poles[k], left[:, k], right[:, k], lambda change, k=k: of(change, poles[k])
                ),
            )
            for k in chosen
        ]

    def part(self, model: int, channel: int) -> tuple[Closed, Array, Array]:
        """Return the loop of a model, or the controller by itself, and rows and columns of a channel."""
        if model < 0:
            alone = self._alone
            return alone, np.arange(len(alone.C)), np.arange(alone.B.shape[1])
        loop = self.loops[model]
        assert loop is not None
        return loop, self.problem.rows[channel], self.problem.columns[channel]

    @cached_property
    def _alone(self) -> Closed:
        """The controller by itself."""
        n, K = self.problem.order, self.controller[0]
        around = np.zeros(K.T.shape)
        return Closed(K[:n, :n], K[:n, n:], K[n:, :n], K[n:, n:], np.eye(len(K)), np.eye(K.shape[1]), around)

    # -- norms -----------------------------------------------------------------------------------------------------
    def response(self, model: int, channel: int) -> Response:
        """Return a channel of a loop; model -1 is the controller itself."""
        key = (model, channel)
        if key not in self._responses:
            whole, rows, columns = self.part(model, channel)
            self._responses[key] = Response.of(whole, columns, rows)
        return self._responses[key]

    def paths(self, model: int, channel: int) -> Paths:
        """Return what leads through a channel of a loop."""
        key = (model, channel)
        if key not in self._paths:
            whole, rows, columns = self.part(model, channel)
            self._paths[key] = Paths.of(self.response(model, channel), whole, columns, rows)
        return self._paths[key]

    def passage(self, model: int, channel: int, omega: float) -> Passage:
        """Return a channel of a loop at a frequency."""
        return self._passages_at(model, channel, [omega])[0]

    def _passages_at(self, model: int, channel: int, omega: list[float]) -> list[Passage]:
        known = self._passages
        new = [item for item in omega if (model, channel, item) not in known]
        if new:
            result = self.paths(model, channel).passages(np.array(new))
            known.update(((model, channel, item), one) for item, one in zip(new, result, strict=True))
        return [known[model, channel, item] for item in omega]

    def norm_peaks(self, model: int, channel: int, window: float) -> tuple[Array, Array]:
        """Return frequencies and values of the peaks of a channel within a share of the highest."""
        seen, at, values = self._peaks.get((model, channel), (-1.0, np.zeros(0), np.zeros(0)))
        if seen < window:
            seen = max(window, WINDOW)  # whose pieces will be asked for, as a rule
            at, values = peaks(self.response(model, channel), *self._coarse(model, channel)[:2], seen)
            self._peaks[model, channel] = seen, at, values
        if seen == window:
            return at, values
        kept = values >= (1.0 - window) * values[0]
        return at[kept], values[kept]

    def _coarse(self, model: int, channel: int) -> tuple[Array, Array, float]:
        """Return a grid, the largest singular values there, and the largest of all."""
        if (model, channel) not in self._grids:
            response = self.response(model, channel)
            omega = grid(response.poles, self._known.get((model, channel), np.zeros(0)))
            self._grids[model, channel] = (omega, *coarse(response, omega))
        return self._grids[model, channel]

    def offset(self, channel: int) -> float:
        """Return the logarithm of what a norm counts in."""
        limit = self.problem.max_gain if channel == GAIN_LIMIT else self.problem.channels[channel].budget
        return 0.0 if limit is None else log(limit)

    def is_limit(self, channel: int) -> bool:
        """Return whether a norm is only to stay below its budget."""
        if channel == GAIN_LIMIT:
            return True
        only = all(item.budget is not None for item in self.problem.channels)
        return self.problem.channels[channel].budget is not None and not only

    @cached_property
    def _sums(self) -> list[tuple[int, int]]:
        """Models and channels whose H-infinity norm counts; the controller's own last."""
        pairs = [
            (i, c)
            for i in range(self.problem.count)
            for c, channel in enumerate(self.problem.channels)
            if channel.norm == "hinf"
        ]
        return pairs + ([(-1, GAIN_LIMIT)] if self.problem.max_gain is not None else [])

    @cached_property
    def norms(self) -> list[tuple[int, int, float, float]]:
        """Return model, channel, frequency and value, as a logarithm over its budget, of every norm."""
        result = []
        for model, channel in self._sums:
            at, value = self.norm_peaks(model, channel, 0.0)
            result.append((model, channel, float(at[0]), log(max(float(value[0]), _TINY)) - self.offset(channel)))
        result += self._squares_of(False) + self._squares_of(True)
        return result

    def _highest(self, limits: bool) -> tuple[int, int, float, float] | None:
        """Return model, channel, frequency and value of the highest objective, or of the highest budget."""
        pairs = [pair for pair in self._sums if self.is_limit(pair[1]) == limits]
        alone = len(pairs) == 1
        rough = [(0.0 if alone else log(max(self._coarse(*p)[2], _TINY)) - self.offset(p[1]), p) for p in pairs]
        best: tuple[int, int, float, float] | None = None
        for seen, (model, channel) in sorted(rough, reverse=True):
            if best is not None and seen < best[3] + log(BELOW):
                break  # the grid shows so much of a peak that none of these is higher
            at, value = self.norm_peaks(model, channel, 0.0)
            height = log(max(float(value[0]), _TINY)) - self.offset(channel)
            if best is None or height > best[3]:
                best = model, channel, float(at[0]), height
        for item in self._squares_of(limits):
            best = item if best is None or item[3] > best[3] else best
        return best

    @property
    def highest(self) -> list[tuple[int, int, float]]:
        """Models, channels and frequencies of the peaks that make the merit what it is."""
        result = [item for item in (self._top, self._over) if item is not None]
        return [item[:3] for item in result if not np.isnan(item[2])]

    def _squares_of(self, limits: bool) -> list[tuple[int, int, float, float]]:
        result = []
        for c, channel in enumerate(self.problem.channels):
            if channel.norm == "h2" and self.is_limit(c) == limits:
                for i in range(self.problem.count):
                    value = log(max(self.h2(i, c)[0], _TINY)) - self.offset(c)
                    result.append((i, c, np.nan, value))
        return result

    @cached_property
    def _top(self) -> tuple[int, int, float, float]:
        result = self._highest(limits=False)
        assert result is not None
        return result

    @cached_property
    def _over(self) -> tuple[int, int, float, float] | None:
        return self._highest(limits=True)

    def merit(self, weight: float) -> "tuple[float, Callable[[], Array]]":
        """Return the largest objective plus ``weight`` times what the worst bound is exceeded by, and its gradient."""
        if not self.stable or not isfinite(self.aim) or not self.excess < inf:
            return inf, lambda: np.zeros_like(self.x)
        if self.excess <= 0.0:
            return self.aim, lambda: self._gradient(*self._top[:3])

        def gradient() -> Array:
            most = max(self._bounds, key=lambda bound: bound.value, default=None)
            if self._over is not None and (most is None or self._over[3] >= most.value):
                return self._gradient(*self._top[:3]) + weight * self._gradient(*self._over[:3])
            assert most is not None
            return self._gradient(*self._top[:3]) + weight * most.gradient()

        return self.aim + weight * self.excess, gradient

    @cached_property
    def excess(self) -> float:
        """By how much the worst bound is exceeded; zero or less where all are kept."""
        result = [bound.value for bound in self._bounds]
        return max(result if self._over is None else [*result, self._over[3]], default=-inf)

    @cached_property
    def aim(self) -> float:
        """The largest objective, as a logarithm."""
        return self._top[3]

    def _gradient(self, model: int, channel: int, omega: float) -> Array:
        if np.isnan(omega):
            return self.h2(model, channel)[1]
        return self._singular(model, channel, [(omega, 0.0)])[0].gradient

    def pieces(
        self, window: float, asked: "set[tuple[int, int, float]] | None" = None, between: float = 0.0
    ) -> list[Piece]:
        """Return the pieces within a share of what counts: of the highest objective, and of budgets nearly used up.

        Beside the peaks these are frequencies that are asked for, and those of the grid within the share ``between``.
        """
        result: list[Piece] = []
        for model, channel in self._sums:
            high = self._near(model, channel, window)[0]
            others = sorted(at for i, c, at in asked or () if (i, c) == (model, channel))
            if between and high:
                omega, seen, _ = self._coarse(model, channel)
                others += omega[seen >= (1.0 - between) * exp(self._level(channel))].tolist()
            others = [at for at in others if not any(same_place(at, peak, BESIDE) for peak in high)]
            result += self._singular(model, channel, [(at, window) for at in high] + [(at, 0.0) for at in others])
        for model, channel, omega, value in self._squares_of(False) + self._squares_of(True):
            gradient = self.h2(model, channel)[1]
            result.append(Piece(model, channel, omega, value, gradient, self.is_limit(channel)))
        return result + self.bounds

    def tops(self, window: float) -> list[tuple[int, int, float, float]]:
        """Return model, channel, frequency and value of the pieces of a window that are the largest singular value itself."""
        result = []
        for model, channel in self._sums:
            offset = self.offset(channel)
            for at, value in zip(*self._near(model, channel, window), strict=True):
                result.append((model, channel, at, log(max(value, _TINY)) - offset))
        return result + self._squares_of(False) + self._squares_of(True) + [bound[:4] for bound in self._bounds]

    def _near(self, model: int, channel: int, window: float) -> tuple[list[float], list[float]]:
        """Return frequencies and values of a channel's peaks within a share of what counts."""
        level = self._level(channel)
        if log(max(self._coarse(model, channel)[2], _TINY)) < level + log((1.0 - window) * BELOW):
            return [], []
        places, values = self.norm_peaks(model, channel, window)
        kept = values >= (1.0 - window) * exp(level)
        return places[kept].tolist(), values[kept].tolist()

    def _level(self, channel: int) -> float:
        """Return the logarithm of the norm of a channel that counts: the highest objective's, or the budget."""
        return self.offset(channel) + (0.0 if self.is_limit(channel) else self.aim)

    def _singular(self, model: int, channel: int, wanted: list[tuple[float, float]]) -> list[Piece]:
        """Return the largest singular values at frequencies, and with a window those near them and mixtures of the two."""
        known = self._pieces
        new = [item for item in wanted if (model, channel, *item) not in known]
        if new:
            result = self._pieces_at(model, channel, new)
            known.update(((model, channel, *item), pieces) for item, pieces in zip(new, result, strict=True))
        return [piece for item in wanted for piece in known[model, channel, *item]]

    def _pieces_at(self, model: int, channel: int, wanted: list[tuple[float, float]]) -> list[list[Piece]]:
        """Return the pieces at frequencies, each with its window, for each of these."""
        omega, owner = [at for at, _ in wanted], []
        seen: list[tuple[Array, Array, float, bool]] = []
        passages = self._passages_at(model, channel, omega)
        for i, ((at, window), passage) in enumerate(zip(wanted, passages, strict=True)):
            U, V, values = passage.U.T, passage.Vh.conj(), passage.values.tolist()
            seen.append((U[0], V[0], values[0], True))
            for k in range(1, len(values) if window else 1):
                if values[k] < (1.0 - window) * values[0]:
                    break
                seen.append((U[k], V[k], values[k], False))
                for phase in _MIXED if 0.0 < at < inf else _MIXED[:2]:
                    u, v = (U[0] + phase * U[k]) / 2**0.5, (V[0] + phase * V[k]) / 2**0.5
                    seen.append((u, v, 0.5 * (values[0] + values[k]), False))
            owner += [i] * (len(seen) - len(owner))
        lefts, rights = np.array([passages[i].left for i in owner]), np.array([passages[i].right for i in owner])
        us, vs = np.array([item[0] for item in seen]).conj(), np.array([item[1] for item in seen])
        outer = (us[:, None, :] @ lefts).swapaxes(1, 2) * (rights @ vs[:, :, None]).swapaxes(1, 2)
        gradients = np.real(outer).reshape(len(seen), -1) @ self.slopes(model).T
        for axis, place in self._by_differences(model):
            offsets, weights = self._stencil(axis)
            moved = [[self._response_at(model, channel, axis, item, at) for item in offsets] for at in omega]
            for k, i in enumerate(owner):
                changes = [w * (us[k] @ M @ vs[k]).real for w, M in zip(weights, moved[i], strict=True)]
                gradients[k, place] = float(sum(changes))
        offset, limit = self.offset(channel), self.is_limit(channel)
        result: list[list[Piece]] = [[] for _ in omega]
        for i, (_, _, value, top), gradient in zip(owner, seen, gradients, strict=True):
            size = max(value, _TINY)
            piece = Piece(model, channel, omega[i], log(size) - offset, gradient / size, limit, top)
            result[i].append(piece)
        return result

    def h2(self, model: int, channel: int) -> tuple[float, Array]:
        """Return an H2 norm and the gradient of its logarithm."""
        if (model, channel) not in self._squares:
            self._squares[model, channel] = self._h2_and_gradient(model, channel)
        return self._squares[model, channel]

    def beside(self, x: Array) -> "Point":
        """Return the loops at other free numbers."""
        return Point(self.problem, x, self._known)

    def _h2_and_gradient(self, model: int, channel: int) -> tuple[float, Array]:
        loop = self.loops[model]
        assert loop is not None
        rows, columns = self.problem.rows[channel], self.problem.columns[channel]
        B, C, _ = loop.part(columns, rows)
        P, Q = _gramian(loop.A, B), _gramian(loop.A.T, C.T)
        square = max(float(np.sum((C @ P) * C)), _TINY**2)
        n = len(loop.A)
        full = np.zeros((n + len(loop.C), n + loop.B.shape[1]))
        full[:n, :n] = Q @ P
        full[np.ix_(np.arange(n), n + columns)] = Q @ B
        full[np.ix_(n + rows, np.arange(n))] = C @ P
        gradient = self.slopes(model) @ (loop.before.T @ full @ loop.after.T).ravel() / square
        for axis, place in self._by_differences(model):
            offsets, weights = self._stencil(axis)
            values = []
            for offset in offsets:
                moved = self._loop_at(model, axis, offset)
                assert moved is not None
                b, c, _ = moved.part(columns, rows)
                values.append(0.5 * log(max(float(np.sum((c @ _gramian(moved.A, b)) * c)), _TINY**2)))
            gradient[place] = float(weights @ np.array(values))
        return float(np.sqrt(square)), gradient

    # -- physical parameters ---------------------------------------------------------------------------------------
    def _by_differences(self, model: int) -> "list[tuple[int, int]]":
        """Return which physical parameters the plant's derivatives are not known by, and their places."""
        known = model < 0 or self.plants[model].slopes is not None
        return [] if known else [(axis, int(place)) for axis, place in enumerate(self.problem.physical)]

    def _stencil(self, axis: int) -> tuple[tuple[int, ...], Array]:
        """Return steps of a difference that stays within the parameter's range, and weights."""
        place = self.x[self.problem.physical[axis]]
        shift = 0
        while shift < 2 and place + (_STENCIL[0] + shift) * _STEP < -1.0:
            shift += 1
        while shift > -2 and place + (_STENCIL[-1] + shift) * _STEP > 1.0:
            shift -= 1
        offsets = _STENCIL + shift
        powers = np.vander(offsets.astype(float), 5, increasing=True).T
        weights = np.linalg.solve(powers, np.eye(5)[1]) / _STEP
        used = np.abs(weights) > 0.0
        return tuple(offsets[used].tolist()), weights[used]

    def _loop_at(self, model: int, axis: int, offset: int) -> Closed | None:
        key = (model, axis, offset)
        if key not in self._moved:
            values = self.x[self.problem.physical].copy()
            values[axis] += offset * _STEP
            plants: tuple[ScaledPlant, ...] = self.problem.plants(values)
            for i, plant in enumerate(plants):
                self._moved[i, axis, offset] = close(plant, self.controller[0], self.problem.order)
        return self._moved[key]

    def _response_at(self, model: int, channel: int, axis: int, offset: int, omega: float) -> Array:
        loop = self._loop_at(model, axis, offset)
        if loop is None:
            return np.full((len(self.problem.rows[channel]), len(self.problem.columns[channel])), np.nan)
        B, C, D = loop.part(self.problem.columns[channel], self.problem.rows[channel])
        if omega == inf or not len(loop.A):
            return D.astype(complex)
        return D + C @ np.linalg.solve(1j * omega * np.eye(len(loop.A)) - loop.A, B.astype(complex))


def _diagonal(one: Array, other: Array) -> Array:
    """Return stacks of matrices on a diagonal."""
    r, c = one.shape[-2:]
    result = np.zeros((*one.shape[:-2], r + other.shape[-2], c + other.shape[-1]))
    result[..., :r, :c], result[..., r:, c:] = one, other
    return result


def _eigen(A: Array) -> tuple[Array, Array, Array]:
    """Return eigenvalues, left and right eigenvectors."""
    return linalg.eig(A, left=True, right=True, check_finite=False)  # type: ignore[return-value]


def _gramian(A: Array, B: Array) -> Array:
    """Return ``P`` with ``A P + P A^T + B B^T = 0``."""
    if not len(A):
        return np.zeros((0, 0))
    return np.asarray(linalg.solve_continuous_lyapunov(A, -B @ B.T))
