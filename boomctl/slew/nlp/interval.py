"""What a programme knows of one interval of its mesh: scaled unknowns, and the sizes by which they are scaled."""

from dataclasses import dataclass

import casadi as ca

from boomctl.arrays import Array


@dataclass(frozen=True, eq=False)
class Units:
    """Typical sizes, by which unknowns and conditions are divided: of all states, torque [N m], time [s], tip [m]."""

    states: Array
    torque: float
    time: float
    tip: float


@dataclass(frozen=True, eq=False)
class Interval:
    """Of one interval, scaled: states, torque and rates, next states and torque, its width [s], bound of the tip."""

    z: ca.SX
    u: ca.SX
    k: ca.SX
    z1: ca.SX
    u1: ca.SX
    h: ca.SX
    bound: ca.SX | None
