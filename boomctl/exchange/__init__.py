"""Controllers and models to files and to other programs, and back."""

from boomctl.lazy import loader

__all__, __getattr__, __dir__ = loader(__name__)
