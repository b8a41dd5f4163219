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

from boomctl.arrays import Array, combined
from boomctl.lti.rounding import ALIKE
from boomctl.printing import compact
from boomctl.structure.elimination import Elimination
from boomctl.structure.symmetry import Mirror

KEPT = 16  # of each kind of result, for the next structure with the same rows or places (a choice of memory)
_FILLED = 0.1  # share of the entries of rows, up to which sums of squares are made of products of pairs (measured)
_FEW = 64  # coordinates up to which one product of matrices is as fast (measured)


@dataclass(frozen=True)
class Weights:
    """What the rows of a layout weigh: ``m`` the mass rows [kg, kg m^2], ``c`` and ``k`` the elastic rows."""

    m: Array
    c: Array
    k: Array

    __repr__ = compact


@dataclass(frozen=True, eq=False)
class Squares:
    """Which products of entries a weighted sum of squares of rows is made of, known once for all weights.

    Rows of beams have a few entries each: the sum takes a tenth of the time of a product of matrices.

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
    def of(cls, rows: Array) -> "Squares | None":
        """Return the products of all pairs of entries of each row; None for rows that are few or mostly filled."""
        count, n = rows.shape
        if n <= _FEW or np.count_nonzero(rows) > _FILLED * rows.size:
            return None
        row, column = np.nonzero(rows)
        counts, data = np.bincount(row, minlength=count), rows[row, column]
        partners = counts[row]
        left = np.repeat(np.arange(len(row)), partners)
        first = np.cumsum(partners) - partners
        starts = np.cumsum(counts) - counts
        right = np.repeat(starts[row] - first, partners) + np.arange(len(left))
        return cls(column[left] * n + column[right], row[left], data[left] * data[right], n)

    def summed(self, weight: Array) -> Array:
        """Return the weighted sum, exactly symmetric."""
        return np.bincount(self.place, self.value * weight[self.row], self.n * self.n).reshape(self.n, self.n)


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
        How the reflection about ``x = 0`` acts, where one is known; weights may still break it.
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
    def squares(self) -> tuple[Squares | None, Squares | None]:
        """What the sums of squares of rows ``N`` and ``R`` are made of, where they have few entries."""
        return Squares.of(self.N), Squares.of(self.R)

    def mass(self, m: Array) -> Array:
        """Return ``N^T diag(m) N``."""
        return self._gram(0, self.N, m)

    def stiffness(self, k: Array) -> Array:
        """Return ``R^T diag(k) R``."""
        return self._gram(1, self.R, k)

    def _gram(self, which: int, rows: Array, weight: Array) -> Array:
        squares = self.squares[which]
        if squares is not None:
            return squares.summed(weight)
        total = rows.T @ (weight[:, None] * rows)
        return 0.5 * (total + total.T)

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

    def keeps_mirror(self, mirror: Mirror, weights: Weights) -> bool:
        """Return whether a reflection leaves mass, damping and stiffness as they are.

        They are asked for the forces that a motion without any symmetry needs, reflected before and after.
        """
        for rows, item in ((self.N, (weights.m,)), (self.R, (weights.c, weights.k))):
            strains = rows @ mirror.probe
            for weight in item:
                forces, reflected = (rows.T @ (weight[:, None] * strains)).T
                largest = squared_sums(rows, weight).max(initial=0.0)
                if np.abs(mirror.reflect(reflected) - forces).max(initial=0.0) > ALIKE * largest:
                    return False
        return True


def squared_sums(rows: Array, weight: Array) -> Array:
    """Return the diagonal of ``rows^T diag(weight) rows``."""
    return weight @ rows**2
