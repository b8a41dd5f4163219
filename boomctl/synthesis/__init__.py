"""Controllers, each with a certificate that was computed apart from the solver."""

from boomctl.synthesis.errors import SynthesisError
from boomctl.synthesis.symmetric import join_symmetric

__all__ = ["SynthesisError", "join_symmetric"]
