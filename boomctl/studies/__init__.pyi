# The public names and where each is defined: `__init__.py` loads them from there when they are first used.

from boomctl.studies.catalogue import design_names as design_names
from boomctl.studies.catalogue import load_design as load_design
from boomctl.studies.machine import MachineDesign as MachineDesign
from boomctl.studies.slew import SlewDesign as SlewDesign
from boomctl.studies.suspension.design import SuspensionDesign as SuspensionDesign
from boomctl.studies.suspension.performance import evaluate_suspension as evaluate_suspension
from boomctl.studies.suspension.scenario import FieldScenario as FieldScenario

from . import slew as slew
from . import suspension as suspension
from . import sweeps as sweeps
