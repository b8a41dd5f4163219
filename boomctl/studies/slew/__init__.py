"""Slews of the hub-beam, judged: beside classical ones, with payloads, on other models, with feedback; a report."""

from boomctl.studies.slew.design import SlewDesign, SlewEvaluation

__all__ = ["SlewDesign", "SlewEvaluation"]
