# The public names and where each is defined: `__init__.py` loads them from there when they are first used.

from boomctl.reduction.reduce import reduce
from boomctl.reduction.result import ReductionCurves, ReductionError, ReductionResult

__all__ = [
    "ReductionCurves",
    "ReductionError",
    "ReductionResult",
    "reduce",
]
