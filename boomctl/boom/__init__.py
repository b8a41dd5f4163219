"""The spray boom of Anthonis & Ramon (2003): parameters, models, excitation by a tractor on a track, spray on the field."""

from boomctl.lazy import loader

__all__, __getattr__, __dir__ = loader(__name__)
