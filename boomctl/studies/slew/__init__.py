"""Slews of the hub-beam, judged: beside classical ones, with payloads, on other models, with feedback; a report."""

from boomctl.lazy import loader

__all__, __getattr__, __dir__ = loader(__name__)
