"""Smaller systems that answer alike: every reduction carries a bound and a verified error."""

from boomctl.lazy import loader

__all__, __getattr__, __dir__ = loader(__name__)
