"""``reduce``: one door to all methods; every result is verified before it is returned."""

import warnings
from dataclasses import replace
from math import inf
from typing import TYPE_CHECKING

from boomctl.checks import finite_array, known, positive, whole
from boomctl.lti.system import Lti, of
from boomctl.progress import Listener, Tell, computing
from boomctl.reduction.core import core_of
from boomctl.reduction.reducers import (
    MINIMAL,
    BalancedTruncation,
    HankelApproximation,
    ModalTruncation,
    Reducer,
    SingularPerturbation,
    StrongestModes,
)
from boomctl.reduction.result import LowerOrderWarning, ReductionError, ReductionResult
from boomctl.reduction.verify import Band, Verified
from boomctl.structure.model import SecondOrderModel

if TYPE_CHECKING:
    import control

METHODS = {
    "balanced": BalancedTruncation,
    "singular-perturbation": SingularPerturbation,
    "hankel": HankelApproximation,
    "modal": ModalTruncation,
    "second-order": StrongestModes,
}
_MODES = 14  # of a structure, beyond the order, that the first core has: enough for most booms (a choice)
_TAIL_SHARE = 0.02  # share of the error that a core may leave out; if it is more, the core grows (a choice)
_ROUNDING = 1e-8  # of the largest Hankel singular value: what a core leaves out below that is rounding (a choice)
_LARGEST_CORE = 500  # modes beyond which no core grows: its balancing takes a minute (a choice)


def reduce(
    system: "control.StateSpace | SecondOrderModel",
    order: int | None = None,
    method: str = "balanced",
    *,
    error: float | None = None,
    band: tuple[float, float] | None = None,
    progress: "Listener | None" = None,
) -> ReductionResult:
    """Return a smaller system, with a bound of its error known beforehand and the error verified afterwards.

    Unstable, undamped, integrating and rigid-body states are split off and kept as they are, but for rounding.

    Parameters
    ----------
    system : control.StateSpace or SecondOrderModel
        In continuous time.  Of a large structure a core of its undamped modes is reduced, and what the other modes
        contribute is bounded in closed form.
    order : int, optional
        Number of states wanted, the kept ones included.  Fewer come back, with a warning, where fewer suffice for
        rounding, or where "modal" would have to split a pair of poles.
    method : "balanced", "singular-perturbation", "hankel", "modal" or "second-order"
        Balanced truncation (exact at infinite frequency), singular perturbation (exact at zero frequency), optimal
        Hankel-norm approximation, the strongest modes with the static gain of the others; of a structure, likewise
        with undamped modes, which gives a smaller structure (an even order, two states a coordinate; the bound is
        ``inf`` for more than 700 coordinates, undamped modes, or other outputs than displacements).
    error : float, optional
        Instead of ``order``: the lowest order whose verified error is not above this (absolute).
    band : (float, float), optional
        Frequencies that matter [rad/s], ascending.  The measured error is then that within the band; the bound still
        holds at all frequencies.
    progress : callable, optional
        Is told a `Progress` at each stage.  Without one, after three seconds a line on a terminal or in a notebook says
        what goes on; `listening` hears whatever runs within it.

    Returns
    -------
    ReductionResult
        The smaller system, and its error: bounded beforehand, and verified.

    Raises
    ------
    TypeError, ValueError
        Another kind of system, discrete time, not finite; unknown method; both or none of ``order`` and ``error``; an
        order above the system's or below its kept part; a band that does not ascend.
    ReductionError
        The error exceeds its bound or could not be verified; no order has so small an error.

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
    >>> smaller.order, round(smaller.measured_error, 3)
    (1, 0.018)
    """
    given = system if isinstance(system, SecondOrderModel) else of(system)
    known("method", method, tuple(METHODS))
    if (order is None) == (error is None):
        raise ValueError("order, error: expected exactly one of them")
    if order is not None and whole("order", order, 0) > _states(given):
        raise ValueError(f"order = {order}: the system has only {_states(given)} states")
    wanted, limits = None if error is None else positive("error", error), _band(band)
    if method == "second-order" and isinstance(given, Lti):
        raise TypeError(f"method 'second-order': expected a SecondOrderModel, got {type(system).__name__}")
    modes, path = _MODES + (order or 0), []
    with computing("reduction", progress) as tell:
        while True:
            tell(f"core of up to {modes} modes")
            core = core_of(given, modes)
            path.append(core.way)
            reducer: Reducer = METHODS[method](given, core, limits, modes)
            last, floor = modes >= _LARGEST_CORE, _ROUNDING * float(reducer.values.max(initial=0.0))
            modes *= 2  # of the next core, where this one does not do
            if not (core.complete or last) and wanted is not None and core.tail > max(_TAIL_SHARE * wanted, floor):
                continue  # what this core leaves out alone is more than may be
            try:
                smaller, found = reducer.reduced(order) if wanted is None else _within(reducer, wanted, tell)  # type: ignore[arg-type]
            except ReductionError:
                if reducer.complete or last:
                    raise
                continue
            if core.complete or last or core.tail <= max(_TAIL_SHARE * found.measured, floor):
                break
    if order is not None and _states(smaller) < order:
        reason = (
            "a pair of poles stays whole"
            if method == "modal"
            else f"all others have Hankel singular values below {MINIMAL:g} of the largest, which is rounding"
        )
        said = f"order = {order}: {_states(smaller)} states come back; {reason}"
        warnings.warn(said, LowerOrderWarning, stacklevel=2)
    if isinstance(smaller, Lti):
        smaller = replace(smaller, inputs=given.inputs, outputs=given.outputs).without_dots()
    return ReductionResult(
        _full=given,
        _reduced=smaller,
        order=_states(smaller),
        asked=order,
        error_bound=found.bound,
        measured_error=found.measured,
        method=method,
        certificate=found.certificate,
        truncation_bound=core.tail,
        hankel_values=reducer.values,
        kept=len(core.kept.A),
        path=tuple(path),
        band=limits,
        full_order=_states(given),
    )


def _states(system: Lti | SecondOrderModel) -> int:
    if isinstance(system, Lti):
        return len(system.A)
    filters = 2 * sum(bandwidth is not None for bandwidth in system.ports.bandwidths)
    return 2 * system.n + sum(system.ports.integrators) + filters


def _band(band: object) -> Band | None:
    if band is None:
        return None
    limits = finite_array("band", band)  # type: ignore[arg-type]
    if limits.shape != (2,):
        raise ValueError(f"band = {band!r}: expected two frequencies")
    if not 0.0 <= limits[0] < limits[1]:
        raise ValueError(f"band = {band!r}: expected two frequencies not below zero, ascending [rad/s]")
    return float(limits[0]), float(limits[1])


def _within(reducer: Reducer, error: float, tell: Tell) -> tuple[Lti | SecondOrderModel, Verified]:
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
            smaller, found = reducer.reduced(order)
        except ValueError:  # a repeated Hankel singular value across the cut: the next order
            continue
        best = min(best, found.measured)
        if found.measured <= error:
            return smaller, found
    raise ReductionError(f"error = {error:g}: the smallest verified error of any order is {best:.4g}")
