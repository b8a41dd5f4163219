# The public names and where each is defined: `__init__.py` loads them from there when they are first used.

from boomctl.lti.controllers.scheduled import ScheduledController, schedule
from boomctl.synthesis.assumptions import SynthesisError
from boomctl.synthesis.certificate import DesignCertificate
from boomctl.synthesis.discretise import discretize
from boomctl.synthesis.hinf.h_infinity import HInfinityResult, h_infinity
from boomctl.synthesis.lq.h2 import H2Result, h2
from boomctl.synthesis.lq.kalman import KalmanResult, kalman
from boomctl.synthesis.lq.lqg import LqgResult, lqg
from boomctl.synthesis.lq.lqr import LqrResult, lqr
from boomctl.synthesis.lq.recovery import RecoveryResult, loop_transfer_recovery
from boomctl.synthesis.plants.full_plant import ReductionWarning
from boomctl.synthesis.plants.generalized import generalized_plant, mixed_sensitivity, select_channels
from boomctl.synthesis.plants.partition import close_loop
from boomctl.synthesis.plants.symmetry import join_symmetric, split_controller
from boomctl.synthesis.plants.units import from_units, in_units
from boomctl.synthesis.plants.weights import band_pass, high_pass, low_pass, shelf
from boomctl.synthesis.reduce_controller import ReducedController, reduce_controller

__all__ = [
    "DesignCertificate",
    "H2Result",
    "HInfinityResult",
    "KalmanResult",
    "LqgResult",
    "LqrResult",
    "RecoveryResult",
    "ReducedController",
    "ReductionWarning",
    "ScheduledController",
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
    "schedule",
    "select_channels",
    "shelf",
    "split_controller",
]
