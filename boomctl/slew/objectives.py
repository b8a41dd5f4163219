"""Objectives of slews: the cost of one interval in a nonlinear program, and the value along a replay.

A new objective requires only an entry of :data:`OBJECTIVES`.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import casadi as ca
import numpy as np

from boomctl.arrays import Array
from boomctl.slew.dynamics import path_peak, row_rates
from boomctl.slew.plant import SlewPlant
from boomctl.slew.torque import TorqueProfile, lines_between

_CHATTER = 1e-6  # weight of the torque and its changes relative to the tip's bound: makes the torque unique

Parts: TypeAlias = tuple[tuple[SlewPlant, slice], ...]
"""Plants driven by the same torque, with their slices of the states."""
Paths: TypeAlias = Sequence[tuple[SlewPlant, Array, Array]]
"""Plants with the time points [s] of a replay and the coordinates at them."""


@dataclass(frozen=True, eq=False)
class Units:
    """Scales of unknowns and conditions: typical values of all states, torque [N m], time [s] and tip [m]."""

    states: Array
    torque: float
    time: float
    tip: float


@dataclass(frozen=True, eq=False)
class Interval:
    """Variables of one interval: scaled states, torque and rates, next states and torque, width [s], bound of the tip.

    ``rates(plant, z, u)`` are the rates of the states of a plant at its states z and a torque u, in SI units.
    """

    z: ca.SX
    u: ca.SX
    k: ca.SX
    z1: ca.SX
    u1: ca.SX
    h: ca.SX
    bound: ca.SX | None
    rates: Callable[[SlewPlant, ca.SX, ca.SX], ca.SX]


@dataclass(frozen=True)
class Objective:
    """Objective of a slew.

    Attributes
    ----------
    title : str
        Name for output, such as "minimum time".
    cost : function of the plants, the units, an interval and the number of intervals
        Contribution of an interval to the cost, scaled to about one.
    value : function of a torque and the replay
        The cost in SI units.
    continuous : bool
        True for a continuous torque, linear on each interval; otherwise it is held there.
    unit : function of the units
        Objective at a scaled cost of one, if the initial guess sets the scale; makes meshes comparable.
    bounds_tip : bool
        True if an unknown bounds the tip displacement.
    """

    title: str
    cost: Callable[[Parts, Units, Interval, int], ca.SX]
    value: Callable[[TorqueProfile, Paths], float]
    continuous: bool = False
    unit: Callable[[Units], float] = lambda units: 1.0
    bounds_tip: bool = False


def _effort(parts: Parts, units: Units, s: Interval, intervals: int) -> ca.SX:
    """Return the integral of the squared torque."""
    return s.h / units.time * (s.u**2 + s.u * s.u1 + s.u1**2) / 3.0


def _tip(parts: Parts, units: Units, s: Interval, intervals: int) -> ca.SX:
    """Return the bound with a small weight of the torque, which prevents chattering while the tip is at the bound."""
    assert s.bound is not None
    return s.bound / intervals + _CHATTER * (_effort(parts, units, s, intervals) + (s.u1 - s.u) ** 2)


def _jerk(parts: Parts, units: Units, s: Interval, intervals: int) -> ca.SX:
    """Return the integral of the squared hub jerk of all plants."""
    total = ca.SX(0)
    for plant, own in parts:
        unit, row = ca.DM(units.states[own]), ca.DM(plant.rows["speed"])
        turning, turning1 = (
            ca.dot(row, s.rates(plant, z[own] * unit, u * units.torque)) for z, u in ((s.z, s.u), (s.z1, s.u1))
        )
        total += ((turning1 - turning) * ((plant.inertia or 1.0) / units.torque)) ** 2 / (s.h / units.time)
    return total


def _jerk_squared(profile: TorqueProfile, paths: Paths) -> float:
    """Return the integral of the squared hub jerk along the replay, whose times include all breakpoints of the torque."""
    plant, time, coordinates = paths[0]
    start, end, slope = lines_between(profile, time)
    ends = ((start, coordinates[:-1]), (end, coordinates[1:]))
    squares = [row_rates(plant, plant.rows["speed"], z, torque, slope)[1] ** 2 for torque, z in ends]
    return float(0.5 * np.sum((squares[0] + squares[1]) * np.diff(time)))


OBJECTIVES = {
    "time": Objective(
        title="minimum time",
        cost=lambda parts, units, s, intervals: s.h / units.time + 0.0 * s.u,
        value=lambda profile, paths: profile.duration,
        unit=lambda units: units.time,
    ),
    "effort": Objective(title="minimum effort", cost=_effort, value=lambda profile, paths: profile.effort),
    "jerk": Objective(title="minimum jerk", cost=_jerk, value=_jerk_squared, continuous=True),
    "torque-rate": Objective(
        title="minimum torque rate",
        cost=lambda parts, units, s, intervals: (s.u1 - s.u) ** 2 / (s.h / units.time),
        value=lambda profile, paths: float(
            np.sum((profile.end_values - profile.start_values) ** 2 / np.diff(profile.edges))
        ),
        continuous=True,
    ),
    "tip": Objective(
        title="minimum tip displacement",
        cost=_tip,
        value=lambda profile, paths: max(path_peak(plant, "tip", profile, t, z) for plant, t, z in paths),
        continuous=True,
        unit=lambda units: units.tip,
        bounds_tip=True,
    ),
}
"""Objectives by name."""
