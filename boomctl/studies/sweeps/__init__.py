"""Functions at many points: parameters, tracks, seeds, speeds, payloads; in one process or many, kept in a file."""

from boomctl.lazy import loader

__all__, __getattr__, __dir__ = loader(__name__)
