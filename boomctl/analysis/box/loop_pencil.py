"""The loop of a structure and a controller as ``E x' = A x``, affine in whatever its matrices are affine in.

A state-space form would need the inverse of the mass matrix, and would lose that.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import linalg

from boomctl.arrays import Array
from boomctl.lti.modal import side_of_axis


@dataclass(frozen=True)
class LoopPencil:
    """``E x' = A x``."""

    E: Array
    A: Array

    @cached_property
    def poles(self) -> Array:
        """Its eigenvalues [rad/s]; infinite ones where ``E`` is singular."""
        try:
            return linalg.eigvals(np.linalg.solve(self.E, self.A))
        except np.linalg.LinAlgError:
            return np.array([complex(np.inf)])

    @property
    def stable(self) -> bool:
        """Whether all of its eigenvalues decay; undamped ones do not."""
        return bool((side_of_axis(self.poles) < 0).all())

    @property
    def abscissa(self) -> float:
        """Largest real part of its eigenvalues; negative if the loop is stable."""
        return float(self.poles.real.max())
