"""A motion as the collocation leaves it: values at the ends of the steps and polynomials between."""

from dataclasses import dataclass

import numpy as np
from numpy.polynomial import legendre

from boomctl.arrays import Array
from boomctl.gauss import CollocationMethod, integrated_legendre


@dataclass(frozen=True)
class Trajectory:
    """Coordinates and rates over m steps.

    Attributes
    ----------
    method : CollocationMethod
    edges : ndarray, m + 1
        Ends of the steps, s.
    q, v : ndarray, (m + 1) x n
        Coordinates and rates at the ends.
    stages : ndarray, m x s x n
        Rates at the nodes.
    """

    method: CollocationMethod
    edges: Array
    q: Array
    v: Array
    stages: Array

    def __call__(self, timepts: Array) -> tuple[Array, Array]:
        """Coordinates and rates at instants within the steps, each k x n.

        The rates are interpolated between ends and nodes; the coordinates are the integral of that, so that both agree
        with the values at the ends.
        """
        timepts = np.asarray(timepts, dtype=float)
        step = np.clip(np.searchsorted(self.edges, timepts, side="right") - 1, 0, self.edges.size - 2)
        length = np.diff(self.edges)
        place = 2.0 * (timepts - self.edges[step]) / length[step] - 1.0
        coefficients = self._rate_coefficients()[step]
        degree = self.method.stages + 1
        v = np.einsum("kj,kjn->kn", legendre.legvander(place, degree), coefficients)
        moved = np.einsum("kj,kjn->kn", integrated_legendre(place, degree), coefficients)
        return self.q[step] + 0.5 * length[step, None] * moved, v

    def end(self) -> tuple[Array, Array]:
        """Coordinates and rates at the end of the last step."""
        return self.q[-1], self.v[-1]

    def at_places(self, places: tuple[float, ...]) -> Array:
        """Coordinates at the same places of every step, given on [0, 1]; steps x places x n."""
        moved = integrated_legendre(2.0 * np.array(places) - 1.0, self.method.stages + 1)
        length = np.diff(self.edges)[:, None, None]
        return self.q[:-1, None] + 0.5 * length * (moved @ self._rate_coefficients())

    def highest_terms(self) -> Array:
        """What the two highest Legendre terms of its rates move each coordinate in a step, m x n."""
        highest = np.abs(self._rate_coefficients()[:, -2:]).max(axis=1)
        return 0.5 * np.diff(self.edges)[:, None] * highest

    def stage_rates(self, edges: Array) -> Array:
        """Rates at the nodes of other steps over the same time, for a finer solution to start from."""
        nodes = edges[:-1, None] + np.diff(edges)[:, None] * self.method.nodes
        _, v = self(nodes.ravel())
        return v.reshape(*nodes.shape, -1)

    def _rate_coefficients(self) -> Array:
        values = np.concatenate([self.v[:-1, None], self.stages, self.v[1:, None]], axis=1)
        return self.method.coefficients @ values
