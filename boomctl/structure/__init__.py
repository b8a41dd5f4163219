"""Linear structural dynamics of any planar machine: rows, bodies, beams, second-order models."""

from boomctl.lazy import loader

__all__, __getattr__, __dir__ = loader(__name__)
