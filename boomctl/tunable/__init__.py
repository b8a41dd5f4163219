"""Tunable controller blocks and design requirements for ``boomctl.tune``."""

from boomctl.lazy import loader

__all__, __getattr__, __dir__ = loader(__name__)
