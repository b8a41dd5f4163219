"""Controller synthesis, with certificates that are computed independently of the solver."""

from boomctl.lazy import loader

__all__, __getattr__, __dir__ = loader(__name__)
