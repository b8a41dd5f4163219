"""Spectra of the platform's motion on a random track, and shaping filters with these spectra for controller design."""

from __future__ import annotations

from dataclasses import dataclass, replace
from importlib import import_module
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from boomctl.arrays import Array
from boomctl.boom.model import ACTUATORS
from boomctl.boom.parameters import BoomParameters
from boomctl.boom.tracks import BAND, SPEEDS, class_number, road_density, track_coherence, wave_band
from boomctl.boom.tractor import TractorParameters, tractor_lti
from boomctl.checks import frequencies, positive, whole, within
from boomctl.lti.system import Lti, append, series, static
from boomctl.parameters import or_default
from boomctl.printing import compact
from boomctl.threads import one_blas_thread

if TYPE_CHECKING:
    import control
    from matplotlib.axes import Axes

_FITTED_HZ = (0.04, 6.0)  # band of the fit: from far below a boom's first yaw mode to above its first bending modes
_MOST_SECTIONS = 20  # fitted in ten seconds; more do not come closer (a choice)
_PER_OCTAVE = 12  # points of the fit: four within the width of the smoothing (a choice)
_SMOOTHED_OCTAVES = 1.0 / 3.0  # over which the comb of front and rear wheels is averaged: a third, as acousticians do
_DAMPING = (0.02, 1.5)  # range of the fitted damping ratios: narrower peaks would follow single teeth of the comb


@dataclass(frozen=True, eq=False)
class PlatformDensity:
    """One-sided densities of the platform's motion.

    Attributes
    ----------
    freq_hz : (n,) ndarray
        Frequencies [Hz].
    jolt : (n,) ndarray
        Density of the half sum of the actuators' displacements [m^2/Hz].
    difference : (n,) ndarray
        Density of their half difference, ``yaw * actuator_distance/2`` [m^2/Hz]; the two are independent.
    """

    freq_hz: Array
    jolt: Array
    difference: Array

    __repr__ = compact

    def plot(self, ax: Axes | None = None, **style: Any) -> Axes:
        """Draw both densities over frequency.

        Parameters
        ----------
        ax : matplotlib Axes, optional
            Where to draw; by default a new figure of pyplot.
        **style
            Of the curves, as matplotlib's lines take it; a ``label`` stands before their names.

        Returns
        -------
        matplotlib.axes.Axes
            Those drawn on.
        """
        return import_module("boomctl.plotting").plot_density(self, ax, **style)


@one_blas_thread
def platform_density(
    freq_hz: ArrayLike,
    tractor: TractorParameters | None = None,
    speed: float = 2.5,
    road_class: str | int = "C",
    *,
    coherence: str = "isotropic",
    band: tuple[float, float] = BAND,
    actuator_distance: float = BoomParameters.actuator_distance,
) -> PlatformDensity:
    """Return the exact spectral densities of the platform's motion on a random track.

    The motion that :func:`platform_motion` computes on :func:`iso_track` is a sample of them.

    On a track that does not go round it is one when the start is over.

    Parameters
    ----------
    freq_hz : array_like
        Frequencies above zero [Hz].
    tractor, speed, actuator_distance
        As for :func:`platform_motion`.
    road_class, coherence, band
        As for :func:`iso_track`.

    Returns
    -------
    PlatformDensity
        One-sided densities of the actuators' half sum and half difference [m^2/Hz].

    Raises
    ------
    TypeError, ValueError
        As for :func:`platform_motion` and :func:`iso_track`; a frequency of zero; numbers so far out that the densities
        are not finite.

    Examples
    --------
    >>> import boomctl as bc
    >>> density = bc.boom.platform_density([0.5, 1.0], speed=2.5, road_class="D")
    >>> [f"{value:.2e}" for value in density.jolt]  # m^2/Hz
    ['6.45e-06', '9.19e-07']
    """
    low, high = wave_band(band)
    p, V = or_default(TractorParameters, "tractor", tractor), within("speed", speed, *SPEEDS, "m/s")
    system = tractor_lti(p, V, positive("actuator_distance", actuator_distance))
    f = frequencies("freq_hz", freq_hz)
    wave = f / V
    if (wave <= 0.0).any():
        raise ValueError(f"freq_hz: expected frequencies above zero, got {f.min():g} at a speed of {V:g} m/s")
    inside = (wave >= low) & (wave <= high)
    ground = np.zeros(len(f))
    if inside.any():
        ground[inside] = road_density(road_class, wave[inside]) / V
    else:
        class_number(road_class)
    common = track_coherence(wave, p.track_width, coherence)
    response = system.response(2.0 * np.pi * f)
    ahead = np.exp(2j * np.pi * f * p.wheelbase / V)
    left, right = (response[:, 0 + i] * ahead + response[:, 2 + i] for i in (0, 1))
    jolt = 0.5 * (left[0] + left[1] + right[0] + right[1])
    difference = 0.5 * (left[0] - left[1] - right[0] + right[1])
    with np.errstate(over="ignore", invalid="ignore"):
        parts = [
            np.abs(moved) ** 2 * ground * 0.5 * share
            for moved, share in ((jolt, 1.0 + common), (difference, 1.0 - common))
        ]
    if not np.isfinite(parts).all():
        raise ValueError(
            f"speed = {V:g}, actuator_distance = {actuator_distance:g}: the densities are not finite at"
            f" {f.min():g} to {f.max():g} Hz"
        )
    return PlatformDensity(f, *parts)


@one_blas_thread
def track_filter(
    tractor: TractorParameters | None = None,
    speed: float = 2.5,
    road_class: str | int = "C",
    *,
    sections: int = 3,
    coherence: str = "isotropic",
    actuator_distance: float = BoomParameters.actuator_distance,
) -> control.StateSpace:
    """Return a small filter from white noise to the platform's motion, for use as a disturbance weight.

    Parameters
    ----------
    tractor, speed, road_class, coherence, actuator_distance
        As for :func:`platform_density`.
    sections : int
        Pairs of poles each of jolt and yaw.

    Returns
    -------
    control.StateSpace
        Inputs ``track_jolt``, ``track_yaw``: independent white noises of unit intensity (two-sided density 1, so that a
        response ``H`` gives the one-sided density ``2 |H|^2`` a hertz).  Outputs ``actuator_left``, ``actuator_right``
        [m].  Stable, minimum-phase, strictly proper with a finite velocity; ``4 sections`` states.

    Raises
    ------
    TypeError, ValueError
        As for :func:`platform_density`.
    ArithmeticError
        The fit did not converge.

    Notes
    -----
    Front and rear wheels meet the same ground one after the other, which engraves a comb into the densities.  The
    filter follows them smoothed over a third of an octave, from 0.04 to 6 Hz, in the least squares of the logarithm;
    its gain is then set so that the RMS velocity in that band is that of the density itself.  With three sections and
    the usual tractor at 1.5 to 4 m/s the smoothed densities agree within 2 dB (RMS from 0.05 to 5 Hz); the deepest
    notch of the comb, at ``V/(2 wheelbase)``, is filled by up to 8 dB.  The edges of the track's band are not modelled.

    Examples
    --------
    >>> import boomctl as bc
    >>> shape = bc.boom.track_filter(speed=2.5, road_class="D")
    >>> shape.nstates, shape.input_labels
    (12, ['track_jolt', 'track_yaw'])
    >>> round(1000.0 * bc.h2_norm(shape).value, 1)  # RMS motion of both actuators [mm]
    5.8
    """
    count = whole("sections", sections, most=_MOST_SECTIONS)
    f = np.geomspace(*_FITTED_HZ, 6000)
    wide = np.geomspace(_FITTED_HZ[0] / 2, _FITTED_HZ[1] * 2, 8000)
    exact = platform_density(
        wide, tractor, speed, road_class, coherence=coherence, actuator_distance=actuator_distance, band=(1e-9, 1e9)
    )
    parts = []
    for name, density in (("jolt", exact.jolt), ("yaw", exact.difference)):
        if not density.any():
            parts.append(static(np.zeros((1, 1))))
            continue
        fitted = _fitted(wide, density, f, count)
        parts.append(replace(fitted, states=tuple(f"{name}_{i + 1}" for i in range(len(fitted.A)))))
    both = append(*parts)
    sides = np.array([[1.0, -1.0], [1.0, 1.0]])  # left and right actuator of half sum and half difference
    mixed = replace(both, C=sides @ both.C, inputs=("track_jolt", "track_yaw"), outputs=ACTUATORS)
    return mixed.statespace("track_filter")


def _fitted(wide: Array, density: Array, f: Array, sections: int) -> Lti:
    """Return a minimum-phase filter whose squared magnitude follows a density."""
    from scipy.optimize import least_squares

    octaves = np.log2(f[-1] / f[0])
    grid = np.geomspace(f[0], f[-1], int(_PER_OCTAVE * octaves))
    target = _smoothed(wide, density, grid)
    s = 2j * np.pi * grid

    def mismatch(x: Array) -> Array:
        return np.log(2.0 * np.abs(_magnitude(x, s)) ** 2 / target)

    def slopes(x: Array) -> Array:
        return _log_slopes(x, 2.0 * np.pi * grid)

    start = _start(target, sections)
    low, high = _bounds(grid, sections)
    result = least_squares(
        mismatch, np.clip(start, low + 1e-9, high - 1e-9), jac=slopes, bounds=(low, high), max_nfev=400
    )
    if not np.isfinite(result.cost):
        raise ArithmeticError("the track filter's fit did not converge")
    x = result.x.copy()
    exact = np.interp(f, wide, density)
    found = 2.0 * np.abs(_magnitude(x, 2j * np.pi * f)) ** 2
    x[0] += 0.5 * np.log(np.trapezoid(exact * f**2, f) / np.trapezoid(found * f**2, f))
    return _realized(x)


def _smoothed(wide: Array, density: Array, grid: Array) -> Array:
    """Return a density averaged over a third of an octave around each frequency."""
    power = np.concatenate([[0.0], np.cumsum(0.5 * (density[1:] + density[:-1]) * np.diff(wide))])
    half = 2.0 ** (0.5 * _SMOOTHED_OCTAVES)
    return (np.interp(grid * half, wide, power) - np.interp(grid / half, wide, power)) / (grid * half - grid / half)


def _split(x: Array) -> tuple[float, Array, Array]:
    """Return the gain, and frequency [rad/s] and damping ratio of each pair of poles and of zeros (2 x k)."""
    values = np.exp(x)
    poles = (len(values) + 1) // 4
    return float(values[0]), values[1 : 1 + 2 * poles].reshape(2, -1), values[1 + 2 * poles :].reshape(2, -1)


def _magnitude(x: Array, s: Array) -> Array:
    """Return ``gain * prod (s^2/w^2 + 2 z s/w + 1)_zeros / prod (...)_poles``."""
    gain, poles, zeros = _split(x)
    value = np.full(s.shape, gain, dtype=complex)
    for w, z in zeros.T:
        value = value * ((s / w) ** 2 + 2.0 * z * s / w + 1.0)
    for w, z in poles.T:
        value = value / ((s / w) ** 2 + 2.0 * z * s / w + 1.0)
    return value


def _log_slopes(x: Array, omega: Array) -> Array:
    """Return the derivatives of the logarithm of the squared magnitude by ``x``, (frequencies, len(x))."""
    _, poles, zeros = _split(x)
    columns = [np.full((len(omega), 1), 2.0)]
    for (w, z), sign in ((poles, -1.0), (zeros, 1.0)):
        ratio = (omega[:, None] / w) ** 2
        size = (1.0 - ratio) ** 2 + 4.0 * z**2 * ratio
        by_damping = 8.0 * z**2 * ratio / size
        columns += [sign * (4.0 * ratio * (1.0 - ratio) / size - by_damping), sign * by_damping]
    return np.hstack(columns)


def _start(target: Array, sections: int) -> Array:
    """Return poles and zeros spread over the band, without a peak between them."""
    marks = np.geomspace(2 * np.pi * 0.3, 2 * np.pi * 4.0, 2 * sections - 1)
    poles, zeros = marks[::2], marks[1::2]
    level = 0.5 * np.log(0.5 * float(target[len(target) // 4]))
    return np.concatenate(
        [[level], np.log(poles), np.full(sections, np.log(0.2)), np.log(zeros), np.full(sections - 1, np.log(0.2))]
    )


def _bounds(grid: Array, sections: int) -> tuple[Array, Array]:
    frequency = np.log(2.0 * np.pi * np.array([grid[0] / 4, grid[-1] * 1.5]))
    damping = np.log(_DAMPING)
    blocks = [(sections, frequency), (sections, damping), (sections - 1, frequency), (sections - 1, damping)]
    low, high = (
        np.concatenate([[side], *(np.full(n, b[i]) for n, b in blocks)]) for i, side in ((0, -60.0), (1, 60.0))
    )
    return low, high


def _realized(x: Array) -> Lti:
    """Return the cascade: first the pair of poles without zeros, then a pair of zeros with each."""
    gain, poles, zeros = _split(x)
    poles = poles[:, np.argsort(poles[0])]
    zeros = zeros[:, np.argsort(zeros[0])]
    cascade = static(np.full((1, 1), gain))
    for i, (w, z) in enumerate(poles.T):
        ratio, damping = (0.0, 0.0) if i == 0 else (w / zeros[0, i - 1], zeros[1, i - 1])
        c = np.array([[1.0 - ratio**2, 2.0 * damping * ratio - 2.0 * z * ratio**2]])
        section = Lti(np.array([[0.0, w], [-w, -2.0 * z * w]]), np.array([[0.0], [w]]), c, np.full((1, 1), ratio**2))
        cascade = series(cascade, section)
    return cascade
