"""Horizontal suspensions of the boom, judged: certified peaks, uncertainty, a run over the field, a report."""

from boomctl.studies.suspension.catalogue import design_names, load_design
from boomctl.studies.suspension.design import SuspensionDesign
from boomctl.studies.suspension.evaluate import SuspensionResult, evaluate
from boomctl.studies.suspension.performance import Performance, performance
from boomctl.studies.suspension.scene import ACCELERATIONS, CONTROLS, SENSORS, STROKES, FieldScene, suspension_model

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
