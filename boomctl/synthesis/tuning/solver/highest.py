"""The highest peak of a small loop at once, by the level sets of SLICOT (Bruinsma & Steinbuch 1990)."""

from math import inf

import numpy as np

from boomctl.arrays import Array

STATES = 40  # up to which the level sets, cubic in twice the states, are faster than a grid (measured)
_WITHIN = 1e-9  # relative, of the norm: what the descent can tell apart
_FAR = 1e12  # times the size of A, a frequency that stands for infinity


def highest_peak(A: Array, B: Array, C: Array, D: Array) -> tuple[float, float] | None:
    """Return the frequency [rad/s], infinity included, and the value of the highest peak; None where that fails.

    The loop is stable.
    """
    import slycot  # only who tunes waits for it

    sizes = (len(A), B.shape[1], len(C))
    try:
        norm, omega = slycot.ab13dd("C", "I", "N", "D", *sizes, A, np.eye(len(A)), B, C, D, _WITHIN)[:2]
    except (ArithmeticError, ValueError):
        return None
    if not (np.isfinite(norm) and norm > 0.0):
        return None
    return (float(omega) if np.isfinite(omega) and omega < _FAR * np.linalg.norm(A) else inf), float(norm)
