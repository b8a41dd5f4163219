"""Piecewise constant or piecewise linear torque as a function of time."""

from __future__ import annotations

from dataclasses import dataclass
from importlib import import_module
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from boomctl.arrays import Array
from boomctl.checks import finite_array, plain_array, shown
from boomctl.maneuvers import TorqueDriven
from boomctl.printing import count

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_SWITCH = 0.5  # fraction of the peak that a torque reaches on both sides of a switch


@dataclass(frozen=True, eq=False)
class TorqueProfile(TorqueDriven):
    """Torque that is linear on each of N intervals, and zero outside them.

    Attributes
    ----------
    edges : ndarray, N + 1
        Boundaries of the intervals [s]; ascending, the first is 0.
    start_values, end_values : ndarray, N
        Torque at the beginning and at the end of each interval [N m].
    unit : str
        Unit for texts and plots: "N m", or empty for a linear system with unspecified units.
    """

    edges: Array
    start_values: Array
    end_values: Array
    unit: str = "N m"

    def __post_init__(self) -> None:
        for name in ("edges", "start_values", "end_values"):
            object.__setattr__(self, name, finite_array(name, getattr(self, name), 1))
        edges, intervals = self.edges, self.edges.size - 1
        if intervals < 1 or edges[0] != 0.0 or (np.diff(edges) < 0.0).any():
            raise ValueError(f"edges = {shown(edges.tolist())}: expected at least two ascending times [s], from 0 on")
        for name in ("start_values", "end_values"):
            if getattr(self, name).size != intervals:
                raise ValueError(
                    f"{name}: expected {intervals} torques, one an interval, got {getattr(self, name).size}"
                )

    def __repr__(self) -> str:
        switching = f", {count(len(self.switching_times), 'switch', 'switches')}" if self.switching_times.size else ""
        parts = f"{count(len(self.start_values), 'interval')}{switching}"
        return f"TorqueProfile: {self.duration:.6g} s, up to {f'{self.peak:.6g} {self.unit}'.rstrip()}; {parts}"

    def __call__(self, t: ArrayLike) -> Array:
        """Return the torque at times t [s], N m; the value after a jump, and at the end the last one."""
        t = plain_array("t", t)
        k = np.minimum(np.maximum(self.edges.searchsorted(t, "right") - 1, 0), self.start_values.size - 1)
        slope = (self.end_values - self.start_values)[k] / np.diff(self.edges)[k]
        value = self.start_values[k] + slope * (t - self.edges[k])
        return np.where((t >= 0.0) & (t <= self.edges[-1]), value, 0.0)

    def torque(self, t: ArrayLike) -> Array:
        """Return the torque, as calling the profile does.

        Parameters
        ----------
        t : array_like
            Times [s].

        Returns
        -------
        ndarray
            Torque [N m].
        """
        return self(t)

    def plot(self, ax: Axes | None = None, **style: Any) -> Axes:
        """Draw the torque over time.

        Parameters
        ----------
        ax : matplotlib Axes, optional
            Axes to draw on. If None, a new figure is created.
        **style
            Line properties, passed to `matplotlib.axes.Axes.plot`.

        Returns
        -------
        matplotlib.axes.Axes
            The axes.
        """
        return import_module("boomctl.plotting.slew").plot_torque(self, ax, **style)

    @property
    def duration(self) -> float:
        """Time at which the torque ends, s."""
        return float(self.edges[-1])

    @property
    def switching_times(self) -> Array:
        """Times at which the torque jumps from at least half of its peak to at least half of it of opposite sign, s.

        Other sign changes, such as zero crossings of a smooth torque held on a mesh, are not switches.
        """
        before, after, enough = self.end_values[:-1], self.start_values[1:], _SWITCH * self.peak
        jumps = (before * after < 0.0) & (np.minimum(np.abs(before), np.abs(after)) >= enough)
        return self.edges[1:-1][jumps]

    @property
    def breakpoints(self) -> tuple[float, ...]:  # type: ignore[override]
        """Times at which the torque or its derivative is discontinuous, s."""
        return tuple(self.edges[1:].tolist())

    @property
    def peak(self) -> float:
        """Largest absolute torque, N m."""
        return float(max(np.abs(self.start_values).max(), np.abs(self.end_values).max()))

    @property
    def max_rate(self) -> float:
        """Largest absolute derivative, N m/s; infinite if the torque jumps, including at its ends."""
        if (
            np.any(self.end_values[:-1] != self.start_values[1:])
            or self.start_values[0] != 0.0
            or self.end_values[-1] != 0.0
        ):
            return float("inf")
        return float(np.abs((self.end_values - self.start_values) / np.diff(self.edges)).max())

    @property
    def effort(self) -> float:
        """Integral of the torque squared, N^2 m^2 s."""
        squares = self.start_values**2 + self.start_values * self.end_values + self.end_values**2
        return float(np.sum(np.diff(self.edges) * squares) / 3.0)

    @property
    def angular_momentum(self) -> float:
        """Integral of the torque, N m s."""
        return float(np.sum(np.diff(self.edges) * 0.5 * (self.start_values + self.end_values)))

    def interval_means(self, t: Array) -> Array:
        """Return the mean torque between neighboring times.

        Parameters
        ----------
        t : (k,) ndarray
            Times within the duration, ascending [s].

        Returns
        -------
        (k - 1,) ndarray
            Mean torque from each time to the next [N m].
        """
        t, widths = plain_array("t", t), np.diff(self.edges)
        whole = np.concatenate([[0.0], np.cumsum(0.5 * widths * (self.start_values + self.end_values))])
        k = np.clip(np.searchsorted(self.edges, t, side="right") - 1, 0, widths.size - 1)
        since = t - self.edges[k]
        slope = (self.end_values[k] - self.start_values[k]) / widths[k]
        return np.diff(whole[k] + since * (self.start_values[k] + 0.5 * slope * since)) / np.diff(t)


def held(edges: Array, values: Array) -> TorqueProfile:
    """Return a torque that is constant between edges [s]."""
    return TorqueProfile(np.asarray(edges, dtype=float), np.array(values), np.array(values))


def ramped(edges: Array, values: Array) -> TorqueProfile:
    """Return a continuous torque, linear between its values [N m] at the edges [s]."""
    return TorqueProfile(np.asarray(edges, dtype=float), np.array(values[:-1]), np.array(values[1:]))


def bang_bang(switches: Array, duration: float, limit: float, sign: float) -> TorqueProfile:
    """Return a torque of constant modulus that changes its sign at switches [s] and ends at a duration [s].

    Parameters
    ----------
    switches : ndarray, m
        Switching times, ascending, within the duration.
    duration : float
        Duration, s.
    limit : float
        Modulus, N m.
    sign : float
        Sign of the first arc.
    """
    values = sign * limit * (-1.0) ** np.arange(switches.size + 1)
    return held(np.concatenate([[0.0], switches, [duration]]), values)


def lines_between(profile: TorqueProfile, time: Array) -> tuple[Array, Array, Array]:
    """Return the torque at the start and at the end of each step between neighboring times, and its slope there.

    The times include the edges of the torque, at which it may jump: the values are limits from within the step.
    """
    middle = 0.5 * (time[1:] + time[:-1])
    k = np.clip(np.searchsorted(profile.edges, middle) - 1, 0, profile.start_values.size - 1)
    slope = ((profile.end_values - profile.start_values) / np.diff(profile.edges))[k]
    start, end = (profile.start_values[k] + slope * (t - profile.edges[k]) for t in (time[:-1], time[1:]))
    return start, end, slope
