"""``K + m M`` of a structure, factored to be solved for many right-hand sides."""

from collections.abc import Callable

import numpy as np
from scipy.linalg import lapack

from boomctl.arrays import Array
from boomctl.structure.matrices import Structure

Solve = Callable[[Array], Array]


def factorized(structure: Structure, m: float) -> Solve:
    """Return a solver of ``K + m M``, positive definite.

    Raises
    ------
    LinAlgError
        It is not.
    """
    return factorized_dense(structure.K + m * structure.M)


def factorized_dense(matrix: Array) -> Solve:
    """Return a solver of a symmetric positive definite matrix, which is written over."""
    factor, failed = lapack.dpotrf(matrix.T, lower=0, clean=0, overwrite_a=1)
    if failed:
        raise np.linalg.LinAlgError("the matrix is not positive definite")
    return lambda rhs: lapack.dpotrs(factor, rhs, lower=0)[0]
