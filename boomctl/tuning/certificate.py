"""What vouches for a tuned controller: norms of the loops as the user handed them in, and what no controller beats."""

import time
from dataclasses import dataclass, replace
from math import inf

import numpy as np

from boomctl.analysis.h2 import H2Certificate, h2_norm
from boomctl.analysis.norm import NormCertificate, matrices_norm
from boomctl.lti.modal import sides
from boomctl.lti.system import ClosedLoop, Lti, lower_lft
from boomctl.printing import compact, sentence
from boomctl.synthesis.assumptions import SynthesisError
from boomctl.synthesis.hinf import full_order as any_order
from boomctl.synthesis.hinf.bounds import REFUTED, Deadline
from boomctl.synthesis.lq.h2 import h2
from boomctl.synthesis.plants.partition import GeneralizedPlant
from boomctl.tuning.channels import Channel

_EDGE = 1e-5  # decay of a pole over its size below which a loop may have ended at the edge of stability (a choice)
_LOST = 1e-3  # share of the decay that the same pole had without the controller, below which it has (a choice)
_SAME_POLE = 0.3  # share of its size within which a pole of the plant is the same (a choice)
_MOST_BOUNDS = 3  # models whose bound is looked for: those where the norm is largest (a choice of patience)


@dataclass(frozen=True)
class ChannelNorm:
    """A certified norm of one channel of one loop.

    Attributes
    ----------
    model : str
        Which of the models; empty where there is only one.
    channel : Channel
        Which channel.
    norm : NormCertificate or H2Certificate
        Its norm, between two bounds.
    """

    model: str
    channel: Channel
    norm: NormCertificate | H2Certificate

    @property
    def value(self) -> float:
        """The norm; of an H-infinity norm the largest value found."""
        return self.norm.lower if isinstance(self.norm, NormCertificate) else self.norm.value

    def __repr__(self) -> str:
        budget = "" if self.channel.budget is None else f", budget {self.channel.budget:.6g}"
        where = f", {self.model}" if self.model else ""
        return f"ChannelNorm: {self.channel.text}{where}: {self.value:.6g}{budget}"


@dataclass(frozen=True)
class ActivePeak:
    """One of the peaks that keep a norm from going lower.

    Attributes
    ----------
    model : str
        Which of the models; empty where there is only one.
    channel : Channel
        Which channel.
    omega : float
        Its frequency [rad/s]; nan of an H2 norm.
    value : float
        The singular value there, or the H2 norm.
    """

    model: str
    channel: Channel
    omega: float
    value: float

    __repr__ = compact


@dataclass(frozen=True)
class TuneCertificate:
    """What vouches for a tuned controller, and how far from the best of any order it is.

    Attributes
    ----------
    norm : NormCertificate or H2Certificate
        The largest objective: computed anew from the plant as it was handed in, between two bounds.
    norms : tuple of ChannelNorm
        Of each channel of each model.
    slowest_pole : float
        Largest real part of the poles of all loops [rad/s], negative.
    lower : float
        A norm that no controller of any order goes below, for these plants; 0 where none is known.
    lower_reason : str
        Where the bound comes from, or why there is none.
    fastest_pole : float
        Largest magnitude of the controller's poles [rad/s].
    peaks : tuple of ActivePeak
        The peaks that keep the norm from going lower.
    stationarity : float
        Length of the least element of the hull of the gradients of these peaks, over that of the longest of them: near zero
        where no small step goes lower, one where a single smooth peak still falls.
    active : tuple of str
        Bounds that are used up.
    path : tuple of str
        What was done, in that order.
    statement : str
        All this in a sentence.
    worst : ChannelNorm or None
        Over a family: the worst norm found anywhere in it.
    """

    norm: NormCertificate | H2Certificate
    norms: tuple[ChannelNorm, ...]
    slowest_pole: float
    lower: float
    lower_reason: str
    fastest_pole: float
    peaks: tuple[ActivePeak, ...]
    stationarity: float
    active: tuple[str, ...]
    path: tuple[str, ...]
    statement: str
    worst: ChannelNorm | None = None

    def __repr__(self) -> str:
        return sentence("TuneCertificate", self.statement)

    @property
    def distance(self) -> float:
        """How far above the lower bound the norm lies at most, relative to it; ``inf`` where there is no bound."""
        upper = self.norm.upper
        if self.lower > 0.0:
            return upper / self.lower - 1.0
        return inf if upper > 0.0 else 0.0


def channel_of(plant: GeneralizedPlant, channel: Channel) -> GeneralizedPlant:
    """Return a plant with the disturbances and performance signals of one channel."""
    columns, rows = places(plant, channel)
    s = plant.system
    i = [*columns, *range(plant.nw, s.B.shape[1])]
    o = [*rows, *range(plant.nz, len(s.C))]
    part = replace(
        s,
        B=s.B[:, i],
        C=s.C[o],
        D=s.D[np.ix_(o, i)],
        inputs=tuple(s.inputs[k] for k in i),
        outputs=tuple(s.outputs[k] for k in o),
    )
    return GeneralizedPlant(part, plant.nmeas, plant.ncon)


def places(plant: GeneralizedPlant, channel: Channel) -> tuple[list[int], list[int]]:
    """Return columns and rows of a channel among disturbances and performance signals."""
    columns = plant.disturbances if channel.inputs is None else channel.inputs
    rows = plant.performance if channel.outputs is None else channel.outputs
    return [plant.disturbances.index(name) for name in columns], [plant.performance.index(name) for name in rows]


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
    slowest = max(slowest, REFUTED * float(sizes.max(initial=0.0)))
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


def channel_norm(loop: Lti, plant: GeneralizedPlant, K: Lti, channel: Channel) -> NormCertificate | H2Certificate:
    """Return the certified norm of a channel of a loop."""
    columns, rows = places(plant, channel)
    if channel.norm == "hinf":
        (p, m), system = loop.D.shape, plant.system
        open_ = system.between([*columns, *range(m, system.B.shape[1])], [*rows, *range(p, len(system.C))])
        return matrices_norm(ClosedLoop(open_, K))
    part = replace(loop, inputs=(), outputs=()).between(columns, rows)
    return h2_norm(replace(part, D=np.zeros_like(part.D)).statespace("channel"))


def full_order_bound(
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
    end = time.monotonic() + limit
    for value, model, channel in sorted(values, key=lambda each: each[0], reverse=True)[:_MOST_BOUNDS]:
        plant = channel_of(plants[model], channel)
        left = end - time.monotonic()
        if left <= 0.0:
            reasons.append("out of time")
            break
        try:
            bound = _bound(plant, channel, left)
        except (SynthesisError, np.linalg.LinAlgError, ValueError, ArithmeticError) as error:
            reasons.append(str(error))
            continue
        if bound > value * (1.0 + REFUTED):
            reasons.append("the bound was made by rounding")
            continue
        if min(bound, value) > best:
            best, said = min(bound, value), "two Riccati equations" if channel.norm == "hinf" else "H2 synthesis"
    if best > 0.0:
        return best, f"full-order synthesis, {said}"
    return 0.0, f"none: {reasons[0]}" if reasons else "none: full-order synthesis reaches zero"


def _bound(plant: GeneralizedPlant, channel: Channel, limit: float) -> float:
    if channel.norm == "h2":
        return h2(plant.system.statespace("P"), plant.nmeas, plant.ncon).optimum
    if not (plant.nmeas and plant.ncon):
        raise SynthesisError("there is no controller")
    found = any_order.full_order_bound(plant, Deadline.after(limit))
    if found.lower == 0.0 and found.told:
        raise SynthesisError(found.told)
    return found.lower
