"""Type of arrays, and products and scalings of matrices."""

from collections.abc import Sequence
from typing import Any, TypeAlias

import numpy as np

Array: TypeAlias = np.ndarray[Any, Any]
"""Array of numbers; docstrings state the type and shape."""

# Rounding error of an entry of matrix products, relative to its terms: some 1e4 units, because solved conditions amplify it.
SUMMED = 1e-12


def combined(lines: Array, T: Array) -> Array:
    """Return ``lines @ T`` with entries that are rounding errors of their sums set to zero.

    Otherwise a rigid motion could have strains, or a force could act on a motion that it does not excite.
    """
    product = lines @ T
    bound = np.outer(np.abs(lines).max(axis=1, initial=0.0), SUMMED * np.abs(T).sum(axis=0))
    if not product[np.abs(product) <= bound].any():  # no entry can be rounding: those below the bound are exact zeros
        return product
    return np.where(np.abs(product) > SUMMED * (np.abs(lines) @ np.abs(T)), product, 0.0)


def squared(x: Array) -> Array:
    """Return squares of absolute values."""
    return x.real**2 + x.imag**2


def blocks(rows: Sequence[Sequence[Array]]) -> Array:
    """Return the matrix of these blocks, as ``numpy.block`` with fewer calls."""
    return np.concatenate([np.concatenate(row, axis=1) for row in rows])


def scaled_to_one(matrix: Array) -> tuple[Array, int]:
    """Return a matrix scaled to a largest entry from 0.5 to 1, and the power of two of the scaling.

    ``LAPACK dgeev`` is inaccurate if all entries are below 1e-138.
    """
    power = int(np.frexp(np.abs(matrix).max(initial=0.0))[1])
    return np.ldexp(matrix, -power), power


def balance(matrix: Array) -> tuple[Array, Array]:
    """Balance a real matrix; return it and the scales of its coordinates, powers of two.

    Raises
    ------
    ValueError
        If the matrix is not finite.
    """
    from scipy.linalg import lapack

    if not len(matrix):
        return matrix, np.ones(0)
    if not np.isfinite(matrix).all():
        raise ValueError("a matrix that is not finite cannot be balanced")
    balanced, _, _, scale, _ = lapack.dgebal(matrix, scale=True, permute=False)
    return balanced, scale
