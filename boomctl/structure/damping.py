"""Damping proportional to stiffness, and a few dampers: ``C = beta K + U diag(gamma) U^T``.

Material damping is proportional to stiffness, and dampers are few.  A spring without damping counts as a damper of
``gamma = -beta k``.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from boomctl.arrays import Array
from boomctl.lti.rounding import SUMMED
from boomctl.structure.layout import KEPT, Layout
from boomctl.structure.matrices import Structure

_DIGITS = 13  # Decimals in which the row of a damper, scaled to one, agrees with that of its mirror image.
_MAX_DAMPERS = 12  # With more, damping is not "proportional but for a few".


@dataclass(frozen=True)
class Damping:
    """``C = beta K + U diag(gamma) U^T``."""

    beta: float
    U: Array
    gamma: Array


def separated_damping(structure: Structure) -> Damping | None:
    """Return the damping as stiffness-proportional and a few dampers; None for many dampers, and without rows."""
    if structure.layout is None or structure.weights is None:
        return None
    k, c = structure.weights.k, structure.weights.c
    beta = common_ratio(c, k)
    gamma = c - beta * k
    dampers = np.flatnonzero(np.abs(gamma) > SUMMED * np.maximum(c, beta * k))
    if len(dampers) > _MAX_DAMPERS:
        return None
    U, image, ratio = _distinct_rows(structure.layout, tuple(dampers.tolist()))
    return Damping(beta, U, np.bincount(image, ratio * gamma[dampers], U.shape[1])[: U.shape[1]])


@lru_cache(maxsize=KEPT)
def _distinct_rows(layout: Layout, places: tuple[int, ...]) -> tuple[Array, Array, Array]:
    """Return elastic rows as columns, those of one shape once, which of them each row is, and its square in theirs.

    Dampers that are mirror images of each other are one damper of a half.
    """
    rows = layout.R[list(places)]
    largest = np.take_along_axis(rows, np.abs(rows).argmax(axis=1)[:, None], axis=1)[:, 0] if len(rows) else np.zeros(0)
    shapes: dict[bytes, int] = {}
    first, image, ratio = [], np.zeros(len(rows), dtype=np.intp), np.zeros(len(rows))
    for i in np.flatnonzero(largest).tolist():
        shape = np.round(rows[i] / largest[i], _DIGITS) + 0.0  # No zero below zero, which would be another shape.
        image[i] = shapes.setdefault(shape.tobytes(), len(shapes))
        if image[i] == len(first):
            first.append(i)
        ratio[i] = (largest[i] / largest[first[image[i]]]) ** 2
    return rows[first].T, image, ratio


def common_ratio(c: Array, k: Array) -> float:
    """Return the damping per stiffness that most share."""
    stiff = k > 0.0
    ratios = np.sort(c[stiff] / k[stiff])
    return float(ratios[len(ratios) // 2]) if len(ratios) else 0.0
