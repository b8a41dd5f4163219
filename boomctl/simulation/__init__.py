"""Linear plants in time: sampled controllers, limits, end stops, Coulomb friction."""

from boomctl.lazy import loader

__all__, __getattr__, __dir__ = loader(__name__)
