"""Minimization of nonsmooth functions by BFGS with a weak Wolfe line search (Lewis & Overton 2013)."""

from collections.abc import Callable
from dataclasses import dataclass
from math import inf, isfinite

import numpy as np

from boomctl.arrays import Array
from boomctl.lti.rounding import ALIKE, COMPUTED

_FALL, _TURN = 1e-4, 0.5  # constants of the weak Wolfe conditions: decrease and curvature
_TRIALS = 30  # evaluations of a line search: the step is then accurate to 1e-9, and at a kink nothing ends it earlier
_LITTLE = 1e-3  # smallest predicted decrease of a step, as a fraction of ``gain``
_STALLED = 10  # steps whose total decrease is compared with ``gain``

Function = Callable[[Array], tuple[float, Callable[[], Array]]]


@dataclass(frozen=True)
class Ended:
    """Result of a descent, or of polishing.

    Attributes
    ----------
    x : ndarray
    value : float
    steps : int
    stationary : bool
        True if polishing ended because no step has a predicted decrease.
    """

    x: Array
    value: float
    steps: int
    stationary: bool = False


def descend(
    function: Function,
    x: Array,
    low: Array,
    high: Array,
    *,
    steps: int,
    gain: float,
    enough: Callable[[Array, float], bool] = lambda x, value: False,
) -> Ended:
    """Minimize a function by BFGS.

    Parameters
    ----------
    function : function
        Maps a point to its value and a function that returns its gradient.
    x : ndarray
        Initial point; the value must be finite.
    low, high : ndarray
        Bounds of the variables; a variable at its bound that would violate it is fixed.
    steps : int
        Largest number of steps.
    gain : float
        Ends if the total decrease of ten steps is smaller.
    enough : function, optional
        Stopping criterion: maps a point and its value to a bool.
    """
    x = np.minimum(np.maximum(x, low), high)
    value, slope = function(x)
    if not isfinite(value):
        return Ended(x, value, 0)
    g, n = slope(), len(x)
    H, fresh = np.eye(n), True
    history = [value]
    for k in range(steps):
        if enough(x, value):
            return Ended(x, value, k)
        resting = ((x <= low) & (g > 0.0)) | ((x >= high) & (g < 0.0))
        moving = ~resting
        if not moving.any():
            return Ended(x, value, k)
        d = np.zeros(n)
        d[moving] = -H[np.ix_(moving, moving)] @ g[moving]
        if not np.isfinite(d).all() or g @ d >= 0.0:
            H, fresh = np.eye(n), True
            d = np.where(moving, -g, 0.0)
        falling = float(g @ d)
        if -falling <= _LITTLE * gain:
            return Ended(x, value, k)
        new = _weak_wolfe(function, x, d, value, falling, low, high, fresh)
        if new is None:
            if fresh:
                return Ended(x, value, k)
            H, fresh = np.eye(n), True
            continue
        point, result, gradient = new
        s, y = point - x, gradient - g
        curvature = float(s @ y)
        if curvature > 1e-14 * float(np.linalg.norm(s) * np.linalg.norm(y)) and curvature > 0.0:
            if fresh:
                H = np.eye(n) * (curvature / float(y @ y))
            rho = 1.0 / curvature
            V = np.eye(n) - rho * np.outer(s, y)
            H, fresh = V @ H @ V.T + rho * np.outer(s, s), False
        x, value, g = point, result, gradient
        history.append(value)
        if len(history) > _STALLED and history[-1 - _STALLED] - value < gain:
            return Ended(x, value, k + 1)
    return Ended(x, value, steps)


def _weak_wolfe(
    function: Function,
    x: Array,
    d: Array,
    value: float,
    falling: float,
    low: Array,
    high: Array,
    fresh: bool,
) -> tuple[Array, float, Array] | None:
    """Return a step that satisfies the weak Wolfe conditions; or one with sufficient decrease only, or None."""
    with np.errstate(divide="ignore", invalid="ignore"):
        distance = np.where(d > 0.0, (high - x) / d, np.where(d < 0.0, (low - x) / d, inf))
    longest = float(np.nanmin(distance)) if len(distance) else inf
    t = min(1.0 / max(1.0, float(np.linalg.norm(d))) if fresh else 1.0, longest)
    short, far = 0.0, inf
    best: tuple[Array, float, Array] | None = None
    for _ in range(_TRIALS):
        point = np.minimum(np.maximum(x + t * d, low), high)
        result, slope = function(point)
        if not result <= value + _FALL * t * falling:
            far = t
        else:
            gradient = slope()
            best, short = (point, result, gradient), t
            if gradient @ d >= _TURN * falling or t >= longest:
                return best
        t = 0.5 * (short + far) if far < inf else min(2.0 * t, longest)
        if far < inf and (far - short <= ALIKE * far or -t * falling <= COMPUTED * max(1.0, abs(value))):
            break
    return best
