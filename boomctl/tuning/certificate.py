"""Certificate of a tuned controller: norms of the closed loops with the original plants, and a lower bound."""

from dataclasses import replace
from math import exp, inf, isfinite, log

import numpy as np

from boomctl.analysis.h2 import matrices_h2_norm
from boomctl.analysis.norm import NormBounds, level_norm, matrices_norm
from boomctl.arrays import Array
from boomctl.exceptions import SynthesisError
from boomctl.lti.modal import sides
from boomctl.lti.rounding import CERTIFIED, LEVEL
from boomctl.lti.system import ClosedLoop, Lti, lower_lft
from boomctl.printing import count as counted
from boomctl.printing import percent
from boomctl.progress import Deadline, tell
from boomctl.synthesis.certificate import ActivePeak, ChannelNorm, DesignCertificate
from boomctl.synthesis.lq.h2 import h2
from boomctl.synthesis.plants.channels import Channel, channel_of, signal_indices
from boomctl.synthesis.plants.partition import GeneralizedPlant
from boomctl.tunable.structures import GAIN
from boomctl.tuning.full_order import full_order_bound
from boomctl.tuning.point import Point
from boomctl.tuning.problem import BOUNDS, DAMPING, FASTEST_POLE, GAIN_LIMIT, Problem
from boomctl.tuning.result import TuneResult
from boomctl.tuning.solver.polish import stationarity
from boomctl.tuning.solver.search import Search

_EDGE = 1e-5  # decay rate of a pole over its modulus below which a loop may be at the edge of stability
_LOST = 1e-3  # fraction of the pole's open-loop relative decay rate below which it is
_SAME_POLE = 0.3  # relative distance within which an open-loop pole corresponds to a closed-loop pole
_ACTIVE = 1e-3  # relative distance to a norm or bound within which a peak or bound is active
_BOUND_TIME = 20.0  # time limit of the lower bound for any controller, in addition to that of the search [s]
_MOST_BOUNDS = 3  # models for which the lower bound is computed: those with the largest norms


def loop_of(plant: GeneralizedPlant, K: Lti) -> Lti:
    """Return the loop from all disturbances to all performance signals.

    Raises
    ------
    SynthesisError
        If it is not well-posed, or not stable.
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


def edge_of(plant: GeneralizedPlant, loop: Lti, slowest: float) -> str:
    """Return a note on a loop at the edge of stability; empty if the controller drove no pole there."""
    if not len(loop.A):
        return ""
    before, after = (-poles.real / (np.abs(poles) + slowest) for poles in (plant.system.poles, loop.poles))
    pole = loop.poles[after.argmin()]
    same = (np.abs(plant.system.poles - pole) <= _SAME_POLE * abs(pole)) & (before > 0.0)
    if after.min() > min(_EDGE, _LOST * before[same].min(initial=1.0)):
        return ""
    shown = f"{pole.real:.3g}" if pole.imag == 0.0 else f"{pole.real:.3g} ± {abs(pole.imag):.6g}j"
    return f"almost unstable: a pole at {shown} rad/s with decay rate {-pole.real:.2g}; set min_decay_rate="


def channel_norm(loop: Lti, plant: GeneralizedPlant, K: Lti, channel: Channel) -> NormBounds:
    """Return the verified norm of a channel of a loop."""
    if channel.norm == "hinf":
        return matrices_norm(ClosedLoop(channel_of(plant, channel).system, K))
    part = loop.between(*signal_indices(plant, channel))
    return matrices_h2_norm(replace(part, D=np.zeros_like(part.D)))


def lower_bound(
    plants: list[GeneralizedPlant], values: list[tuple[float, int, Channel]], limit: float
) -> tuple[float, str]:
    """Return a lower bound on the norm for controllers of any order, and its source, or the reason why there is none.

    Parameters
    ----------
    plants : list of GeneralizedPlant
    values : list of (float, int, Channel)
        Norm reached, plant and channel of every objective.
    limit : float
        Time limit in total [s].
    """
    best, said, reasons = 0.0, "", []
    deadline = Deadline(limit)
    for value, model, channel in sorted(values, key=lambda item: item[0], reverse=True)[:_MOST_BOUNDS]:
        plant = channel_of(plants[model], channel)
        try:
            bound = _bound(plant, channel, deadline)
        except (SynthesisError, np.linalg.LinAlgError, ValueError, ArithmeticError) as error:
            reasons.append(str(error))
            continue
        if bound > value * (1.0 + LEVEL):
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
    lower, notes = full_order_bound(plant, deadline)
    if lower == 0.0 and notes:
        raise SynthesisError(f"full-order synthesis of a relaxed problem reaches zero; {notes}")
    return lower


def limit_ratio(norm: ChannelNorm) -> float:
    """Return a norm over its limit, if any."""
    return norm.value / (norm.channel.limit or 1.0)


def verified(search: Search, worst: "ChannelNorm | None", stages: tuple[str, ...]) -> TuneResult:
    """Return the best controller of a search, verified with the plants passed by the user.

    Raises
    ------
    SynthesisError
        If it cannot be verified, or exceeds a limit or a bound.
    """
    problem, x, labels = search.problem, search.design, search.problem.plants.labels
    tell("verifying")
    plants = problem.plants.original(x[problem.physical])
    K = replace(problem.lti(x).balanced(), scales=plants[0].system.scales)
    loops = [loop_of(plant, K) for plant in plants]
    norms = [
        (i, ChannelNorm(label, channel, channel_norm(loop, plant, K, channel)))
        for i, (label, plant, loop) in enumerate(zip(labels, plants, loops, strict=True))
        for channel in problem.channels
    ]
    aims = [item for item in norms if problem.constraints_alone or item[1].channel.limit is None]
    largest, top = max(aims, key=lambda pair: limit_ratio(pair[1]))
    point = Point(problem, x, search.known)
    used_up = _used_up(problem, x, _bounds(problem, K, loops), [item for _, item in norms])
    if problem.plants.physical:
        lower, reason = 0.0, "none: the plant itself is tuned"
    else:
        tell("bound on any controller")
        lower, reason = lower_bound(list(plants), [(item.value, i, item.channel) for i, item in aims], _BOUND_TIME)
    near = [
        p for p in point.active_functions(_ACTIVE) if p.value >= (0.0 if p.limit else point.aim) + log(1.0 - _ACTIVE)
    ]
    tops = sorted((p for p in near if p.top and not p.limit), key=lambda p: -p.value)
    certificate = DesignCertificate(
        norm_bounds=top.norm,
        channel_norms=tuple(item for _, item in norms),
        spectral_abscissa=max((float(loop.poles.real.max()) for loop in loops if len(loop.A)), default=-inf),
        lower_bound=lower,
        lower_bound_source=reason,
        fastest_pole=float(np.abs(K.poles).max(initial=0.0)),
        active_peaks=tuple(
            ActivePeak(labels[p.model], c := problem.channels[p.channel], p.omega, exp(p.value) * (c.limit or 1.0))
            for p in tops
        ),
        stationarity=stationarity(near, point, problem.low, problem.high),
        active_constraints=used_up,
        stages=stages,
        summary="",
        worst_case=None if worst is None else max((worst, top), key=limit_ratio),
    )
    slowest = problem.ports.slowest
    edges = [note for plant, loop in zip(plants, loops, strict=True) if (note := edge_of(plant, loop, slowest))]
    return TuneResult(
        K,
        tuple(replace(loop, state_labels=()) for loop in loops),
        largest,
        top.value,
        replace(certificate, summary=_summary(certificate, top, search, edges)),
        problem.values(x),
        problem.physical_values(x),
        tuple(search.starts),
        labels,
        plants,
        search.deadline.elapsed,
    )


def _bounds(problem: Problem, K: Lti, loops: list[Lti]) -> list[tuple[str, float, float]]:
    """Return the specified bounds on the verified controller and loops, their values and relative excesses."""
    poles, rate = np.concatenate([loop.poles for loop in loops]), problem.ports.rate
    result = []
    for kind, limit in problem.limits.items():
        if kind == GAIN_LIMIT:  # the peak of the response; an unstable controller has no norm
            value = (level_norm if (K.poles.real > 0.0).any() else matrices_norm)(K).value
            excess = value / limit - 1.0
        elif kind == FASTEST_POLE:
            value = float(np.abs(K.poles).max(initial=0.0))
            excess = value / limit - 1.0
        else:
            value = float((-np.real(poles) / (np.abs(poles) if kind == DAMPING else 1.0)).min(initial=inf))
            excess = (limit - value) / (1.0 if kind == DAMPING else rate)
        result.append((f"{BOUNDS[kind]} = {limit}", value, excess))
    return result


def _used_up(
    problem: Problem, x: Array, bounds: list[tuple[str, float, float]], norms: list[ChannelNorm]
) -> tuple[str, ...]:
    """Return the active bounds; raise an error if one is exceeded."""
    result = []
    for item, number, low, high in zip(problem.free, x, problem.low, problem.high, strict=True):
        for end, name in ((low, "minimum"), (high, "maximum")):
            if abs(number - end) <= LEVEL * (high - low):
                away = f"{item.name} diverges: infimum at infinite gain; set max_gain"
                result.append(away if item.kind == GAIN else f"{item.name} at its {name}, {item.value(number):.6g}")
    for text, value, excess in bounds:
        if excess > CERTIFIED:
            raise SynthesisError(f"no controller found satisfies {text}: it reaches {value:.6g}")
        result += [text] if excess > -_ACTIVE else []
    for norm in norms:
        if norm.channel.limit is None:
            continue
        if limit_ratio(norm) > 1.0 + CERTIFIED:
            none = "no controller found meets its limit"
            what = "no controller found meets all limits" if problem.constraints_alone else none
            where = f", {norm.model}" if norm.model else ""
            value = f"is {norm.value:.6g}, limit {norm.channel.limit:.6g}"
            raise SynthesisError(f"{what}: {norm.channel.text}{where} {value}")
        if limit_ratio(norm) > 1.0 - _ACTIVE and not problem.constraints_alone:
            result.append(f"limit of the {norm.channel.text}")
    return tuple(dict.fromkeys(result))


def _summary(c: DesignCertificate, top: ChannelNorm, search: Search, edges: list[str]) -> str:
    models = len(search.problem.plants.models)
    kind = "verified" if top.norm.verified else f"between {top.norm.lower_bound:.6g} and {top.norm.upper_bound:.6g}"
    over = f", the largest of {models} models" if models > 1 else ""
    said = [f"{top.channel.text} {top.value:.6g}{over}, {kind}"]
    if c.lower_bound > 0.0:
        said.append(f"at most {percent(c.optimality_gap)} above {c.lower_bound:.6g}, the lower bound for any order")
    else:
        said.append(f"no lower bound: {c.lower_bound_source.removeprefix('none: ')}")
    same = sum(isfinite(s.objective) and abs(s.objective / exp(search.value) - 1.0) < _ACTIVE for s in search.starts)
    said.append(f"first-order optimality {c.stationarity:.2g} at {counted(len(c.active_peaks), 'active peak')}")
    said.append(f"reached from {same} of {counted(len(search.starts), 'start')}")
    if c.worst_case is not None:
        said.append(f"largest norm found over the family {c.worst_case.value:.6g} ({c.worst_case.model})")
    if c.active_constraints:
        said.append(f"active: {', '.join(c.active_constraints)}")
    return "; ".join([*said, *edges[:1]])
