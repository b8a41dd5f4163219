# The public names and where each is defined: `__init__.py` loads them from there when they are first used.

from boomctl.rotating_beam.assumed_modes import AssumedModesBeam as AssumedModesBeam
from boomctl.rotating_beam.beam import HubBeam as HubBeam
from boomctl.rotating_beam.campbell import CampbellDiagram as CampbellDiagram
from boomctl.rotating_beam.campbell import CriticalSpeed as CriticalSpeed
from boomctl.rotating_beam.exact.beam import GeometricallyExactBeam as GeometricallyExactBeam
from boomctl.rotating_beam.factory import hub_beam as hub_beam
from boomctl.rotating_beam.parameters import HubBeamParameters as HubBeamParameters
from boomctl.rotating_beam.result import SimulationResult as SimulationResult
from boomctl.rotating_beam.sensors import BeamSensor as BeamSensor

from . import published as published
