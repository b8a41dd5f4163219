"""What designs are judged by: suspensions on the field, slews beside classical ones; designs by name or from a file."""

from boomctl.lazy import loader

__all__, __getattr__, __dir__ = loader(__name__)
