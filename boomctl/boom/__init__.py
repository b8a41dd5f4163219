"""The spray boom of Anthonis & Ramon (2003): parameters and models."""

from boomctl.boom.exact import exact_eigenfrequencies_hz, exact_frequency_response
from boomctl.boom.model import spray_boom
from boomctl.boom.parameters import BoomParameters
from boomctl.boom.uncertainty import boom_family, yaw_family

__all__ = [
    "BoomParameters",
    "boom_family",
    "exact_eigenfrequencies_hz",
    "exact_frequency_response",
    "spray_boom",
    "yaw_family",
]
