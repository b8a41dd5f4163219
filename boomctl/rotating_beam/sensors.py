"""Sensors on a hub-beam, and the signals of a beam in a loop."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, final

from boomctl.checks import instance, known, nonnegative, real, signal_name

QUANTITIES: Final = {"displacement": "m", "slope": "rad", "moment": "N m", "strain": "m/m", "acceleration": "m/s^2"}
"""Measured quantities and their units."""

LOOP_INPUTS: Final = ("torque", "disturbance_torque", "tip_force")
"""Inputs of a beam in a loop: torque of the drive, disturbance torque on the hub, transverse force at the free end."""

LOOP_OUTPUTS: Final = ("hub_angle", "hub_speed", "tip_displacement", "root_moment", "tip_acceleration")
"""Outputs of a beam in a loop, in addition to its sensors."""

LOOP_UNITS: Final = {
    **dict(zip(LOOP_INPUTS, ("N m", "N m", "N"), strict=True)),
    **dict(zip(LOOP_OUTPUTS, ("rad", "rad/s", "m", "N m", "m/s^2"), strict=True)),
}
"""SI units of these inputs and outputs."""


@final
@dataclass(frozen=True)
class BeamSensor:
    """Sensor at a position on a hub-beam.

    Parameters
    ----------
    name : str
        Name of its signal.
    quantity : str
        "displacement" [m], normal to the undeformed beam, relative to the hub; "slope" [rad], relative to the hub;
        "moment" [N m], the bending moment ``EI v''``; "strain", of the surface at ``height`` from the neutral axis;
        "acceleration" [m/s^2], the component of the absolute acceleration normal to the undeformed beam.
    position : float
        Distance from the clamp along the undeformed beam, m.
    height : float or None
        Distance of the strain gauge from the neutral axis, m, positive on the side of positive displacements.
        Required for "strain", which is the axial strain of the neutral axis less ``height`` times the curvature.

    Raises
    ------
    TypeError, ValueError
        If a value has the wrong type or is out of its range.

    Examples
    --------
    >>> import boomctl as bc
    >>> bc.BeamSensor("gauge", "strain", position=0.5, height=0.01).position
    0.5
    """

    name: str
    quantity: str
    position: float
    height: float | None = None

    def __post_init__(self) -> None:
        signal_name("name", self.name)
        known("quantity", self.quantity, QUANTITIES)
        nonnegative("position", self.position)
        if (self.height is None) == (self.quantity == "strain"):
            wanted = "a distance from the neutral axis [m]" if self.height is None else "None"
            raise ValueError(f"height = {self.height!r}: expected {wanted} for the quantity {self.quantity!r}")
        if self.height is not None:
            real("height", self.height)


def checked_sensors(sensors: Sequence[object], length: float) -> tuple[BeamSensor, ...]:
    """Return sensors, checked to be on a beam of a length [m] and to have unique names.

    Raises
    ------
    TypeError, ValueError
        If an entry is not a BeamSensor, is beyond the free end, or has the name of another output.
    """
    result: list[BeamSensor] = []
    for i, item in enumerate(sensors):
        sensor = instance(f"sensors[{i}]", item, BeamSensor)
        if sensor.position > length:
            raise ValueError(
                f"sensors[{i}]: position = {sensor.position!r}: expected a place on the beam, 0 to {length} m"
            )
        if sensor.name in (*LOOP_OUTPUTS, *(other.name for other in result)):
            raise ValueError(f"sensors[{i}]: expected a name of its own, got {sensor.name!r}, which another output has")
        result.append(sensor)
    return tuple(result)
