"""``tune``: controllers of a given structure that minimize the largest norm over all models and channels.

From call to certificate: :func:`tune` makes the plants (``build_plants``) and the ``Problem``; ``search`` runs all starts,
where ``Search.turn`` lowers the peaks of a ``Point`` by ``descend`` and ``Polish.run``; ``verified`` computes the norms of
the original loops (``channel_norm``, ``matrices_norm``) and a bound for any order (``lower_bound``, ``full_order_bound``).
"""

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import replace
from math import exp, inf, nan
from typing import TYPE_CHECKING, Any

import numpy as np

from boomctl.analysis.box.points import pattern_search
from boomctl.analysis.norm import UNSTABLE, NormBounds
from boomctl.arrays import Array
from boomctl.checks import function_of, instance, known, positive, sequence, whole, within
from boomctl.exceptions import SynthesisError
from boomctl.progress import Deadline, Listener, computing, tell
from boomctl.structure.families import Family
from boomctl.synthesis.assumptions import check_hidden_modes
from boomctl.synthesis.certificate import ChannelNorm
from boomctl.synthesis.plants.channels import Channel, objective
from boomctl.threads import one_blas_thread
from boomctl.tunable.structures import ControllerForm, Physical, terms
from boomctl.tuning.certificate import channel_norm, limit_ratio, loop_of, verified
from boomctl.tuning.initial import initial_numbers
from boomctl.tuning.plants import FamilyPlants, build_plants
from boomctl.tuning.problem import BOUNDS, DAMPING, GAIN_LIMIT, Problem
from boomctl.tuning.result import TuneResult
from boomctl.tuning.solver.search import TIME_OVER, Search, search

if TYPE_CHECKING:
    from boomctl.lti.system import Controller

_WORSE = 1e-3  # accepted relative excess of the worst norm over the family above that at the tuned points
_MORE_POINTS = 8  # worst points added to a family's vertices at most
_AGAIN = 3  # starts for each added point, including the best controller so far


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
    """Tune a controller of a given structure to minimize a norm of the closed loop.

    From each start, the closed loops are first stabilized. Then the norm is minimized by nonsmooth descent and by sequential
    quadratic programming over all peaks near the highest one (Apkarian & Noll 2006; Lewis & Overton 2013).  The result is
    the best local minimum of all starts, and is verified independently of the search.

    Parameters
    ----------
    P : control.StateSpace, function, or sequence of them
        Generalized plant, as for `h_infinity`. For several with equal signals, the largest norm is minimized and all
        loops are stabilized.  A function maps the tuned plant parameters, by name, to a plant, or, with
        ``family``, a `SecondOrderModel` of the family.
    nmeas, ncon : int, optional
        Numbers of measurements and controls; both 0 if only plant parameters are tuned.  Optional then, and for results
        of `generalized_plant` or `mixed_sensitivity`.
    structure : ControllerForm
        Structure from `boomctl.tunable`: blocks are connected in parallel by ``+`` and in series by ``*``.
    channels : sequence of Channel, optional
        `boomctl.tunable.objective` and `boomctl.tunable.constraint`; by default one objective, the norm from all
        disturbances to all performance outputs.
    norm : {"hinf", "h2"}
        Norm to minimize if there are no ``channels``.
    n_starts : int
        Number of starts.  An unstructured state-space block is tuned at lower orders first.
    seed : int
        Seed of random starts; the result is reproducible if the time limit is not reached.
    fastest_pole : float, optional
        Maximum magnitude of the controller poles [rad/s].
    max_gain : float, optional
        Upper bound on the H-infinity norm of the controller, in the units of the signals.  Needed if the infimum of the
        norm is approached as the gain tends to infinity.
    min_damping_ratio : float, optional
        Minimum damping ratio of all poles of the loops.
    min_decay_rate : float, optional
        Minimum decay rate of all poles of the loops [rad/s].
    family : AffineFamily or PolynomialFamily, optional
        Plants over a box of parameters.  Tuning starts with the center and the vertices (with more than six uncertain
        parameters, with the center only) and adds worst-case points until a search of the box finds no larger norm.
        Parameters that are a `boomctl.tunable.plant_parameter` of the structure are tuned, the others are uncertain.
    initial_controller : mapping of str to float, control.StateSpace or a design, optional
        Initial controller: free parameters by name, as in `TuneResult.values`; or for a `boomctl.tunable.state_space`
        (also with plant parameters) a controller of at most its order, in scaled signals if the plant is scaled.
    time_limit : float
        Time limit [s], after which the best result so far is returned, as after an interrupt.
    progress : callable, optional
        Called with a `Progress` at each stage. If None, a progress line is shown after 3 s.

    Returns
    -------
    TuneResult
        Controller, closed loops, largest norm ``gamma``, results of all starts, and a certificate.

    Raises
    ------
    TypeError, ValueError
        If a plant is not a continuous, finite system, the signals of models differ, an argument is out of range, a signal or
        parameter is unknown, the start does not match the structure or the signals, or the H2 norm of a channel is infinite
        for every controller of the structure.
    SynthesisError
        If no controller can stabilize a model, or no stabilizing controller of the structure is found within the
        limits.

    Examples
    --------
    >>> import boomctl as bc
    >>> import control
    >>> P = control.ss(-1.0, [[1.0, 0.0, 1.0]], [[1.0], [0.0], [1.0]], [[0, 0, 0], [0, 0, 1], [0, 0.1, 0]])
    >>> design = bc.tune(P, 1, 1, bc.tunable.gain(), n_starts=2)
    >>> best = bc.h_infinity(P, 1, 1)  # of any order; here no better than a gain
    >>> round(design.gamma, 4), round(best.certificate.lower_bound, 4)
    (0.7071, 0.7071)
    """
    if isinstance(nmeas, ControllerForm):
        raise TypeError(
            "nmeas: expected a whole number, got a structure; where nmeas and ncon are left out, structure=..."
        )
    structure = instance("structure", structure, ControllerForm, "a structure of boomctl.tunable")
    listed = _channels(channels, norm)
    bounds = {
        "max_gain": max_gain,
        "fastest_pole": fastest_pole,
        "min_damping_ratio": min_damping_ratio,
        "min_decay_rate": min_decay_rate,
    }
    limits = {
        kind: within(name, bounds[name], 0.0, 1.0) if kind == DAMPING else positive(name, bounds[name])
        for kind, name in BOUNDS.items()
        if bounds[name] is not None
    }
    count, number = whole("n_starts", n_starts), whole("seed", seed, 0)
    deadline = Deadline(positive("time_limit", time_limit))
    counts = _counts(structure, nmeas, ncon)
    with computing("tuning", progress):
        tell("plants")
        over = None if family is None else _family(P, *counts, structure, family)
        plants = build_plants(P, *counts, structure.physicals()) if over is None else over.plants()
        problem = Problem.of(structure, plants, listed, limits)
        _check(problem)
        initial = [] if initial_controller is None else [initial_numbers(problem, initial_controller)]
        result = _searched(problem, count, np.random.default_rng(number), initial, deadline)
        worst, stages = None, [*problem.plants.stages, *result.stages]
        if over is not None and over.uncertain:
            result, worst = _over_family(over, result, number, stages)
        return verified(result, worst, tuple(stages))


def _channels(channels: "Sequence[Channel] | None", norm: str) -> tuple[Channel, ...]:
    if channels is None:
        return (objective(norm=norm),)
    if norm != "hinf":
        raise ValueError(f"norm = {norm!r}: expected none with channels, which have their own norms")
    result = tuple(instance("channel", item, Channel) for item in sequence("channels", channels, "Channel"))
    if not result:
        raise ValueError("channels: expected at least one")
    return result


def _counts(structure: ControllerForm, nmeas: int | None, ncon: int | None) -> tuple[int | None, int | None]:
    """Return the numbers of measurements and controls, None if they follow from names.

    Both are zero if only plant parameters are tuned.
    """
    names = [item.name for item in structure.physicals()]
    for name in names:
        if names.count(name) > 1:
            raise ValueError(f"structure: the plant parameter {name!r} is there twice")
    passive = all(isinstance(part, Physical) for part in terms(structure))
    counts = [
        (what, n, whole(what, n, 0 if passive else 1))
        for what, n in (("nmeas", nmeas), ("ncon", ncon))
        if n is not None
    ]
    if passive and any(n for _, n, _ in counts):
        raise ValueError(f"nmeas, ncon = {nmeas}, {ncon}: expected 0, 0 for a structure of plant parameters alone")
    return (0, 0) if passive else (nmeas, ncon)


def _family(
    P: Any, nmeas: int | None, ncon: int | None, structure: ControllerForm, family: "Family | None"
) -> FamilyPlants:
    checked = instance("family", family, Family, "AffineFamily or PolynomialFamily")
    make = function_of("P", P, "a structure of the family to a generalized plant")
    for item in structure.physicals():
        known("parameter of the family", item.name, checked.names)
        low, high = checked.ranges[item.name]
        if item.low < low or item.high > high:
            raise ValueError(
                f"plant parameter {item.name!r} from {item.low:g} to {item.high:g}: expected a range within the family's,"
                f" {low:g} to {high:g}"
            )
    return FamilyPlants(checked, make, nmeas, ncon, structure.physicals())


def _check(problem: Problem) -> None:
    """Check signals, stabilizability and detectability, and that norms and gains are finite."""
    plants, channels = problem.plants.middle, problem.channels
    problem.structure.check(problem.ports)
    for label, plant in zip(problem.plants.labels, plants, strict=True):
        if plant.ncon and not problem.plants.physical:
            try:
                for kind, part in (("control", plant), ("measurement", plant.dual)):
                    check_hidden_modes(kind, part.A, part.B2, part.controls, plant.system.state_labels)
            except SynthesisError as error:
                raise SynthesisError(f"{label}: {error}" if label else str(error)) from None
    x = problem.clipped(problem.middle + 0.1 * np.random.default_rng(0).normal(size=len(problem.free)))
    K, n = problem.matrix.value(x), problem.order
    for channel, columns, rows in zip(channels, problem.columns, problem.rows, strict=True):
        for plant in plants if channel.norm == "h2" else ():
            if plant.D11[np.ix_(rows, columns)].any():
                raise ValueError(
                    f"{channel.text}: infinite for every controller because of a direct feedthrough; "
                    "filter the disturbance or omit the signal"
                )
            if (plant.D12[rows] @ K[n:, n:] @ plant.D21[:, columns]).any():
                raise ValueError(
                    f"{channel.text}: infinite through a feedthrough of the controller; "
                    "expected a strictly proper structure, or filters"
                )
    if GAIN_LIMIT in problem.limits and n and np.abs(np.linalg.eigvals(K[:n, :n])).min() == 0.0:
        raise ValueError("max_gain: the structure integrates, so that its gain has no limit at low frequency")


def _searched(
    problem: Problem, starts: int, rng: np.random.Generator, initial: list[Array], deadline: Deadline
) -> Search:
    """Run a search and return it.

    Raises
    ------
    SynthesisError
        If no controller that stabilizes is found.
    """
    with np.errstate(all="ignore"), warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # from rejected trial points
        result = search(problem, starts, rng, deadline, initial)
    if result.best is None:
        ended = {"stopped": " before it was stopped", TIME_OVER: " in the time allowed"}
        when = ended.get((result.stages or [""])[-1], "")
        many = " all models" if len(problem.plants.models) > 1 else ""
        near = f"; smallest spectral abscissa reached: {result.abscissa:.4g} rad/s"
        raise SynthesisError(
            f"no controller of this structure was found that stabilizes{many}{when}"
            f"{near if result.abscissa < inf else ''}"
        )
    return result


def _over_family(
    over: FamilyPlants, current: Search, seed: int, stages: list[str]
) -> "tuple[Search, ChannelNorm | None]":
    """Repeat the search with the worst points of the family as models, until none is worse."""
    worst = None
    for extra in range(_MORE_POINTS + 1):
        plants, deadline = current.problem.plants, current.deadline
        tell("worst point of the family")
        excess, point, worst = _worst(over, current)
        if excess <= _WORSE:
            stages.append(f"nothing worse in the family, {len(plants.models)} points")
            break
        more = over.model(point)
        if extra == _MORE_POINTS or "stopped" in current.stages or deadline.over:
            stages.append(f"worse by {100.0 * excess:.3g} % at {more.label}")
            break
        stages.append(f"added {more.label}")
        problem = replace(current.problem, plants=replace(plants, models=(*plants.models, more)))
        try:
            again = _searched(problem, _AGAIN, np.random.default_rng(seed + extra + 1), [current.design], deadline)
        except SynthesisError:
            stages.append("found nothing with it")
            break
        again.earlier = current.starts
        stages += again.stages
        current = again
    return current, worst


def _worst(over: FamilyPlants, result: Search) -> tuple[float, Array, ChannelNorm]:
    """Return the relative excess of a family's worst point over the tuned ones, that point, and its largest objective."""
    problem, size = result.problem, len(over.uncertain)
    K, values = problem.lti(result.design), problem.physical_values(result.design)
    aims = [item for item in problem.channels if problem.constraints_alone or item.limit is None]

    def norms(point: Array) -> list[tuple[float, ChannelNorm]]:
        plant = over.plant(values, point)
        try:
            loop = loop_of(plant, K)
        except SynthesisError:
            bad = NormBounds(inf, inf, nan, UNSTABLE)
            return [(inf, ChannelNorm(over.model(point).label, item, bad)) for item in problem.channels]
        there = [ChannelNorm(over.model(point).label, c, channel_norm(loop, plant, K, c)) for c in problem.channels]
        return [
            (limit_ratio(item) / (exp(result.value) if item.channel in aims else 1.0) - 1.0, item) for item in there
        ]

    def of_aims(point: Array) -> tuple[float, ChannelNorm]:
        """Return the largest objective, excluding constraints."""
        return max((item for item in norms(point) if item[1].channel in aims), key=lambda pair: pair[0])

    point, most, _ = pattern_search(lambda d: max(item[0] for item in norms(d)), size)
    at = point if len(aims) == len(problem.channels) else pattern_search(lambda d: of_aims(d)[0], size)[0]
    return most, point, max((of_aims(d) for d in (point, at)), key=lambda pair: pair[0])[1]
