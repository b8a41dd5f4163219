# The public names and where each is defined: `__init__.py` loads them from there when they are first used.

from boomctl.studies.suspension.design import SuspensionDesign as SuspensionDesign
from boomctl.studies.suspension.design import SuspensionResult as SuspensionResult
from boomctl.studies.suspension.performance import Performance as Performance
from boomctl.studies.suspension.performance import evaluate_suspension as evaluate_suspension
from boomctl.studies.suspension.scenario import ACCELERATIONS as ACCELERATIONS
from boomctl.studies.suspension.scenario import CONTROLS as CONTROLS
from boomctl.studies.suspension.scenario import MASS as MASS
from boomctl.studies.suspension.scenario import SPRING as SPRING
from boomctl.studies.suspension.scenario import STROKES as STROKES
from boomctl.studies.suspension.scenario import FieldScenario as FieldScenario
from boomctl.studies.suspension.scenario import suspension_model as suspension_model
