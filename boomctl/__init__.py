"""Control design for flexible structures on a moving base.

Names are loaded when first used, so that ``import boomctl`` itself costs next to nothing.
"""

from boomctl.lazy import loader

__version__ = "0.1.0"

__all__, __getattr__, __dir__ = loader(__name__)
__all__.append("__version__")
