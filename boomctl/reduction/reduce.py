"""Model reduction by one of five methods, with a verified error.

From call to certificate: :func:`reduce` separates the stable part (``SystemParts.of``, ``spectral_parts``) and balances it
(``balance``); ``StateReducer.reduced`` cuts it by a method, such as ``truncated``; ``verified`` bounds the error, which
``error_norm`` computes (``largest_gain``) and proves to stay below a level (``stays_below``).
"""

from contextlib import suppress
from dataclasses import replace
from functools import partial
from math import inf
from typing import TYPE_CHECKING

import numpy as np

from boomctl.analysis.norm import NO_RESPONSE, NormBounds
from boomctl.checks import known, positive, span, up_to, warn_user, whole
from boomctl.exceptions import LowerOrderWarning, ReductionError
from boomctl.lti.bilinear import image_of_omega, omega_of_image
from boomctl.lti.rounding import DEPENDENT, LEVEL
from boomctl.lti.system import Lti, of
from boomctl.progress import Listener, computing, tell
from boomctl.reduction.reducers import (
    ModalTruncation,
    StateReducer,
    StrongestModes,
    nearest,
    perturbed,
    truncated,
)
from boomctl.reduction.result import ReductionResult
from boomctl.reduction.verify import Band, SystemParts, Verified
from boomctl.structure.model import SecondOrderModel
from boomctl.threads import one_blas_thread

if TYPE_CHECKING:
    import control

METHODS = {
    "balanced": partial(StateReducer, truncated),
    "singular-perturbation": partial(StateReducer, perturbed),
    "hankel": partial(StateReducer, nearest),
    "modal": ModalTruncation,
    "second-order": StrongestModes,
}
_WITHOUT_RANGE = ("hankel", "modal")  # Methods that accept no frequency range.
UNREDUCED = "the system itself"  # Stage of a result that is not reduced: its error is zero.
_NO_ERROR = NormBounds(0.0, 0.0, 0.0, NO_RESPONSE, verified=True)


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
    """Return a reduced system, with an a priori error bound and the verified error.

    Unstable, undamped, integrating and rigid-body states are separated and retained unchanged except for rounding.

    Parameters
    ----------
    system : control.StateSpace, control.TransferFunction or SecondOrderModel
        The stable part of a discrete system is reduced after a bilinear transformation, which preserves
        norms and Hankel singular values.
    order : int, optional
        Number of states, retained states included.  The result has fewer, with a warning, if all further Hankel
        singular values are at rounding level, or "modal" would split a complex pair.
    method : "balanced", "singular-perturbation", "hankel", "modal" or "second-order"
        Method of reduction:

        - "balanced": balanced truncation, exact at infinite frequency;
        - "singular-perturbation": exact at zero frequency;
        - "hankel": smallest Hankel norm (not H-infinity norm) of the error at that order;
        - "modal": dominant modes, with static correction for the others;
        - "second-order": dominant undamped modes of a structure, with static correction for the others; returns a
          structure of even order, without an a priori bound (``inf``).
    max_error : float, optional
        Instead of ``order``: limit on the verified absolute error; the lowest order that meets it is selected.  If there is
        none, the system itself is returned, with an error of zero.
    omega_range : (float, float), optional
        Frequency range [rad/s] in which the reduced system is accurate, ascending.  The verified error is then the
        largest error in this range; the bound still holds at all frequencies.  If None, all frequencies.  Must be None for
        "hankel" and "modal".
    progress : callable, optional
        Called with a `Progress` at each stage.  If None, a progress line is shown after 3 s on a terminal or in a notebook.
        `progress_callback` receives the stages of all computations in its block.

    Returns
    -------
    ReductionResult
        The reduced system, with its a priori error bound and its verified error.

    Raises
    ------
    TypeError, ValueError
        If `system` has another type, an unspecified sampling time or a value that is not finite, if `method` is unknown, if
        not exactly one of `order` and `max_error` is specified, if `order` is above the order of the system, below that of
        its retained part, or separates equal Hankel singular values ("hankel"), or if `omega_range` does not ascend or is
        far outside the range of the poles.
    ReductionError
        If the error exceeds its bound or could not be verified.

    Warns
    -----
    LowerOrderWarning
        If the returned system has fewer states than `order`.

    Examples
    --------
    >>> import boomctl as bc
    >>> import control
    >>> full = control.ss([[-1.0, 0.0], [0.0, -50.0]], [[1.0], [1.0]], [[1.0, 1.0]], 0.0, inputs="u", outputs="y")
    >>> smaller = bc.reduce(full, order=1)
    >>> smaller.order, round(smaller.error_norm, 3)
    (1, 0.019)
    """
    model = system if isinstance(system, SecondOrderModel) else of(system, sampled=True)
    full = model if isinstance(model, Lti) else model._modal_form
    wanted, limits = _checked_request(system, len(full.A), order, method, max_error, omega_range)
    band = None if limits is None else _band_of_image(full, limits)
    with computing("reduction", progress):
        tell("modal coordinates")
        parts = SystemParts.of(full, band or (0.0, inf))
        reducer = METHODS[method](model, parts, band)
        itself = full if isinstance(model, Lti) or method != "second-order" else model, (0.0, _NO_ERROR)
        try:
            reduction = reducer.reduced(order) if order is not None else _within(reducer, wanted)
        except ReductionError:
            if order not in (None, len(full.A)):
                raise
            reduction = itself
        if isinstance(model, Lti) and len(reduction[0].A) >= len(full.A):
            reduction = itself
    smaller, (bound, error) = reduction
    states = len((smaller if isinstance(smaller, Lti) else smaller._modal_form).A)
    if order is not None and states < order:
        reason = (
            "complex pairs are not split"
            if method == "modal"
            else f"all others have Hankel singular values below {DEPENDENT:g} of the largest, which is rounding"
        )
        warn_user(f"order = {order}: {states} states returned; {reason}", LowerOrderWarning)
    if isinstance(smaller, Lti):
        scales = getattr(model, "scales", {})  # A structure is in the units of the machine.
        smaller = replace(
            smaller, input_labels=model.input_labels, output_labels=model.output_labels, state_labels=(), scales=scales
        ).without_dots()
    coordinates = "modal coordinates" if parts.modal is not None else "given coordinates"
    return ReductionResult(
        _full=model,
        _reduced=smaller,
        order=states,
        requested_order=order,
        error_bound=bound,
        error_norm=error.upper_bound,
        method=method,
        certificate=replace(error, peak_omega=float(omega_of_image(error.peak_omega, full.dt))),
        hankel_singular_values=reducer.form.values,
        retained_order=len(parts.retained.A),
        stages=(coordinates, UNREDUCED) if error is _NO_ERROR else (coordinates,),
        omega_range=limits,
        full_order=len(full.A),
    )


def _checked_request(
    system: object,
    size: int,
    order: int | None,
    method: str,
    max_error: float | None,
    omega_range: Band | None,
) -> tuple[float, Band | None]:
    """Return the largest error, ``inf`` if an order is requested, and the frequency range of a valid request."""
    known("method", method, tuple(METHODS))
    if omega_range is not None and method in _WITHOUT_RANGE:
        raise ValueError(
            f"`omega_range` must be None for method {method!r}, got {omega_range!r}. Use 'balanced' or"
            " 'singular-perturbation'."
        )
    if (order is None) == (max_error is None):
        raise ValueError("order, max_error: expected exactly one of them")
    if order is not None and whole("order", order, 0) > size:
        raise ValueError(f"order = {order}: the system has only {size} states")
    if method == "second-order" and not isinstance(system, SecondOrderModel):
        raise TypeError(f"method 'second-order': expected a SecondOrderModel, got {type(system).__name__}")
    wanted = inf if max_error is None else positive("max_error", max_error)
    return wanted, None if omega_range is None else span("omega_range", omega_range)


def _band_of_image(system: Lti, band: Band) -> Band:
    if band[1] > system.nyquist:
        raise ValueError(
            f"`omega_range` must end at or below half the sampling rate, {up_to(system.nyquist)} rad/s, got {band[1]:g}."
        )
    low, high = image_of_omega(np.minimum(band, system.nyquist * (1.0 - LEVEL)), system.dt)
    return float(low), float(high)


def _within(reducer: StateReducer | StrongestModes, error: float) -> tuple[Lti | SecondOrderModel, Verified]:
    """Return the reduction of lowest order whose verified error is at most ``error``.

    Raises
    ------
    ReductionError
        If no order has such a small verified error.
    """
    best = inf
    for order in reducer.orders(error):
        tell(f"{order} states")
        with suppress(ValueError, ReductionError):  # A Hankel singular value repeated across the cut, or not verified.
            reduction = reducer.reduced(order)
            best = min(best, reduction[1][1].upper_bound)
            if best <= error:
                return reduction
    raise ReductionError(f"max_error = {error:g}: the smallest verified error of any order is {best:.4g}")
