"""Drawing: the only part that knows matplotlib.  It draws results; it computes nothing."""

from boomctl.lazy import loader

__all__, __getattr__, __dir__ = loader(__name__)
