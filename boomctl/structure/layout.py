"""Kinematics of a structure as rows over its coordinates, and the weights that give its matrices.

With rows ``N`` and ``R`` over the coordinates and nonnegative weights ``m, c, k``,

    M = N^T diag(m) N,   C = R^T diag(c) R,   K = R^T diag(k) R.

Matrices passed by the user are weights of the coordinates themselves.

Rows depend on geometry, weights on material.  Structures that differ only in weights share one :class:`Layout`, and all
results that depend only on rows: eliminated coordinates, symmetric subsystems.

Rows are stored in addition to the matrices because ``R v`` is accurate where ``K v`` is not: the strain of a fine mesh in
rigid motion is a difference of nearly equal displacements, its force a difference of huge nearly equal forces.
"""

from dataclasses import dataclass, fields
from functools import cached_property, lru_cache

import numpy as np

from boomctl.arrays import Array, combined
from boomctl.lti.rounding import SUMMED
from boomctl.printing import compact
from boomctl.structure.elimination import Elimination
from boomctl.structure.symmetry import Mirror

CACHE_SIZE = 16  # Number of cached results of each kind, for structures with the same rows or geometry.


@dataclass(frozen=True)
class Weights:
    """Weights of the rows of a layout: ``m`` of the mass rows [kg, kg m^2], ``c`` and ``k`` of the elastic rows.

    One number per row.  For matrices passed by the user, whose rows are the coordinates, they are these matrices.
    """

    m: Array
    c: Array
    k: Array

    __repr__ = compact

    def uneven_damping(self) -> tuple[float, Array]:
        """Return the damping per stiffness that most rows share, and the weights of the damping beyond it.

        Material damping is proportional to stiffness, and dampers are few.  A spring without damping counts as a damper of
        ``-beta k``.
        """
        stiffness, damping = (weight if weight.ndim == 1 else weight.diagonal() for weight in (self.k, self.c))
        ratios = np.sort(damping[stiffness > 0.0] / stiffness[stiffness > 0.0])
        beta = float(ratios[len(ratios) // 2]) if len(ratios) else 0.0
        excess = self.c - beta * self.k
        size = np.maximum(np.abs(self.c), np.abs(beta * self.k))
        return beta, np.where(np.abs(excess) > SUMMED * size, excess, 0.0)


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
        """Pickle the fields without cached results."""
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

    def matrices(self, weights: Weights) -> tuple[Array, Array, Array]:
        """Return mass, damping and stiffness matrix."""
        return _gram(self.N, weights.m), _gram(self.R, weights.c), _gram(self.R, weights.k)

    @cached_property
    def halves(self) -> "dict[int, tuple[Array, Layout]]":
        """For each parity the motions ``q = P q_half``, and over them one of each pair of rows; the layout has a mirror."""
        if self.mirror is None:
            raise ValueError("the structure carries no mirror")
        N, R = (rows[first] for rows, (first, _) in zip((self.N, self.R), self.pairs, strict=True))
        result = {}
        for parity in (1, -1):
            P, names = self.mirror.basis(parity), self.mirror.half_coordinates(self.coordinates, parity)
            result[parity] = P, Layout(names, combined(N, P), combined(R, P))
        return result

    @cached_property
    def pairs(self) -> tuple[tuple[Array, Array], tuple[Array, Array]]:
        """Of mass rows and elastic rows the indices of one row of each pair of mirror images, and those of its image."""
        return _pairs(self.N, self.mirror), _pairs(self.R, self.mirror)


@lru_cache(maxsize=4)  # At most 8 MB each.
def layout_of_matrices(coordinates: tuple[str, ...], mirror: Mirror | None = None) -> Layout:
    """Return the layout of matrices passed by the user."""
    rows = np.eye(len(coordinates))
    rows.setflags(write=False)
    return Layout(coordinates, rows, rows, mirror)


def _pairs(rows: Array, mirror: Mirror | None) -> tuple[Array, Array]:
    """Return indices of one row of each pair of mirror images, up to sign, and of its image: itself if it has no other."""
    here = np.arange(len(rows))
    if mirror is None:
        return here, here
    size, image = np.abs(rows).max(axis=1, initial=0.0), np.empty_like(here)
    motion, reflected = np.abs(rows @ mirror.probe).T
    image[np.argsort(reflected)] = np.argsort(motion)
    pair, reflection = rows[image], rows[:, mirror.partner] * mirror.sign
    off = np.minimum(*(np.abs(reflection + sign * pair).max(axis=1, initial=0.0) for sign in (1.0, -1.0)))
    image = np.where((off <= SUMMED * size) & (image[image] == here), image, here)
    first = np.flatnonzero(image >= here)
    return first, image[first]


def _gram(rows: Array, weight: Array) -> Array:
    """Return ``rows^T diag(weight) rows``, exactly symmetric, or of a matrix of weights ``rows^T weight rows``."""
    if weight.ndim == 2:
        return rows.T @ weight @ rows
    scaled = np.sqrt(weight)[:, None] * rows
    return scaled.T @ scaled
