"""Damping as a share of the stiffness, and a few dampers: ``C = beta K + U diag(gamma) U^T``.

So it is of most structures: material damping is proportional to stiffness, and dampers are few.  A spring without damping
of its own counts as a damper too, of ``gamma = -beta k``.
"""

from dataclasses import dataclass

import numpy as np
from scipy import linalg, sparse

from boomctl.arrays import Array, Matrix
from boomctl.structure.matrices import ElasticRows, Structure, dense

_SAME = 1e-9  # share of its size up to which a damper's coefficient is the rounding of a proportional one
_SAME_ROW = 1e-12  # the same where the coefficient of each row is known: some 1e4 eps
_DIGITS = 13  # of a damper's row, relative to its largest entry, in which its image agrees with it
_MOST_DAMPERS = 12  # beyond, damping is not "proportional but for a few" (a choice)
_ENDS = 8  # coordinates that a damper may touch, where it has to be found in the matrix: two bodies of a beam each


@dataclass(frozen=True)
class Damping:
    """``C = beta K + U diag(gamma) U^T``."""

    beta: float
    U: Array
    gamma: Array


def separated_damping(structure: Structure) -> Damping | None:
    """Return the damping as stiffness-proportional and a few dampers; None where it is not."""
    if structure.elastic is None:
        return _from_matrices(structure.C, structure.K)
    rows: ElasticRows = structure.elastic
    beta = _common_ratio(rows.c, rows.k)
    gamma = rows.c - beta * rows.k
    apart = np.flatnonzero(np.abs(gamma) > _SAME_ROW * np.maximum(rows.c, beta * rows.k))
    if len(apart) > _MOST_DAMPERS:
        return None
    # dampers that are each other's image are one damper of a half
    U = dense(rows.R[apart])
    largest = np.take_along_axis(U, np.abs(U).argmax(axis=1)[:, None], axis=1)
    moved = np.flatnonzero(largest)
    shapes = np.round(U[moved] / largest[moved], _DIGITS) + 0.0  # no zero below zero, which would be another shape
    place: dict[bytes, int] = {}
    for row, i in zip(shapes, moved.tolist(), strict=True):
        first = place.setdefault(row.tobytes(), i)
        if first != i:
            gamma[apart[first]] += gamma[apart[i]] * float(largest[i, 0] / largest[first, 0]) ** 2
    kept = list(place.values())
    return Damping(beta, U[kept].T, gamma[apart[kept]])


def _common_ratio(c: Array, k: Array) -> float:
    """Return the damping per stiffness that most share."""
    ratios = np.sort(c[k > 0.0] / k[k > 0.0])
    return float(ratios[len(ratios) // 2]) if len(ratios) else 0.0


def _from_matrices(C: Matrix, K: Matrix) -> Damping | None:
    c, k = C.diagonal(), K.diagonal()
    beta, rest = _common_ratio(c, k), C
    if beta:
        rest = C - beta * K
    if sparse.issparse(rest):
        entries = sparse.coo_array(rest)
        (i, j), values = entries.coords, entries.data
    else:
        i, j = np.nonzero(rest)
        values = rest[i, j]
    size = beta * k + c
    large = np.abs(values) > _SAME * np.sqrt(np.abs(size[i] * size[j]))
    touched = np.unique(np.concatenate([i[large], j[large]]))
    U = np.zeros((len(c), len(touched)))
    if len(touched) > _ENDS * _MOST_DAMPERS:
        return None
    if not len(touched):
        return Damping(beta, U, np.zeros(0))
    gamma, U[touched] = linalg.eigh(dense(rest[touched][:, touched]))
    apart = np.abs(gamma) > _SAME * np.abs(gamma).max()
    return Damping(beta, U[:, apart], gamma[apart]) if apart.sum() <= _MOST_DAMPERS else None
