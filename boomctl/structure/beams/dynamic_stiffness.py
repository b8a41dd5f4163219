"""The exact Euler-Bernoulli beam, frequency by frequency: its transcendental dynamic stiffness.

With ``z^4 = omega^2 rhoA l^4/(EI (1 + i omega c_b))`` the forces and moments at the ends of a uniform segment follow
from the end displacements and rotations through six functions of ``z``.  For small ``|z|`` they are quotients of power
series in ``z^4``, without cancellation; for large ``|z|`` decaying exponentials keep them from overflow.
The interior of a segment with clamped ends has natural frequencies of its own; their number below a frequency is what
the count of Wittrick and Williams (1971) adds to the negative pivots of the dynamic stiffness.
"""

from dataclasses import dataclass
from math import factorial

import numpy as np

from boomctl.arrays import Array

_SERIES_LIMIT = 2.0  # |z| up to which the series is taken; exponentials cancel below, some |z|^-3 eps (a choice)
_TERMS = 8  # of each series; what follows is below 1e-22 at |z| = 2: 4^8 2^32/33!


def _series(offset: int, ratio: float, factor: float) -> Array:
    """Return the coefficients of ``factor * sum ratio^k x^k/(4k + offset)!``, lowest power first."""
    return np.array([factor * ratio**k / factorial(4 * k + offset) for k in range(_TERMS)])


# the six end functions as fractions: numerators and, last, their common denominator (derived: cosh, sinh, cos, sin in x)
_SERIES = np.array(
    [
        _series(1, -4.0, 2.0),
        _series(2, -4.0, 2.0),
        _series(3, -4.0, 4.0),
        _series(1, 1.0, -2.0),
        _series(2, 1.0, 2.0),
        _series(3, 1.0, 2.0),
        _series(4, -4.0, 4.0),
    ]
)
_SERIES.setflags(write=False)


@dataclass(frozen=True)
class Segment:
    """A uniform stretch of beam between two attachments: length [m], rhoA [kg/m], EI [N m^2], damping [s]."""

    length: float
    mass_per_length: float
    bending_stiffness: float
    damping: float


def end_functions(x: Array) -> Array:
    """Return the six end functions of ``x = z^4``, shape (6, len(x)); at ``x = 0``: 12, 6, 4, -12, 6, 2."""
    small = np.abs(x) < _SERIES_LIMIT**4
    if small.all():
        return _by_series(x)
    values = np.empty((6, len(x)), dtype=complex)
    if small.any():
        values[:, small] = _by_series(x[small])
    if not small.all():
        values[:, ~small] = _by_exponentials(x[~small])
    return values


def _by_series(x: Array) -> Array:
    powers = np.empty((_TERMS, len(x)), dtype=complex)
    powers[0] = 1.0
    for k in range(1, _TERMS):
        np.multiply(powers[k - 1], x, out=powers[k])
    sums = (_SERIES @ powers.view(float)).view(complex)
    return sums[:6] / sums[6]


def _by_exponentials(x: Array) -> Array:
    z = np.sqrt(np.sqrt(x))
    e = np.exp(-z)
    growth = np.abs(np.imag(z))
    forward, backward = np.exp(1j * z - growth), np.exp(-1j * z - growth)
    c, s, one = 0.5 * (forward + backward), -0.5j * (forward - backward), np.exp(-growth)
    e2 = e * e
    plus, minus = 1.0 + e2, 1.0 - e2
    scale = z / (2.0 * e * one - plus * c)
    z2 = z * z
    return np.array(
        [
            z2 * scale * (c * minus + s * plus),
            z * scale * s * minus,
            scale * (s * plus - c * minus),
            -z2 * scale * (one * minus + 2.0 * e * s),
            z * scale * (one * plus - 2.0 * e * c),
            scale * (one * minus - 2.0 * e * s),
        ]
    )


def segment_terms(left: Array, right: Array) -> Array:
    """Return the matrices that multiply the six end functions, shape (6, n, m), for a segment of ``EI/length^3 = 1``.

    ``left`` and ``right`` are the segment's ``w1, length phi1, w2, length phi2`` over two groups of coordinates; the result
    times ``EI/length^3 (1 + s c_b)`` and the functions, summed, is the segment's share of the dynamic stiffness.
    """
    pairs = left[:, None, :, None] * right[None, :, None, :]

    def both(a: int, b: int) -> Array:
        return pairs[a, b] + pairs[b, a]

    return np.array(
        [
            pairs[0, 0] + pairs[2, 2],
            both(0, 1) - both(2, 3),
            pairs[1, 1] + pairs[3, 3],
            both(0, 2),
            both(0, 3) - both(1, 2),
            both(1, 3),
        ]
    )


def clamped_count(z: Array) -> Array:
    """Return how many clamped-clamped natural frequencies lie below ``z``: roots of ``cosh z cos z = 1`` in (0, z)."""
    i = np.floor(z / np.pi).astype(int)
    sign = np.where(z < 1.0, 1.0, np.sign(2.0 * np.exp(-z) - (1.0 + np.exp(-2.0 * z)) * np.cos(z)))
    return np.maximum(i - ((1 - (-1.0) ** i * sign) / 2).astype(int), 0)
