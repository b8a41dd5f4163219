"""Integrators and rigid bodies told by structure: poles at zero with their Jordan chains, deflated one by one.

An eigenvalue solver moves a chain of ``k`` poles at zero by the ``k``-th root of rounding, and one beside slow poles by
rounding over their distance, so that its poles do not tell.  What tells is whether ``A`` is singular to within the
rounding of its own entries: then a vector that ``A`` takes to zero is split off by a reflection, and the rest is asked again.
"""

from dataclasses import dataclass

import numpy as np
from scipy import linalg

from boomctl.arrays import Array
from boomctl.lti.system import Lti

_EPS = float(np.finfo(float).eps)
_UNITS = 8.0  # of rounding, a state, that the terms of a product may be off: a change of coordinates and its inverse
# share of the largest pole below which a simple pole may be one at zero beside other slow ones (a choice)
_RIGID = 1e-6
_SPREAD = 10.0  # times the root of rounding that poles of a chain may lie apart (a choice)


@dataclass(frozen=True)
class Deflated:
    """A system as a chain of integrators and the rest, which is without poles at zero.

    Attributes
    ----------
    rest : Lti
        With ``D``.
    chain : Lti
        Strictly upper triangular ``A``; without ``D``.
    doubt : float
        How far rounding may have moved the entries of the rest's ``A``, to first order.
    """

    rest: Lti
    chain: Lti
    doubt: float = 0.0


def without_integrators(system: Lti) -> Deflated:
    """Return a system as the sum of its integrators, Jordan chains whole, and all else."""
    n = len(system.A)
    scaled = system.balanced()
    T, Z, size, count, carried = scaled.A.copy(), np.eye(n), np.abs(scaled.A), 0, 0.0
    while count < n:
        U, values, Vt = linalg.svd(T[count:, count:])
        left, null = np.abs(U[:, -1]), Vt[-1]
        doubt = _UNITS * n * _EPS * float(left @ size[count:, count:] @ np.abs(null)) + carried
        if values[-1] > doubt:
            break
        if count + 1 < n and values[-2] > doubt:  # the vector is off by so much, and with it what is left
            carried += float(values[0] * values[-1] / values[-2])
        Q = np.eye(n)
        Q[count:, count:] = linalg.qr(null[:, None])[0]
        T, Z, size = Q.T @ T @ Q, Z @ Q, np.abs(Q).T @ size @ np.abs(Q)
        T[count:, count] = 0.0
        count += 1
    if not count or not _small(np.sort(np.abs(system.poles))[:count], count, float(np.abs(system.poles).max())):
        return Deflated(system, Lti(np.zeros((0, 0)), system.B[:0], system.C[:, :0], np.zeros_like(system.D)))
    N, rest = T[:count, :count], T[count:, count:]
    X = linalg.solve_sylvester(N, -rest, -T[:count, count:]) if count < n else np.zeros((count, 0))
    B, C = Z.T @ scaled.B, scaled.C @ Z
    return Deflated(
        Lti(rest, B[count:], C[:, :count] @ X + C[:, count:], system.D),
        Lti(N, B[:count] - X @ B[count:], C[:, :count], np.zeros_like(system.D)),
        doubt_of_split(scaled.A, X),
    )


def doubt_of_split(A: Array, X: Array) -> float:
    """Return how far rounding may have moved the entries of a part that was split off: ``X`` decouples it."""
    return _UNITS * _EPS * float(np.linalg.norm(A)) * (1.0 + (float(np.linalg.norm(X, 2)) if X.size else 0.0))


def _small(poles: Array, count: int, largest: float) -> bool:
    """Return whether computed poles are so small that they can be a chain of that many at zero."""
    return bool(poles.max() <= max(_RIGID, _SPREAD * _EPS ** (1.0 / count)) * largest) or largest == 0.0
