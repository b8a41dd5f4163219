"""Integrators and rigid bodies told by structure: poles at zero (``z = 1``) with their Jordan chains, deflated one by one.

An eigenvalue solver moves a chain of ``k`` poles at zero by the ``k``-th root of rounding, and one beside slow poles by
rounding over their distance, so that its poles do not tell.  What tells is whether ``A`` is singular to within the
rounding of its own entries: then a vector that ``A`` takes to zero is split off by a reflection, and the rest is asked again.
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
class Deflated:
    """A system as a chain of integrators and the rest, which is without poles at zero, in discrete time at one.

    Attributes
    ----------
    rest : Lti
        With ``D``.
    chain : Lti
        Upper triangular ``A`` with zeros, in discrete time ones, on its diagonal; without ``D``.
    doubt : float
        How far rounding may have moved the entries of the rest's ``A``, to first order.
    """

    rest: Lti
    chain: Lti
    doubt: float = 0.0


def without_integrators(system: Lti) -> Deflated:
    """Return a system as the sum of its integrators, Jordan chains whole, and all else."""
    n, one = len(system.A), 0.0 if system.dt == 0.0 else 1.0
    scaled = system.balanced()
    T, Z, size, count, carried = scaled.A - one * np.eye(n), np.eye(n), np.abs(scaled.A), 0, 0.0
    if one:  # what sampling makes of small entries are sums of terms as large as the largest
        size[:] = size.max(initial=0.0)
    none = Lti(np.zeros((0, 0)), system.B[:0], system.C[:, :0], np.zeros_like(system.D), dt=system.dt)
    if not n or _least_stretch(T) > n * CANCELLED * float(np.linalg.norm(size)):
        return Deflated(system, none)
    while count < n:
        block = T[count:, count:]
        U, values, Vt = linalg.svd(block)
        left, null = np.abs(U[:, -1]), Vt[-1]
        doubt = n * CANCELLED * float(left @ size[count:, count:] @ np.abs(null)) + carried
        still, sure = ~block.any(axis=0), int((~block.any(axis=1)).sum())
        if still.any():  # a column of zeros leaves no doubt
            null = np.eye(n - count)[int(np.argmax(still))]
        elif values[-1] > doubt and not sure:  # nor do rows of zeros, of as many vectors
            break
        elif count + max(sure, 1) < n and (next_value := values[-1 - max(sure, 1)]) > doubt:
            carried += float(values[0] * values[-1] / next_value)  # the vector is off by so much, and what is left
        Q = np.eye(n)
        Q[count:, count:] = linalg.qr(null[:, None])[0]
        T, Z, size = Q.T @ T @ Q, Z @ Q, np.abs(Q).T @ size @ np.abs(Q)
        T[count:, count] = 0.0
        count += 1
    if not count:
        return Deflated(system, none)
    sizes = np.sort(np.abs(system.poles - one))
    moved = _SPREAD * EPS ** (1.0 / count) * float(np.linalg.norm(scaled.A - one * np.eye(n), 2))
    if sizes[count - 1] > max(_RIGID * sizes[-1], moved):
        return Deflated(system, none)
    N, rest = T[:count, :count], T[count:, count:]
    X = linalg.solve_sylvester(N, -rest, -T[:count, count:]) if count < n else np.zeros((count, 0))
    B, C = Z.T @ scaled.B, scaled.C @ Z
    return Deflated(
        Lti(rest + one * np.eye(n - count), B[count:], C[:, :count] @ X + C[:, count:], system.D, dt=system.dt),
        Lti(N + one * np.eye(count), B[:count] - X @ B[count:], C[:, :count], np.zeros_like(system.D), dt=system.dt),
        doubt_of_split(scaled.A, X),
    )


def _least_stretch(A: Array) -> float:
    """Return what the smallest singular value of a matrix is at least: that of a singular one is zero."""
    try:
        return 1.0 / float(np.linalg.norm(np.linalg.inv(A)))
    except np.linalg.LinAlgError:
        return 0.0


def doubt_of_split(A: Array, X: Array) -> float:
    """Return how far rounding may have moved the entries of a part that was split off: ``X`` decouples it."""
    return CANCELLED * float(np.linalg.norm(A)) * (1.0 + (float(np.linalg.norm(X, 2)) if X.size else 0.0))
