"""H2 norms of closed loops by both Gramians, solved apart from each other.

The Gramians are those of balanced states, by Bartels and Stewart: with each mode of a plant twice in the loop, once
regulated and once estimated, its eigenvectors are nearly parallel, and modal coordinates would lose the digits.
"""

from dataclasses import dataclass

import numpy as np
from scipy import linalg

from boomctl.lti.system import Lti


@dataclass(frozen=True)
class QuadraticNorm:
    """An H2 norm by the Gramian of controllability and by that of observability; infinite if not stable or proper."""

    controllability: float
    observability: float

    @property
    def value(self) -> float:
        """The larger of the two."""
        return max(self.controllability, self.observability)

    @property
    def disagreement(self) -> float:
        """Difference of the two, relative."""
        if not np.isfinite(self.value):
            return np.inf
        return abs(self.controllability - self.observability) / max(self.value, float(np.finfo(float).tiny))


def quadratic_norm(system: Lti) -> QuadraticNorm:
    """Return the H2 norm of a system in continuous time, by both Gramians."""
    if not len(system.A):
        value = np.inf if system.D.any() else 0.0
        return QuadraticNorm(value, value)
    if system.D.any() or linalg.eigvals(system.A).real.max() >= 0.0:
        return QuadraticNorm(np.inf, np.inf)
    A, (scale, _) = linalg.matrix_balance(system.A, permute=False, separate=True)
    B, C = system.B / scale[:, None], system.C * scale
    P = linalg.solve_continuous_lyapunov(A, -B @ B.T)
    Q = linalg.solve_continuous_lyapunov(A.T, -C.T @ C)
    return QuadraticNorm(_root(np.trace(C @ P @ C.T)), _root(np.trace(B.T @ Q @ B)))


def _root(square: float) -> float:
    return float(np.sqrt(max(float(square), 0.0)))
