"""Nonlinear machine in a loop: vibrations in closed form plus nonlinear terms; and a machine with hub friction."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Protocol, runtime_checkable

from boomctl.lti.machine_modes import MachineModes


@runtime_checkable
class Machine(Protocol):
    """Nonlinear machine, such as a flexible beam on a hub."""

    def _forced_modes(self, sensors: Sequence[Any]) -> MachineModes:
        """Return its equations, sensors among the outputs."""
        ...


def reading_states(machine: MachineModes, wanted: Sequence[str]) -> MachineModes:
    """Return a machine whose outputs include the states that a controller reads by name."""
    more = [name for name in wanted if name in machine.state_labels and name not in machine.output_labels]
    if not more:
        return machine
    import casadi as ca

    z, u = ca.SX.sym("z", len(machine.to_state)), ca.SX.sym("u", len(machine.input_labels))
    outputs, margin = machine.read.call([z, u])
    rows = machine.to_state[[machine.state_labels.index(name) for name in more]]
    read = ca.Function("read", [z, u], [ca.vertcat(outputs, ca.mtimes(ca.sparsify(ca.DM(rows)), z)), margin])
    return replace(machine, output_labels=(*machine.output_labels, *more), read=read)


@dataclass(frozen=True, eq=False)
class RubbingMachine:
    """Machine with hub friction, a torque of ``friction tanh(speed / creep)``.

    Attributes
    ----------
    machine : Machine
    friction : float
        N m.
    creep : float
        Hub speed at which friction has reached three quarters of its torque, rad/s.
    """

    machine: Machine
    friction: float
    creep: float

    def _forced_modes(self, sensors: Sequence[Any]) -> MachineModes:
        """Return its equations, sensors among the outputs."""
        import casadi as ca

        modes = self.machine._forced_modes(sensors)
        z, u = ca.SX.sym("z", len(modes.from_state)), ca.SX.sym("u", len(modes.input_labels))
        hub_speed = modes.read(z, u)[0][modes.output_labels.index("hub_speed")]
        acting = ca.SX(u)
        acting[modes.input_labels.index("disturbance_torque")] -= self.friction * ca.tanh(hub_speed / self.creep)
        return replace(
            modes,
            rest=ca.Function("rest", [z, u], [modes.rest(z, acting)]),
            read=ca.Function("read", [z, u], list(modes.read.call([z, acting]))),
        )
