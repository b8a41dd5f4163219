"""``m M + c C + K`` of a structure, to be solved at one ``m`` and ``c``: dense where it is small, else sparse.

A stiffness matrix that is formed loses as many digits as its stiffest element is stiffer than the structure: all of them on
a beam of ten thousand elements.  Where rows ``R`` and their weights ``w = k + c c_R`` are known, the forces of strains are
unknowns beside the coordinates,

    [ -|w|/w       |w|^1/2 R ] [ forces ]   [ 0 ]
    [ |w|^1/2 R^T  m M       ] [ motion ] = [ f ]

and ``R^T w R`` is never formed: stiff entries are large, so that they are the pivots.  Time and memory grow as the number of
coordinates, on beams.
"""

from collections.abc import Callable

import numpy as np
from scipy import sparse
from scipy.linalg import lapack
from scipy.sparse.linalg import splu

from boomctl.arrays import Array
from boomctl.structure.matrices import DENSE, Structure, dense

Solve = Callable[[Array], Array]


def factorized(structure: Structure, m: float) -> Solve:
    """Return a solver of ``K + m M``, positive definite.

    Raises
    ------
    LinAlgError
        It is not.
    """
    if structure.n <= DENSE:
        return factorized_dense(dense(structure.K) + m * dense(structure.M))
    return factorized_sparse(structure, m)


def factorized_dense(matrix: Array) -> Solve:
    """Return a solver of a dense symmetric positive definite matrix, which is written over."""
    factor, failed = lapack.dpotrf(matrix.T, lower=0, clean=0, overwrite_a=1)
    if failed:
        raise np.linalg.LinAlgError("the matrix is not positive definite")
    return lambda rhs: lapack.dpotrs(factor, rhs, lower=0)[0]


def factorized_sparse(structure: Structure, m: complex, c: complex = 0.0) -> Solve:
    """Return a solver of ``m M + c C + K``, which need not be definite.

    Raises
    ------
    LinAlgError
        The matrix is singular.
    """
    rows, M = structure.elastic, sparse.csr_array(structure.M)
    strains, full = 0, m * M + c * sparse.csr_array(structure.C) + sparse.csr_array(structure.K) if rows is None else M
    if rows is not None:
        weight = rows.k + c * rows.c
        used = np.flatnonzero(weight)
        size, strains = np.abs(weight[used]), len(used)
        R = sparse.diags_array(np.sqrt(size)) @ sparse.csr_array(rows.R)[used]
        full = sparse.block_array([[sparse.diags_array(-size / weight[used]), R], [R.T, m * M]])
    full = sparse.csc_array(full)
    try:
        lu = splu(full)
    except RuntimeError:
        raise np.linalg.LinAlgError("the matrix is singular") from None

    def solve(rhs: Array) -> Array:
        load = np.zeros((strains + structure.n, *rhs.shape[1:]), dtype=np.result_type(full.dtype, rhs.dtype))
        load[strains:] = rhs
        found = lu.solve(load)
        found = found + lu.solve(load - full @ found)  # what pivots of very unlike size have lost
        return found[strains:]

    return solve
