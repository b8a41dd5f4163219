"""The linear hub-beam over boxes of hub speed and tip mass."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from boomctl.checks import nonnegative, sequence
from boomctl.rotating_beam.sensors import LOOP_INPUTS, LOOP_OUTPUTS, LOOP_UNITS, QUANTITIES, checked_sensors
from boomctl.structure.families import PolynomialFamily, interval
from boomctl.structure.matrices import Structure
from boomctl.structure.model import SecondOrderModel
from boomctl.structure.ports import Ports

if TYPE_CHECKING:
    from boomctl.rotating_beam.beam import HubBeam
    from boomctl.rotating_beam.modal.equations import Tip
    from boomctl.rotating_beam.sensors import BeamSensor

_ACCELERATION = "acceleration"  # the quantity whose reading changes with the hub speed


def hub_beam_family(
    beam: HubBeam,
    tip: Tip,
    hub_speed: tuple[float, float] | float,
    tip_mass: tuple[float, float] | None,
    sensors: Sequence[BeamSensor],
) -> PolynomialFamily:
    """Return a hub-beam about steady rotation over ranges of hub speed and tip mass; see `AssumedModesBeam.family`.

    ``tip`` are the rows that read its free end.
    """
    p, given = beam.parameters, checked_sensors(sequence("sensors", sensors, "BeamSensor"), beam.parameters.length)
    for i, sensor in enumerate(given):
        if sensor.quantity == _ACCELERATION:
            raise ValueError(f"sensors[{i}]: expected no acceleration, whose reading changes with the hub speed")
    ranges: dict[str, tuple[float, float]] = {}
    if isinstance(hub_speed, (int, float)):
        fixed = beam._steady_speed(hub_speed)
    else:
        ranges["hub_speed"], fixed = interval("hub_speed", hub_speed), 0.0
        for end in ranges["hub_speed"]:
            beam._steady_speed(end)
    if tip_mass is not None:
        ranges["tip_mass"] = interval("tip_mass", tip_mass)
        nonnegative("lower end of tip_mass", ranges["tip_mass"][0])
    if not ranges:
        raise ValueError(f"hub_speed = {hub_speed!r}: expected a range, two ascending numbers, where no other is given")
    rest = beam.linearize(0.0, given)
    read = [i for i, name in enumerate(rest.output_labels) if name in LOOP_OUTPUTS[:-1] or i >= len(LOOP_OUTPUTS)]
    size, C = beam._size, np.asarray(rest.C)[read]
    outputs, coordinates = tuple(rest.output_labels[i] for i in read), beam.state_names[:size]
    states = [i for i, name in enumerate(beam.state_names) if name not in outputs]
    rows = np.vstack([C, np.eye(2 * size)[states]])
    lines = np.array([rows[:, :size], rows[:, size:], np.zeros((len(rows), size))])
    outputs = (*outputs, *(beam.state_names[i] for i in states))
    units = LOOP_UNITS | {sensor.name: QUANTITIES[sensor.quantity] for sensor in given}
    reach, beams = p.hub_radius + p.length, {p.tip_mass: beam}

    def make(values: Mapping[str, float]) -> SecondOrderModel:
        speed, mass = values.get("hub_speed", fixed), values.get("tip_mass", p.tip_mass)
        here = beams.setdefault(mass, beam.with_tip_mass(mass))
        motion = here._small_motion(speed)
        columns = np.zeros((size, len(LOOP_INPUTS)))
        columns[0, :2], columns[1:, 2] = 1.0, tip.transverse
        columns[0, 2] = reach + tip.axial @ here._steady_coordinates(speed)
        structure = Structure.of(motion.mass, motion.damping, motion.stiffness, coordinates)
        return SecondOrderModel.of(structure, Ports.of_forces(LOOP_INPUTS, columns, outputs, lines, units=units))

    return PolynomialFamily.through(ranges, make, free=coordinates[:1])
