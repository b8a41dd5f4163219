"""Evaluation of designs: suspensions on the field, slews, drives; designs by name or from a file; sweeps."""

from boomctl.lazy import loader

__all__, __getattr__, __dir__ = loader(__name__)
