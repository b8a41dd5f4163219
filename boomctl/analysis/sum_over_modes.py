"""What the sum over a system's modes proves of its response at all frequencies.

With eigenvectors ``V`` the response is ``C V (s - diag(poles) - E)^-1 V^-1 B + D``: a sum over the modes but for what the
error ``E`` of the eigenvectors, and rounding, may add.  :func:`bounds` says how large the sum and that addition are at most;
:func:`stays_below` proves that the sum stays below a level.
"""

from dataclasses import dataclass
from math import inf

import numpy as np
from scipy.linalg import blas, lapack

from boomctl.arrays import squared
from boomctl.lti.frequency import singular_values
from boomctl.lti.modal import ModalSystem
from boomctl.lti.rounding import CANCELLED, EPS, TINY
from boomctl.lti.system import System

_INVERSE = 0.1  # Distance from one of the inverse of the eigenvectors times them, beyond which they bound nothing.
_TWICE = 2.0  # of a bound that is itself computed in floats, from an inverse that is off by _INVERSE at most

# Ends of the first cells, from which others are made where these say nothing (choices, but for what they say):
_SPREAD = 24  # over all frequencies, evenly in the logarithm
_AROUND = np.array([-5.0, 0.0, 5.0])  # around each mode, in half-widths of its resonance
# around the highest resonance likewise.  Its height ``1 - x^2/2`` leaves a cell of half the width ``h`` that is ``x`` away
# room for ``2 h^2``, what the tangent and the rest take, where ``h < x/2``: each is nearly twice as wide as the one before
_BESIDE = np.append(7e-4 * 1.9 ** np.arange(13), [3.5, 13.0, 90.0])
_CLOSE = np.concatenate([-_BESIDE[::-1], _BESIDE])
_PARTS = np.arange(4) / 3.0  # ends of the parts of a cell that says nothing (a choice)
_EVALUATED = 16  # roundings of a term of the sum, besides one for each term that is added
_CELLS, _CELLS_OF_MODE = 400, 10  # tried at most, and for each mode: more cost as much as another proof (measured)
# entries of the response for each mode, of which more take longer than another proof (measured: four half as long to a fifth
# longer, ten a third longer, twenty twice as long, fifty three times)
_ENTRIES = 6


@dataclass(frozen=True)
class Bounded:
    """What the eigenvectors of a system bound, rounding of its entries included.

    Attributes
    ----------
    norm : float
        No singular value is larger at any frequency; ``inf`` where the eigenvectors do not show that all poles decay.
    doubt : float
        No singular value changes by more where entries are off in their last places, nor is the sum over the modes off by
        more; ``inf`` likewise.
    unstable : bool
        Whether some poles are unstable, for certain.
    """

    norm: float = inf
    doubt: float = inf
    unstable: bool = False


def bounds(given: System) -> Bounded:
    """Bound the response of a balanced system, and what rounding may change of it; of a loop, as its parts are stored.

    In the coordinates of the eigenvectors the matrix is diagonal but for an error, ``|E| <= F``.  Where ``diag(decay) - F``
    is an M-matrix, the system is stable, and the inverse of that matrix is larger than the resolvent at every frequency,
    entry by entry.  Poles are unstable for certain where the discs around them, as large as the rows of ``F``, lie beyond
    the boundary and touch no others (Gershgorin).  Of a pair of modes all sizes are those of the first, for which both
    count.
    """
    system, made = given.system, given.magnitudes
    poles, inverse, right = system.eigensystem
    decay = -poles.real if system.dt == 0.0 else 1.0 - np.abs(poles)
    one = (poles.imag >= 0.0).nonzero()[0]
    twice, lost = 1.0 + (poles.imag[one] > 0.0), len(poles) * EPS + CANCELLED
    count, acting = len(one), len(one) + system.B.shape[1]
    inverse, moving = inverse[one], right[:, one]
    reads, size = np.abs(inverse), np.abs(moving)
    if not lost * reads.max() < 1.0:  # they lose all digits, or are no numbers
        return Bounded()
    missed = np.abs(inverse @ right - np.eye(len(poles))[one])
    off = np.add.reduceat(missed, one, axis=1) + lost * twice * (reads @ size)  # both columns of a pair
    apart = off.sum(axis=1)
    if not apart.max() <= _INVERSE:
        return Bounded()
    residual = np.abs(system.A @ moving - moving * poles[one]) + lost * (made.A @ size + size * np.abs(poles[one]))
    acts = np.abs(inverse @ system.B)
    blur = lost * (reads @ made.B) + off @ acts
    three = np.concatenate([reads @ residual, acts + blur, blur], axis=1)
    three += _TWICE * apart[:, None] * three.max(axis=0)  # of the exact inverse: this one is off by as much
    F, blur = _TWICE * twice * three[:, :count], three[:, acting:]
    poles, decay = poles[one], decay[one]
    if not (decay > 0.0).all():
        radius = F.sum(axis=1)
        grows = decay < -radius
        gaps = np.abs(poles[grows, None] - poles[~grows]) - radius[grows, None] - radius[~grows]
        return Bounded(unstable=bool(grows.any() and (gaps > 0.0).all()))
    sought = np.concatenate([np.ones((count, 1)), three[:, count:acting]], axis=1)
    factors, order, states, singular = lapack.dgesv(np.diag(decay) - F, sought)
    if singular or not (states[:, 0] > 0.0).all():
        return Bounded()
    states, blurred = states[:, 1:], twice * lost * (made.C @ size)
    reading = twice * np.abs(system.C @ moving) + blurred
    largest = reading @ states + made.D
    change = reading @ lapack.dgetrs(factors, order, F @ states + blur)[0] + blurred @ states + lost * made.D
    if not largest.size:
        return Bounded(0.0, 0.0)
    room = 1.0 + _INVERSE  # for what floats lose on the way
    return Bounded(float(room * blas.dnrm2(largest.ravel())), float(room * blas.dnrm2(change.ravel())))


@np.errstate(divide="ignore", over="ignore", invalid="ignore")  # of squares that are no numbers
def stays_below(modes: ModalSystem, level: float, at: float) -> bool:
    """Return whether the sum over modes that decay stays below a level at all frequencies; False where that takes too long.

    The axis is cut into cells; ``at`` lies near the highest resonance.  In a cell
    around ``m`` the sum is ``S(m) + x S'(m)``, whose norm is largest at one of the ends ``x = -h, h``, but for
    ``h^2 sum_k |R_k|/d_k^3``, with ``d_k`` the distance of the pole ``k`` from the cell and ``R_k`` its residue.
    """
    if modes.D.size > _ENTRIES * len(modes.poles):
        return False
    poles, terms, D = modes.poles[:, None], modes.terms / level, modes.D.reshape(-1, 1) / level
    decay, swing, rates = -modes.poles.real, modes.poles.imag, np.abs(modes.poles)
    largest = np.maximum(np.abs(terms).max(axis=1, initial=0.0), TINY)  # its square may be no number
    size = largest * np.sqrt(squared(terms / largest[:, None]).sum(axis=1))
    lost = (len(decay) + _EVALUATED) * EPS * float((size / decay).sum())  # of the sum, by rounding
    slowest, fastest = 0.1 * rates.min(), 10.0 * rates.max()
    if not (size / (fastest - rates)).sum() + blas.dnrm2(D.ravel()) <= 1.0:  # above the fastest
        return False
    upper = swing >= 0.0
    spread = slowest * (fastest / slowest) ** (np.arange(_SPREAD) / (_SPREAD - 1.0))
    around = swing[upper, None] + decay[upper, None] * _AROUND
    close = at + decay[np.abs(modes.poles - 1j * at).argmin()] * _CLOSE
    ends = np.concatenate([spread, around.ravel(), close])
    ends = np.concatenate([[0.0], np.sort(ends[(ends > 0.0) & (ends < fastest)]), [fastest]])
    low, high, left = ends[:-1], ends[1:], _CELLS + _CELLS_OF_MODE * len(poles)
    while (left := left - len(low)) >= 0:
        m = 0.5 * (low + high)
        h = np.maximum(high - m, m - low)
        shares = modes.shares(m)
        S, slope = terms.T @ shares + D, h * (terms.T @ (shares * shares))
        beside = np.maximum(np.abs(m - poles.imag) - h, 0.0)
        square = decay[:, None] ** 2 + beside * beside
        rest = lost + h * h * (size @ (1.0 / (square * np.sqrt(square))))
        turned = np.abs((S.conj() * slope).sum(axis=0).imag)  # adds to the squares at one end, takes off at the other
        sides = np.sqrt(squared(S).sum(axis=0) + squared(slope).sum(axis=0) + 2.0 * turned)
        most = sides + rest
        if not np.isfinite(most).all():
            return False
        open_ = (most > 1.0).nonzero()[0]
        # the root of the sum of all squares is more than the largest value: where it says nothing that is looked at
        over = open_[sides[open_] > 1.0] if min(modes.D.shape) > 1 else open_[:0]
        if len(over):
            both = np.array([S[:, over] - 1j * slope[:, over], S[:, over] + 1j * slope[:, over]])
            ended = both.transpose(1, 0, 2).reshape(*modes.D.shape, -1)
            most[over] = singular_values(ended)[0].reshape(2, -1).max(axis=0) + rest[over]
            open_ = open_[most[open_] > 1.0]
        if not len(open_):
            return True
        there = singular_values(S[:, open_].reshape(*modes.D.shape, -1))[0]
        if there.max() >= 1.0:
            return False
        ends = low[open_, None] + 2.0 * h[open_, None] * _PARTS
        ends[:, -1] = high[open_]
        low, high = ends[:, :-1].ravel(), ends[:, 1:].ravel()
    return False
