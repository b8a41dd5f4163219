"""``tune``: controllers of a given structure, the largest norm over all models and channels as small as can be found."""

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from math import exp, inf, isfinite, log, nan
from typing import TYPE_CHECKING, Any

import numpy as np

from boomctl.analysis.box.points import pattern_search
from boomctl.analysis.norm import UNSTABLE, NormBounds
from boomctl.arrays import Array
from boomctl.checks import function_of, instance, known, positive, sequence, whole, within
from boomctl.exceptions import SynthesisError
from boomctl.lti.rounding import CERTIFIED
from boomctl.printing import count as counted
from boomctl.progress import Deadline, Listener, computing, tell
from boomctl.structure.families import Family
from boomctl.synthesis.assumptions import check_detectable, check_stabilizable
from boomctl.synthesis.certificate import ActivePeak, ChannelNorm, DesignCertificate
from boomctl.synthesis.plants.channels import Channel, objective, places
from boomctl.synthesis.plants.partition import GeneralizedPlant
from boomctl.threads import one_blas_thread
from boomctl.tunable.structures import GAIN, ControllerForm, Decentralized, Ports, Series, Sum
from boomctl.tuning.certificate import channel_norm, edge_of, loop_of, lower_bound
from boomctl.tuning.initial import initial_numbers
from boomctl.tuning.plants import FamilyPlants, Plants, made_plants
from boomctl.tuning.point import DAMPING, DECAY, FASTEST_POLE, GAIN_LIMIT, Point
from boomctl.tuning.problem import Problem, ports_of
from boomctl.tuning.result import TuneResult
from boomctl.tuning.solver.bundle import stationarity
from boomctl.tuning.solver.search import Search, search

if TYPE_CHECKING:
    from boomctl.lti.system import Controller

_LARGEST_GAIN = 1e6  # times its natural size, beyond which no free number goes: an infimum at infinite gain (a choice)
_TELLING = 10.0  # times a bound up to which a norm so far above it says something of it (a choice)
_ACTIVE = 1e-3  # share of a norm or of a bound within which a peak or bound is active (a choice)
_AT_END = 1e-6  # share of a range within which a number rests at its end (a choice)
_WORSE = 1e-3  # how much worse than at the points tuned for the family may be, relative (a choice)
_MORE_POINTS = 8  # worst points that are added to a family's corners at most (a choice of patience)
_AGAIN = 3  # starts with each point added, the best so far among them (a choice)
_BOUND_TIME = 20.0  # s that the bound on any controller may take beyond the time limit (a choice)


@one_blas_thread
def tune(
    P: Any,
    nmeas: int | None = None,
    ncon: int | None = None,
    structure: ControllerForm | None = None,
    *,
    channels: "Sequence[Channel] | None" = None,
    norm: str = "hinf",
    n_starts: int = 10,
    seed: int = 0,
    fastest_pole: float | None = None,
    max_gain: float | None = None,
    min_damping_ratio: float | None = None,
    min_decay_rate: float | None = None,
    family: "Family | None" = None,
    initial_controller: "Mapping[str, float] | Controller | None" = None,
    time_limit: float = 60.0,
    progress: "Listener | None" = None,
) -> TuneResult:
    """Return the controller of a given structure that makes a norm of the closed loop as small as can be found.

    From many starts the loops are stabilized, then the norm is brought down by descent on its highest peak and by
    quadratic programmes over all peaks near the highest, in turn (Apkarian & Noll 2006; Lewis & Overton 2013).  The
    minimum is a local one: the best of all starts.  The controller returned is verified apart from the search.

    Parameters
    ----------
    P : control.StateSpace, function, or sequence of them
        Generalized plant, as for `h_infinity`; of several, with the same signals, the largest norm counts and all are to
        be stable.  A function returns one: from a mapping of the physical parameters of the structure, or, with
        ``family``, from a `SecondOrderModel` of the family.
    nmeas, ncon : int, optional
        Numbers of measurements and controls; both 0 where only physical parameters are tuned.  Not needed there, nor of
        what `generalized_plant` or `mixed_sensitivity` made, whose names tell them.
    structure : ControllerForm
        What the controller is made of, from `boomctl.tunable`: parts can be added, and put in series by ``*``.
    channels : sequence of Channel, optional
        `boomctl.tunable.objective` and `boomctl.tunable.constraint`; by default one objective, the whole loop.
    norm : {"hinf", "h2"}
        Which norm, where no channels are given.
    n_starts : int
        Number of starts.  Lower orders of a free state-space part are tuned on the way.
    seed : int
        Of the starts drawn; the same seed gives the same controller, if the time limit does not interfere.
    fastest_pole : float, optional
        No pole of the controller has a larger magnitude [rad/s].
    max_gain : float, optional
        Largest singular value of the controller's response at any frequency, in the units of the signals.  Some norms have
        their infimum at infinite gain.
    min_damping_ratio : float, optional
        Least damping ratio of all poles of the loops.
    min_decay_rate : float, optional
        All poles of the loops lie left of ``-decay`` [rad/s].
    family : AffineFamily or PolynomialFamily, optional
        Structures over a box of parameters.  The middle and the corners, of more than six uncertain parameters the middle
        alone, are tuned for at first, then the worst points that a search over the box finds too, until none is worse.
        Parameters that are `boomctl.tunable.plant_parameter` ones of the
        structure are tuned, the others are uncertain.
    initial_controller : mapping of str to float, control.StateSpace or a design, optional
        A start of your own: free numbers by name, as `TuneResult.values` holds them; where the structure is a
        `boomctl.tunable.state_space` (physical parameters may be added to it), a controller of its order or of a lower one.
        In the scaled signals of a scaled plant.
    time_limit : float
        Seconds after which the best so far is returned; so it is when the user interrupts.
    progress : callable, optional
        Is told a `Progress` at each stage.  Without one, after three seconds a line on a terminal or in a notebook says
        what goes on; `progress_callback` hears whatever runs within it.

    Returns
    -------
    TuneResult
        The controller, the closed loops, the largest norm ``gamma``, all starts, and a certificate.

    Raises
    ------
    TypeError, ValueError
        Another kind of system, not finite, discrete time; models with different signals; counts or numbers out of range;
        unknown signals or parameters; a start of another structure, order or with other signals; a channel whose H2 norm is
        infinite for every controller of the structure.
    SynthesisError
        No controller can stabilize a model, none of the structure was found that does, or none that keeps the budgets.

    Examples
    --------
    >>> import boomctl as bc
    >>> import control
    >>> P = control.ss(-1.0, [[1.0, 0.0, 1.0]], [[1.0], [0.0], [1.0]], [[0, 0, 0], [0, 0, 1], [0, 0.1, 0]])
    >>> design = bc.tune(P, 1, 1, bc.tunable.gain(), n_starts=2)
    >>> best = bc.h_infinity(P, 1, 1)  # of any order; here it can do no more than a gain
    >>> round(design.gamma, 4), round(best.certificate.lower_bound, 4)
    (0.7071, 0.7071)
    """
    if isinstance(nmeas, ControllerForm):
        raise TypeError(
            "nmeas: expected a whole number, got a structure; where nmeas and ncon are left out, structure=..."
        )
    structure = instance("structure", structure, ControllerForm, "a structure of boomctl.tunable")
    listed = _channels(channels, norm)
    limits = {
        "fastest_pole": None if fastest_pole is None else positive("fastest_pole", fastest_pole),
        "max_gain": None if max_gain is None else positive("max_gain", max_gain),
        "min_damping_ratio": None
        if min_damping_ratio is None
        else within("min_damping_ratio", min_damping_ratio, 0.0, 1.0),
        "min_decay_rate": None if min_decay_rate is None else positive("min_decay_rate", min_decay_rate),
    }
    count, number = whole("n_starts", n_starts), whole("seed", seed, 0)
    deadline = Deadline(positive("time_limit", time_limit))
    nmeas, ncon = _counts(structure, nmeas, ncon)
    with computing("tuning", progress):
        tell("plants")
        over = _family(P, nmeas, ncon, structure, family)
        plants = over.plants(deadline) if over is not None else _plants(P, nmeas, ncon, structure, deadline)
        task = _Task(structure, listed, limits, plants, deadline)
        begun = task.begun(initial_controller)
        result = task.searched(count, np.random.default_rng(number), begun)
        worst, stages = None, [*plants.stages, *result.stages]
        if over is not None and over.uncertain:
            task, result, worst = _over_family(task, over, result, number, stages)
        return _result(task, result, worst, tuple(stages))


def _channels(channels: "Sequence[Channel] | None", norm: str) -> tuple[Channel, ...]:
    if channels is None:
        return (objective(norm=norm),)
    if norm != "hinf":
        raise ValueError(f"norm = {norm!r}: expected none beside channels, which say their own")
    result = tuple(instance("channel", item, Channel) for item in sequence("channels", channels, "Channel"))
    if not result:
        raise ValueError("channels: expected at least one")
    return result


def _counts(structure: ControllerForm, nmeas: int | None, ncon: int | None) -> tuple[int | None, int | None]:
    """Return the numbers of measurements and controls, both zero where nothing but physical parameters is tuned.

    Where they are left out, names tell them.
    """
    parts = structure.parts if isinstance(structure, Sum) else (structure,)
    passive = len(structure.physicals()) == len(parts)
    names = [item.name for item in structure.physicals()]
    if len(set(names)) < len(names):
        twice = next(name for name in names if names.count(name) > 1)
        raise ValueError(f"structure: the physical parameter {twice!r} is there twice")
    least = 0 if passive else 1
    if passive and nmeas is None and ncon is None:
        return 0, 0
    result = tuple(None if n is None else whole(what, n, least) for what, n in (("nmeas", nmeas), ("ncon", ncon)))
    if passive and result != (0, 0):
        raise ValueError(
            f"nmeas, ncon = {result[0]}, {result[1]}: expected 0, 0 for a structure of physical parameters alone"
        )
    return result[0], result[1]


def _family(
    P: Any, nmeas: int | None, ncon: int | None, structure: ControllerForm, family: "Family | None"
) -> FamilyPlants | None:
    if family is None:
        return None
    given = instance("family", family, Family, "AffineFamily or PolynomialFamily")
    make = function_of("P", P, "a structure of the family to a generalized plant")
    for item in structure.physicals():
        known("parameter of the family", item.name, given.names)
        i = given.names.index(item.name)
        if item.low < given.low[i] or item.high > given.high[i]:
            raise ValueError(
                f"physical {item.name!r} from {item.low:g} to {item.high:g}: expected a range within the family's,"
                f" {given.low[i]:g} to {given.high[i]:g}"
            )
    return FamilyPlants(given, make, nmeas, ncon, structure.physicals())


def _plants(P: Any, nmeas: int | None, ncon: int | None, structure: ControllerForm, deadline: Deadline) -> Plants:
    many = tuple(P) if isinstance(P, (list, tuple)) else (P,)
    if not many:
        raise ValueError("P: expected at least one generalized plant")
    physical = structure.physicals()
    if physical and not any(callable(item) and not hasattr(item, "ninputs") for item in many):
        function_of("P", many[0], f"the physical parameters ({', '.join(p.name for p in physical)})")
    return made_plants(many, nmeas, ncon, physical, deadline)


@dataclass(frozen=True)
class _Task:
    """What is tuned, for which plants."""

    structure: ControllerForm
    channels: tuple[Channel, ...]
    limits: dict[str, float | None]
    plants: Plants
    deadline: Deadline

    def middle(self) -> tuple[GeneralizedPlant, ...]:
        """Return the plants in the middle of the physical parameters' ranges."""
        return self.plants.given(np.zeros(len(self.plants.physical)))

    @cached_property
    def ports(self) -> Ports:
        """The ports of the controller."""
        result = ports_of(self.middle())
        limit = self.limits["fastest_pole"]
        return (
            result
            if limit is None
            else replace(result, fastest=min(result.fastest, limit), rate=min(result.rate, limit))
        )

    def problem(self, structure: ControllerForm) -> Problem:
        """Return the problem of a structure."""
        ports, plant = self.ports, self.middle()[0]
        free = structure.free(ports)
        ends = np.array([item.ends() for item in free]).reshape(-1, 2)
        gains = np.array([item.kind == GAIN for item in free], dtype=bool)
        low = np.where(gains, np.maximum(ends[:, 0], -_LARGEST_GAIN), ends[:, 0])
        high = np.where(gains, np.minimum(ends[:, 1], _LARGEST_GAIN), ends[:, 1])
        wanted = [places(plant, channel) for channel in self.channels]
        middle = np.where(np.isfinite(low + high) & ~gains, 0.5 * (low + high), 0.0)
        return Problem(
            structure=structure,
            ports=ports,
            free=free,
            low=low,
            high=high,
            plants=self.plants.scaled,
            count=len(self.plants.labels),
            channels=self.channels,
            columns=tuple(np.array(columns) for columns, _ in wanted),
            rows=tuple(np.array(rows) for _, rows in wanted),
            order=structure.system(middle, ports).A.shape[0],
            **self.limits,
        )

    def begun(self, initial: "Mapping[str, float] | Controller | None") -> list[Array]:
        """Return starts that are given, after all has been checked."""
        plants = self.middle()
        self._check_signals(plants[0])
        for label, plant in zip(self.plants.labels, plants, strict=True):
            s, where = plant.system, f"{label}: " if label else ""
            if len(self.plants.physical) == 0 and plant.ncon:
                try:
                    check_stabilizable(plant.A, plant.B2, plant.controls, s.state_labels)
                    check_detectable(plant.A, plant.C2, plant.measurements, s.state_labels)
                except SynthesisError as error:
                    raise SynthesisError(f"{where}{error}") from None
        problem = self.problem(self.structure)
        self._check_norms(problem)
        return [] if initial is None else [initial_numbers(problem, initial, plants[0].system.scales)]

    def _check_signals(self, plant: GeneralizedPlant) -> None:
        for channel in self.channels:
            for what, wanted, there in (
                ("disturbance", channel.inputs, plant.disturbances),
                ("performance signal", channel.outputs, plant.performance),
            ):
                for name in wanted or ():
                    known(what, name, there)
        _check_loops(self.structure, plant.measurements, plant.controls)

    def _check_norms(self, problem: Problem) -> None:
        """Refuse an H2 norm that a feedthrough makes infinite, and a gain limit on an integrator."""
        x = np.random.default_rng(0).normal(size=len(problem.free))
        x = np.where(np.isfinite(problem.low + problem.high), 0.5 * (problem.low + problem.high), 0.0) + 0.1 * x
        K = problem.controller(problem.clipped(x)).value
        n = problem.order
        through = K[n:, n:]
        for channel, columns, rows in zip(self.channels, problem.columns, problem.rows, strict=True):
            if channel.norm != "h2":
                continue
            for plant in self.middle():
                if plant.D11[np.ix_(rows, columns)].any():
                    raise ValueError(
                        f"{channel.text}: infinite for every controller, as a feedthrough leads around it; "
                        "filter the disturbance or leave the signal away"
                    )
                if (plant.D12[rows] @ through @ plant.D21[:, columns]).any():
                    raise ValueError(
                        f"{channel.text}: infinite through a feedthrough of the controller; "
                        "expected a strictly proper structure, or filters"
                    )
        if problem.max_gain is not None and n and np.abs(np.linalg.eigvals(K[:n, :n])).min() == 0.0:
            raise ValueError("max_gain: the structure integrates, so that its gain has no limit at low frequency")

    def searched(self, starts: int, rng: np.random.Generator, begun: list[Array]) -> Search:
        """Return what a search found.

        Raises
        ------
        SynthesisError
            No controller that stabilizes and keeps the budgets.
        """
        problem = self.problem(self.structure)
        with np.errstate(all="ignore"), warnings.catch_warnings():
            warnings.simplefilter("ignore", RuntimeWarning)  # of what is tried and given up
            result = search(problem, starts, rng, self.deadline, begun, self.problem)
        if result.best is None:
            ended = {"stopped": " before it was stopped", "out of time": " in the time allowed"}
            when = ended.get((result.stages or [""])[-1], "")
            many = " all models" if len(self.plants.labels) > 1 else ""
            near = f"; the largest real part of a pole came down to {result.abscissa:.4g} rad/s"
            raise SynthesisError(
                f"no controller of this structure was found that stabilizes{many}{when}"
                f"{near if result.abscissa < inf else ''}"
            )
        return result


def _check_loops(structure: ControllerForm, measurements: tuple[str, ...], controls: tuple[str, ...]) -> None:
    """Refuse a decentralized structure whose signals are not there, or a square one between numbers that differ."""
    if isinstance(structure, Sum):
        for part in structure.parts:
            _check_loops(part, measurements, controls)
    elif isinstance(structure, Decentralized):
        if structure.each is not None and len(measurements) != len(controls):
            raise ValueError(
                f"decentralized: expected as many measurements as controls, got {len(measurements)} and {len(controls)};"
                " name the signals of each loop"
            )
        for ys, us, part in structure.loops:
            for name in ys:
                known("measurement", name, measurements)
            for name in us:
                known("control", name, controls)
            _check_loops(part, ys, us)
    elif structure.square and len(measurements) != len(controls):
        raise ValueError(
            f"structure: a filter without gains between {len(measurements)} measurement(s) and {len(controls)} control(s);"
            " put it in series with a gain"
        )
    elif isinstance(structure, Series):
        for part in (structure.last, structure.first):
            if isinstance(part, Decentralized):
                raise ValueError("structure: decentralized cannot stand in a series; put the series into it")


def _over_family(
    task: _Task, over: FamilyPlants, found: Search, seed: int, stages: list[str]
) -> "tuple[_Task, Search, ChannelNorm | None]":
    """Return the search with the worst points of the family among the models, until none is worse."""
    worst = None
    for extra in range(_MORE_POINTS + 1):
        assert found.best is not None
        tell("worst point of the family")
        excess, point, worst = _worst(task, over, found)
        if excess <= _WORSE:
            stages.append(f"nothing worse in the family, {len(task.plants.labels)} points")
            break
        stopped = "stopped" in found.stages or task.deadline.over
        if extra == _MORE_POINTS or stopped:
            stages.append(f"worse by {100.0 * excess:.3g} % at {over.label(point)}")
            break
        stages.append(f"added {over.label(point)}")
        more = replace(
            task, plants=task.plants.with_more(over.maker(point), over.maker(point, settled=True), over.label(point))
        )
        try:
            again = more.searched(_AGAIN, np.random.default_rng(seed + extra + 1), [found.best])
        except SynthesisError:
            stages.append("found nothing with it")
            break
        again.earlier = found.starts
        stages += again.stages
        task, found = more, again
    return task, found, worst


def _worst(task: _Task, over: FamilyPlants, found: Search) -> tuple[float, Array, ChannelNorm]:
    """Return by how much the worst point of a family is worse than those tuned for, that point, and the norm there."""
    assert found.best is not None
    x, problem = found.best, found.problem
    plants, values = task.middle(), problem.physical_values(x)
    K = problem.lti(x, plants[0].measurements, plants[0].controls)
    aims = [item for item in task.channels if item.budget is None] or list(task.channels)
    top = exp(found.value)

    def norms(point: Array) -> list[tuple[float, ChannelNorm]]:
        plant = over.plant(values, point)
        try:
            loop = loop_of(plant, K)
        except SynthesisError:
            return []
        listed = []
        for channel in task.channels:
            norm = ChannelNorm(over.label(point), channel, channel_norm(loop, plant, K, channel))
            reference = (top if channel.budget is None else 1.0) * (channel.budget or 1.0)
            if channel.budget is not None and channel in aims:
                reference *= top
            listed.append((norm.value / reference - 1.0, norm))
        return listed

    def excess(point: Array) -> float:
        return max((item[0] for item in norms(point)), default=inf)

    def aimed(point: Array) -> tuple[float, ChannelNorm]:
        """Return the worst of what is to be small, which a budget that is worst elsewhere does not show."""
        bad = NormBounds(inf, inf, nan, UNSTABLE)
        shown = [item for item in norms(point) if item[1].channel in aims]
        return max(shown, key=lambda each: each[0], default=(inf, ChannelNorm(over.label(point), aims[0], bad)))

    size = len(over.uncertain)
    point, most, _ = pattern_search(excess, size, 1.0)
    at = point if len(aims) == len(task.channels) else pattern_search(lambda d: aimed(d)[0], size, 1.0)[0]
    return most, point, max((aimed(d) for d in (point, at)), key=lambda each: each[0])[1]


def _share_used(found: ChannelNorm) -> float:
    return found.value / (found.channel.budget or 1.0)


def _result(task: _Task, found: Search, worst: "ChannelNorm | None", stages: tuple[str, ...]) -> TuneResult:
    """Return the best controller, verified from what the user handed in.

    Raises
    ------
    SynthesisError
        It could not be verified, or exceeds a budget.
    """
    assert found.best is not None
    problem, x = found.problem, found.best
    tell("verifying")
    plants = task.plants.given(x[problem.physical])
    K = problem.lti(x, plants[0].measurements, plants[0].controls).balanced()
    K = replace(K, scales=plants[0].system.scales)
    loops = [loop_of(plant, K) for plant in plants]
    norms = tuple(
        (i, ChannelNorm(label, channel, channel_norm(loop, plant, K, channel)))
        for i, (label, plant, loop) in enumerate(zip(task.plants.labels, plants, loops, strict=True))
        for channel in task.channels
    )
    only = all(channel.budget is not None for channel in task.channels)
    aims = [item for item in norms if only or item[1].channel.budget is None]
    largest, top = max(aims, key=lambda each: _share_used(each[1]))
    _check_kept(problem, x, norms)
    passive = len(task.plants.physical) > 0
    values = [(item.value, i, item.channel) for i, item in aims]
    if passive:
        lower, reason = 0.0, "none: the plant itself is tuned"
    else:
        tell("bound on any controller")
        lower, reason = lower_bound(list(plants), values, _BOUND_TIME)
    point = Point(problem, x, found.known)
    active = _active(problem, x, point)
    peaks, least = _peaks(task, problem, point)
    fastest = float(np.abs(K.poles).max(initial=0.0)) if len(K.A) else 0.0
    slowest = max((float(loop.poles.real.max()) for loop in loops if len(loop.A)), default=-inf)
    certificate = DesignCertificate(
        norm_bounds=top.norm,
        channel_norms=tuple(item for _, item in norms),
        spectral_abscissa=slowest,
        lower_bound=lower,
        lower_bound_source=reason,
        fastest_pole=fastest,
        active_peaks=peaks,
        stationarity=least,
        active_constraints=active,
        stages=stages,
        summary="",
        worst_case=None if worst is None else max((worst, top), key=_share_used),
    )
    edges = [told for plant, loop in zip(plants, loops, strict=True) if (told := edge_of(plant, loop))]
    certificate = replace(certificate, summary=_statement(certificate, top, len(plants), least, found, edges))
    named = replace(K, input_labels=plants[0].measurements, output_labels=plants[0].controls)
    return TuneResult(
        named,
        tuple(replace(loop, state_labels=()) for loop in loops),
        largest,
        top.value,
        certificate,
        problem.values(x),
        problem.physical_values(x),
        tuple(found.starts),
        task.plants.labels,
        tuple(plants),
        task.deadline.elapsed,
    )


def _check_kept(problem: Problem, x: Array, norms: "tuple[tuple[int, ChannelNorm], ...]") -> None:
    """Refuse a controller that exceeds a budget or a bound on poles or gains."""
    only = all(channel.budget is not None for channel in problem.channels)
    for _, item in norms:
        budget = item.channel.budget
        if budget is not None and item.value > budget * (1.0 + CERTIFIED):
            what = (
                "the budgets cannot all be kept as far as was found" if only else "no controller found keeps its budget"
            )
            where = f", {item.model}" if item.model else ""
            raise SynthesisError(f"{what}: {item.channel.text}{where} is {item.value:.6g}, allowed are {budget:.6g}")
    point = Point(problem, x)
    for piece in point.bounds:
        if piece.value > CERTIFIED:
            raise SynthesisError(f"no controller found keeps its bound: {_bound_text(problem, piece.channel)}")
    if problem.max_gain is not None:
        value = float(point.norm_peaks(-1, GAIN_LIMIT, 0.0)[1][0])
        if value > problem.max_gain * (1.0 + CERTIFIED):
            raise SynthesisError(f"no controller found keeps max_gain = {problem.max_gain:.6g}: it reaches {value:.6g}")


def _bound_text(problem: Problem, kind: int) -> str:
    return {
        FASTEST_POLE: f"fastest_pole = {problem.fastest_pole}",
        DAMPING: f"min_damping_ratio = {problem.min_damping_ratio}",
        DECAY: f"min_decay_rate = {problem.min_decay_rate}",
        GAIN_LIMIT: f"max_gain = {problem.max_gain}",
    }[kind]


def _active(problem: Problem, x: Array, point: Point) -> tuple[str, ...]:
    """Return the bounds that are used up."""
    result = []
    for item, number, low, high in zip(problem.free, x, problem.low, problem.high, strict=True):
        width = high - low
        for end, name in ((low, "least"), (high, "largest")):
            if abs(number - end) <= _AT_END * width:
                if item.kind == GAIN:
                    result.append(f"{item.name} runs away: an infimum at infinite gain; give gain_limit")
                else:
                    result.append(f"{item.name} at its {name}, {item.value(number):.6g}")
    kinds = {piece.channel for piece in point.bounds if piece.value > -_ACTIVE}
    result += [_bound_text(problem, kind) for kind in sorted(kinds, reverse=True)]
    if problem.max_gain is not None:
        value = float(point.norm_peaks(-1, GAIN_LIMIT, 0.0)[1][0])
        if value > problem.max_gain * (1.0 - _ACTIVE):
            result.append(_bound_text(problem, GAIN_LIMIT))
    for _, c, _, value in point.norms:
        if c >= 0 and problem.channels[c].budget is not None and value > -_ACTIVE and point.is_limit(c):
            text = f"budget of the {problem.channels[c].text}"
            result += [] if text in result else [text]
    return tuple(result)


def _peaks(task: _Task, problem: Problem, point: Point) -> tuple[tuple[ActivePeak, ...], float]:
    """Return the active peaks, highest first, and the length of the least element of the hull of their gradients."""
    pieces = point.pieces(_ACTIVE)
    top = point.aim
    near = [p for p in pieces if p.value >= (0.0 if p.limit else top) + log(1.0 - _ACTIVE)]
    shown = sorted((p for p in near if p.channel >= 0 and p.top and not p.limit), key=lambda p: -p.value)
    result = tuple(
        ActivePeak(
            task.plants.labels[p.model],
            problem.channels[p.channel],
            p.omega,
            exp(p.value) * (problem.channels[p.channel].budget or 1.0),
        )
        for p in shown
    )
    return result, stationarity(near, point, problem.low, problem.high)


def _statement(
    c: DesignCertificate, top: ChannelNorm, models: int, least: float, found: Search, edges: list[str]
) -> str:
    kind = "verified" if top.norm.verified else f"between {top.norm.lower_bound:.6g} and {top.norm.upper_bound:.6g}"
    over = f", the largest of {models} models" if models > 1 else ""
    said = f"{top.channel.text} {top.value:.6g}{over}, {kind}"
    if c.lower_bound > 0.0 and c.optimality_gap <= _TELLING:
        said += (
            f"; at most {100.0 * c.optimality_gap:.2g} % above {c.lower_bound:.6g}, which no controller of any order "
            "beats"
        )
    elif c.lower_bound > 0.0:
        said += f"; controllers of any order might go far lower: not below {c.lower_bound:.3g} is all that is known"
    else:
        said += f"; no bound on other controllers: {c.lower_bound_source.removeprefix('none: ')}"
    same = sum(isfinite(s.objective) and abs(s.objective / exp(found.value) - 1.0) < _ACTIVE for s in found.starts)
    said += f"; stationary to {least:.2g} over {counted(len(c.active_peaks), 'peak')}"
    said += f"; {same} of {len(found.starts)} starts came here"
    if c.worst_case is not None:
        said += f"; over the family {c.worst_case.value:.6g} at most as far as was found ({c.worst_case.model})"
    if c.active_constraints:
        said += f"; used up: {', '.join(c.active_constraints)}"
    if edges:
        said += f"; {edges[0]}"
    return said
