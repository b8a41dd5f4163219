"""What a slew may be the best in: the cost of one interval to a programme, and the value along a replay.

An entry of :data:`OBJECTIVES` is all that a new objective takes.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import casadi as ca
import numpy as np

from boomctl.arrays import Array
from boomctl.slew.dynamics import path_peak, row_rates
from boomctl.slew.nlp.interval import Interval, Units
from boomctl.slew.plant import SlewPlant
from boomctl.slew.torque import TorqueProfile, lines_between

_CHATTER = 1e-6  # price of the torque and its changes beside the tip's bound: too small to be seen, enough to decide

Parts: TypeAlias = tuple[tuple[SlewPlant, slice], ...]
"""Plants, which the one torque drives, with their places in the states."""
Paths: TypeAlias = Sequence[tuple[SlewPlant, Array, Array]]
"""Plants with the instants [s] of a replay and their coordinates there."""


@dataclass(frozen=True)
class Objective:
    """What is made least.

    Attributes
    ----------
    title : str
        In words.
    cost : function of the plants, the units, an interval and the number of intervals
        The interval's share of the cost, scaled to about one.
    value : function of a torque and the replay
        The cost in SI units.
    continuous : bool
        Whether the torque is to be continuous and straight on each interval; else it is held there.
    unit : function of the units
        What a cost of one is worth, where the programme's own start decides: else meshes could not be compared.
    bounds_tip : bool
        Whether there is an unknown that the tip's displacement does not exceed.
    """

    title: str
    cost: Callable[[Parts, Units, Interval, int], ca.SX]
    value: Callable[[TorqueProfile, Paths], float]
    continuous: bool = False
    unit: Callable[[Units], float] = lambda units: 1.0
    bounds_tip: bool = False


def _effort(parts: Parts, units: Units, s: Interval, intervals: int) -> ca.SX:
    """Integral of the torque squared."""
    return s.h / units.time * (s.u**2 + s.u * s.u1 + s.u1**2) / 3.0


def _tip(parts: Parts, units: Units, s: Interval, intervals: int) -> ca.SX:
    """The bound; where the tip stays at it the torque is free to chatter, from which a small price keeps it."""
    assert s.bound is not None
    return s.bound / intervals + _CHATTER * (_effort(parts, units, s, intervals) + (s.u1 - s.u) ** 2)


def _jerk(parts: Parts, units: Units, s: Interval, intervals: int) -> ca.SX:
    """Integral of the hub's jerk squared, of all plants."""
    total = ca.SX(0)
    for plant, own in parts:
        unit, row = ca.DM(units.states[own]), ca.DM(plant.rows["speed"])
        turning, turning1 = (
            ca.dot(row, s.rates(plant, z[own] * unit, u * units.torque)) for z, u in ((s.z, s.u), (s.z1, s.u1))
        )
        total += ((turning1 - turning) * ((plant.inertia or 1.0) / units.torque)) ** 2 / (s.h / units.time)
    return total


def _jerk_squared(history: TorqueProfile, paths: Paths) -> float:
    """Integral of the hub's jerk squared along the replay, whose instants include all corners of the torque."""
    plant, time, coordinates = paths[0]
    start, end, slope = lines_between(history, time)
    ends = ((start, coordinates[:-1]), (end, coordinates[1:]))
    squares = [row_rates(plant, plant.rows["speed"], z, torque, slope)[1] ** 2 for torque, z in ends]
    return float(0.5 * np.sum((squares[0] + squares[1]) * np.diff(time)))


OBJECTIVES = {
    "time": Objective(
        title="minimum time",
        cost=lambda parts, units, s, intervals: s.h / units.time + 0.0 * s.u,
        value=lambda history, paths: history.duration,
        unit=lambda units: units.time,
    ),
    "effort": Objective(title="minimum effort", cost=_effort, value=lambda history, paths: history.effort),
    "jerk": Objective(title="minimum jerk", cost=_jerk, value=_jerk_squared, continuous=True),
    "torque-rate": Objective(
        title="minimum torque rate",
        cost=lambda parts, units, s, intervals: (s.u1 - s.u) ** 2 / (s.h / units.time),
        value=lambda history, paths: float(
            np.sum((history.end_values - history.start_values) ** 2 / np.diff(history.edges))
        ),
        continuous=True,
    ),
    "tip": Objective(
        title="minimum tip displacement",
        cost=_tip,
        value=lambda history, paths: max(path_peak(plant, "tip", history, t, z) for plant, t, z in paths),
        continuous=True,
        unit=lambda units: units.tip,
        bounds_tip=True,
    ),
}
"""By the names that users give."""
