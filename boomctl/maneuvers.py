"""Maneuvers of the hub: prescribed motions and torques, from t = 0.

All functions of time accept a time or an array of times [s] and return an array of the same shape.
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
from boomctl.checks import function_of, plain_array, positive, real, sequence, shown
from boomctl.gauss import gauss_method
from boomctl.lti.rounding import SUMMED

__all__ = ["applied_torque", "free_hub", "hold_angle", "prescribed_motion", "sine_torque", "spin_up"]

TimeFunction = Callable[..., object]

_CHECKED_INTERVALS = 200  # Intervals on which the functions of a profile are compared.
_CHECK_POINTS = 10  # Gauss points of an interval: exact for polynomials of degree 19.
_SPLIT, _CHECKED_LEVELS = 16, 5  # Parts of an interval with a difference, and number of refinements.
_MOST_OPEN, _MOST_JUMPS = 2**13, 1000  # Largest number of intervals split at once, and with a jump.
# Allowed difference between a function and the integral of its derivative, relative to the range of the function. A resonance
# amplifies it a thousand times, to the default tolerance of a motion.
_BELONGING = 1e-11
_FUNCTION_ROUNDING = 16.0 * np.finfo(float).eps  # Rounding error of a user's function, relative to its largest value.


class PrescribedMotion(ABC):
    """Prescribed motion of the hub.

    Attributes
    ----------
    breakpoints : tuple of float
        Times at which the motion is not smooth [s]; steps end there.
    """

    breakpoints: tuple[float, ...] = ()

    @property
    def steady_from(self) -> float:
        """Time from which the hub speed is constant [s]; inf if unknown."""
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
    """Torque on a free hub.

    Attributes
    ----------
    breakpoints : tuple of float
        Times at which the torque is not smooth [s]; steps end there.
    """

    breakpoints: tuple[float, ...] = ()

    @abstractmethod
    def torque(self, t: ArrayLike) -> Array:
        """Torque on the hub, N m."""


Maneuver = PrescribedMotion | TorqueDriven


class PlannedSlew(Protocol):
    """Planned slew: its torque, times and states."""

    @property
    def torque_profile(self) -> TorqueDriven: ...

    @property
    def time(self) -> Array: ...

    @property
    def states(self) -> Array: ...


@final
@dataclass(frozen=True)
class SpinUp(PrescribedMotion):
    """A smooth spin-up from rest, Eq. (43) of Bai et al. (2009) with its misprint corrected.

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
    """Hub clamped at an angle.

    Parameters
    ----------
    hub_angle : float
        Angle [rad].
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
    """Hub motion given by its angle, speed and acceleration as functions of time.

    Parameters
    ----------
    angle_function, speed_function, acceleration_function : callable
        Hub angle [rad], speed [rad/s] and acceleration [rad/s^2] of the time [s].
    breakpoints : tuple of float
        Times at which the acceleration or its derivative is discontinuous [s].
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
        """Check that the functions are derivatives of one another up to a time [s]; return them with breakpoints.

        Intervals with a difference are split, and their ends become breakpoints: the motion is fast or discontinuous there.

        Raises
        ------
        ValueError
            If the speed is not the derivative of the angle, or the acceleration that of the speed.
        """
        even = np.linspace(0.0, end, _CHECKED_INTERVALS + 1)
        edges = np.unique(np.concatenate([even, [b for b in self.breakpoints if 0.0 < b < end]]))
        split = self._agree("angle", "speed", edges), self._agree("speed", "acceleration", edges)
        inside = np.unique(np.concatenate([self.breakpoints, *split]))
        # Times closer than this are equal.
        inside = inside[np.diff(inside, prepend=-np.inf) > SUMMED * end]
        return replace(self, breakpoints=tuple(inside.tolist()))

    def _agree(self, name: str, slope: str, edges: Array) -> Array:
        """Return the ends of the intervals that were split; raise an error if a function is not the integral of another."""
        function, rate, method = getattr(self, name), getattr(self, slope), gauss_method(_CHECK_POINTS)
        low, high, allowed, floor = edges[:-1], edges[1:], np.inf, 0.0
        settled, split = [], []
        for level in range(_CHECKED_LEVELS):
            width, last = high - low, level == _CHECKED_LEVELS - 1
            ended, slopes = function(high), rate(low[:, None] + width[:, None] * method.nodes)
            missed = ended - function(low) - width * (slopes @ method.weights)
            if not level:
                floor = _FUNCTION_ROUNDING * float(np.abs(ended).max() + edges[-1] * np.abs(slopes).max())
                allowed = max(_BELONGING * float(np.ptp(ended)), floor)
            open_ = np.abs(missed) > max(allowed / (len(edges) * _SPLIT**level), floor)
            count = np.count_nonzero(open_)
            if last and count <= _MOST_JUMPS:
                missed[open_] = 0.0  # The derivative is discontinuous there: its integral has no better accuracy.
            open_ &= not (last or count > _MOST_OPEN)
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
    """Torque on the hub given by a function of time.

    Parameters
    ----------
    function : callable
        Torque [N m] of the time [s].
    breakpoints : tuple of float
        Times at which the torque or its derivative is discontinuous [s].
    """

    function: TimeFunction
    breakpoints: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        function_of("torque", self.function, "time")
        object.__setattr__(self, "breakpoints", _breakpoints(self.breakpoints))

    def torque(self, t: ArrayLike) -> Array:
        return _evaluate("torque", self.function, t)


@final
@dataclass(frozen=True)
class Free(TorqueDriven):
    """No torque on the hub."""

    def torque(self, t: ArrayLike) -> Array:
        return np.zeros(np.shape(t))


def spin_up(final_speed: float, duration: float) -> SpinUp:
    """Return a smooth spin-up of the hub from rest to a constant speed (Bai et al. 2009, Eq. 43).

    Parameters
    ----------
    final_speed : float
        Hub speed after the spin-up [rad/s].
    duration : float
        Duration of the spin-up [s]; above zero.

    Returns
    -------
    SpinUp
        Maneuver for ``simulate``.

    Raises
    ------
    TypeError, ValueError
        If a number is not finite, or `duration` is not positive.

    Examples
    --------
    >>> import boomctl as bc
    >>> spin = bc.spin_up(final_speed=4.0, duration=15.0)
    >>> spin.speed([0.0, 7.5, 15.0]).round(3)
    array([0., 2., 4.])
    """
    return SpinUp(final_speed, duration)


def sine_torque(amplitude: float, period: float, duration: float) -> SineTorque:
    """Return a sinusoidal hub torque of finite duration (Bai et al. 2009, Eq. 44).

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
        Maneuver for ``simulate``.

    Raises
    ------
    TypeError, ValueError
        If a number is not finite, or `period` or `duration` is not positive.

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
        Hub angle [rad], speed [rad/s] and acceleration [rad/s^2] as functions of the time [s].
    breakpoints : tuple of float
        Times at which the acceleration or its derivative is discontinuous [s]. Unnamed ones increase the number of
        steps, as for `applied_torque`.

    Returns
    -------
    HubProfile
        Maneuver for ``simulate``.

    Raises
    ------
    TypeError, ValueError
        If an argument is not a function of time, or breakpoints are not numbers. During the simulation: if the functions
        are not derivatives of one another to eleven digits; for tables use one spline and its derivatives.

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
        Times at which the torque or its derivative is discontinuous [s]. Unnamed ones increase the number of steps up to
        fifty times, without a loss of accuracy. Pulses shorter than 0.5 ms have to be named.

    Returns
    -------
    Torque
        Maneuver for ``simulate``.

    Raises
    ------
    TypeError, ValueError
        If `function` is not a function of time, or breakpoints are not numbers.

    Examples
    --------
    >>> import boomctl as bc
    >>> push = bc.maneuvers.applied_torque(lambda t: 50.0 * (t < 1.0), breakpoints=(1.0,))
    >>> result = bc.hub_beam(modes=1).simulate(push, [0.0, 1.0, 2.0])
    >>> result.hub_speed[1:].round(4)  # rad/s, the beam still vibrates
    array([0.2067, 0.2088])
    """
    return Torque(function, breakpoints)


def hold_angle(angle: float = 0.0) -> Hold:
    """Clamp the hub at an angle.

    Parameters
    ----------
    angle : float
        Hub angle [rad].

    Returns
    -------
    Hold
        Maneuver for ``simulate``.

    Raises
    ------
    TypeError, ValueError
        If `angle` is not a finite number.

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
    """Leave the hub free, without a torque.

    Returns
    -------
    Free
        Maneuver for ``simulate``.

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
    return tuple(sorted(real("breakpoints", value) for value in sequence("breakpoints", values, "times")))


def _numbers(name: str, value: object, t: Array) -> Array:
    """Return the result of a user's function at some times as real numbers."""
    array = plain_array(name, value)  # type: ignore[arg-type]
    if array.dtype.kind not in "iuf" or array.size not in (1, t.size):
        raise TypeError(f"{name} at t = {t.min():g} s: expected a number, or one for each time, got {shown(value)}")
    return np.broadcast_to(array.ravel()[0] if array.size == 1 else array, t.shape).astype(float)


def _evaluate(name: str, function: TimeFunction, t: ArrayLike) -> Array:
    """Evaluate a user's function at all times; one that accepts only numbers is called for each time."""
    t = plain_array("t", t).astype(float)
    try:
        values = _numbers(name, function(t), t)
    except (TypeError, ValueError):
        values = np.array([_numbers(name, function(item), np.array(item)) for item in t.ravel().tolist()])
        values = values.reshape(t.shape)
    if not np.all(np.isfinite(values)):
        where = t[~np.isfinite(values)].ravel()[0]
        raise ValueError(f"{name} at t = {where:g} s: expected a finite number")
    return values
