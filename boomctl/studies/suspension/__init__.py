"""Evaluation of horizontal suspensions of the boom: peaks, uncertainty, a simulation on the field, a report."""

from boomctl.lazy import loader

__all__, __getattr__, __dir__ = loader(__name__)
