"""Parameters of a model from measurements: what fits, how sure it is, and what the measurements do not see."""

from boomctl.lazy import loader

__all__, __getattr__, __dir__ = loader(__name__)
