"""Polynomials of parameters whose coefficients are arrays, and pencils ``s E - A``, which are stored as ``[E, A]``.

A state-space form would need the inverse of the mass matrix, and would not be a polynomial.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from itertools import chain, product
from math import comb, inf, prod

import numpy as np
from scipy import linalg

from boomctl.arrays import Array
from boomctl.lti.modal import side_of_axis
from boomctl.lti.rounding import EPS

# Rounding error of entries of products of three matrices over that of magnitudes: 3 n eps, for n up to 300 states.
ROUNDING = 1e3 * EPS

Polynomial = Mapping[tuple[int, ...], Array]
"""Coefficients by products of parameters: ``()`` for the constant term, ``(0, 0, 1)`` for ``d0^2 d1``."""


@dataclass(frozen=True)
class Cell:
    """Box of parameters: its midpoint and half-widths."""

    middle: Array
    reach: Array

    @classmethod
    def whole(cls, size: int) -> "Cell":
        """Return the box of all parameters from -1 to 1."""
        return cls(np.zeros(size), np.ones(size))

    def halves(self, axis: int) -> tuple["Cell", "Cell"]:
        """Return the two halves across an axis."""
        step = np.zeros(len(self.middle))
        step[axis] = 0.5 * self.reach[axis]
        reach = np.where(np.arange(len(step)) == axis, 0.5 * self.reach, self.reach)
        return Cell(self.middle - step, reach), Cell(self.middle + step, reach)

    def point(self, local: Array) -> Array:
        """Return a point of the cell from its local coordinates, -1 to 1 across it."""
        return self.middle + self.reach * local


def value_at(terms: Polynomial, delta: Array) -> Array:
    """Return the value of a polynomial at a point."""
    return np.asarray(sum(float(np.prod(delta[list(power)])) * X for power, X in terms.items()))


def sum_of(*terms: Polynomial) -> dict[tuple[int, ...], Array]:
    """Return the sum of polynomials."""
    result: dict[tuple[int, ...], Array] = {}
    for power, X in chain(*(item.items() for item in terms)):
        result[power] = result.get(power, 0.0) + X
    return result


def stacked(upper: Polynomial, lower: Polynomial, more: int = 0) -> dict[tuple[int, ...], Array]:
    """Return one polynomial above the other, both followed by ``more`` columns of zeros."""
    pairs = {q: [X.get(q, 0.0 * X[()]) for X in (upper, lower)] for q in dict.fromkeys((*upper, *lower))}
    return {q: np.pad(np.vstack(pair), ((0, 0), (0, more))) for q, pair in pairs.items()}


def product_of(first: Polynomial, second: Polynomial) -> dict[tuple[int, ...], Array]:
    """Return the product of two polynomials of matrices."""
    result: dict[tuple[int, ...], Array] = {}
    for (p, X), (q, Y) in product(first.items(), second.items()):
        power = tuple(sorted((*p, *q)))
        result[power] = result.get(power, 0.0) + X @ Y
    return result


def within(terms: Polynomial, cell: Cell) -> dict[tuple[int, ...], Array]:
    """Return the same polynomial in parameters that run from -1 to 1 across a cell."""
    return {power: float(np.prod(cell.reach[list(power)])) * X for power, X in about(terms, cell.middle).items()}


def about(terms: Polynomial, middle: Array) -> dict[tuple[int, ...], Array]:
    """Return the same polynomial in the distances of the parameters from another midpoint."""
    powers, weights = expansion(tuple(terms), middle[None])
    result = np.tensordot(weights[0], np.array([*terms.values()]), 1)
    return {power: X for power, X, weight in zip(powers, result, weights[0], strict=True) if not power or weight.any()}


def expansion(
    powers: tuple[tuple[int, ...], ...], middles: Array, order: float = inf
) -> tuple[list[tuple[int, ...]], Array]:
    """Return the products, up to an order, of distances from midpoints (N, k), and their weights (N, products, powers)."""
    wanted, rows, columns, factors, left = _factors(powers, middles.shape[1], order)
    weights = np.zeros((len(middles), len(wanted), len(powers)))
    weights[:, rows, columns] = factors * monomials(middles, left)
    return wanted, weights


def monomials(points: Array, exponents: Array) -> Array:
    """Return the products of coordinates of points (N, k) with exponents (m, k), shape (N, m)."""
    known = points[:, :, None] ** np.arange(int(exponents.max(initial=0)) + 1)
    return np.prod([known[:, i, n] for i, n in enumerate(exponents.T)], axis=0)


@lru_cache(maxsize=8)
def _factors(
    powers: tuple[tuple[int, ...], ...], size: int, order: float
) -> tuple[list[tuple[int, ...]], Array, Array, Array, Array]:
    """Return the products in the expansion of shifted products; row, column, coefficient, remaining powers of each pair."""
    index: dict[tuple[int, ...], int] = {}
    pairs, left = [], []
    for column, power in enumerate(powers):
        often = [power.count(i) for i in range(size)]
        for here in product(*(range(count + 1) for count in often)):
            if sum(here) <= order:
                row = index.setdefault(tuple(np.repeat(range(size), here).tolist()), len(index))
                pairs.append((row, column, prod(map(comb, often, here))))
                left.append([n - count for n, count in zip(often, here, strict=True)])
    return list(index), *np.array(pairs).T, np.array(left)


def poles_of(pencil: Array) -> Array:
    """Return the eigenvalues of a pencil [rad/s]; infinite ones where ``E`` is singular."""
    try:
        return linalg.eigvals(np.linalg.solve(*pencil))
    except np.linalg.LinAlgError:
        return np.array([complex(np.inf)])


def stable(pencil: Array) -> bool:
    """Return whether all eigenvalues are stable; undamped ones are not."""
    return bool((side_of_axis(poles_of(pencil)) < 0).all())
