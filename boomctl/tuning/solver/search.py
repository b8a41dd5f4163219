"""Multistart search: stabilize, descend and polish until convergence; the best result is stored."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from math import exp, inf, isfinite

import numpy as np

from boomctl.analysis.norm import level_norm
from boomctl.arrays import Array
from boomctl.lti.rounding import ALIKE, LEVEL, ROOT
from boomctl.lti.system import Lti
from boomctl.progress import Deadline, OutOfTimeError, tell
from boomctl.tuning.initial import QUIET
from boomctl.tuning.point import Point
from boomctl.tuning.problem import Problem
from boomctl.tuning.solver.descent import descend
from boomctl.tuning.solver.polish import Polish

_STABILIZING = 300  # steps of the descent of the spectral abscissa at most
_DESCENDING, _POLISHING = 5, 60  # steps of a descent and of a polish at most; polishing is more efficient
_LEVELS = (-2.0, 1.0)  # decimal exponents between which random gains are drawn, over their natural size
TIME_OVER = "stopped: time limit"  # stage of a search whose time is over
_NEARBY = "near order"  # origin of a start near the optimum of a lower order
_FINISHED = 2  # starts that are completed: the best after their first round
_BEGINNING = 0.5  # fraction of the time limit for first rounds of all starts
_LOWER = 0.5  # fraction of the time limit for the next lower order, whose optimum is a start
_HOPE = 4.0  # rounds with the last decrease within which a local search must be able to reach the best value
_ROUNDS = 6  # rounds of descent and polish at most
_MIN_DECREASE = 1e-11  # smallest relative predicted decrease of a step
_WEIGHT = 10.0  # initial penalty weight of constraint violations; it grows until the constraints are satisfied
_EDGE, _LAST_EDGE = 1e-2, 1e-8  # initial and final relative distance from the edge of stability
_AT_EDGE = 2.0  # ratio to the required distance from the edge of stability up to which that constraint is active
_NEARER = 0.1  # factor on the distance from the edge of stability for the next round


@dataclass(frozen=True)
class TuneStart:
    """Result of one start.

    Attributes
    ----------
    origin : str
        Origin of the start.
    objective : float
        Final objective; ``inf`` if no stabilizing controller within the bounds was found.
    nit : int
        Number of steps.
    """

    origin: str
    objective: float
    nit: int


@dataclass
class LocalSearch:
    """State of a local search; merits and values are logarithms, ``gain`` is the decrease of the last round."""

    kind: str
    x: Array
    open: bool = False
    value: float = inf
    merit: float = inf
    gain: float = inf
    weight: float = _WEIGHT
    edge: float = _EDGE
    steps: int = 0


@dataclass
class Search:
    """Multistart search that can be interrupted at any time.

    Attributes
    ----------
    problem : Problem
    deadline : Deadline
    """

    problem: Problem
    deadline: Deadline
    best: Array | None = None
    value: float = inf
    excess: float = inf
    abscissa: float = inf
    earlier: list[TuneStart] = field(default_factory=list)
    searches: "list[LocalSearch]" = field(default_factory=list)
    known: dict[tuple[int, int], Array] = field(default_factory=dict)
    stages: list[str] = field(default_factory=list)

    def point(self, x: Array, edge: float | None = None) -> Point:
        """Return the loops at free parameters; raise `OutOfTimeError` after the time limit."""
        if self.deadline.over:
            raise OutOfTimeError
        return Point(self.problem, x, self.known, edge)

    def keep(self, point: Point) -> tuple[Point, bool]:
        """Verify the peaks of a point, and store it if it is the best so far: by constraint violation, then by objective.

        Return it with all its peaks, and True if these were known. New peaks come from the Hamiltonian matrix.
        """
        if not point.stable or not isfinite(point.aim):
            return point, True
        complete = True
        for model, channel, omega, value, _ in point.norms:
            if channel < 0 or np.isnan(omega):
                continue
            loop, rows, columns = point.loop(model), self.problem.rows[channel], self.problem.columns[channel]
            norm = level_norm(Lti(loop.A, loop.B[:, columns], loop.C[rows], loop.D[np.ix_(rows, columns)]))
            here = exp(value + self.problem.offset(channel))
            if norm.lower_bound > here * (1.0 + ROOT) and isfinite(norm.peak_omega):
                self.known[model, channel] = np.append(self.known.get((model, channel), np.zeros(0)), norm.peak_omega)
                complete = False
        point = point if complete else point.with_parameters(point.x)
        excess = max(point.excess, LEVEL)
        if (excess, point.aim) < (self.excess, self.value):
            self.best, self.value, self.excess = point.x.copy(), point.aim, excess
        return point, complete

    @property
    def design(self) -> Array:
        """Best free parameters; the search must have found a controller."""
        assert self.best is not None
        return self.best

    @property
    def starts(self) -> list[TuneStart]:
        """Results of all starts, with those of earlier searches first."""
        ended = [(item.kind, exp(item.value) if item.value < inf else inf, item.steps) for item in self.searches]
        return self.earlier + [TuneStart(*item) for item in ended]

    def from_starts(self, initial: list[tuple[str, Array]], reached: float) -> None:
        """Run a first round from all starts, then complete the best few.

        Starts near the optimum of the next lower order, with value ``reached``, are used only without a better result.
        """
        order, half = f"order {self.problem.order}", _fraction_of(self.deadline, _BEGINNING)
        for k, (kind, x) in enumerate(initial):
            if kind.startswith(_NEARBY) and self.value < reached - LEVEL:
                continue
            tell(f"{order}, start", k + 1, len(initial))
            local = LocalSearch(kind, self.problem.clipped(x))
            self.searches.append(local)
            result, local.steps = self.stabilized(local.x)
            if result is not None:
                local.x, local.open = result, True
                self.keep(Point(self.problem, result, self.known))
                self.turn(local)
            if self.best is not None and half.over:
                self.stages.append(f"time for {k + 1} starts")
                break
        for k, local in enumerate(sorted(self.searches, key=lambda item: item.value)[:_FINISHED]):
            tell(f"{order}, finishing", k + 1, _FINISHED)
            for _ in range(_ROUNDS):
                if not local.open or (local.value - self.value > _HOPE * local.gain and local.value > self.value):
                    break  # converged, or the best value is out of reach
                self.turn(local)

    def turn(self, local: "LocalSearch") -> None:
        """Run a round: descend on the highest peak (first round only), then polish, away from the edge of stability."""
        edge, before, problem = min(local.edge, 0.5 * self.point(local.x).edge_distance), local.merit, self.problem
        active_edge = edge if edge >= _LAST_EDGE else None
        if before == inf:

            def merit(x: Array) -> tuple[float, Callable[[], Array]]:
                return self.point(x, active_edge).merit(local.weight)

            down = descend(merit, local.x, problem.low, problem.high, steps=_DESCENDING, gain=LEVEL)
            local.x, local.steps = down.x, local.steps + down.steps
        polish = Polish(lambda x: self.point(x, active_edge), local.x, weight=local.weight, gain=_MIN_DECREASE)
        done = polish.run(_POLISHING)
        if polish.weight > local.weight:  # merits of different weights are not comparable
            local.weight, before = polish.weight, inf
        local.x, local.steps, local.merit = done.x, local.steps + done.steps, done.value
        point, complete = self.keep(Point(self.problem, local.x, self.known))
        if point.excess > LEVEL:
            local.weight *= 10.0
            local.gain = local.merit = inf  # merits of different weights are not comparable
            return
        local.value = min(local.value, point.aim)
        local.gain = before - done.value if complete else inf
        local.open = local.gain >= LEVEL
        if active_edge is not None and point.edge_distance < _AT_EDGE * active_edge:  # continue with a smaller distance
            local.edge, local.open = _NEARER * active_edge, True
        elif complete and done.stationary:
            local.gain = 0.0  # converged to rounding level

    def stabilized(self, x: Array) -> tuple[Array | None, int]:
        """Return free parameters at which all loops are stable, by descent of the spectral abscissa, and the steps."""
        if self.point(x).stable:
            return x, 0

        def enough(x: Array, value: float) -> bool:
            return value < 0.0 and self.point(x).stable

        result = descend(
            lambda x: self.point(x).abscissa(),
            x,
            self.problem.low,
            self.problem.high,
            steps=_STABILIZING,
            gain=ALIKE,
            enough=enough,
        )
        end = self.point(result.x)
        if end.well_posed:
            self.abscissa = min(
                self.abscissa, max(end.loop(i).abscissa for i in range(len(self.problem.plants.models)))
            )
        return (result.x if end.stable else None), result.steps


def search(
    problem: Problem,
    starts: int,
    rng: np.random.Generator,
    deadline: Deadline,
    first: list[Array],
) -> Search:
    """Search from all starts; return the search also after the time limit or an interrupt.

    Parameters
    ----------
    problem : Problem
    starts : int
    rng : Generator
    deadline : Deadline
    first : list of ndarray
        User-defined starts.
    """
    work = Search(problem, deadline)
    try:
        initial: list[tuple[str, Array]] = [("given", x) for x in first]
        less, reached = problem.structure.lower(), -inf
        if less is not None and (starts > 1 or not first):
            small = replace(problem, structure=less)
            # the same search as a call for that order: the same starts and random numbers
            inner = search(small, starts, rng, _fraction_of(deadline, _LOWER), [])
            work.stages += [f"order {small.order}: {stage}" for stage in inner.stages]
            if inner.best is not None:
                work.stages.append(f"from order {small.order}: {exp(inner.value):.6g}")
                reached = inner.value
                for name, size in (("order", 0.0), (_NEARBY, QUIET)):  # the same controller, and one near it
                    x = problem.structure.grown(inner.best, problem.ports, rng, size)
                    initial.append((f"{name} {small.order}", x))
            if "stopped" in inner.stages or deadline.over:
                for _, x in initial:
                    work.keep(Point(problem, problem.clipped(x), work.known))
                work.stages.append("stopped" if "stopped" in inner.stages else TIME_OVER)
                return work
        for k in range(max(starts - len(initial), 1)):
            level = float(10.0 ** rng.uniform(*_LEVELS)) if k else QUIET
            initial.append(("random" if k else "low-gain", problem.structure.drawn(problem.ports, rng, level, k == 0)))
        work.from_starts(initial, reached)
    except OutOfTimeError:
        work.stages.append(TIME_OVER)
    except KeyboardInterrupt:
        work.stages.append("stopped")
    return work


def _fraction_of(deadline: Deadline, fraction: float) -> Deadline:
    return Deadline(fraction * max(deadline.limit - deadline.elapsed, 0.0))
