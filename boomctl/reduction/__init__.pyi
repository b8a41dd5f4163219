# The public names and where each is defined: `__init__.py` loads them from there when they are first used.

from boomctl.reduction.reduce import reduce as reduce
from boomctl.reduction.result import ReductionCurves as ReductionCurves
from boomctl.reduction.result import ReductionResult as ReductionResult
