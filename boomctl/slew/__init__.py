"""Slews of a flexible beam on a hub: optimal ones, classical ones, and how to follow them."""

from boomctl.slew.optimal import optimal_slew
from boomctl.slew.result import Replay, SlewCertificate, SlewError, SlewResult
from boomctl.slew.torque import TorqueHistory

__all__ = ["Replay", "SlewCertificate", "SlewError", "SlewResult", "TorqueHistory", "optimal_slew"]
