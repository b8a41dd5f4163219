# The public names and where each is defined: `__init__.py` loads them from there when they are first used.

from boomctl.slew.budget import SlewProgress
from boomctl.slew.classical.comparison import SlewComparison, SlewLine, compare_slews
from boomctl.slew.classical.shapers import Shaper, classical_spin_up, classical_torque, shaper
from boomctl.slew.classical.tracking import TrackingResult, track
from boomctl.slew.least_time.arcs import SwitchingCurve, switching_curve
from boomctl.slew.nlp.mesh_study import MeshStudy, mesh_study
from boomctl.slew.optimal import optimal_slew, resolve
from boomctl.slew.payloads import PayloadComparison, PayloadLine, compare_payloads
from boomctl.slew.result import Replay, SlewCertificate, SlewError, SlewResult
from boomctl.slew.torque import TorqueHistory
from boomctl.slew.tracking.monte_carlo import TrackingStudy
from boomctl.slew.tracking.tracked import TrackedSlew

__all__ = [
    "MeshStudy",
    "PayloadComparison",
    "PayloadLine",
    "Replay",
    "Shaper",
    "SlewCertificate",
    "SlewComparison",
    "SlewError",
    "SlewLine",
    "SlewProgress",
    "SlewResult",
    "SwitchingCurve",
    "TorqueHistory",
    "TrackedSlew",
    "TrackingResult",
    "TrackingStudy",
    "classical_spin_up",
    "classical_torque",
    "compare_payloads",
    "compare_slews",
    "mesh_study",
    "optimal_slew",
    "resolve",
    "shaper",
    "switching_curve",
    "track",
]
