"""Smaller systems that answer alike: every reduction carries a bound and a verified error."""

from boomctl.reduction.reduce import reduce
from boomctl.reduction.result import ReductionError, ReductionResult

__all__ = ["ReductionError", "ReductionResult", "reduce"]
