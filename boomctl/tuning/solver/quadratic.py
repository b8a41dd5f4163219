"""Small dense quadratic programmes, by least squares with numbers that are not negative (Lawson & Hanson 1974)."""

import numpy as np
from scipy.linalg import lapack
from scipy.optimize import nnls

from boomctl.arrays import Array
from boomctl.lti.rounding import TINY

_ROUNDS = 60  # at most: two or three are the rule
_CURVED = (
    1e-2  # curvature that is lent to variables without any: of larger ones more rounds, of smaller ones fewer digits
)
_ENOUGH = 1e-11  # slope that this leaves, relative to the costs, at which it ends
_NO_ROW = 1e-12  # share of the longest row below which a row bounds nothing, and is not made longer (a choice)


def least(H: Array, c: Array, G: Array, h: Array, give: float = 0.0) -> tuple[Array, Array]:
    """Return ``y`` that makes ``1/2 y^T H y + c^T y`` least under ``G y <= h``, and the multipliers of the rows of ``G``.

    In coordinates in which all directions curve alike it is the point of a polyhedron that is nearest to the one without
    rows: its multipliers solve a problem of least squares.  What does not curve is lent some curvature around where it was
    last, in turn until that costs nothing.

    ``H`` is positive definite but for variables that do not curve at all, which rows bound.  The problem must have a point at
    which all rows are met.  Rows, made of length one, may be exceeded by ``give`` times their multipliers.
    """
    n, m = len(c), len(h)
    size = np.sqrt((G * G).sum(axis=1))
    size = np.maximum(size, max(_NO_ROW * float(size.max(initial=0.0)), TINY))
    G, h, y, z = G / size[:, None], h / size, np.zeros(n), np.zeros(m)
    lent = np.where(H.diagonal() == 0.0, _CURVED, 0.0)
    root, wrong = lapack.dpotrf(H + np.diag(lent), lower=1)
    if wrong:
        return y, z
    rows, end = np.zeros((n + 1 + m, m)), np.zeros(n + 1 + m)
    rows[:n], end[n] = -lapack.dtrtrs(root, G.T, lower=1)[0], 1.0
    rows[n + 1 :] = give**0.5 * np.eye(m)
    for _ in range(_ROUNDS):
        free = lapack.dtrtrs(root, -(H @ y + c), lower=1)[0]  # the step without rows
        rows[n] = G @ y - h - free @ rows[:n]
        if not np.isfinite(rows).all():
            break
        try:
            found = nnls(rows, end)[0]
        except RuntimeError:  # it went on too long
            break
        z = found / (end[n] - rows[n] @ found)
        step = lapack.dtrtrs(root, free + rows[:n] @ z, lower=1, trans=1)[0]
        y = y + step
        if float(np.abs(lent * step).max(initial=0.0)) <= _ENOUGH * float(np.abs(c).max(initial=0.0)):
            break
    return y, z / size
