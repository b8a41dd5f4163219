"""Integrators and rigid bodies told by structure: poles at zero (``z = 1``) with their Jordan chains, deflated step by step.

An eigenvalue solver moves a chain of ``k`` poles at zero by the ``k``-th root of rounding, and one beside slow poles by
rounding over their distance, so that its poles do not tell.  What tells is whether ``A`` is singular to within the
rounding of its own entries: then the vectors that ``A`` takes to zero are split off, and the rest is asked again.
"""

from dataclasses import dataclass

import numpy as np
from scipy import linalg

from boomctl.arrays import Array
from boomctl.lti.rounding import CANCELLED, EPS
from boomctl.lti.system import Lti

# share of the largest pole below which a simple pole may be one at zero beside other slow ones (a choice)
_RIGID = 1e-6
_SPREAD = 10.0  # times the root of rounding, of the norm of A, that poles of a chain may lie apart (a choice)


@dataclass(frozen=True)
class SpectralParts:
    """A system as the sum of two.

    Attributes
    ----------
    rest : Lti
        With ``D``.
    kept : Lti
        The part that is split off, without ``D``.
    doubt : float
        How far rounding may have moved the entries of the rest's ``A``, to first order; 0 where nothing was split.
    """

    rest: Lti
    kept: Lti
    doubt: float

    @classmethod
    def whole(cls, system: Lti) -> "SpectralParts":
        """Return a system of which nothing is split off."""
        B, C = system.B[:0], system.C[:, :0]
        return cls(system, Lti(np.zeros((0, 0)), B, C, np.zeros_like(system.D), dt=system.dt), 0.0)

    @classmethod
    def of(cls, system: Lti, A: Array, Z: Array, count: int) -> "SpectralParts":
        """Return the sum of the first ``count`` states and the others of ``A``, block triangular, in columns ``Z``."""
        N, rest = A[:count, :count], A[count:, count:]
        X = linalg.solve_sylvester(N, -rest, -A[:count, count:]) if 0 < count < len(A) else np.zeros((count, len(rest)))
        B, C = Z.T @ system.B, system.C @ Z
        norm = 1.0 + (float(np.linalg.norm(X, 2)) if X.size else 0.0)
        return cls(
            Lti(rest, B[count:], C[:, :count] @ X + C[:, count:], system.D, dt=system.dt),
            Lti(N, B[:count] - X @ B[count:], C[:, :count], np.zeros_like(system.D), dt=system.dt),
            CANCELLED * float(np.linalg.norm(system.A)) * norm,
        )


def without_integrators(system: Lti) -> SpectralParts:
    """Return a system as the sum of its integrators, Jordan chains whole, and all else.

    What is kept has an upper triangular ``A`` with zeros, in discrete time ones, on its diagonal.
    """
    n, one = len(system.A), 0.0 if system.dt == 0.0 else 1.0
    scaled = system.balanced()
    T, Z, size, count, carried = scaled.A - one * np.eye(n), np.eye(n), np.abs(scaled.A), 0, 0.0
    if one:  # what sampling makes of small entries are sums of terms as large as the largest
        size[:] = size.max(initial=0.0)
    while count < n:
        U, values, Vt = linalg.svd(T[count:, count:])
        doubt = n * CANCELLED * ((np.abs(U).T @ size[count:, count:]) * np.abs(Vt)).sum(axis=1)
        null = values <= doubt + EPS * values[0] + carried
        if not null.any():
            break
        if not null.all():  # vectors are off by so much, and what is left
            carried += float(values[0] * values[null].max() / values[~null].min())
        Q = np.eye(n)
        Q[count:, count:] = Vt[null.argsort()[::-1]].T
        T, Z, size = Q.T @ T @ Q, Z @ Q, np.abs(Q).T @ size @ np.abs(Q)
        T[count:, count : count + null.sum()] = 0.0
        count += int(null.sum())
    sizes = np.sort(np.abs(system.poles - one))
    moved = _SPREAD * EPS ** (1.0 / max(count, 1)) * float(np.linalg.norm(scaled.A - one * np.eye(n), 2))
    if not count or sizes[count - 1] > max(_RIGID * sizes[-1], moved):
        return SpectralParts.whole(system)
    return SpectralParts.of(scaled, T + one * np.eye(n), Z, count)
