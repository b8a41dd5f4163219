"""The pencil ``s^2 M + s C + K`` of a structure, to be solved at many ``s``."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.linalg import lapack
from scipy.sparse.csgraph import reverse_cuthill_mckee
from scipy.sparse.linalg import splu

from boomctl.arrays import Array, Matrix

Solve = Callable[[Array], Array]

_DENSE_FACTOR = 220  # coordinates up to which factors are dense: sparse is faster from some 200 on (measured)
_WIDEST_BAND = 24  # half bandwidth up to which bands are used: a boom has 3, with elements of order 12 it has 23


def factorized(matrix: Matrix) -> Solve:
    """Return a solver of a symmetric positive definite matrix, sparse or dense."""
    if matrix.shape[0] <= _DENSE_FACTOR:
        return factorized_dense(matrix.toarray() if sparse.issparse(matrix) else np.array(matrix))
    options = {"SymmetricMode": True}
    lu = splu(sparse.csc_array(matrix), options=options, diag_pivot_thresh=0.0, permc_spec="MMD_AT_PLUS_A")
    return lu.solve


def factorized_dense(matrix: Array) -> Solve:
    """Return a solver of a dense symmetric positive definite matrix, which is written over."""
    factor, failed = lapack.dpotrf(matrix.T, lower=0, clean=0, overwrite_a=1)
    if failed:
        raise np.linalg.LinAlgError("the matrix is not positive definite")
    return lambda rhs: lapack.dpotrs(factor, rhs, lower=0)[0]


def stored(matrix: Matrix, n: int) -> Matrix:
    """Return a matrix as products with it are fastest."""
    if n <= _DENSE_FACTOR:
        return matrix.toarray() if sparse.issparse(matrix) else np.asarray(matrix)
    return sparse.csr_array(matrix)


@dataclass(frozen=True)
class Pencil:
    """``s^2 M + s C + K`` of symmetric matrices, to be solved at many ``s``; as bands where reordering makes them narrow.

    ``bands`` are the lower bands of ``M, C, K`` in the order ``order``, ``bands[k, i, j]`` at ``(i + j, j)``.
    """

    M: Matrix
    C: Matrix
    K: Matrix
    order: Array
    bands: Array

    @classmethod
    def of(cls, M: Matrix, C: Matrix, K: Matrix) -> "Pencil":
        n, entries = M.shape[0], _entries(M, C, K)
        i, j = (np.concatenate([entry[axis] for entry in entries]) for axis in (0, 1))
        order = reverse_cuthill_mckee(sparse.csr_array((np.ones(len(i)), (i, j)), shape=(n, n)), symmetric_mode=True)
        place = np.empty(n, dtype=np.intp)
        place[order] = np.arange(n)
        width = int(np.abs(place[i] - place[j]).max(initial=0))
        if width > _WIDEST_BAND:
            return cls(M, C, K, order, np.zeros((3, 0, n)))
        bands = np.zeros((3, width + 1, n))
        for band, (row, column, data) in zip(bands, entries, strict=True):
            at = place[column]
            below = place[row] - at
            low = below >= 0
            band[below[low], at[low]] = data[low]
        return cls(M, C, K, order, bands)

    def factorized(self, s: float) -> Solve:
        """Return a solver at a real ``s``, where the matrix is positive definite."""
        return self._solver((s * s, s))

    def shifted(self, alpha: float) -> Solve:
        """Return a solver of ``K + alpha M``, positive definite."""
        return self._solver((alpha, 0.0))

    def _solver(self, shares: tuple[float, float]) -> Solve:
        """Return a solver of the stiffness matrix and shares of mass and damping."""
        m, c = shares
        if not self.bands.shape[1]:
            return factorized(self.K + c * self.C + m * self.M)
        factor, failed = lapack.dpbtrf(self.bands[2] + c * self.bands[1] + m * self.bands[0], lower=1, overwrite_ab=1)
        if failed:
            raise np.linalg.LinAlgError("the matrix is not positive definite")

        def solve(rhs: Array) -> Array:
            solution = np.empty_like(rhs)
            solution[self.order] = lapack.dpbtrs(factor, rhs[self.order], lower=1, overwrite_b=1)[0]
            return solution

        return solve

    def solved(self, s: complex, rhs: Array) -> Array:
        """Return the solution at a complex ``s``."""
        width = self.bands.shape[1] - 1
        if width < 0:
            D = self.K + s * self.C + s * s * self.M
            if not sparse.issparse(D):
                return np.linalg.solve(D, rhs)
            return splu(sparse.csc_array(D), permc_spec="MMD_AT_PLUS_A").solve(rhs)
        low = self._band(s)
        n = low.shape[1]
        full = np.zeros((3 * width + 1, n), dtype=complex)
        full[2 * width :] = low
        for k in range(1, width + 1):
            full[2 * width - k, k:] = low[k, : n - k]
        _, _, x, failed = lapack.zgbsv(width, width, full, rhs[self.order], overwrite_ab=1)
        if failed:
            raise np.linalg.LinAlgError("the matrix is singular")
        solution = np.empty_like(x)
        solution[self.order] = x
        return solution

    def _band(self, s: complex) -> Array:
        return self.bands[2] + s * self.bands[1] + s * s * self.bands[0]


def _entries(*matrices: Matrix) -> list[tuple[Array, Array, Array]]:
    """Return rows, columns and values of the entries of matrices, each place once."""
    if any(sparse.issparse(matrix) for matrix in matrices):
        listed = [sparse.coo_array(matrix) for matrix in matrices]
        return [(matrix.coords[0], matrix.coords[1], matrix.data) for matrix in listed]
    i, j = np.nonzero(np.any([matrix != 0.0 for matrix in matrices], axis=0))
    return [(i, j, matrix[i, j]) for matrix in matrices]
