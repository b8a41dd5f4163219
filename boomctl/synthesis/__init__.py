"""Controllers, each with a certificate that was computed apart from the solver."""

from boomctl.synthesis.errors import SynthesisError
from boomctl.synthesis.lqr import LqrResult, lqr

__all__ = ["LqrResult", "SynthesisError", "lqr"]
