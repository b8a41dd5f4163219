"""How H2 norms are found between two bounds.

In modal coordinates that answer for their rounding (:mod:`boomctl.lti.verified_modal_form`) its square is a sum over pairs of
modes, ``|G|^2 = -sum_ij (c_i^* c_j)(b_j b_i^*)/(p_j + p_i^*)``; in discrete time with ``1/(1 - p_i p_j^*)``.  Where that has
too few digits, the norm is enclosed in ball arithmetic (:mod:`boomctl.lti.proof`).
"""

from dataclasses import replace
from math import inf, nan, sqrt
from typing import TYPE_CHECKING

import numpy as np

from boomctl.analysis.marginal_poles import marginal_poles
from boomctl.analysis.norm import NOT_PROVED, ON_CIRCLE, PROVED, UNDAMPED, UNSTABLE, NormBounds, doubtful
from boomctl.arrays import Array
from boomctl.lti.gramians import refined_gramian
from boomctl.lti.modal import split
from boomctl.lti.rounding import EPS, TERMS, TINY
from boomctl.lti.system import Lti, of
from boomctl.lti.verified_modal_form import VerifiedModalForm, verified_modal_form
from boomctl.structure.model import SecondOrderModel
from boomctl.threads import one_blas_thread

if TYPE_CHECKING:
    import control

BY_MODES = "a sum over pairs of modes"
_CANCELLED = 4.0  # roundings of one, in the difference of one and the product of two poles


@one_blas_thread
def h2_norm(system: "SecondOrderModel | control.StateSpace | control.TransferFunction") -> NormBounds:
    """Return the certified H2 norm: the RMS of the outputs to white noise of unit intensity at every input.

    In discrete time it is white noise of unit variance at every sample.  The square of the norm is then the sum of the
    squares of all pulse responses, the feedthrough included.

    Parameters
    ----------
    system : SecondOrderModel, control.StateSpace or control.TransferFunction
        The system, from all its inputs to all its outputs; a boom model without selected signals from its platform
        actuators to its tips, as in :func:`boomctl.sigma`.

    Returns
    -------
    NormBounds
        The norm, and bounds of it.

    Raises
    ------
    TypeError, ValueError
        Another kind of system, discrete time that does not say its sampling time, not finite; an output of a structure
        that needs a derivative of an input.

    Examples
    --------
    >>> import boomctl as bc
    >>> import control
    >>> lag = control.ss([[-2.0]], [[2.0]], [[1.0]], 0.0)
    >>> round(bc.h2_norm(lag).value, 6)  # sqrt(2^2/(2 2))
    1.0
    """
    if isinstance(system, SecondOrderModel):
        chosen = system.between()
        return replace(matrices_h2_norm(chosen._modal_form), _given=chosen)
    given = of(system, sampled=True)
    return replace(matrices_h2_norm(given), _given=given)


def matrices_h2_norm(given: Lti) -> NormBounds:
    """Return the certified H2 norm of ``A, B, C, D``."""
    if not len(given.A) or min(given.D.shape) == 0:
        through = float(np.linalg.norm(given.D))
        if through and given.dt == 0.0:
            return _fed_through(given)
        return _between(through, through, through, "no states")
    balanced = given.balanced()
    axis = marginal_poles(balanced)
    if axis.infinite is not None:
        pole = axis.infinite
        what = UNSTABLE if pole.real > 0.0 else UNDAMPED if given.dt == 0.0 else ON_CIRCLE
        return _between(inf, inf, inf, f"{what} at {pole.real:.4g}{pole.imag:+.4g}j rad/s")
    if given.D.any() and given.dt == 0.0:
        return _fed_through(given)
    if axis.doubtful is not None:
        return _doubtful(balanced, axis.open, f"a mode at {abs(axis.doubtful):.6g} rad/s {doubtful(given)}")
    return _proved(balanced) if axis.hidden.any() else _finite(balanced)


def _between(lower: float, value: float, upper: float, method: str) -> NormBounds:
    return NormBounds(lower, upper, nan, method, kind="h2", _value=value)


def _fed_through(given: Lti) -> NormBounds:
    o, i = np.unravel_index(int(np.argmax(np.abs(given.D))), given.D.shape)
    return _between(
        inf, inf, inf, f"a feedthrough to {given.output_labels[int(o)]!r} from {given.input_labels[int(i)]!r}"
    )


def _doubtful(system: Lti, near: Array, why: str) -> NormBounds:
    """Return the value without the modes that may be undamped, where that can be told; the norm may be infinite."""
    try:
        conjugates = np.abs(system.poles[:, None] - system.poles.conj()).argmin(axis=1)
        rest = _finite(split(system, near | near[conjugates], "undamped modes")[1])
    except ValueError:
        return _between(0.0, 0.0, inf, why)
    return _between(0.0, rest.value, inf, why)


def _finite(system: Lti) -> NormBounds:
    """Return the norm of a stable system, in continuous time without a feedthrough."""
    modes = verified_modal_form(system)
    result = None if modes is None else _by_modes(modes, system.dt)
    if result is not None and result.certified:
        return result
    known = _proved(system)
    if known.upper_bound < inf:
        return known
    known = result or known
    return replace(known, _value=float(np.clip(_by_gramian(system), known.lower_bound, known.upper_bound)))


def _proved(system: Lti) -> NormBounds:
    """Return the norm of a system whose poles decay or do not show, as they are stored; no upper bound if undecided."""
    from boomctl.exact_roots import OPERATIONS, UndecidedError
    from boomctl.lti.proof import Exact, below

    try:
        square = Exact.of(system, OPERATIONS).energy()
    except UndecidedError:
        return _between(0.0, 0.0, inf, NOT_PROVED)
    low, high = below(square.sqrt()), -below(-square.sqrt())
    return _between(max(low, 0.0), float(square.sqrt()), high, PROVED)


def _by_gramian(system: Lti) -> float:
    """Return the norm where modes nearly coincide and a proof takes too long: a value without bounds of its own."""
    P = refined_gramian(system.A, system.B, system.dt != 0.0)
    return sqrt(max(float(np.sum((system.C @ P) * system.C) + np.sum(system.D**2)), 0.0))


def _by_modes(modes: VerifiedModalForm, dt: float) -> NormBounds:
    """Return the norm as a sum over pairs of modes."""
    modal, p = modes.modal, modes.modal.poles
    through = float(np.sum(modal.D**2))
    acting: Array = modal.B @ modal.B.conj().T
    reading: Array = modal.C.conj().T @ modal.C
    pairs = -(p[:, None] + p.conj()[None, :]) if dt == 0.0 else 1.0 - p[:, None] * p.conj()[None, :]
    shares, units = 1.0 / pairs, TERMS + len(p)
    if dt != 0.0:  # where 1 and the product of two poles nearly cancel, the difference is off by a few roundings of one
        units = units + _CANCELLED * np.abs(shares)
    square = max(float(np.sum(reading.T * acting * shares).real), 0.0) + through
    sizes = (np.abs(modal.C).T @ np.abs(modal.C)) * (np.abs(modal.B) @ np.abs(modal.B).T) * np.abs(shares)
    rounding = EPS * (float(np.sum(sizes * units)) + TERMS * through)
    if (modal.B.any() and modal.C.any()) or modal.D.any():
        rounding += TINY  # below it squares have fewer digits
    low, value, high = (sqrt(x) for x in (max(square - rounding, 0.0), square, square + rounding))
    return _between(max(low - modes.energy_gap, 0.0), value, high + modes.energy_gap, BY_MODES)
