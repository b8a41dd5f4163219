"""The exact Euler-Bernoulli beam, frequency by frequency: its transcendental dynamic stiffness.

With ``z^4 = omega^2 rhoA l^4/(EI (1 + i omega c_b))`` the forces and moments at the ends of a uniform segment follow
from the end displacements and rotations through six functions of ``z``.  For small ``|z|`` they are quotients of power
series in ``z^4``, without cancellation; for large ``|z|`` decaying exponentials keep them from overflow.

Over a segment's strains and the rigid motion of its ends (``strain_functions``), the static part of the same stiffness is
that of the strains, so the huge stiffness of a short segment is never summed with soft terms.

The interior of a segment with clamped ends has separate natural frequencies; their number below a frequency is added to the
number of negative pivots of the dynamic stiffness in the count of Wittrick and Williams (1971).
"""

from fractions import Fraction
from math import factorial

import numpy as np

from boomctl.arrays import Array

_SERIES_LIMIT = 2.0  # |z| up to which the series is used; below, exponentials cancel with an error of |z|^-3 eps.
_TERMS = 8  # Terms of each series; the remainder is below 1e-22 at |z| = 2: 4^8 2^32/33!


# offset, ratio and factor of ``factor * sum ratio^k x^k/(4k + offset)!``: the six end functions are fractions of such series,
# of which the seventh is the common denominator
_FRACTIONS = ((1, -4, 2), (2, -4, 2), (3, -4, 4), (1, 1, -2), (2, 1, 2), (3, 1, 2), (4, -4, 4))


def _series(weights: Array) -> Array:
    """Return the coefficients of sums of the six numerators, and last those of the denominator, lowest power first.

    They are summed in exact arithmetic, so that static parts of the strain functions and other terms cancel exactly.
    """
    lines, padded = [], np.pad(weights, (0, 1))
    padded[-1, -1] = 1.0
    for line in padded.tolist():
        parts = [(Fraction(w) * factor, o, ratio) for w, (o, ratio, factor) in zip(line, _FRACTIONS, strict=True) if w]
        powers = [[w * Fraction(ratio) ** k / factorial(4 * k + o) for w, o, ratio in parts] for k in range(_TERMS)]
        lines.append([float(sum(terms)) for terms in powers])
    result = np.array(lines)
    result.setflags(write=False)
    return result


# The six strain functions as sums of the six end functions, derived from end displacements and rotations
# w +- rise/2 and (shear/2 + rise -+ bend/2)/l.  They are those of w w, w bend, bend bend (symmetric motions), rise rise,
# rise shear, shear shear (antisymmetric ones).
_STRAINS = np.array(
    [
        [2.0, 0.0, 0.0, 2.0, 0.0, 0.0],
        [0.0, -1.0, 0.0, 0.0, 1.0, 0.0],
        [0.0, 0.0, 0.5, 0.0, 0.0, -0.5],
        [0.5, -2.0, 2.0, -0.5, -2.0, 2.0],
        [0.0, -0.5, 1.0, 0.0, -0.5, 1.0],
        [0.0, 0.0, 0.5, 0.0, 0.0, 0.5],
    ]
)
_STRAINS.setflags(write=False)


# of the end functions (each numerator alone) and of the strain functions
_SERIES, _STRAIN_SERIES = _series(np.eye(6)), _series(_STRAINS)


def end_functions(x: Array) -> Array:
    """Return the six end functions of ``x = z^4``, shape (6, len(x)); at ``x = 0``: 12, 6, 4, -12, 6, 2."""
    small = np.abs(x) < _SERIES_LIMIT**4
    if small.all():
        return _by_series(_SERIES, x)
    values = np.empty((6, len(x)), dtype=complex)
    values[:, small], values[:, ~small] = _by_series(_SERIES, x[small]), _by_exponentials(x[~small])
    return values


def strain_functions(x: Array) -> tuple[Array, Array]:
    """Return the six strain functions of ``x = z^4``, shape (6, len(x)), and the magnitudes of their terms.

    At ``x = 0`` they are 0, 0, 1, 0, 0, 3; near it they are accurate to rounding error.
    """
    small = np.abs(x) < _SERIES_LIMIT**4
    values, sizes = np.empty((6, len(x)), dtype=complex), np.empty((6, len(x)))
    values[:, small], ends = _by_series(_STRAIN_SERIES, x[small]), _by_exponentials(x[~small])
    sizes[:, small] = np.abs(values[:, small])
    values[:, ~small], sizes[:, ~small] = _STRAINS @ ends, np.abs(_STRAINS) @ np.abs(ends)
    return values, sizes


def _by_series(series: Array, x: Array) -> Array:
    powers = np.empty((_TERMS, len(x)), dtype=complex)
    powers[0] = 1.0
    for k in range(1, _TERMS):
        np.multiply(powers[k - 1], x, out=powers[k])
    sums = (series @ powers.view(float)).view(complex)
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
    times ``EI/length^3 (1 + s c_b)`` and the functions, summed, is the segment's contribution to the dynamic stiffness.
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


def strain_lines(ends: Array) -> Array:
    """Return ``w, rise, bend, shear`` of each segment, (4 segments, n), from its ``w1, l phi1, w2, l phi2``.

    Mean displacement and rise of its ends are rigid motions; ``bend = l (phi2 - phi1)`` and
    ``shear = l (phi1 + phi2) - 2 rise`` strain it.
    """
    w1, turn1, w2, turn2 = np.moveaxis(ends.reshape(len(ends) // 4, 4, ends.shape[1]), 1, 0)
    rise = w2 - w1
    lines = np.stack([0.5 * (w1 + w2), rise, turn2 - turn1, (turn1 + turn2) - 2.0 * rise], axis=1)
    return lines.reshape(ends.shape)


def strain_terms(left: Array, right: Array) -> Array:
    """Return the matrices that multiply the six strain functions, as :func:`segment_terms` those of the end functions.

    ``left`` and ``right`` are the segment's :func:`strain_lines`.
    """
    pairs = left[:, None, :, None] * right[None, :, None, :]
    w, rise, bend, shear = range(4)
    return np.array(
        [
            pairs[w, w],
            pairs[w, bend] + pairs[bend, w],
            pairs[bend, bend],
            pairs[rise, rise],
            pairs[rise, shear] + pairs[shear, rise],
            pairs[shear, shear],
        ]
    )


def clamped_count(z: Array) -> Array:
    """Return the number of clamped-clamped natural frequencies below ``z``: roots of ``cosh z cos z = 1`` in (0, z)."""
    i = np.floor(z / np.pi).astype(int)
    sign = np.where(z < 1.0, 1.0, np.sign(2.0 * np.exp(-z) - (1.0 + np.exp(-2.0 * z)) * np.cos(z)))
    return np.maximum(i - ((1 - (-1.0) ** i * sign) / 2).astype(int), 0)
