"""One explicit step of vibrations under forces that are not linear.

``z'' + Omega^2 z = r(z, z', u)``: the vibration is taken by its exact flow, the rest by Krogstad's (2005) exponential
Runge-Kutta scheme of fourth order, which integrates a parabola through the rest's values against that flow.  Forces that
run along straight lines are exact by that, and modes that nothing excites may turn many times in a step.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from boomctl.arrays import Array

if TYPE_CHECKING:
    import casadi

_SERIES = 1.0  # square of the angle of a step below which closed forms lose digits, and a series is summed
_TERMS = 9  # of that series: 1 / 19! = 8e-18 is left out where the angle is 1


def exponential_step(
    rest: casadi.Function, omega: Array, h: float, z: casadi.SX, first: casadi.SX, last: casadi.SX
) -> casadi.SX:
    """Return modal coordinates and rates after a step.

    Parameters
    ----------
    rest : casadi.Function
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
    half, whole = _Flow(omega, 0.5 * h), _Flow(omega, h)
    middle = 0.5 * (first + last)
    n1 = rest(z, first)
    at = half.free(z) + half.pushed(0, n1)
    n2 = rest(at, middle)
    n3 = rest(at + 2.0 * half.pushed(1, n2 - n1), middle)
    end = whole.free(z) + whole.pushed(0, n1)
    n4 = rest(end + 2.0 * whole.pushed(1, n3 - n1), last)
    both = n2 + n3
    return end + whole.pushed(1, 2.0 * both - 3.0 * n1 - n4) + whole.pushed(2, 2.0 * (n1 + n4 - both))


class _Flow:
    """Motion of oscillators over a time."""

    def __init__(self, omega: Array, h: float) -> None:
        c = _stumpff((omega * h) ** 2)
        self._cosine, self._sine, self._omega = np.cos(omega * h), h * c[0], omega
        self._weights = [(math.factorial(k) * h**2 * c[k + 1], math.factorial(k) * h * c[k]) for k in range(len(c) - 1)]

    def free(self, z: casadi.SX) -> casadi.SX:
        """Return the motion without forces."""
        import casadi as ca

        m = len(self._omega)
        p, v, cosine = z[:m], z[m:], ca.DM(self._cosine)
        return ca.vertcat(cosine * p + ca.DM(self._sine) * v, cosine * v - ca.DM(self._omega**2 * self._sine) * p)

    def pushed(self, power: int, acceleration: casadi.SX) -> casadi.SX:
        """Return the motion from rest under accelerations ``g (t / h)^power``, power 0, 1 or 2."""
        import casadi as ca

        place, speed = self._weights[power]
        return ca.vertcat(ca.DM(place) * acceleration, ca.DM(speed) * acceleration)


def _stumpff(y: Array) -> list[Array]:
    """Return Stumpff's functions ``c_k(y) = sum_j (-y)^j / (2 j + k)!`` for k = 1 to 4, y >= 0."""
    near = y < _SERIES
    x = np.sqrt(np.where(near, 1.0, y))
    c1, c2 = np.sin(x) / x, 2.0 * (np.sin(0.5 * x) / x) ** 2
    closed, found = [c1, c2, (1.0 - c1) / x**2, (0.5 - c2) / x**2], []
    for k in range(1, 5):
        series = np.zeros_like(y)
        for j in range(_TERMS - 1, -1, -1):
            series = 1.0 / math.factorial(2 * j + k) - y * series
        found.append(np.where(near, series, closed[k - 1]))
    return found
