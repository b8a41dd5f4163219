"""Poles to begin from: a common denominator by linear least squares (polyreference least squares), at many orders."""

from dataclasses import dataclass
from statistics import median

import numpy as np
from scipy import linalg

from boomctl.arrays import Array
from boomctl.identification.modal.spectra import Spectra, rms
from boomctl.lti.rounding import SUMMED

_CIRCLE = 0.95  # Fraction of the unit circle that the band occupies; its ends remain separate.
_NEAR = 0.1  # Largest change of a pole between orders over its frequency.
_OWN = 0.5  # of its decay rate, or of the resolution of the record, that it may move as well


@dataclass(frozen=True)
class Track:
    """Stable pole at several orders.

    Attributes
    ----------
    poles : tuple of complex
        [rad/s]
    orders : tuple of int
        Orders at which it is stable.
    """

    poles: tuple[complex, ...]
    orders: tuple[int, ...]

    @property
    def pole(self) -> complex:
        """The middle one."""
        return complex(median(pole.real for pole in self.poles), median(pole.imag for pole in self.poles))


def poles_by_order(data: Spectra, orders: tuple[int, ...]) -> dict[int, Array]:
    """Return the stable poles within the band at each order [rad/s].

    ``d(q) Y = n(q) U + t(q)`` with polynomials of one degree in ``q = exp(-j 2 pi x)``, where ``x`` goes through the band
    (Peeters et al. 2004, with complex coefficients).  The coefficient of the highest power is one: poles of noise
    alone are then unstable, and fall out.  All products of columns depend on the difference of two powers only.
    """
    omega = data.s.imag
    low, high = omega.min(), omega.max()
    time = 2.0 * np.pi * _CIRCLE / (high - low)
    top = max(orders)
    q = np.exp(-1j * np.outer(np.arange(-top, top + 1), (omega - low) * time))
    regressors = data.U / rms(data.U)
    if data.records:
        regressors = np.concatenate([regressors, (data.record[:, None] == np.arange(data.records))], axis=1)
    r, p = regressors.shape[1], data.Y.shape[1]
    both = np.concatenate([regressors, data.Y], axis=1)
    # mean of conj(a) b q^d for each pair of columns and each difference d
    pairs = (regressors.conj()[:, :, None] * both[:, None, :]).reshape(len(omega), -1)
    products = (q @ pairs).reshape(2 * top + 1, r, r + p)
    own = q @ np.square(np.abs(data.Y)).sum(axis=1)
    # of a lower order are the leading rows and columns: one factor serves all
    index = top + np.arange(top + 1)[None, :] - np.arange(top + 1)[:, None]
    blocks = products[index]  # row power, column power, regressor, column
    R = blocks[..., :r].transpose(0, 2, 1, 3).reshape((top + 1) * r, -1)
    S = blocks[..., r:].transpose(0, 2, 3, 1).reshape((top + 1) * r, -1)
    factor = np.linalg.cholesky(R + SUMMED * np.abs(R).max() * np.eye(len(R)))
    explained = linalg.solve_triangular(factor, S, lower=True, check_finite=False).reshape(len(R), p, top + 1)
    result = {}
    for order in orders:
        part = explained[: (order + 1) * r, :, : order + 1].reshape(-1, order + 1)
        M = own[index[: order + 1, : order + 1]] - part.conj().T @ part
        lowest = linalg.lstsq(M[:-1, :-1], -M[:-1, -1], check_finite=False)[0]  # type: ignore[index]
        roots = np.roots(np.concatenate([[1.0], lowest[::-1]]))
        roots = roots[np.abs(roots) > 1.0]
        angle = np.mod(-np.angle(roots), 2.0 * np.pi)
        at = -np.log(np.abs(roots)) / time + 1j * (low + angle / time)
        result[order] = at[(at.imag <= high) & (at.imag > 0.0)]
    return result


def tracks(by_order: dict[int, Array], resolution: float) -> tuple[Track, ...]:
    """Return which poles of one order are those of another, near in frequency and decay; those of most orders first."""
    chains: list[tuple[list[complex], list[int]]] = []
    for order, poles in sorted(by_order.items()):
        ends = np.array([chain[0][-1] for chain in chains])
        free = np.ones(len(chains), bool)
        new = []
        for pole in sorted(poles, key=lambda item: -item.real):
            distance = np.abs(ends - pole)
            reach = min(_NEAR * pole.imag, max(-_OWN * pole.real, _OWN * resolution))
            near = np.flatnonzero(free & (distance < reach)) if len(ends) else []
            if len(near):
                best = near[np.argmin(distance[near])]
                free[best] = False
                chains[best][0].append(complex(pole))
                chains[best][1].append(order)
            else:
                new.append(([complex(pole)], [order]))
        chains += new
    return tuple(sorted((Track(tuple(p), tuple(o)) for p, o in chains), key=lambda item: -len(item.orders)))
