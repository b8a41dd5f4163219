"""What controllers are made of, for ``boomctl.tune``: parts with free numbers, and channels whose norms count."""

from boomctl.lazy import loader

__all__, __getattr__, __dir__ = loader(__name__)
