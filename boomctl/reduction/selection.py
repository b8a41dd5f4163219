"""From a core and a wanted order or error to a verified reduced part."""

from collections.abc import Callable
from dataclasses import dataclass
from math import inf

import numpy as np
from scipy import linalg

from boomctl.analysis.norm import NormCertificate
from boomctl.arrays import Array
from boomctl.lti.frequency import singular_values
from boomctl.lti.system import Lti
from boomctl.reduction.balanced import balance, perturbed, truncated
from boomctl.reduction.band import weighted
from boomctl.reduction.core import SystemCore
from boomctl.reduction.hankel import hankel_optimal
from boomctl.reduction.modal import modal_reduced
from boomctl.reduction.result import ReductionError
from boomctl.reduction.verify import verified_norm

METHODS = ("balanced", "singular-perturbation", "hankel", "modal", "second-order")
_SLACK = 1e-3
_ROUNDING = 1e-9

Band = tuple[float, float]
_BALANCED = {"balanced": truncated, "singular-perturbation": perturbed, "hankel": hankel_optimal}


@dataclass(frozen=True)
class Attempt:
    """A reduced stable part, its bound and its verified error, what the core leaves out included in both."""

    reduced: Lti
    bound: float
    measured: float
    certificate: NormCertificate


@dataclass(frozen=True)
class Cutter:
    """A core ready to be cut: ``cut(order)`` gives the reduced stable part and the bound of the core's error."""

    core: SystemCore
    band: Band | None
    values: Array
    cut: Callable[[int], tuple[Lti, float]]


def cutter(core: SystemCore, method: str, band: Band | None) -> Cutter:
    """Return a core ready to be cut by a method.

    Raises
    ------
    ValueError
        "modal" of a system that has no well-conditioned modal coordinates.
    """
    if method == "modal":
        modal = core.modal
        if modal is None:
            raise ValueError("method 'modal': the stable poles are defective (Jordan blocks), use 'balanced'")
        values = balance(core.stable, modal).values
        return Cutter(core, band, values, lambda order: modal_reduced(modal, order, band))
    shorten = _BALANCED[method]
    if band is None or not len(core.stable.A):
        form = balance(core.stable, core.modal)
        return Cutter(core, band, form.values, lambda order: shorten(form, order))
    seen = weighted(core.stable, core.modal, band)
    inner = balance(seen.system, seen.modal)

    def cut(order: int) -> tuple[Lti, float]:
        reduced, bound = shorten(inner, order)
        return seen.restored(reduced), bound * seen.factor

    return Cutter(core, band, inner.values, cut)


def attempt_order(ready: Cutter, order: int) -> Attempt:
    """Return the stable part reduced to an order, verified.

    Raises
    ------
    ReductionError
        The error exceeds its bound, or could not be verified.
    """
    reduced, bound = ready.cut(order)
    try:
        return verified(ready.core, reduced, bound, ready.band)
    except ReductionError as reason:
        raise ReductionError(f"order {order}: {reason}") from None


def verified(core: SystemCore, reduced: Lti, bound: float, band: Band | None) -> Attempt:
    """Return how a reduced stable part compares with that of the core, refused where it breaks its bound."""
    D = core.stable.D
    largest = core.modal.sizes.max(initial=0.0) if core.modal is not None else _size(core.stable)
    floor = _ROUNDING * max(float(np.linalg.norm(D, 2)) if D.size else 0.0, float(largest))
    found = verified_norm(core.stable, core.modal, reduced, band, floor)
    if found.lower > bound * (1.0 + _SLACK) + floor:
        raise ReductionError(
            f"the error, {found.lower:.4g} at {found.omega:.4g} rad/s, exceeds its bound {bound:.4g}: the Gramians were "
            "not solved accurately"
        )
    if found.upper == inf:
        raise ReductionError(
            f"the error, at least {found.lower:.4g} at {found.omega:.4g} rad/s, could not be verified ({found.method})"
        )
    return Attempt(reduced, bound + core.tail, found.upper + core.tail, found)


def _size(system: Lti) -> float:
    """Return the largest response at the poles of a system without modal coordinates."""
    if not len(system.A) or not system.D.size:
        return 0.0
    return float(singular_values(system.response(np.unique(np.abs(linalg.eigvals(system.A)))))[0].max())


def attempt_error(ready: Cutter, error: float) -> Attempt:
    """Return the stable part of lowest order whose verified error is not above the one wanted.

    No system of fewer states comes nearer than the first Hankel singular value that goes, so that the search begins
    there.

    Raises
    ------
    ReductionError
        No order has so small a verified error.
    """
    first = int((ready.values > error).sum()) if ready.band is None else 0
    best = inf
    for order in range(first, len(ready.values) + 1):
        try:
            found = attempt_order(ready, order)
        except ValueError:  # a repeated Hankel singular value across the cut: the next order
            continue
        best = min(best, found.measured)
        if found.measured <= error:
            return found
    raise ReductionError(f"error = {error:g}: the smallest verified error of any order is {best:.4g}")
