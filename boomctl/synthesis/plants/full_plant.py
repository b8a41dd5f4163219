"""Designs on a reduced plant, judged on the full one.

The full plant is the reduced one and a stable error beside it, whose size `reduce` has verified.  A loop ``u = K y`` that
is stable on the reduced plant is stable on the full one too if ``K S``, from what is added to the measurements to the
controls, times that error stays below one at every frequency (small gain; ``S = (I - G K)^-1``).  That is sufficient, not
necessary: where it does not hold, and the full plant is not too large, the poles of its loop are computed.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from math import inf, nan
from typing import TYPE_CHECKING, Any

import numpy as np

from boomctl.analysis.h2 import matrices_h2_norm
from boomctl.analysis.norm import UNSTABLE, NormBounds, axis_eigenvalues, matrices_norm
from boomctl.arrays import blocks
from boomctl.checks import warn_user
from boomctl.exceptions import ReductionWarning
from boomctl.lti.bilinear import continuous_image
from boomctl.lti.frequency import largest_gain, singular_values
from boomctl.lti.modal import sides
from boomctl.lti.system import ClosedLoop, Lti, of
from boomctl.printing import compact
from boomctl.reduction.result import ReductionResult
from boomctl.reduction.verify import band_norm
from boomctl.synthesis.certificate import NOT_COMPUTED, UNDEFINED, DesignCertificate, norm_there
from boomctl.synthesis.plants.partition import GeneralizedPlant, cancelled

if TYPE_CHECKING:
    import control

_ORIGIN = "_boomctl_reduced_plant"  # the attribute in which a generalized plant carries what it was made of
_MOST_POLES = 800  # states of a full loop whose poles are computed: two seconds (a choice)
_MOST_NORM = 200  # states of a full loop whose norm is certified: a second (a choice)
_WORSE = 1.1  # times the norm on the reduced plant: a norm on the full one above that is worth a warning (a choice)
_BEYOND = 2.0  # times the end of a band: a frequency beyond it


@dataclass(frozen=True, eq=False)
class ReducedPlant:
    """What a generalized plant was made of.

    Attributes
    ----------
    reduction : ReductionResult
        Of the plant within.
    around : callable
        Makes the generalized plant around any plant with the same signals.
    """

    reduction: ReductionResult
    around: Callable[[Lti], Lti]

    __repr__ = compact


def plant_within(plant: Any) -> Lti:
    """Return the system that a design is made on: what was handed in, or the reduced one of a reduction."""
    given = plant.system if isinstance(plant, ReductionResult) else plant
    return of(given, "plant", "SecondOrderModel, StateSpace or ReductionResult", sampled=True)


def carrying(P: "control.StateSpace", plant: Any, around: Callable[[Lti], Lti]) -> "control.StateSpace":
    """Return a generalized plant that knows, where its plant is a reduction, what that was made of."""
    if isinstance(plant, ReductionResult):
        setattr(P, _ORIGIN, ReducedPlant(plant, around))
    return P


def origin_of(P: Any) -> ReducedPlant | None:
    """Return what a generalized plant was made of, if its plant is a reduction, or it is one itself."""
    return ReducedPlant(P, of) if isinstance(P, ReductionResult) else getattr(P, _ORIGIN, None)


def warn_of_lost_channels(plant: Any, channels: dict[str, tuple[tuple[str, ...], tuple[str, ...]]]) -> None:
    """Warn where the error of a reduction is as large as all that the reduced plant does between some signals.

    Parameters
    ----------
    plant : ReductionResult or any other
        Of another kind nothing is said.
    channels : mapping
        From what a message calls them to inputs and outputs.
    """
    if not isinstance(plant, ReductionResult):
        return
    system, lost = of(plant.system, sampled=True), []
    for what, (inputs, outputs) in channels.items():
        if inputs and outputs and len(system.A):
            peak, _ = largest_gain(continuous_image(system.select(inputs, outputs)))
            if peak <= plant.error_norm:
                lost.append(f"{what} (at most {peak:.3g})")
    if lost:
        said = (
            f"the reduction's error, up to {plant.error_norm:.3g}, is as large as all that the reduced plant does from "
            f"{' and from '.join(lost)}; reduce to more states, or scale these signals to similar magnitudes (scale_signals)"
        )
        warn_user(said, ReductionWarning)


def judged_on_full_plant(
    origin: ReducedPlant | None, plant: GeneralizedPlant, K: Lti, reduced: NormBounds | None
) -> DesignCertificate | None:
    """Return what is known of a loop on the full plant, if its plant is reduced, and warn.

    ``reduced`` is the norm on the reduced plant: that on the full one is of the same kind, and a larger one is warned of.
    None: there is none to compute.
    """
    if origin is None:
        return None
    reduction = origin.reduction
    share = _share(reduction, plant, K)
    size = reduction.full_order + len(plant.A) - reduction.order + len(K.A)  # with weights and controller
    stable, slowest = True if share < 1.0 else None, nan
    kind, why = ("h2", UNDEFINED) if reduced is None else (reduced.kind, NOT_COMPUTED)
    norm = NormBounds(0.0, inf, nan, why, kind=kind)
    stages = [f"small gain {share:.3g}"]
    if size <= _MOST_POLES:
        full = replace(plant, system=origin.around(of(reduction.full_system, sampled=True)))
        try:
            parts = ClosedLoop(full.system, K)
            loop = parts.system
        except ValueError:  # not well-posed on the full plant
            stable, slowest = False, inf
            stages.append("not well-posed")
        else:
            slowest = float(loop.rates.real.max(initial=-inf))
            side = int(sides(loop.poles, loop.dt).max(initial=-1))
            stable = {-1: True, 0: stable, 1: False}[side]  # of poles that stand on the axis the small gain alone tells
            stages.append("poles")
            if stable is False:
                norm = replace(norm, lower_bound=inf, method=UNSTABLE)
            elif stable and reduced is not None and size <= _MOST_NORM:
                norm = matrices_h2_norm(cancelled(loop, full.D11)) if reduced.kind == "h2" else matrices_norm(parts)
                stages.append(f"norm: {norm.method}")
    statement = _statement(reduction, stable, share, slowest, norm)
    worse = False
    if stable and reduced is not None and norm.method != NOT_COMPUTED:
        now, before = (norm.value, reduced.value) if norm.kind == "h2" else (norm.upper_bound, reduced.upper_bound)
        worse = now > _WORSE * before
    if not stable or worse:
        warn_user(f"the controller was designed on a reduced plant: {statement}", ReductionWarning)
    fastest = float(np.abs(K.poles).max(initial=0.0))
    reason = "none: sought for the reduced plant"
    return DesignCertificate(norm, slowest, fastest, 0.0, reason, tuple(stages), statement, stable, small_gain=share)


def _statement(reduction: ReductionResult, stable: bool | None, share: float, slowest: float, norm: NormBounds) -> str:
    gain = f"K S times the reduction's error of {reduction.error_norm:.3g} is up to {share:.3g}"
    if stable is False:
        return (
            f"on the full plant of {reduction.full_order} states the loop is UNSTABLE (a pole with real part {slowest:.3g} "
            f"rad/s); {gain}; reduce to more states"
        )
    if stable is None:
        return (
            f"it is not proved that the loop is stable on the full plant of {reduction.full_order} states; {gain}, and below "
            "1 would prove it; reduce to more states, or look at the full loop (feedback_loop, margins)"
        )
    how = f"proved: {gain}, below 1" if share < 1.0 else f"its poles were computed, the slowest at {slowest:.3g} rad/s"
    told = f"stable on the full plant of {reduction.full_order} states ({how})"
    return f"{told}{norm_there(norm, '; its ')}"


def _share(reduction: ReductionResult, plant: GeneralizedPlant, K: Lti) -> float:
    """Return the largest ``K S`` times the error of a reduction; at least one where that is not proved to be less."""
    n, m, p = len(plant.A), plant.ncon, plant.nmeas
    added = Lti(
        plant.A,
        np.hstack([np.zeros((n, p)), plant.B2]),
        np.vstack([np.zeros((m, n)), plant.C2]),
        blocks([[np.zeros((m, p)), np.eye(m)], [np.eye(p), plant.D22]]),
        dt=plant.system.dt,
    )
    parts = ClosedLoop(added, K)
    KS = parts.system
    if reduction.error_norm == 0.0:
        return 0.0
    largest = matrices_norm(parts).upper_bound
    if reduction.omega_range is None:
        return largest * min(reduction.error_norm, reduction.error_bound)
    everywhere = largest * reduction.error_bound
    if everywhere < 1.0 or KS.dt != 0.0:  # of a band on the unit circle nothing more is told
        return everywhere
    inside = band_norm(KS, KS.response, reduction.omega_range).upper_bound * reduction.error_norm
    low, high = reduction.omega_range
    outside = np.array([0.0, 0.5 * low, _BEYOND * high] if low > 0.0 else [_BEYOND * high])
    values = np.append(singular_values(KS.response(outside, quiet=True))[0], np.linalg.norm(KS.D, 2))
    if values.max() * reduction.error_bound >= 1.0:
        return max(inside, float(values.max()) * reduction.error_bound)
    crossings = axis_eigenvalues(KS, 1.0 / reduction.error_bound)
    # where all of these lie within the band nothing reaches the level outside of it
    return inside if ((crossings > low) & (crossings < high)).all() else max(inside, everywhere)
