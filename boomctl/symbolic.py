"""Constants of CasADi functions as arguments, so that functions with the same sparsity are compiled once."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from boomctl.arrays import Array
from boomctl.lti.rounding import DIGIT

if TYPE_CHECKING:
    import casadi


class Places(NamedTuple):
    """Sparsity pattern of a matrix, row by row; key of the cache of functions."""

    rows: int
    columns: int
    filled: bytes


def lifted(matrices: Sequence[Array | float]) -> tuple[tuple[Places, ...], Array]:
    """Return the places of matrices, vectors (as columns) and numbers, and the entries there, those of all in one vector."""
    places, entries = [], []
    for item in matrices:
        matrix = np.asarray(item, dtype=float)
        matrix = matrix.reshape(matrix.shape[0] if matrix.ndim else 1, -1)
        size = np.abs(matrix)
        filled = size > DIGIT * size.max(initial=0.0)
        places.append(Places(*matrix.shape, filled.tobytes()))
        entries.append(matrix.T[filled.T])
    return tuple(places), np.concatenate(entries)


def symbols(places: Sequence[Places]) -> tuple[casadi.SX, list[casadi.SX]]:
    """Return a vector of symbols, and the matrices with these places that it fills, in the order of `lifted`."""
    import casadi as ca

    patterns = []
    for rows, columns, filled in places:
        column, row = np.nonzero(np.frombuffer(filled, dtype=bool).reshape(rows, columns).T)
        patterns.append(ca.Sparsity.triplet(rows, columns, row.tolist(), column.tolist()))
    vector, ends = (
        ca.SX.sym("constants", sum(item.nnz() for item in patterns)),
        np.cumsum([0, *map(ca.Sparsity.nnz, patterns)]),
    )
    spans = zip(patterns, ends[:-1].tolist(), ends[1:].tolist(), strict=True)
    return vector, [ca.SX(pattern, vector[first:last]) for pattern, first, last in spans]
