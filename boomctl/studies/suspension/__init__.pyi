# The public names and where each is defined: `__init__.py` loads them from there when they are first used.

from boomctl.studies.suspension.design import SuspensionDesign, SuspensionResult
from boomctl.studies.suspension.performance import Performance, performance
from boomctl.studies.suspension.scene import (
    ACCELERATIONS,
    CONTROLS,
    STROKES,
    FieldScene,
    suspension_family,
    suspension_model,
)

__all__ = [
    "ACCELERATIONS",
    "CONTROLS",
    "STROKES",
    "FieldScene",
    "Performance",
    "SuspensionDesign",
    "SuspensionResult",
    "performance",
    "suspension_family",
    "suspension_model",
]
