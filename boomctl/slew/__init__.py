"""Slews of a flexible beam on a hub: optimal ones, classical ones, and how to follow them."""

from boomctl.lazy import loader

__all__, __getattr__, __dir__ = loader(__name__)
