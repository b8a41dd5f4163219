"""Verification of designs for a reduced plant on the full one.

The full plant is the reduced one plus a stable error, whose norm `reduce` has verified. A loop ``u = K y`` that is stable
on the reduced plant is stable on the full one if ``K S`` times that error, with ``S = (I - G K)^-1``, is below one at every
frequency (small gain). This is sufficient, not necessary; unless the full plant is too large, the poles of its loop are
computed too.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from math import inf, isfinite, nan
from typing import TYPE_CHECKING, Any

import numpy as np

from boomctl.analysis.h2 import matrices_h2_norm
from boomctl.analysis.norm import UNSTABLE, NormBounds, matrices_norm
from boomctl.arrays import blocks
from boomctl.checks import warn_user
from boomctl.exceptions import ReductionWarning
from boomctl.lti.bilinear import continuous_image
from boomctl.lti.frequency import largest_gain
from boomctl.lti.modal import partial_fractions, sides
from boomctl.lti.system import ClosedLoop, Lti, of
from boomctl.printing import compact
from boomctl.reduction.result import ReductionResult
from boomctl.synthesis.certificate import DesignCertificate
from boomctl.synthesis.plants.partition import GeneralizedPlant, cancelled

if TYPE_CHECKING:
    import control

# Methods of a norm on a full plant that is not available.
_NOT_COMPUTED = "not computed"
_UNDEFINED = "not defined, because states of the reduced plant have weights or noise"
_ORIGIN = "_boomctl_reduced_plant"  # Attribute of a generalized plant with its `ReducedPlant`.
_MAX_POLES = 800  # States of a full loop whose poles are computed, in two seconds.
_MAX_NORM = 200  # States of a full loop whose norm is computed, in a second.
_WARNING_FACTOR = 1.1  # Norm on the full plant, relative to that on the reduced one, from which on to warn.


@dataclass(frozen=True, eq=False)
class ReducedPlant:
    """Origin of a generalized plant of a reduced plant.

    Attributes
    ----------
    reduction : ReductionResult
        Reduction of the plant.
    around : callable
        Builds the generalized plant of any plant with the same signals.
    """

    reduction: ReductionResult
    around: Callable[[Lti], Lti]

    __repr__ = compact


def plant_within(plant: Any) -> Lti:
    """Return the plant as a system, of a reduction the reduced one."""
    system = plant.system if isinstance(plant, ReductionResult) else plant
    return of(system, "plant", "SecondOrderModel, StateSpace or ReductionResult", sampled=True)


def origin_of(P: Any) -> ReducedPlant | None:
    """Return the origin of a generalized plant if its plant, or it, is a reduction."""
    return ReducedPlant(P, of) if isinstance(P, ReductionResult) else getattr(P, _ORIGIN, None)


def generalized(
    plant: Any, around: Callable[[Lti], Lti], channels: Mapping[str, tuple[Sequence[str], Sequence[str]]]
) -> "control.StateSpace":
    """Return the generalized plant of a plant, which remembers a reduction.

    Warn of channels, given by name as inputs and outputs, in which a reduced plant is no larger than its error.
    """
    system, lost = plant_within(plant), []
    P = around(system).statespace("generalized_plant")
    if not isinstance(plant, ReductionResult):
        return P
    setattr(P, _ORIGIN, ReducedPlant(plant, around))
    for name, (inputs, outputs) in channels.items():
        if inputs and outputs and len(system.A):
            image = continuous_image(system.select(inputs, outputs))
            peak, _ = largest_gain(partial_fractions(image), partial(image.response, quiet=True))
            lost += [f"from {name}, {peak:.3g}"] if peak <= plant.error_norm else []
    if lost:
        warn_user(
            f"The error of the reduced plant, up to {plant.error_norm:.3g}, exceeds its gain {' and '.join(lost)}."
            " Increase the order, or scale these signals to similar magnitudes (scale_signals).",
            ReductionWarning,
        )
    return P


def evaluate_on_full_plant(
    origin: ReducedPlant | None, plant: GeneralizedPlant, K: Lti, reduced: NormBounds | None
) -> DesignCertificate | None:
    """Return a certificate of a loop on the full plant if its plant is reduced, and warn if it is worse there.

    ``reduced`` is the norm on the reduced plant, that on the full one is of the same kind. If None, it is not defined.
    """
    if origin is None:
        return None
    reduction = origin.reduction
    ratio = _small_gain(reduction, plant, K)
    size = reduction.full_order + len(plant.A) - reduction.order + len(K.A)  # with weights and controller
    stable, slowest = True if ratio < 1.0 else None, nan
    kind, why = ("h2", _UNDEFINED) if reduced is None else (reduced.kind, _NOT_COMPUTED)
    norm = NormBounds(0.0, inf, nan, why, kind=kind)
    stages = [f"small gain {ratio:.3g}"]
    if size <= _MAX_POLES:
        full = replace(plant, system=origin.around(of(reduction.full_system, sampled=True)))
        parts = ClosedLoop(full.system, K)
        try:
            slowest = float(parts.system.rates.real.max(initial=-inf))
            side = int(sides(parts.system.poles, K.dt).max(initial=-1))
            stages.append("poles")
        except ValueError:
            slowest, side = inf, 1
            stages.append("not well-posed")
        stable = {-1: True, 0: stable, 1: False}[side]  # the small gain decides for poles on the axis
        if stable is False:
            norm = replace(norm, lower_bound=inf, method=UNSTABLE, verified=True)
        elif stable and reduced is not None and size <= _MAX_NORM:
            norm = matrices_h2_norm(cancelled(parts.system, full.D11)) if kind == "h2" else matrices_norm(parts)
            stages.append(f"norm: {norm.method}")
    summary = _summary(reduction, stable, ratio, slowest, norm)
    known = inf if reduced is None or norm.method == _NOT_COMPUTED else reduced.value
    if not stable or norm.value > _WARNING_FACTOR * known:
        warn_user(f"The controller was designed on a reduced plant: {summary}.", ReductionWarning)
    fastest, source = float(np.abs(K.poles).max(initial=0.0)), "none: computed for the reduced plant"
    return DesignCertificate(norm, slowest, fastest, 0.0, source, tuple(stages), summary, stable, small_gain=ratio)


def _summary(reduction: ReductionResult, stable: bool | None, ratio: float, slowest: float, norm: NormBounds) -> str:
    plant = f"on the full plant of {reduction.full_order} states"
    gain = f"K S times the reduction error: norm at most {ratio:.3g}"
    if not stable:
        result = f"stability is not proved {plant}; {gain} (must be below 1)"
        if stable is False:
            result = f"UNSTABLE {plant} (a pole with real part {slowest:.3g} rad/s); {gain}"
        return f"{result}; increase the order of the reduction"
    how = f"proved: {gain}" if ratio < 1.0 else f"by its poles, largest real part {slowest:.3g} rad/s"
    if norm.method == _NOT_COMPUTED:
        cost = ""
    elif norm.method == _UNDEFINED:
        cost = f"; its cost there is {_UNDEFINED}"
    elif norm.kind == "h2":
        cost = f"; its H2 norm {norm.value:.6g}, a cost of {norm.value**2:.6g} ({norm.status})"
    elif isfinite(norm.upper_bound):
        cost = f"; its norm {norm.upper_bound:.6g}"
    else:
        cost = f"; its norm at least {norm.lower_bound:.6g} ({norm.method})"
    return f"stable {plant} ({how}){cost}"


def _small_gain(reduction: ReductionResult, plant: GeneralizedPlant, K: Lti) -> float:
    """Return the largest ``K S`` times the error of a reduction; at least one if that is not proved to be less."""
    n, m, p = len(plant.A), plant.ncon, plant.nmeas
    B, C = np.hstack([np.zeros((n, p)), plant.B2]), np.vstack([np.zeros((m, n)), plant.C2])
    D = blocks([[np.zeros((m, p)), np.eye(m)], [np.eye(p), plant.D22]])
    if reduction.error_norm == 0.0:
        return 0.0
    everywhere = reduction.error_bound if reduction.omega_range else min(reduction.error_norm, reduction.error_bound)
    return matrices_norm(ClosedLoop(Lti(plant.A, B, C, D, dt=plant.system.dt), K)).upper_bound * everywhere
