"""Small dense quadratic programmes, by a primal-dual interior-point method (Mehrotra 1992)."""

import numpy as np
from scipy.linalg import lapack

from boomctl.arrays import Array

_STEPS = 60  # of Newton's method at most: a dozen are the rule
_ENOUGH = 1e-11  # complementarity and residuals, relative, at which it ends
_RIDGE = 1e-14  # share of the diagonal that is added to it: less than its rounding costs (a choice)
_NO_ROW = 1e-12  # share of the longest row below which a row bounds nothing, and is not made longer (a choice)
_BACK = 0.995  # share of the way to the boundary that a step takes (a choice, as usual)


def least(H: Array, c: Array, G: Array, h: Array) -> tuple[Array, Array]:
    """Return ``y`` that makes ``1/2 y^T H y + c^T y`` least under ``G y <= h``, and the multipliers of the rows of ``G``.

    ``H`` is positive semidefinite, and positive definite where ``G`` does not bound.  The problem must have a point at
    which all rows are below.
    """
    n, m = len(c), len(h)
    size = np.linalg.norm(G, axis=1)
    size = np.maximum(size, max(_NO_ROW * float(size.max(initial=0.0)), np.finfo(float).tiny))
    G, h = G / size[:, None], h / size
    y, s, z = np.zeros(n), np.maximum(h, 1.0), np.ones(m)
    scale = 1.0 + max(float(np.abs(c).max(initial=0.0)), float(np.abs(h).max(initial=0.0)))
    for _ in range(_STEPS):
        dual, primal = H @ y + c + G.T @ z, G @ y + s - h
        mu = float(s @ z) / m
        if mu <= _ENOUGH * scale and max(np.abs(dual).max(initial=0.0), np.abs(primal).max()) <= _ENOUGH * scale:
            break
        matrix = H + (G.T * (z / s)) @ G
        diagonal = matrix.reshape(-1)[:: n + 1]
        diagonal += _RIDGE * (1.0 + diagonal)
        factor, wrong = lapack.dpotrf(matrix)  # SciPy's own wrapping takes longer than such small factors
        if wrong:
            break

        # ds = -primal - G dy;  dz = (target - z ds)/s - z
        def direction(target: Array) -> tuple[Array, Array, Array]:
            right = -dual - G.T @ ((target + z * primal) / s - z)  # noqa: B023
            dy = lapack.dpotrs(factor, right)[0]  # noqa: B023
            ds = -primal - G @ dy  # noqa: B023
            dz = (target - z * ds) / s - z  # noqa: B023
            return dy, ds, dz

        dy, ds, dz = direction(np.zeros(m))
        a, b = _longest(s, ds), _longest(z, dz)
        after = float((s + a * ds) @ (z + b * dz)) / m
        centre = (after / mu) ** 3
        dy, ds, dz = direction(centre * mu - ds * dz)
        a = b = min(_longest(s, ds), _longest(z, dz)) * _BACK
        y, s, z = y + a * dy, s + a * ds, z + b * dz
    return y, z / size


def _longest(values: Array, change: Array) -> float:
    steepest = float((-change / values).max())
    return 1.0 / steepest if steepest > 1.0 else 1.0
