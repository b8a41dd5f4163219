# The public names and where each is defined: `__init__.py` loads them from there when they are first used.

from boomctl.synthesis.plants.channels import budget, objective
from boomctl.tuning.parts.makers import (
    decentralised,
    gain,
    lead,
    notch,
    physical,
    pid,
    ppf,
    state_space,
)

__all__ = [
    "budget",
    "decentralised",
    "gain",
    "lead",
    "notch",
    "objective",
    "physical",
    "pid",
    "ppf",
    "state_space",
]
