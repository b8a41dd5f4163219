"""Vectorized functions of frequency: singular values, grids around resonances, the highest peak."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import inf
from operator import itemgetter
from typing import TypeVar

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import lapack

from boomctl.arrays import Array, squared
from boomctl.lti.modal import UNDAMPED, ModalSystem
from boomctl.lti.rounding import ALIKE, CERTIFIED, EPS, ROOT, SOLVED
from boomctl.lti.system import SLOWEST

Response = Callable[[Array], Array]  # from frequencies (N,) to responses (outputs, inputs, N)
Value = TypeVar("Value", float, Array)  # one frequency or height, or many

_AROUND = np.array([-1, 0, 1])  # a point and its neighbors
_CLOSED_FROM = 12  # Number of frequencies above which the closed form is faster than LAPACK.
_PLACED = 1e-10  # Relative bracket width of a peak at which the search stops; the height is then accurate to rounding.
# Distance from the vertex at which a bracket is also evaluated, as a fraction of its width, to enclose the peak.
_CLOSE = 0.03
# Number of highest grid points around which a peak is searched for: the highest peak may be at the second.
_REFINED = 3
# Number of frequencies between the resonances: of curves and of checks without proof, about 100 per decade for a boom; of a
# search that is refined at the peaks.
CURVE = 240
SEARCHED = 60
_STEPS = 12  # Limit on the Newton steps to a peak; typical are three or four.
_TOPS = 3  # Iterations that refine a peak on a grid; each squares the relative error.
_SMOOTH = 0.05  # Largest step of a Nyquist curve, as a fraction of its distance from zero plus one.
_HALVINGS = 10  # Limit on the halvings of a step of a Nyquist curve: a narrow resonance is a circle of many steps.
MODES = 8  # Number of modes shown in a plot by default.
# Limits of the plotted range, as multiples of the lowest and the highest of these frequencies: both sides of a peak.
BELOW, ABOVE = 0.25, 1.5
BEYOND = 100.0  # Range in which a loop is evaluated: this factor below the slowest pole and above the fastest.
RAISED = 30  # Limit on the levels tested; each rises to a higher peak, so that a few suffice.
# Lower limit of a plot without poles, as a fraction of half the sampling rate.
_LOWEST_SHOWN = 0.1
EMPTY = (0.1, 100.0)  # Plotted range of a system without dynamics [rad/s].
NARROWEST = 1e-6  # Least relative width of a drawn resonance; narrower ones look the same.

# Points around a resonance, in half-power half-widths |Re p| from Im p: for a curve, dense at the peak and up to 23
# half-widths to either side; for a search, which is refined at the highest point.
DRAWN = np.sinh(np.linspace(-4.0, 4.0, 33)) / np.sinh(1.0)
SOUGHT = np.array([-3.0, -1.0, -0.5, -0.2, 0.0, 0.2, 0.5, 1.0, 3.0])
_LIGHT = 0.1  # Ratio of decay rate to frequency up to which a mode has a separate resonance.


def singular_values(G: Array) -> Array:
    """Return the singular values of ``G[:, :, f]``, descending, shape (min(p, m), N).

    A single row or column has its norm as singular value.  Two are computed in closed form, at many frequencies.  Otherwise
    LAPACK is used.
    """
    p, m, _ = G.shape
    fewer = min(p, m)
    if fewer == 0:
        return np.zeros((0, G.shape[2]))
    if p == m == 1:
        return np.abs(G[0])
    if fewer == 1:
        with np.errstate(over="ignore"):  # infinite where squares are no numbers
            return np.sqrt(squared(G).sum(axis=(0, 1)))[None, :]
    if fewer > 2 or G.shape[2] < _CLOSED_FROM:
        return np.linalg.svd(G.transpose(2, 0, 1), compute_uv=False).T
    x, y = G.swapaxes(0, 1) if m == 2 else G
    with np.errstate(invalid="ignore", divide="ignore"):
        a, c, b = squared(x).sum(axis=0), squared(y).sum(axis=0), (x.conj() * y).sum(axis=0)
        first = np.sqrt(0.5 * (a + c) + np.hypot(0.5 * (a - c), np.abs(b)))
        if p == m:
            product = np.abs(x[0] * y[1] - x[1] * y[0])
        else:  # Length of one times the orthogonal component of the other.
            product = np.sqrt(a * squared(y - np.where(a > 0.0, b / a, 0.0) * x).sum(axis=0))
        return np.array([first, np.where(first > 0.0, product / first, 0.0)])


def largest_of(D: Array) -> float:
    """Return the largest singular value of a real matrix, in a few calls; zero where it is empty."""
    return float(singular_values(D[:, :, None])[0, 0]) if D.any() else 0.0


def resonance_grid(
    poles: Array,
    low: float,
    high: float,
    *,
    points: int = CURVE,
    places: ArrayLike = SOUGHT,
    narrowest: float = 0.0,
    also: ArrayLike = (),
) -> Array:
    """Return ascending frequencies that resolve every resonance between ``low`` and ``high``.

    Parameters
    ----------
    poles : (n,) complex ndarray
        The grid is dense around the magnitude of each imaginary part.  Omit poles that need no dense grid.
    low, high : float
        Limits of the grid, above zero [rad/s].
    points : int
        Number of logarithmically spaced points, both limits included.
    places : array_like
        Around each resonance, in half-widths from it: ``DRAWN`` or ``SOUGHT``.
    narrowest : float
        Least width of a resonance, as a fraction of its frequency.
    also : array_like
        Further frequencies, inside or outside the limits.
    """
    width = np.maximum(np.abs(poles.real), narrowest * np.abs(poles))
    near = (np.abs(poles.imag)[:, None] + width[:, None] * np.asarray(places)).ravel()
    near = near[(near >= low) & (near <= high)]
    return np.unique(np.concatenate([np.geomspace(low, high, points), near, np.asarray(also, float).ravel()]))


@np.errstate(divide="ignore", invalid="ignore", over="ignore")  # of values at a pole, and of brackets that are flat
def highest_peak(value: Callable[[Array], Array], grid: Array) -> tuple[float, float]:
    """Return the largest value around the highest points of a grid, and its frequency.

    Parameters
    ----------
    value : function from frequencies to nonnegative values
    grid : (n,) ndarray
        Ascending, so fine that the highest peak is among the highest points.
    """
    values = value(grid)
    around = _tops(values)
    omega, heights = grid[around], values[around]
    peak = max(zip(heights[:, 1].tolist(), omega[:, 1].tolist(), strict=True), key=itemgetter(0))
    while len(omega):
        omega, finer = _narrowed(value, omega, heights)
        peak = max(peak, *zip(finer[:, 1].tolist(), omega[:, 1].tolist(), strict=True), key=itemgetter(0))
        # Converged: the last step raised the peak only by rounding, and the bracket is so flat that the error of a parabola's
        # vertex, the square of the flatness, is rounding error.
        flat = (finer[:, 1] <= heights[:, 1] * (1.0 + SOLVED)) & (finer.min(axis=1) >= finer[:, 1] * (1.0 - ROOT))
        going = (omega[:, 2] - omega[:, 0] > _PLACED * omega[:, 2]) & ~flat
        omega, heights = omega[going], finer[going]
    return peak


def _tops(values: Array) -> Array:
    """Return the indices of the highest local maxima and their neighbors, (tops, 3); an end point is its own neighbor."""
    before, after = np.append(-np.inf, values[:-1]), np.append(values[1:], -np.inf)
    tops = np.flatnonzero(~((before > values) | (after > values)))
    tops = tops[values[tops].argsort()[::-1][:_REFINED]]
    return np.minimum(np.maximum(tops[:, None] + _AROUND, 0), len(values) - 1)


def top_of_resonance(low: Value, middle: Value, high: Value, left: Value, top: Value, right: Value) -> Value:
    """Return the frequency of the peak of a resonance from three heights, whose inverse squares are on a parabola.

    Arguments are numbers or arrays.  The result is outside the outer frequencies, or not finite, if there is no peak.
    """
    p = (middle - low) * ((top / right) * (top / right) - 1.0)
    q = (middle - high) * ((top / left) * (top / left) - 1.0)
    return middle - 0.5 * ((middle - low) * p - (middle - high) * q) / (p - q)


def with_peaks(respond: Response, grid: Array, allowed: Callable[[Array], Array]) -> tuple[Array, Array]:
    """Return a grid and the response on it, with every peak of every entry of the response among its frequencies.

    The frequency of a peak is the top of the resonance through its three points.  A second and a third iteration, through
    nearer points, reduce the error below what is visible.

    Parameters
    ----------
    respond : function from frequencies to responses
    grid : (n,) ndarray
        Ascending, so fine that each peak has a separate point.
    allowed : function from frequencies to the subset at which the response can be evaluated
    """
    values = respond(grid)
    for _ in range(_TOPS):
        size = np.abs(values).reshape(-1, len(grid))
        rows, k = np.nonzero((size[:, 1:-1] > size[:, :-2]) & (size[:, 1:-1] >= size[:, 2:]))
        left, top, right = (size[rows, k + i] for i in range(3))
        low, middle, high = (grid[k + i] for i in range(3))
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            vertex = top_of_resonance(low, middle, high, left, top, right)
        inside = (vertex > low) & (vertex < high) & (np.abs(vertex - middle) > _PLACED * middle)
        new = np.setdiff1d(allowed(np.unique(vertex[inside])), grid)
        if not len(new):
            break
        grid, values = np.concatenate([grid, new]), np.concatenate([values, respond(new)], axis=2)
        order = np.argsort(grid)
        grid, values = grid[order], values[:, :, order]
    return grid, values


def smooth_curve(respond: Callable[[Array], Array], omega: Array) -> tuple[Array, Array]:
    """Return refined frequencies at which a complex curve is smooth, and the curve, from a grid that resolves its turns."""
    values = respond(omega)
    for _ in range(_HALVINGS):
        size = np.minimum(np.abs(values[:-1]), np.abs(values[1:]))
        with np.errstate(invalid="ignore"):
            far = np.abs(np.diff(values)) > _SMOOTH * (1.0 + size)
        if not far.any():
            break
        between = 0.5 * (omega[:-1] + omega[1:])[far]
        omega, values = np.append(omega, between), np.append(values, respond(between))
        order = np.argsort(omega)
        omega, values = omega[order], values[order]
    there = np.isfinite(values)
    return omega[there], values[there]


def _narrowed(value: Callable[[Array], Array], omega: Array, heights: Array) -> tuple[Array, Array]:
    """Return narrower brackets of peaks, and the values there, in the order of the frequencies.

    A row is a bracket: its ends and, between or at one of them, its highest point.  Each bracket is evaluated at the top of
    the resonance through its three points, close to either side of it, and at the midpoints, all at once.
    """
    (low, middle, high), (left, top, right) = omega.T, heights.T
    vertex = top_of_resonance(low, middle, high, left, top, right)
    vertex, offset = np.where((vertex > low) & (vertex < high), vertex, middle), _CLOSE * (high - low)
    trial = [vertex - offset, vertex, vertex + offset, 0.5 * (low + middle), 0.5 * (middle + high)]
    new = np.minimum(np.maximum(np.array(trial), low), high).T
    points = np.concatenate([omega, new], axis=1)
    values = np.concatenate([heights, value(new.ravel()).reshape(new.shape)], axis=1)
    row, order = np.arange(len(points))[:, None], points.argsort(axis=1)
    points, values = points[row, order], values[row, order]
    around = values.argmax(axis=1)[:, None] + _AROUND
    around = np.minimum(np.maximum(around, 0), points.shape[1] - 1)
    return points[row, around], values[row, around]


def largest_gain(modes: ModalSystem, respond: Response) -> tuple[float, float]:
    """Return the largest singular value near the poles and at the ends of the axis, and its frequency.

    The peak frequency is searched for in modal coordinates, the height is computed with ``respond``.  If the two heights
    differ, the eigenvectors are nearly dependent, and the search is repeated with the response.
    """
    poles, size = modes.poles, np.abs(modes.poles)
    fastest = float(size.max())
    nonzero = size[size > SOLVED * fastest]
    grid = resonance_grid(
        poles[(poles.imag > 0.0) & (np.abs(poles.real) > UNDAMPED * size)],
        0.1 * max(float(nonzero.min(initial=fastest)), SLOWEST),
        10.0 * max(fastest, SLOWEST),
        points=SEARCHED,
        places=_AROUND,
        also=[0.0] if len(nonzero) == len(size) else (),
    )
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):  # of eigenvectors without accuracy
        response = modes.response(grid)
    peak = np.inf, 0.0
    if np.isfinite(response).all():
        near = grid[_tops(singular_values(response)[0])]
        peak = max(_climbed(modes, *bracket) for bracket in near.tolist())
    return confirmed_peak(peak, lambda omega: singular_values(respond(omega))[0], grid)


@np.errstate(invalid="ignore", over="ignore")  # of modes whose squares are no numbers
def top_of_a_mode(modes: ModalSystem) -> tuple[float, float] | None:
    """Return the largest singular value at the resonance of the mode that is highest alone, and its frequency.

    None if its damping is too high for a resonance.  A sum of other modes may be higher elsewhere, so the caller must prove
    that none is.
    """
    highest = int(modes.sizes.argmax())
    width, omega = -float(modes.poles[highest].real), abs(float(modes.poles[highest].imag))
    return _climbed(modes, omega - width, omega, omega + width) if width <= _LIGHT * omega else None


@np.errstate(divide="ignore", invalid="ignore", over="ignore")
def _climbed(modes: ModalSystem, low: float, omega: float, high: float) -> tuple[float, float]:
    """Return the largest singular value that Newton's method reaches between two frequencies, and its frequency.

    It goes to the top of ``u^H G v``, of the singular vectors of each step, by its inverse square, which is a parabola at a
    resonance.  Infinite where the sum is not finite.
    """
    peak, at = 0.0, omega
    for _ in range(_STEPS):
        factors = 1.0 / (1j * omega - modes.poles)
        G = (modes.C * factors) @ modes.B + modes.D
        if not np.isfinite(G).all():
            return np.inf, at
        u, values, v, _ = lapack.zgesdd(G, full_matrices=0)
        before, height = peak, float(values[0])
        if height > peak:
            peak, at = height, omega
        if abs(height - before) <= ROOT * before:  # Converged, or no resonance, where steps are too small.
            break
        parts = (u[:, 0].conj() @ modes.C) * (modes.B @ v[0].conj()) * (factors * factors / height)
        slope, bend = parts.sum(), float(parts.dot(factors).real)  # of the logarithm, times 1j
        rise = slope.imag**2
        curve = 4.0 * rise - abs(slope) ** 2 + 2.0 * bend
        if not (curve > 0.0 and rise > EPS * curve):
            break
        omega = min(max(omega + float(slope.imag / curve), low), high)
    return peak, at


def confirmed_peak(candidate: tuple[float, float], exact: Callable[[Array], Array], grid: Array) -> tuple[float, float]:
    """Return the ``exact`` height of an approximate peak, and its frequency; repeat the search if the heights differ."""
    shown, at = candidate
    there = float(exact(np.array([at]))[0])
    return (there, at) if abs(shown - there) <= CERTIFIED * there else highest_peak(exact, grid)


@dataclass(frozen=True)
class Resonances:
    """Poles that a curve shows, and its band [rad/s]."""

    poles: Array
    low: float
    high: float

    @classmethod
    def of(cls, rates: Array, high: float | None = None, nyquist: float = inf) -> Resonances:
        """Return the lowest resonances among all poles of a system, or those up to ``high``, and a band that shows them.

        In discrete time, of poles as rates, in a band up to half the sampling rate.
        """
        rates = rates[np.isfinite(rates)]
        size = np.sort(np.abs(rates[np.abs(rates) > ALIKE * np.abs(rates).max(initial=0.0)]))
        low, top = (BELOW * size[0], ABOVE * size[min(len(size), 2 * MODES) - 1]) if len(size) else EMPTY
        top = top if high is None else high
        poles = rates[(rates.imag >= 0.0) & (np.abs(rates) <= top)]
        if nyquist < inf:
            top = min(top, nyquist) if len(poles) else nyquist
            low = min(low, _LOWEST_SHOWN * top)
        return cls(poles[poles.imag <= top], float(low), float(top))

    def curve(self, also: ArrayLike = ()) -> Array:
        """Return frequencies through which a curve shows the poles in the band, and others wherever they lie."""
        return resonance_grid(self.poles, self.low, self.high, places=DRAWN, narrowest=NARROWEST, also=also)
