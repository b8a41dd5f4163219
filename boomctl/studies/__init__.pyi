# The public names and where each is defined: `__init__.py` loads them from there when they are first used.

from boomctl.studies.catalogue import design_names, load_design

from . import slew as slew
from . import suspension as suspension
from . import sweeps as sweeps

__all__ = [
    "design_names",
    "load_design",
]
