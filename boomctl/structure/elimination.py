"""Rank-revealing choice of dependent coordinates: used for joints, closed chains and displacement inputs.

``n_d`` rows ``J^T z = d`` are solved for ``n_d`` coordinates, ``z_r = J_r^-T d - J_r^-T J_s^T z_s``, so that
``z = T_d d + T_q z_s``.  Source: Anthonis & Ramon (2003), Eqs. (3), (5), (6).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import lapack

from boomctl.arrays import SUMMED, Array, combined
from boomctl.lti.rounding import DEPENDENT


@dataclass(frozen=True)
class Elimination:
    """The congruence ``z = T_d d + T_q z_s`` and the indices of the independent coordinates (s)."""

    independent: Array
    T_d: Array
    T_q: Array


def eliminate(J: Array, names: Sequence[str], weights: Array | None = None) -> Elimination:
    """Choose dependent coordinates by pivoted QR and return the congruence.

    Parameters
    ----------
    J : (n, n_d) ndarray
        Its columns are the rows prescribed.
    names : sequence of str
        Name of each column, for messages.
    weights : (n,) ndarray, optional
        Preference: coordinates of larger weight become dependent first.

    Raises
    ------
    ValueError
        A column is zero, or depends on the others.
    """
    n, count = J.shape
    touched = np.flatnonzero(J.any(axis=1))
    block = J[touched]
    norms = np.linalg.norm(block, axis=0)
    _check_rank(block, norms, names)
    scaled = (block / norms).T if weights is None else (block / norms).T * weights[touched]
    pivots = np.sort(lapack.dgeqp3(scaled)[1][:count] - 1)
    dependent = touched[pivots]
    rest = np.delete(np.arange(len(touched)), pivots)
    # Normalized conditions and coordinates, so that rounding error is identified by its magnitude.
    unit = block / norms
    size = np.abs(unit).max(axis=1)
    even = unit / size[:, None]
    inverse = _without_rounding(np.linalg.inv(even[pivots].T))
    coupling = _without_rounding(combined(-inverse, even[rest].T)) * (size[rest] / size[pivots][:, None])
    inverse = inverse / (size[pivots][:, None] * norms)
    independent = np.delete(np.arange(n), dependent)
    T_d, T_q = np.zeros((n, count)), np.zeros((n, n - count))
    T_d[dependent] = inverse
    T_q[independent, np.arange(n - count)] = 1.0
    T_q[np.ix_(dependent, np.searchsorted(independent, touched[rest]))] = coupling
    return Elimination(independent, T_d, T_q)


def _without_rounding(matrix: Array) -> Array:
    """Return a matrix of entries of similar magnitude with zeros for those below rounding of the largest one."""
    return np.where(np.abs(matrix) > SUMMED * np.abs(matrix).max(initial=0.0), matrix, 0.0)


def _check_rank(block: Array, norms: Array, names: Sequence[str]) -> None:
    """Raise if a column is zero or depends on the others, naming it."""
    zero = np.flatnonzero(norms == 0.0)
    if len(zero):
        raise ValueError(f"{names[zero[0]]!r} is fully constrained: its displacement cannot be prescribed")
    if block.shape[0] < block.shape[1]:
        raise ValueError(f"{', '.join(map(repr, names))}: more displacements are prescribed than the points can move")
    R, order, *_ = lapack.dgeqp3(block / norms)
    small = np.flatnonzero(np.abs(R.diagonal()) < DEPENDENT)
    if len(small):
        others = [names[i - 1] for i in order[: small[0]]]
        raise ValueError(
            f"displacement of {names[order[small[0]] - 1]!r} depends on that of {', '.join(map(repr, others))}"
        )
