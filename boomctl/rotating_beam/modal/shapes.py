"""Mode shapes of the plain clamped-free beam, transverse and axial, in a form that neither overflows nor cancels."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike

from boomctl.arrays import Array


@dataclass(frozen=True)
class TransverseModes:
    """Bending modes of a clamped-free Euler-Bernoulli beam: ``int_0^L f^2 dx = L``, +2 and -2 in turn at the free end.

    The textbook form ``cosh - cos - s (sinh - sin)`` loses all significant digits above mode 12; here it is written as
    ``a exp(-b x) + c exp(-b (L - x)) - cos(b x) + s sin(b x)``.

    Attributes
    ----------
    length : float
        L, m.
    wavenumbers : ndarray, n
        b, 1/m: ``cos(b L) cosh(b L) = -1``.
    clamp_decay, tip_decay, sine : ndarray, n
        The factors a, c and s.
    """

    length: float
    wavenumbers: Array
    clamp_decay: Array
    tip_decay: Array
    sine: Array

    def __call__(self, x: ArrayLike, derivative: int = 0) -> Array:
        """Values of the shapes, or of a derivative with respect to x.

        Parameters
        ----------
        x : array_like
            Places on the beam, m.
        derivative : int
            Order of the derivative.

        Returns
        -------
        ndarray, shape of x + (n,)
        """
        b = self.wavenumbers
        x = np.asarray(x, dtype=float)[..., None]
        quarter = 0.5 * np.pi * derivative
        decaying = (-1.0) ** derivative * self.clamp_decay * np.exp(-b * x)
        decaying = decaying + self.tip_decay * np.exp(-b * (self.length - x))
        return b**derivative * (decaying - np.cos(b * x + quarter) + self.sine * np.sin(b * x + quarter))

    def shortening(self, x: ArrayLike) -> Array:
        """``S(x) = int_0^x f'^T f' dx``, Eq. (20), in closed form.

        Parameters
        ----------
        x : array_like
            Places on the beam, m.

        Returns
        -------
        ndarray, shape of x + (n, n)
        """
        x = np.asarray(x, dtype=float)
        at_x = self._antiderivative(x)
        return at_x - self._antiderivative(np.zeros(1))[0]

    def _antiderivative(self, x: Array) -> Array:
        """Of ``f_i' f_j'``: for i != j from ``f'''' = b^4 f`` by parts, for i = j its limit."""
        scaled = self.wavenumbers
        d = [self(x, k) / scaled**k for k in range(4)]
        b_i, b_j = scaled[:, None], scaled[None, :]
        row, column = [item[..., :, None] for item in d], [item[..., None, :] for item in d]
        bracket = (
            b_i**4 * b_j * row[0] * column[1]
            - b_i**3 * b_j**2 * row[3] * column[2]
            + b_i**2 * b_j**3 * row[2] * column[3]
            - b_i * b_j**4 * row[1] * column[0]
        )
        gap = b_i**4 - b_j**4
        np.fill_diagonal(gap, 1.0)
        result = bracket / gap
        z = x[..., None] * scaled
        equal = 3.0 * d[1] * d[0] + z * d[1] ** 2 - 2.0 * z * d[2] * d[0] - d[2] * d[3] + z * d[3] ** 2
        index = np.arange(scaled.size)
        result[..., index, index] = 0.25 * scaled * equal
        return result


@dataclass(frozen=True)
class AxialModes:
    """Axial modes of a clamped-free bar, ``f = sin((2 i - 1) pi x / 2 L)``.

    Attributes
    ----------
    length : float
        L, m.
    wavenumbers : ndarray, n
        ``(2 i - 1) pi / 2 L``, 1/m.
    """

    length: float
    wavenumbers: Array

    def __call__(self, x: ArrayLike, derivative: int = 0) -> Array:
        """Values of the shapes, or of a derivative with respect to x; shape of x + (n,)."""
        b = self.wavenumbers
        x = np.asarray(x, dtype=float)[..., None]
        return b**derivative * np.sin(b * x + 0.5 * np.pi * derivative)


def transverse_modes(count: int, length: float) -> TransverseModes:
    """Return the first `count` clamped-free bending modes of a beam of a `length` [m]."""
    odd, z = _roots(count)
    sech, decay = _sech(z), np.exp(-z)
    sine = np.tanh(z) / (1.0 + odd * sech)
    tip_decay = (odd + decay) / ((1.0 + decay**2) * (1.0 + odd * sech))
    return TransverseModes(length, z / length, 0.5 * (1.0 + sine), tip_decay, sine)


@lru_cache(maxsize=64)
def _roots(count: int) -> tuple[Array, Array]:
    """1 and -1 in turn, and the roots of ``cos z cosh z = -1`` by the small angle between z and ``(i - 1/2) pi``."""
    odd = np.where(np.arange(count) % 2 == 0, 1.0, -1.0)
    middle = (np.arange(count) + 0.5) * np.pi
    angle = np.zeros(count)
    for _ in range(60):
        angle = odd * np.arcsin(_sech(middle + angle))
    return odd, middle + angle


def axial_modes(count: int, length: float) -> AxialModes:
    """Return the first `count` clamped-free axial modes of a bar of a `length` [m]."""
    return AxialModes(length, (np.arange(count) + 0.5) * np.pi / length)


def _sech(z: Array) -> Array:
    return 2.0 * np.exp(-z) / (1.0 + np.exp(-2.0 * z))
