# The public names and where each is defined: `__init__.py` loads them from there when they are first used.

from boomctl.studies.sweeps.booms import SigmaStudy
from boomctl.studies.sweeps.field import FieldStudy
from boomctl.studies.sweeps.result import FailedPoint, SweepResult
from boomctl.studies.sweeps.sweep import SweepWarning, sweep

__all__ = [
    "FailedPoint",
    "FieldStudy",
    "SigmaStudy",
    "SweepResult",
    "SweepWarning",
    "sweep",
]
