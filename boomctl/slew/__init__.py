"""Slews of a flexible beam on a hub: optimal ones, classical ones, and how to follow them."""

from boomctl.slew.comparison import SlewComparison, SlewLine, compare_slews
from boomctl.slew.mesh_study import MeshStudy, mesh_study
from boomctl.slew.optimal import optimal_slew, resolve
from boomctl.slew.result import Replay, SlewCertificate, SlewError, SlewResult
from boomctl.slew.shapers import Shaper, classical_torque, shaper
from boomctl.slew.torque import TorqueHistory
from boomctl.slew.tracking import TrackingResult, track

__all__ = [
    "MeshStudy",
    "Replay",
    "Shaper",
    "SlewCertificate",
    "SlewComparison",
    "SlewError",
    "SlewLine",
    "SlewResult",
    "TorqueHistory",
    "TrackingResult",
    "classical_torque",
    "compare_slews",
    "mesh_study",
    "optimal_slew",
    "resolve",
    "shaper",
    "track",
]
