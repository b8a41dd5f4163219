# The public names and where each is defined: `__init__.py` loads them from there when they are first used.

from boomctl.analysis.box.ramp import RampBound, ramp_bound
from boomctl.analysis.box.robustness import (
    RobustStability,
    StructuredMargin,
    robust_stability,
    structured_margin,
)
from boomctl.analysis.box.worst_case import WorstCase, worst_case
from boomctl.analysis.h2 import h2_norm
from boomctl.analysis.looking.bode import BodeResult, bode
from boomctl.analysis.looking.comparison import Comparison, compare
from boomctl.analysis.looking.nyquist import NyquistResult, nyquist
from boomctl.analysis.looking.pole_zero import PoleZeroResult, pzmap
from boomctl.analysis.looking.transients import TransientResult, impulse, step
from boomctl.analysis.loops import closed_loop_response, feedback_loop
from boomctl.analysis.margins import DiskMargin, LoopMargin, Margins, margins
from boomctl.analysis.measured import MeasuredCurve, read_measured_curve
from boomctl.analysis.model_norm import hinf_norm
from boomctl.analysis.modes import ModeRow, ModeTable, mode_table
from boomctl.analysis.norm import NormCertificate
from boomctl.analysis.nyquist import ExactLoopStability, exact_loop_stability
from boomctl.analysis.prove import prove
from boomctl.analysis.sampled_loops.sampled_norm import sampled_norm
from boomctl.analysis.sigma import SigmaComparison, SigmaResult, compare_sigma, sigma
from boomctl.analysis.state_outputs import with_states
from boomctl.lti.sampled import sample_plant

__all__ = [
    "BodeResult",
    "Comparison",
    "DiskMargin",
    "ExactLoopStability",
    "LoopMargin",
    "Margins",
    "MeasuredCurve",
    "ModeRow",
    "ModeTable",
    "NormCertificate",
    "NyquistResult",
    "PoleZeroResult",
    "RampBound",
    "RobustStability",
    "SigmaComparison",
    "SigmaResult",
    "StructuredMargin",
    "TransientResult",
    "WorstCase",
    "bode",
    "closed_loop_response",
    "compare",
    "compare_sigma",
    "exact_loop_stability",
    "feedback_loop",
    "h2_norm",
    "hinf_norm",
    "impulse",
    "margins",
    "mode_table",
    "nyquist",
    "prove",
    "pzmap",
    "ramp_bound",
    "read_measured_curve",
    "robust_stability",
    "sample_plant",
    "sampled_norm",
    "sigma",
    "step",
    "structured_margin",
    "with_states",
    "worst_case",
]
