"""Stable filters of a given order that lie above given magnitudes, as a bound over frequency."""

import numpy as np

from boomctl.arrays import Array
from boomctl.lti.rounding import ALIKE
from boomctl.lti.system import Lti

MOST = 12  # poles: more of them follow single frequencies, and the roots of polynomials lose digits (a choice)
_APART = 1.5  # ratio of the poles above the highest frequency, so that each has a residue of its own (a choice)
# share of the largest magnitude below which smaller ones do not count for less room above them (a choice)
_SMALL = 1e-3
_BESIDE = np.geomspace(1.0, 1e3, 101)[1:]  # beyond the frequencies: from there on a band is what it is at its limit


def overbound(omega: Array, size: Array, order: int, fall: int) -> Lti:
    """Return a filter with real poles whose magnitude is at least ``size`` at all frequencies, and near it on average.

    Below the lowest frequency it is at least the size there, above the highest one at least the size there, falling as told.
    Its squared magnitude is a sum of bands, each flat between two neighboring poles and falling to either side.  Their
    heights are found by a linear programme.

    Parameters
    ----------
    omega, size : (n,) ndarray
        Frequencies [rad/s], above zero, and magnitudes there, not all zero.
    order : int
        Poles, at most ``MOST``, as evenly spaced over the logarithm of the frequencies as may be.
    fall : int
        Power of frequency with which it falls above them, at most ``order``.
    """
    from scipy.optimize import linprog  # long to import, and few come here

    low, high = float(omega.min()), float(omega.max())
    extra = max(fall - 1, 0)
    poles = np.r_[np.geomspace(low, high, order - extra), high * _APART ** np.arange(1, extra + 1)]
    unit, top, given = float(np.sqrt(low * high)), float(size.max()), len(omega)
    below, above = size[omega == low].max(), size[omega == high].max()
    omega = np.r_[omega, low / _BESIDE, high * _BESIDE]
    size = np.r_[size, np.full(len(_BESIDE), below), above * _BESIDE**-fall]
    v, squares = np.square(omega / unit), np.square(poles / unit)
    after = np.r_[np.cumprod(squares[::-1])[::-1], 1.0]  # products of the squares from a pole on
    exponents = np.arange(order - fall + 1)
    bands = (
        np.exp(np.log(v)[:, None] * exponents - np.log(v[:, None] + squares).sum(axis=1)[:, None]) * after[exponents]
    )
    wanted = np.square(size / top)
    room = np.maximum(wanted, _SMALL**2)[:, None]
    least = np.zeros(len(exponents))  # the first and the last band alone reach what is wanted beyond all frequencies
    for band, end in ((0, given + len(_BESIDE) - 1), (-1, len(omega) - 1)):
        least[band] = max(least[band], wanted[end] / bands[end, band])
    cost = (bands / room)[:given].mean(axis=0)
    result = linprog(cost, A_ub=-bands / room, b_ub=-wanted / room[:, 0], bounds=[(x, None) for x in least])
    if result.x is None:
        raise ArithmeticError(f"no filter of order {order} was found above the magnitudes: {result.message}")
    heights = np.maximum(result.x, 0.0) * after[exponents]
    last = int(np.flatnonzero(heights)[-1])
    zeros = -unit * np.sqrt(-np.roots(heights[last::-1]).astype(complex))
    gain = top * float(np.sqrt(heights[last])) * unit ** (order - last)
    residues = np.array(
        [gain * np.prod(-pole - zeros).real / np.prod(np.delete(poles, k) - pole) for k, pole in enumerate(poles)]
    )
    root = np.sqrt(np.abs(residues))
    C, D = (np.sign(residues) * root)[None, :], np.array([[gain if last == order else 0.0]])
    filters = Lti(np.diag(-poles), root[:, None], C, D)
    there = np.abs(filters.response(omega)[0, 0])
    spare = max(float((size / there).max()), 1.0) * (1.0 + ALIKE)  # the programme ends within its tolerance
    return Lti(filters.A, filters.B, spare * filters.C, spare * filters.D)
