"""Proved bounds of a system's response at all frequencies by the sum over its modes.

With eigenvectors ``V`` the response is ``C V (s - diag(poles) - E)^-1 V^-1 B + D``: a sum over the modes, except for the
contributions of the error ``E`` of the eigenvectors and of rounding error.  :func:`bounds` returns upper bounds of the sum
and of these contributions; :func:`stays_below` proves that the sum stays below a level.
"""

from dataclasses import dataclass
from math import inf

import numpy as np
from scipy.linalg import blas, lapack

from boomctl.arrays import Array, squared
from boomctl.lti.frequency import singular_values
from boomctl.lti.modal import ModalSystem
from boomctl.lti.rounding import CANCELLED, EPS, UNDERFLOW
from boomctl.lti.system import System

_INVERSE = 0.1  # Largest distance from the identity of the eigenvectors times their inverse; no bound beyond it.
_TWICE = 2.0  # Factor on a bound computed in floating point with an inverse whose error is at most _INVERSE.

# Ends of the first cells, which are subdivided if they are inconclusive:
_SPREAD = 24  # Number over all frequencies, equally spaced in the logarithm.
_AROUND = np.array([-5.0, 0.0, 5.0])  # Around each mode, in half-widths of its resonance.
# Around the highest resonance, in half-widths.  Its height ``1 - x^2/2`` at a distance ``x`` exceeds the ``2 h^2`` of the
# tangent and the remainder in a cell of half-width ``h < x/2``: each cell is nearly twice as wide as the previous one.
_OFFSETS = np.append(7e-4 * 1.9 ** np.arange(13), [3.5, 13.0, 90.0])
_CLOSE = np.concatenate([-_OFFSETS[::-1], _OFFSETS])
_PARTS = np.arange(4) / 3.0  # Ends of the parts of an inconclusive cell.
_EVALUATED = 16  # Rounding errors of a term of the sum, in addition to one for each summand.
_CELLS, _CELLS_OF_MODE = 400, 10  # Largest number of cells, and per mode: with more, another proof is as fast.
_FEW = 40  # With more cells that are too wide, and more than half of all, the sum is near the level in a wide band.
# Largest number of entries of the response per mode: with more, another proof is faster.
_ENTRIES = 6


@dataclass(frozen=True)
class Bounded:
    """Bounds of a response by the eigenvectors of the system, rounding error of its entries included.

    Attributes
    ----------
    norm : float
        Upper bound of the singular values at all frequencies; ``inf`` if stability is not shown by the eigenvectors.
    error : float
        Upper bound of the change of a singular value if every entry is perturbed by one ulp, and of the error of the sum
        over the modes; ``inf`` if stability is not shown by the eigenvectors.
    unstable : bool
        True if some poles are proved to be unstable.
    """

    norm: float = inf
    error: float = inf
    unstable: bool = False


def bounds(original: System) -> Bounded:
    """Bound the response of a balanced system and its rounding error; for a loop, with its parts as stored.

    In the coordinates of the eigenvectors the matrix is diagonal except for an error, ``|E| <= F``.  If ``diag(decay) - F``
    is an M-matrix, the system is stable, and the inverse of this matrix bounds the resolvent at every frequency, entry by
    entry.  Poles are proved unstable if the disks around them, with the row sums of ``F`` as radii, are beyond the boundary
    and touch no others (Gershgorin).  A pair of modes is represented by the first one, counted twice.
    """
    system, sizes = original.system, original.magnitudes
    poles, inverse, right = system.eigensystem
    decay = -poles.real if system.dt == 0.0 else 1.0 - np.abs(poles)
    one = (poles.imag >= 0.0).nonzero()[0]
    twice, lost = 1.0 + (poles.imag[one] > 0.0), len(poles) * EPS + CANCELLED
    count, acting = len(one), len(one) + system.B.shape[1]
    inverse, moving = inverse[one], right[:, one]
    reads, size = np.abs(inverse), np.abs(moving)
    if not lost * reads.max() < 1.0:  # no significant digits, or not finite
        return Bounded()
    defect = inverse @ right
    defect[np.arange(count), one] -= 1.0
    off = np.add.reduceat(np.abs(defect), one, axis=1) + lost * twice * (reads @ size)  # both columns of a pair
    distance = off.sum(axis=1)
    if not distance.max() <= _INVERSE:
        return Bounded()
    poles = poles[one]
    residual = np.abs(system.A @ moving - moving * poles) + lost * (sizes.A @ size + size * np.abs(poles))
    acts = np.abs(inverse @ system.B)
    blur = lost * (reads @ sizes.B) + off @ acts
    three = np.concatenate([reads @ residual, acts + blur, blur], axis=1)
    three += _TWICE * distance[:, None] * three.max(axis=0)  # error of the inverse
    F, blur = _TWICE * twice * three[:, :count], three[:, acting:]
    decay = decay[one]
    if not (decay > 0.0).all():
        radius = F.sum(axis=1)
        grows = decay < -radius
        gaps = np.abs(poles[grows, None] - poles[~grows]) - radius[grows, None] - radius[~grows]
        return Bounded(unstable=bool(grows.any() and (gaps > 0.0).all()))
    sought = np.concatenate([np.ones((count, 1)), three[:, count:acting]], axis=1)
    factors, order, states, singular = lapack.dgesv(np.diag(decay) - F, sought)
    if singular or not (states[:, 0] > 0.0).all():
        return Bounded()
    states, blurred = states[:, 1:], twice * lost * (sizes.C @ size)
    reading = twice * np.abs(system.C @ moving) + blurred
    largest = reading @ states + sizes.D
    change = reading @ lapack.dgetrs(factors, order, F @ states + blur)[0] + blurred @ states + lost * sizes.D
    if not largest.size:
        return Bounded(0.0, 0.0)
    factor = 1.0 + _INVERSE  # covers rounding error of this computation
    return Bounded(float(factor * blas.dnrm2(largest.ravel())), float(factor * blas.dnrm2(change.ravel())))


@np.errstate(divide="ignore", over="ignore", invalid="ignore")  # squares may overflow
def stays_below(modes: ModalSystem, level: float, at: float, sizes: Array | None = None) -> bool:
    """Return whether the sum over stable modes stays below a level at all frequencies; False if it takes too long.

    The axis is cut into cells; ``at`` is near the highest resonance.  In a cell around ``m`` the sum is ``S(m) + x S'(m)``,
    whose norm is largest at one of the ends ``x = -h, h``, with an error of at most ``h^2 sum_k |R_k|/d_k^3``, where ``d_k``
    is the distance of the pole ``k`` from the cell and ``R_k`` its residue; ``sizes`` are less than ``|R_k|`` for modes that
    nearly cancel.
    """
    if modes.D.size > _ENTRIES * len(modes.poles):
        return False
    poles, terms, D = modes.poles[:, None], modes.terms / level, modes.D.reshape(-1, 1) / level
    decay, omega, rates = -modes.poles.real, modes.poles.imag, np.abs(modes.poles)
    size = np.sqrt(squared(terms).sum(axis=1)) + UNDERFLOW
    lost = (len(decay) + _EVALUATED) * EPS * float((size / decay).sum())  # rounding error of the sum
    slowest, fastest = 0.1 * rates.min(), 10.0 * rates.max()
    if not (size / (fastest - rates)).sum() + blas.dnrm2(D.ravel()) <= 1.0:  # above the fastest
        return False
    bends = size if sizes is None else sizes / level
    upper = omega >= 0.0
    spread = slowest * (fastest / slowest) ** (np.arange(_SPREAD) / (_SPREAD - 1.0))
    around = omega[upper, None] + decay[upper, None] * _AROUND
    close = at + decay[np.abs(modes.poles - 1j * at).argmin()] * _CLOSE
    ends = np.concatenate([spread, around.ravel(), close])
    ends = np.concatenate([[0.0], np.sort(ends[(ends > 0.0) & (ends < fastest)]), [fastest]])
    low, high, left = ends[:-1], ends[1:], _CELLS + _CELLS_OF_MODE * len(poles)
    while (left := left - len(low)) >= 0:
        m = 0.5 * (low + high)
        h = np.maximum(high - m, m - low)
        fractions = 1.0 / (1j * m - poles)
        S, slope = terms.T @ fractions + D, h * (terms.T @ (fractions * fractions))
        distance = np.maximum(np.abs(m - poles.imag) - h, 0.0)
        square = decay[:, None] ** 2 + distance * distance
        rest = lost + h * h * (bends @ (1.0 / (square * np.sqrt(square))))
        turned = np.abs((S.conj() * slope).sum(axis=0).imag)  # added to the squares at one end, subtracted at the other
        sides = np.sqrt(squared(S).sum(axis=0) + squared(slope).sum(axis=0) + 2.0 * turned)
        most = sides + rest
        if not np.isfinite(most).all():
            return False
        open_ = (most > 1.0).nonzero()[0]
        if not len(open_):
            return True
        there = singular_values(S[:, open_].reshape(*modes.D.shape, -1))[0]
        wide = there + rest[open_] > 1.0
        if there.max() >= 1.0 or wide.sum() > max(_FEW, 0.5 * len(low)):
            return False
        # The Frobenius norm bounds the largest singular value, which is computed only if this bound is inconclusive.
        over = open_[~wide] if min(modes.D.shape) > 1 else open_[:0]
        if len(over):
            both = np.array([S[:, over] - 1j * slope[:, over], S[:, over] + 1j * slope[:, over]])
            ended = both.transpose(1, 0, 2).reshape(*modes.D.shape, -1)
            most[over] = singular_values(ended)[0].reshape(2, -1).max(axis=0) + rest[over]
            open_ = open_[most[open_] > 1.0]
            if not len(open_):
                return True
        ends = low[open_, None] + 2.0 * h[open_, None] * _PARTS
        ends[:, -1] = high[open_]
        low, high = ends[:, :-1].ravel(), ends[:, 1:].ravel()
    return False
