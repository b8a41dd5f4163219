"""Frequencies at which the response ``L`` of a loop is real, or of modulus one: eigenvalues of one pencil each.

With the sensitivity ``S = 1/(1 - L)``, ``L`` is real if ``S(s) - S(-s)`` is zero on the imaginary axis, and of modulus one if
``S(s) + S(-s) - 1`` is zero.  The sensitivity of a stable loop has no pole there, regardless of the poles of ``L``.  Each
eigenvalue is a candidate: a crossing if the response itself has different signs at the midpoints to the next ones.
"""

from collections.abc import Callable

import numpy as np
from scipy import linalg

from boomctl.arrays import Array, blocks
from boomctl.lti.rounding import ALIKE
from boomctl.lti.system import Lti, signal_scales

# Largest eigenvalue relative to the norm of ``A``: larger ones are infinite eigenvalues perturbed by rounding.
_FASTEST = 1e4
_OFF_AXIS = 0.1  # Largest distance of a candidate from the axis, relative to its modulus; signs decide on a crossing.


def real_crossings(S: Lti, respond: Callable[[Array], Array]) -> Array:
    """Return the frequencies [rad/s] at which the loop's response is real, except for DC and infinite frequency.

    Parameters
    ----------
    S : Lti
        Sensitivity of a stable loop, one signal, in continuous time.
    respond : function from frequencies (N,) to the sensitivity there (N,)
        May be more accurate than the matrices of ``S``.
    """
    return _crossings(_axis_zeros(S, 1.0, 0.0), lambda omega: respond(omega).imag)


def unit_crossings(S: Lti, respond: Callable[[Array], Array]) -> Array:
    """Return the frequencies [rad/s] at which the modulus of the loop's response crosses one, DC included."""

    def height(omega: Array) -> Array:
        return respond(omega).real - 0.5

    omega = _crossings(_axis_zeros(S, -1.0, 2.0 * float(S.D[0, 0]) - 1.0), height)
    # With a gain of one at DC or at infinite frequency, crossings near it are due to rounding error.
    at_rest = abs(height(np.zeros(1))[0]) <= ALIKE
    if at_rest:
        omega = omega[np.abs(height(0.5 * omega)) > ALIKE]
    if abs(float(S.D[0, 0]) - 0.5) <= ALIKE:
        omega = omega[np.abs(height(2.0 * omega)) > ALIKE]
    return np.append(omega, 0.0) if at_rest else omega


def _axis_zeros(S: Lti, sign: float, D: float) -> Array:
    """Return the zeros of ``C (s - A)^-1 B + sign C (s + A)^-1 B + D``, which is even or odd in ``s``."""
    if not len(S.A):
        return np.zeros(0, complex)
    n, scale = len(S.A), signal_scales(S.A, S.B, S.C)
    A, B, C = S.A / scale[:, None] * scale, S.B / scale[:, None], S.C * scale
    unit = float(np.linalg.norm(A)) or 1.0  # unit of time, so that no magnitude depends on it
    A, B, C, none = A / unit, B / unit**0.5, C / unit**0.5, np.zeros((n, n))
    pencil = blocks([[A, none, B], [none, -A, B], [C, sign * C, np.array([[D]])]])
    zeros = linalg.eigvals(pencil, np.diag(np.append(np.ones(2 * n), 0.0)))
    return unit * zeros[np.abs(zeros) <= _FASTEST]


def _crossings(zeros: Array, height: Callable[[Array], Array]) -> Array:
    """Return the frequencies of zeros near the axis at which a height changes its sign."""
    omega = zeros[np.abs(zeros.real) <= _OFF_AXIS * np.abs(zeros.imag)].imag
    omega = np.unique(omega[omega > 0.0])
    if not len(omega):
        return omega
    values = height(np.concatenate([[0.5 * omega[0]], 0.5 * (omega[1:] + omega[:-1]), [2.0 * omega[-1]]]))
    return omega[values[1:] * values[:-1] < 0.0]
