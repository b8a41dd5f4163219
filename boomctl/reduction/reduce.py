"""``reduce``: a smaller system by one of five methods, its error verified before it is returned."""

from contextlib import suppress
from dataclasses import replace
from math import inf
from typing import TYPE_CHECKING

import numpy as np

from boomctl.analysis.norm import NO_RESPONSE, NormBounds
from boomctl.checks import known, positive, span, up_to, warn_user, whole
from boomctl.exceptions import LowerOrderWarning, ReductionError
from boomctl.lti.bilinear import image_of_omega, omega_of_image
from boomctl.lti.system import Lti, of
from boomctl.progress import Listener, computing, tell
from boomctl.reduction.reducers import (
    MINIMAL,
    BalancedTruncation,
    HankelApproximation,
    ModalTruncation,
    SingularPerturbation,
    StateReducer,
    StrongestModes,
)
from boomctl.reduction.result import ReductionResult
from boomctl.reduction.verify import Band, SystemParts, Verified
from boomctl.structure.model import SecondOrderModel
from boomctl.threads import one_blas_thread

if TYPE_CHECKING:
    import control

METHODS = {
    "balanced": BalancedTruncation,
    "singular-perturbation": SingularPerturbation,
    "hankel": HankelApproximation,
    "modal": ModalTruncation,
    "second-order": StrongestModes,
}
_WITHOUT_RANGE = ("hankel", "modal")  # Methods that accept no frequency range.
AS_GIVEN = "the system itself"  # Of all its states: no system differs less.
_NO_ERROR = NormBounds(0.0, 0.0, 0.0, NO_RESPONSE, verified=True)
_NYQUIST = 1e-6  # Distance, relative, at which a band ends below half the sampling rate, whose image is at infinity.


@one_blas_thread
def reduce(
    system: "control.StateSpace | control.TransferFunction | SecondOrderModel",
    order: int | None = None,
    method: str = "balanced",
    *,
    max_error: float | None = None,
    omega_range: tuple[float, float] | None = None,
    progress: "Listener | None" = None,
) -> ReductionResult:
    """Return a smaller system, with a bound of its error known beforehand and the error verified afterwards.

    Unstable, undamped, integrating and rigid-body states are split off and kept as they are, but for rounding.

    Parameters
    ----------
    system : control.StateSpace, control.TransferFunction or SecondOrderModel
        The stable part of a discrete one is reduced as its continuous image by the bilinear map, which has the same norms and
        Hankel singular values.
    order : int, optional
        Number of states wanted, the kept ones included.  Fewer come back, with a warning, where fewer suffice for
        rounding, or where "modal" would have to split a pair of poles.
    method : "balanced", "singular-perturbation", "hankel", "modal" or "second-order"
        Balanced truncation (exact at infinite frequency), singular perturbation (exact at zero frequency), optimal
        Hankel norm approximation (the Hankel norm of the error is the smallest of that order, its H-infinity norm is
        not), the strongest modes with the static gain of the others; of a structure, likewise
        with undamped modes, which gives a smaller structure (an even order, two states a coordinate, and no bound known
        beforehand: ``inf``).
    max_error : float, optional
        Instead of ``order``: the lowest order whose verified error is not above this (absolute).  Where none is, the system
        itself comes back, with an error of zero.
    omega_range : (float, float), optional
        Frequency range [rad/s] in which the reduced system is accurate, ascending.  The measured error is then the
        largest error in this range; the bound still holds at all frequencies.  If None, all frequencies.  Must be None for
        "hankel" and "modal".
    progress : callable, optional
        Is told a `Progress` at each stage.  Without one, after three seconds a line on a terminal or in a notebook says
        what goes on; `progress_callback` hears whatever runs within it.

    Returns
    -------
    ReductionResult
        The smaller system, and its error: bounded beforehand, and verified.

    Raises
    ------
    TypeError, ValueError
        Another kind of system, discrete time that does not say its sampling time, not finite; unknown method; both or none
        of ``order`` and ``max_error``; an order above the system's or below its kept part, or one that parts equal Hankel
        singular values ("hankel"); an `omega_range` that does not ascend, or that is too far from the poles.
    ReductionError
        The error exceeds its bound or could not be verified.

    Warns
    -----
    LowerOrderWarning
        The system returned has fewer states than asked for.

    Examples
    --------
    >>> import boomctl as bc
    >>> import control
    >>> full = control.ss([[-1.0, 0.0], [0.0, -50.0]], [[1.0], [1.0]], [[1.0, 1.0]], 0.0, inputs="u", outputs="y")
    >>> smaller = bc.reduce(full, order=1)
    >>> smaller.order, round(smaller.error_norm, 3)
    (1, 0.019)
    """
    given = system if isinstance(system, SecondOrderModel) else of(system, sampled=True)
    known("method", method, tuple(METHODS))
    if omega_range is not None and method in _WITHOUT_RANGE:
        raise ValueError(
            f"`omega_range` must be None for method {method!r}, got {omega_range!r}. Use 'balanced' or"
            " 'singular-perturbation'."
        )
    if (order is None) == (max_error is None):
        raise ValueError("order, error: expected exactly one of them")
    if order is not None and whole("order", order, 0) > _states(given):
        raise ValueError(f"order = {order}: the system has only {_states(given)} states")
    wanted = None if max_error is None else positive("max_error", max_error)
    limits = None if omega_range is None else span("omega_range", omega_range)
    if method == "second-order" and isinstance(given, Lti):
        raise TypeError(f"method 'second-order': expected a SecondOrderModel, got {type(system).__name__}")
    with computing("reduction", progress):
        result = _reduced(given, order, wanted, method, limits)
    if order is not None and result.order < order:
        reason = (
            "a pair of poles stays whole"
            if method == "modal"
            else f"all others have Hankel singular values below {MINIMAL:g} of the largest, which is rounding"
        )
        warn_user(f"order = {order}: {result.order} states come back; {reason}", LowerOrderWarning)
    return result


def _reduced(
    given: Lti | SecondOrderModel, order: int | None, wanted: float | None, method: str, band: Band | None
) -> ReductionResult:
    """Return the reduction to an order, or of the lowest order within an error."""
    system, size = given if isinstance(given, Lti) else given._modal_form, _states(given)
    limits = None if band is None else _band_of_image(system, band)
    tell("modal coordinates")
    parts = SystemParts.of(system, limits or (0.0, inf))
    reducer = METHODS[method](given, parts, limits)
    coordinates = "modal coordinates" if parts.modal is not None else "given coordinates"
    itself = given if method == "second-order" else system, (0.0, _NO_ERROR)
    try:
        found = reducer.reduced(order) if order is not None else _within(reducer, wanted)  # type: ignore[arg-type]
    except ReductionError:
        if wanted is None and order != size:
            raise
        found = itself
    smaller, (bound, error) = itself if isinstance(given, Lti) and _states(found[0]) >= size else found
    if isinstance(smaller, Lti):
        scales = getattr(given, "scales", {})  # A structure is in the units of the machine.
        smaller = replace(
            smaller, input_labels=given.input_labels, output_labels=given.output_labels, state_labels=(), scales=scales
        ).without_dots()
    peak_omega = float(omega_of_image(error.peak_omega, system.dt))
    return ReductionResult(
        _full=given,
        _reduced=smaller,
        order=_states(smaller),
        requested_order=order,
        error_bound=bound,
        error_norm=error.upper_bound,
        method=method,
        certificate=replace(error, peak_omega=peak_omega),
        hankel_singular_values=reducer.values,
        retained_order=len(parts.kept.A),
        stages=(coordinates, AS_GIVEN) if error is _NO_ERROR else (coordinates,),
        omega_range=band,
        full_order=size,
    )


def _band_of_image(system: Lti, band: Band) -> Band:
    if band[1] > system.nyquist:
        raise ValueError(
            f"`omega_range` must end at or below half the sampling rate, {up_to(system.nyquist)} rad/s, got {band[1]:g}."
        )
    low, high = image_of_omega(np.minimum(band, system.nyquist * (1.0 - _NYQUIST)), system.dt)
    return float(low), float(high)


def _states(system: Lti | SecondOrderModel) -> int:
    if isinstance(system, Lti):
        return len(system.A)
    filters = 2 * sum(bandwidth is not None for bandwidth in system.ports.bandwidths)
    return 2 * system.ncoordinates + sum(system.ports.integrators) + filters


def _within(reducer: StateReducer | StrongestModes, error: float) -> tuple[Lti | SecondOrderModel, Verified]:
    """Return the reduction of lowest order whose verified error is not above the one wanted.

    Raises
    ------
    ReductionError
        No order has so small a verified error.
    """
    best = inf
    for order in reducer.orders(error):
        tell(f"{order} states")
        with suppress(ValueError, ReductionError):  # A Hankel singular value repeated across the cut, or not verified.
            found = reducer.reduced(order)
            best = min(best, found[1][1].upper_bound)
            if best <= error:
                return found
    raise ReductionError(f"max_error = {error:g}: the smallest verified error of any order is {best:.4g}")
