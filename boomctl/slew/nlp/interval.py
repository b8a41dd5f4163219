"""What a programme knows of one interval of its mesh: scaled unknowns, their sizes, and rates of the states."""

from collections.abc import Callable
from dataclasses import dataclass

import casadi as ca

from boomctl.arrays import Array
from boomctl.slew.plant import SlewPlant


@dataclass(frozen=True, eq=False)
class Units:
    """Typical sizes, by which unknowns and conditions are divided: of all states, torque [N m], time [s], tip [m]."""

    states: Array
    torque: float
    time: float
    tip: float


@dataclass(frozen=True, eq=False)
class Interval:
    """Of one interval, scaled: states, torque and rates, next states and torque, its width [s], bound of the tip.

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
