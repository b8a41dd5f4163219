"""Controllers of a structure that is given, tuned: certified, and with a bound that no controller beats."""

from boomctl.lazy import loader

__all__, __getattr__, __dir__ = loader(__name__)
