"""What is done to the hub: a prescribed motion, or a torque. A maneuver starts at t = 0.

All functions of time take an instant or an array of instants [s] and return an array of the same shape.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Protocol, final

import numpy as np
from numpy.typing import ArrayLike

from boomctl.arrays import Array
from boomctl.checks import finite_array, function_of, plain_array, positive, real, sequence, shown
from boomctl.gauss import gauss_method
from boomctl.lti.rounding import SUMMED

__all__ = ["applied_torque", "free_hub", "hold_angle", "prescribed_motion", "sine_torque", "spin_up"]

TimeFunction = Callable[..., object]

_CHECKED_INTERVALS = 200  # on which a profile's functions are compared (a choice)
_CHECK_POINTS = 10  # Gauss points on each: exact for polynomials of degree 19
_SPLIT, _CHECKED_LEVELS = 16, 5  # parts of an interval on which they disagree, and how often it is split (choices)
_MOST_OPEN, _MOST_JUMPS = 2**13, 1000  # intervals that are split at once, and those in which a slope jumps (choices)
# a resonance makes a thousand times as much of what functions differ by, which is a motion's own tolerance
_BELONGING = 1e-11  # of how far a function goes, by which it may differ from the integral of its slope (measured)
_ROUNDING = 16.0 * np.finfo(float).eps  # of the largest value: what a user's function may be off (a choice)


class PrescribedMotion(ABC):
    """A motion that the hub is made to follow, whatever torque it takes.

    Attributes
    ----------
    breakpoints : tuple of float
        Instants at which the motion is not smooth, s; steps end there.
    """

    breakpoints: tuple[float, ...] = ()

    @property
    def steady_from(self) -> float:
        """Instant from which the hub speed is known to be constant, s; inf if it is not known."""
        return math.inf

    @abstractmethod
    def angle(self, t: ArrayLike) -> Array:
        """Hub angle, rad."""

    @abstractmethod
    def speed(self, t: ArrayLike) -> Array:
        """Hub speed, rad/s."""

    @abstractmethod
    def acceleration(self, t: ArrayLike) -> Array:
        """Hub acceleration, rad/s^2."""


class TorqueDriven(ABC):
    """A torque that acts on a free hub.

    Attributes
    ----------
    breakpoints : tuple of float
        Instants at which the torque is not smooth, s; steps end there.
    """

    breakpoints: tuple[float, ...] = ()

    @abstractmethod
    def torque(self, t: ArrayLike) -> Array:
        """Torque on the hub, N m."""


Maneuver = PrescribedMotion | TorqueDriven


class PlannedTorque(Protocol):
    """A torque that was planned: a straight line on each of N intervals between N + 1 edges [s], and zero outside them."""

    @property
    def edges(self) -> Array: ...

    @property
    def start_values(self) -> Array: ...

    @property
    def end_values(self) -> Array: ...


class PlannedSlew(Protocol):
    """A slew that was planned: its torque, instants and states on the way."""

    @property
    def torque_profile(self) -> PlannedTorque: ...

    @property
    def time(self) -> Array: ...

    @property
    def states(self) -> Array: ...


@final
@dataclass(frozen=True)
class SpinUp(PrescribedMotion):
    """A smooth spin-up from rest, Eq. (43) of Bai et al. (2009) with its print mended.

    ``speed = w (t / T - sin(2 pi t / T) / 2 pi)`` until T, then w.

    Parameters
    ----------
    final_speed : float
        Hub speed w after the spin-up, rad/s; negative turns the other way.
    duration : float
        Duration T of the spin-up, s.
    """

    final_speed: float
    duration: float
    breakpoints: tuple[float, ...] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        real("final_speed", self.final_speed)
        positive("duration", self.duration)
        object.__setattr__(self, "breakpoints", (self.duration,))

    @property
    def steady_from(self) -> float:
        return self.duration

    def _phase(self, t: ArrayLike) -> Array:
        return np.minimum(np.maximum(plain_array("t", t) / self.duration, 0.0), 1.0)

    def angle(self, t: ArrayLike) -> Array:
        phase = self._phase(t)
        turns = 0.5 * phase**2 - (np.sin(np.pi * phase) / np.pi) ** 2 / 2.0
        steady = np.maximum(np.asarray(t, dtype=float) - self.duration, 0.0)
        return self.final_speed * (self.duration * turns + steady)

    def speed(self, t: ArrayLike) -> Array:
        phase = self._phase(t)
        return self.final_speed * (phase - np.sin(2.0 * np.pi * phase) / (2.0 * np.pi))

    def acceleration(self, t: ArrayLike) -> Array:
        phase = self._phase(t)
        return self.final_speed / self.duration * 2.0 * np.sin(np.pi * phase) ** 2


@final
@dataclass(frozen=True)
class Hold(PrescribedMotion):
    """The hub clamped at an angle.

    Parameters
    ----------
    hub_angle : float
        The angle, rad.
    """

    hub_angle: float = 0.0

    def __post_init__(self) -> None:
        real("angle", self.hub_angle)

    @property
    def steady_from(self) -> float:
        return 0.0

    def angle(self, t: ArrayLike) -> Array:
        return np.full(np.shape(t), self.hub_angle)

    def speed(self, t: ArrayLike) -> Array:
        return np.zeros(np.shape(t))

    def acceleration(self, t: ArrayLike) -> Array:
        return np.zeros(np.shape(t))


@final
@dataclass(frozen=True)
class HubProfile(PrescribedMotion):
    """A hub motion given by three functions of time that belong together: the second is the slope of the first.

    Parameters
    ----------
    angle_function, speed_function, acceleration_function : callable
        Hub angle [rad], speed [rad/s] and acceleration [rad/s^2] of the time [s].
    breakpoints : tuple of float
        Instants at which the acceleration or a slope of it jumps, s.
    """

    angle_function: TimeFunction
    speed_function: TimeFunction
    acceleration_function: TimeFunction
    breakpoints: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        for name in ("angle", "speed", "acceleration"):
            function_of(name, getattr(self, f"{name}_function"), "time")
        object.__setattr__(self, "breakpoints", _breakpoints(self.breakpoints))

    def checked_until(self, end: float) -> HubProfile:
        """Check up to an instant [s], on 200 intervals, that the functions belong together; return them for a simulation.

        Intervals on which they seem not to are split; their ends are breakpoints, for the motion is swift there or jumps.

        Raises
        ------
        ValueError
            If the speed is not the slope of the angle, or the acceleration that of the speed.
        """
        even = np.linspace(0.0, end, _CHECKED_INTERVALS + 1)
        edges = np.unique(np.concatenate([even, [b for b in self.breakpoints if 0.0 < b < end]]))
        split = self._agree("angle", "speed", edges), self._agree("speed", "acceleration", edges)
        inside = np.unique(np.concatenate([self.breakpoints, *split]))
        # of the whole time: two instants nearer than that are one, and no step lies between them
        inside = inside[np.diff(inside, prepend=-np.inf) > SUMMED * end]
        return replace(self, breakpoints=tuple(inside.tolist()))

    def _agree(self, name: str, slope: str, edges: Array) -> Array:
        """Return the ends of the intervals that were split; raise an error for a function that is no integral of another."""
        function, rate, method = getattr(self, name), getattr(self, slope), gauss_method(_CHECK_POINTS)
        nodes, weights = method.nodes, method.weights
        low, high, allowed, floor = edges[:-1], edges[1:], np.inf, 0.0
        settled: list[tuple[Array, Array]] = []
        split: list[Array] = []
        for level in range(_CHECKED_LEVELS):
            width = high - low
            ended, slopes = function(high), rate(low[:, None] + width[:, None] * nodes)
            missed = ended - function(low) - width * (slopes @ weights)
            if not level:
                size = float(np.abs(ended).max() + edges[-1] * np.abs(slopes).max())
                floor = _ROUNDING * size
                allowed = max(_BELONGING * float(np.ptp(ended)), floor)
            open_ = np.abs(missed) > max(allowed / (len(edges) * _SPLIT**level), floor)
            count = np.count_nonzero(open_)
            if level == _CHECKED_LEVELS - 1 and count <= _MOST_JUMPS:
                missed[open_] = 0.0  # there the slope jumps, so that its integral is not known better
            if level == _CHECKED_LEVELS - 1 or count > _MOST_OPEN:
                open_[:] = False
            settled.append((high[~open_], missed[~open_]))
            split += [low[open_], high[open_]]
            ends = np.linspace(low[open_], high[open_], _SPLIT + 1, axis=1)
            low, high = ends[:, :-1].ravel(), ends[:, 1:].ravel()
            if not len(low):
                break
        at, missed = (np.concatenate(item) for item in zip(*settled, strict=True))
        order = np.argsort(at)
        apart = np.abs(np.cumsum(missed[order]))
        worst = int(np.argmax(apart))
        if apart[worst] > allowed:
            raise ValueError(
                f"{slope}: expected the derivative of the {name}; from {edges[0]:.6g} to {at[order][worst]:.6g} s the {name}"
                f" differs by up to {apart[worst]:.3g} from the integral of the {slope}; of tables take one spline and its"
                " derivatives"
            )
        return np.concatenate(split)

    def angle(self, t: ArrayLike) -> Array:
        return _evaluate("angle", self.angle_function, t)

    def speed(self, t: ArrayLike) -> Array:
        return _evaluate("speed", self.speed_function, t)

    def acceleration(self, t: ArrayLike) -> Array:
        return _evaluate("acceleration", self.acceleration_function, t)


@final
@dataclass(frozen=True)
class SineTorque(TorqueDriven):
    """A sine torque on the hub for some time, then none, Eq. (44) of Bai et al. (2009).

    Parameters
    ----------
    amplitude : float
        Largest torque, N m.
    period : float
        Period of the sine, s.
    duration : float
        Time after which the torque is zero, s.
    """

    amplitude: float
    period: float
    duration: float
    breakpoints: tuple[float, ...] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        real("amplitude", self.amplitude)
        positive("period", self.period)
        positive("duration", self.duration)
        object.__setattr__(self, "breakpoints", (self.duration,))

    def torque(self, t: ArrayLike) -> Array:
        t = plain_array("t", t)
        acting = (t >= 0.0) & (t <= self.duration)
        return np.where(acting, self.amplitude * np.sin(2.0 * np.pi * t / self.period), 0.0)


@final
@dataclass(frozen=True)
class Torque(TorqueDriven):
    """A torque on the hub given by a function of time.

    Parameters
    ----------
    function : callable
        Torque [N m] of the time [s].
    breakpoints : tuple of float
        Instants at which the torque or a slope of it jumps, s.
    """

    function: TimeFunction
    breakpoints: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        function_of("torque", self.function, "time")
        object.__setattr__(self, "breakpoints", _breakpoints(self.breakpoints))

    def torque(self, t: ArrayLike) -> Array:
        return _evaluate("torque", self.function, t)


@final
@dataclass(frozen=True, eq=False)
class StraightTorque(TorqueDriven):
    """A planned torque: it is known where it is not smooth, and nothing has to be looked for between.

    Parameters
    ----------
    edges : ndarray, N + 1
        Instants, ascending from 0 [s].
    left, right : ndarray, N
        Torque at the beginning and at the end of each interval [N m].
    """

    edges: Array
    left: Array
    right: Array
    breakpoints: tuple[float, ...] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        for name in ("edges", "left", "right"):
            finite_array(name, getattr(self, name), 1)
        object.__setattr__(self, "breakpoints", tuple(self.edges[1:].tolist()))

    def torque(self, t: ArrayLike) -> Array:
        t = plain_array("t", t)
        k = np.minimum(np.maximum(self.edges.searchsorted(t, "right") - 1, 0), self.left.size - 1)
        slope = (self.right - self.left) / np.diff(self.edges)
        outside = (t < self.edges[0]) | (t > self.edges[-1])
        return np.where(outside, 0.0, self.left[k] + slope[k] * (t - self.edges[k]))


@final
@dataclass(frozen=True)
class Free(TorqueDriven):
    """No torque on the hub."""

    def torque(self, t: ArrayLike) -> Array:
        return np.zeros(np.shape(t))


def spin_up(final_speed: float, duration: float) -> SpinUp:
    """Spin the hub up smoothly from rest (Bai et al. 2009, Eq. 43).

    Parameters
    ----------
    final_speed : float
        Hub speed after the spin-up [rad/s].
    duration : float
        How long the spin-up lasts [s]; above zero.

    Returns
    -------
    SpinUp
        A maneuver for ``simulate``: the hub's angle, speed and acceleration are prescribed.

    Raises
    ------
    TypeError, ValueError
        Not finite numbers; a duration that is not above zero.

    Examples
    --------
    >>> import boomctl as bc
    >>> spin = bc.spin_up(final_speed=4.0, duration=15.0)
    >>> spin.speed([0.0, 7.5, 15.0]).round(3)
    array([0., 2., 4.])
    """
    return SpinUp(final_speed, duration)


def sine_torque(amplitude: float, period: float, duration: float) -> SineTorque:
    """Drive the hub by a sine torque that ends (Bai et al. 2009, Eq. 44).

    Parameters
    ----------
    amplitude : float
        Largest torque [N m].
    period : float
        Period of the sine [s]; above zero.
    duration : float
        Time after which the torque is zero [s]; above zero.

    Returns
    -------
    SineTorque
        A maneuver for ``simulate``: the torque is given, the hub moves as it will.

    Raises
    ------
    TypeError, ValueError
        Not finite numbers; a period or duration that is not above zero.

    Examples
    --------
    >>> import boomctl as bc
    >>> push = bc.sine_torque(amplitude=100.0, period=4.0, duration=4.0)
    >>> push.torque([1.0, 3.0, 5.0]).round(6)
    array([ 100., -100.,    0.])
    """
    return SineTorque(amplitude, period, duration)


def prescribed_motion(
    angle: TimeFunction, speed: TimeFunction, acceleration: TimeFunction, breakpoints: tuple[float, ...] = ()
) -> HubProfile:
    """Prescribe the hub's motion by functions of time.

    Parameters
    ----------
    angle, speed, acceleration : callable
        Hub angle [rad], speed [rad/s] and acceleration [rad/s^2] as functions of the time [s]; each is the slope of the
        one before.
    breakpoints : tuple of float
        Instants [s] at which the acceleration or its slope jumps; steps of the solver then end there. What is not named
        costs steps, as for `torque`.

    Returns
    -------
    HubProfile
        A maneuver for ``simulate``: the hub's motion is prescribed.

    Raises
    ------
    TypeError, ValueError
        Something that is not a function of time; breakpoints that are not numbers. When it is simulated: functions that
        do not belong together to eleven digits. Of tables take one spline and its derivatives.

    Examples
    --------
    >>> import boomctl as bc
    >>> import numpy as np
    >>> sway = bc.maneuvers.prescribed_motion(lambda t: 1.0 - np.cos(t), np.sin, np.cos)
    >>> result = bc.hub_beam(modes=1).simulate(sway, [0.0, 1.0, 2.0])
    >>> result.hub_angle.round(4)
    array([0.    , 0.4597, 1.4161])
    """
    return HubProfile(angle, speed, acceleration, breakpoints)


def applied_torque(function: TimeFunction, breakpoints: tuple[float, ...] = ()) -> Torque:
    """Drive the hub by a torque that is a function of time.

    Parameters
    ----------
    function : callable
        Torque [N m] as a function of the time [s].
    breakpoints : tuple of float
        Instants [s] at which the torque or its slope jumps; steps of the solver then end there. What is not named costs
        steps, up to fifty times as many, but no accuracy, as long as it is seen where the torque is looked at: every
        0.5 ms, and at 16,384 to 1,048,576 instants in all. Pulses that are shorter have to be given.

    Returns
    -------
    Torque
        A maneuver for ``simulate``: the torque is given, the hub moves as it will.

    Raises
    ------
    TypeError, ValueError
        Something that is not a function of time; breakpoints that are not numbers.

    Examples
    --------
    >>> import boomctl as bc
    >>> push = bc.maneuvers.applied_torque(lambda t: 50.0 * (t < 1.0), breakpoints=(1.0,))
    >>> result = bc.hub_beam(modes=1).simulate(push, [0.0, 1.0, 2.0])
    >>> result.hub_speed[1:].round(4)  # rad/s, the beam still swings
    array([0.2067, 0.2088])
    """
    return Torque(function, breakpoints)


def hold_angle(angle: float = 0.0) -> Hold:
    """Hold the hub at an angle, as if it were clamped.

    Parameters
    ----------
    angle : float
        Hub angle [rad].

    Returns
    -------
    Hold
        A maneuver for ``simulate``: the beam swings, the hub does not.

    Raises
    ------
    TypeError, ValueError
        Not a finite number.

    Examples
    --------
    >>> import boomctl as bc
    >>> beam = bc.hub_beam(modes=1)
    >>> bent = [0.0, 0.01, 0.0, 0.0]  # hub angle, mode, and their rates
    >>> beam.simulate(bc.maneuvers.hold_angle(), [0.0, 1.0], initial_state=bent).tip_displacement.round(4)  # m
    array([ 0.02  , -0.0195])
    """
    return Hold(angle)


def free_hub() -> Free:
    """Leave the hub free, without a torque on it.

    Returns
    -------
    Free
        A maneuver for ``simulate``: beam and hub move from the initial state.

    Examples
    --------
    >>> import boomctl as bc
    >>> turning = [0.0, 0.0, 1.0, 0.0]  # hub angle, mode, and their rates
    >>> beam, timepts = bc.hub_beam(modes=1, model="sfoam-consistent"), [0.0, 1.0, 2.0]
    >>> result = beam.simulate(bc.maneuvers.free_hub(), timepts, initial_state=turning)
    >>> bool(abs(result.angular_momentum / result.angular_momentum[0] - 1.0).max() < 1e-6)  # it is conserved
    True
    """
    return Free()


def _breakpoints(values: tuple[float, ...]) -> tuple[float, ...]:
    return tuple(sorted(real("breakpoints", value) for value in sequence("breakpoints", values, "instants")))


def _real_numbers(value: object) -> Array:
    """Return what a user's function returned as real numbers; complex ones are none."""
    result = plain_array("function", value)  # type: ignore[arg-type]
    if result.dtype.kind not in "iuf":
        raise TypeError
    return result.astype(float)


def _number(name: str, value: object, t: float) -> float:
    """Return what a user's function returned for one instant."""
    array = plain_array(name, value)  # type: ignore[arg-type]
    if array.dtype.kind not in "iuf" or array.size != 1:
        raise TypeError(f"{name} at t = {t:g} s: expected a number, or one for each instant, got {shown(value)}")
    return float(array.ravel()[0])


def _evaluate(name: str, function: TimeFunction, t: ArrayLike) -> Array:
    """Values of a user's function at all instants; one that takes only numbers is called once an instant."""
    t = plain_array("t", t).astype(float)
    try:
        values = np.broadcast_to(_real_numbers(function(t)), t.shape)
    except (TypeError, ValueError):
        values = np.array([_number(name, function(float(item)), item) for item in t.ravel()]).reshape(t.shape)
    if not np.all(np.isfinite(values)):
        where = t[~np.isfinite(values)].ravel()[0]
        raise ValueError(f"{name} at t = {where:g} s: expected a finite number")
    return values
