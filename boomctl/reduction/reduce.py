"""``reduce``: one door to all methods; every result is verified before it is returned."""

from typing import TYPE_CHECKING, Any

import numpy as np
from scipy import linalg

from boomctl.arrays import Array
from boomctl.checks import finite_array, known, positive, whole
from boomctl.lti.system import Lti
from boomctl.reduction.balanced import balance
from boomctl.reduction.core import SystemCore, core_of
from boomctl.reduction.result import ReductionError, ReductionResult
from boomctl.reduction.second_order import reduced_structure
from boomctl.reduction.selection import METHODS, Attempt, Band, Cutter, attempt_error, attempt_order, cutter
from boomctl.structure.model import SecondOrderModel

if TYPE_CHECKING:
    import control

_TAIL_SHARE = 0.02
_ROUNDING = 1e-8
_MODES = 14
_LARGEST_CORE = 500


def reduce(
    system: "control.StateSpace | SecondOrderModel",
    order: int | None = None,
    method: str = "balanced",
    *,
    error: float | None = None,
    band: tuple[float, float] | None = None,
) -> ReductionResult:
    """Return a smaller system, with a bound of its error known beforehand and the error verified afterwards.

    Unstable, undamped, integrating and rigid-body states are split off and kept exactly.

    Parameters
    ----------
    system : control.StateSpace or SecondOrderModel
        In continuous time.  Of a large structure a core of its undamped modes is reduced, and what the other modes
        contribute is bounded in closed form.
    order : int, optional
        Number of states wanted, the kept ones included.  Fewer come back where fewer suffice for rounding, or where
        "modal" would have to split a pair of poles.
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

    Returns
    -------
    ReductionResult

    Raises
    ------
    TypeError, ValueError
        Another kind of system, discrete time, not finite; unknown method; both or none of ``order`` and ``error``; an
        order above the system's or below its kept part; a band that does not ascend.
    ReductionError
        The error exceeds its bound or could not be verified; no order has so small an error.

    Examples
    --------
    >>> import control
    >>> full = control.ss([[-1.0, 0.0], [0.0, -50.0]], [[1.0], [1.0]], [[1.0, 1.0]], 0.0, inputs="u", outputs="y")
    >>> reduce(full, order=1).order
    1
    """
    states = _states(system)
    known("method", method, METHODS)
    wanted, limits = _wanted(states, order, error), _band(band)
    if method == "second-order":
        return _structure(system, order, wanted, limits)
    core, found, values = _reduced(system, order, wanted, method, limits)
    joined = _joined(found.reduced, core.kept)
    return _result(_named(joined, system), len(joined.A), method, core, found, values)


def _result(
    smaller: "control.StateSpace | SecondOrderModel",
    order: int,
    method: str,
    core: SystemCore,
    found: Attempt,
    values: Array,
) -> ReductionResult:
    return ReductionResult(
        smaller, order, found.bound, found.measured, method, found.certificate, core.tail, values, len(core.kept.A)
    )


def _structure(system: object, order: int | None, error: float | None, band: Band | None) -> ReductionResult:
    if not isinstance(system, SecondOrderModel):
        raise TypeError(f"method 'second-order': expected a SecondOrderModel, got {type(system).__name__}")
    modes = _MODES + (order or 0)
    while True:
        try:
            smaller, core, found = reduced_structure(system, order, error, modes, band)
        except ReductionError:
            if error is None or modes >= min(system.n, _LARGEST_CORE):
                raise
        else:
            if core.complete or modes >= _LARGEST_CORE or core.tail <= _TAIL_SHARE * found.measured:
                values = balance(core.stable, core.modal).values
                return _result(smaller, _states(smaller), "second-order", core, found, values)
        modes *= 2


def _states(system: Any) -> int:
    """Return the number of states of a system, refused unless it is of a known kind, in continuous time and finite."""
    from boomctl.lti.python_control import control

    if isinstance(system, SecondOrderModel):
        filters = 2 * sum(bandwidth is not None for bandwidth in system.ports.bandwidths)
        return 2 * system.n + sum(system.ports.integrators) + filters
    if not isinstance(system, control.StateSpace):
        raise TypeError(f"system: expected SecondOrderModel or StateSpace, got {type(system).__name__}")
    if not system.isctime():
        raise ValueError(f"system: expected continuous time, got a sampling time of {system.dt:g} s")
    for name in ("A", "B", "C", "D"):
        finite_array(f"{name} of the system", getattr(system, name))
    return int(system.nstates)


def _wanted(states: int, order: int | None, error: float | None) -> float | None:
    """Return the wanted error, if that is what is given, and refuse an order that cannot be."""
    if (order is None) == (error is None):
        raise ValueError("order, error: expected exactly one of them")
    if order is not None and whole("order", order, 0) > states:
        raise ValueError(f"order = {order}: the system has only {states} states")
    return None if error is None else positive("error", error)


def _band(band: object) -> Band | None:
    if band is None:
        return None
    limits = finite_array("band", band)  # type: ignore[arg-type]
    if limits.shape != (2,):
        raise ValueError(f"band = {band!r}: expected two frequencies")
    if not 0.0 <= limits[0] < limits[1]:
        raise ValueError(f"band = {band!r}: expected two frequencies not below zero, ascending [rad/s]")
    return float(limits[0]), float(limits[1])


def _reduced(
    system: "control.StateSpace | SecondOrderModel",
    order: int | None,
    error: float | None,
    method: str,
    band: Band | None,
) -> tuple[SystemCore, Attempt, Array]:
    """Return a core, its reduced part and Hankel singular values; the core grows until it is not what limits."""
    modes = _MODES + (order or 0)
    while True:
        core = core_of(system, modes)
        ready = cutter(core, method, band)
        enough = core.complete or modes >= _LARGEST_CORE
        floor = _ROUNDING * float(ready.values.max(initial=0.0))
        if error is not None and not enough and core.tail > max(_TAIL_SHARE * error, floor):
            modes *= 2
            continue
        found = attempt_error(ready, error) if error is not None else _to_order(ready, order or 0)
        if enough or core.tail <= max(_TAIL_SHARE * found.measured, floor):
            return core, found, ready.values
        modes *= 2


def _to_order(ready: Cutter, order: int) -> Attempt:
    kept = len(ready.core.kept.A)
    if order < kept:
        raise ValueError(f"order = {order}: {kept} unstable, undamped or rigid-body states are kept, so at least that")
    return attempt_order(ready, min(order - kept, len(ready.core.stable.A)))


def _joined(stable: Lti, kept: Lti) -> Lti:
    if not len(kept.A):
        return stable
    A = linalg.block_diag(kept.A, stable.A) if len(stable.A) else kept.A
    return Lti(A, np.vstack([kept.B, stable.B]), np.hstack([kept.C, stable.C]), stable.D)


def _named(reduced: Lti, system: "control.StateSpace | SecondOrderModel") -> "control.StateSpace":
    from boomctl.lti.python_control import control

    if isinstance(system, SecondOrderModel):
        inputs, outputs = list(system.inputs), list(system.outputs)
    else:
        inputs, outputs = list(system.input_labels), list(system.output_labels)
    return control.ss(reduced.A, reduced.B, reduced.C, reduced.D, inputs=inputs, outputs=outputs, name="reduced")
