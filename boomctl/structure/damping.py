"""Damping as a share of the stiffness, and a few dampers: ``C = beta K + U diag(gamma) U^T``.

So it is of most structures: material damping is proportional to stiffness, and dampers are few.  A spring without damping
of its own counts as a damper too, of ``gamma = -beta k``.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy import linalg

from boomctl.arrays import Array
from boomctl.lti.rounding import ALIKE, SUMMED
from boomctl.structure.layout import KEPT, Layout
from boomctl.structure.matrices import Structure

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
    if structure.layout is None or structure.weights is None:
        return _from_matrices(structure.C, structure.K)
    k, c = structure.weights.k, structure.weights.c
    beta = common_ratio(c, k)
    gamma = c - beta * k
    apart = (np.abs(gamma) > SUMMED * np.maximum(c, beta * k)).nonzero()[0]
    if len(apart) > _MOST_DAMPERS:
        return None
    U, image, share = _distinct_rows(structure.layout, tuple(apart.tolist()))
    return Damping(beta, U, np.bincount(image, share * gamma[apart], U.shape[1])[: U.shape[1]])


@lru_cache(maxsize=KEPT)
def _distinct_rows(layout: Layout, places: tuple[int, ...]) -> tuple[Array, Array, Array]:
    """Return elastic rows as columns, those of one shape once, which of them each row is, and its square in theirs.

    Dampers that are each other's image are one damper of a half.
    """
    rows = layout.R[list(places)]
    largest = np.take_along_axis(rows, np.abs(rows).argmax(axis=1)[:, None], axis=1)[:, 0] if len(rows) else np.zeros(0)
    first: dict[bytes, int] = {}
    kept, image, share = [], np.zeros(len(rows), dtype=np.intp), np.zeros(len(rows))
    for i in np.flatnonzero(largest).tolist():
        shape = np.round(rows[i] / largest[i], _DIGITS) + 0.0  # no zero below zero, which would be another shape
        image[i] = first.setdefault(shape.tobytes(), len(first))
        if image[i] == len(kept):
            kept.append(i)
        share[i] = (largest[i] / largest[kept[image[i]]]) ** 2
    return rows[kept].T, image, share


def common_ratio(c: Array, k: Array) -> float:
    """Return the damping per stiffness that most share."""
    stiff = k > 0.0
    ratios = c[stiff] / k[stiff]
    ratios.sort()
    return float(ratios[len(ratios) // 2]) if len(ratios) else 0.0


def _from_matrices(C: Array, K: Array) -> Damping | None:
    c, k = C.diagonal(), K.diagonal()
    beta, rest = common_ratio(c, k), C
    if beta:
        rest = C - beta * K
    i, j = np.nonzero(rest)
    values = rest[i, j]
    size = beta * k + c
    large = np.abs(values) > ALIKE * np.sqrt(np.abs(size[i] * size[j]))
    touched = np.unique(np.concatenate([i[large], j[large]]))
    U = np.zeros((len(c), len(touched)))
    if len(touched) > _ENDS * _MOST_DAMPERS:
        return None
    if not len(touched):
        return Damping(beta, U, np.zeros(0))
    gamma, U[touched] = linalg.eigh(rest[touched][:, touched])
    apart = np.abs(gamma) > ALIKE * np.abs(gamma).max()
    return Damping(beta, U[:, apart], gamma[apart]) if apart.sum() <= _MOST_DAMPERS else None
