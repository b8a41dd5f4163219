"""Proof that a loop's largest singular value stays below a level, over cells of parameters and frequencies together.

In a cell the loop's response is a Taylor series in the parameters and the frequency: ``C M^-1 B`` with ``M = s E - A``, all
polynomials of them.  Terms of first and second order are exact; what is left is bounded by magnitudes, entry by entry.  With
``M = M0 (1 + Z)``, a nonnegative matrix ``N`` that bounds ``Z`` throughout the cell, and a positive vector ``d`` such that
``N d < d`` (Collatz & Wielandt), ``M`` is regular there and ``(1 + Z)^-1`` is bounded.  A convex function of the terms is
largest at the corners of a polytope around them.  Where all cells between frequency zero and infinity are regular and the
loop is stable at one point, no pole crosses the axis anywhere in the box.

A resonance moves with the parameters, and cells whose frequencies do not would have to be as small as its width.  Cells lie
between two frequencies that are affine in the parameters; one that is cut across the frequency is cut along that slope at
which its response changes least with the parameters.  Whatever the slopes, every frequency of every point of the box lies
between two such surfaces that follow each other in the chain from zero to the last.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations_with_replacement
from math import comb
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from scipy import linalg
from scipy.sparse.csgraph import connected_components

from boomctl.analysis.box.polynomials import ROUNDING, Cell
from boomctl.analysis.box.zero_exclusion import BELOW, TOP, evened
from boomctl.arrays import Array, balance
from boomctl.chebyshev import FEW_PARAMETERS

if TYPE_CHECKING:
    from boomctl.analysis.box.level import LoopPart

_Terms = dict[tuple[int, ...], Array]
"""A series: of each product of variables its coefficient, in all cells."""


def _hull(count: int) -> Array:
    """Return the corners of a polygon around ``(v, v^2)``, ``-1 <= v <= 1``: where tangents meet that touch it at steps."""
    ends = np.linspace(-1.0, 1.0, count)
    meet = 0.5 * (ends[1:] + ends[:-1])
    return np.array([(-1.0, 1.0), *zip(meet, ends[1:] * ends[:-1], strict=True), (1.0, 1.0)])


_PARALLEL = 0.9  # cosine of eigenvectors beyond which they are made orthogonal: their inverse would be large (a choice)
_LEVEL = 1.0 - 1e-9  # share of a level below which a gain has to stay: more than rounding of the gain itself
_SWEEPS = 5  # of the power iteration for the vector: it need not be exact, any positive one bounds (measured)
_FAR = 0.6  # bound of ``Z`` beyond which it, not the terms of second order, decides where to cut (measured: 0.5 to 0.8 alike)
_WEDGE = (
    1.0  # width of a cell in its middle over how much that changes across it, below which slopes are no use (a choice)
)
_KEPT = 2  # parameters in a product whose matrix keeps its phases; longer products count by their magnitudes
_FIRST = 0.5  # share of the slowest pole at which the chain of frequencies begins after zero (a choice)
_CORNERS = 6  # Variables of a larger box whose corners are combined: memory grows with three to their number.
_HULLS = (_hull(5), _hull(3), _hull(2))  # of the frequency, of few parameters, of many: corners multiply (a choice)
_FEW = 4  # variables, the frequency among them, that are few: 6 times 4 times 4 times 4 corners (a choice)
_BATCH = 2**18  # entries of the matrices handled at once: what stays in the cache (measured)


@dataclass(frozen=True)
class Frontier:
    """Cells that wait for a proof.

    Attributes
    ----------
    middle, reach : (N, k) ndarray
        Their parameters.
    ends : (N, 2, 1 + k) ndarray
        Both frequencies, as affine functions of the parameters [rad/s]; inverse ones [s/rad] of cells that reach infinity.
    inverse : (N,) ndarray of bool
        Which those are.
    """

    middle: Array
    reach: Array
    ends: Array
    inverse: NDArray[np.bool_]

    def __len__(self) -> int:
        return len(self.middle)

    def __getitem__(self, index: slice | NDArray[np.bool_ | np.integer]) -> Frontier:
        return Frontier(self.middle[index], self.reach[index], self.ends[index], self.inverse[index])

    def with_halves(self, parents: Frontier, axes: NDArray[np.int_], between: Array) -> Frontier:
        """Return these and both halves of others, cut across a parameter or, ``axes = 0``, along a surface."""
        result: list[Frontier] = [self]
        across, along = np.flatnonzero(axes == 0), np.flatnonzero(axes)
        for side in (-1, 1):
            middle, reach, ends = parents.middle.copy(), parents.reach.copy(), parents.ends.copy()
            ends[across, 1 if side < 0 else 0] = between[across]
            reach[along, axes[along] - 1] *= 0.5
            middle[along, axes[along] - 1] += side * reach[along, axes[along] - 1]
            result.append(Frontier(middle, reach, ends, parents.inverse))
        fields = (np.concatenate([getattr(x, name) for x in result]) for name in ("middle", "reach", "ends", "inverse"))
        return Frontier(*fields)


@dataclass(frozen=True)
class ResponseCells:
    """A loop ``E x' = A x + (B - B d/dt) w``, ``z = C x + D w`` over a box, in coordinates in which it is nearly diagonal.

    Attributes
    ----------
    powers : tuple
        Products of parameters; matrices are sums over them.
    E, A, B : ndarray
        Stacks of matrices, one a product.
    C, D : ndarray
        What is judged.
    sampled : bool
        Whether the derivative of ``w`` counts.
    rounding : tuple of ndarray
        By how much entries of ``E``, of ``A``, and of ``B`` may be off.
    poles : ndarray
        Of the loop in the middle of the box [rad/s].
    size : int
        Number of parameters.
    """

    powers: tuple[tuple[int, ...], ...]
    E: Array
    A: Array
    B: Array
    C: Array
    D: Array
    sampled: bool
    rounding: tuple[Array, Array, Array]
    poles: Array
    size: int

    @classmethod
    def of(cls, loop: LoopPart) -> ResponseCells:
        """Return a loop in the eigenvectors of the middle of its box, nearly parallel ones made orthogonal."""
        pencils, B = loop.pencils, loop.B
        balanced, scale = balance(np.linalg.solve(*pencils[()]))
        poles, V = linalg.eig(balanced)  # type: ignore[misc]
        V = V.astype(complex)
        _orthogonalise(V)
        V = V * scale[:, None]
        W = np.linalg.inv(pencils[()][0] @ V)
        powers = ((), *sorted({*pencils, *B} - {()}, key=lambda power: (len(power), power)))
        both = np.array([pencils.get(power, 0.0 * pencils[()]) for power in powers])
        driving = np.array([W @ B.get(power, 0.0 * B[()]) for power in powers])
        off = np.abs(W) @ (ROUNDING * np.abs(both).sum(axis=0) + loop.missed[0]) @ np.abs(V)
        rounding, size = (*off, np.abs(W) @ loop.missed[1]), len(loop.cell.middle)
        E, A = (W @ both @ V).swapaxes(0, 1)
        return cls(powers, E, A, driving, loop.C @ V, loop.D, loop.sampled, rounding, poles, size)

    def start(self, box: Cell) -> Frontier:
        """Return a part of the box over all frequencies."""
        low, high = _FIRST * float(np.abs(self.poles).min()), TOP * float(np.abs(self.poles).max())
        chain = np.concatenate([[0.0], np.geomspace(low, high, 2 + int(np.log2(high / low)))])
        count = len(chain)
        ends = np.zeros((count, 2, 1 + self.size))
        ends[:-1, 0, 0], ends[:-1, 1, 0], ends[-1, 1, 0] = chain[:-1], chain[1:], 1.0 / high
        middle, reach = np.tile(box.middle, (count, 1)), np.tile(box.reach, (count, 1))
        return Frontier(middle, reach, ends, np.arange(count) == count - 1)

    @cached_property
    def sizes(self) -> tuple[tuple[Array, Array], tuple[Array, Array]]:
        """Magnitudes of the entries of ``E`` and ``A``, and of what is driven by derivatives and at once."""
        B = np.abs(self.B)
        return (np.abs(self.E), np.abs(self.A)), (self.sampled * B, B)

    @property
    def batch(self) -> int:
        """How many cells are looked at together."""
        return max(8, _BATCH // len(self.poles) ** 2)

    def look(self, cells: Frontier) -> tuple[Array, Array, NDArray[np.int_], Array]:
        """Return bounds of the largest singular value over cells, that in their middles, and where to cut them."""
        series = _Series.of(self, cells)
        gain, bound, second, rest = series.gains()
        axes, between = series.cuts(second, rest)
        return np.where(series.rho < BELOW, bound, np.inf), gain, axes, between

    def prove(self, cell: Cell, level: float, limit: int, seen: Callable[[float, Array], float]) -> int | None:
        """Prove that no singular value reaches a level; return in how many cells it was proved, None if it was not.

        Parameters
        ----------
        cell : Cell
            Where it is to be proved.
        level : float
            The level.
        limit : int
            Largest number of cells looked at; it is given up where more wait.
        seen : callable
            Is told the largest gain met among each batch's middles and the point; returns the level from there on, infinite
            where there is none.
        """
        cells, tried, proved = self.start(cell), 0, 0
        while len(cells) and tried + len(cells) <= limit and level < np.inf:
            here, cells = cells[-self.batch :], cells[: -self.batch]
            bound, gain, axes, between = self.look(here)
            tried += len(here)
            worst = int(np.argmax(gain))
            level = seen(float(gain[worst]), here.middle[worst])
            open_ = ~(bound < level * _LEVEL)  # what is not a number is not proved
            proved += int((~open_).sum())
            cells = cells.with_halves(here[open_], axes[open_], between[open_])
        return None if len(cells) else proved


@dataclass(frozen=True)
class _Series:
    """Terms of ``M = M0 (1 + Z)`` and of the response over cells.

    They are named by variables from -1 to 1: zero across the frequency, from one on the parameters.

    Attributes
    ----------
    loop : ResponseCells
        The loop.
    cells : Frontier
        The cells.
    along : ndarray
        ``M0^-1`` times how ``M`` changes with the frequency.
    Z, sizes : dict
        Terms of first and second order, and the magnitudes of their entries.
    higher : ndarray
        Bound of what is left of ``Z``, rounding included.
    x : dict
        Terms of ``M^-1 B`` up to second order.
    driven : ndarray
        Bound of the terms of ``M0^-1 B`` beyond second order.
    rho, d : ndarray
        Bound of the spectral radius of ``Z``, and the vector that shows it.
    beside : ndarray
        Bound of the terms of ``Z`` beyond first order.
    frequency : tuple of ndarray
        In the middles, half the width, half the sums and half the differences of the slopes.
    """

    loop: ResponseCells
    cells: Frontier
    along: Array
    Z: _Terms
    sizes: _Terms
    higher: Array
    x: _Terms
    driven: Array
    rho: Array
    d: Array
    beside: Array
    frequency: tuple[Array, Array, Array, Array]

    @classmethod
    def of(cls, loop: ResponseCells, cells: Frontier) -> _Series:
        """Return the series."""
        values = cells.ends[:, :, 0] + (cells.ends[:, :, 1:] * cells.middle[:, None, :]).sum(axis=2)
        slopes = cells.ends[:, :, 1:] * cells.reach[:, None, :]
        center, half = 0.5 * (values[:, 1] + values[:, 0]), 0.5 * (values[:, 1] - values[:, 0])
        tilt, spread = 0.5 * (slopes[:, 1] + slopes[:, 0]), 0.5 * (slopes[:, 1] - slopes[:, 0])
        # the pencil is j a E - b A: (frequency, 1), or (1, inverse frequency) of cells that reach infinity
        a, da = (np.where(cells.inverse, x, y)[:, None, None] for x, y in ((1.0, center), (0.0, half)))
        b, db = (np.where(cells.inverse, x, y)[:, None, None] for x, y in ((center, 1.0), (half, 0.0)))
        turned: _Terms = {(): 1j * a, (0,): 1j * da}
        for i in range(loop.size):
            turned[i + 1,], turned[0, i + 1] = (1j * X[:, i, None, None] for X in (tilt, spread))
        still: _Terms = {(): -b, (0,): -db}
        shares, beyond = _shares(loop.powers, cells)
        E, A, B = ({p: np.tensordot(w, X, 1) for p, w in shares.items()} for X in (loop.E, loop.A, loop.B))
        inverse = np.linalg.inv(1j * a * E[()] - b * A[()])
        P = {p: inverse @ X for p, X in E.items() if not p or X.any()}
        Q = {p: inverse @ X for p, X in A.items() if p and X.any()}
        Q[()] = (1j * a * P[()] - np.eye(len(loop.poles))) / b  # for j a P - b Q is one
        Z, higher = _expanded((turned, P), (still, Q))
        push = {p: -inverse @ X for p, X in B.items() if not p or X.any()}
        driving, driven = _expanded((turned, push if loop.sampled else {}), (still, push))
        off_E, off_A, off_B = loop.rounding
        side = [sum(np.abs(x) for x in terms.values()) for terms in (turned, still)]
        others = [side[0] * off_E + side[1] * off_A, (side[0] + side[1]) * off_B]
        if beyond.any():
            for place, pair in enumerate(loop.sizes):
                others[place] += sum(w * np.tensordot(beyond, X, 1) for w, X in zip(side, pair, strict=True))
        higher, driven = (late + np.abs(inverse) @ more for late, more in zip((higher, driven), others, strict=True))
        sizes = {p: np.abs(X) for p, X in Z.items() if p}
        main = sum(X for p, X in sizes.items() if len(p) == 1)
        beside = sum((X for p, X in sizes.items() if len(p) > 1), higher)
        d = np.ones((*higher.shape[:2], 1))
        for _ in range(_SWEEPS):
            d = evened(d, main @ d)
        rho, x = (((main + beside) @ d) / d).max(axis=(1, 2)), _solution(driving, Z, loop.size)
        frequency = center, half, tilt, spread
        return cls(loop, cells, 1j * P[()], Z, sizes, higher, x, driven, rho, d, beside, frequency)

    def gains(self) -> tuple[Array, Array, Array, Array]:
        """Return the gain in the middles, a bound of it, what terms of second order add to that, and what the rest adds."""
        C, d, beside, size = self.loop.C, self.d, self.beside, 1 + self.loop.size
        G = {p: C @ x for p, x in self.x.items()}
        G0 = G[()] + self.loop.D
        # what the series does not satisfy of (1 + Z) x = M0^-1 B: terms of third order and beyond
        most = sum(np.abs(x) for p, x in self.x.items() if p)
        residual = beside @ most + self.higher @ np.abs(self.x[()]) + self.driven
        judged, weight = np.abs(C) @ residual, np.abs(C) @ beside
        pairs = [x for p, x in self.x.items() if len(p) == _KEPT]
        late = np.concatenate(pairs, axis=2)
        for i in range(size):
            step = self.Z[i,] @ late
            shape = len(pairs), -1
            residual = residual + np.abs(step).reshape(*step.shape[:2], *shape).sum(axis=2)
            judged = judged + np.abs(C @ step).reshape(len(step), len(C), *shape).sum(axis=2)
            weight = weight + np.abs(C @ self.Z[i,])
        spare = np.where(self.rho < BELOW, 1.0 - self.rho, np.nan)[:, None, None]
        rest = _size(judged + (weight @ d) * ((residual / d).max(axis=1, keepdims=True) / spare))
        total, second = rest, np.zeros((len(G0), size))
        for p, X in G.items():
            if len(p) == _KEPT:
                share = _size(X)
                total = total + share if p[0] != p[1] else total
                for i in p:
                    second[:, i] += 0.5 * share
        at = G0[:, None]
        corners = FEW_PARAMETERS if size <= FEW_PARAMETERS + 1 else _CORNERS
        for i in range(size):
            if i > corners:  # Corners multiply: the others count by magnitudes.
                total = total + _size(G[i,]) + _size(G[i, i])
                continue
            hull = _HULLS[0 if i == 0 else 1 if size <= _FEW else 2]
            pair = np.stack([G[i,], G[i, i]], axis=1)
            at = at[:, :, None] + np.tensordot(pair, hull, (1, 1)).transpose(0, 3, 1, 2)[:, None]
            at = at.reshape(len(G0), -1, *G0.shape[1:])
        return _largest(G0), _largest(at).max(axis=1) + total, second, rest

    def cuts(self, second: Array, rest: Array) -> tuple[NDArray[np.int_], Array]:
        """Return across which variable cells are to be cut, zero the frequency, and along which surface there."""
        (center, half, tilt, spread), d, variables = self.frequency, self.d, range(1 + self.loop.size)
        pairs = {p: 0.5 * size @ d for p, size in self.sizes.items() if len(p) == _KEPT}
        mixed = [sum((p.count(i) * size for p, size in pairs.items()), np.zeros_like(d)) for i in variables]
        own = [self.sizes[i,] @ d + mixed[i] for i in variables]
        shares = np.stack([(size / d).max(axis=(1, 2)) for size in own], axis=1)
        squares = (np.abs(self.along) ** 2).sum(axis=(1, 2))
        turns = [-(self.along.conj() * self.Z[i,]).sum(axis=(1, 2)).real / squares for i in variables[1:]]
        turned = [
            np.abs(self.Z[i,] + turn[:, None, None] * self.along) @ d + mixed[i]
            for i, turn in zip(variables[1:], turns, strict=True)
        ]
        straight = np.abs(half) > _WEDGE * np.abs(spread).max(axis=1)
        whole = sum(own[1:], own[0])
        tries = [0.5 * own[0] + sum(turned[1:], turned[0]), *(whole - 0.5 * size for size in own[1:])]
        after = np.stack([(item / d).max(axis=(1, 2)) for item in tries], axis=1)
        after[:, 0] = np.where(straight, after[:, 0], np.inf)
        score = second + rest[:, None] * shares / shares.sum(axis=1, keepdims=True)
        axes = np.where(np.isfinite(score).all(axis=1), score.argmax(axis=1), shares.argmax(axis=1))
        axes = np.where(self.rho > _FAR, after.argmin(axis=1), axes)
        axes = np.where((axes == 0) & ~straight, 1 + np.abs(spread).argmax(axis=1), axes)
        slopes = np.where(self.cells.inverse[:, None], 0.0, tilt + np.stack(turns, axis=1)) / self.cells.reach
        return axes, np.column_stack([center - (slopes * self.cells.middle).sum(axis=1), slopes])


def _expanded(*products: tuple[_Terms, _Terms]) -> tuple[_Terms, Array]:
    """Return the sum of products of series up to second order, and a bound of the magnitudes of its other terms."""
    result: _Terms = {}
    higher: Any = 0.0
    for frequency, series in products:
        for q, X in series.items():
            late = [np.abs(x) for p, x in frequency.items() if len(p) + len(q) > _KEPT]
            for p, x in frequency.items():
                power = tuple(sorted((*p, *q)))
                if len(power) <= _KEPT:
                    result[power] = result.get(power, 0.0) + x * X
            higher = higher + sum(late) * np.abs(X) if late else higher
    return result, higher


def _orthogonalise(V: Array) -> None:
    """Make groups of nearly parallel columns orthogonal, in place."""
    count, group = connected_components(np.abs(V.conj().T @ V) > _PARALLEL, directed=False)
    for k in range(count):
        own = np.flatnonzero(group == k)
        if len(own) > 1:
            V[:, own] = np.linalg.qr(V[:, own])[0]


def _solution(driving: _Terms, Z: _Terms, size: int) -> _Terms:
    """Return the terms of ``(1 + Z)^-1`` times what drives up to the second order."""
    x: _Terms = {(): driving[()]}
    for order in (1, 2):
        for power in combinations_with_replacement(range(1 + size), order):
            result: Any = driving.get(power, 0.0)
            for part in {power[:1], power[1:], power} & {*Z}:
                rest = () if part == power else power[1:] if part == power[:1] else power[:1]
                result = result - Z[part] @ x[rest] if part else result
            x[power] = result
    return x


def _shares(powers: tuple[tuple[int, ...], ...], cells: Frontier) -> tuple[dict[tuple[int, ...], Array], Array]:
    """Return what products of parameters bring to products of variables of the cells, shape (cells, products).

    Of none, one and two variables each for itself; of more the sum of magnitudes.
    """
    k = cells.middle.shape[1]
    often = np.array([[power.count(i) for i in range(k)] for power in powers])
    total = np.ones((len(cells), len(powers)))
    # powers of each parameter's middle, and what of them goes with none, one and two of its p
    parts: list[list[Array]] = []
    for i, (n, middle, reach) in enumerate(zip(often.T, cells.middle.T, cells.reach.T, strict=True)):
        total *= (np.abs(middle) + reach)[:, None] ** n
        known = middle[:, None] ** np.arange(n.max(initial=0) + 1)
        parts.append([])
        for count in range(_KEPT + 1):
            left = np.maximum(n - count, 0)
            ways = np.where(n >= count, [comb(item, count) for item in n.tolist()], 0.0)
            parts[i].append(ways * known[:, left] * (reach**count)[:, None])
    result: dict[tuple[int, ...], Array] = {}
    for count in range(_KEPT + 1):
        for here in combinations_with_replacement(range(k), count):
            share = np.prod([parts[i][here.count(i)] for i in range(k)], axis=0)
            if share.any():
                result[tuple(i + 1 for i in here)] = share
            total -= np.abs(share)
    return result, np.maximum(np.where(often.sum(axis=1) > _KEPT, total, 0.0), 0.0)


def _size(G: Array) -> Array:
    """Return the Frobenius norm, which no singular value exceeds."""
    return np.sqrt((np.abs(G) ** 2).sum(axis=(-2, -1)))


def _largest(G: Array) -> Array:
    """Return the largest singular value."""
    return _size(G) if 1 in G.shape[-2:] else np.linalg.norm(G, 2, axis=(-2, -1))
