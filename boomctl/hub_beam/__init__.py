"""The rotating hub-beam with a point mass of Bai et al. (2009): models from linear to geometrically exact.

``boomctl.hub_beam`` is this package and the factory of the same name at once: the package can be called.
"""

import sys
from types import ModuleType
from typing import Any

from boomctl.hub_beam.manoeuvres import free, hold, hub_profile, sine_torque, spin_up, torque
from boomctl.hub_beam.model import HubBeam, hub_beam
from boomctl.hub_beam.motion import SimulationError
from boomctl.hub_beam.parameters import HubBeamParameters
from boomctl.hub_beam.result import SimulationResult

__all__ = [
    "HubBeam",
    "HubBeamParameters",
    "SimulationError",
    "SimulationResult",
    "free",
    "hold",
    "hub_beam",
    "hub_profile",
    "sine_torque",
    "spin_up",
    "torque",
]


class _Callable(ModuleType):
    """A package that is called like its function `hub_beam`."""

    def __call__(self, parameters: HubBeamParameters | None = None, model: str = "sfoam", modes: int = 5) -> Any:
        return hub_beam(parameters, model, modes)


sys.modules[__name__].__class__ = _Callable
