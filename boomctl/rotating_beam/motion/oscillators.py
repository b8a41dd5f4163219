"""Oscillators under forces that are polynomials on each of m equal steps: their motion is exact, however fast they are.

``z'' + 2 sigma z' + (sigma^2 + omega^2) z = F(t)`` is ``u' = l u + F`` with ``l = -sigma + i omega`` and
``u = z' - conj(l) z``: ``z = Im u / omega``, ``z' = Re u - sigma z``. A slow oscillator's answer to the Lagrange
polynomials of the nodes is integrated by quadrature; a fast oscillator's is the sum of a polynomial, from derivatives of
the force, and a vibration. The first oscillator of a window is a free mass, ``z'' = F``, with ``u = z' + i z``, as if l
were i.

Axes are oscillators (1 + n, with the free mass), motions k that are integrated at once, steps m and nodes s; functions of
rates take further axes in front.
"""

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.polynomial import legendre

from boomctl.arrays import Array
from boomctl.gauss import gauss_method

FAST = 16.0  # Phase in a step above which the response follows from derivatives of the force: ten lose one digit.
_POINTS = 22  # Gauss points of the quadrature below this phase: exact to rounding for exp(16 i) times degree 11.


def turning(rates: Array, times: Array) -> Array:
    """``exp(l t)`` of rates l, ... x n, at times, ... x k; ... x n x k."""
    angle = rates.imag[..., None] * times[..., None, :]
    turned: Array = np.empty(angle.shape, dtype=complex)
    np.cos(angle, out=turned.real)
    np.sin(angle, out=turned.imag)
    if rates.real.any():
        turned *= np.exp(rates.real[..., None] * times[..., None, :])
    return turned


def coordinates(rates: Array, u: Array) -> tuple[Array, Array]:
    """Coordinates and rates of ``u``, ... x n and further axes, of oscillators of rates l, ... x n."""
    known = rates.reshape(*rates.shape, *(1,) * (u.ndim - rates.ndim))
    z = u.imag / known.imag
    return z, u.real + known.real * z


class Flow(NamedTuple):
    """Motion of oscillators over m equal steps.

    Attributes
    ----------
    to_nodes : ndarray, 2 x (1 + n) x 1 x (s + 2) x s
        From forces at the nodes, Re u and Im u at a step's start to coordinates, and to rates, at the nodes. The free
        vibration of a fast oscillator is omitted: the nodes do not resolve it.
    to_end : ndarray, (1 + n) x 1 x s x 2
        Re u and Im u at a step's end by the forces, from rest.
    resting : ndarray, n x 1 x s x 2
        Re u and Im u at a step's start for which a fast oscillator does not vibrate; zero for the others.
    fast : ndarray of bool, n
    turns, back : complex ndarray, n x 1 x (m + 1)
        ``exp(l t)`` at the ends of the steps, and its inverse.
    h : float
        Length of a step, s.
    """

    to_nodes: Array
    to_end: Array
    resting: Array
    fast: Array
    turns: Array
    back: Array
    h: float

    def states(self, force: Array, start: Array, impulses: Array | None = None) -> Array:
        """``u`` at the ends of the steps from ``u`` before the first, (1 + n) x k x (m + 1).

        Impulses act at the ends of the steps, in the same shape: the states are those after them.
        """
        gained = _complex(force @ self.to_end)
        if impulses is not None:
            start = start + impulses[..., 0]
            gained += impulses[..., 1:]
        u: Array = np.empty((*gained.shape[:-1], gained.shape[-1] + 1), dtype=complex)
        u[..., 0] = start
        vibrating: Array = u[1:, :, 1:]
        np.add.accumulate(gained[1:] * self.back[..., 1:], axis=-1, out=vibrating)
        vibrating += start[1:, :, None]
        vibrating *= self.turns[..., 1:]
        speed, position = u[0].real, u[0].imag
        np.add.accumulate(gained[0].real, axis=-1, out=speed[:, 1:])
        speed[:, 1:] += speed[:, :1]
        np.add.accumulate(gained[0].imag + self.h * speed[:, :-1], axis=-1, out=position[:, 1:])
        position[:, 1:] += position[:, :1]
        return u

    def vibrations(self, force: Array, u: Array) -> Array:
        """Free vibrations of the fast oscillators at the beginning of each step, as ``u``, n x k x m."""
        free: Array = u[1:, :, :-1] - _complex(force[1:] @ self.resting)
        free[~self.fast] = 0.0
        return free

    def beginning(self, free: Array) -> Array:
        """Return the rates of these vibrations that start at each step, less those that end with the step before."""
        rates = np.zeros((*free.shape[:-1], free.shape[-1] + 1))
        rates[..., :-1] = free.real
        rates[..., 1:] -= np.real(self.turns[..., 1:2] * free)
        return rates

    def at_nodes(self, force: Array, u: Array) -> Array:
        """Coordinates and rates at all nodes, 2 x (1 + n) x (k m s)."""
        size, s = len(force), force.shape[-1]
        known = np.empty((*force.shape[:-1], s + 2))
        known[..., :s] = force
        known[..., s], known[..., s + 1] = u.real[..., :-1], u.imag[..., :-1]
        result: Array = known @ self.to_nodes
        return result.reshape(2, size, -1)


def flow(rates: Array, h: float, steps: int, stages: int) -> Flow:
    """Return the motion over equal steps.

    Parameters
    ----------
    rates : complex ndarray, 1 + n
        Of the oscillators, the free mass first.
    h : float
        Length of a step, s.
    steps, stages : int
        Numbers m of steps and s of nodes.
    """
    s, vibrating, nodes = stages, rates[1:], h * gauss_method(stages).nodes
    fast = vibrating.imag * h > FAST
    by_force = np.concatenate(
        [free_mass(h, s)[None], responses(vibrating, np.array(h), s, FAST) @ gauss_method(s).terms]
    )
    z, rate = coordinates(rates, by_force[:, 1:-1])
    turned = turning(vibrating, nodes)
    turned[fast] = 0.0
    to_nodes = np.empty((2, len(rates), s + 2, s))
    to_nodes[0, :, :s], to_nodes[1, :, :s] = z.swapaxes(1, 2), rate.swapaxes(1, 2)
    to_nodes[0, 0, s], to_nodes[0, 0, s + 1], to_nodes[1, 0, s:] = nodes, 1.0, [[1.0], [0.0]]
    to_nodes[:, 1:, s:] = coordinates(vibrating, np.stack([turned, 1j * turned], axis=1))
    turns = turning(vibrating, h * np.arange(steps + 1))
    to_end, resting = by_force[:, -1], by_force[1:, 0]
    to_end[1:] -= turns[:, 1:2] * resting
    turns = turns[:, None]
    return Flow(to_nodes[:, :, None], _pairs(to_end), _pairs(resting), fast, turns, 1.0 / turns, h)


def _pairs(u: Array) -> Array:
    return np.stack([u.real, u.imag], axis=-1)[:, None]


def _complex(pairs: Array) -> Array:
    """Real and imaginary parts along the last axis as complex numbers."""
    return pairs.view(complex)[..., 0]


def free_mass(h: float, stages: int) -> Array:
    """Return the response of the free mass to forces at a step's nodes: ``u`` at start, nodes and end, (s + 2) x s."""
    table = _table(stages)
    return (h * table.pushed + 1j * h * h * table.moved) @ gauss_method(stages).terms


def responses(rates: Array, h: Array, stages: int, smooth_above: float) -> Array:
    """Return the response to s Legendre terms of the forces: ``u`` at start, nodes and end, ... x n x (s + 2) x s.

    Parameters
    ----------
    rates : complex ndarray, ... x n
    h : ndarray, ...
        Lengths of the steps, s.
    stages : int
        Number s of nodes.
    smooth_above : float
        Oscillators of a larger phase in a step get the motion without vibration; all others start from rest.
    """
    table = _table(stages)
    turned: Array = rates * h[..., None]
    powers = np.vander(1.0 / turned.ravel(), stages + 1, increasing=True)[:, 1:] * (-turned / rates).reshape(-1, 1)
    result = (powers @ table.derivatives.reshape(stages, -1)).reshape(*rates.shape, stages + 2, stages)
    slow = turned.imag <= smooth_above
    if slow.any():
        kernel = np.exp(turned[slow][:, None] * table.ahead.ravel()).reshape(-1, *table.ahead.shape)
        result[slow, 0] = 0.0
        result[slow, 1:] = (kernel.swapaxes(0, 1) @ table.quadrature).swapaxes(0, 1)
        result[slow] *= (turned / rates)[slow, None, None]
    return result


class _Table(NamedTuple):
    """Values of s Legendre polynomials at the points start, nodes and end of a step of unit length.

    Attributes
    ----------
    ahead : ndarray, (s + 1) x p
        Distance from the quadrature's points to each point except the start.
    quadrature : ndarray, (s + 1) x p x s
        Polynomials times weights at the quadrature's points.
    derivatives : ndarray, s x (s + 2) x s
        Derivatives at all points, from order 0 on.
    pushed, moved : ndarray, (s + 2) x s
        Integrals once and twice, from the start.
    """

    ahead: Array
    quadrature: Array
    derivatives: Array
    pushed: Array
    moved: Array


@lru_cache(maxsize=8)
def _table(stages: int) -> _Table:
    nodes, gauss = gauss_method(stages).nodes, gauss_method(_POINTS)
    positions = np.array([0.0, *nodes, 1.0])
    points = np.multiply.outer(positions[1:], gauss.nodes)
    weights = np.multiply.outer(positions[1:], gauss.weights)
    quadrature = legendre.legvander(2.0 * points - 1.0, stages - 1) * weights[..., None]
    ahead = positions[1:, None] - points
    derivatives = np.zeros((stages, positions.size, stages))
    terms = np.eye(stages)
    for item in derivatives:
        item[:] = legendre.legval(2.0 * positions - 1.0, terms).T
        terms = 2.0 * legendre.legder(terms)
    start = np.zeros((1, stages))
    pushed = np.concatenate([start, quadrature.sum(axis=1)])
    moved = np.concatenate([start, np.einsum("kp,kps->ks", ahead, quadrature)])
    return _Table(ahead, quadrature, derivatives, pushed, moved)
