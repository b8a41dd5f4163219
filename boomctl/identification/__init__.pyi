# The public names and where each is defined: `__init__.py` loads them from there when they are first used.

from boomctl.identification.certificate import FitCertificate as FitCertificate
from boomctl.identification.fit import fit as fit
from boomctl.identification.identifiability import Combination as Combination
from boomctl.identification.identify import Identification as Identification
from boomctl.identification.identify import IdentifiedMode as IdentifiedMode
from boomctl.identification.identify import RealPole as RealPole
from boomctl.identification.identify import identify as identify
from boomctl.identification.response import MeasuredResponse as MeasuredResponse
from boomctl.identification.response import estimate_response as estimate_response
from boomctl.identification.result import FitResult as FitResult
from boomctl.identification.uncertainty_band import uncertainty_band as uncertainty_band
