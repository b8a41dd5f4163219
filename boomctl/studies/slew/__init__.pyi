# The public names and where each is defined: `__init__.py` loads them from there when they are first used.

from boomctl.studies.slew.design import SlewDesign, SlewEvaluation
from boomctl.studies.slew.feedback import FeedbackStudy, Spread

__all__ = [
    "FeedbackStudy",
    "SlewDesign",
    "SlewEvaluation",
    "Spread",
]
