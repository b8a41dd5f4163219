"""A machine whose hub may rub."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from boomctl.simulation.machine.machine import Machine, MachineModes


@dataclass(frozen=True, eq=False)
class RubbingMachine:
    """A machine whose hub rubs with a torque ``friction tanh(speed / creep)``.

    Attributes
    ----------
    machine : Machine
    friction : float
        N m.
    creep : float
        Hub speed at which friction has reached three quarters of its torque, rad/s.
    """

    machine: Machine
    friction: float = 0.0
    creep: float = 1.0

    def _forced_modes(self, sensors: Sequence[Any]) -> MachineModes:
        """Return its equations, sensors among the outputs."""
        return rubbing(self.machine._forced_modes(sensors), self.friction, self.creep)


def rubbing(modes: MachineModes, friction: Any, creep: float) -> MachineModes:
    """Return equations with friction on the hub; a name makes it an input.

    Parameters
    ----------
    modes : MachineModes
    friction : float or str
        Torque [N m], or the name of a further input that it is.
    creep : float
        rad/s.
    """
    import casadi as ca

    size, inputs = len(modes.from_state), modes.inputs
    z, u = ca.SX.sym("z", size), ca.SX.sym("u", len(inputs))
    given, torque = u, ca.SX(0.0)
    if isinstance(friction, str):
        torque = ca.SX.sym("friction")
        given, inputs = ca.vertcat(u, torque), (*inputs, friction)
    else:
        torque = ca.SX(friction)
    on_hub, acting = inputs.index("disturbance_torque"), ca.SX(u)
    speed = modes.outputs.index("hub_speed")
    hub_speed = modes.read(z, u)[0][speed]
    acting[on_hub] -= torque * ca.tanh(hub_speed / creep)
    record: Any = modes
    return replace(
        record,
        inputs=inputs,
        push=np.pad(modes.push, ((0, 0), (0, len(inputs) - modes.push.shape[1]))),
        rest=ca.Function("rest", [z, given], [modes.rest(z, acting)]),
        read=ca.Function("read", [z, given], list(modes.read.call([z, acting]))),
    )
