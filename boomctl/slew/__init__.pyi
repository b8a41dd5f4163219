# The public names and where each is defined: `__init__.py` loads them from there when they are first used.

from boomctl.slew.comparison import SlewComparison as SlewComparison
from boomctl.slew.comparison import SlewRow as SlewRow
from boomctl.slew.comparison import compare_slews as compare_slews
from boomctl.slew.deadline import SlewProgress as SlewProgress
from boomctl.slew.monte_carlo import TrackingStudy as TrackingStudy
from boomctl.slew.optimal import optimal_slew as optimal_slew
from boomctl.slew.optimal import replan as replan
from boomctl.slew.result import Replay as Replay
from boomctl.slew.result import SlewCertificate as SlewCertificate
from boomctl.slew.result import SlewResult as SlewResult
from boomctl.slew.result import SwitchingFunction as SwitchingFunction
from boomctl.slew.result import switching_function as switching_function
from boomctl.slew.shapers import Shaper as Shaper
from boomctl.slew.shapers import input_shaper as input_shaper
from boomctl.slew.shapers import rest_to_rest_torque as rest_to_rest_torque
from boomctl.slew.shapers import spin_up_torque as spin_up_torque
from boomctl.slew.torque import TorqueProfile as TorqueProfile
from boomctl.slew.tracked import TrackedSlew as TrackedSlew
