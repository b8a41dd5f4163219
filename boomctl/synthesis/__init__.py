"""Controllers, each with a certificate that was computed apart from the solver."""

from boomctl.synthesis.errors import SynthesisError

__all__ = ["SynthesisError"]
