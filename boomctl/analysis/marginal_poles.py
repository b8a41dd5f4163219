"""Poles at the imaginary axis, in discrete time at the unit circle: do they decay, and do they show in the response?

An eigenvalue solver cannot tell: it moves poles by rounding.  Where its eigenvectors bound that, and all poles still decay,
they do.  Elsewhere it is decided for the numbers as they are stored, exactly (:mod:`boomctl.lti.proof`).  A verdict that one
unit in the last place of an entry would change is none, even if it is true of the stored numbers: a free body whose matrix
holds 1e-20 of noise is a free body.  Poles that lie on the axis exactly are there by structure.
"""

from dataclasses import dataclass, replace
from math import inf

import numpy as np

from boomctl.analysis.sum_over_modes import bounds
from boomctl.arrays import Array
from boomctl.lti.rounding import CANCELLED, TINY
from boomctl.lti.system import Lti, System, rates_of

_SQUARED = 5  # times a matrix is squared: the norm of its power 32 tells its largest eigenvalue to a tenth


@dataclass(frozen=True)
class MarginalPoles:
    """What is known of the poles at the imaginary axis.

    Attributes
    ----------
    infinite : complex or None
        A pole that makes the response infinite: one that grows, or one on the axis that shows.  In discrete time its
        rate ``log(z)/dt``.
    doubtful : complex or None
        One of which the digits given do not tell; None if there is an infinite one.  A rate in discrete time.
    hidden, open : (n,) ndarray of bool
        Which poles lie on the axis and do not show; which ones are doubtful.
    bound, doubt : float
        No singular value is larger at any frequency, and none is off by more where entries are off in their last place, nor
        is the sum over the modes; ``inf`` where eigenvectors do not show it.
    """

    infinite: complex | None
    doubtful: complex | None
    hidden: Array
    open: Array
    bound: float = inf
    doubt: float = inf


def marginal_poles(given: System) -> MarginalPoles:
    """Return what is known of the poles of a (balanced) system at the imaginary axis; of a loop, as its parts are stored."""
    system, made = given.system, given.magnitudes
    hidden, open_ = np.zeros((2, len(system.A)), bool)
    result = MarginalPoles(None, None, hidden, open_)
    if not len(system.A):
        return result
    poles, reads, right = system.eigensystem
    decay = -poles.real if system.dt == 0.0 else 1.0 - np.abs(poles)
    fastest, known = int(np.argmin(decay)), bounds(system, made, decay)
    if known == (inf, 0.0):
        return replace(result, infinite=complex(system.rates[fastest]))
    if known is not None:
        return MarginalPoles(None, None, hidden, open_, *known)
    from boomctl.exact_roots import OPERATIONS, UndecidedError
    from boomctl.lti.proof import Exact

    size, on_axis, shown = made.A, [], []
    try:
        growing, on_axis, shown = Exact.of(given, OPERATIONS).sides
    except (
        UndecidedError
    ):  # what is known is what an eigenvalue solver says, whose errors are those of the matrix's norm
        growing, size = int((decay < 0.0).sum()), np.full_like(size, np.abs(system.A).max())
    reads = np.fmin(np.abs(reads), 1.0 / TINY)  # none of equal poles in a chain
    moved = CANCELLED * np.einsum("ji,ij->j", reads, size @ np.abs(right)) + TINY
    least = int(np.argmin(decay / moved))
    slowest = float(decay.min())
    if growing and (decay[least] < -moved[least] or (slowest < 0.0 and _stays(system, size, poles, 0.5 * slowest))):
        return replace(result, infinite=complex(system.rates[fastest]))
    if shown:
        return replace(result, infinite=complex(0.0, abs(rates_of(np.array(shown), system.dt).imag).min()))
    for pole in on_axis:
        result.hidden[np.argmin(np.where(result.hidden, np.inf, np.abs(poles - pole)))] = True
    open_ = ~result.hidden & (decay <= moved)
    if not growing and (not open_.any() or _stays(system, size, poles[open_], 0.0)):
        return result
    worst = int(np.argmin(np.where(result.hidden, np.inf, decay / moved)))
    open_[worst] = True
    return replace(result, doubtful=complex(system.rates[worst]), hidden=np.zeros_like(open_), open=open_)


def _stays(system: Lti, size: Array, poles: Array, inside: float) -> bool:
    """Return whether no change of entries in their last places moves a pole across a line beside the boundary, at the poles.

    A change ``E`` of ``|E| <= e size`` does not where ``e |s - A|^-1 size`` has no eigenvalue of one.  The line lies so far
    ``inside``, where poles decay.
    """
    beyond = 1j * poles.imag - inside if system.dt == 0.0 else (1.0 - inside) * np.exp(1j * np.angle(poles))
    try:
        resolvents = np.abs(np.linalg.inv(beyond[:, None, None] * np.eye(len(size)) - system.A))
    except np.linalg.LinAlgError:
        return False
    powers, radius = CANCELLED * resolvents @ size, np.ones(len(poles))
    for k in range(_SQUARED):  # the norm of a power tells the largest eigenvalue from above
        norm = np.maximum(np.linalg.norm(powers, np.inf, axis=(1, 2)), TINY)
        radius *= norm ** (0.5**k)
        powers = np.linalg.matrix_power(powers / norm[:, None, None], 2)
    return bool((radius < 1.0).all())
