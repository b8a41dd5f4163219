"""What is done to the hub: a prescribed motion, or a torque.

A prescribed motion has ``angle(t)``, ``speed(t)`` and ``acceleration(t)``; a torque-driven manoeuvre has ``torque(t)``.
All of them take an instant or an array of instants and return an array of the same shape. A manoeuvre starts at t = 0.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from boomctl.arrays import Array
from boomctl.checks import positive, real
from boomctl.gauss import gauss_method
from boomctl.rotating_beam.validation import function_of_time

TimeFunction = Callable[..., object]


@dataclass(frozen=True)
class SpinUp:
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

    def __post_init__(self) -> None:
        real("final_speed", self.final_speed)
        positive("duration", self.duration)

    @property
    def breakpoints(self) -> tuple[float, ...]:
        """Instants at which the motion is not smooth, s."""
        return (self.duration,)

    @property
    def steady_from(self) -> float:
        """Instant from which the hub speed is constant, s."""
        return self.duration

    def _phase(self, t: ArrayLike) -> Array:
        phase: Array = np.minimum(np.maximum(np.asarray(t, dtype=float) / self.duration, 0.0), 1.0)
        return phase

    def angle(self, t: ArrayLike) -> Array:
        """Hub angle, rad."""
        phase = self._phase(t)
        turns = 0.5 * phase**2 - (np.sin(np.pi * phase) / np.pi) ** 2 / 2.0
        steady = np.maximum(np.asarray(t, dtype=float) - self.duration, 0.0)
        return self.final_speed * (self.duration * turns + steady)

    def speed(self, t: ArrayLike) -> Array:
        """Hub speed, rad/s."""
        phase = self._phase(t)
        return self.final_speed * (phase - np.sin(2.0 * np.pi * phase) / (2.0 * np.pi))

    def acceleration(self, t: ArrayLike) -> Array:
        """Hub acceleration, rad/s^2."""
        phase = self._phase(t)
        return self.final_speed / self.duration * 2.0 * np.sin(np.pi * phase) ** 2


@dataclass(frozen=True)
class Hold:
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
    def breakpoints(self) -> tuple[float, ...]:
        """Instants at which the motion is not smooth: none."""
        return ()

    @property
    def steady_from(self) -> float:
        """Instant from which the hub speed is constant, s."""
        return 0.0

    def angle(self, t: ArrayLike) -> Array:
        """Hub angle, rad."""
        return np.full(np.shape(t), self.hub_angle)

    def speed(self, t: ArrayLike) -> Array:
        """Hub speed, rad/s: zero."""
        return np.zeros(np.shape(t))

    def acceleration(self, t: ArrayLike) -> Array:
        """Hub acceleration, rad/s^2: zero."""
        return np.zeros(np.shape(t))


@dataclass(frozen=True)
class HubProfile:
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
            function_of_time(name, getattr(self, f"{name}_function"))
        object.__setattr__(self, "breakpoints", _breakpoints(self.breakpoints))

    @property
    def steady_from(self) -> float:
        """Instant from which the hub speed is known to be constant, s: none."""
        return math.inf

    def check_until(self, end: float) -> None:
        """Check up to an instant [s] that the functions belong together.

        Raises
        ------
        ValueError
            If the speed is not the slope of the angle, or the acceleration that of the speed, to 1 %.
        """
        if end <= 0.0:
            return
        method = gauss_method(6)
        edges = np.unique(np.concatenate([np.linspace(0.0, end, 65), [b for b in self.breakpoints if 0.0 < b < end]]))
        h = np.diff(edges)
        t = edges[:-1, None] + h[:, None] * method.nodes
        for name, slope in (("angle", "speed"), ("speed", "acceleration")):
            values = h * (getattr(self, slope)(t) @ method.weights)
            gained = np.diff(getattr(self, name)(edges))
            if np.abs(gained - values).max() > 1e-2 * max(np.abs(values).max(), np.abs(gained).max()):
                raise ValueError(f"{slope}: expected the derivative of the {name}")

    def angle(self, t: ArrayLike) -> Array:
        """Hub angle, rad."""
        return _evaluate("angle", self.angle_function, t)

    def speed(self, t: ArrayLike) -> Array:
        """Hub speed, rad/s."""
        return _evaluate("speed", self.speed_function, t)

    def acceleration(self, t: ArrayLike) -> Array:
        """Hub acceleration, rad/s^2."""
        return _evaluate("acceleration", self.acceleration_function, t)


@dataclass(frozen=True)
class SineTorque:
    """One stretch of a sine torque on the hub, then none, Eq. (44) of Bai et al. (2009).

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

    def __post_init__(self) -> None:
        real("amplitude", self.amplitude)
        positive("period", self.period)
        positive("duration", self.duration)

    @property
    def breakpoints(self) -> tuple[float, ...]:
        """Instants at which the torque is not smooth, s."""
        return (self.duration,)

    def torque(self, t: ArrayLike) -> Array:
        """Torque on the hub, N m."""
        t = np.asarray(t, dtype=float)
        acting = (t >= 0.0) & (t <= self.duration)
        return np.where(acting, self.amplitude * np.sin(2.0 * np.pi * t / self.period), 0.0)


@dataclass(frozen=True)
class Torque:
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
        function_of_time("torque", self.function)
        object.__setattr__(self, "breakpoints", _breakpoints(self.breakpoints))

    def torque(self, t: ArrayLike) -> Array:
        """Torque on the hub, N m."""
        return _evaluate("torque", self.function, t)


@dataclass(frozen=True)
class Free:
    """No torque on the hub."""

    @property
    def breakpoints(self) -> tuple[float, ...]:
        """Instants at which the torque is not smooth: none."""
        return ()

    def torque(self, t: ArrayLike) -> Array:
        """Torque on the hub, N m: zero."""
        return np.zeros(np.shape(t))


PrescribedMotion = SpinUp | Hold | HubProfile
TorqueDriven = SineTorque | Torque | Free


def spin_up(final_speed: float, duration: float) -> SpinUp:
    """Spin the hub up smoothly from rest (Bai et al. 2009, Eq. 43).

    Parameters
    ----------
    final_speed : float
        Hub speed after the spin-up, rad/s.
    duration : float
        Duration of the spin-up, s; > 0.
    """
    return SpinUp(final_speed, duration)


def sine_torque(amplitude: float, period: float, duration: float) -> SineTorque:
    """Drive the hub by a sine torque that ends (Bai et al. 2009, Eq. 44).

    Parameters
    ----------
    amplitude : float
        Largest torque, N m.
    period : float
        Period of the sine, s; > 0.
    duration : float
        Time after which the torque is zero, s; > 0.
    """
    return SineTorque(amplitude, period, duration)


def hub_profile(
    angle: TimeFunction, speed: TimeFunction, acceleration: TimeFunction, breakpoints: tuple[float, ...] = ()
) -> HubProfile:
    """Prescribe the hub motion by functions of time.

    Parameters
    ----------
    angle, speed, acceleration : callable
        Hub angle [rad], speed [rad/s] and acceleration [rad/s^2] of the time [s].
    breakpoints : tuple of float
        Instants at which the acceleration or a slope of it jumps, s; steps then end there.
    """
    return HubProfile(angle, speed, acceleration, breakpoints)


def torque(function: TimeFunction, breakpoints: tuple[float, ...] = ()) -> Torque:
    """Drive the hub by a torque that is a function of time.

    Parameters
    ----------
    function : callable
        Torque [N m] of the time [s].
    breakpoints : tuple of float
        Instants at which the torque or a slope of it jumps, s; steps then end there.
    """
    return Torque(function, breakpoints)


def hold(angle: float = 0.0) -> Hold:
    """Hold the hub at an angle [rad]."""
    return Hold(angle)


def free() -> Free:
    """Leave the hub free, without torque."""
    return Free()


def _breakpoints(values: tuple[float, ...]) -> tuple[float, ...]:
    return tuple(sorted(real("breakpoints", value) for value in values))


def _evaluate(name: str, function: TimeFunction, t: ArrayLike) -> Array:
    """Values of a user's function at all instants; one that takes only numbers is called once an instant."""
    t = np.asarray(t, dtype=float)
    try:
        values = np.broadcast_to(np.asarray(function(t), dtype=float), t.shape)
    except (TypeError, ValueError):
        values = np.array([float(function(float(each))) for each in t.ravel()]).reshape(t.shape)  # pyright: ignore[reportArgumentType]
    if not np.all(np.isfinite(values)):
        where = t[~np.isfinite(values)].ravel()[0]
        raise ValueError(f"{name} at t = {where:g} s: expected a finite number")
    return values
