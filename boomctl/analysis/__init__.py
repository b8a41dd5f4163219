"""Frequency-domain analysis of any linear system: singular values, certified norms, measured curves."""

from boomctl.analysis.measured import MeasuredCurve, read_measured_curve
from boomctl.analysis.norm import NormCertificate, hinf_norm
from boomctl.analysis.sigma import SigmaResult, sigma

__all__ = ["MeasuredCurve", "NormCertificate", "SigmaResult", "hinf_norm", "read_measured_curve", "sigma"]
