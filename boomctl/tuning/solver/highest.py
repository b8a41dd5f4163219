"""The highest peak of a small loop at once, by the level sets of SLICOT (Bruinsma & Steinbuch 1990), and a parabola on it."""

from collections.abc import Callable
from math import inf, isfinite

import numpy as np

from boomctl.arrays import Array

STATES = 30  # up to which the level sets, cubic in twice the states, are faster than a grid (measured)
_WITHIN = 1e-6  # relative, of the norm: where level sets end; nearer to it they may miss a peak by rounding (measured)
_BESIDE = 3e-3  # share of its frequency to either side of a peak that is known to the square root of that (derived)
_ROUNDS = 2  # of parabolas: the value is then known to 1e-12
_FAR = 1e12  # times the size of A, a frequency that stands for infinity


def highest_peak(A: Array, B: Array, C: Array, D: Array, also: Array) -> tuple[float, float] | None:
    """Return the frequency [rad/s], infinity included, and the value of the highest peak; None where that fails.

    The loop is stable; ``also`` are frequencies that are looked at too.
    """
    import slycot  # only who tunes waits for it

    sizes = (len(A), B.shape[1], len(C))
    try:
        norm, omega = slycot.ab13dd("C", "I", "S", "D", *sizes, A, np.eye(len(A)), B, C, D, _WITHIN)[:2]
    except (ArithmeticError, ValueError):
        return None
    if not (isfinite(norm) and norm > 0.0):
        return None
    if not (isfinite(omega) and omega < _FAR * np.linalg.norm(A)):
        omega = inf

    def largest(at: Array) -> Array:
        pencils = 1j * at[:, None, None] * np.eye(len(A)) - A
        return np.linalg.svd(C @ np.linalg.solve(pencils, B.astype(complex)) + D, compute_uv=False)[:, 0]

    known = np.append(also, 0.0)
    try:
        values = largest(known)
    except np.linalg.LinAlgError:  # a pole so near zero is one of a loop that is hardly stable
        return None
    best = int(np.argmax(values))
    if values[best] >= norm:
        norm, omega = float(values[best]), float(known[best])
    rest, through = float(values[-1]), float(np.linalg.norm(D, 2)) if D.any() else 0.0
    omega, norm = (omega, norm) if omega in (0.0, inf) else _refined(largest, omega)
    value, at = max((norm, omega), (rest, 0.0), (through, inf))
    return at, value


def _refined(largest: Callable[[Array], Array], omega: float) -> tuple[float, float]:
    """Return frequency and value of the peak beside a frequency, by parabolas."""
    norm, width = 0.0, _BESIDE
    for _ in range(_ROUNDS):
        at = omega * np.array([1.0 - width, 1.0, 1.0 + width])
        low, top, high = largest(at)
        bend = low - 2.0 * top + high
        shift = 0.5 * (low - high) / bend if bend < 0.0 else 0.0
        norm = float(top)
        if abs(shift) > 1.0:
            best = int(np.argmax([low, top, high]))
            norm, omega = float((low, top, high)[best]), float(at[best])
            continue
        moved = omega * (1.0 + shift * width)
        found = float(largest(np.array([moved]))[0])
        if found >= norm:
            norm, omega = found, moved
        width *= 0.1
    return omega, norm
