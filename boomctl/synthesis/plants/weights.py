"""Weighting filters for generalized plants, with corner frequencies in rad/s."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from boomctl.checks import exactly, positive, real, whole
from boomctl.lti.python_control import control
from boomctl.structure.ports import FILTER_DAMPING


def _filter(A: ArrayLike, B: ArrayLike, C: ArrayLike, D: float) -> control.StateSpace:
    return control.ss(A, B, C, [[D]], inputs="in", outputs="out")


def _second(corner: float, damping: float) -> tuple[list[list[float]], list[list[float]]]:
    """Return ``A, B`` with the states ``corner^2/d`` and ``corner s/d``, ``d = s^2 + 2 damping corner s + corner^2``."""
    return [[0.0, corner], [-corner, -2.0 * damping * corner]], [[0.0], [corner]]


def low_pass(gain: float, corner: float, order: int = 1, damping_ratio: float = FILTER_DAMPING) -> control.StateSpace:
    """Return a low-pass weighting filter.

    Parameters
    ----------
    gain : float
        Gain at zero frequency.
    corner : float
        Corner frequency [rad/s].
    order : 1 or 2
        Number of poles: the roll-off is 20 or 40 dB per decade.
    damping_ratio : float
        Damping ratio of the poles of order 2; for a small one the peak is ``gain/(2 damping_ratio)``.

    Returns
    -------
    control.StateSpace
        One input, ``in``, and one output, ``out``; stable, with ``order`` states.

    Raises
    ------
    TypeError, ValueError
        If a number is not finite, the corner or the damping ratio is not positive, or the order is invalid.

    Examples
    --------
    >>> import boomctl as bc
    >>> weight = bc.low_pass(2.0, corner=10.0)
    >>> abs(weight.frequency_response([0.0, 10.0, 1000.0]).complex).round(3)
    array([2.   , 1.414, 0.02 ])
    """
    g, w, zeta = real("gain", gain), positive("corner", corner), positive("damping_ratio", damping_ratio)
    if whole("order", order, most=2) == 1:
        return _filter([[-w]], [[w]], [[g]], 0.0)
    return _filter(*_second(w, zeta), [[g, 0.0]], 0.0)


def high_pass(gain: float, corner: float, order: int = 1, damping_ratio: float = FILTER_DAMPING) -> control.StateSpace:
    """Return a high-pass weight: ``gain`` above the corner frequency, zero at zero frequency.

    Parameters
    ----------
    gain : float
        Gain at high frequency.
    corner : float
        Corner frequency [rad/s].
    order : 1 or 2
        Number of poles: below the corner the gain rises by 20 or by 40 dB a decade.
    damping_ratio : float
        Damping ratio of the two poles of order 2.

    Returns
    -------
    control.StateSpace
        One input, ``in``, and one output, ``out``; stable, with ``order`` states.

    Raises
    ------
    TypeError, ValueError
        If a number is not finite, the corner or the damping ratio is not positive, or the order is invalid.

    Examples
    --------
    >>> import boomctl as bc
    >>> weight = bc.synthesis.high_pass(2.0, corner=10.0, order=2)
    >>> abs(weight.frequency_response([0.0, 10.0, 1000.0]).complex).round(3)
    array([0.   , 1.414, 2.   ])
    """
    g, w, zeta = real("gain", gain), positive("corner", corner), positive("damping_ratio", damping_ratio)
    if whole("order", order, most=2) == 1:
        return _filter([[-w]], [[w]], [[-g]], g)
    return _filter(*_second(w, zeta), [[-g, -2.0 * g * zeta]], g)


def band_pass(gain: float, low: float, high: float) -> control.StateSpace:
    """Return a second-order band-pass weight between two corner frequencies.

    It can represent, for instance, the platform's motion on a track.

    Parameters
    ----------
    gain : float
        Largest gain, at ``sqrt(low high)``.
    low, high : float
        Frequencies at which the gain is lower by the square root of two [rad/s], ascending.

    Returns
    -------
    control.StateSpace
        One input, ``in``, and one output, ``out``; stable, with two states.

    Raises
    ------
    TypeError, ValueError
        If a value is out of range or the frequencies do not ascend.

    Examples
    --------
    >>> import boomctl as bc
    >>> weight = bc.synthesis.band_pass(2.0, low=0.5, high=8.0)
    >>> abs(weight.frequency_response([0.5, 2.0, 8.0]).complex).round(3)
    array([1.414, 2.   , 1.414])
    """
    g, a, b = real("gain", gain), positive("low", low), positive("high", high)
    if a >= b:
        raise ValueError(f"`low` must be less than `high`, got {exactly(a)} and {exactly(b)} rad/s.")
    center = float(np.sqrt(a * b))
    damping = (b - a) / (2.0 * center)
    return _filter(*_second(center, damping), [[0.0, 2.0 * g * damping]], 0.0)


def shelf(low_gain: float, high_gain: float, corner: float, order: int = 1) -> control.StateSpace:
    """Return a weighting filter with given gains at zero and at infinite frequency, like MATLAB's ``makeweight``.

    Parameters
    ----------
    low_gain, high_gain : float
        Gains at zero and at infinite frequency, both above zero.
    corner : float
        Frequency at which the gain is the geometric mean of both [rad/s].
    order : 1 or 2
        Number of poles; the transition of order 2 is twice as steep.

    Returns
    -------
    control.StateSpace
        One input, ``in``, and one output, ``out``; stable, with ``order`` states.

    Raises
    ------
    TypeError, ValueError
        If a gain or the corner is not positive, or the order is neither 1 nor 2.

    Examples
    --------
    >>> import boomctl as bc
    >>> weight = bc.shelf(10.0, 0.1, corner=2.0)
    >>> abs(weight.frequency_response([0.0, 2.0, 1e6]).complex).round(3)
    array([10. ,  1. ,  0.1])
    """
    a, b, w = positive("low_gain", low_gain), positive("high_gain", high_gain), positive("corner", corner)
    count = whole("order", order, most=2)
    ratio = (b / a) ** (1.0 / count)
    # each factor is (1 + ratio s/pole)/(1 + s/pole) = ratio + (1 - ratio)/(1 + s/pole)
    pole = w * np.sqrt(ratio)
    change = 1.0 - ratio
    if count == 1:
        return _filter([[-pole]], [[pole]], [[a * change]], a * ratio)
    A = [[-pole, 0.0], [pole * change, -pole]]
    return _filter(A, [[pole], [pole * ratio]], [[a * ratio * change, a * change]], a * ratio**2)
