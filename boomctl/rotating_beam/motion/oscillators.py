"""Oscillators under forces that are polynomials on each of m equal steps: their motion is exact, however fast they are.

``z'' + 2 sigma z' + (sigma^2 + omega^2) z = F(t)`` is ``u' = l u + F`` with ``l = -sigma + i omega`` and
``u = z' - conj(l) z``: ``z = Im u / omega``, ``z' = Re u - sigma z``. A slow oscillator's answer to the Lagrange
polynomials of the nodes is integrated by quadrature; a fast one's is a polynomial, which the derivatives of the force
give, and a vibration. The first oscillator of all is a free mass, ``z'' = F``: there ``u = z' + i z`` stands for the two.

Leading axes are windows (b of them) and oscillators (1 + n); forces are b x (1 + n) x m x s in the s Gauss nodes.
"""

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.polynomial import legendre

from boomctl.arrays import Array
from boomctl.gauss import gauss_method

FAST = 16.0  # phase in a step above which a force's derivatives give the answer: ten of them then lose one digit
_POINTS = 22  # Gauss points of the quadrature below that phase: exact to rounding for exp(16 i) times degree 11


class Oscillators(NamedTuple):
    """Oscillators beside the free mass.

    Attributes
    ----------
    sigma, omega : ndarray, b x n
        Decay rates, 1/s, and frequencies, rad/s.
    damped : bool
        Whether any sigma is not zero.
    """

    sigma: Array
    omega: Array
    damped: bool

    def take(self, which: Array) -> "Oscillators":
        """The oscillators of some of the windows."""
        return Oscillators(self.sigma[which], self.omega[which], self.damped)

    def turning(self, times: Array) -> Array:
        """``exp(l t)`` at times of shape b x ..., b x n x ... ."""
        shape = (*self.omega.shape, *(1,) * (times.ndim - 1))
        angle = self.omega.reshape(shape) * times[:, None]
        turned: Array = np.empty(angle.shape, dtype=complex)
        np.cos(angle, out=turned.real)
        np.sin(angle, out=turned.imag)
        if self.damped:
            turned *= np.exp(-self.sigma.reshape(shape) * times[:, None])
        return turned

    def coordinates(self, u: Array) -> tuple[Array, Array]:
        """Coordinates and rates of ``u``, b x (1 + n) x ... ."""
        shape = (*self.omega.shape, *(1,) * (u.ndim - 2))
        z, rate = u.imag.copy(), u.real.copy()
        z[:, 1:] /= self.omega.reshape(shape)
        if self.damped:
            rate[:, 1:] -= self.sigma.reshape(shape) * z[:, 1:]
        return z, rate

    def states(self, z: Array, rate: Array) -> Array:
        """``u`` of coordinates and rates, b x (1 + n) each."""
        u = rate + 1j * z
        u[:, 1:] = rate[:, 1:] + (self.sigma + 1j * self.omega) * z[:, 1:]
        return u


class Flow(NamedTuple):
    """Motion of oscillators over m equal steps.

    Attributes
    ----------
    to_nodes : ndarray, b x (1 + n) x (s + 2) x 2 s
        From forces at the nodes, Re u and Im u at a step's start to coordinates and rates at the nodes. The free
        vibration of a fast oscillator is left out: between the nodes it turns too often to be seen in them.
    to_end : ndarray, b x (1 + n) x s x 2
        Re u and Im u at a step's end by the forces, from rest.
    resting : ndarray, b x n x s x 2
        Likewise at a step's start if a fast oscillator does not vibrate; zero for the others.
    fast : ndarray of bool, b x n
    any_fast : bool
    turns, back : complex ndarray, b x n x (m + 1)
        ``exp(l t)`` at the ends of the steps, and its inverse.
    h : ndarray, b
        Length of a step, s.
    """

    to_nodes: Array
    to_end: Array
    resting: Array
    fast: Array
    any_fast: bool
    turns: Array
    back: Array
    h: Array

    def states(self, force: Array, start: Array, impulses: Array | None = None) -> Array:
        """``u`` at the ends of the steps from ``u`` before the first, b x (1 + n) x (m + 1).

        Impulses act at the ends of the steps, in the same shape: the states are those after them.
        """
        gained = _complex(force @ self.to_end)
        if impulses is not None:
            start = start + impulses[..., 0]
            gained += impulses[..., 1:]
        u: Array = np.empty((*gained.shape[:2], gained.shape[2] + 1), dtype=complex)
        u[..., 0] = start
        vibrating: Array = u[:, 1:, 1:]
        np.add.accumulate(gained[:, 1:] * self.back[..., 1:], axis=-1, out=vibrating)
        vibrating += start[:, 1:, None]
        vibrating *= self.turns[..., 1:]
        speed, place = u[:, 0].real, u[:, 0].imag
        np.add.accumulate(gained[:, 0].real, axis=-1, out=speed[:, 1:])
        speed[:, 1:] += speed[:, :1]
        np.add.accumulate(gained[:, 0].imag + self.h[:, None] * speed[:, :-1], axis=-1, out=place[:, 1:])
        place[:, 1:] += place[:, :1]
        return u

    def vibrations(self, force: Array, u: Array) -> Array:
        """Free vibrations of the fast oscillators at the beginning of each step, as ``u``, b x n x m."""
        free: Array = u[:, 1:, :-1] - _complex(force[:, 1:] @ self.resting)
        free[~self.fast] = 0.0
        return free

    def beginning(self, free: Array) -> Array:
        """Of these vibrations the rates that begin with each step; and at the last one's end they are taken off."""
        rates = np.zeros((*free.shape[:2], free.shape[2] + 1))
        rates[..., :-1] = np.real(free)
        rates[..., 1:] -= np.real(self.turns[..., 1:2] * free)
        return rates

    def at_nodes(self, force: Array, u: Array) -> tuple[Array, Array]:
        """Coordinates and rates at all nodes, b x (1 + n) x (m s) each."""
        b, size, m, s = force.shape
        known = np.empty((b, size, m, s + 2))
        known[..., :s] = force
        known[..., s], known[..., s + 1] = u.real[..., :-1], u.imag[..., :-1]
        both = known @ self.to_nodes
        return both[..., :s].reshape(b, size, m * s), both[..., s:].reshape(b, size, m * s)


def flow(oscillators: Oscillators, h: Array, steps: int, stages: int) -> Flow:
    """Return the motion over equal steps.

    Parameters
    ----------
    oscillators : Oscillators
    h : ndarray, b
        Length of a step, s.
    steps, stages : int
        Numbers m of steps and s of nodes.
    """
    (b, n), s = oscillators.omega.shape, stages
    fast = oscillators.omega * h[:, None] > FAST
    by_force = responses(oscillators, h, stages, FAST)
    z, rate = oscillators.coordinates(by_force[:, :, 1:-1])
    turned = oscillators.turning(h[:, None] * gauss_method(s).nodes)
    turned[fast] = 0.0
    to_nodes = np.empty((b, 1 + n, s + 2, 2 * s))
    to_nodes[:, :, :s, :s], to_nodes[:, :, :s, s:] = z.swapaxes(2, 3), rate.swapaxes(2, 3)
    to_nodes[:, 0, s:, :s] = np.stack([np.multiply.outer(h, gauss_method(s).nodes), np.ones((b, s))], axis=1)
    to_nodes[:, 0, s:, s:] = np.array([[1.0], [0.0]])
    for row, free in ((s, turned), (s + 1, 1j * turned)):
        z = free.imag / oscillators.omega[..., None]
        to_nodes[:, 1:, row, :s], to_nodes[:, 1:, row, s:] = z, free.real - oscillators.sigma[..., None] * z
    turns = oscillators.turning(h[:, None] * np.arange(steps + 1))
    back = 1.0 / turns if oscillators.damped else turns.conj()
    to_end, resting = by_force[:, :, -1], by_force[:, 1:, 0]
    to_end[:, 1:] -= turns[..., 1:2] * resting
    return Flow(to_nodes, _pairs(to_end), _pairs(resting), fast, bool(fast.any()), turns, back, h)


def _pairs(u: Array) -> Array:
    return np.stack([u.real, u.imag], axis=-1)


def _complex(pairs: Array) -> Array:
    """Real and imaginary parts along the last axis as complex numbers."""
    return pairs.view(complex)[..., 0]


def responses(oscillators: Oscillators, h: Array, stages: int, smooth_above: float) -> Array:
    """Return what forces at the nodes of a step do: ``u`` at its start, nodes and end, b x (1 + n) x (s + 2) x s.

    Parameters
    ----------
    oscillators, h, stages
        As for `flow`.
    smooth_above : float
        Oscillators of a larger phase in a step are given the motion that has no vibration; all others start from rest.
    """
    (b, n), table = oscillators.omega.shape, _table(stages)
    result = np.zeros((b, 1 + n, stages + 2, stages), dtype=complex)
    result[:, 0].real = h[:, None, None] * table.pushed
    result[:, 0].imag = (h * h)[:, None, None] * table.moved
    vibrating = result[:, 1:]
    rate = (-oscillators.sigma + 1j * oscillators.omega) * h[:, None]
    slow = oscillators.omega * h[:, None] <= smooth_above
    kernel = np.exp(rate[slow][:, None] * table.ahead.ravel()).reshape(-1, *table.ahead.shape)
    vibrating[slow, 1:] = (kernel.swapaxes(0, 1) @ table.quadrature).swapaxes(0, 1)
    if not slow.all():
        powers = -((1.0 / rate[~slow])[:, None] ** np.arange(1, stages + 1))
        vibrating[~slow] = (powers @ table.derivatives.reshape(stages, -1)).reshape(-1, stages + 2, stages)
    vibrating *= h[:, None, None, None]
    return result


class _Table(NamedTuple):
    """Of the Lagrange polynomials of s nodes, at the places start, nodes and end of a step of unit length.

    Attributes
    ----------
    ahead : ndarray, (s + 1) x p
        Distance from the quadrature's points to each place but the start.
    quadrature : ndarray, (s + 1) x p x s
        Polynomials times weights in these points.
    derivatives : ndarray, s x (s + 2) x s
        Derivatives at all places, from the value on.
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
    places = np.array([0.0, *nodes, 1.0])
    to_terms = np.linalg.inv(legendre.legvander(2.0 * nodes - 1.0, stages - 1))
    points = np.multiply.outer(places[1:], gauss.nodes)
    quadrature = (legendre.legvander(2.0 * points - 1.0, stages - 1) @ to_terms) * (
        np.multiply.outer(places[1:], gauss.weights)[..., None]
    )
    ahead = places[1:, None] - points
    derivatives = np.zeros((stages, places.size, stages))
    terms = to_terms
    for item in derivatives:
        item[:] = legendre.legval(2.0 * places - 1.0, terms).T
        terms = 2.0 * legendre.legder(terms)
    start = np.zeros((1, stages))
    pushed = np.concatenate([start, quadrature.sum(axis=1)])
    moved = np.concatenate([start, np.einsum("kp,kps->ks", ahead, quadrature)])
    return _Table(ahead, quadrature, derivatives, pushed, moved)
