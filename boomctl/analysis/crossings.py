"""Frequencies at which the response ``L`` of a loop is real, or of size one: eigenvalues of one pencil each.

With the sensitivity ``S = 1/(1 - L)``, ``L`` is real where ``S(s) - S(-s)`` is zero on the imaginary axis, and of size one
where ``S(s) + S(-s) - 1`` is.  The sensitivity of a stable loop has no pole there, whatever poles ``L`` has.  Each eigenvalue
may be a crossing; those are placed in the response itself, between two frequencies at which the sign differs.
"""

from collections.abc import Callable

import numpy as np
from scipy import linalg

from boomctl.arrays import Array, blocks
from boomctl.lti.rounding import ALIKE, SOLVED
from boomctl.lti.system import Lti, signal_scales

_DIRECT = 0.1  # Feedthrough from which on the zeros are eigenvalues of a matrix, which takes half the time.
_FASTEST = (
    1e4  # Times the size of ``A``, up to which an eigenvalue is none at infinite frequency that rounding has moved.
)
_OFF_AXIS = 0.1  # Share of its size by which an eigenvalue may be off the axis: signs tell crossings, not eigenvalues.
_TOUCHING = 1e-6  # Distance from a gain of one up to which a gain that does not pass it is said to be one.
_STEPS = 60  # To a crossing at most: two to four do from an eigenvalue.


def real_crossings(S: Lti, respond: Callable[[Array], Array]) -> Array:
    """Return the frequencies [rad/s] at which the loop's response is real, rest and infinite frequency not among them.

    Parameters
    ----------
    S : Lti
        The sensitivity of a stable loop, one signal, in continuous time.
    respond : function from frequencies (N,) to the sensitivity there (N,)
        More accurate than the matrices of ``S``, if need be.
    """
    return _crossings(_axis_zeros(S, 1.0, 0.0), lambda omega: respond(omega).imag)[0]


def unit_crossings(S: Lti, respond: Callable[[Array], Array]) -> Array:
    """Return the frequencies [rad/s] at which the loop's response has size one, rest among them, or touches it."""

    def height(omega: Array) -> Array:
        return respond(omega).real - 0.5

    zeros = _axis_zeros(S, -1.0, 2.0 * float(S.D[0, 0]) - 1.0)
    crossed, touched = _crossings(zeros, height)
    if len(touched):
        values = respond(touched)
        touched = touched[np.abs(values.real - 0.5) <= _TOUCHING * np.abs(values) ** 2]
    found = np.concatenate([crossed, touched])
    # A gain of one at rest, or at infinite frequency, is not crossed beside it, where rounding says so.
    at_rest = abs(height(np.zeros(1))[0]) <= ALIKE
    if at_rest:
        found = found[np.abs(height(0.5 * found)) > ALIKE]
    if abs(float(S.D[0, 0]) - 0.5) <= ALIKE:
        found = found[np.abs(height(2.0 * found)) > ALIKE]
    return np.append(found, 0.0) if at_rest else found


def _axis_zeros(S: Lti, sign: float, D: float) -> Array:
    """Return the zeros of ``C (s - A)^-1 B + sign C (s + A)^-1 B + D``, which is even or odd in ``s``."""
    if not len(S.A):
        return np.zeros(0, complex)
    n, scale = len(S.A), signal_scales(S.A, S.B, S.C)
    A, B, C = S.A / scale[:, None] * scale, S.B / scale[:, None], S.C * scale
    unit = float(np.linalg.norm(A)) or 1.0  # of time: then no size depends on that
    A, B, C, none = A / unit, B / unit**0.5, C / unit**0.5, np.zeros((n, n))
    if abs(D) > _DIRECT:
        into, out_of = np.concatenate([B, B]), np.concatenate([C, sign * C], axis=1) / D
        zeros = np.linalg.eigvals(blocks([[A, none], [none, -A]]) - into @ out_of)
    else:
        pencil = blocks([[A, none, B], [none, -A, B], [C, sign * C, np.array([[D]])]])
        zeros = linalg.eigvals(pencil, np.diag(np.append(np.ones(2 * n), 0.0)))
    return unit * zeros[np.abs(zeros) <= _FASTEST]


def _crossings(zeros: Array, height: Callable[[Array], Array]) -> tuple[Array, Array]:
    """Return the frequencies at which a height changes its sign, and those of zeros at which it does not."""
    places = zeros[np.abs(zeros.real) <= _OFF_AXIS * np.abs(zeros.imag)].imag
    places = np.unique(places[places > 0.0])
    if not len(places):
        return places, places
    ends = np.concatenate([[0.5 * places[0]], 0.5 * (places[1:] + places[:-1]), [2.0 * places[-1]]])
    values = height(ends)
    changed = values[1:] * values[:-1] < 0.0
    brackets = [x[k:][: len(places)][changed] for k in (0, 1) for x in (ends, values)]
    return _roots(height, places[changed], *brackets), places[~changed]


def _roots(function: Callable[[Array], Array], start: Array, a: Array, fa: Array, b: Array, fb: Array) -> Array:
    """Return the zeros of a function, from a start in brackets at whose ends its signs differ: regula falsi."""
    new = result = start
    for _ in range(_STEPS if len(start) else 0):
        value = function(new)
        same = np.sign(value) == np.sign(fb)
        a, fa = np.where(same, a, b), np.where(same, 0.5 * fa, fb)  # An end that stays is weighed half (Illinois).
        b, fb, result = new, value, new
        with np.errstate(invalid="ignore", divide="ignore"):
            new = np.where(fb == 0.0, b, b - fb * (b - a) / (fb - fa))
        if (np.abs(new - result) <= SOLVED * result).all():
            break
    return new
