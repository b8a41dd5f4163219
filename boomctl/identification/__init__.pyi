# The public names and where each is defined: `__init__.py` loads them from there when they are first used.

from boomctl.identification.certificate import FitCertificate
from boomctl.identification.fit import fit
from boomctl.identification.identifiability import Combination
from boomctl.identification.identify import Identification, IdentifiedMode, identify
from boomctl.identification.response import estimate_response
from boomctl.identification.result import FitResult

__all__ = [
    "Combination",
    "FitCertificate",
    "FitResult",
    "Identification",
    "IdentifiedMode",
    "estimate_response",
    "fit",
    "identify",
]
