"""Small dense quadratic programmes, by a primal-dual interior-point method (Mehrotra 1992)."""

from math import inf

import numpy as np
from scipy.linalg import lapack

from boomctl.arrays import Array
from boomctl.lti.rounding import TINY

_STEPS = 60  # of Newton's method at most: a dozen are the rule
_ENOUGH = 1e-11  # complementarity and residuals, relative, at which it ends
_ROOM = 1e-3  # below rows that are met at which it begins: it then takes fewer steps than from one (measured)
_NEARLY = 1e-7  # residual, relative, from which on it ends where rounding keeps it from halving (a choice)
_RIDGE = 1e-14  # share of the diagonal that is added to it: less than its rounding costs (a choice)
_NO_ROW = 1e-12  # share of the longest row below which a row bounds nothing, and is not made longer (a choice)
_BACK = 0.995  # share of the way to the boundary that a step takes (a choice, as usual)


def least(H: Array, c: Array, G: Array, h: Array) -> tuple[Array, Array]:
    """Return ``y`` that makes ``1/2 y^T H y + c^T y`` least under ``G y <= h``, and the multipliers of the rows of ``G``.

    ``H`` is positive semidefinite, and positive definite where ``G`` does not bound.  The problem must have a point at
    which all rows are below.
    """
    n, m = len(c), len(h)
    size = np.sqrt((G * G).sum(axis=1))
    size = np.maximum(size, max(_NO_ROW * float(size.max(initial=0.0)), TINY))
    G, h = G / size[:, None], h / size
    y, s, z = np.zeros(n), np.maximum(h, _ROOM), np.ones(m)
    scale = 1.0 + max(float(np.abs(c).max(initial=0.0)), float(np.abs(h).max(initial=0.0)))
    last = inf
    for _ in range(_STEPS):
        slope, primal, products = H @ y + c, G @ y + s - h, s * z
        mu = float(products.sum()) / m
        if mu <= _ENOUGH * scale:
            residual = max(float(np.abs(primal).max()), float(np.abs(slope + z @ G).max(initial=0.0)))
            if residual <= _ENOUGH * scale or 0.5 * last < residual <= _NEARLY * scale:
                break
            last = residual
        weights = z / s
        matrix = H + (G.T * weights) @ G
        diagonal = matrix.reshape(-1)[:: n + 1]
        diagonal += _RIDGE * (1.0 + diagonal)
        factor, wrong = lapack.dpotrf(matrix)  # SciPy's own wrapping takes longer than such small factors
        if wrong:
            break
        # with the target zero: ds = -s gone and dz = z (gone - 1)
        right = -slope - (weights * primal) @ G
        gone = (primal + G @ lapack.dpotrs(factor, right)[0]) / s
        left = 1.0 - gone
        a, b = _longest(float(gone.max())), _longest(float(left.max()))
        after = float((products * (1.0 - a * gone)) @ (1.0 - b * left)) / m
        # with the target that centres: ds = -back, dz = target/s + z/s back - z
        target = ((after / mu) ** 3 * mu - products * gone * left) / s
        dy = lapack.dpotrs(factor, right - target @ G)[0]
        back = primal + G @ dy
        dz = target + weights * back - z
        a = _BACK * _longest(max(float((back / s).max()), float((-dz / z).max())))
        y, s, z = y + a * dy, s - a * back, z + a * dz
    return y, z / size


def _longest(steepest: float) -> float:
    """Return how far to go, one at most, where so large a share of what is left goes in a step of one."""
    return 1.0 / steepest if steepest > 1.0 else 1.0
