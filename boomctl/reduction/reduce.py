"""``reduce``: one door to all methods; every result is verified before it is returned."""

from dataclasses import replace
from math import inf
from typing import TYPE_CHECKING

import numpy as np

from boomctl.analysis.norm import (
    NO_CIRCLE_CROSSING,
    NO_RESPONSE,
    NormBounds,
    matrices_norm,
    proved_norm,
    stays_below_on_circle,
)
from boomctl.arrays import Array
from boomctl.checks import finite_array, known, positive, up_to, warn_user, whole
from boomctl.exceptions import LowerOrderWarning, ReductionError
from boomctl.lti.bilinear import continuous_image, discrete_image, image_of_omega, omega_of_image
from boomctl.lti.frequency import singular_values
from boomctl.lti.modal import sides, split
from boomctl.lti.rounding import CERTIFIED
from boomctl.lti.system import Lti, of
from boomctl.lti.verified_modal_form import rounding_doubt
from boomctl.progress import Listener, computing, tell
from boomctl.reduction.core import core_of
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
from boomctl.reduction.verify import SLACK, START, Band, Verified, band_norm, difference
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
AS_GIVEN = "the system itself"  # of all its states: no system differs less
NO_ERROR = NormBounds(0.0, 0.0, 0.0, NO_RESPONSE)
_MODES = 14  # of a structure, beyond the order, that the first core has: enough for most booms (a choice)
_TAIL_SHARE = 0.02  # share of the error that a core may leave out; if it is more, the core grows (a choice)
_ROUNDING = 1e-8  # of the largest Hankel singular value: what a core leaves out below that is rounding (a choice)
_SPLIT = (
    1e-6  # distance up to which rounding takes a double pole on the circle apart: its root, with room (measured: 4e-8)
)
_LARGEST_CORE = 500  # modes beyond which no core grows: its balancing takes a minute (a choice)


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
        A discrete one is reduced as its continuous image by the bilinear map, which has the same norms and Hankel singular
        values; the error is verified anew on the unit circle.  Of a large structure a core of its undamped modes is
        reduced, and what the other modes contribute is bounded in closed form.
    order : int, optional
        Number of states wanted, the kept ones included.  Fewer come back, with a warning, where fewer suffice for
        rounding, or where "modal" would have to split a pair of poles.
    method : "balanced", "singular-perturbation", "hankel", "modal" or "second-order"
        Balanced truncation (exact at infinite frequency), singular perturbation (exact at zero frequency), optimal
        Hankel norm approximation (the Hankel norm of the error is the smallest of that order, its H-infinity norm is
        not), the strongest modes with the static gain of the others; of a structure, likewise
        with undamped modes, which gives a smaller structure (an even order, two states a coordinate; the bound is
        ``inf`` for undamped modes, or other outputs than displacements).
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
        Another kind of system, discrete time that does not say its sampling time, a pole at ``z = -1``, not finite;
        unknown method; both or none of ``order`` and ``max_error``; an
        order above the system's or below its kept part, or one that parts equal Hankel singular values ("hankel"); an
        `omega_range` that does not ascend, or that is too far from the poles.
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
    (1, 0.018)
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
    wanted, limits = None if max_error is None else positive("max_error", max_error), _checked_range(omega_range)
    if method == "second-order" and isinstance(given, Lti):
        raise TypeError(f"method 'second-order': expected a SecondOrderModel, got {type(system).__name__}")
    with computing("reduction", progress):
        reduced = _by_image if isinstance(given, Lti) and given.dt != 0.0 else _by_cores
        result = reduced(given, order, wanted, method, limits)  # type: ignore[arg-type]
    if order is not None and result.order < order:
        reason = (
            "a pair of poles stays whole"
            if method == "modal"
            else f"all others have Hankel singular values below {MINIMAL:g} of the largest, which is rounding"
        )
        warn_user(f"order = {order}: {result.order} states come back; {reason}", LowerOrderWarning)
    return result


def _by_cores(
    given: Lti | SecondOrderModel, order: int | None, wanted: float | None, method: str, band: Band | None
) -> ReductionResult:
    """Return the reduction to an order or within an error, of the first core large enough."""
    stages: list[str] = []
    modes, size, truncated = _MODES + (order or 0), _states(given), 0.0
    while True:
        tell(f"core of up to {modes} modes")
        core = core_of(given, modes)
        stages.append(core.way)
        reducer = METHODS[method](given, core, band, modes)
        last, floor = modes >= _LARGEST_CORE, _ROUNDING * float(reducer.values.max(initial=0.0))
        modes *= 2  # of the next core, where this one does not do
        if not (core.complete or last) and wanted is not None and core.tail > max(_TAIL_SHARE * wanted, floor):
            continue  # what this core leaves out alone is more than may be
        try:
            smaller, result = reducer.reduced(order) if wanted is None else _within(reducer, wanted)  # type: ignore[arg-type]
        except ReductionError:
            if not (reducer.complete or last):
                continue
            if wanted is None and (order != size or not isinstance(given, Lti)):
                raise
            smaller, result = None, None
        if result is None or (isinstance(given, Lti) and _states(smaller) >= size):  # type: ignore[arg-type]
            # no system differs less from one than itself
            smaller, result = _as_given(given, method), Verified(0.0, 0.0, NO_ERROR, 0.0)
            stages.append(AS_GIVEN)
            break
        if core.complete or last or core.tail <= max(_TAIL_SHARE * result.measured, floor):
            truncated = result.truncation
            break
    if isinstance(smaller, Lti):
        scales = getattr(given, "scales", {})  # a structure is in the units of the machine
        smaller = replace(
            smaller, input_labels=given.input_labels, output_labels=given.output_labels, state_labels=(), scales=scales
        ).without_dots()
    return ReductionResult(
        _full=given,
        _reduced=smaller,  # type: ignore[arg-type]
        order=_states(smaller),  # type: ignore[arg-type]
        requested_order=order,
        error_bound=result.bound,
        error_norm=result.measured,
        method=method,
        certificate=result.certificate,
        core_error_bound=truncated,
        hankel_singular_values=reducer.values,
        retained_order=len(core.kept.A),
        stages=tuple(stages),
        omega_range=band,
        full_order=size,
    )


def _by_image(given: Lti, order: int | None, wanted: float | None, method: str, band: Band | None) -> ReductionResult:
    """Return the reduction of a discrete system, by orders of its image until the error on the circle is small enough."""
    inside = None if band is None else _band_of_image(given, band)
    # what the discrete error is proved to stay below is a little more than that of the image
    within = None if wanted is None else wanted * (1.0 - CERTIFIED)
    image = continuous_image(given)
    while True:
        found = _by_cores(image, order, within, method, inside)
        try:
            result = _on_circle(given, found, band)
        except ReductionError:
            if wanted is None:
                raise
        else:
            if wanted is None or result.error_norm <= wanted:
                return result
        within = found.error_norm * (1.0 - CERTIFIED)  # the next order


def _band_of_image(full: Lti, band: Band) -> Band:
    if band[1] > full.nyquist:
        raise ValueError(
            f"`omega_range` must end at or below half the sampling rate, {up_to(full.nyquist)} rad/s, got {band[1]:g}."
        )
    end = min(band[1], full.nyquist * (1.0 - START))  # the image of half the sampling rate is at infinity
    return float(image_of_omega(min(band[0], end), full.dt)), float(image_of_omega(end, full.dt))


def _as_given(given: Lti | SecondOrderModel, method: str) -> Lti | SecondOrderModel:
    """Return the given system as what a method returns."""
    if isinstance(given, Lti) or method == "second-order":
        return given
    return given._modal_form


def _kept(system: Lti) -> Array:
    """Return which poles of a discrete system do not decay: both halves of a double one, which rounding takes apart."""
    poles = system.poles
    beyond = sides(poles, system.dt) >= 0
    return np.any((np.abs(poles[:, None] - poles) <= _SPLIT) & beyond, axis=1)


def _on_circle(full: Lti, found: ReductionResult, band: Band | None) -> ReductionResult:
    """Return the reduction of the image of a discrete system as that of the system itself, its error verified anew.

    Raises
    ------
    ReductionError
        The error on the unit circle is another, or could not be verified.
    """
    if found.order >= len(full.A):
        small = replace(full, state_labels=()).without_dots()
        return replace(found, _full=full, _reduced=small, certificate=NO_ERROR, omega_range=band)
    image = found._reduced
    assert isinstance(image, Lti)
    small, dt, kept = discrete_image(image, full.dt), full.dt, "unstable, undamped or rigid-body poles"
    small = replace(
        small, input_labels=full.input_labels, output_labels=full.output_labels, state_labels=(), scales=full.scales
    ).without_dots()
    # a system without such poles stays as it is: rounding of other coordinates moves what is slow by more than the error
    apart, ours, own = [full.balanced(), small.balanced()], [], 0.0
    for k, system in enumerate(apart):
        if (far := _kept(system)).any():
            one, apart[k], doubt = split(system, far, kept)
            ours.append(one)
            own += rounding_doubt(apart[k], doubt)
    if len(ours) == 2:  # what is kept is the same but for rounding, of the map there and back too
        omega = np.unique(np.concatenate([[0.0, full.nyquist], *(np.abs(one.rates.imag) for one in ours)]))
        first, second = (one.response(omega, quiet=True) for one in ours)
        own += float(singular_values(first - second)[0].max())
    if own == inf:
        raise ReductionError(
            "rounding of the system's matrices may change its response without bound: nothing is verified"
        )
    gap = replace(difference(*apart), dt=dt)
    largest = matrices_norm(apart[0].balanced()).lower_bound
    floor = _ROUNDING * largest
    everywhere = matrices_norm(gap)
    level = max(found.error_norm, everywhere.lower_bound) * (1.0 + SLACK) + floor
    if everywhere.upper_bound == inf and len(gap.A) and stays_below_on_circle(gap, level):
        everywhere = replace(everywhere, upper_bound=level, method=NO_CIRCLE_CROSSING)
    norm = everywhere if band is None else _in_band(gap, band, floor)
    if norm.lower_bound > found.error_bound * (1.0 + SLACK) + floor:
        raise ReductionError(
            f"the error on the unit circle, {norm.lower_bound:.4g} at {norm.peak_omega:.4g} rad/s, exceeds its bound "
            f"{found.error_bound:.4g}: rounding of the bilinear map is larger"
        )
    if norm.upper_bound == inf:
        raise ReductionError(f"the error on the unit circle could not be verified ({norm.method})")
    return replace(
        found,
        _full=full,
        _reduced=small,
        error_bound=max(
            found.error_bound, everywhere.upper_bound + own
        ),  # which knows of rounding, and of that of the map
        error_norm=norm.upper_bound + own,
        certificate=norm,
        omega_range=band,
    )


def _in_band(gap: Lti, band: Band, floor: float) -> NormBounds:
    """Compute the largest error of a discrete system in a band: its own response, below levels that its image proves.

    Where rounding hides these, in exact arithmetic.
    """

    def respond(v: Array) -> Array:
        return gap.response(omega_of_image(v, gap.dt), quiet=True)

    result = band_norm(continuous_image(gap), respond, _band_of_image(gap, band), floor)
    result = replace(result, peak_omega=float(omega_of_image(result.peak_omega, gap.dt)))
    if result.upper_bound <= result.lower_bound * (1.0 + CERTIFIED):
        return result
    exact = proved_norm(gap, result.lower_bound, result.peak_omega, band=band)
    return exact if exact.upper_bound < inf else result


def _states(system: Lti | SecondOrderModel) -> int:
    if isinstance(system, Lti):
        return len(system.A)
    filters = 2 * sum(bandwidth is not None for bandwidth in system.ports.bandwidths)
    return 2 * system.ncoordinates + sum(system.ports.integrators) + filters


def _checked_range(omega_range: object) -> Band | None:
    if omega_range is None:
        return None
    limits = finite_array("omega_range", omega_range)  # type: ignore[arg-type]
    if limits.shape != (2,) or not 0.0 <= limits[0] < limits[1]:
        raise ValueError(
            f"`omega_range` must be two frequencies [rad/s], nonnegative and ascending, got {omega_range!r}."
        )
    return float(limits[0]), float(limits[1])


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
        try:
            smaller, result = reducer.reduced(order)
        except (
            ValueError,
            ReductionError,
        ):  # a Hankel singular value repeated across the cut, or not verified: the next
            continue
        best = min(best, result.measured)
        if result.measured <= error:
            return smaller, result
    raise ReductionError(f"max_error = {error:g}: the smallest verified error of any order is {best:.4g}")
