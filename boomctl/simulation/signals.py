"""Checks of a simulation's arguments: times, disturbances, limits."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from boomctl.arrays import Array
from boomctl.checks import exactly, finite_array, known, mapping, nonnegative, plain_array, positive, whole
from boomctl.lti.rounding import LEVEL

MOST_STEPS = 1e8  # Most steps of a run, and of a delay; bounds the memory of the stored signals.

Levels = float | Mapping[str, float] | None


@dataclass(frozen=True)
class TimeGrid:
    """Requested times, and the finer grid on which the loop is stepped.

    Attributes
    ----------
    time : (n,) ndarray
        Requested times [s].
    h : float
        Step [s].
    per_point, per_sample : int
        Steps from one requested time to the next, and from one sample of the controller to the next.
    """

    time: Array
    h: float
    per_point: int
    per_sample: int

    @property
    def steps(self) -> int:
        """Number of steps."""
        return (len(self.time) - 1) * self.per_point

    def refined(self, rows: Array) -> Array:
        """Return signals at the requested times on the finer grid, by linear interpolation."""
        if self.per_point == 1:
            return rows
        fraction = np.arange(self.per_point) / self.per_point
        lines = rows[:, :-1, None] + fraction * np.diff(rows, axis=1)[:, :, None]
        return np.hstack([lines.reshape(len(rows), -1), rows[:, -1:]])


def uniform_times(timepts: ArrayLike) -> Array:
    """Return times that ascend in equal steps, at least two.

    Raises
    ------
    ValueError
        If they do not; the message gives the position.
    """
    time = finite_array("timepts", timepts, ndim=1)
    if len(time) < 2:
        raise ValueError(f"timepts: expected at least two times, got {len(time)}")
    steps = np.diff(time)
    mean = (time[-1] - time[0]) / (len(time) - 1)
    if mean <= 0.0:
        raise ValueError("timepts: expected ascending times")
    off = np.abs(steps - mean)
    # times printed with seven digits pass
    if off.max() > LEVEL * mean + 1e-12 * np.abs(time).max():
        k = int(off.argmax())
        raise ValueError(
            f"timepts: expected equal steps of {exactly(mean)} s, got {exactly(steps[k])} s after "
            f"{exactly(time[k])} s; resample the signals"
        )
    return time


def time_grid(timepts: ArrayLike, sample_time: float, substeps: int = 1) -> TimeGrid:
    """Return the grid of a loop sampled every ``sample_time``.

    Raises
    ------
    ValueError
        If neither the step of ``timepts`` nor ``sample_time`` is a whole multiple of the other.
    """
    time = uniform_times(timepts)
    sample = positive("sample_time", sample_time)
    step = float(time[-1] - time[0]) / (len(time) - 1)
    per_point, per_sample = max(1, round(step / sample)), max(1, round(sample / step))
    h = min(step, sample)
    if abs(h * per_point - step) > LEVEL * step or abs(h * per_sample - sample) > LEVEL * sample:
        raise ValueError(
            f"sample_time = {exactly(sample)} s, steps of timepts {exactly(step)} s: expected one to be a "
            f"whole multiple of the other"
        )
    if per_point * substeps * (len(time) - 1) > MOST_STEPS:
        raise ValueError(
            f"sample_time = {exactly(sample)} s: {per_point * (len(time) - 1):.3g} samples; expected a run of at most "
            f"{MOST_STEPS:g} steps"
        )
    exact = step / per_point
    return TimeGrid(time, exact / substeps, per_point * substeps, per_sample * substeps)


def disturbance_rows(
    disturbance: Mapping[str, ArrayLike] | ArrayLike | None,
    inputs: Sequence[str],
    driven: Sequence[str],
    points: int,
) -> Array:
    """Return the disturbance of each input of the plant at each time, (inputs, points).

    Parameters
    ----------
    disturbance : mapping from input to array, array or None
        An array has one row for each input that the controller does not drive, in their order; with one such input it
        may have one dimension.  A mapping may name any input: on one that the controller drives it adds up.
    inputs, driven : sequence of str
        All inputs of the plant, and those that the controller drives.
    points : int
        Number of times.

    Raises
    ------
    TypeError, ValueError
        If an input is unknown, a shape is wrong, or a value is not finite (a gap); the message names the input.
    """
    if disturbance is None:
        return np.zeros((len(inputs), points))
    if not isinstance(disturbance, Mapping):
        free = [name for name in inputs if name not in driven]
        values = np.atleast_2d(plain_array("disturbance", disturbance))
        if values.shape != (len(free), points):
            raise ValueError(
                f"disturbances has shape {values.shape}; expected {(len(free), points)}, a row for each of "
                f"{', '.join(free) or 'no inputs'} and a column for each time"
            )
        disturbance = dict(zip(free, values, strict=True))
    return _rows("disturbance", disturbance, "disturbance input", inputs, points)


def sampled_signals(
    what: str, values: Mapping[str, ArrayLike] | None, signals: Sequence[str], grid: TimeGrid
) -> Array | None:
    """Return signals, specified at the requested times, at the samples, (samples, signals); ``None`` for none.

    Raises
    ------
    TypeError, ValueError
        If `values` is not a mapping, a signal is unknown, a shape is wrong, or a value is not finite.
    """
    if values is None:
        return None
    mapping(what, values, f"signals to arrays, those of the controller: {', '.join(signals)}")
    rows = _rows(what, values, f"signal of {what}", signals, len(grid.time))
    return np.ascontiguousarray(grid.refined(rows)[:, :: grid.per_sample].T)


def sampled_noise(noise: Levels, seed: int, signals: Sequence[str], samples: int) -> Array | None:
    """Return independent normal noise with standard deviations ``noise``, (samples, signals); ``None`` if all are zero."""
    level = per_signal("noise", noise, signals, zero=True)
    level[np.isinf(level)] = 0.0
    start = whole("seed", seed, least=0)
    return level * np.random.default_rng(start).standard_normal((samples, len(signals))) if level.any() else None


def _rows(what: str, values: Mapping[str, ArrayLike], kind: str, signals: Sequence[str], points: int) -> Array:
    rows = np.zeros((len(signals), points))
    for name, row in values.items():
        known(kind, name, signals)
        said = f"{what} {name!r}"
        row = plain_array(said, row)
        if row.shape != (points,):
            raise ValueError(f"{said} has shape {row.shape}; expected {(points,)}, a value for each time")
        if row.dtype.kind == "f" and not np.isfinite(row).all():
            gap = int(np.flatnonzero(~np.isfinite(row))[0])
            raise ValueError(f"{said} has a gap: {row[gap]} at point {gap}; fill it before the simulation")
        rows[list(signals).index(name)] = finite_array(said, row)
    return rows


def per_signal(what: str, levels: Levels, signals: Sequence[str], zero: bool = False) -> Array:
    """Return a positive level for each signal, ``inf`` if it has none; with ``zero``, a level of zero counts as none."""
    result = np.full(len(signals), np.inf)
    if levels is None:
        return result

    def check(name: str, value: object) -> float:
        return 0.0 if zero and nonnegative(name, value) == 0.0 else positive(name, value)

    if isinstance(levels, Mapping):
        for name, value in levels.items():
            known(f"signal of {what}", name, signals)
            result[list(signals).index(name)] = check(f"{what}[{name!r}]", value)
    else:
        result[:] = check(what, levels)
    if zero:
        result[result == 0.0] = np.inf
    return result
