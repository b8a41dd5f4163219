"""Explicit step of vibrations under nonlinear forces.

``z'' + Omega^2 z = r(z, z', u)``: the vibration is integrated by its exact flow, the remainder by Krogstad's (2005)
exponential Runge-Kutta scheme of fourth order, which integrates a parabola through the remainder's values against the flow.
Forces that are linear in time are exact, and modes without excitation may vibrate many times in a step.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from boomctl.arrays import Array

if TYPE_CHECKING:
    import casadi

_SERIES = 1.0  # Square of the angle of a step below which closed forms suffer cancellation, and a series is summed.
_TERMS = 9  # Terms of this series: the first omitted one is 1 / 19! = 8e-18 for an angle of 1.


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
        Inputs at the start and the end, linearly interpolated.
    """
    import casadi as ca

    position, rate, middle = z[: len(omega)], z[len(omega) :], 0.5 * (first + last)

    def motion(duration: float) -> tuple[casadi.SX, Callable[[int, casadi.SX], casadi.SX]]:
        """Return the state after undamped motion, and motion from rest under accelerations ``g (t/duration)^k``."""
        c = [ca.DM(item) for item in stumpff((omega * duration) ** 2)]
        cosine, sine = ca.DM(np.cos(omega * duration)), duration * c[0]
        free = ca.vertcat(cosine * position + sine * rate, cosine * rate - ca.DM(omega**2) * sine * position)

        def pushed(k: int, g: casadi.SX) -> casadi.SX:
            size = math.factorial(k)
            return ca.vertcat(size * duration**2 * c[k + 1] * g, size * duration * c[k] * g)

        return free, pushed

    (at, pushed), (end, thrust) = motion(0.5 * h), motion(h)
    n1 = remainder(z, first)
    at += pushed(0, n1)
    n2 = remainder(at, middle)
    n3 = remainder(at + 2.0 * pushed(1, n2 - n1), middle)
    end += thrust(0, n1)
    n4 = remainder(end + 2.0 * thrust(1, n3 - n1), last)
    both = n2 + n3
    return end + thrust(1, 2.0 * both - 3.0 * n1 - n4) + thrust(2, 2.0 * (n1 + n4 - both))


def stumpff(y: Array) -> list[Array]:
    """Return Stumpff's functions ``c_k(y) = sum_j (-y)^j / (2 j + k)!`` for k = 1 to 4, y >= 0."""
    near = y < _SERIES
    x = np.sqrt(np.where(near, 1.0, y))
    c1, c2 = np.sin(x) / x, 2.0 * (np.sin(0.5 * x) / x) ** 2
    closed, result = [c1, c2, (1.0 - c1) / x**2, (0.5 - c2) / x**2], []
    for k in range(1, 5):
        series = np.zeros_like(y)
        for j in range(_TERMS - 1, -1, -1):
            series = 1.0 / math.factorial(2 * j + k) - y * series
        result.append(np.where(near, series, closed[k - 1]))
    return result
