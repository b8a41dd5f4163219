"""Slews of a flexible beam on a hub: optimal ones, classical ones, and how to follow them."""

from boomctl.slew.comparison import SlewComparison, SlewLine, compare_slews
from boomctl.slew.costate import SwitchingCurve, switching_curve
from boomctl.slew.mesh_study import MeshStudy, mesh_study
from boomctl.slew.optimal import optimal_slew, resolve
from boomctl.slew.payloads import PayloadComparison, PayloadLine, compare_payloads
from boomctl.slew.result import Replay, SlewCertificate, SlewError, SlewResult
from boomctl.slew.shapers import Shaper, classical_spin_up, classical_torque, shaper
from boomctl.slew.torque import TorqueHistory
from boomctl.slew.tracking import TrackingResult, track

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
    "SlewResult",
    "SwitchingCurve",
    "TorqueHistory",
    "TrackingResult",
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
