# The public names and where each is defined: `__init__.py` loads them from there when they are first used.

from boomctl.synthesis.certificate import ActivePeak, ChannelNorm
from boomctl.tuning.result import TuneResult
from boomctl.tuning.solver.search import TuneStart
from boomctl.tuning.tune import tune

__all__ = [
    "ActivePeak",
    "ChannelNorm",
    "TuneResult",
    "TuneStart",
    "tune",
]
