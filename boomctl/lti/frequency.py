"""Singular values of small matrices at many frequencies."""

import numpy as np

from boomctl.arrays import Array

_NEARLY_EQUAL = 1e-5


def singular_values(G: Array) -> Array:
    """Return the singular values of ``G[:, :, f]``, descending, shape (min(p, m), N).

    One row or column: its length.  Two by two: in closed form, but for the frequencies at which the two values nearly
    meet, where the closed form loses half of the digits.  Otherwise LAPACK.
    """
    p, m, _ = G.shape
    if min(p, m) == 0:
        return np.zeros((0, G.shape[2]))
    if min(p, m) == 1:
        return np.sqrt((G.real**2 + G.imag**2).sum(axis=(0, 1)))[None, :]
    if (p, m) != (2, 2):
        return np.linalg.svd(np.moveaxis(G, 2, 0), compute_uv=False).T
    total = (G.real**2 + G.imag**2).sum(axis=(0, 1))
    product = np.abs(G[0, 0] * G[1, 1] - G[0, 1] * G[1, 0])
    gap = total - 2.0 * product
    first = 0.5 * (np.sqrt(total + 2.0 * product) + np.sqrt(np.maximum(gap, 0.0)))
    with np.errstate(invalid="ignore", divide="ignore"):
        values = np.array([first, np.where(first > 0.0, product / first, 0.0)])
    near = gap < _NEARLY_EQUAL * total
    if near.any():
        values[:, near] = np.linalg.svd(np.moveaxis(G[:, :, near], 2, 0), compute_uv=False).T
    return values
