"""Verified H2 norms by Gramians.

The square of the norm is ``trace(C P C')`` with the controllability Gramian ``P``, and ``trace(B' Q B)`` with the
observability Gramian ``Q``: the two agree to within rounding error.
"""

import warnings
from dataclasses import replace
from math import inf, nan, sqrt
from typing import TYPE_CHECKING

import numpy as np

from boomctl.analysis.norm import NOT_PROVED, PROVED, UNSTABLE, NormBounds, at_boundary
from boomctl.analysis.sum_over_modes import bounds
from boomctl.lti.gramians import gramian, refined_gramian
from boomctl.lti.modal import sides
from boomctl.lti.rounding import CERTIFIED, EPS, EXACT_STATES
from boomctl.lti.system import Lti, of
from boomctl.structure.model import SecondOrderModel
from boomctl.threads import one_blas_thread

if TYPE_CHECKING:
    import control

BY_GRAMIANS = "Gramians of controllability and observability agree"
NOT_AGREED = "Gramians of controllability and observability do not agree"
_AGREED = 0.1 * CERTIFIED  # Largest relative difference of the norms by the two Gramians for a verified norm.
_CLEAR = 1e-8  # Largest rounding error of A, relative to the slowest decay rate, for double precision.
_MARGIN = 0.2 * CERTIFIED  # Relative distance of both bounds from the norm.


@one_blas_thread
def h2_norm(system: "SecondOrderModel | control.StateSpace | control.TransferFunction") -> NormBounds:
    """Return the certified H2 norm: the RMS of the outputs to white noise of unit intensity at every input.

    In discrete time it is white noise of unit variance at every sample.  The square of the norm is then the sum of the
    squares of all pulse responses, the feedthrough included.

    Parameters
    ----------
    system : SecondOrderModel, control.StateSpace or control.TransferFunction
        System, from all inputs to all outputs; a boom model without selected signals from platform actuators to tips, as in
        :func:`boomctl.sigma`.

    Returns
    -------
    NormBounds
        The norm and its bounds.

    Raises
    ------
    TypeError, ValueError
        If `system` has an unsupported type, an unspecified sampling time or an entry that is not finite, or if an output of a
        structure needs a derivative of an input.

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
    plain = of(system, sampled=True)
    return replace(matrices_h2_norm(plain), _given=plain)


def matrices_h2_norm(original: Lti) -> NormBounds:
    """Return the H2 norm of ``A, B, C, D``."""
    system, through = original.balanced(), float(np.linalg.norm(original.D))
    moves = len(original.A) > 0 and min(original.D.shape) > 0
    infinite, hidden = at_boundary(system, bounds(system)) if moves else (None, False)
    if infinite is not None and infinite.verified:
        slowest = system.rates[int(np.argmax(system.rates.real))]
        pole = slowest if infinite.method == UNSTABLE else 1j * infinite.peak_omega
        result = replace(infinite, peak_omega=nan, kind="h2", method=f"{infinite.method} at {pole:.4g} rad/s")
    elif infinite is not None:
        decays = (sides(system.poles, system.dt) < 0).all()
        result = _between(0.0, _by_gramians(system).value if decays else inf, inf, infinite.method)
    elif through and original.dt == 0.0:
        o, i = np.unravel_index(int(np.argmax(np.abs(original.D))), original.D.shape)
        method = f"a feedthrough to {original.output_labels[int(o)]!r} from {original.input_labels[int(i)]!r}"
        result = _between(inf, inf, inf, method, verified=True, proved=True)
    elif not moves:
        result = _between(through, through, through, "no states", verified=True, proved=True)
    else:
        result = _between(0.0, 0.0, inf, NOT_PROVED) if hidden else _by_gramians(system)
        result = result if result.verified else _by_exact_arithmetic(system, result)
    return replace(result, _given=original)


def _between(
    lower: float, value: float, upper: float, method: str, verified: bool = False, proved: bool = False
) -> NormBounds:
    return NormBounds(lower, upper, nan, method, kind="h2", verified=verified, _proved=proved, _value=value)


def _by_gramians(system: Lti) -> NormBounds:
    """Return the norm of a stable system, verified if both Gramians agree; in extended precision if necessary."""
    steps, through = system.dt != 0.0, float(np.sum(system.D**2))
    value = other = nan
    slowest = float((1.0 - np.abs(system.poles) if steps else -system.poles.real).min())
    clear = len(system.A) * EPS * float(np.linalg.norm(system.A)) <= _CLEAR * slowest
    for solve in (gramian, refined_gramian) if clear else (refined_gramian,):
        try:
            with warnings.catch_warnings():  # SciPy warns of poles that are nearly mirror images
                warnings.simplefilter("ignore", RuntimeWarning)
                P, Q = solve(system.A, system.B, steps), solve(system.A.T, system.C.T, steps)
        except (np.linalg.LinAlgError, ValueError):
            continue
        squares = float(np.sum((system.C @ P) * system.C)), float(np.sum((system.B.T @ Q) * system.B.T))
        value, other = (sqrt(square + through) if square >= 0.0 else nan for square in squares)
        if abs(value - other) <= _AGREED * value < inf:
            margin = _MARGIN * value
            return _between(value - margin, value, value + margin, BY_GRAMIANS, verified=True)
    return _between(0.0, value if value < inf else inf, inf, NOT_AGREED)  # NaN: from a pole that is not stable.


def _by_exact_arithmetic(system: Lti, known: NormBounds) -> NormBounds:
    """Return the norm of the stored system, whose unstable poles do not contribute, in exact arithmetic; else ``known``."""
    from boomctl.exact_roots import OPERATIONS, UndecidedError
    from boomctl.lti.proof import Exact, below

    if len(system.A) > EXACT_STATES:
        return known
    try:
        root = Exact.of(system, OPERATIONS).energy().sqrt()
    except UndecidedError:
        return replace(known, method=NOT_PROVED)
    return _between(max(below(root), 0.0), float(root), -below(-root), PROVED, verified=True, proved=True)
