"""The search from many starts: stabilize, descend, polish, in turn until nothing changes; the best so far is kept."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from math import exp, inf, isfinite, log

import numpy as np

from boomctl.analysis.norm import level_norm
from boomctl.arrays import Array
from boomctl.lti.rounding import LEVEL
from boomctl.lti.system import Lti
from boomctl.progress import Deadline, OutOfTimeError, tell
from boomctl.tuning.point import Point
from boomctl.tuning.problem import Problem
from boomctl.tuning.solver.bundle import Polish
from boomctl.tuning.solver.descent import descend

_STABILIZING = 300  # steps of the descent of the spectral abscissa at most (a choice)
_DESCENDING, _POLISHING = 5, 60  # steps of a descent and of a polish at most (choices: polishing gains more a second)
_LEVELS = (-2.0, 1.0)  # powers of ten between which gains are drawn, over their natural size (a choice)
_QUIET = 1e-2  # gains of the quiet start, and of a state more, over their natural size (a choice)
_BESIDE = "beside order"  # origin of a start beside the optimum of a lower order
_FINISHED = 2  # starts that are taken to the end, the best after their first turn (a choice)
_BEGINNING = 0.5  # share of the time in which starts are begun; then the best are finished (a choice)
_LOWER = 0.5  # share of the time for the order below, whose optimum is a start (a choice)
_HOPE = 4.0  # turns that each gain as much as the last which would bring a local search down to the best (a choice)
_ROUNDS = 6  # of both in turn at most (a choice)
_GAIN = 1e-6  # relative gain of ten steps, or of a round, below which nothing changes (a choice)
_PROMISE = 1e-11  # relative gain that a step must promise (a choice)
_WEIGHT = 10.0  # what a unit of an exceeded bound costs at first (a choice); grows until the bounds are kept
_EDGE, _LAST_EDGE = 1e-2, 1e-8  # how far from the edge of stability the first turns stay, and the last ones (choices)
_AT_EDGE = 2.0  # times the distance kept from the edge of stability, up to which it is what held a turn up (a choice)
_NEARER = 0.1  # share of its distance from the edge of stability that a turn may come nearer to it (a choice)
_MISSED = 1e-7  # relative height above the peaks known from which on one counts as missed: a tenth of what is certified
_ZERO = 1e-9  # share of the first norm seen below which a norm counts as zero: nothing is left to gain


class NothingLeftError(Exception):
    """The norm is zero as far as numbers tell."""


@dataclass(frozen=True)
class TuneStart:
    """What one start came to.

    Attributes
    ----------
    origin : str
        How it began.
    objective : float
        The objective that it reached; ``inf`` where no stabilizing controller, or none within the bounds, was found.
    nit : int
        Steps taken.
    """

    origin: str
    objective: float
    nit: int


@dataclass
class LocalSearch:
    """One start on its way; merits and values are logarithms, ``gain`` is that of the last turn."""

    kind: str
    x: Array
    open: bool = False
    value: float = inf
    merit: float = inf
    gain: float = inf
    weight: float = _WEIGHT
    edge: float = _EDGE
    steps: int = 0

    @property
    def start(self) -> TuneStart:
        """What it came to."""
        return TuneStart(self.kind, exp(self.value) if self.value < inf else inf, self.steps)


@dataclass
class Search:
    """A search that can be stopped at any moment.

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
    floor: float = -inf
    abscissa: float = inf
    earlier: list[TuneStart] = field(default_factory=list)
    searches: "list[LocalSearch]" = field(default_factory=list)
    known: dict[tuple[int, int], Array] = field(default_factory=dict)
    stages: list[str] = field(default_factory=list)

    def point(self, x: Array, edge: float | None = None) -> Point:
        """Return the loops at free numbers; out of time where it is."""
        if self.deadline.over:
            raise OutOfTimeError
        return Point(self.problem, x, self.known, edge)

    def keep(self, point: Point) -> tuple[Point, bool]:
        """Remember a point if it is the best so far: within the bounds first, then the lowest.

        Return it with all its peaks, and whether these were known; those that a Hamiltonian matrix shows now are.
        """
        if not point.stable or not isfinite(point.aim):
            return point, True
        point, complete = self._checked(point)
        if self.floor == -inf:
            self.floor = point.aim + log(_ZERO)
        excess = max(point.excess, LEVEL)
        if (excess, point.aim) < (self.excess, self.value):
            self.best, self.value, self.excess = point.x.copy(), point.aim, excess
        if self.value < self.floor:
            raise NothingLeftError
        return point, complete

    def _checked(self, point: Point) -> tuple[Point, bool]:
        """Return a point with all its peaks, and whether these were known."""
        missed = False
        for model, channel, omega, value, _ in point.norms:
            if channel < 0 or np.isnan(omega):
                continue
            loop, rows, columns = point.loop(model), self.problem.rows[channel], self.problem.columns[channel]
            norm = level_norm(Lti(loop.A, loop.B[:, columns], loop.C[rows], loop.D[np.ix_(rows, columns)]))
            here = exp(value + self.problem.offset(channel))
            if norm.lower_bound > here * (1.0 + _MISSED) and isfinite(norm.peak_omega):
                self.known[model, channel] = np.append(self.known.get((model, channel), np.zeros(0)), norm.peak_omega)
                missed = True
        return (point.beside(point.x), False) if missed else (point, True)

    @property
    def design(self) -> Array:
        """The best free numbers, of a search that found some."""
        assert self.best is not None
        return self.best

    @property
    def starts(self) -> list[TuneStart]:
        """What all starts came to, those of searches before this one first."""
        return self.earlier + [item.start for item in self.searches]

    def from_starts(self, begun: list[tuple[str, Array]], reached: float) -> None:
        """Begin from all starts, then finish the best few.

        From beside the optimum of the order below, which ``reached`` some value, only where that itself led no further.
        """
        order, half = f"order {self.problem.order}", _share(self.deadline, _BEGINNING)
        for k, (kind, x) in enumerate(begun):
            if kind.startswith(_BESIDE) and self.value < reached - _GAIN:
                continue
            tell(f"{order}, start", k + 1, len(begun))
            self.begin(self.problem.clipped(x), kind)
            if self.best is not None and half.over:
                self.stages.append(f"time for {k + 1} starts")
                break
        for k, local in enumerate(sorted(self.searches, key=lambda each: each.value)[:_FINISHED]):
            tell(f"{order}, finishing", k + 1, _FINISHED)
            for _ in range(_ROUNDS):
                if not local.open or (local.value - self.value > _HOPE * local.gain and local.value > self.value):
                    break  # nothing changes, or there is no hope to come down to the best
                self.turn(local)

    def begin(self, x: Array, kind: str) -> None:
        """Stabilize from one start, and take a first turn."""
        local = LocalSearch(kind, x)
        self.searches.append(local)
        result, local.steps = self.stabilized(x)
        if result is not None:
            local.x, local.open = result, True
            self.keep(Point(self.problem, result, self.known))
            self.turn(local)

    def turn(self, local: "LocalSearch") -> None:
        """Descend on the highest peak at first, then polish over all near it, away from the edge of stability."""
        edge, before, problem = min(local.edge, 0.5 * self.point(local.x).apart), local.merit, self.problem
        kept = edge if edge >= _LAST_EDGE else None
        if before == inf:

            def merit(x: Array) -> tuple[float, Callable[[], Array]]:
                return self.point(x, kept).merit(local.weight)

            down = descend(merit, local.x, problem.low, problem.high, steps=_DESCENDING, gain=_GAIN)
            local.x, local.steps = down.x, local.steps + down.steps
        hard = -inf if before == inf else _PROMISE  # the last digits are for those that are finished
        polish = Polish(lambda x: self.point(x, kept), local.x, weight=local.weight, gain=_PROMISE, hard=hard)
        done = polish.run(_POLISHING)
        local.x, local.steps, local.merit = done.x, local.steps + done.steps, done.value
        point, complete = self.keep(Point(self.problem, local.x, self.known))
        if point.excess > LEVEL:
            local.weight *= 10.0
            local.gain = local.merit = inf  # merits of two weights tell nothing of each other
            return
        local.value = min(local.value, point.aim)
        local.gain = before - done.value if complete else inf
        local.open = local.gain >= _GAIN
        if kept is not None and point.apart < _AT_EDGE * kept:  # on along it, and nearer
            local.edge, local.open = _NEARER * kept, True
        elif complete and done.stationary:
            local.gain = 0.0  # the last digits alone are left

    def stabilized(self, x: Array) -> tuple[Array | None, int]:
        """Return free numbers at which all loops are stable, found by descending the spectral abscissa."""
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
            gain=1e-9,
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
    """Return the search from all starts, or what it had come to when the time ran out or the user stopped it.

    Parameters
    ----------
    problem : Problem
    starts : int
    rng : Generator
    deadline : Deadline
    first : list of ndarray
        Starts that are given.
    """
    work = Search(problem, deadline)
    try:
        begun: list[tuple[str, Array]] = [("given", x) for x in first]
        less, reached = problem.structure.lower(), -inf
        if less is not None and (starts > 1 or not first):
            small = replace(problem, structure=less)
            # what a call for that order comes to: the same starts and the same numbers drawn
            inner = search(small, starts, rng, _share(deadline, _LOWER), [])
            work.stages += [f"order {small.order}: {stage}" for stage in inner.stages]
            if inner.best is not None:
                work.stages.append(f"from order {small.order}: {exp(inner.value):.6g}")
                reached = inner.value
                for name, size in (("order", 0.0), (_BESIDE, _QUIET)):  # the same controller, and one beside it
                    x = problem.structure.grown(inner.best, problem.ports, rng, size)
                    begun.append((f"{name} {small.order}", x))
            if "stopped" in inner.stages or deadline.over:
                for _, x in begun:
                    work.keep(Point(problem, problem.clipped(x), work.known))
                work.stages.append("stopped" if "stopped" in inner.stages else "out of time")
                return work
        for k in range(max(starts - len(begun), 1)):
            level = float(10.0 ** rng.uniform(*_LEVELS)) if k else _QUIET
            begun.append(("drawn" if k else "quiet", problem.structure.drawn(problem.ports, rng, level, k == 0)))
        work.from_starts(begun, reached)
    except NothingLeftError:
        work.stages.append("nothing left")
    except OutOfTimeError:
        work.stages.append("out of time")
    except KeyboardInterrupt:
        work.stages.append("stopped")
    return work


def _share(deadline: Deadline, share: float) -> Deadline:
    return Deadline(share * max(deadline.limit - deadline.elapsed, 0.0))
