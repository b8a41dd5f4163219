"""Horizontal suspensions of the boom, judged: certified peaks, uncertainty, a run over the field, a report."""

from boomctl.studies.suspension.design import SuspensionDesign, SuspensionResult
from boomctl.studies.suspension.performance import Performance, performance
from boomctl.studies.suspension.scene import ACCELERATIONS, CONTROLS, STROKES, FieldScene, suspension_model

__all__ = [
    "ACCELERATIONS",
    "CONTROLS",
    "STROKES",
    "FieldScene",
    "Performance",
    "SuspensionDesign",
    "SuspensionResult",
    "performance",
    "suspension_model",
]
