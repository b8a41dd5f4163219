"""Damping proportional to stiffness, and the damping beyond it.

Material damping is proportional to stiffness, and dampers are few.  A spring without damping counts as a damper of
``-beta k``.
"""

import numpy as np

from boomctl.arrays import Array
from boomctl.lti.rounding import SUMMED
from boomctl.structure.matrices import Structure


def uneven_damping(structure: Structure) -> tuple[float, Array]:
    """Return the damping per stiffness that most rows share, and the weights of the damping beyond it."""
    k, c = structure.weights.k, structure.weights.c
    stiffness, damping = (weight if weight.ndim == 1 else weight.diagonal() for weight in (k, c))
    ratios = np.sort(damping[stiffness > 0.0] / stiffness[stiffness > 0.0])
    beta = float(ratios[len(ratios) // 2]) if len(ratios) else 0.0
    excess = c - beta * k
    return beta, np.where(np.abs(excess) > SUMMED * np.maximum(np.abs(c), np.abs(beta * k)), excess, 0.0)
