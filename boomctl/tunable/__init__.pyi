# The public names and where each is defined: `__init__.py` loads them from there when they are first used.

from boomctl.synthesis.plants.channels import constraint as constraint
from boomctl.synthesis.plants.channels import objective as objective
from boomctl.tunable.makers import decentralized as decentralized
from boomctl.tunable.makers import gain as gain
from boomctl.tunable.makers import notch as notch
from boomctl.tunable.makers import pid as pid
from boomctl.tunable.makers import plant_parameter as plant_parameter
from boomctl.tunable.makers import ppf as ppf
from boomctl.tunable.makers import state_space as state_space
