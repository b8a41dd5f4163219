"""Horizontal suspensions of the boom, judged: verified peaks, uncertainty, a run over the field, a report."""

from boomctl.lazy import loader

__all__, __getattr__, __dir__ = loader(__name__)
