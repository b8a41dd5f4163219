# The public names and where each is defined: `__init__.py` loads them from there when they are first used.

from boomctl.rotating_beam.assumed_modes import AssumedModesBeam
from boomctl.rotating_beam.beam import HubBeam
from boomctl.rotating_beam.campbell import CampbellDiagram, SpeedCrossing
from boomctl.rotating_beam.exact.beam import GeometricallyExactBeam
from boomctl.rotating_beam.factory import hub_beam
from boomctl.rotating_beam.manoeuvres import free, hold, hub_profile, sine_torque, spin_up, torque
from boomctl.rotating_beam.parameters import HubBeamParameters
from boomctl.rotating_beam.result import SimulationError, SimulationResult
from boomctl.rotating_beam.sensors import BeamSensor

__all__ = [
    "AssumedModesBeam",
    "BeamSensor",
    "CampbellDiagram",
    "GeometricallyExactBeam",
    "HubBeam",
    "HubBeamParameters",
    "SimulationError",
    "SimulationResult",
    "SpeedCrossing",
    "free",
    "hold",
    "hub_beam",
    "hub_profile",
    "sine_torque",
    "spin_up",
    "torque",
]
