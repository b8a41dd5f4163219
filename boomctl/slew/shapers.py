"""Classical slews under a torque limit: a rigid body's bang-bang, its smooth form, and both with input shaping.

A shaper is a train of impulses with which a command is convolved: ZV and ZVD (Singer & Seering 1990), EI (Singhose, Seering
& Singer 1994). Shaping a torque keeps its integrals of first and second order if the amplitudes add up to one, so a
rigid body still reaches the same angle; the duration increases by the length of the train.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from typing import TYPE_CHECKING, Any

import numpy as np

from boomctl.arrays import Array
from boomctl.checks import instance, known, nonnegative, positive, real
from boomctl.lti.rounding import SUMMED
from boomctl.printing import compact
from boomctl.slew.plant import is_machine, plant_of
from boomctl.slew.torque import TorqueProfile, held
from boomctl.threads import one_blas_thread

if TYPE_CHECKING:
    from boomctl.rotating_beam.assumed_modes import AssumedModesBeam

_RISE = 0.1  # rise time of a smoothed bang-bang over the duration, as in Junkins, Rahman and Bang (1991)
_INTERVALS = 200  # intervals on which a smooth torque is held: its steps are about a hundredth of the limit


@dataclass(frozen=True, eq=False)
class Shaper:
    """Input shaper: a train of impulses that reduces the residual vibration of one mode.

    Attributes
    ----------
    name : str
        "none", "ZV", "ZVD" or "EI".
    times : ndarray
        Times of the impulses [s]; the first is 0.
    amplitudes : ndarray
        Amplitudes of the impulses; their sum is one.
    """

    _made_by = "slew.input_shaper(...)"

    name: str
    times: Array
    amplitudes: Array

    __repr__ = compact

    def plot(self, ax: Any = None, **style: Any) -> Array:
        """Draw the impulses over time, and the residual vibration over frequency.

        Parameters
        ----------
        ax : sequence of two matplotlib Axes, or a figure, optional
            Axes to draw on: impulses and residual vibration. If None, a new figure is created.
        **style
            Line properties, passed to `matplotlib.axes.Axes.plot`.

        Returns
        -------
        ndarray of matplotlib.axes.Axes
            The axes, in the order of ``ax``.
        """
        return import_module("boomctl.plotting.slew").plot_shaper(self, ax, **style)

    def residual_vibration(self, omega: float, damping_ratio: float = 0.0) -> float:
        """Return the residual vibration after the train, relative to that after one impulse.

        Parameters
        ----------
        omega : float
            Angular frequency of the vibration [rad/s].
        damping_ratio : float
            Its damping ratio.

        Returns
        -------
        float
            0 without residual vibration, 1 if the train has no effect.
        """
        s = -damping_ratio * omega + 1j * omega * math.sqrt(1.0 - damping_ratio**2)
        return float(abs(np.sum(self.amplitudes * np.exp(s * (self.times[-1] - self.times)))))


_TRAINS: dict[str, Callable[[float, float], list[float]]] = {
    "none": lambda K, level: [1.0],
    "ZV": lambda K, level: [1.0, K],
    "ZVD": lambda K, level: [1.0, 2.0 * K, K**2],
    "EI": lambda K, level: [0.25 * (1.0 + level), 0.5 * (1.0 - level) * K, 0.25 * (1.0 + level) * K**2],
}
"""Amplitudes of impulses at half the damped period, K the decay in that time; before scaling to a sum of one."""


@one_blas_thread
def input_shaper(name: str, omega: float | AssumedModesBeam, damping_ratio: float = 0.0, level: float = 0.05) -> Shaper:
    """Return a shaper: a train of impulses against one vibration.

    Parameters
    ----------
    name : str
        "none", "ZV" (zero vibration), "ZVD" (zero vibration and derivative) or "EI" (extra-insensitive).
    omega : float or hub-beam
        Undamped angular frequency of the vibration [rad/s].  Of a hub-beam it is that of its first mode with the hub free to
        turn, as a torque moves it; frequencies at a prescribed hub speed (`eigenfrequencies_hz`) are lower.
    damping_ratio : float
        Damping ratio of the vibration, below 1; of a hub-beam that of the mode.
    level : float
        Relative residual vibration of EI at the frequency itself. Without damping it is exact; with light damping it is the
        usual approximation, with amplitudes weighted by the decay.

    Returns
    -------
    Shaper
        Times and amplitudes of the impulses.

    Raises
    ------
    TypeError, ValueError
        If the name is unknown or a number out of its range.

    Examples
    --------
    >>> import boomctl as bc
    >>> train = bc.slew.input_shaper("ZV", omega=2.0)
    >>> train.times.round(4), train.amplitudes.round(4)
    (array([0.    , 1.5708]), array([0.5, 0.5]))
    >>> round(train.residual_vibration(2.0), 6), round(train.residual_vibration(2.2), 3)  # at the frequency, and 10 % above
    (0.0, 0.156)
    >>> bc.slew.input_shaper("ZV", bc.hub_beam()).times.round(4)
    array([0.    , 0.9872])
    """
    known("shaper", name, _TRAINS)
    if is_machine(omega):
        if damping_ratio:
            raise ValueError(f"damping_ratio = {damping_ratio!r}: expected none for a hub-beam, which has its own")
        omega, damping_ratio = plant_of(omega).vibration
    zeta = nonnegative("damping_ratio", damping_ratio)
    if zeta >= 1.0:
        raise ValueError(f"damping_ratio = {damping_ratio!r}: expected a number below 1")
    half = math.pi / (positive("omega", omega) * math.sqrt(1.0 - zeta**2))
    K = math.exp(-zeta * math.pi / math.sqrt(1.0 - zeta**2))
    if positive("level", level) >= 1.0:
        raise ValueError(f"level = {level!r}: expected a number below 1")
    amplitudes = _TRAINS[name](K, level)
    return Shaper(name, half * np.arange(len(amplitudes)), np.array(amplitudes) / np.sum(amplitudes))


@one_blas_thread
def rest_to_rest_torque(
    profile: str, shaper: Shaper, angle: float, inertia: float, torque_limit: float
) -> TorqueProfile:
    """Return a torque that turns a rigid body from rest to rest, shaped.

    Parameters
    ----------
    profile : str
        "bang-bang"; "smoothed", a bang-bang that rises, turns and falls by cubics, the rise a tenth of the duration
        (Junkins, Rahman and Bang 1991); or "versine": ``sin(2 pi t / T)``, under which the speed is a versine.
    shaper : Shaper
        What `input_shaper` returns.
    angle : float
        Angle to turn through [rad].
    inertia : float
        Moment of inertia of the body [kg m^2].
    torque_limit : float
        The torque before shaping reaches it [N m], and shaping with positive amplitudes does not exceed it.

    Returns
    -------
    TorqueProfile
        The torque over time; ``.plot()`` draws it.

    Raises
    ------
    TypeError, ValueError
        If the profile is unknown or a number out of its range.

    Examples
    --------
    >>> import boomctl as bc
    >>> train = bc.slew.input_shaper("ZV", omega=2.0)
    >>> push = bc.slew.rest_to_rest_torque("bang-bang", train, angle=1.0, inertia=100.0, torque_limit=50.0)
    >>> round(push.duration, 3), round(push.peak, 3)  # s, N m
    (4.399, 25.0)
    """
    known("profile", profile, ("bang-bang", "smoothed", "versine"))
    instance("shaper", shaper, Shaper)
    limit, turn = positive("torque_limit", torque_limit), abs(real("angle", angle))
    if turn == 0.0:
        raise ValueError("angle = 0: expected a turn that leads somewhere")
    sign = math.copysign(1.0, angle)
    if profile != "versine":
        edges, values = _smoothed() if profile == "smoothed" else (np.array([0.0, 0.5, 1.0]), np.array([1.0, -1.0]))
        T = math.sqrt(turn * positive("inertia", inertia) / (limit * _turned(edges, values)))
        edges = T * edges
    else:
        T = math.sqrt(2.0 * math.pi * turn * positive("inertia", inertia) / limit)
        edges = np.linspace(0.0, T, _INTERVALS + 1)
        impulse = -np.cos(2.0 * np.pi * edges / T) / (2.0 * np.pi / T)
        values = np.diff(impulse) / np.diff(edges)  # means: they preserve the impulse
        values *= turn * inertia / (limit * _turned(edges, values))
    return _convolved(edges, sign * limit * values, shaper)


@one_blas_thread
def spin_up_torque(profile: str, shaper: Shaper, speed: float, inertia: float, torque_limit: float) -> TorqueProfile:
    """Return a torque that spins a rigid body up from rest, shaped.

    Parameters
    ----------
    profile : str
        "constant"; or "smooth", ``1 - cos(2 pi t / T)``: the torque of a rigid body for the hub motion of Bai et al.
        (2009), Eq. (43).
    shaper : Shaper
        What `input_shaper` returns.
    speed : float
        Speed at the end [rad/s].
    inertia : float
        Moment of inertia of the body [kg m^2].
    torque_limit : float
        The torque before shaping reaches it [N m], and shaping with positive amplitudes does not exceed it.

    Returns
    -------
    TorqueProfile
        The torque over time; ``.plot()`` draws it.

    Raises
    ------
    TypeError, ValueError
        If the profile is unknown or a number out of its range.

    Examples
    --------
    >>> import boomctl as bc
    >>> plain = bc.slew.input_shaper("none", omega=2.0)
    >>> push = bc.slew.spin_up_torque("smooth", plain, speed=1.0, inertia=100.0, torque_limit=50.0)
    >>> round(push.duration, 3), round(push.angular_momentum, 3)  # s, N m s
    (4.0, 100.0)
    """
    known("profile", profile, ("constant", "smooth"))
    instance("shaper", shaper, Shaper)
    limit = positive("torque_limit", torque_limit)
    least = abs(speed) * positive("inertia", inertia) / limit
    if profile == "constant":
        edges, values = np.array([0.0, least]), np.array([1.0])
    else:
        edges = np.linspace(0.0, 2.0 * least, _INTERVALS + 1)
        phase = np.pi * edges / least
        values = 0.5 * np.diff(phase - np.sin(phase)) / np.diff(phase)  # means: they preserve the impulse
    return _convolved(edges, math.copysign(limit, speed) * values, shaper)


def _smoothed() -> tuple[Array, Array]:
    """Return a smoothed bang-bang of unit duration and limit, held on equal intervals."""
    edges = np.linspace(0.0, 1.0, _INTERVALS + 1)
    middle = 0.5 * (edges[1:] + edges[:-1])

    def risen(x: Array) -> Array:
        within = np.clip(x, 0.0, 1.0)
        return within**2 * (3.0 - 2.0 * within)

    turning = 2.0 * risen((middle - 0.5 + _RISE) / (2.0 * _RISE))
    return edges, risen(middle / _RISE) - turning + risen((middle - 1.0 + _RISE) / _RISE)


def _turned(edges: Array, values: Array) -> float:
    """Return the double integral from rest."""
    speed = np.concatenate([[0.0], np.cumsum(np.diff(edges) * values)])
    return float(np.trapezoid(speed, edges))


def _convolved(edges: Array, values: Array, train: Shaper) -> TorqueProfile:
    """Return a torque held on intervals, convolved with the impulses."""
    jumps = np.diff(np.concatenate([[0.0], values, [0.0]]))
    times = (edges[None, :] + train.times[:, None]).ravel()
    steps = (train.amplitudes[:, None] * jumps[None, :]).ravel()
    order = np.argsort(times, kind="stable")
    ascending = times[order]
    first = np.flatnonzero(np.diff(ascending, prepend=-ascending[-1]) > SUMMED * ascending[-1])
    total = np.add.reduceat(steps[order], first)
    return held(ascending[first], np.cumsum(total)[:-1])
