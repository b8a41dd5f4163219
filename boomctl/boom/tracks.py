"""Wheel tracks: seeded random ones of ISO 8608 classes, and a bump.

A track is the height of the ground under the left and the right wheels.  The random ones are stationary Gaussian
processes of one-sided density ``G_d(n) = G_d(n0) (n/n0)^-2`` in the wave number ``n`` [1/m], ``n0 = 0.1 /m``,
``G_d(n0) = 16 * 4^k * 1e-6 m^3`` for class ``k`` (0 is A, 7 is H).  A seed is one ground of 10 km, the sum of its waves
``j/10 km``; a track is its beginning, so that neither length nor step of a track change the ground.

The coherence of two tracks follows from isotropy (Dodds & Robson 1973; Kamash & Robson 1978): if the statistics of the
ground are equal in all directions, the density along a line determines that over the plane, ``S(n, m) ~ (n^2 + m^2)^(-3/2)``
for the exponent -2, and the cross density of two lines at distance ``b`` is its cosine transform over ``m``,

    G_lr(n) = G_d(n) z K1(z),   z = 2 pi n b,

with the modified Bessel function ``K1``: one for waves much longer than ``b``, zero for shorter ones.
"""

from __future__ import annotations

from dataclasses import dataclass
from importlib import import_module
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from boomctl.arrays import Array
from boomctl.checks import (
    exactly,
    finite_array,
    frequencies,
    known,
    positive,
    real,
    span,
    truth,
    up_to,
    whole,
    within,
)
from boomctl.lti.rounding import ALIKE
from boomctl.threads import one_blas_thread

if TYPE_CHECKING:
    from matplotlib.axes import Axes

ROAD_CLASSES = "ABCDEFGH"
COHERENCES = ("isotropic", "full", "none")
REFERENCE_WAVE_NUMBER = 0.1  # 1/m, at which ISO 8608 states the densities of its classes
SPEEDS = (1e-6, 1e6)  # Range of driving speeds [m/s], within which nothing overflows.
BAND = (0.01, 3.0)  # 1/m: waves of 100 m to 0.33 m, 0.025 to 7.5 Hz at 2.5 m/s; tires smooth shorter ones.
_MAX_STEPS = 50_000_000  # Of a track or a motion: 400 MB a signal.
_MOST_WAVES = 5_000_000  # of a ground, 500 to the meter of 10 km: 160 MB of random numbers
GROUND_LENGTH = 10_000.0  # Period of the ground of a seed [m]: 100 of the longest waves, 55 min at 3 m/s.
_BLOCK = 2**15  # Least number of track points summed at once, which limits the rounding error of phases.


@dataclass(frozen=True, eq=False)
class Track:
    """Height of the ground under the left and the right wheels, with linear interpolation between the points.

    Attributes
    ----------
    spacing : float
        Distance between points [m].
    left, right : (n,) ndarray
        Heights under the left and the right wheels [m], at ``0, spacing, 2 spacing, ...`` along the track.
    width : float
        Distance between the two lines [m].
    periodic : bool
        If True, the first point of the track follows its last.  If False, the ground is level before and after it.

    Raises
    ------
    TypeError, ValueError
        If `spacing` or `width` is not above zero, or if heights are not finite, fewer than two or of different number.

    Examples
    --------
    >>> import boomctl as bc
    >>> step_up = bc.boom.Track(spacing=0.5, left=[0.0, 0.1, 0.1], right=[0.0, 0.0, 0.0], width=1.8)
    >>> step_up.heights([0.25, 0.5])  # left and right wheels, 0.25 m and 0.5 m from the beginning
    array([[0.05, 0.1 ],
           [0.  , 0.  ]])
    """

    _made_by = "iso_track(...) or bump_track(...)"

    spacing: float
    left: Array
    right: Array
    width: float
    periodic: bool = False

    def __post_init__(self) -> None:
        for name in ("spacing", "width"):
            positive(name, getattr(self, name))
        truth("periodic", self.periodic)
        for side in ("left", "right"):
            object.__setattr__(self, side, finite_array(side, getattr(self, side), ndim=1))
        if len(self.left) != len(self.right) or len(self.left) < 2:
            raise ValueError(
                f"left, right: expected two heights or more, equally many, got {len(self.left)} and {len(self.right)}"
            )

    def __repr__(self) -> str:
        kind = "periodic" if self.periodic else "with ends"
        left, right = (f"{side.min():.4g} to {side.max():.4g} m" for side in (self.left, self.right))
        sides = f"left {left}, right {right}; {self.width:.4g} m apart"
        return f"Track: {self.length:.6g} m, {kind}, a point each {self.spacing:.4g} m\n  {sides}"

    def plot(self, ax: Axes | None = None, **style: Any) -> Axes:
        """Draw the height of the ground under the left and the right wheels over the distance.

        Parameters
        ----------
        ax : matplotlib Axes, optional
            Axes to draw on.  If None, a new figure is created.
        **style
            Line properties, passed to `matplotlib.axes.Axes.plot`.  ``label`` is prefixed to the line labels.

        Returns
        -------
        matplotlib.axes.Axes
            The axes.
        """
        return import_module("boomctl.plotting.spray").plot_track(self, ax, **style)

    @property
    def distance(self) -> Array:
        """Distances of the points from the beginning of the track [m]."""
        return self.spacing * np.arange(len(self.left))

    @property
    def length(self) -> float:
        """Length of the track, of one round if it is periodic [m]."""
        return self.spacing * (len(self.left) if self.periodic else len(self.left) - 1)

    def heights(self, distance: ArrayLike) -> Array:
        """Return the heights (2 x n: left, right) at positions along the track [m].

        Parameters
        ----------
        distance : (n,) array_like
            Distances from the beginning of the track [m].

        Returns
        -------
        (2, n) ndarray
            Heights under the left and the right wheels [m].

        Raises
        ------
        TypeError, ValueError
            If `distance` is not a vector of finite numbers.
        """
        at, period = finite_array("distance", distance, ndim=1), self.length if self.periodic else None
        return np.array([np.interp(at, self.distance, side, period=period) for side in (self.left, self.right)])


def road_psd(road_class: str | int, wave_number: ArrayLike) -> Array:
    """Return the density of the ground's heights of a road class.

    Source: ISO 8608, geometric means of the classes.

    Parameters
    ----------
    road_class : str or int
        A letter from A to H, or its number from 0.
    wave_number : array_like
        Wave numbers above zero [1/m].

    Returns
    -------
    ndarray
        One-sided displacement density ``G_d(n)`` [m^3].

    Raises
    ------
    TypeError, ValueError
        A class that does not exist; wave numbers that are not finite or not above zero.

    Examples
    --------
    >>> import boomctl as bc
    >>> [f"{value:.2e}" for value in bc.boom.road_psd("C", [0.1, 1.0])]  # 256e-6 m^3 at 0.1/m
    ['2.56e-04', '2.56e-06']
    """
    n = np.asarray(frequencies("wave_number", wave_number))
    if (n == 0.0).any():
        raise ValueError("wave_number: expected values above zero, got 0")
    if isinstance(road_class, str):
        road_class = ROAD_CLASSES.index(known("road_class", road_class, tuple(ROAD_CLASSES)))
    number = whole("road_class", road_class, 0, len(ROAD_CLASSES) - 1)
    return 16e-6 * 4.0**number * (n / REFERENCE_WAVE_NUMBER) ** -2


def track_coherence(wave_number: ArrayLike, width: float, coherence: str = "isotropic") -> Array:
    """Return the coherence of the heights under the left and the right wheels: cross density over density.

    Parameters
    ----------
    wave_number : array_like
        Wave numbers [1/m].
    width : float
        Distance between the two tracks [m].
    coherence : "isotropic", "full" or "none"
        ``"isotropic"`` is ``z K1(z)``, ``z = 2 pi n width``; ``"full"`` is 1 (both wheels on the same ground), ``"none"`` 0.

    Returns
    -------
    ndarray
        Between 0 and 1, for each wave number.

    Raises
    ------
    TypeError, ValueError
        If `coherence` is unknown or a value is not finite.

    Examples
    --------
    >>> import boomctl as bc
    >>> bc.boom.track_coherence([0.01, 0.1, 1.0], width=1.8).round(3)  # long waves lift both sides alike
    array([0.982, 0.548, 0.   ])
    """
    n = frequencies("wave_number", wave_number)
    known("coherence", coherence, COHERENCES)
    positive("width", width)
    if coherence != "isotropic":
        return np.full(n.shape, 1.0 if coherence == "full" else 0.0)
    from scipy.special import k1

    z = 2.0 * np.pi * n * width
    common, some = np.ones(z.shape), z > 0.0
    common[some] = z[some] * k1(z[some])
    return np.minimum(common, 1.0)


@one_blas_thread
def iso_track(
    road_class: str | int = "C",
    length: float = 200.0,
    seed: int = 0,
    *,
    width: float = 1.8,
    spacing: float = 0.02,
    wave_number_range: tuple[float, float] = BAND,
    coherence: str = "isotropic",
    periodic: bool = False,
) -> Track:
    """Return a random track of a road class of ISO 8608, the same for the same seed on every machine.

    A seed determines a profile of 10 km, of which a track is the first part: a longer track begins with the shorter
    one, and a finer track has the same heights at common points. Components that two wave-number ranges have in
    common are equal.

    Parameters
    ----------
    road_class : str or int
        A letter from A to H, or its number from 0.
    length : float
        Length of the track [m], at most 10 km unless periodic.
    seed : int
        Seed of NumPy's PCG64.
    width : float
        Distance between the wheels' tracks [m].
    spacing : float
        Distance between points [m].
    wave_number_range : (float, float)
        Wave numbers [1/m] between which the track has content; none outside.
    coherence : "isotropic", "full" or "none"
        Coherence of left and right, see :func:`track_coherence`.
    periodic : bool
        If True, the track has the period `length`. All wavelengths are integer fractions of `length`, so that tracks
        of different lengths differ.

    Returns
    -------
    Track
        Heights under the left and the right wheels [m].

    Raises
    ------
    TypeError, ValueError
        If `road_class` is unknown, if `length` exceeds the ground, if `spacing` is too long for the shortest wave, if the
        track has no wave within `wave_number_range`, or if this range has too many.

    Notes
    -----
    Half sum and half difference of the two sides are independent, with power spectral densities ``(1 +- coherence)/2
    G_d``; each is the Fourier sum over the wave numbers ``j/length`` with independent Gaussian amplitudes, which has
    that density exactly.

    Examples
    --------
    >>> import boomctl as bc
    >>> rough = bc.iso_track("E", length=100.0, seed=3)
    >>> len(rough.left), rough.length  # points; m
    (5001, 100.0)
    >>> bool((rough.left == bc.iso_track("E", length=100.0, seed=3).left).all())  # the same seed, the same ground
    True
    """
    spacing, round_trip = positive("spacing", spacing), truth("periodic", periodic)
    longest = positive("length", length)
    if longest > GROUND_LENGTH and not round_trip:
        raise ValueError(f"`length` must be at most {GROUND_LENGTH:g} m, got {longest:g} m. Use periodic=True.")
    low, high = span("wave_number_range", wave_number_range)
    if high >= 0.5 / spacing:
        raise ValueError(
            f"spacing = {exactly(spacing)}: expected less than {up_to(0.5 / high)} m, half the shortest wave of the band"
        )
    count = step_count("length", longest, spacing, "m")
    period = count * spacing if round_trip else GROUND_LENGTH
    within("wave_number_range", high, 0.0, _MOST_WAVES / period, "/m")
    # Rounding puts a wave number across the edge of the range by less than ALIKE.
    n = np.arange(1, int(high * period * (1.0 + ALIKE)) + 1) / period
    inside = n >= low * (1.0 - ALIKE)
    if not inside.any():
        raise ValueError(
            f"`wave_number_range` must contain a multiple of {1.0 / period:g} /m, got {low:g} to {high:g} /m."
        )
    common = track_coherence(n, positive("width", width), coherence)
    size = np.zeros(len(n))
    size[inside] = np.sqrt(0.5 * road_psd(road_class, n[inside]) / period)
    drawn = np.random.Generator(np.random.PCG64(whole("seed", seed, least=0))).standard_normal((len(n), 4))
    amplitudes = size * np.sqrt([1.0 + common, 1.0 - common])
    waves = np.zeros((2, len(n) + 1), dtype=complex)
    waves[:, 1:] = amplitudes * drawn.view(complex).T
    if round_trip:
        mean, half = np.fft.irfft(0.5 * count * waves, count)
    else:
        mean, half = _sum_of_waves(waves, spacing / period, count + 1)
    return Track(spacing, mean - half, mean + half, float(width), periodic=round_trip)


def _sum_of_waves(waves: Array, turn: float, count: int) -> Array:
    """Return the real parts of ``sum_k waves[:, k] exp(2 pi i turn k m)`` at ``m = 0 ... count - 1``.

    ``2 k m = k^2 + m^2 - (m - k)^2`` makes a convolution of the sum for any ``turn`` (Bluestein 1970); long ones are
    summed block by block, because phases that grow with the square of ``m`` would be inaccurate.
    """
    from scipy.fft import fft, ifft, next_fast_len

    order = waves.shape[1]
    block = min(count, max(order, _BLOCK))
    size = next_fast_len(order + block - 1)
    k = np.arange(order)
    squares = np.arange(max(order, block), dtype=float) ** 2
    chirp = np.exp(1j * np.pi * np.mod(turn * squares, 2.0))
    kernel = np.zeros(size, dtype=complex)
    kernel[:block] = chirp[:block].conj()
    kernel[size - order + 1 :] = chirp[order - 1 : 0 : -1].conj()
    kernel = fft(kernel)
    summed = np.empty((len(waves), count))
    for begin in range(0, count, block):
        shifted = waves * (chirp[:order] * np.exp(2j * np.pi * np.mod(k * (turn * begin), 1.0)))
        result = ifft(fft(shifted, size) * kernel)[:, :block] * chirp[:block]
        summed[:, begin : begin + block] = result.real[:, : count - begin]
    return summed


def step_count(name: str, extent: float, step: float, unit: str) -> int:
    """Return the number of steps in a length or a duration, at least one and as many as memory holds."""
    if not 0.5 < extent / step <= _MAX_STEPS:
        raise ValueError(
            f"`{name}` must be 1 to {_MAX_STEPS:g} steps of {exactly(step)} {unit} long, got {exactly(extent)} {unit}."
        )
    return round(extent / step)


def bump_track(
    height: float,
    bump_length: float,
    side: str = "left",
    *,
    position: float = 5.0,
    length: float = 50.0,
    width: float = 1.8,
    spacing: float = 0.005,
) -> Track:
    """Return level ground with one bump, ``height (1 - cos(2 pi s/bump_length))/2``, such as a stone.

    Parameters
    ----------
    height : float
        Height of the bump [m]; negative for a pothole.
    bump_length : float
        Length of the bump along the track, from foot to foot [m].
    side : "left", "right" or "both"
        Wheels under which the bump is.
    position : float
        Start of the bump [m].
    length, width, spacing : float
        Length of the track, distance between the wheels, distance between points [m].

    Returns
    -------
    Track
        Not periodic; the ground is level before and after the track.

    Raises
    ------
    TypeError, ValueError
        If the bump is not within the track, or is shorter than ten times the spacing.

    Examples
    --------
    >>> import boomctl as bc
    >>> stone = bc.bump_track(0.05, bump_length=0.4, side="left", position=5.0)
    >>> stone.heights([5.2]).round(3)  # its top, under the left wheels only
    array([[0.05],
           [0.  ]])
    """
    known("side", side, ("left", "right", "both"))
    peak, spacing, whole_length = real("height", height), positive("spacing", spacing), positive("length", length)
    extent = within("bump_length", bump_length, 10.0 * spacing, whole_length, "m")
    begin = within("position", position, 0.0, whole_length - extent, "m")
    s = (spacing * np.arange(step_count("length", whole_length, spacing, "m") + 1) - begin) / extent
    raised = np.where((s > 0.0) & (s < 1.0), 0.5 * peak * (1.0 - np.cos(2.0 * np.pi * s)), 0.0)
    level = np.zeros_like(raised)
    left = raised if side != "right" else level
    return Track(spacing, left, raised if side != "left" else level, positive("width", width))
