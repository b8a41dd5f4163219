"""How a structure moves, whatever it weighs: rows over its coordinates, and the weights that make matrices of them.

With rows ``N`` and ``R`` over the coordinates and weights ``m, c, k``, none of them negative,

    M = N^T diag(m) N,   C = R^T diag(c) R,   K = R^T diag(k) R.

Rows say where things are, weights what they are made of.  Structures that differ in weights alone share one
:class:`Layout`, and with it all that follows from rows: coordinates eliminated, halves.

Rows are kept beside the matrices also because ``R v`` loses no digits where ``K v`` does: the strain of a fine mesh that
moves as a whole is a difference of near-equal displacements, its stiffness a difference of huge near-equal forces.
"""

from dataclasses import dataclass, fields
from functools import cached_property

import numpy as np
from scipy import sparse

from boomctl.arrays import DENSE_LIMIT, Array, Matrix, combined
from boomctl.lti.rounding import ALIKE
from boomctl.printing import compact
from boomctl.structure.elimination import Elimination
from boomctl.structure.symmetry import Mirror

KEPT = 16  # of each kind of result, for the next structure with the same rows or places (a choice of memory)
_FULL = 0.1  # share of the entries of sparse rows beyond which they are dense: their products are nearly all (a choice)


@dataclass(frozen=True)
class Weights:
    """What the rows of a layout weigh: ``m`` the mass rows [kg, kg m^2], ``c`` and ``k`` the elastic rows."""

    m: Array
    c: Array
    k: Array

    __repr__ = compact


@dataclass(frozen=True, eq=False)
class Squares:
    """Which products of entries a weighted sum of squares of sparse rows is made of, known once for all weights.

    Attributes
    ----------
    place : ndarray
        Where each product stands, line by line in a full matrix.
    row : ndarray
        Whose weight it has.
    value : ndarray
    n : int
        Number of coordinates.
    """

    place: Array
    row: Array
    value: Array
    n: int

    __repr__ = compact

    @classmethod
    def of(cls, rows: sparse.csr_array) -> "Squares":
        """Return the products of all pairs of entries of each row."""
        counts, n = np.diff(rows.indptr), rows.shape[1]
        row = np.repeat(np.arange(len(counts)), counts)
        partners = counts[row]
        left = np.repeat(np.arange(len(row)), partners)
        first = np.cumsum(partners) - partners
        right = np.repeat(rows.indptr[row] - first, partners) + np.arange(len(left))
        place = rows.indices[left].astype(np.int64) * n + rows.indices[right]
        return cls(place, row[left], rows.data[left] * rows.data[right], n)

    @cached_property
    def pattern(self) -> tuple[Array, Array, Array]:
        """Places of the products among the entries of a sparse matrix, its indices and their pointers."""
        flat, slot = np.unique(self.place, return_inverse=True)
        ends = np.searchsorted(flat, self.n * np.arange(self.n + 1, dtype=np.int64))
        return slot, (flat % self.n).astype(np.int32), ends.astype(np.int32)

    def summed(self, weight: Array, full: bool) -> Matrix:
        """Return the weighted sum, exactly symmetric, as a dense matrix or as a sparse one."""
        values = self.value * weight[self.row]
        if full:
            return np.bincount(self.place, values, self.n * self.n).reshape(self.n, self.n)
        slot, indices, ends = self.pattern
        return sparse.csr_array((np.bincount(slot, values, len(indices)), indices, ends), shape=(self.n, self.n))


def _filled(rows: sparse.csr_array) -> float:
    return rows.nnz / max(1, rows.shape[0] * rows.shape[1])


@dataclass(frozen=True, eq=False)
class Layout:
    """Rows over named coordinates.

    Attributes
    ----------
    coordinates : tuple of str
        Names.
    N : (rows, n) ndarray or sparse array
        Rows of the mass matrix.
    R : (rows, n) ndarray or sparse array
        Rows of the stiffness and damping matrix.
    mirror : Mirror or None
        How the reflection about ``x = 0`` acts, where one is known; weights may still break it.
    """

    coordinates: tuple[str, ...]
    N: Matrix
    R: Matrix
    mirror: Mirror | None = None

    __repr__ = compact

    def __getstate__(self) -> dict[str, object]:
        """Pickle what it is made of; its halves can be found again."""
        return {item.name: getattr(self, item.name) for item in fields(self)}

    @property
    def n(self) -> int:
        """Number of coordinates."""
        return len(self.coordinates)

    def congruent(self, T: Matrix, coordinates: tuple[str, ...], mirror: Mirror | None = None) -> "Layout":
        """Return the rows over coordinates ``z`` with ``q = T z``."""
        N, R = combined(self.N, T), combined(self.R, T)
        if sparse.issparse(N) and (len(coordinates) <= DENSE_LIMIT or max(map(_filled, (N, R))) > _FULL):
            N, R = N.toarray(), R.toarray()
        return Layout(coordinates, N, R, mirror)

    def eliminated(self, choice: Elimination) -> "Layout":
        """Return the rows over the independent coordinates, the prescribed displacements at rest."""
        names = tuple(self.coordinates[i] for i in choice.independent)
        return self.congruent(choice.T_q, names, None if self.mirror is None else self.mirror.restricted(choice))

    @cached_property
    def squares(self) -> tuple[Squares, Squares]:
        """What the sums of squares of sparse rows ``N`` and ``R`` are made of."""
        return Squares.of(self.N), Squares.of(self.R)

    def mass(self, m: Array, full: bool) -> Matrix:
        """Return ``N^T diag(m) N``, dense if it is to be full."""
        return self._gram(0, self.N, m, full)

    def stiffness(self, k: Array, full: bool) -> Matrix:
        """Return ``R^T diag(k) R``, dense if it is to be full."""
        return self._gram(1, self.R, k, full)

    def _gram(self, which: int, rows: Matrix, weight: Array, full: bool) -> Matrix:
        if sparse.issparse(rows):
            return self.squares[which].summed(weight, full)
        total = rows.T @ (weight[:, None] * rows)
        return 0.5 * (total + total.T)

    @cached_property
    def halves(self) -> "dict[int, tuple[Matrix, Layout]]":
        """The motions of each parity, ``q = P q_half``, and the rows over them; the layout has a mirror."""
        if self.mirror is None:
            raise ValueError("the structure carries no mirror")
        found = {}
        for parity in (1, -1):
            P = self.mirror.basis(parity)
            found[parity] = P, self.congruent(P, self.mirror.half_coordinates(self.coordinates, parity))
        return found

    def keeps_mirror(self, mirror: Mirror, weights: Weights) -> bool:
        """Return whether a reflection leaves mass, damping and stiffness as they are.

        They are asked for the forces that a motion without any symmetry needs, reflected before and after.
        """
        for rows, each in ((self.N, (weights.m,)), (self.R, (weights.c, weights.k))):
            strains = rows @ mirror.probe
            for weight in each:
                forces, reflected = (rows.T @ (weight[:, None] * strains)).T
                largest = squared_sums(rows, weight).max(initial=0.0)
                if np.abs(mirror.reflect(reflected) - forces).max(initial=0.0) > ALIKE * largest:
                    return False
        return True


def squared_sums(rows: Matrix, weight: Array) -> Array:
    """Return the diagonal of ``rows^T diag(weight) rows``."""
    if sparse.issparse(rows):
        return np.bincount(rows.indices, np.repeat(weight, np.diff(rows.indptr)) * rows.data**2, rows.shape[1])
    return weight @ rows**2
