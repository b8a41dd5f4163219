# The public names and where each is defined: `__init__.py` loads them from there when they are first used.

from boomctl.studies.sweeps.result import FailedPoint as FailedPoint
from boomctl.studies.sweeps.result import SweepResult as SweepResult
from boomctl.studies.sweeps.sweep import sweep as sweep
