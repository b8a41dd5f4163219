# The public names and where each is defined: `__init__.py` loads them from there when they are first used.

from boomctl.lti.controllers.time_varying import TimeVaryingController
from boomctl.simulation.contact.friction import CoulombFriction
from boomctl.simulation.contact.stops import StopHit
from boomctl.simulation.forced_response import ForcedResponse, forced_response
from boomctl.simulation.loop import simulate_loop
from boomctl.simulation.result import FrictionReport, LoopResult
from boomctl.simulation.sines.describing_function import SineResponse, describing_function
from boomctl.simulation.sines.swept_sine import sine_sigma, swept_sine

__all__ = [
    "CoulombFriction",
    "ForcedResponse",
    "FrictionReport",
    "LoopResult",
    "SineResponse",
    "StopHit",
    "TimeVaryingController",
    "describing_function",
    "forced_response",
    "simulate_loop",
    "sine_sigma",
    "swept_sine",
]
