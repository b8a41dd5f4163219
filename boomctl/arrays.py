"""The name of the arrays that signatures speak of, and products and scalings of matrices."""

from collections.abc import Sequence
from typing import Any, TypeAlias

import numpy as np

Array: TypeAlias = np.ndarray[Any, Any]
"""An array of numbers; the docstring says whether real or complex, and of which shape."""

# share of its terms up to which a sum is what rounding left of zero: some 1e4 eps, of which conditions that are solved for
# coordinates amplify some (a choice)
ROUNDED = 1e-12


def combined(lines: Array, T: Array) -> Array:
    """Return ``lines @ T``; an entry that is rounding of the terms it was summed from is zero.

    A motion that strains nothing would otherwise strain by rounding, and could be taken for one that is held; a force that
    does not push it would push it by rounding, and a motion that nothing else holds goes far.
    """
    product = lines @ T
    bound = np.outer(np.abs(lines).max(axis=1, initial=0.0), ROUNDED * np.abs(T).sum(axis=0))
    if not product[np.abs(product) <= bound].any():  # no entry can be rounding: those below the bound are exact zeros
        return product
    return np.where(np.abs(product) > ROUNDED * (np.abs(lines) @ np.abs(T)), product, 0.0)


def squared(x: Array) -> Array:
    """Return squares of absolute values."""
    return x.real**2 + x.imag**2


def blocks(rows: Sequence[Sequence[Array]]) -> Array:
    """Return the matrix of these blocks, each of them a matrix: what ``numpy.block`` does, in a tenth of its calls."""
    return np.concatenate([np.concatenate(row, axis=1) for row in rows])


def scaled_to_one(matrix: Array) -> tuple[Array, int]:
    """Return a matrix whose largest entry is from a half to one in size, and the power of two that gives the one handed in.

    Eigenvalues of ``LAPACK dgeev`` lose their digits where all entries are below 1e-138 (measured).
    """
    power = int(np.frexp(np.abs(matrix).max(initial=0.0))[1])
    return np.ldexp(matrix, -power), power


def balance(matrix: Array) -> tuple[Array, Array]:
    """Return a real matrix whose rows and columns have like sizes, and the scales of its coordinates, powers of two.

    Raises
    ------
    ValueError
        The matrix is not finite.
    """
    from scipy.linalg import lapack

    if not len(matrix):
        return matrix, np.ones(0)
    if not np.isfinite(matrix).all():
        raise ValueError("a matrix that is not finite cannot be balanced")
    balanced, _, _, scale, _ = lapack.dgebal(matrix, scale=True, permute=False)
    return balanced, scale
