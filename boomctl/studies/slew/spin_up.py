"""A spin-up by a planned torque, beside a profile of the hub that is prescribed exactly."""

from dataclasses import dataclass

import numpy as np

from boomctl.rotating_beam.assumed_modes import AssumedModesBeam
from boomctl.rotating_beam.manoeuvres import SpinUp
from boomctl.rotating_beam.result import SimulationResult
from boomctl.slew.torque import TorqueHistory


@dataclass(frozen=True, eq=False)
class SpinUpMotion:
    """A spin-up, by a torque or by a prescribed motion of the hub.

    Attributes
    ----------
    name : str
    duration : float
        s.
    peak_torque : float
        Largest torque that it takes, N m.
    vibration : float
        Largest tip displacement after the end, m.
    speed_error : float
        Largest deviation of the hub's speed after the end, rad/s.
    motion : SimulationResult
        On the way and afterwards.
    """

    name: str
    duration: float
    peak_torque: float
    vibration: float
    speed_error: float
    motion: SimulationResult


def spin_ups(
    h: AssumedModesBeam, label: str, history: TorqueHistory, profile: SpinUp
) -> tuple[SpinUpMotion, SpinUpMotion]:
    """Return the motion under a planned torque, and that under a profile of the hub.

    Parameters
    ----------
    h : AssumedModesBeam
    label : str
        Name of the planned spin-up.
    history : TorqueHistory
        Its torque.
    profile : SpinUp
        To the same speed.
    """
    rest = 1.5 / float(h.frequencies_hz().min())
    t = np.linspace(0.0, max(profile.duration, history.duration) + rest, 1201)
    t = np.unique(np.concatenate([t, [profile.duration, history.duration]]))
    speed = profile.final_speed
    return (
        _motion(label, history.duration, speed, h.simulate(history, t)),
        _motion("profile, Eq. (43)", profile.duration, speed, h.simulate(profile, t)),
    )


def _motion(name: str, duration: float, speed: float, motion: SimulationResult) -> SpinUpMotion:
    late = motion.time >= duration
    return SpinUpMotion(
        name=name,
        duration=duration,
        peak_torque=float(np.abs(motion.torque).max()),
        vibration=float(np.abs(motion.tip_displacement[late]).max()),
        speed_error=float(np.abs(motion.hub_speed[late] - speed).max()),
        motion=motion,
    )
