"""Steps in which every mode vibrates in closed form under forces that are polynomials.

With the mean of the speed squared over a step the beam's modes are decoupled, ``z'' + Omega^2 z = F(t)``: a polynomial
motion for a polynomial F, and a free vibration. F holds the hub's acceleration and what the speed's deviation from its
mean couples the modes by; it is given in the Gauss points of the step. The deviation is weak, so that these forces
settle in a few sweeps; where they do not, they are solved for.
"""

from functools import lru_cache
from math import perm
from typing import NamedTuple

import numpy as np
from numpy.polynomial import legendre

from boomctl.arrays import Array
from boomctl.gauss import gauss_method

STAGES = 8  # nodes of a step: a choice, forces of degree 7 over nearly a period of the lowest mode
_KEPT = 6  # Legendre terms of the forces that stay when the two highest are taken as the error
_SLOW = 0.5  # angle below which a mode turns slowly in a step: polynomial and vibration would cancel, a series does not
_TERMS = 7  # of that series: what is left out is below 1e-16
_PLACES = np.array([*gauss_method(STAGES).nodes, 1.0])  # where forces act and motions are wanted: nodes and end
_SWEEPS = 10  # in which forces may settle before they are solved for: a choice
_FIRST_CHECK = 4  # sweep after which it is first asked whether they have settled: a choice, the question takes time too
_SETTLED = 1e-11  # last change of settled forces, relative to them: after so few sweeps a tenth of it is left


class Steps(NamedTuple):
    """Answers of m steps, modal: to start coordinates, start rates and, last, the hub's acceleration.

    Attributes
    ----------
    force : ndarray, m x n x s x (2 n + 1)
        Modal forces at the nodes.
    ends : ndarray, m x n x 2 x (2 n + 1)
        Coordinates and rates at the end.
    end_by_force : ndarray, m x n x 2 x s
        Coordinates and rates at the end by the forces at the nodes.
    """

    force: Array
    ends: Array
    end_by_force: Array


def solve_steps(omega: Array, h: Array, push: Array, remainder: Array, coupling: Array) -> Steps:
    """Solve every step for its answers.

    Parameters
    ----------
    omega : ndarray, m x n
        Frequencies of the modes of each step, rad/s.
    h : ndarray, m
        Lengths of the steps, s.
    push : ndarray, m x n x s
        Modal forces at the nodes by the hub's acceleration.
    remainder : ndarray, m x s
        Speed squared at the nodes less its mean.
    coupling : ndarray, m x n x n
        Modal stiffness that goes with it.
    """
    (m, n), s = omega.shape, STAGES
    angle = omega[..., None] * (h[:, None] * _PLACES)[:, None]
    cosine, sine = np.cos(angle), np.sin(angle)
    to_place, end_by_force = _by_force(omega, angle[..., s], cosine, sine)
    to_nodes = to_place[:, :, :s]
    free = np.zeros((m, n, s, 2 * n + 1))
    sine /= omega[..., None]
    _diagonal(free[..., :n])[...] = cosine[..., :s]
    _diagonal(free[..., n:-1])[...] = sine[..., :s]
    pushed = (to_nodes @ push[..., None])[..., 0]
    size = max(float(pushed.max()), -float(pushed.min())) or 1.0
    np.divide(pushed, size, out=free[..., -1])
    force = _forces(to_nodes, remainder, coupling, free)
    force[..., -1] *= size
    force[..., -1] += push
    ends = end_by_force @ force
    for rate, columns, share in (
        (0, slice(0, n), cosine[..., s]),
        (0, slice(n, -1), sine[..., s]),
        (1, slice(0, n), -sine[..., s] * omega**2),
        (1, slice(n, -1), cosine[..., s]),
    ):
        diagonal = _diagonal(ends[:, :, rate : rate + 1, columns])
        diagonal += share[..., None]
    return Steps(force, ends, end_by_force)


def polynomial_motion(omega: Array, h: Array, force: Array) -> Array:
    """Coefficients of the polynomial part of each mode in powers of the place on a step, m x n x s or more.

    Parameters
    ----------
    omega, h
        As for `solve_steps`.
    force : ndarray, m x n x s
        Modal forces at the nodes.
    """
    table, phase = _table(), omega * h[:, None]
    powers = _times(force, table.to_powers.T)
    derivatives = _times(powers, table.derivatives).reshape(*omega.shape, -1, STAGES)
    result: Array = (_scales(omega, phase)[:, :, None] @ derivatives)[:, :, 0]
    slow = phase < _SLOW
    if not slow.any():
        return result
    width = STAGES + 2 * _TERMS
    wide = np.zeros((*omega.shape, width))
    wide[..., :STAGES] = result
    integrals = (powers[slow] @ table.integrals).reshape(-1, _TERMS, width)
    wide[slow] = (_slow_scales(omega[slow], phase[slow])[:, None] @ integrals)[:, 0]
    return wide


def highest_terms(force: Array) -> Array:
    """The two highest Legendre terms of forces given at the nodes, in the nodes; shape of `force`."""
    return _times(force, _table().highest.T)


def leading_terms(force: Array) -> tuple[Array, Array]:
    """Sizes of the two highest Legendre terms of forces given at the nodes, and of the two before; the latter first."""
    terms = np.abs(_times(force, _table().legendre.T))
    return terms[..., 0] + terms[..., 1], terms[..., 2] + terms[..., 3]


def _times(tensor: Array, matrix: Array) -> Array:
    """``tensor @ matrix`` in one product of matrices."""
    return (tensor.reshape(-1, tensor.shape[-1]) @ matrix).reshape(*tensor.shape[:-1], -1)


def _diagonal(tensor: Array) -> Array:
    """A view, m x n x s, of the entries of an m x n x s x n array that belong to one mode."""
    return np.einsum("mnsn->mns", tensor)


def _forces(to_nodes: Array, remainder: Array, coupling: Array, free: Array) -> Array:
    """Forces F by the coupling of the coordinates ``free + to_nodes F``, at the nodes; shape of `free`.

    The columns of `free`, motions without coupling, are to be of about one size.
    """
    m, n, s, columns = free.shape
    factor = -remainder[:, None, :, None]

    def forces(z: Array) -> Array:
        result = (coupling @ z.reshape(m, n, -1)).reshape(free.shape)
        result *= factor
        return result

    force = forces(free)
    for sweep in range(1, _SWEEPS):
        before, z = force, to_nodes @ force
        z += free
        force = forces(z)
        if sweep >= _FIRST_CHECK:
            before -= force
            if np.vdot(before, before) <= _SETTLED**2 * np.vdot(force, force):
                return force
    system = (to_nodes * remainder[:, None, None])[:, :, :, None] * coupling[:, :, None, :, None]
    system = system.reshape(m, n * s, n * s)
    system.reshape(m, -1)[:, :: n * s + 1] += 1.0
    return forces(np.linalg.solve(system, free.reshape(m, n * s, columns)))


def _by_force(omega: Array, phase: Array, cosine: Array, sine: Array) -> tuple[Array, Array]:
    """What forces at the nodes do to a mode from rest: at the places, m x n x (s + 1) x s, and at the end, m x n x 2 x s.

    To each power of the place belongs a polynomial motion, less the free vibration that starts as it does.
    """
    s, table, slow = STAGES, _table(), phase < _SLOW
    motions = _scales(omega, phase) @ table.motions
    if slow.any():
        motions[slow] = _slow_scales(omega[slow], phase[slow]) @ table.slow_motions
    motions = motions.reshape(*omega.shape, s + 4, s)
    start, start_slope = motions[:, :, s + 1], motions[:, :, s + 2] / phase[..., None]
    to_place = motions[:, :, : s + 1] - cosine[..., None] * start[:, :, None]
    to_place -= sine[..., None] * start_slope[:, :, None]
    rate = motions[:, :, s + 3] / phase[..., None] + sine[..., s, None] * start - cosine[..., s, None] * start_slope
    ends = np.empty((*omega.shape, 2, s))
    ends[:, :, 0], ends[:, :, 1] = to_place[:, :, s], omega[..., None] * rate
    return _times(to_place, table.to_powers), _times(ends, table.to_powers)


def _scales(omega: Array, phase: Array) -> Array:
    """Factors ``(-1)^i / (Omega^2 phase^2i)`` of the even derivatives of a force in its polynomial motion, ... x s/2."""
    return _geometric(1.0 / (omega * omega), -1.0 / (phase * phase), STAGES // 2)


def _slow_scales(omega: Array, phase: Array) -> Array:
    """Factors ``h^2 (-phase^2)^i`` of the integrals, taken 2 i + 2 times, of a force in its motion from rest."""
    return _geometric((phase / omega) ** 2, -phase * phase, _TERMS)


def _geometric(first: Array, ratio: Array, count: int) -> Array:
    """Geometric series along a new last axis."""
    result = np.empty((*first.shape, count))
    result[..., 0] = first
    for i in range(1, count):
        np.multiply(result[..., i - 1], ratio, out=result[..., i])
    return result


class _Table(NamedTuple):
    """Constants of the method with s stages.

    Attributes
    ----------
    to_powers : ndarray, s x s
        From values at the nodes to coefficients of powers.
    highest : ndarray, s x s
        Leaves the two highest Legendre terms of what is given at the nodes.
    legendre : ndarray, 4 x s
        From values at the nodes to coefficients of the four highest Legendre terms.
    derivatives : ndarray, s x (s/2 s)
        From coefficients of powers to those of the even derivatives.
    motions : ndarray, s/2 x ((s + 4) s)
        Even derivatives of the powers: at the places, at 0, their slopes at 0 and at 1.
    integrals : ndarray, s x (r (s + 2 r))
        From coefficients of powers to those of their integrals from 0, taken 2, 4, ... 2 r times.
    slow_motions : ndarray, r x ((s + 4) s)
        As `motions`, of these integrals.
    """

    to_powers: Array
    highest: Array
    legendre: Array
    derivatives: Array
    motions: Array
    integrals: Array
    slow_motions: Array


@lru_cache(maxsize=1)
def _table() -> _Table:
    s, nodes = STAGES, gauss_method(STAGES).nodes
    derivatives = np.zeros((s, s // 2, s))
    integrals = np.zeros((s, _TERMS, s + 2 * _TERMS))
    for k in range(s):
        for i in range(k // 2 + 1):
            derivatives[k, i, k - 2 * i] = perm(k, 2 * i)
        for i in range(_TERMS):
            integrals[k, i, k + 2 * i + 2] = 1.0 / perm(k + 2 * i + 2, 2 * i + 2)
    vandermonde = legendre.legvander(2.0 * nodes - 1.0, s - 1)
    terms = np.linalg.inv(vandermonde)
    highest = vandermonde[:, _KEPT:] @ terms[_KEPT:]
    to_powers = np.linalg.inv(np.vander(nodes, s, increasing=True))
    flat = derivatives.reshape(s, -1), integrals.reshape(s, -1)
    return _Table(
        to_powers, highest, terms[_KEPT - 2 :], flat[0], _evaluated(derivatives), flat[1], _evaluated(integrals)
    )


def _evaluated(polynomials: Array) -> Array:
    """Polynomials (s x r x degree + 1) at the places and at 0, and their slopes at 0 and 1; r x ((s + 4) s)."""
    degree = polynomials.shape[2] - 1
    values = np.vander([*_PLACES, 0.0], degree + 1, increasing=True)
    slopes = np.zeros((2, degree + 1))
    slopes[0, 1], slopes[1] = 1.0, np.arange(degree + 1)
    rows = np.concatenate([values, slopes])
    return (polynomials @ rows.T).transpose(1, 2, 0).reshape(polynomials.shape[1], -1)
