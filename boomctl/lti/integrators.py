"""Integrators and rigid bodies identified by structure: poles at zero (``z = 1``) and their Jordan chains, by deflation.

An eigenvalue solver perturbs a chain of ``k`` poles at zero by the ``k``-th root of the rounding error, and a pole near slow
poles by the rounding error over their distance, so computed poles do not identify integrators.  The criterion is that ``A``
is singular to within the rounding error of its entries.  Its null space is then deflated, and the remainder is tested again.
"""

from dataclasses import dataclass

import numpy as np
from scipy import linalg

from boomctl.arrays import Array
from boomctl.lti.rounding import CANCELLED, EPS
from boomctl.lti.system import Lti

# Fraction of the largest pole below which a simple pole may be a pole at zero near other slow poles.
_RIGID = 1e-6
_SPREAD = 10.0  # Largest spread of the poles of a chain, in units of the k-th root of rounding times the norm of A.


@dataclass(frozen=True)
class SpectralParts:
    """A system as the sum of two subsystems.

    Attributes
    ----------
    rest : Lti
        With ``D``.
    retained : Lti
        The part that is split off, without ``D``.
    error_bound : float
        First-order bound on the rounding error of the entries of ``rest.A``; 0 if nothing was split.
    """

    rest: Lti
    retained: Lti
    error_bound: float

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
    """Return a system as the sum of its integrators, with complete Jordan chains, and the remainder.

    The integrators have an upper triangular ``A`` with zeros on its diagonal, in discrete time ones.
    """
    n, one = len(system.A), 0.0 if system.dt == 0.0 else 1.0
    scaled = system.balanced()
    T, Z, size, count, carried = scaled.A - one * np.eye(n), np.eye(n), np.abs(scaled.A), 0, 0.0
    if one:  # Sampled small entries are sums of terms as large as the largest.
        size[:] = size.max(initial=0.0)
    while count < n:
        U, values, Vt = linalg.svd(T[count:, count:])
        error_bound = n * CANCELLED * ((np.abs(U).T @ size[count:, count:]) * np.abs(Vt)).sum(axis=1)
        null = values <= error_bound + EPS * values[0] + carried
        if not null.any():
            break
        if not null.all():  # Errors of the null vectors, and of the remainder.
            carried += float(values[0] * values[null].max() / values[~null].min())
        Q = np.eye(n)
        Q[count:, count:] = Vt[null.argsort()[::-1]].T
        T, Z, size = Q.T @ T @ Q, Z @ Q, np.abs(Q).T @ size @ np.abs(Q)
        T[count:, count : count + null.sum()] = 0.0
        count += int(null.sum())
    sizes = np.sort(np.abs(system.poles - one))
    moved = _SPREAD * EPS ** (1.0 / max(count, 1)) * float(np.linalg.norm(scaled.A - one * np.eye(n), 2))
    if not count or sizes[count - 1] > max(_RIGID * sizes[-1], moved):
        none = Lti(T[:0, :0], system.B[:0], system.C[:, :0], np.zeros_like(system.D), dt=system.dt)
        return SpectralParts(system, none, 0.0)
    return SpectralParts.of(scaled, T + one * np.eye(n), Z, count)
