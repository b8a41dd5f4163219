# The public names and where each is defined: `__init__.py` loads them from there when they are first used.

from boomctl.synthesis.certificate import ActivePeak as ActivePeak
from boomctl.synthesis.certificate import ChannelNorm as ChannelNorm
from boomctl.tuning.result import TuneResult as TuneResult
from boomctl.tuning.solver.search import TuneStart as TuneStart
from boomctl.tuning.tune import tune as tune
