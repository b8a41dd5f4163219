"""Rank-revealing choice of dependent coordinates: the one step behind joints, held chains and displacement inputs.

``n_d`` rows ``J^T z = d`` are solved for ``n_d`` coordinates, ``z_r = J_r^-T d - J_r^-T J_s^T z_s``, so that
``z = T_d d + T_q z_s``.  Source: Anthonis & Ramon (2003), Eqs. (3), (5), (6).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy import linalg, sparse

from boomctl.arrays import DENSE_LIMIT, ROUNDED, Array, Matrix, combined

DEPENDENT = 1e-10  # of the largest pivot, or of what was there; what differs by less depends on the others (a choice)


@dataclass(frozen=True)
class Elimination:
    """The congruence ``z = T_d d + T_q z_s`` and the places of the independent coordinates (s)."""

    independent: Array
    T_d: Matrix
    T_q: Matrix


def eliminate(J: Matrix, names: Sequence[str], weights: Array | None = None) -> Elimination:
    """Choose dependent coordinates by pivoted QR and return the congruence; dense where coordinates are few.

    Parameters
    ----------
    J : (n, n_d) array, dense or sparse
        Its columns are the rows prescribed.
    names : sequence of str
        What each column is called, for messages.
    weights : (n,) ndarray, optional
        Preference: a coordinate of larger weight is rather made dependent.

    Raises
    ------
    ValueError
        A column is zero, or depends on the others.
    """
    n, count = J.shape
    if sparse.issparse(J):
        full = sparse.csr_array(J)
        touched = np.flatnonzero(np.diff(full.indptr))
        block = full[touched].toarray()
    else:
        touched = np.flatnonzero(J.any(axis=1))
        block = J[touched]
    norms = np.linalg.norm(block, axis=0)
    _check_rank(block, norms, names)
    scaled = (block / norms).T if weights is None else (block / norms).T * weights[touched]
    pivots = np.sort(linalg.qr(scaled, mode="r", pivoting=True)[1][:count])
    dependent = touched[pivots]
    rest = np.delete(np.arange(len(touched)), pivots)
    # conditions as large as one, and coordinates by what they move of them, so that what rounding leaves is told by its size
    unit = block / norms
    size = np.abs(unit).max(axis=1)
    even = unit / size[:, None]
    inverse = _told(np.linalg.inv(even[pivots].T))
    coupling = _told(combined(-inverse, even[rest].T)) * (size[rest] / size[pivots][:, None])
    inverse = inverse / (size[pivots][:, None] * norms)
    independent = np.delete(np.arange(n), dependent)
    column = np.full(n, -1)
    column[independent] = np.arange(n - count)
    r, s = np.nonzero(coupling)
    rows = np.concatenate([independent, dependent[r]])
    columns = np.concatenate([np.arange(n - count), column[touched[rest[s]]]])
    T_q = from_entries(rows, columns, np.concatenate([np.ones(n - count), coupling[r, s]]), (n, n - count), n)
    i, j = np.nonzero(inverse)
    return Elimination(independent, from_entries(dependent[i], j, inverse[i, j], (n, count), n), T_q)


def _told(matrix: Array) -> Array:
    """Return a matrix of entries alike without those that are rounding of the largest one."""
    return np.where(np.abs(matrix) > ROUNDED * np.abs(matrix).max(initial=0.0), matrix, 0.0)


def from_entries(rows: Any, columns: Any, values: Any, shape: tuple[int, int], coordinates: int) -> Matrix:
    """Return a matrix of these entries, each place once; sparse where the coordinates of the structure are many."""
    if coordinates > DENSE_LIMIT:
        return sparse.csr_array((values, (rows, columns)), shape=shape)
    full = np.zeros(shape)
    full[rows, columns] = values
    return full


def _check_rank(block: Array, norms: Array, names: Sequence[str]) -> None:
    """Raise if a column is zero or depends on the others, naming it."""
    zero = np.flatnonzero(norms == 0.0)
    if len(zero):
        raise ValueError(f"{names[zero[0]]!r} moves no coordinate: its displacement cannot be prescribed")
    if block.shape[0] < block.shape[1]:
        raise ValueError(f"{', '.join(map(repr, names))}: more displacements are prescribed than the points can move")
    _, R, order = linalg.qr(block / norms, mode="economic", pivoting=True)
    small = np.flatnonzero(np.abs(np.diag(R)) < DEPENDENT)
    if len(small):
        others = [names[i] for i in order[: small[0]]]
        raise ValueError(
            f"displacement of {names[order[small[0]]]!r} depends on that of {', '.join(map(repr, others))}"
        )
