"""Stable filters of a given order that lie above given magnitudes, as a bound over frequency."""

import numpy as np

from boomctl.arrays import Array
from boomctl.lti.rounding import ALIKE
from boomctl.lti.system import Lti

_APART = 1.5  # ratio of the poles above the highest frequency, so that each has a residue of its own (a choice)
_SMALL = (
    1e-3  # share of the largest magnitude below which smaller ones do not count for less room above them (a choice)
)


def overbound(omega: Array, size: Array, order: int, fall: int) -> Lti:
    """Return a filter with real poles whose magnitude is at least ``size`` at all frequencies, and near it on average.

    Its squared magnitude is a sum of bands, each flat between two neighbouring poles and falling to either side.  Their
    heights are found by a linear programme.

    Parameters
    ----------
    omega, size : (n,) ndarray
        Frequencies [rad/s], above zero, and magnitudes there, not all zero.
    order : int
        Poles, as evenly spaced over the logarithm of the frequencies as may be.
    fall : int
        Power of frequency with which it falls above them, at most ``order``.
    """
    from scipy.optimize import linprog  # long to import, and few come here

    low, high = float(omega.min()), float(omega.max())
    extra = max(fall - 1, 0)
    poles = np.r_[np.geomspace(low, high, order - extra), high * _APART ** np.arange(1, extra + 1)]
    unit, top = float(np.sqrt(low * high)), float(size.max())
    v, squares = np.square(omega / unit), np.square(poles / unit)
    after = np.r_[np.cumprod(squares[::-1])[::-1], 1.0]  # products of the squares from a pole on
    exponents = np.arange(order - fall + 1)
    bands = v[:, None] ** exponents * after[exponents] / np.prod(v[:, None] + squares, axis=1)[:, None]
    wanted = np.square(size / top)
    room = np.maximum(wanted, _SMALL**2)[:, None]
    bounds = [(0.0, None)] * (order - fall) + [
        (wanted[omega == high].max(), None)
    ]  # so that it falls from there as told
    found = linprog((bands / room).mean(axis=0), A_ub=-bands / room, b_ub=-wanted / room[:, 0], bounds=bounds)
    heights = np.maximum(found.x, 0.0) * after[exponents]
    last = int(np.flatnonzero(heights)[-1])
    zeros = -unit * np.sqrt(-np.roots(heights[last::-1]).astype(complex))
    gain = top * float(np.sqrt(heights[last])) * unit ** (order - last)
    residues = np.array(
        [gain * np.prod(-pole - zeros).real / np.prod(np.delete(poles, k) - pole) for k, pole in enumerate(poles)]
    )
    root = np.sqrt(np.abs(residues))
    C, D = (np.sign(residues) * root)[None, :], np.array([[gain if last == order else 0.0]])
    above = Lti(np.diag(-poles), root[:, None], C, D)
    there = np.abs(above.response(omega)[0, 0])
    spare = max(float((size / there).max()), 1.0) * (1.0 + ALIKE)  # the programme ends within its tolerance
    return Lti(above.A, above.B, spare * above.C, spare * above.D)
