# The public names and where each is defined: `__init__.py` loads them from there when they are first used.

from boomctl.identification.files.frequency_response import MeasuredFrequencyResponse as MeasuredFrequencyResponse
from boomctl.identification.files.frequency_response import read_frequency_response as read_frequency_response
from boomctl.identification.fit import fit as fit
from boomctl.identification.fit_certificate import FitCertificate as FitCertificate
from boomctl.identification.fit_result import FitResult as FitResult
from boomctl.identification.identifiability import ParameterCombination as ParameterCombination
from boomctl.identification.identify import IdentificationResult as IdentificationResult
from boomctl.identification.identify import IdentifiedMode as IdentifiedMode
from boomctl.identification.identify import RealPole as RealPole
from boomctl.identification.identify import identify as identify
from boomctl.identification.response import FrequencyResponseEstimate as FrequencyResponseEstimate
from boomctl.identification.response import estimate_frequency_response as estimate_frequency_response
from boomctl.identification.uncertainty_weight import uncertainty_weight as uncertainty_weight
