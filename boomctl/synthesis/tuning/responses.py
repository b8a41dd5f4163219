"""Peaks of the largest singular value of a closed loop over frequency, found on a grid that follows the poles."""

from dataclasses import dataclass
from math import log

import numpy as np

from boomctl.arrays import Array
from boomctl.synthesis.tuning.problem import Closed

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
_COLUMNS = 200_000  # entries of states at once: what stays in the cache (a choice)


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

    def response(self, omega: Array) -> Array:
        """Return the frequency response, shape (outputs, inputs, frequencies)."""
        (n, m), p, count = self.B.shape, len(self.C), len(omega)
        if not n:
            return np.repeat(self.D[:, :, None].astype(complex), count, axis=2)
        shares = 1.0 / (1j * omega - self.poles[:, None])
        if self.A.ndim == 1:
            terms = self.C[:, None, :] * self.B.T
            return (terms.reshape(-1, n) @ shares).reshape(p, m, count) + self.D[:, :, None]
        step = max(1, _COLUMNS // (n * min(m, p)))
        if count > step:
            parts = [self.response(omega[i : i + step]) for i in range(0, count, step)]
            return np.concatenate(parts, axis=2)
        if m <= p:  # the fewer are solved for
            x = np.empty((n, m, count), complex)
            flat = x.reshape(n, -1)
            for i in range(n - 1, -1, -1):
                known = (self.A[i, i + 1 :] @ flat[i + 1 :]).reshape(m, count)
                x[i] = (known + self.B[i][:, None]) * shares[i]
            return (self.C @ flat).reshape(p, m, count) + self.D[:, :, None]
        x = np.empty((n, p, count), complex)
        flat = x.reshape(n, -1)
        for i in range(n):
            known = (self.A[:i, i] @ flat[:i]).reshape(p, count)
            x[i] = (known + self.C[:, i][:, None]) * shares[i]
        return np.moveaxis((self.B.T @ flat).reshape(m, p, count), 0, 1) + self.D[:, :, None]

    def largest(self, omega: Array) -> Array:
        """Return the largest singular values."""
        with np.errstate(all="ignore"):
            G = self.response(omega)
            p, m, _ = G.shape
            if min(p, m) == 0:
                return np.zeros(len(omega))
            if min(p, m) == 1:
                found = np.sqrt((G.real**2 + G.imag**2).sum(axis=(0, 1)))
            else:
                found = np.sqrt(_largest_eigenvalues(np.moveaxis(G, 2, 0)))
        return np.where(np.isfinite(found), found, np.inf)


def _largest_eigenvalues(G: Array) -> Array:
    """Return the squares of the largest singular values of a stack of matrices."""
    adjoint = G.conj().swapaxes(1, 2)
    gram = G @ adjoint if G.shape[1] <= G.shape[2] else adjoint @ G
    there = np.isfinite(gram).all(axis=(1, 2))
    found = np.full(len(G), np.inf)
    if gram.shape[1] == 2:
        a, d, b = np.real(gram[there, 0, 0]), np.real(gram[there, 1, 1]), gram[there, 0, 1]
        found[there] = 0.5 * (a + d) + np.hypot(0.5 * (a - d), np.abs(b))
    elif there.any():
        found[there] = np.linalg.eigvalsh(gram[there])[:, -1]
    return np.maximum(found, 0.0)


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
    found = np.concatenate([[0.0], spread, near[near > 0.0], np.abs(real), also])
    return np.unique(found)


def coarse(channel: Response, omega: Array) -> tuple[Array, float]:
    """Return the largest singular values on a grid, and the largest of all, that at infinite frequency included."""
    values = channel.largest(omega)
    last = float(np.linalg.norm(channel.D, 2)) if channel.D.any() else 0.0
    return values, float(values.max(initial=last))


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
    last = float(np.linalg.norm(channel.D, 2)) if channel.D.any() else 0.0
    k = np.arange(len(omega))
    left, right = values[np.maximum(k - 1, 0)], values[np.minimum(k + 1, len(omega) - 1)]
    tops = np.flatnonzero((values >= left) & (values >= right))
    best = float(values.max(initial=last))
    # a top on the grid may stand beside one that is higher: what is a little lower is looked at too
    tops = tops[values[tops] >= (1.0 - window) * best * BELOW]
    tops = tops[np.argsort(values[tops])[::-1]]
    ends = np.clip(tops[:, None] + np.array([-1, 0, 1]), 0, len(omega) - 1)
    places, heights = omega[ends], values[ends]
    for _ in range(_ROUNDS):
        flat = heights.min(axis=1) >= heights[:, 1] * (1.0 - _FLAT)
        going = (places[:, 2] - places[:, 0] > _PLACED * places[:, 2]) & ~flat
        if not going.any():
            break
        places[going], heights[going] = _narrowed(channel, places[going], heights[going])
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
