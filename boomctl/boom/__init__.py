"""The spray boom of Anthonis & Ramon (2003): parameters and models."""

from boomctl.boom.exact import exact_eigenfrequencies_hz, exact_frequency_response
from boomctl.boom.model import spray_boom
from boomctl.boom.parameters import BoomParameters

__all__ = ["BoomParameters", "exact_eigenfrequencies_hz", "exact_frequency_response", "spray_boom"]
