"""How a structure moves, whatever it weighs: rows over its coordinates, and the weights that make matrices of them.

With rows ``N`` and ``R`` over the coordinates and weights ``m, c, k``, none of them negative,

    M = N^T diag(m) N,   C = R^T diag(c) R,   K = R^T diag(k) R.

Matrices given are weights of the coordinates themselves.

Rows say where things are, weights what they are made of.  Structures that differ in weights alone share one
:class:`Layout`, and with it all that follows from rows: coordinates eliminated, halves.

Rows are kept beside the matrices also because ``R v`` loses no digits where ``K v`` does: the strain of a fine mesh that
moves as a whole is a difference of near-equal displacements, its stiffness a difference of huge near-equal forces.
"""

from dataclasses import dataclass, fields
from functools import cached_property

import numpy as np

from boomctl.arrays import Array, combined
from boomctl.printing import compact
from boomctl.structure.elimination import Elimination
from boomctl.structure.symmetry import Mirror

KEPT = 16  # Cached results of each kind, for the next structure with the same rows or places.
_FILLED = 0.25  # Fraction of nonzero entries of a row up to which sums over products of pairs are faster.
_SMALL = 64  # Coordinates up to which one product of matrices is as fast.


@dataclass(frozen=True)
class Weights:
    """Weights of the rows of a layout: ``m`` of the mass rows [kg, kg m^2], ``c`` and ``k`` of the elastic rows.

    One number a row.  Of matrices given, whose rows are the coordinates, they are these matrices.
    """

    m: Array
    c: Array
    k: Array

    __repr__ = compact


def weigh(weight: Array, rows: Array) -> Array:
    """Return rows times their weights."""
    return weight @ rows if weight.ndim == 2 else weight[:, None] * rows


@dataclass(frozen=True, eq=False)
class Layout:
    """Rows over named coordinates.

    Attributes
    ----------
    coordinates : tuple of str
        Names.
    N : (rows, n) ndarray
        Rows of the mass matrix.
    R : (rows, n) ndarray
        Rows of the stiffness and damping matrix.
    mirror : Mirror or None
        The reflection about ``x = 0`` that leaves the matrices as they are, where there is one.
    """

    coordinates: tuple[str, ...]
    N: Array
    R: Array
    mirror: Mirror | None = None

    __repr__ = compact

    def __getstate__(self) -> dict[str, object]:
        """Pickle what it is made of; its halves can be found again."""
        return {item.name: getattr(self, item.name) for item in fields(self)}

    @property
    def n(self) -> int:
        """Number of coordinates."""
        return len(self.coordinates)

    def congruent(self, T: Array, coordinates: tuple[str, ...], mirror: Mirror | None = None) -> "Layout":
        """Return the rows over coordinates ``z`` with ``q = T z``."""
        return Layout(coordinates, combined(self.N, T), combined(self.R, T), mirror)

    def eliminated(self, choice: Elimination) -> "Layout":
        """Return the rows over the independent coordinates, the prescribed displacements at rest."""
        names = tuple(self.coordinates[i] for i in choice.independent)
        return self.congruent(choice.T_q, names, None if self.mirror is None else self.mirror.restricted(choice))

    @cached_property
    def _products(self) -> tuple[tuple[Array, Array] | None, tuple[Array, Array] | None]:
        """Products of pairs of entries of the rows ``N`` and ``R``, where these have few entries."""
        return _products(self.N), _products(self.R)

    def matrices(self, weights: Weights) -> tuple[Array, Array, Array]:
        """Return mass, damping and stiffness matrix."""
        if weights.k.ndim == 2:
            return self.N.T @ weights.m @ self.N, self.R.T @ weights.c @ self.R, self.R.T @ weights.k @ self.R
        inertia, elastic = self._products
        return _gram(self.N, inertia, weights.m), _gram(self.R, elastic, weights.c), _gram(self.R, elastic, weights.k)

    @cached_property
    def halves(self) -> "dict[int, tuple[Array, Layout]]":
        """The motions of each parity, ``q = P q_half``, and the rows over them; the layout has a mirror."""
        if self.mirror is None:
            raise ValueError("the structure carries no mirror")
        result = {}
        for parity in (1, -1):
            P = self.mirror.basis(parity)
            result[parity] = P, self.congruent(P, self.mirror.half_coordinates(self.coordinates, parity))
        return result


def _products(rows: Array) -> tuple[Array, Array] | None:
    """Return the products of all pairs of entries of each row, and where they are in a matrix; None for filled rows.

    Rows of beams have a few entries each: their sum takes a tenth of the time of a product of matrices.
    """
    n, entries = rows.shape[1], int(np.count_nonzero(rows, axis=1).max(initial=0))
    if n <= _SMALL or entries > _FILLED * n:
        return None
    column = np.argsort(rows == 0.0, axis=1, kind="stable")[:, :entries]
    values = np.take_along_axis(rows, column, axis=1)
    places = column[:, :, None] * n + column[:, None]
    return places.ravel(), values[:, :, None] * values[:, None]


def _gram(rows: Array, products: tuple[Array, Array] | None, weight: Array) -> Array:
    """Return ``rows^T diag(weight) rows``, exactly symmetric."""
    n = rows.shape[1]
    if products is not None:
        return np.bincount(products[0], (weight[:, None, None] * products[1]).ravel(), n * n).reshape(n, n)
    total = rows.T @ weigh(weight, rows)
    return 0.5 * (total + total.T)
