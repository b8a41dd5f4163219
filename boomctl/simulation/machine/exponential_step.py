"""One explicit step of vibrations under forces that are not linear.

``z'' + Omega^2 z = r(z, z', u)``: the vibration is taken by its exact flow, the remainder by Krogstad's (2005) exponential
Runge-Kutta scheme of fourth order, which integrates a parabola through the remainder's values against that flow.  Forces that
run along straight lines are exact by that, and modes that nothing excites may turn many times in a step.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import lru_cache
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from boomctl.arrays import Array

if TYPE_CHECKING:
    import casadi

    Pushed: TypeAlias = Callable[[int, casadi.SX], casadi.SX]  # motion from rest under accelerations g (t / h)^power

_SERIES = 1.0  # square of the angle of a step below which closed forms lose digits, and a series is summed
_TERMS = 9  # of that series: 1 / 19! = 8e-18 is left out where the angle is 1


def exponential_step(
    remainder: casadi.Function, omega: Array, h: float, z: casadi.SX, first: casadi.SX, last: casadi.SX
) -> casadi.SX:
    """Return modal coordinates and rates after a step.

    Parameters
    ----------
    remainder : casadi.Function
        ``(z, u) -> r``.
    omega : ndarray, m
        Frequencies, rad/s.
    h : float
        Length of the step, s.
    z : casadi.SX, 2 m
        Coordinates and rates.
    first, last : casadi.SX
        Inputs at the beginning and the end; straight lines between.
    """
    import casadi as ca

    m, place, given = len(omega), z[: len(omega)], (first, 0.5 * (first + last), last)
    rate = z[m:]

    def motion(duration: float) -> tuple[casadi.SX, Pushed]:
        c = _numbers(m).call([ca.DM((omega * duration) ** 2)])
        cosine, sine = ca.DM(np.cos(omega * duration)), duration * c[0]
        free = ca.vertcat(cosine * place + sine * rate, cosine * rate - ca.DM(omega**2) * sine * place)
        return free, pushing(c, duration)

    return krogstad(lambda at, stage: remainder(at, given[stage]), z, motion(0.5 * h), motion(h))


def krogstad(
    remainder: Callable[[casadi.SX, int], casadi.SX],
    z: casadi.SX,
    half: tuple[casadi.SX, Pushed],
    whole: tuple[casadi.SX, Pushed],
) -> casadi.SX:
    """Return the state after a step of Krogstad's scheme.

    Parameters
    ----------
    remainder : function of a state and 0, 1 or 2
        What the exact motion leaves out of the accelerations at the beginning, the middle or the end of the step.
    z : casadi.SX
        The state at the beginning.
    half, whole : (casadi.SX, function)
        The state after half a step and after a whole one by the exact motion alone, and `pushing` over that time.
    """
    (at, pushed), (end, thrust) = half, whole
    n1 = remainder(z, 0)
    at += pushed(0, n1)
    n2 = remainder(at, 1)
    n3 = remainder(at + 2.0 * pushed(1, n2 - n1), 1)
    end += thrust(0, n1)
    n4 = remainder(end + 2.0 * thrust(1, n3 - n1), 2)
    both = n2 + n3
    return end + thrust(1, 2.0 * both - 3.0 * n1 - n4) + thrust(2, 2.0 * (n1 + n4 - both))


def pushing(c: Sequence[casadi.SX | casadi.DM], h: float | casadi.SX) -> Pushed:
    """Return ``(k, g) -> z``: undamped motion from rest after a time h under accelerations ``g (t/h)^k``, k = 0, 1, 2.

    ``c`` are Stumpff's functions of the squares of the angles in that time.
    """
    import casadi as ca

    def pushed(k: int, g: casadi.SX) -> casadi.SX:
        size = math.factorial(k)
        return ca.vertcat(size * h**2 * c[k + 1] * g, size * h * c[k] * g)

    return pushed


@lru_cache(maxsize=8)
def _numbers(count: int) -> casadi.Function:
    """Return Stumpff's functions of so many numbers."""
    import casadi as ca

    y = ca.SX.sym("y", count)
    return ca.Function("stumpff", [y], stumpff(y))


def stumpff(y: casadi.SX) -> list[casadi.SX]:
    """Return Stumpff's functions ``c_k(y) = sum_j (-y)^j / (2 j + k)!`` for k = 1 to 4, y >= 0."""
    import casadi as ca

    near = y < _SERIES
    x = ca.sqrt(ca.if_else(near, 1.0, y))
    c1, c2 = ca.sin(x) / x, 2.0 * (ca.sin(0.5 * x) / x) ** 2
    closed, result = [c1, c2, (1.0 - c1) / x**2, (0.5 - c2) / x**2], []
    for k in range(1, 5):
        series = 0.0 * y
        for j in range(_TERMS - 1, -1, -1):
            series = 1.0 / math.factorial(2 * j + k) - y * series
        result.append(ca.if_else(near, series, closed[k - 1]))
    return result
