"""Controllers, each with a certificate that was computed apart from the solver."""

from boomctl.synthesis.discrete import discretize
from boomctl.synthesis.errors import SynthesisError
from boomctl.synthesis.h2 import H2Result, h2
from boomctl.synthesis.kalman import KalmanResult, kalman
from boomctl.synthesis.lqg import LqgResult, lqg
from boomctl.synthesis.lqr import LqrResult, lqr
from boomctl.synthesis.recovery import RecoveryResult, loop_transfer_recovery

__all__ = [
    "H2Result",
    "KalmanResult",
    "LqgResult",
    "LqrResult",
    "RecoveryResult",
    "SynthesisError",
    "discretize",
    "h2",
    "kalman",
    "loop_transfer_recovery",
    "lqg",
    "lqr",
]
