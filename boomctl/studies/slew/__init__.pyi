# The public names and where each is defined: `__init__.py` loads them from there when they are first used.

from boomctl.studies.slew.design import SlewDesign as SlewDesign
from boomctl.studies.slew.design import SlewEvaluation as SlewEvaluation
