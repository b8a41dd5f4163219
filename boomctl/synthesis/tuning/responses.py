"""Peaks of the largest singular value of a closed loop over frequency, found on a grid that follows the poles."""

from dataclasses import dataclass

import numpy as np

from boomctl.arrays import Array
from boomctl.lti.frequency import singular_values
from boomctl.synthesis.tuning.problem import Closed

_POINTS = 24  # spread evenly in the logarithm, beside the resonances (a choice)
_PLACES = np.array([-1.0, 0.0, 1.0])  # around a resonance, in half-widths (a choice)
_SLOWEST = 1e-7  # share of the fastest pole below which no peak is looked for but at zero (a choice)
_NARROWEST = 1e-9  # share of its frequency that a resonance is taken to be wide at least
_ROUNDS = 6  # of narrowing brackets, each to a tenth or less where the peak is smooth (a choice)
_CLOSE = 0.05  # share of a bracket to either side of a parabola's top (a choice)
_PLACED = 1e-7  # relative width of a bracket that needs no narrowing: the value is then known to its square
_FLAT = 1e-7  # share by which a bracket's ends lie below its top where the top is known to its square (a choice)
_COLUMNS = 200_000  # entries of states at once: what stays in the cache (a choice)


@dataclass(frozen=True)
class Response:
    """A channel of a closed loop in Schur coordinates: ``C (s - T)^-1 B + D``."""

    T: Array
    B: Array
    C: Array
    D: Array

    @classmethod
    def of(cls, loop: Closed, columns: Array, rows: Array) -> "Response":
        """Return a channel of a loop."""
        B, C, D = loop.part(columns, rows)
        if not len(loop.A):
            return cls(loop.A.astype(complex), B.astype(complex), C.astype(complex), D)
        T, Z = loop.schur
        return cls(T, Z.conj().T @ B, C @ Z, D)

    @property
    def width(self) -> int:
        """Number of inputs."""
        return self.B.shape[1]

    def response(self, omega: Array) -> Array:
        """Return the frequency response, shape (outputs, inputs, frequencies)."""
        n, m = self.B.shape
        if not n:
            return np.repeat(self.D[:, :, None].astype(complex), len(omega), axis=2)
        step = max(1, _COLUMNS // (n * m))
        if len(omega) > step:
            parts = [self.response(omega[i : i + step]) for i in range(0, len(omega), step)]
            return np.concatenate(parts, axis=2)
        dual = len(self.C) < m  # fewer to solve for
        if dual:
            return self._dual(omega)
        T, count = self.T, len(omega)
        shares = 1.0 / (1j * omega - np.diagonal(T)[:, None])
        x = np.empty((n, m, count), complex)
        flat = x.reshape(n, -1)
        x[n - 1] = self.B[n - 1][:, None] * shares[n - 1]
        for i in range(n - 2, -1, -1):
            known = T[i, i + 1 :] @ flat[i + 1 :]
            x[i] = (known.reshape(m, count) + self.B[i][:, None]) * shares[i]
        return (self.C @ flat).reshape(len(self.C), m, count) + self.D[:, :, None]

    def _dual(self, omega: Array) -> Array:
        (n, m), p, count = self.B.shape, len(self.C), len(omega)
        T = self.T
        shares = 1.0 / (1j * omega - np.diagonal(T)[:, None])
        x = np.empty((n, p, count), complex)
        flat = x.reshape(n, -1)
        x[0] = self.C[:, 0][:, None] * shares[0]
        for i in range(1, n):
            known = T[:i, i] @ flat[:i]
            x[i] = (known.reshape(p, count) + self.C[:, i][:, None]) * shares[i]
        found = (self.B.T @ flat).reshape(m, p, count)
        return np.moveaxis(found, 0, 1) + self.D[:, :, None]

    def largest(self, omega: Array) -> Array:
        """Return the largest singular values."""
        with np.errstate(all="ignore"):
            found = singular_values(self.response(omega))[0]
        return np.where(np.isfinite(found), found, np.inf)


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
    spread = np.geomspace(0.1 * float(seen.min()), 10.0 * top, _POINTS)
    real = -poles.real[(poles.imag == 0.0) & (size > _SLOWEST * top)]
    found = np.concatenate([[0.0], spread, near[near > 0.0], np.abs(real), also])
    return np.unique(found)


def peaks(channel: Response, omega: Array, window: float) -> tuple[Array, Array]:
    """Return places and values of the local maxima within a share of the highest, highest first; ``inf`` for infinity.

    Parameters
    ----------
    channel : Response
    omega : ndarray
        Grid, ascending.
    window : float
        Maxima above ``1 - window`` times the highest are returned, refined.
    """
    values = channel.largest(omega)
    last = float(np.linalg.norm(channel.D, 2)) if channel.D.size else 0.0
    k = np.arange(len(omega))
    left, right = values[np.maximum(k - 1, 0)], values[np.minimum(k + 1, len(omega) - 1)]
    tops = np.flatnonzero((values >= left) & (values >= right))
    best = float(values.max(initial=last))
    # a top on the grid may stand beside one that is higher: what is a little lower is looked at too
    tops = tops[values[tops] >= (1.0 - window) * best * 0.8]
    tops = tops[np.argsort(values[tops])[::-1]]
    ends = np.clip(tops[:, None] + np.array([-1, 0, 1]), 0, len(omega) - 1)
    places, heights = omega[ends], values[ends]
    for _ in range(_ROUNDS):
        flat = heights.min(axis=1) >= heights[:, 1] * (1.0 - _FLAT)
        going = (np.ptp(places, axis=1) > _PLACED * places[:, 2]) & ~flat
        heights_going = heights[going]
        if not going.any():
            break
        places[going], heights[going] = _narrowed(channel, places[going], heights_going)
    at, found = places[:, 1], heights[:, 1]
    if last > 0.0:
        at, found = np.append(at, np.inf), np.append(found, last)
    order = np.argsort(found)[::-1]
    at, found = at[order], found[order]
    kept = found >= (1.0 - window) * found[0] if len(found) else np.zeros(0, bool)
    at, found = at[kept], found[kept]
    # neighbours on the grid may narrow down to the same peak
    lone = [i for i in range(len(at)) if not any(_same(at[i], at[j]) for j in range(i))]
    return at[lone], found[lone]


def _same(a: float, b: float) -> bool:
    return a == b or abs(a - b) <= 10.0 * _PLACED * max(abs(a), abs(b))


def _narrowed(channel: Response, omega: Array, heights: Array) -> tuple[Array, Array]:
    """Return narrower brackets ``(low, top, high)``; the inverse square of a resonance is a parabola."""
    (low, middle, high), (left, top, right) = omega.T, heights.T
    with np.errstate(all="ignore"):
        p, q = (middle - low) * ((top / right) ** 2 - 1.0), (middle - high) * ((top / left) ** 2 - 1.0)
        vertex = middle - 0.5 * ((middle - low) * p - (middle - high) * q) / (p - q)
    inside = (vertex > low) & (vertex < high)
    vertex = np.where(inside, vertex, middle)
    beside = _CLOSE * (high - low)
    asked = np.array([vertex - beside, vertex, vertex + beside, 0.5 * (low + middle), 0.5 * (middle + high)])
    asked = np.minimum(np.maximum(asked, low), high).T
    places = np.concatenate([omega, asked], axis=1)
    values = np.concatenate([heights, channel.largest(asked.ravel()).reshape(asked.shape)], axis=1)
    row, order = np.arange(len(places))[:, None], np.argsort(places, axis=1)
    places, values = places[row, order], values[row, order]
    around = np.argmax(values, axis=1)[:, None] + np.array([-1, 0, 1])
    around = np.clip(around, 0, places.shape[1] - 1)
    return places[row, around], values[row, around]
