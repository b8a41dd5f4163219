"""Frequency-domain analysis of any linear system: singular values, verified norms, modes, margins, robustness."""

from boomctl.lazy import loader

__all__, __getattr__, __dir__ = loader(__name__)
