# The public names and where each is defined: `__init__.py` loads them from there when they are first used.

from boomctl.analysis.box.robustness import (
    RobustStability,
    StructuredMargin,
    WorstCase,
    robust_stability,
    structured_margin,
    worst_case,
)
from boomctl.analysis.h2 import H2Certificate, h2_norm
from boomctl.analysis.loops import closed_loop_response, feedback_loop
from boomctl.analysis.margins import DiskMargin, LoopMargin, Margins, margins
from boomctl.analysis.measured import MeasuredCurve, read_measured_curve
from boomctl.analysis.modes import ModeRow, ModeTable, mode_table
from boomctl.analysis.norm import NormCertificate, hinf_norm
from boomctl.analysis.nyquist import ExactLoopStability, exact_loop_stability
from boomctl.analysis.sigma import SigmaComparison, SigmaResult, compare_sigma, sigma

__all__ = [
    "DiskMargin",
    "ExactLoopStability",
    "H2Certificate",
    "LoopMargin",
    "Margins",
    "MeasuredCurve",
    "ModeRow",
    "ModeTable",
    "NormCertificate",
    "RobustStability",
    "SigmaComparison",
    "SigmaResult",
    "StructuredMargin",
    "WorstCase",
    "closed_loop_response",
    "compare_sigma",
    "exact_loop_stability",
    "feedback_loop",
    "h2_norm",
    "hinf_norm",
    "margins",
    "mode_table",
    "read_measured_curve",
    "robust_stability",
    "sigma",
    "structured_margin",
    "worst_case",
]
