"""The rotating hub-beam with a point mass of Bai et al. (2009): models from linear to geometrically exact."""

from boomctl.lazy import loader

__all__, __getattr__, __dir__ = loader(__name__)
