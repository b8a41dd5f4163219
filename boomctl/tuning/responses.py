"""Channels of a closed loop over frequency: the peaks of their largest singular values, found on a grid that follows the
poles, and what carries changes of the controller to them.
"""

from dataclasses import dataclass
from functools import cached_property
from math import inf, isfinite, log
from typing import NamedTuple

import numpy as np

from boomctl.arrays import Array
from boomctl.lti.frequency import top_of_resonance
from boomctl.tuning.problem import Closed

_POINTS = 24  # spread evenly in the logarithm, beside the resonances (a choice)
_SPREAD = np.arange(_POINTS) / (_POINTS - 1.0)
_PLACES = np.array([-1.0, 0.0, 1.0])  # around a resonance, in half-widths (a choice)
_SLOWEST = 1e-7  # share of the fastest pole below which no peak is looked for but at zero (a choice)
_NARROWEST = 1e-9  # share of its frequency that a resonance is taken to be wide at least
_ROUNDS = 6  # of narrowing brackets, each to a tenth or less where the peak is smooth (a choice)
_CLOSE = 0.05  # share of a bracket to either side of a parabola's top (a choice)
_PLACED = 1e-7  # relative width of a bracket that needs no narrowing: the value is then known to its square
_FLAT = 1e-9  # share by which a bracket's ends lie below its top where the top is known to its square (a choice)
BELOW = 0.8  # share of a peak's height that the grid shows at least (a choice: it follows the poles)


@dataclass(frozen=True)
class Response:
    """A channel of a closed loop, ``C (s - A)^-1 B + D``, in coordinates in which solving is fast.

    Attributes
    ----------
    poles : (n,) complex ndarray
    A : (n, n) ndarray
        Upper triangular, a vector where it is diagonal.
    B, C, D : ndarray
    """

    poles: Array
    A: Array
    B: Array
    C: Array
    D: Array

    @classmethod
    def of(cls, loop: Closed, columns: Array, rows: Array) -> "Response":
        """Return a channel of a loop."""
        B, C, D = loop.part(columns, rows)
        A, into, out_of = loop.coordinates
        poles = A if A.ndim == 1 else np.diagonal(A)  # in the order of the coordinates
        return cls(poles, A, into @ B, C @ out_of, D)

    @cached_property
    def through(self) -> float:
        """Largest singular value at infinite frequency."""
        return float(_largest(self.D[:, :, None])[0]) if self.D.any() else 0.0

    @cached_property
    def _residues(self) -> Array:
        """What each pole brings to the entries of the response, one after the other."""
        return (self.C[:, None] * self.B.T).reshape(self.D.size, len(self.A))

    def response(self, omega: Array) -> Array:
        """Return the frequency response, shape (outputs, inputs, frequencies)."""
        if self.A.ndim == 2:  # without independent eigenvectors, as is rare
            x = np.zeros((*self.B.shape, len(omega)), complex)
            for i in range(len(x) - 1, -1, -1):  # by substitution from the last state
                known = np.tensordot(self.A[i, i + 1 :], x[i + 1 :], 1)
                x[i] = (self.B[i][:, None] + known) / (1j * omega - self.A[i, i])
            return np.tensordot(self.C, x, 1) + self.D[:, :, None]
        G = self._residues @ (1.0 / (1j * omega - self.A[:, None]))
        return G.reshape(*self.D.shape, len(omega)) + self.D[:, :, None]

    def largest(self, omega: Array) -> Array:
        """Return the largest singular values."""
        with np.errstate(all="ignore"):
            result = _largest(self.response(omega))
        return np.where(np.isfinite(result), result, np.inf)


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


class Bracket(NamedTuple):
    """Three frequencies around a peak, and the values there; the one in the middle is the highest known."""

    low: float
    middle: float
    high: float
    left: float
    top: float
    right: float

    @property
    def narrow(self) -> bool:
        """Whether the peak is known: its place, or its value because the bracket is flat."""
        flat = min(self.left, self.top, self.right) >= self.top * (1.0 - _FLAT)
        return flat or not self.high - self.low > _PLACED * self.high

    def asked(self) -> list[float]:
        """Return where to look next: around the top of the resonance through the three points."""
        low, middle, high = self[:3]
        try:
            vertex = top_of_resonance(*self)
        except ZeroDivisionError:  # flat, or nothing at an end
            vertex = middle
        if not low < vertex < high:
            vertex = middle
        beside = _CLOSE * (high - low)
        ends = max(vertex - beside, low), min(vertex + beside, high)
        return [ends[0], vertex, ends[1], 0.5 * (low + middle), 0.5 * (middle + high)]

    def narrowed(self, omega: list[float], values: list[float]) -> "Bracket":
        """Return the bracket around the highest of all that is known."""
        known = sorted([*zip(self[:3], self[3:], strict=True), *zip(omega, values, strict=True)])
        heights = [height for _, height in known]
        best = heights.index(max(heights))
        around = [known[k] for k in (max(best - 1, 0), best, min(best + 1, len(known) - 1))]
        return Bracket(*(place for place, _ in around), *(value for _, value in around))


def grid(poles: Array, also: Array) -> Array:
    """Return ascending frequencies from zero on that show every resonance."""
    size = np.abs(poles)
    top = float(size.max(initial=0.0))
    seen = size[size > _SLOWEST * top]
    if not len(seen):
        return np.unique(np.concatenate([[0.0], also]))
    resonant = poles[poles.imag > 0.0]
    width = np.maximum(np.abs(resonant.real), _NARROWEST * np.abs(resonant))
    near = (resonant.imag[:, None] + width[:, None] * _PLACES).ravel()
    low, high = log(0.1 * float(seen.min())), log(10.0 * top)
    spread = np.exp(low + (high - low) * _SPREAD)
    real = -poles.real[(poles.imag == 0.0) & (size > _SLOWEST * top)]
    result = np.concatenate([[0.0], spread, near[near > 0.0], np.abs(real), also])
    result.sort()
    return result[np.append(True, result[1:] > result[:-1])]


def coarse(channel: Response, omega: Array) -> tuple[Array, float]:
    """Return the largest singular values on a grid, and the largest of all, that at infinite frequency included."""
    values = channel.largest(omega)
    return values, float(values.max(initial=channel.through))


def peaks(channel: Response, omega: Array, values: Array, window: float) -> tuple[Array, Array]:
    """Return places and values of the local maxima within a share of the highest, highest first; ``inf`` for infinity.

    Parameters
    ----------
    channel : Response
    omega, values : ndarray
        Grid, ascending, and the largest singular values there.
    window : float
        Maxima above ``1 - window`` times the highest are returned, refined.
    """
    left, right = np.append(values[:1], values[:-1]), np.append(values[1:], values[-1:])
    tops = np.flatnonzero((values >= left) & (values >= right))
    # a top on the grid may stand beside one that is higher: what is a little lower is looked at too
    tops = tops[values[tops] >= (1.0 - window) * float(values.max(initial=channel.through)) * BELOW]
    places, heights = omega.tolist(), values.tolist()
    brackets = [
        Bracket(*(item[i] for item in (places, heights) for i in (max(k - 1, 0), k, min(k + 1, len(omega) - 1))))
        for k in tops.tolist()
    ]
    for _ in range(_ROUNDS):
        going = [k for k, bracket in enumerate(brackets) if not bracket.narrow]
        if not going:
            break
        asked = [brackets[k].asked() for k in going]
        result = channel.largest(np.array(asked).ravel()).reshape(-1, len(asked[0])).tolist()
        for k, more, there in zip(going, asked, result, strict=True):
            brackets[k] = brackets[k].narrowed(more, there)
    both = [(bracket.top, bracket.middle) for bracket in brackets]
    if channel.through > 0.0:
        both.append((channel.through, inf))
    both.sort(key=lambda each: -each[0])
    kept: list[tuple[float, float]] = []
    for value, at in both:
        # neighbors on the grid may narrow down to the same peak
        if value >= (1.0 - window) * both[0][0] and not any(same_place(at, k[1], 10.0 * _PLACED) for k in kept):
            kept.append((value, at))
    return np.array([at for _, at in kept]), np.array([value for value, _ in kept])


def same_place(a: float, b: float, share: float) -> bool:
    """Return whether two frequencies are the same to a share of the higher one; infinity is the same as itself alone."""
    return a == b or (isfinite(a) and isfinite(b) and abs(a - b) <= share * max(abs(a), abs(b)))


class Passage(NamedTuple):
    """A channel at one frequency: its response, by singular values, and what carries changes of the controller to it.

    A change ``d`` of the controller's matrices changes the response by ``left @ d @ right``, and reads itself through
    ``around``.
    """

    U: Array
    values: Array
    Vh: Array
    left: Array
    right: Array
    around: Array


@dataclass(frozen=True)
class Paths:
    """A channel of a closed loop whose inputs are changes of the controller too, and whose outputs what the controller reads.

    Attributes
    ----------
    response : Response
        The channel.
    into : (n, m + r) ndarray
        What the inputs and changes of the controller do to the states, in the channel's coordinates.
    out_of : (p + c, n) ndarray
        What the outputs show, and the controller reads, of the states.
    beside : (p + c, m + r) ndarray
        What passes the states by.
    """

    response: Response
    into: Array
    out_of: Array
    beside: Array

    @classmethod
    def of(cls, response: Response, loop: Closed, columns: Array, rows: Array) -> "Paths":
        """Return what leads through a channel of a loop, whose response is known."""
        n, (_, into, out_of) = len(loop.A), loop.coordinates
        top = np.concatenate([response.D, loop.before[n + rows]], axis=1)
        beside = np.concatenate([top, np.concatenate([loop.after[:, n + columns], loop.around], axis=1)])
        entering = np.concatenate([response.B, into @ loop.before[:n]], axis=1)
        return cls(response, entering, np.concatenate([response.C, loop.after[:, :n] @ out_of]), beside)

    def through_states(self, omega: Array, power: int) -> Array:
        """Return what passes at finite frequencies through a power of the resolvent, (frequencies, p + c, m + r)."""
        A = self.response.A
        if A.ndim == 1:
            shares = 1.0 / (1j * omega[:, None] - A)
            weights = shares
            for _ in range(power - 1):
                weights = weights * shares
            return (self.out_of * weights[:, None, :]) @ self.into
        resolvent = np.linalg.inv(1j * omega[:, None, None] * np.eye(len(A)) - A)
        return self.out_of @ np.linalg.matrix_power(resolvent, power) @ self.into

    def passages(self, omega: Array) -> list[Passage]:
        """Return the channel at some frequencies, infinity among them or not."""
        whole = np.repeat(self.beside[None].astype(complex), len(omega), axis=0)
        finite = np.isfinite(omega)
        if finite.any() and len(self.into):
            whole[finite] += self.through_states(omega[finite], 1)
        p, m = self.response.D.shape
        U, values, Vh = np.linalg.svd(whole[:, :p, :m], full_matrices=False)
        parts = (U, values, Vh, whole[:, :p, m:], whole[:, p:, :m], whole[:, p:, m:])
        return [Passage(*item) for item in zip(*parts, strict=True)]
