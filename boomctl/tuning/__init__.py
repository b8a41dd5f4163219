"""Tuning of controllers of a fixed structure, with certificates and lower bounds for any controller."""

from boomctl.lazy import loader

__all__, __getattr__, __dir__ = loader(__name__)
