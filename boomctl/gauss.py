"""Collocation in Gauss points: coefficients, and the polynomials that continue a step between its nodes."""

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from numpy.polynomial import legendre

from boomctl.arrays import Array


@dataclass(frozen=True, eq=False)
class CollocationMethod:
    """Collocation of ``x' = f`` in s nodes of a step (Hairer & Wanner 1996, IV.5).

    Attributes
    ----------
    nodes : ndarray, s
        Of the step [0, 1].
    weights : ndarray, s
        Integrals of the Lagrange polynomials over the step.
    A : ndarray, s x s
        Integrals of the Lagrange polynomials from 0 to each node.
    """

    nodes: Array
    weights: Array
    A: Array

    @property
    def stages(self) -> int:
        """Number of nodes s."""
        return self.nodes.size

    @cached_property
    def A_inverse(self) -> Array:
        """Inverse of A: derivatives at the nodes of what has given values there and starts at 0, s x s."""
        return np.linalg.inv(self.A)

    @cached_property
    def carry(self) -> Array:
        """``weights A^-1``: the end value of what has the stage values V and starts at 0 is ``carry V``, s."""
        return self.weights @ self.A_inverse

    @cached_property
    def coefficients(self) -> Array:
        """From the values at 0, at the nodes and at 1 to Legendre coefficients on [-1, 1], (s + 2) x (s + 2)."""
        points = np.concatenate([[-1.0], 2.0 * self.nodes - 1.0, [1.0]])
        return np.linalg.inv(legendre.legvander(points, self.stages + 1))

    @cached_property
    def terms(self) -> Array:
        """From the values at the nodes to Legendre coefficients on [-1, 1] of the polynomial through them, s x s."""
        return np.linalg.inv(legendre.legvander(2.0 * self.nodes - 1.0, self.stages - 1))

    @cached_property
    def highest(self) -> Array:
        """From the values at the nodes to those of the two highest Legendre terms there, s x s."""
        return np.linalg.inv(self.terms)[:, -2:] @ self.terms[-2:]

    @cached_property
    def onward(self) -> Array:
        """From the values at the nodes to those of the same polynomial at the nodes of the next step, s x s."""
        return legendre.legvander(2.0 * self.nodes + 1.0, self.stages - 1) @ self.terms


@lru_cache(maxsize=64)
def gauss_method(stages: int) -> CollocationMethod:
    """Return collocation in the Gauss points, of order 2 s; nodes and weights are those of Gauss-Legendre quadrature."""
    points, weights = legendre.leggauss(stages)
    return CollocationMethod(0.5 * (points + 1.0), 0.5 * weights, 0.5 * lagrange_integrals(points, points))


def lagrange_integrals(nodes: Array, at: Array) -> Array:
    """Integrals from -1 to each of m places of the Lagrange polynomials through n nodes on [-1, 1], m x n."""
    degree = nodes.size - 1
    return integrated_legendre(at, degree) @ np.linalg.inv(legendre.legvander(nodes, degree))


def integrated_legendre(x: Array, degree: int) -> Array:
    """Integrals from -1 to x of the Legendre polynomials up to a degree, shape of x + (degree + 1,)."""
    values = legendre.legvander(x, degree + 1)
    result = np.empty((*np.shape(x), degree + 1))
    result[..., 0] = x + 1.0
    for m in range(1, degree + 1):
        result[..., m] = (values[..., m + 1] - values[..., m - 1]) / (2 * m + 1)
    return result
