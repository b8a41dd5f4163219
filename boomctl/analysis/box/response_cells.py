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

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations_with_replacement
from math import comb

import numpy as np
from numpy.typing import NDArray
from scipy import linalg
from scipy.sparse.csgraph import connected_components

from boomctl.analysis.box.polynomials import Cell, Polynomial
from boomctl.analysis.box.zero_exclusion import BELOW, TOP, evened
from boomctl.arrays import Array, balance
from boomctl.chebyshev import FEW_PARAMETERS
from boomctl.lti.rounding import EPS


def _hull(count: int) -> Array:
    """Return the corners of a polygon around ``(v, v^2)``, ``-1 <= v <= 1``: where tangents meet that touch it at steps."""
    ends = np.linspace(-1.0, 1.0, count)
    meet = 0.5 * (ends[1:] + ends[:-1])
    return np.array([(-1.0, 1.0), *zip(meet, ends[1:] * ends[:-1], strict=True), (1.0, 1.0)])


_PARALLEL = 0.9  # cosine of eigenvectors beyond which they are made orthogonal: their inverse would be large (a choice)
# of entries of products of three matrices, over that of magnitudes (derived: 3 n eps, for n up to 300 states)
ROUNDING = 1e3 * EPS
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
    def of(
        cls,
        pencils: Polynomial,
        B: Polynomial,
        C: Array,
        D: Array,
        sampled: bool,
        size: int,
        missed: tuple[Array, Array],
    ) -> ResponseCells:
        """Return a loop in the eigenvectors of the middle of its box, nearly parallel ones made orthogonal.

        ``pencils`` are ``[E, A]``; ``missed`` is by how much entries of both, and of ``B``, may be off.
        """
        balanced, scale = balance(np.linalg.solve(*pencils[()]))
        poles, V = linalg.eig(balanced)  # type: ignore[misc]
        V = V.astype(complex)
        _orthogonalise(V)
        V = V * scale[:, None]
        W = np.linalg.inv(pencils[()][0] @ V)
        powers = ((), *sorted({*pencils, *B} - {()}, key=lambda power: (len(power), power)))
        both = np.array([pencils.get(power, 0.0 * pencils[()]) for power in powers])
        driving = np.array([W @ B.get(power, 0.0 * B[()]) for power in powers])
        off = np.abs(W) @ (ROUNDING * np.abs(both).sum(axis=0) + missed[0]) @ np.abs(V)
        E, A = (W @ both @ V).swapaxes(0, 1)
        return cls(powers, E, A, driving, C @ V, D, sampled, (*off, np.abs(W) @ missed[1]), poles, size)

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
        bounds = series.regularity()
        gain, bound, second, rest = series.gains(bounds)
        axes, between = series.cuts(bounds, second, rest)
        return np.where(bounds.rho < BELOW, bound, np.inf), gain, axes, between

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
class _Bounds:
    """Bounds of ``Z``: its spectral radius, the vector that shows it, its terms beyond first order, shares of variables.

    ``own`` and ``mixed`` are magnitudes times the vector, of all terms with a variable, and of those of second order alone.
    """

    rho: Array
    d: Array
    beside: Array
    own: list[Array]
    mixed: list[Array]


@dataclass(frozen=True)
class _Expansion:
    """``j a P - b Q`` over cells: in their middles, terms of first and second order, a bound of magnitudes of the others."""

    middle: Array
    first: list[Array]
    second: dict[tuple[int, int], Array]
    higher: Array


@dataclass(frozen=True)
class _Frequency:
    """Where on the axis cells are, as ``(j a, b)``: middles, half the widths, half the sums and differences of the slopes."""

    a: Array
    da: Array
    b: Array
    db: Array
    tilt: Array
    spread: Array

    @property
    def away(self) -> Array:
        """How far frequencies of a cell are from that of its middle at most."""
        return np.abs(self.da) + np.abs(self.tilt).sum(axis=1) + np.abs(self.spread).sum(axis=1)

    def expanded(self, P: Mapping[tuple[int, ...], Array], Q: Mapping[tuple[int, ...], Array], size: int) -> _Expansion:
        """Return ``j a P - b Q`` of polynomials of second order of the parameters, expanded in the frequency and these."""
        shape = next(iter([*P.values(), *Q.values()])).shape
        none, a, da, b, db = np.zeros(shape), self.a, self.da, self.b, self.db
        tilt, spread = ([X[:, i] for i in range(size)] for X in (self.tilt, self.spread))

        def changed(power: tuple[int, ...], ca: Array, cb: Array) -> Array:
            result = none
            if power in P:
                result = result + 1j * ca * P[power]
            return result - cb * Q[power] if power in Q else result

        straight = 1j * P[()] if () in P else none
        first = [changed((), da, db)]
        second: dict[tuple[int, int], Array] = {}
        for i in range(size):
            first.append(changed((i,), a, b) + tilt[i] * straight)
            second[0, i + 1] = changed((i,), da, db) + spread[i] * straight
        for i, j in combinations_with_replacement(range(size), 2):
            result = changed((i, j), a, b)
            if (j,) in P:
                result = result + 1j * tilt[i] * P[j,]
            if i != j and (i,) in P:
                result = result + 1j * tilt[j] * P[i,]
            if result is not none:
                second[i + 1, j + 1] = result
        spreads, higher = np.abs(self.spread).sum(axis=1), np.zeros(shape)
        for power in {*P, *Q} - {()}:
            p, q = P.get(power, none), Q.get(power, none)
            higher = higher + (spreads if len(power) == 1 else self.away) * np.abs(p)
            if len(power) > 1:
                higher = higher + np.abs(db) * np.abs(q)
        return _Expansion(changed((), a, b), first, second, higher)


@dataclass(frozen=True)
class _Series:
    """Terms of ``Z`` and of the response over cells, in ``q``, across the frequency, and ``p``, all from -1 to 1.

    Attributes
    ----------
    loop : ResponseCells
        The loop.
    cells : Frontier
        The cells.
    along : ndarray
        ``M^-1`` times how ``M`` changes with the frequency.
    first : list of ndarray
        Of ``Z``, by ``q`` and each ``p``.
    second : dict
        Of ``Z``, by pairs of those.
    higher : ndarray
        Bound of what is left of ``Z``, rounding included.
    x : tuple
        Of ``M^-1 B``: of order zero, of one, and of two by pairs of variables.
    driven : ndarray
        Bound of the terms of ``M0^-1 B`` beyond second order.
    frequency : tuple of ndarray
        In the middles, half the width, half the sums and half the differences of the slopes.
    """

    loop: ResponseCells
    cells: Frontier
    along: Array
    first: list[Array]
    second: dict[tuple[int, int], Array]
    higher: Array
    x: tuple[Array, list[Array], list[Array]]
    driven: Array
    frequency: tuple[Array, Array, Array, Array]

    @classmethod
    def of(cls, loop: ResponseCells, cells: Frontier) -> _Series:
        """Return the series."""
        k = loop.size
        values = cells.ends[:, :, 0] + (cells.ends[:, :, 1:] * cells.middle[:, None, :]).sum(axis=2)
        slopes = cells.ends[:, :, 1:] * cells.reach[:, None, :]
        center, half = 0.5 * (values[:, 1] + values[:, 0]), 0.5 * (values[:, 1] - values[:, 0])
        tilt, spread = 0.5 * (slopes[:, 1] + slopes[:, 0]), 0.5 * (slopes[:, 1] - slopes[:, 0])
        # the pencil is j a E - b A: (frequency, 1), or (1, inverse frequency) of cells that reach infinity
        a, da = (np.where(cells.inverse, x, y)[:, None, None] for x, y in ((1.0, center), (0.0, half)))
        b, db = (np.where(cells.inverse, x, y)[:, None, None] for x, y in ((center, 1.0), (half, 0.0)))
        shares, beyond = _shares(loop.powers, cells)
        E, A, B = ({p: np.tensordot(w, X, 1) for p, w in shares.items()} for X in (loop.E, loop.A, loop.B))
        inverse = np.linalg.inv(1j * a * E[()] - b * A[()])
        P = {p: inverse @ X for p, X in E.items() if X.any()}
        Q = {p: inverse @ X for p, X in A.items() if p and X.any()}
        Q[()] = (1j * a * P[()] - np.eye(len(loop.poles))) / b  # for j a P - b Q is one
        moved = _Frequency(a, da, b, db, tilt[:, :, None, None], spread[:, :, None, None])
        Z = moved.expanded(P, Q, k)
        driven = {p: -inverse @ X for p, X in B.items() if p == () or X.any()}
        driving = moved.expanded(driven if loop.sampled else {}, driven, k)
        off_E, off_A, off_B = loop.rounding
        side = np.abs(a) + moved.away, np.abs(b) + np.abs(db)
        others = [side[0] * off_E + side[1] * off_A, (side[0] + side[1]) * off_B]
        if beyond.any():
            for place, pair in enumerate(loop.sizes):
                others[place] += sum(w * np.tensordot(beyond, X, 1) for w, X in zip(side, pair, strict=True))
        higher, driven = (X.higher + np.abs(inverse) @ more for X, more in zip((Z, driving), others, strict=True))
        frequency = (center, half, tilt, spread)
        x = _solution(driving, Z)
        return cls(loop, cells, 1j * P[()], Z.first, Z.second, higher, x, driven, frequency)

    def regularity(self) -> _Bounds:
        """Return bounds of ``Z``."""
        sizes = [np.abs(Z) for Z in self.first]
        main = sum(sizes[1:], sizes[0])
        beside = sum((np.abs(Z) for Z in self.second.values()), self.higher)
        d = np.ones((*main.shape[:2], 1))
        for _ in range(_SWEEPS):
            d = evened(d, main @ d)
        own = [Z @ d for Z in sizes]
        rho = ((sum(own[1:], own[0]) + beside @ d) / d).max(axis=(1, 2))
        pairs = {pair: np.abs(Z) @ d for pair, Z in self.second.items()}
        mixed = [sum((0.5 * p.count(i) * size for p, size in pairs.items()), np.zeros_like(d)) for i in range(len(own))]
        return _Bounds(rho, d, beside, [a + b for a, b in zip(own, mixed, strict=True)], mixed)

    def gains(self, bounds: _Bounds) -> tuple[Array, Array, Array, Array]:
        """Return the gain in the middles, a bound of it, what terms of second order add to that, and what the rest adds."""
        C, (x0, x1, x2), d, beside = self.loop.C, self.x, bounds.d, bounds.beside
        m, count = x0.shape[2], len(x2)
        G0, G1 = C @ x0 + self.loop.D, [C @ x for x in x1]
        # what the series does not satisfy of (1 + Z) x = M0^-1 B: terms of third order and beyond
        size = sum((np.abs(x) for x in (*x1, *x2)), np.zeros(x0.shape))
        residual = beside @ size + self.higher @ np.abs(x0) + self.driven
        judged, weight = np.abs(C) @ residual, np.abs(C) @ beside
        late = np.concatenate(x2, axis=2)
        for Z in self.first:
            step = Z @ late
            residual = residual + np.abs(step).reshape(*step.shape[:2], count, m).sum(axis=2)
            judged = judged + np.abs(C @ step).reshape(len(step), -1, count, m).sum(axis=2)
            weight = weight + np.abs(C @ Z)
        spare = np.where(bounds.rho < BELOW, 1.0 - bounds.rho, np.nan)[:, None, None]
        rest = _size(judged + (weight @ d) * ((residual / d).max(axis=1, keepdims=True) / spare))
        G2 = {pair: C @ x for pair, x in zip(combinations_with_replacement(range(len(x1)), 2), x2, strict=True)}
        total, second = rest, np.zeros((len(G0), len(x1)))
        for (i, j), G in G2.items():
            share = _size(G)
            if i != j:
                total = total + share
            second[:, i] += 0.5 * share
            second[:, j] += 0.5 * share
        at = G0[:, None]
        corners = FEW_PARAMETERS if len(G1) <= FEW_PARAMETERS + 1 else _CORNERS
        for i, G in enumerate(G1):
            if i > corners:  # Corners multiply: the others count by magnitudes.
                total = total + _size(G) + _size(G2[i, i])
                continue
            hull = _HULLS[0 if i == 0 else 1 if len(G1) <= _FEW else 2]
            at = (
                at[:, :, None]
                + hull[:, 0, None, None] * G[:, None, None]
                + hull[:, 1, None, None] * G2[i, i][:, None, None]
            )
            at = at.reshape(len(G0), -1, *G.shape[1:])
        return _largest(G0), _largest(at).max(axis=1) + total, second, rest

    def cuts(self, bounds: _Bounds, second: Array, rest: Array) -> tuple[NDArray[np.int_], Array]:
        """Return across which variable cells are to be cut, zero the frequency, and along which surface there."""
        center, half, tilt, spread = self.frequency
        shares = np.stack([(own / bounds.d).max(axis=(1, 2)) for own in bounds.own], axis=1)
        squares = (np.abs(self.along) ** 2).sum(axis=(1, 2))
        turns = [-(self.along.conj() * Z).sum(axis=(1, 2)).real / squares for Z in self.first[1:]]
        turned = [
            np.abs(Z + turn[:, None, None] * self.along) @ bounds.d + mixed
            for Z, turn, mixed in zip(self.first[1:], turns, bounds.mixed[1:], strict=True)
        ]
        widest = np.abs(spread).max(axis=1)
        straight = np.abs(half) > _WEDGE * widest
        whole = sum(bounds.own[1:], bounds.own[0])
        tries = [0.5 * bounds.own[0] + sum(turned[1:], turned[0]), *(whole - 0.5 * own for own in bounds.own[1:])]
        after = np.stack([(item / bounds.d).max(axis=(1, 2)) for item in tries], axis=1)
        after[:, 0] = np.where(straight, after[:, 0], np.inf)
        score = second + rest[:, None] * shares / shares.sum(axis=1, keepdims=True)
        axes = np.where(np.isfinite(score).all(axis=1), score.argmax(axis=1), shares.argmax(axis=1))
        axes = np.where(bounds.rho > _FAR, after.argmin(axis=1), axes)
        axes = np.where((axes == 0) & ~straight, 1 + np.abs(spread).argmax(axis=1), axes)
        slopes = np.where(self.cells.inverse[:, None], 0.0, tilt + np.stack(turns, axis=1)) / self.cells.reach
        return axes, np.column_stack([center - (slopes * self.cells.middle).sum(axis=1), slopes])


def _orthogonalise(V: Array) -> None:
    """Make groups of nearly parallel columns orthogonal, in place."""
    count, group = connected_components(np.abs(V.conj().T @ V) > _PARALLEL, directed=False)
    for k in range(count):
        own = np.flatnonzero(group == k)
        if len(own) > 1:
            V[:, own] = np.linalg.qr(V[:, own])[0]


def _solution(driving: _Expansion, Z: _Expansion) -> tuple[Array, list[Array], list[Array]]:
    """Return the terms of ``(1 + Z)^-1`` times what drives up to the second order."""
    x0 = driving.middle
    x1 = [s - z @ x0 for s, z in zip(driving.first, Z.first, strict=True)]
    x2 = []
    for i, j in combinations_with_replacement(range(len(x1)), 2):
        result = -Z.first[i] @ x1[j]
        if i != j:
            result = result - Z.first[j] @ x1[i]
        if (i, j) in Z.second:
            result = result - Z.second[i, j] @ x0
        if (i, j) in driving.second:
            result = result + driving.second[i, j]
        x2.append(result)
    return x0, x1, x2


def _shares(powers: tuple[tuple[int, ...], ...], cells: Frontier) -> tuple[dict[tuple[int, ...], Array], Array]:
    """Return what products of parameters bring to products of ``p``, shape (cells, products).

    Of none, one and two ``p`` each for itself; of more the sum of magnitudes.
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
            share = np.ones((len(cells), len(powers)))
            for i in range(k):
                share = share * parts[i][here.count(i)]
            if share.any():
                result[here] = share
            total -= np.abs(share)
    return result, np.maximum(np.where(often.sum(axis=1) > _KEPT, total, 0.0), 0.0)


def _size(G: Array) -> Array:
    """Return the Frobenius norm, which no singular value exceeds."""
    return np.sqrt((np.abs(G) ** 2).sum(axis=(-2, -1)))


def _largest(G: Array) -> Array:
    """Return the largest singular value."""
    return _size(G) if 1 in G.shape[-2:] else np.linalg.norm(G, 2, axis=(-2, -1))
