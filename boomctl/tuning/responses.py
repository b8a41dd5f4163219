"""Frequency responses of channels of a closed loop: peaks on a grid that follows the poles, and their derivatives."""

from dataclasses import dataclass
from functools import cached_property
from math import inf, isfinite
from typing import NamedTuple

import numpy as np

from boomctl.arrays import Array
from boomctl.lti.frequency import top_of_resonance
from boomctl.lti.rounding import ALIKE, ROOT, TINY
from boomctl.tuning.loops import Closed

_ROUNDS = 6  # bracket refinements, each to a tenth or less of the width for a smooth peak
_CLOSE = 0.05  # fraction of a bracket on either side of the interpolated peak
WINDOW = 0.1  # relative window below the highest peak within which peaks are refined
BELOW = 0.8  # assumed least ratio of the grid's values to a peak, since the grid follows the poles


class Passage(NamedTuple):
    """Channel at one frequency: singular value decomposition of its response, and its derivatives by the controller.

    A change ``d`` of the controller's matrices changes the response by ``left @ d @ right`` to first order; ``around`` is
    the feedback of ``d`` on itself.
    """

    U: Array
    values: Array
    Vh: Array
    left: Array
    right: Array
    around: Array


class Bracket(NamedTuple):
    """Three frequencies around a peak, and their values; the middle one is the highest."""

    low: float
    middle: float
    high: float
    left: float
    top: float
    right: float

    @property
    def narrow(self) -> bool:
        """True at convergence: the bracket is narrow or flat."""
        flat = min(self.left, self.top, self.right) >= self.top * (1.0 - ALIKE)
        return flat or not self.high - self.low > ROOT * self.high

    def candidates(self) -> list[float]:
        """Return the next frequencies: around the peak of the resonance through the three points."""
        low, middle, high = self[:3]
        try:
            vertex = top_of_resonance(*self)
        except ZeroDivisionError:  # flat, or zero at an end
            vertex = middle
        if not low < vertex < high:
            vertex = middle
        distance = _CLOSE * (high - low)
        ends = max(vertex - distance, low), min(vertex + distance, high)
        return [ends[0], vertex, ends[1], 0.5 * (low + middle), 0.5 * (middle + high)]

    def narrowed(self, omega: list[float], values: list[float]) -> "Bracket":
        """Return the bracket around the highest known value."""
        known = sorted([*zip(self[:3], self[3:], strict=True), *zip(omega, values, strict=True)])
        heights = [height for _, height in known]
        best = heights.index(max(heights))
        around = [known[k] for k in (max(best - 1, 0), best, min(best + 1, len(known) - 1))]
        return Bracket(*(frequency for frequency, _ in around), *(value for _, value in around))


@dataclass(frozen=True)
class Response:
    """Channel of a closed loop, ``C (s - A)^-1 B + D``, in coordinates for fast solving.

    Derivatives use further inputs, the changes of the controller, and further outputs, the inputs of the controller.

    Attributes
    ----------
    loop : Closed
    rows, columns : ndarray
        Indices of the channel in the loop.
    known : ndarray
        Additional frequencies of the grid.
    """

    loop: Closed
    rows: Array
    columns: Array
    known: Array

    @cached_property
    def A(self) -> Array:
        """State matrix: upper triangular, or a vector if it is diagonal."""
        return self.loop.coordinates[0]

    @cached_property
    def D(self) -> Array:
        """Feedthrough."""
        return self.loop.D[np.ix_(self.rows, self.columns)]

    @cached_property
    def through(self) -> float:
        """Largest singular value at infinite frequency."""
        return float(_largest(self.D[:, :, None])[0]) if self.D.any() else 0.0

    @cached_property
    def _ends(self) -> tuple[Array, Array]:
        """Input and output matrices of the channel in these coordinates."""
        _, into, out_of = self.loop.coordinates
        return into @ self.loop.B[:, self.columns], self.loop.C[self.rows] @ out_of

    @cached_property
    def _residues(self) -> Array:
        """Residues of the entries of the response, one column per pole."""
        B, C = self._ends
        return (C[:, None] * B.T).reshape(self.D.size, len(self.A))

    def response(self, omega: Array) -> Array:
        """Return the frequency response, shape (outputs, inputs, frequencies)."""
        (p, m), D = self.D.shape, self.D[:, :, None]
        if self.A.ndim == 2:  # without independent eigenvectors, which is rare
            return np.moveaxis(self.through_states(omega, 1)[:, :p, :m], 0, 2) + D
        shared = omega is self.loop.frequencies
        inverse = self.loop.inverses if shared else 1.0 / (1j * omega - self.A[:, None])
        return (self._residues @ inverse).reshape(p, m, len(omega)) + D

    def largest(self, omega: Array) -> Array:
        """Return the largest singular values."""
        with np.errstate(all="ignore"):
            result = _largest(self.response(omega))
        return np.where(np.isfinite(result), result, np.inf)

    @cached_property
    def coarse(self) -> tuple[Array, Array, float]:
        """Grid, its largest singular values, and their maximum, including infinite frequency."""
        omega = self.loop.frequencies
        omega = np.union1d(omega, self.known) if len(self.known) else omega
        values = self.largest(omega)
        return omega, values, float(values.max(initial=self.through))

    @cached_property
    def peaks(self) -> tuple[Array, Array]:
        """Frequencies and values of the local maxima near the highest, highest first; possibly at ``inf``."""
        omega, values, highest = self.coarse
        left, right = np.append(values[:1], values[:-1]), np.append(values[1:], values[-1:])
        tops = np.flatnonzero((values >= left) & (values >= right))
        # a maximum on the grid may be near a higher peak: slightly lower ones are refined too
        tops = tops[values[tops] >= (1.0 - WINDOW) * highest * BELOW]
        frequencies, heights = omega.tolist(), values.tolist()
        brackets = [
            Bracket(
                *(item[i] for item in (frequencies, heights) for i in (max(k - 1, 0), k, min(k + 1, len(omega) - 1)))
            )
            for k in tops.tolist()
        ]
        for _ in range(_ROUNDS):
            going = [k for k, bracket in enumerate(brackets) if not bracket.narrow]
            if not going:
                break
            requests = [brackets[k].candidates() for k in going]
            result = self.largest(np.array(requests).ravel()).reshape(-1, len(requests[0])).tolist()
            for k, more, there in zip(going, requests, result, strict=True):
                brackets[k] = brackets[k].narrowed(more, there)
        both = [(bracket.top, bracket.middle) for bracket in brackets]
        if self.through > 0.0:
            both.append((self.through, inf))
        both.sort(key=lambda pair: -pair[0])
        distinct: list[tuple[float, float]] = []
        for value, at in both:
            # neighbors on the grid may converge to the same peak
            if value >= (1.0 - WINDOW) * both[0][0] and not any(
                same_frequency(at, k[1], 10.0 * ROOT) for k in distinct
            ):
                distinct.append((value, at))
        return np.array([at for _, at in distinct]), np.array([value for value, _ in distinct])

    @cached_property
    def _paths(self) -> tuple[Array, Array, Array]:
        """Input, output and feedthrough matrices of the channel and the controller's changes together."""
        loop, n, (_, into, out_of), (B, C) = self.loop, len(self.A), self.loop.coordinates, self._ends
        top = np.concatenate([self.D, loop.before[n + self.rows]], axis=1)
        feedthrough = np.concatenate([top, np.concatenate([loop.after[:, n + self.columns], loop.around], axis=1)])
        enters = np.concatenate([B, into @ loop.before[:n]], axis=1)
        return enters, np.concatenate([C, loop.after[:, :n] @ out_of]), feedthrough

    def through_states(self, omega: Array, power: int) -> Array:
        """Return output times a power of the resolvent times input matrix at finite frequencies, (n, p + c, m + r)."""
        A, (enters, leaves, _) = self.A, self._paths
        if A.ndim == 1:
            return (leaves * (1j * omega[:, None] - A)[:, None, :] ** -power) @ enters
        # a pole on the axis gives infinite entries, no error
        resolvent = np.linalg.inv((1j * omega[:, None, None] + TINY) * np.eye(len(A)) - A)
        return leaves @ np.linalg.matrix_power(resolvent, power) @ enters

    def passages(self, omega: Array) -> list[Passage]:
        """Return the channel at frequencies, which may be infinite."""
        whole = np.repeat(self._paths[2][None].astype(complex), len(omega), axis=0)
        finite = np.isfinite(omega)
        if finite.any() and len(self.A):
            whole[finite] += self.through_states(omega[finite], 1)
        p, m = self.D.shape
        U, values, Vh = np.linalg.svd(whole[:, :p, :m], full_matrices=False)
        parts = (U, values, Vh, whole[:, :p, m:], whole[:, p:, :m], whole[:, p:, m:])
        return [Passage(*item) for item in zip(*parts, strict=True)]


def _largest(G: Array) -> Array:
    """Return the largest singular values of matrices that lie along the last axis."""
    fewer = min(G.shape[:2])
    if fewer == 0:
        return np.zeros(G.shape[2])
    return np.sqrt((G.real**2 + G.imag**2).sum(axis=(0, 1)) if fewer == 1 else _largest_eigenvalues(G))


def _largest_eigenvalues(G: Array) -> Array:
    """Return the squares of the largest singular values of matrices that lie along the last axis."""
    G = G if len(G) <= G.shape[1] else G.swapaxes(0, 1)
    if len(G) == 2:
        (a, d), product = (G.real**2 + G.imag**2).sum(axis=1), (G[0] * G[1].conj()).sum(axis=0)
        return 0.5 * (a + d) + np.hypot(0.5 * (a - d), np.abs(product))
    G = G.transpose(2, 0, 1)
    gram = G @ G.conj().swapaxes(1, 2)
    there = np.isfinite(gram).all(axis=(1, 2))
    result = np.full(len(G), np.inf)
    if there.any():
        result[there] = np.linalg.eigvalsh(gram[there])[:, -1]
    return np.maximum(result, 0.0)


def same_frequency(a: float, b: float, rtol: float) -> bool:
    """Return True if two frequencies are equal to a fraction of the higher one; infinity equals itself only."""
    return a == b or (isfinite(a) and isfinite(b) and abs(a - b) <= rtol * max(abs(a), abs(b)))
