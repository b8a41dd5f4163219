"""Transfer functions as state-space systems, their response compared with that of the polynomials.

One entry becomes its companion form, balanced, which has the coefficients as they are; a table of entries becomes SLICOT's
minimal realisation.  Polynomials lose digits where modes are many or hardly damped.  What the realisation does is therefore
compared with what the coefficients say, around every pole and zero: nothing is answered for another system than that given.
"""

from typing import TYPE_CHECKING

import numpy as np

from boomctl.arrays import Array, balance
from boomctl.lti.rounding import LEVEL, SUMMED

if TYPE_CHECKING:
    import control

_BESIDE = (0.5, 0.99, 1.01, 2.0)  # times the size of a pole or zero: frequencies compared; not at a pole itself
_REST = 1.0  # [rad/s], where all poles and zeros are at zero (any frequency will do)
_HALF_CIRCLE = np.linspace(0.01, 3.1, 64)  # angles compared in discrete time (a choice)


def realized(given: "control.TransferFunction", what: str) -> tuple[Array, Array, Array, Array]:
    """Return ``A, B, C, D`` of a transfer function, balanced.

    Of one entry all poles stay, also those that a zero cancels; of a table only those that its response has.

    Raises
    ------
    ValueError
        Coefficients that are not finite; not proper; realised with another response than the coefficients have.
    """
    entries = [
        (np.asarray(n, dtype=float), np.asarray(d, dtype=float))
        for n, d in zip(_listed(given.num), _listed(given.den), strict=True)
    ]
    for n, d in entries:
        if not (np.isfinite(n).all() and np.isfinite(d).all()):
            raise ValueError(f"{what}: expected finite coefficients")
        if len(np.trim_zeros(n, "f")) > len(np.trim_zeros(d, "f")):
            raise ValueError(f"{what}: expected a proper transfer function, got a numerator of higher order")
    A, B, C, D = _companion(*entries[0]) if len(entries) == 1 else _minimal(given)
    A, scale = balance(A)
    B, C = B / scale[:, None], C * scale
    if given.isctime():
        rates = np.abs(np.concatenate([np.roots(part) for entry in entries for part in entry]))
        at = 1j * np.unique(np.outer(rates[rates > 0.0] if rates.any() else [_REST], _BESIDE))
    else:
        at = np.exp(1j * _HALF_CIRCLE)
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        answers = C @ np.linalg.solve(at[:, None, None] * np.eye(len(A)) - A, B.astype(complex)[None]) + D
        for answer, (n, d) in zip(answers.reshape(len(at), -1).T, entries, strict=True):
            num, den = np.polyval(n, at), np.polyval(d, at)
            terms = np.polyval(np.abs(n), np.abs(at)) + np.abs(num / den) * np.polyval(np.abs(d), np.abs(at))
            told = np.abs(answer - num / den) <= LEVEL * np.abs(num / den) + SUMMED * terms / np.abs(den)
            if not told.all():
                raise ValueError(
                    f"{what}: its polynomials have too few digits to tell its response in state space; expected a StateSpace"
                )
    return A, B, C, D


def _companion(num: Array, den: Array) -> tuple[Array, Array, Array, Array]:
    """Return the controllable companion form of one entry."""
    den = np.trim_zeros(den, "f")
    n = len(den) - 1
    num, den = np.pad(np.trim_zeros(num, "f"), (n + 1, 0))[-n - 1 :] / den[0], den / den[0]
    A = np.eye(n, k=-1)
    A[:1] = -den[1:]
    return A, np.eye(n, 1), (num[1:] - num[0] * den[1:])[None, :], num[None, :1]


def _minimal(given: "control.TransferFunction") -> tuple[Array, Array, Array, Array]:
    from boomctl.lti.python_control import control

    found = control.ss(given)
    A, B, C, D = (np.asarray(getattr(found, letter), dtype=float) for letter in "ABCD")
    return A, B, C, D


def _listed(table: Array) -> list[Array]:
    """Return the polynomials of a transfer function row by row."""
    return [polynomial for row in table for polynomial in row]
