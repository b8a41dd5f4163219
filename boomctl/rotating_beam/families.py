"""The linear hub-beam over boxes of hub speed, tip mass and its other parameters."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import fields, replace
from functools import cache
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from boomctl.checks import known, sequence
from boomctl.rotating_beam.sensors import LOOP_INPUTS, LOOP_OUTPUTS, LOOP_UNITS, QUANTITIES, checked_sensors
from boomctl.structure.families import PolynomialFamily, interval
from boomctl.structure.matrices import Structure
from boomctl.structure.model import SecondOrderModel
from boomctl.structure.ports import Ports

if TYPE_CHECKING:
    from boomctl.arrays import Array
    from boomctl.rotating_beam.beam import HubBeam
    from boomctl.rotating_beam.modal.equations import Tip
    from boomctl.rotating_beam.sensors import BeamSensor

# parameters that change the model, but not the rows of its outputs
_UNREAD = ("tip_mass", "tip_mass_position", "hub_inertia", "density", "damping_ratio")
_ACCELERATION = "acceleration"  # the quantity whose reading changes with the hub speed


Read: TypeAlias = "tuple[tuple[str, ...], Array, dict[str, str]]"
"""Outputs, their rows over coordinates and rates, and units of signals."""


def read_by(beam: HubBeam, sensors: Sequence[BeamSensor]) -> Read:
    """Return the rows of the outputs of a beam in a loop, including its states."""
    checked = checked_sensors(sequence("sensors", sensors, "BeamSensor"), beam.parameters.length)
    for i, sensor in enumerate(checked):
        if sensor.quantity == _ACCELERATION:
            raise ValueError(f"sensors[{i}]: expected no acceleration, whose reading changes with the hub speed")
    size, outputs = beam._size, (*LOOP_OUTPUTS[:-1], *(sensor.name for sensor in checked))
    readings = np.zeros((len(outputs), 2 * size))
    readings[0, 0] = readings[1, size] = 1.0
    readings[2, :size], readings[3] = beam._small_motion(0.0).tip, beam._root_moment_row  # type: ignore[attr-defined]
    if checked:  # the linearization takes long
        rest = beam.linearize(0.0, checked)
        readings[4:] = np.asarray(rest.C)[[rest.output_labels.index(sensor.name) for sensor in checked]]
    states = [i for i, name in enumerate(beam.state_labels) if name not in outputs]
    rows = np.vstack([readings, np.eye(2 * size)[states]])
    lines = np.array([rows[:, :size], rows[:, size:], np.zeros((len(rows), size))])
    units = LOOP_UNITS | {sensor.name: QUANTITIES[sensor.quantity] for sensor in checked}
    return (*outputs, *(beam.state_labels[i] for i in states)), lines, units


def structure_of(beam: HubBeam, speed: float, read: Read) -> SecondOrderModel:
    """Return the linear model about steady rotation with these outputs."""
    tip: Tip = beam.equations.tip  # type: ignore[attr-defined]  # of models of assumed modes, the only ones that come here
    motion, size = beam._small_motion(speed), beam._size
    columns = np.zeros((size, len(LOOP_INPUTS)))
    columns[0, :2], columns[1:, 2] = 1.0, tip.transverse
    reach = beam.parameters.hub_radius + beam.parameters.length
    columns[0, 2] = reach + tip.axial @ beam._steady_coordinates(speed)
    structure = Structure.of(motion.mass, motion.damping, motion.stiffness, beam.state_labels[:size])
    outputs, lines, units = read
    return SecondOrderModel.of(structure, replace(Ports.of_forces(LOOP_INPUTS, columns, outputs, lines), units=units))


def hub_beam_family(
    beam: HubBeam,
    hub_speed: tuple[float, float] | float,
    sensors: Sequence[BeamSensor],
    parameters: Mapping[str, tuple[float, float]],
) -> PolynomialFamily:
    """Return a hub-beam about steady rotation over ranges of its parameters; see `AssumedModesBeam.family`."""
    ranges: dict[str, tuple[float, float]] = {}
    if isinstance(hub_speed, (int, float)):
        fixed = beam._speed_below(hub_speed, beam.max_steady_speed)
    else:
        ranges["hub_speed"], fixed = interval("hub_speed", hub_speed), 0.0
        for end in ranges["hub_speed"]:
            beam._speed_below(end, beam.max_steady_speed)
    for name, ends in parameters.items():
        ranges[name] = interval(known("parameter", name, [field.name for field in fields(beam.parameters)]), ends)
        for end, value in zip(("lower", "upper"), ranges[name], strict=True):
            try:
                replace(beam.parameters, **{name: value})
            except ValueError as error:
                raise ValueError(f"{end} end of {error}") from None
    if not ranges:
        raise ValueError(f"hub_speed = {hub_speed!r}: expected a range, two ascending numbers, where no other is given")

    @cache
    def changed_beam(changes: tuple[tuple[str, float], ...]) -> HubBeam:
        return beam._with(**dict(changes)) if changes else beam

    @cache
    def read(changes: tuple[tuple[str, float], ...]) -> Read:
        return read_by(changed_beam(changes), sensors)

    def make(values: Mapping[str, float]) -> SecondOrderModel:
        changes = tuple((name, value) for name, value in values.items() if name != "hub_speed")
        reading = read(tuple(item for item in changes if item[0] not in _UNREAD))
        return structure_of(changed_beam(changes), values.get("hub_speed", fixed), reading)

    return PolynomialFamily.from_function(ranges, make, free=beam.state_labels[:1])
