"""The pencil ``s^2 M + s C + K`` in mixed form: forces of strains as unknowns beside the coordinates.

A stiffness matrix that is formed loses as many digits as its stiffest element is stiffer than the structure: all of them
on a beam of ten thousand elements.  Here ``K`` is never formed.  With rows ``R`` and weights ``w = k + s c``

    [ -1/w   R    ] [ forces ]   [ 0 ]
    [ R^T    s^2 M ] [ motion ] = [ f ]

is eliminated along the structure, coordinates first and each strain after the last coordinate that it is made of, with
pivots chosen by size.  Coordinates then follow from strains by summation, as they do along the beam, and ``R^T w R`` never
arises.  A boom of 100,000 elements keeps eleven digits so (measured), in time and memory that grow as the number of elements.
"""

from dataclasses import dataclass

import numpy as np
from scipy import linalg, sparse
from scipy.sparse.csgraph import reverse_cuthill_mckee
from scipy.sparse.linalg import LinearOperator, eigsh, splu

from boomctl.arrays import Array
from boomctl.structure.layout import Layout, Weights, squared_sums
from boomctl.structure.response.pencil import Solve

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

    def damping(self) -> Solve:
        """Return a solver of ``C``."""
        return self._solver(0.0, self.weights.c[self.used])

    def _solver(self, inertia: complex, stiffness: Array) -> Solve:
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
        try:
            lu = splu(sparse.csc_array((full.data, (i, j)), shape=full.shape), permc_spec="NATURAL")
        except RuntimeError:
            raise np.linalg.LinAlgError("the matrix is singular") from None
        motion = place[strains:]

        def solve(rhs: Array) -> Array:
            load = np.zeros((strains + n, *rhs.shape[1:]), dtype=full.dtype)
            scale = size.reshape(-1, *(1,) * (rhs.ndim - 1))
            load[motion] = scale * rhs
            return scale * lu.solve(load)[motion]

        return solve

    def solved(self, s: complex, rhs: Array) -> Array:
        """Return the solution at a complex ``s``."""
        return self.factorized(s)(rhs)

    def lowest(self, alpha: float, count: int) -> tuple[Array, Array]:
        """Return the ``count`` lowest undamped frequencies [rad/s] and mass-normalised shapes.

        They are found with the stiffness ``K + alpha M``, and mended by a projection of the strains of their shapes.
        """
        n = self.M.shape[0]
        solve = self.shifted(alpha)
        inverse = LinearOperator((n, n), matvec=solve, dtype=float)  # type: ignore[call-arg]
        start = np.random.default_rng(0).standard_normal(n)
        _, V = eigsh(self.M, count, self.M, sigma=-alpha, OPinv=inverse, v0=start, tol=1e-12)
        strain = self.R @ V
        stiffness, mixed = linalg.eigh(strain.T @ (self.weights.k[self.used][:, None] * strain), V.T @ (self.M @ V))
        return np.sqrt(np.maximum(stiffness, 0.0)), V @ mixed
