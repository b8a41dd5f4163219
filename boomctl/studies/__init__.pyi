# The public names and where each is defined: `__init__.py` loads them from there when they are first used.

from boomctl.studies.catalogue import design_names, load_design
from boomctl.studies.machine import MachineDesign
from boomctl.studies.slew.design import SlewDesign
from boomctl.studies.spin_up import SpinUpDesign
from boomctl.studies.suspension.design import SuspensionDesign
from boomctl.studies.suspension.performance import performance
from boomctl.studies.suspension.scene import FieldScene
from boomctl.studies.sweeps.booms import SigmaStudy
from boomctl.studies.sweeps.field import FieldStudy

from . import slew as slew
from . import suspension as suspension
from . import sweeps as sweeps

__all__ = [
    "FieldScene",
    "FieldStudy",
    "MachineDesign",
    "SigmaStudy",
    "SlewDesign",
    "SpinUpDesign",
    "SuspensionDesign",
    "design_names",
    "load_design",
    "performance",
]
