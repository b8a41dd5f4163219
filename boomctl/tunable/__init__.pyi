# The public names and where each is defined: `__init__.py` loads them from there when they are first used.

from boomctl.synthesis.plants.channels import budget as budget
from boomctl.synthesis.plants.channels import objective as objective
from boomctl.tuning.parts.makers import decentralised as decentralised
from boomctl.tuning.parts.makers import gain as gain
from boomctl.tuning.parts.makers import lead as lead
from boomctl.tuning.parts.makers import notch as notch
from boomctl.tuning.parts.makers import physical as physical
from boomctl.tuning.parts.makers import pid as pid
from boomctl.tuning.parts.makers import ppf as ppf
from boomctl.tuning.parts.makers import state_space as state_space
