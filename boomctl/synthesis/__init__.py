"""Controllers, each with a certificate that was computed apart from the solver."""

from boomctl.lazy import loader

__all__, __getattr__, __dir__ = loader(__name__)
