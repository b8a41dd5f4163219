"""Controllers, each with a certificate that was computed apart from the solver."""

from boomctl.synthesis.errors import SynthesisError
from boomctl.synthesis.generalized import generalized_plant, mixed_sensitivity, select_channels
from boomctl.synthesis.h_infinity import h_infinity
from boomctl.synthesis.loop import close_loop
from boomctl.synthesis.result import HInfinityCertificate, HInfinityResult
from boomctl.synthesis.symmetric import join_symmetric
from boomctl.synthesis.weights import band_pass, high_pass, low_pass, shelf

__all__ = [
    "HInfinityCertificate",
    "HInfinityResult",
    "SynthesisError",
    "band_pass",
    "close_loop",
    "generalized_plant",
    "h_infinity",
    "high_pass",
    "join_symmetric",
    "low_pass",
    "mixed_sensitivity",
    "select_channels",
    "shelf",
]
