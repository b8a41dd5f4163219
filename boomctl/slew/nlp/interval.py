"""One interval of the mesh of a nonlinear program: scaled unknowns, their units, and rates of the states."""

from collections.abc import Callable
from dataclasses import dataclass

import casadi as ca

from boomctl.arrays import Array
from boomctl.slew.plant import SlewPlant


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
