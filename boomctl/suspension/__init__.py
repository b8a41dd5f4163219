"""Horizontal suspensions of the boom, judged: certified peaks, uncertainty, a run over the field, a report."""

from boomctl.suspension.catalogue import design_names, load_design
from boomctl.suspension.design import SuspensionDesign
from boomctl.suspension.evaluate import SuspensionResult, evaluate
from boomctl.suspension.performance import Performance, performance
from boomctl.suspension.scene import ACCELERATIONS, CONTROLS, SENSORS, STROKES, FieldScene, suspension_model

__all__ = [
    "ACCELERATIONS",
    "CONTROLS",
    "SENSORS",
    "STROKES",
    "FieldScene",
    "Performance",
    "SuspensionDesign",
    "SuspensionResult",
    "design_names",
    "evaluate",
    "load_design",
    "performance",
    "suspension_model",
]
