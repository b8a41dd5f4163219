"""Controllers, each with a certificate that was computed apart from the solver."""

from boomctl.synthesis.discrete import discretize
from boomctl.synthesis.errors import SynthesisError
from boomctl.synthesis.generalized import generalized_plant, mixed_sensitivity, select_channels
from boomctl.synthesis.h2 import H2Result, h2
from boomctl.synthesis.h_infinity import h_infinity
from boomctl.synthesis.kalman import KalmanResult, kalman
from boomctl.synthesis.loop import close_loop
from boomctl.synthesis.lqg import LqgResult, lqg
from boomctl.synthesis.lqr import LqrResult, lqr
from boomctl.synthesis.recovery import RecoveryResult, loop_transfer_recovery
from boomctl.synthesis.reduce_controller import ReducedController, reduce_controller
from boomctl.synthesis.result import HInfinityCertificate, HInfinityResult
from boomctl.synthesis.symmetric import join_symmetric, split_controller
from boomctl.synthesis.units import from_units, in_units
from boomctl.synthesis.weights import band_pass, high_pass, low_pass, shelf

__all__ = [
    "H2Result",
    "HInfinityCertificate",
    "HInfinityResult",
    "KalmanResult",
    "LqgResult",
    "LqrResult",
    "RecoveryResult",
    "ReducedController",
    "SynthesisError",
    "band_pass",
    "close_loop",
    "discretize",
    "from_units",
    "generalized_plant",
    "h2",
    "h_infinity",
    "high_pass",
    "in_units",
    "join_symmetric",
    "kalman",
    "loop_transfer_recovery",
    "low_pass",
    "lqg",
    "lqr",
    "mixed_sensitivity",
    "reduce_controller",
    "select_channels",
    "shelf",
    "split_controller",
]
