"""Optimal Hankel-norm approximation.

Source: Glover (1984), Int. J. Control 39, Theorems 6.3 and 9.7.  The error's Hankel norm is the first Hankel singular
value that goes, the smallest that any system of that order has.
"""

import numpy as np

from boomctl.arrays import Array
from boomctl.lti.modal import spectral_parts
from boomctl.lti.system import Lti
from boomctl.reduction.balanced import Balanced

_EQUAL = 1e-7


def hankel_optimal(balanced: Balanced, order: int) -> tuple[Lti, float]:
    """Return the stable system of the given order that is nearest in the Hankel norm, and a bound of the error.

    The bound is ``sigma_{r+1} + 2 sum of the distinct later ones``: an all-pass error, and an antistable part left out.

    Raises
    ------
    ValueError
        The Hankel singular value is repeated across the cut, so that there is no best system of this order.
    """
    values = balanced.values
    n, r = len(values), order
    if r >= n:
        return balanced.system, balanced.lost
    if r > 0 and values[r - 1] <= values[r] * (1.0 + _EQUAL):
        raise ValueError(
            f"order {r}: Hankel singular values {r} and {r + 1} are equal ({values[r]:.6g}); take {r - 1} or {r + 1}"
        )
    sigma = float(values[r])
    k = int((values[r:] >= sigma * (1.0 - _EQUAL)).sum())
    dilated = _dilated(balanced, r, k, sigma)
    stable, antistable = spectral_parts(dilated)
    if len(stable.A) != r or len(antistable.A) != n - r - k:
        raise ValueError(
            f"order {r}: the all-pass dilation has {len(stable.A)} stable poles; Hankel singular values "
            f"{values[r]:.3g} and its neighbours are too close to tell apart"
        )
    bound = sigma + 2.0 * float(values[r + k :].sum()) + balanced.lost
    return stable, bound


def _dilated(balanced: Balanced, r: int, k: int, sigma: float) -> Lti:
    """Return the all-pass dilation: the given system minus it is ``sigma`` at every frequency."""
    cut = np.arange(r, r + k)
    keep = np.setdiff1d(np.arange(len(balanced.values)), cut)
    p, m = balanced.system.D.shape
    q = max(p, m)
    A = balanced.system.A[np.ix_(keep, keep)]
    B, C, D = np.zeros((len(balanced.values), q)), np.zeros((q, len(balanced.values))), np.zeros((q, q))
    B[:, :m], C[:p], D[:p, :m] = balanced.system.B, balanced.system.C, balanced.system.D
    U = _orthogonal(B[cut], C[:, cut], -_glimpse(balanced.system.A, B, C))
    S = balanced.values[keep]
    B1, C1 = B[keep], C[:, keep]
    gamma = (S**2 - sigma**2)[:, None]
    A_new = (sigma**2 * A.T + S[:, None] * A * S[None, :] - sigma * C1.T @ U @ B1.T) / gamma
    B_new = (S[:, None] * B1 + sigma * C1.T @ U) / gamma
    C_new = C1 * S[None, :] + sigma * U @ B1.T
    return Lti(A_new, B_new[:, :m], C_new[:p], (D - sigma * U)[:p, :m])


def _glimpse(A: Array, B: Array, C: Array) -> Array:
    """Return ``C (s - A)^-1 B`` at the real ``s`` amid the poles; unlike ``C B`` it is there for displacements, too."""
    s = float(np.exp(np.linalg.slogdet(A)[1] / len(A)))
    return C @ np.linalg.solve(s * np.eye(len(A)) - A, B)


def _orthogonal(B: Array, C: Array, near: Array) -> Array:
    """Return an orthogonal ``U`` with ``B = -C^T U``; it exists because ``B B^T = C^T C``.

    Where that leaves it free, ``U`` is turned towards ``near``, so that it does not hang on the order of the signals.
    """
    left, size, right = np.linalg.svd(-C @ B)
    rank = int((size > _EQUAL * size[0]).sum())
    rest_left, rest_right = left[:, rank:], right[rank:]
    turn, _, back = np.linalg.svd(rest_left.T @ near @ rest_right.T)
    return left[:, :rank] @ right[:rank] + rest_left @ (turn @ back) @ rest_right
