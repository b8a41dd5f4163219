"""The pencil ``s^2 M + s C + K`` in mixed form: forces of strains as unknowns beside the coordinates.

A stiffness matrix that is formed loses as many digits as its stiffest element is stiffer than the structure: all of them
on a beam of ten thousand elements.  Here ``K`` is never formed.  With rows ``R`` and weights ``w = k + s c``

    [ -1/w   R    ] [ forces ]   [ 0 ]
    [ R^T    s^2 M ] [ motion ] = [ f ]

is eliminated along the structure, coordinates first and each strain after the last coordinate that it is made of, with
pivots chosen by size.  Coordinates then follow from strains by summation, as they do along the beam, and ``R^T w R`` never
arises.  A boom of 100,000 elements keeps eleven digits so (measured), in time and memory that grow as the number of elements.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy import linalg, sparse
from scipy.sparse.csgraph import reverse_cuthill_mckee
from scipy.sparse.linalg import LinearOperator, eigsh, splu

from boomctl.arrays import Array
from boomctl.structure.layout import Layout, Weights, squared_sums
from boomctl.structure.response.pencil import Solve

# share of its terms up to which each strain of a motion is rounding, and the motion rigid: a mode strains some row by about
# as much as its terms, a rigid motion of 10,000 elements strains none by more than some 1e-8 of them (measured)
_STRAINLESS = 1e-5
_DEPENDENT = 1e-12  # of the largest; what of a motion is below it, beside others, is rounding
_WIDEST = 64.0  # places that a row spans in the mean, up to which elimination along the structure is cheap (a choice)


@dataclass(frozen=True, eq=False)
class MixedForm:
    """Rows and weights in the order in which they are eliminated.

    Attributes
    ----------
    weights : Weights
    used : (rows,) ndarray
        Elastic rows that carry stiffness or damping.
    place : ndarray
        Where each strain and, behind them, each coordinate stands in the order of elimination.
    R, M : csr_array
        Elastic rows used, and the mass matrix.
    """

    weights: Weights
    used: Array
    place: Array
    R: sparse.csr_array
    M: sparse.csr_array

    @classmethod
    def of(cls, layout: Layout, weights: Weights) -> "MixedForm | None":
        """Return the mixed form; None where rows reach so far that elimination along the structure would fill up."""
        R, M = sparse.csr_array(layout.R), sparse.csr_array(layout.mass(weights.m, False))
        used = np.flatnonzero(((weights.k > 0.0) | (weights.c > 0.0)) & (np.diff(R.indptr) > 0))
        R = sparse.csr_array(R[used])
        pattern = sparse.csr_array(abs(R).T @ abs(R) + abs(M))
        order = reverse_cuthill_mckee(pattern, symmetric_mode=True)
        n = layout.n
        at = np.empty(n, dtype=np.intp)
        at[order] = np.arange(n)
        if not len(used):
            return None
        last, first = (f.reduceat(at[R.indices], R.indptr[:-1]) for f in (np.maximum, np.minimum))
        if (last - first).mean() > _WIDEST:
            return None
        place = np.empty(len(used) + n, dtype=np.intp)
        place[np.argsort(np.concatenate([last + 0.5, at]), kind="stable")] = np.arange(len(place))
        return cls(weights, used, place, R, M)

    def factorized(self, s: complex) -> Solve:
        """Return a solver of ``s^2 M + s C + K``; real where ``s`` is."""
        return self._solver(s * s, self.weights.k[self.used] + s * self.weights.c[self.used])

    def shifted(self, alpha: float) -> Solve:
        """Return a solver of ``K + alpha M``."""
        return self._solver(alpha, self.weights.k[self.used])

    def projected(self, alpha: float, loads: Array) -> tuple[Array, Array, Array]:
        """Return ``M, C, K`` over the responses of ``K + alpha M`` to loads, made of mass one; those that depend left out."""
        strain, X = self.strains_and_motion(alpha)(loads)
        k, c = self.weights.k[self.used], self.weights.c[self.used]
        mass = X.T @ (self.M @ X)
        size = 1.0 / np.sqrt(np.diag(mass))
        values, mixed = linalg.eigh(size[:, None] * mass * size)
        kept = values > _DEPENDENT * values[-1]
        T = size[:, None] * mixed[:, kept] / np.sqrt(values[kept])
        strain, X = strain @ T, X @ T
        still = np.sqrt(c[k == 0.0])[:, None] * (self.R[np.flatnonzero(k == 0.0)] @ X)
        elastic = k > 0.0
        C = strain.T @ ((c[elastic] / k[elastic])[:, None] * strain) + still.T @ still
        return np.eye(int(kept.sum())), C, strain.T @ strain

    def strains_and_motion(self, alpha: float) -> Callable[[Array], tuple[Array, Array]]:
        """Return a solver of ``K + alpha M`` that tells strains, times the roots of their stiffness, beside the motion.

        They are unknowns of their own and keep their digits where differences of the motion have none left.
        """
        return self._both(alpha, self.weights.k[self.used])

    def damping(self) -> Solve:
        """Return a solver of ``C``."""
        return self._solver(0.0, self.weights.c[self.used])

    def _solver(self, inertia: complex, stiffness: Array) -> Solve:
        both = self._both(inertia, stiffness)
        return lambda rhs: both(rhs)[1]

    def _both(self, inertia: complex, stiffness: Array) -> Callable[[Array], tuple[Array, Array]]:
        kept = np.flatnonzero(stiffness != 0.0)
        w, n = np.abs(stiffness[kept]), self.M.shape[0]
        R, strains = sparse.csr_array(self.R[kept]), len(kept)
        diagonal = squared_sums(R, w) + np.abs(inertia) * self.M.diagonal()
        size = 1.0 / np.sqrt(np.where(diagonal > 0.0, diagonal, 1.0))
        R = sparse.csr_array(sparse.diags_array(np.sqrt(w)) @ R @ sparse.diags_array(size))
        scaled = sparse.diags_array(size) @ (inertia * self.M) @ sparse.diags_array(size)
        flexibility = sparse.diags_array(-w / stiffness[kept])
        full = sparse.coo_array(sparse.block_array([[flexibility, R], [R.T, scaled]]))
        place = self.place
        if strains < len(self.used):
            chosen = np.concatenate([place[: len(self.used)][kept], place[len(self.used) :]])
            place = np.empty(strains + n, dtype=np.intp)
            place[np.argsort(chosen)] = np.arange(strains + n)
        i, j = (place[axis] for axis in full.coords)
        placed = sparse.csc_array((full.data, (i, j)), shape=full.shape)
        try:
            lu = splu(placed, permc_spec="NATURAL")
        except RuntimeError:
            raise np.linalg.LinAlgError("the matrix is singular") from None
        motion = place[strains:]

        def solve(rhs: Array) -> tuple[Array, Array]:
            load = np.zeros((strains + n, *rhs.shape[1:]), dtype=full.dtype)
            scale = size.reshape(-1, *(1,) * (rhs.ndim - 1))
            load[motion] = scale * rhs
            found = lu.solve(load)
            found += lu.solve(load - placed @ found)  # what pivots of very unlike size have lost
            return found[place[:strains]], scale * found[motion]

        return solve

    def solved(self, s: complex, rhs: Array) -> Array:
        """Return the solution at a complex ``s``."""
        return self.factorized(s)(rhs)

    def lowest(self, alpha: float, count: int) -> tuple[Array, Array]:
        """Return the ``count`` lowest undamped frequencies [rad/s], those of rigid motions zero, and mass-normalised shapes.

        They are found with the stiffness ``K + alpha M``, and mended by a projection of the strains of their shapes.

        Raises
        ------
        ArpackError
            Lanczos' method does not converge.
        """
        n = self.M.shape[0]
        both = self.strains_and_motion(alpha)
        inverse = LinearOperator((n, n), matvec=lambda v: both(v)[1], dtype=float)  # type: ignore[call-arg]
        start = np.random.default_rng(0).standard_normal(n)
        _, V = eigsh(self.M, count, self.M, sigma=-alpha, OPinv=inverse, v0=start, tol=1e-12)
        strain, X = both(self.M @ V)
        stiffness, mixed = linalg.eigh(strain.T @ strain, X.T @ (self.M @ X))
        shapes = X @ mixed
        strained = np.abs(self.R @ shapes) > _STRAINLESS * (abs(self.R) @ np.abs(shapes))
        return np.where(strained.any(axis=0), np.sqrt(np.maximum(stiffness, 0.0)), 0.0), shapes
