"""What vouches for a tuned controller: norms of the loops as the user handed them in, and what no controller beats."""

from dataclasses import replace

import numpy as np

from boomctl.analysis.h2 import matrices_h2_norm
from boomctl.analysis.norm import NormBounds, matrices_norm
from boomctl.exceptions import SynthesisError
from boomctl.lti.modal import sides
from boomctl.lti.system import ClosedLoop, Lti, lower_lft
from boomctl.progress import Deadline
from boomctl.synthesis.hinf.bounds import REFUTED_RTOL
from boomctl.synthesis.lq.h2 import h2
from boomctl.synthesis.plants.channels import Channel, channel_of, places
from boomctl.synthesis.plants.partition import GeneralizedPlant
from boomctl.tuning.full_order import full_order_bound

_EDGE = 1e-5  # decay of a pole over its size below which a loop may have ended at the edge of stability (a choice)
_LOST = 1e-3  # share of the decay that the same pole had without the controller, below which it has (a choice)
_SAME_POLE = 0.3  # share of its size within which a pole of the plant is the same (a choice)
_MOST_BOUNDS = 3  # models whose bound is looked for: those where the norm is largest (a choice of patience)


def loop_of(plant: GeneralizedPlant, K: Lti) -> Lti:
    """Return the loop from all disturbances to all performance signals.

    Raises
    ------
    SynthesisError
        It is not well-posed, or not stable.
    """
    try:
        loop = lower_lft(plant.system, K)
    except ValueError as error:
        raise SynthesisError(f"the best controller found could not be verified: {error}") from None
    if (sides(loop.poles, 0.0) >= 0).any():
        worst = loop.poles[np.argmax(loop.poles.real)]
        raise SynthesisError(
            f"the best controller found could not be verified: the loop has a pole at {worst:.6g} rad/s"
        )
    return loop


def edge_of(plant: GeneralizedPlant, loop: Lti) -> str:
    """Return what to say of a loop that ended at the edge of stability; nothing where none of its poles was driven there."""
    before, after = plant.system.poles, loop.poles
    sizes = np.abs(before[before != 0.0])
    slowest = float(sizes.min(initial=np.inf)) if len(sizes) else 1.0
    slowest = max(slowest, REFUTED_RTOL * float(sizes.max(initial=0.0)))
    if not len(after):
        return ""
    apart = -after.real / (np.abs(after) + slowest)
    k = int(np.argmin(apart))
    pole = after[k]
    near = np.abs(before - pole)
    had = 1.0
    if len(before) and near.min() <= _SAME_POLE * abs(pole):
        its = before[np.argmin(near)]
        had = -its.real / (abs(its) + slowest) if its.real < 0.0 else 1.0
    if apart[k] > min(_EDGE, _LOST * had):
        return ""
    shown = f"{pole.real:.3g}" if pole.imag == 0.0 else f"{pole.real:.3g} ± {abs(pole.imag):.6g}j"
    return f"ended at the edge of stability: a pole at {shown} rad/s decays by {-pole.real:.2g}; ask for decay="


def channel_norm(loop: Lti, plant: GeneralizedPlant, K: Lti, channel: Channel) -> NormBounds:
    """Return the verified norm of a channel of a loop."""
    columns, rows = places(plant, channel)
    if channel.norm == "hinf":
        (p, m), system = loop.D.shape, plant.system
        open_ = system.between([*columns, *range(m, system.B.shape[1])], [*rows, *range(p, len(system.C))])
        return matrices_norm(ClosedLoop(open_, K))
    part = loop.between(columns, rows)
    return matrices_h2_norm(replace(part, D=np.zeros_like(part.D)))


def lower_bound(
    plants: list[GeneralizedPlant], values: list[tuple[float, int, Channel]], limit: float
) -> tuple[float, str]:
    """Return a norm that no controller of any order goes below, and where it comes from, or why there is none.

    Parameters
    ----------
    plants : list of GeneralizedPlant
    values : list of (float, int, Channel)
        Norm reached, plant and channel of every objective.
    limit : float
        Seconds for all of it.
    """
    best, said, reasons = 0.0, "", []
    deadline = Deadline(limit)
    for value, model, channel in sorted(values, key=lambda each: each[0], reverse=True)[:_MOST_BOUNDS]:
        plant = channel_of(plants[model], channel)
        if deadline.over:
            reasons.append("out of time")
            break
        try:
            bound = _bound(plant, channel, deadline)
        except (SynthesisError, np.linalg.LinAlgError, ValueError, ArithmeticError) as error:
            reasons.append(str(error))
            continue
        if bound > value * (1.0 + REFUTED_RTOL):
            reasons.append("the bound was made by rounding")
            continue
        if min(bound, value) > best:
            best, said = min(bound, value), "two Riccati equations" if channel.norm == "hinf" else "H2 synthesis"
    if best > 0.0:
        return best, f"full-order synthesis, {said}"
    return 0.0, f"none: {reasons[0]}" if reasons else "none: full-order synthesis reaches zero"


def _bound(plant: GeneralizedPlant, channel: Channel, deadline: Deadline) -> float:
    if channel.norm == "h2":
        return h2(plant.system.statespace("P"), plant.nmeas, plant.ncon).optimal_norm
    if not (plant.nmeas and plant.ncon):
        raise SynthesisError("there is no controller")
    lower, told = full_order_bound(plant, deadline)
    if lower == 0.0 and told:
        raise SynthesisError(told)
    return lower
