"""Proof that a loop's largest singular value stays below a level, over cells of parameters and frequencies together.

In a cell the loop's response is a Taylor series in the parameters and the frequency: ``C M^-1 B`` with ``M = s E - A``, all
polynomials of them.  Terms of first and second order are exact; the remainder is bounded by magnitudes, entry by entry.  With
``M = M0 (1 + Z)``, a nonnegative matrix ``N`` that bounds ``Z`` throughout the cell, and a positive vector ``d`` such that
``N d < d`` (Collatz & Wielandt), ``M`` is regular there and ``(1 + Z)^-1`` is bounded.  A convex function of the terms is
largest at the vertices of a polytope around them.  If all cells between frequency zero and infinity are regular and the
loop is stable at one point, no pole crosses the axis anywhere in the box.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations_with_replacement
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from scipy import linalg
from scipy.sparse.csgraph import connected_components

from boomctl.analysis.box.polynomials import ROUNDING, Cell, expansion, monomials
from boomctl.analysis.box.zero_exclusion import BATCH, BELOW, TOP, evened
from boomctl.arrays import Array, balance

if TYPE_CHECKING:
    from boomctl.analysis.box.level import LoopPart

_Terms = dict[tuple[int, ...], Array]
"""Series: coefficients by products of variables, in all cells."""


_PARALLEL = 0.9  # Cosine of two eigenvectors above which they are orthogonalized: their inverse would be large.
_SWEEPS = 5  # Power iterations for the vector ``d``: it need not be exact, any positive vector yields a bound.
_FAR = 0.6  # Bound of ``Z`` above which it, not the terms of second order, determines where to cut.
_ORDER = 2  # Largest order of a product whose matrix is stored with phases; longer products count by their magnitudes.
_FIRST = 0.5  # First frequency of the chain after zero, relative to the slowest pole.
_HULL = np.array([(-1.0, 1.0), (0.0, -1.0), (1.0, 1.0)])  # Vertices of a triangle around (v, v^2), -1 <= v <= 1.
_CORNERS = 7  # Largest number of variables whose triangles are combined: memory grows with three to its power.


@dataclass(frozen=True)
class Frontier:
    """Cells that are not yet proved.

    Attributes
    ----------
    middle, reach : (N, 1 + k) ndarray
        Midpoints and half-widths of their frequencies [rad/s] and parameters; of inverse ones [s/rad] of cells that reach
        infinity.
    inverse : (N,) ndarray of bool
        True for cells that reach infinity.
    """

    middle: Array
    reach: Array
    inverse: NDArray[np.bool_]

    def __len__(self) -> int:
        return len(self.middle)

    def __getitem__(self, index: slice | NDArray[np.bool_ | np.integer]) -> Frontier:
        return Frontier(self.middle[index], self.reach[index], self.inverse[index])

    def with_halves(self, parents: Frontier, axes: NDArray[np.int_]) -> Frontier:
        """Return these cells and both halves of others, cut across the frequency, axis 0, or a parameter."""
        cut = np.eye(parents.middle.shape[1])[axes]
        reach = (1.0 - 0.5 * cut) * parents.reach
        sides = [parents.middle - cut * reach, parents.middle + cut * reach]
        return Frontier(
            np.concatenate([self.middle, *sides]),
            np.concatenate([self.reach, reach, reach]),
            np.concatenate([self.inverse, parents.inverse, parents.inverse]),
        )


@dataclass(frozen=True)
class ResponseCells:
    """Loop ``E x' = A x + (B - B d/dt) w``, ``z = C x + D w`` over a box, in coordinates in which it is nearly diagonal.

    Attributes
    ----------
    powers : tuple
        Products of parameters; matrices are sums over them.
    E, A, B : ndarray
        Stacks of matrices, one for each product.
    C, D : ndarray
        Matrices of the evaluated outputs.
    sampled : bool
        True if the derivative of ``w`` enters.
    rounding : tuple of ndarray
        Error bounds of the entries of ``E``, of ``A``, and of ``B``.
    poles : ndarray
        Poles of the loop at the midpoint of the box [rad/s].
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
        """Return a loop in the eigenvectors at the midpoint of its box, nearly parallel ones orthogonalized."""
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
        off = np.abs(W) @ (ROUNDING * np.abs(both).sum(axis=0) + loop.errors[0]) @ np.abs(V)
        rounding, size = (*off, np.abs(W) @ loop.errors[1]), len(loop.cell.middle)
        E, A = (W @ both @ V).swapaxes(0, 1)
        return cls(powers, E, A, driving, loop.C @ V, loop.D, loop.dt > 0.0, rounding, poles, size)

    @cached_property
    def alike(self) -> bool:
        """True if the parameters change ``E`` and ``A`` equally, as those of a sampled loop do."""
        return np.array_equal(self.E[1:], self.A[1:])

    def start(self, box: Cell) -> Frontier:
        """Return the cells of a part of the box over all frequencies."""
        low, high = _FIRST * float(np.abs(self.poles).min()), TOP * float(np.abs(self.poles).max())
        chain = np.concatenate([[0.0], np.geomspace(low, high, 2 + int(np.log2(high / low)))])
        ends = np.array([chain, np.append(chain[1:], 0.0)])
        ends[0, -1] = 1.0 / high
        middle = np.column_stack([0.5 * ends.sum(axis=0), np.tile(box.middle, (len(chain), 1))])
        reach = np.column_stack([0.5 * np.abs(ends[1] - ends[0]), np.tile(box.reach, (len(chain), 1))])
        return Frontier(middle, reach, np.arange(len(chain)) == len(chain) - 1)

    def look(self, cells: Frontier) -> tuple[Array, Array, NDArray[np.int_]]:
        """Return bounds of the largest singular value over cells, its values at their midpoints, and the axes to halve."""
        series = _Series.of(self, cells)
        gain, bound, second, rest = series.gains()
        return np.where(series.rho < BELOW, bound, np.inf), gain, series.axes(second, rest)

    def prove(self, cell: Cell, level: float, limit: int, update: Callable[[float, Array], float]) -> int | None:
        """Prove that no singular value reaches a level; return the number of cells, or None if it is not proved.

        Parameters
        ----------
        cell : Cell
            Cell of parameters.
        level : float
            The level.
        limit : int
            Largest number of cells evaluated; the proof stops if more remain.
        update : callable
            Called with the largest gain at the midpoints of a batch and its point; returns the new level, infinite to stop.
        """
        cells, visited, proved = self.start(cell), 0, 0
        batch = max(8, BATCH // len(self.poles) ** 2)
        while len(cells) and visited + len(cells) <= limit and level < np.inf:
            here, cells = cells[-batch:], cells[:-batch]
            bound, gain, axes = self.look(here)
            visited += len(here)
            worst = int(np.argmax(gain))
            level = update(float(gain[worst]), here.middle[worst, 1:])
            open_ = ~(bound < level * BELOW)  # NaN is not proved
            proved += int((~open_).sum())
            cells = cells.with_halves(here[open_], axes[open_])
        return None if len(cells) else proved


@dataclass(frozen=True)
class _Series:
    """Terms of ``M = M0 (1 + Z)`` and of the response over cells.

    Keys are variables that range from -1 to 1: 0 is the frequency, 1 and above are the parameters.

    Attributes
    ----------
    loop : ResponseCells
        The loop.
    Z, sizes : dict
        Terms of first and second order, and the magnitudes of their entries.
    higher : ndarray
        Bound of the remainder of ``Z``, rounding error included.
    x : dict
        Terms of ``M^-1 B`` up to second order.
    driven : ndarray
        Bound of the terms of ``M0^-1 B`` beyond second order.
    rho, d : ndarray
        Bound of the spectral radius of ``Z``, and the vector that yields it.
    nonlinear : ndarray
        Bound of the terms of ``Z`` beyond first order.
    """

    loop: ResponseCells
    Z: _Terms
    sizes: _Terms
    higher: Array
    x: _Terms
    driven: Array
    rho: Array
    d: Array
    nonlinear: Array

    @classmethod
    def of(cls, loop: ResponseCells, cells: Frontier) -> _Series:
        """Return the series."""
        center, half = cells.middle[:, 0], cells.reach[:, 0]
        # the pencil is j a E - b A: (frequency, 1), or (1, inverse frequency) of cells that reach infinity
        a, da = (np.where(cells.inverse, x, y)[:, None, None] for x, y in ((1.0, center), (0.0, half)))
        b, db = (np.where(cells.inverse, x, y)[:, None, None] for x, y in ((center, 1.0), (half, 0.0)))
        # without a term that is zero in all cells
        turned: _Terms = {p: x for p, x in {(): 1j * a, (0,): 1j * da}.items() if x.any()}
        still: _Terms = {p: x for p, x in {(): -b, (0,): -db}.items() if x.any()}
        factors, beyond = _coefficients(loop.powers, cells.middle[:, 1:], cells.reach[:, 1:])
        E, B = ({p: _weighted(w, X) for p, w in factors.items()} for X in (loop.E, loop.B))
        A = {p: E[p] if p and loop.alike else _weighted(w, loop.A) for p, w in factors.items()}
        inverse = np.linalg.inv(1j * a * E[()] - b * A[()])
        P = {p: inverse @ X for p, X in E.items() if not p or X.any()}
        Q = {p: P[p] if loop.alike else inverse @ X for p, X in A.items() if p and X.any()}
        Q[()] = (1j * a * P[()] - np.eye(len(loop.poles))) / b  # for j a P - b Q is one
        Z, higher = _expanded((turned, P), (still, Q))
        Z = {(i,): 0.0 * higher for i in range(1 + loop.size)} | Z
        push = {p: -inverse @ X for p, X in B.items() if not p or X.any()}
        driving, driven = _expanded((turned, push if loop.sampled else {}), (still, push))
        off_E, off_A, off_B = loop.rounding
        side = [sum(np.abs(x) for x in terms.values()) for terms in (turned, still)]
        others = [side[0] * off_E + side[1] * off_A, (side[0] + side[1]) * off_B]
        if beyond.any():
            for k, pair in enumerate(((loop.E, loop.A), (loop.sampled * loop.B, loop.B))):
                others[k] += sum(w * np.tensordot(beyond, np.abs(X), 1) for w, X in zip(side, pair, strict=True))
        higher, driven = (late + np.abs(inverse) @ more for late, more in zip((higher, driven), others, strict=True))
        sizes = {p: np.abs(X) for p, X in Z.items() if p}
        main = sum(X for p, X in sizes.items() if len(p) == 1)
        nonlinear = sum((X for p, X in sizes.items() if len(p) > 1), higher)
        d = np.ones((*higher.shape[:2], 1))
        for _ in range(_SWEEPS):
            d = evened(d, main @ d)
        rho, x = (((main + nonlinear) @ d) / d).max(axis=(1, 2)), _solution(driving, Z, loop.size)
        return cls(loop, Z, sizes, higher, x, driven, rho, d, nonlinear)

    def gains(self) -> tuple[Array, Array, Array, Array]:
        """Return the gain at the midpoints, its bound over the cells, and the parts of second-order terms and remainder."""
        C, d, nonlinear, size = self.loop.C, self.d, self.nonlinear, 1 + self.loop.size
        G = {p: C @ x for p, x in self.x.items()}
        G0 = G[()] + self.loop.D
        # Residual of the series in (1 + Z) x = M0^-1 B: terms of third order and beyond.
        most = sum(np.abs(x) for p, x in self.x.items() if p)
        residual = nonlinear @ most + self.higher @ np.abs(self.x[()]) + self.driven
        evaluated, weight = np.abs(C) @ residual, np.abs(C) @ nonlinear
        pairs = [x for p, x in self.x.items() if len(p) == _ORDER]
        late = np.concatenate(pairs, axis=2)
        for i in range(size):
            step = self.Z[i,] @ late
            shape = len(pairs), -1
            residual = residual + np.abs(step).reshape(*step.shape[:2], *shape).sum(axis=2)
            evaluated = evaluated + np.abs(C @ step).reshape(len(step), len(C), *shape).sum(axis=2)
            weight = weight + np.abs(C @ self.Z[i,])
        spare = np.where(self.rho < BELOW, 1.0 - self.rho, np.nan)[:, None, None]
        rest = _size(evaluated + (weight @ d) * ((residual / d).max(axis=1, keepdims=True) / spare))
        total, second = rest, np.zeros((len(G0), size))
        for p, X in G.items():
            if len(p) == _ORDER:
                part = _size(X)
                total = total + part if p[0] != p[1] else total
                for i in p:
                    second[:, i] += 0.5 * part
        at = G0[:, None]
        for i in range(size):
            if i >= _CORNERS:  # the others count by magnitudes
                total = total + _size(G[i,]) + _size(G[i, i])
                continue
            pair = np.stack([G[i,], G[i, i]], axis=1)
            at = at[:, :, None] + np.tensordot(pair, _HULL, (1, 1)).transpose(0, 3, 1, 2)[:, None]
            at = at.reshape(len(G0), -1, *G0.shape[1:])
        return _largest(G0), _largest(at).max(axis=1) + total, second, rest

    def axes(self, second: Array, rest: Array) -> NDArray[np.int_]:
        """Return the variable across which each cell is to be halved, 0 for the frequency."""
        d, variables = self.d, range(1 + self.loop.size)
        pairs = {p: 0.5 * size @ d for p, size in self.sizes.items() if len(p) == _ORDER}
        own = [self.sizes[i,] @ d + sum(p.count(i) * size for p, size in pairs.items()) for i in variables]
        weights = np.stack([(size / d).max(axis=(1, 2)) for size in own], axis=1)
        after = np.stack([((sum(own) - 0.5 * size) / d).max(axis=(1, 2)) for size in own], axis=1)
        score = second + rest[:, None] * weights / weights.sum(axis=1, keepdims=True)
        axes = np.where(np.isfinite(score).all(axis=1), score.argmax(axis=1), weights.argmax(axis=1))
        return np.where(self.rho > _FAR, after.argmin(axis=1), axes)


def _expanded(*products: tuple[_Terms, _Terms]) -> tuple[_Terms, Array]:
    """Return the sum of products of series up to second order, and a bound of the magnitudes of its other terms."""
    result: _Terms = {}
    higher: Any = 0.0
    for frequency, series in products:
        for q, X in series.items():
            late = [np.abs(x) for p, x in frequency.items() if len(p) + len(q) > _ORDER]
            for p, x in frequency.items():
                power = tuple(sorted((*p, *q)))
                if len(power) <= _ORDER:
                    result[power] = result.get(power, 0.0) + x * X
            higher = higher + sum(late) * np.abs(X) if late else higher
    return result, higher


def _orthogonalise(V: Array) -> None:
    """Make groups of nearly parallel columns orthogonal, in place."""
    count, group = connected_components(np.abs(V.conj().T @ V) > _PARALLEL, directed=False)
    for k in range(count):
        V[:, group == k] = np.linalg.qr(V[:, group == k])[0]


def _solution(driving: _Terms, Z: _Terms, size: int) -> _Terms:
    """Return the terms of ``(1 + Z)^-1`` times ``driving`` up to the second order."""
    x: _Terms = {(): driving[()]}
    for order in (1, 2):
        for power in combinations_with_replacement(range(1 + size), order):
            result: Any = driving.get(power, 0.0)
            for part in {power[:1], power[1:], power} & {*Z}:
                rest = () if part == power else power[1:] if part == power[:1] else power[:1]
                result = result - Z[part] @ x[rest] if part else result
            x[power] = result
    return x


def _coefficients(
    powers: tuple[tuple[int, ...], ...], middle: Array, reach: Array
) -> tuple[dict[tuple[int, ...], Array], Array]:
    """Return the coefficients of products of parameters in products of variables of cells, shape (cells, products).

    Products of up to two variables have separate coefficients; of longer products the sum of magnitudes is returned.
    """
    often = np.array([[power.count(i) for i in range(middle.shape[1])] for power in powers])
    wanted, weights = expansion(powers, middle, _ORDER)
    weights *= np.array([reach[:, list(power)].prod(axis=1) for power in wanted]).T[:, :, None]
    total = monomials(np.abs(middle) + reach, often) - np.abs(weights).sum(axis=1)
    result = {tuple(i + 1 for i in power): weights[:, row] for row, power in enumerate(wanted)}
    return result, np.maximum(np.where(often.sum(axis=1) > _ORDER, total, 0.0), 0.0)


def _weighted(weights: Array, matrices: Array) -> Array:
    """Return sums of complex matrices with real weights, one for each row."""
    return (weights @ matrices.reshape(len(matrices), -1).view(float)).view(complex).reshape(-1, *matrices.shape[1:])


def _size(G: Array) -> Array:
    """Return the Frobenius norm, an upper bound of the largest singular value."""
    return np.sqrt((np.abs(G) ** 2).sum(axis=(-2, -1)))


def _largest(G: Array) -> Array:
    """Return the largest singular value."""
    return _size(G) if 1 in G.shape[-2:] else np.linalg.norm(G, 2, axis=(-2, -1))
