"""Plots of results. The only package that uses matplotlib."""

from boomctl.lazy import loader

__all__, __getattr__, __dir__ = loader(__name__)
