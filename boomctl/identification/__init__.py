"""Model parameters from measurements, with confidence intervals and unidentifiable combinations."""

from boomctl.lazy import loader

__all__, __getattr__, __dir__ = loader(__name__)
