"""Sweeps: a function at many points, in one process or in parallel, with a checkpoint."""

from boomctl.lazy import loader

__all__, __getattr__, __dir__ = loader(__name__)
