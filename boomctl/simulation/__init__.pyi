# The public names and where each is defined: `__init__.py` loads them from there when they are first used.

from boomctl.simulation.contact.friction import CoulombFriction as CoulombFriction
from boomctl.simulation.contact.stops import StopContact as StopContact
from boomctl.simulation.forced_response import ForcedResponse as ForcedResponse
from boomctl.simulation.forced_response import forced_response as forced_response
from boomctl.simulation.loop import simulate_loop as simulate_loop
from boomctl.simulation.result import FrictionResult as FrictionResult
from boomctl.simulation.result import LoopResult as LoopResult
from boomctl.simulation.time_varying import TimeVaryingController as TimeVaryingController
