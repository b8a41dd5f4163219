"""Gauss-Legendre collocation: coefficients, and the polynomials that continue a step between its nodes."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.polynomial import legendre

from boomctl.arrays import Array


@dataclass(frozen=True)
class GaussMethod:
    """Collocation in the s Gauss points of a step, of order 2 s (Hairer & Wanner 1996, IV.5).

    Attributes
    ----------
    nodes : ndarray, s
        Of the step [0, 1].
    weights : ndarray, s
    A, A_inverse : ndarray, s x s
        Integrals of the Lagrange polynomials from 0 to each node, and their inverse.
    carry : ndarray, s
        ``weights A^-1``: the end value of what has the stage values V and starts at 0 is ``carry V``.
    coefficients : ndarray, (s + 2) x (s + 2)
        From the values at 0, at the nodes and at 1 to Legendre coefficients on [-1, 1].
    """

    nodes: Array
    weights: Array
    A: Array
    A_inverse: Array
    carry: Array
    coefficients: Array

    @property
    def stages(self) -> int:
        """Number of nodes s."""
        return self.nodes.size


@lru_cache(maxsize=16)
def gauss_method(stages: int) -> GaussMethod:
    """Return the collocation method with a number of stages."""
    points, weights = legendre.leggauss(stages)
    values = legendre.legvander(points, stages - 1)
    to_coefficients = np.linalg.inv(values)
    A = 0.5 * integrated_legendre(points, stages - 1) @ to_coefficients
    A_inverse = np.linalg.inv(A)
    everywhere = np.concatenate([[-1.0], points, [1.0]])
    coefficients = np.linalg.inv(legendre.legvander(everywhere, stages + 1))
    return GaussMethod(0.5 * (points + 1.0), 0.5 * weights, A, A_inverse, 0.5 * weights @ A_inverse, coefficients)


def integrated_legendre(x: Array, degree: int) -> Array:
    """Integrals from -1 to x of the Legendre polynomials up to a degree, shape of x + (degree + 1,)."""
    values = legendre.legvander(x, degree + 1)
    result = np.empty((*np.shape(x), degree + 1))
    result[..., 0] = x + 1.0
    for m in range(1, degree + 1):
        result[..., m] = (values[..., m + 1] - values[..., m - 1]) / (2 * m + 1)
    return result
