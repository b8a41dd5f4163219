"""The benchmark of fixed-structure tuning: norms reached on published plants, beside a bound of all orders."""

import time
from dataclasses import dataclass
from functools import partial
from math import inf, isfinite, nan

from boomctl.analysis.norm import hinf_norm
from boomctl.lab.benchmark.report import BenchmarkReport, Row, Sheet, Tell, measured
from boomctl.lab.benchmark.tune.boom import boom_lines
from boomctl.lab.benchmark.tune.goals import GOALS, Goal
from boomctl.lab.benchmark.tune.plants import BenchmarkPlant, plant, plant_names
from boomctl.synthesis.assumptions import SynthesisError
from boomctl.synthesis.hinf.bounds import Deadline
from boomctl.synthesis.hinf.full_order import full_order_bound
from boomctl.synthesis.plants.partition import close_loop, partition
from boomctl.tuning.parts import makers as tunable
from boomctl.tuning.tune import tune

_STARTS = 10  # of each tuning, as many as by default
_SMALL, _LARGE = 10, 60  # states up to which a start may take a second, and five: what was asked for
_QUICK_STATES = 12  # states up to which a run that is not full goes: it is to end within two minutes
_PATIENCE = 600.0  # given to one tuning [s]
_BOUND_PATIENCE = 60.0  # given to a bound of all orders [s]
_AGREE = 1e-6  # share by which a norm computed anew may exceed what the result says: norms are certified to as much
_SECTION = f"H-infinity tuning, {_STARTS} starts; time: of one start"
_NOTES = (
    f"Time: processor time of one thread, over the {_STARTS} starts; a start may take 1 s up to {_SMALL} states and 5 s "
    f"up to {_LARGE}, beyond that no target. Error: norm over the one asked for, less one, where it is above.",
    "Norm: of the loop of plant and controller, closed and certified anew. Bound: no controller of any order goes below it "
    "(Riccati equations, the measurements' rates where they carry no noise). Goal: asked for; published: lowest known to be.",
    "Plants: COMPleib 1.1 (Leibfritz & Lipinski 2004), the collection's own numbers; * four decimals of them, as in "
    "controlgym, and not measured where that is not installed.",
)


@dataclass(frozen=True)
class Outcome:
    """What tuning came to.

    Attributes
    ----------
    goal : Goal
    plant : BenchmarkPlant
    norm : float
        Of the loop closed anew; nan without a result.
    bound : float
        What no controller of any order beats.
    seconds : float
        Processor time of all starts [s].
    starts : int
    certified : bool
        Whether the loop is stable and its norm, computed anew, is no larger than the result says.
    said : str
        Why there is no result.
    """

    goal: Goal
    plant: BenchmarkPlant
    norm: float
    bound: float
    seconds: float
    starts: int
    certified: bool
    said: str = ""

    @property
    def a_start(self) -> float:
        """Processor time of a start [s]."""
        return self.seconds / self.starts

    @property
    def allowed(self) -> float:
        """What a start may take [s]."""
        return 1.0 if self.plant.states <= _SMALL else 5.0 if self.plant.states <= _LARGE else inf

    @property
    def met(self) -> bool | None:
        """Whether it is certified, low and fast enough; None where only the certificate was asked for and is there."""
        wanted = self.goal.limit
        if not self.certified:
            return False
        if wanted is None:
            return None if self.a_start <= self.allowed else False
        return self.norm <= wanted and self.a_start <= self.allowed

    def row(self) -> Row:
        """Return the line of the report."""
        wanted, p = self.goal.norm if self.goal.norm is not None else self.goal.published, self.plant
        time_target = f"{self.allowed:g} s" if isfinite(self.allowed) else ""
        norm_target = "" if wanted is None else f"<= {wanted:.5g}"
        found = self.said or f"{self.norm:.5g}"
        return Row(
            _SECTION,
            f"{self.goal.name} ({p.states} states): {found}",
            ours=self.a_start,
            target=", ".join(filter(None, [norm_target, time_target])),
            error=None if wanted is None or not isfinite(self.norm) else max(self.norm / wanted - 1.0, 0.0),
            met=self.met,
        )

    def cells(self) -> tuple[str | float | int | None, ...]:
        """Return the line of the table."""
        goal, p = self.goal, self.plant
        numbers = (self.norm, goal.norm, goal.published, self.bound)
        shown = (None if value is None or not isfinite(value) else f"{value:.5g}" for value in numbers)
        certified = "yes" if self.certified else "NO"
        return (p.name + ("*" if p.data else ""), p.states, goal.order, *shown, self.a_start, self.seconds, certified)


def run(full: bool = False, progress: Tell | None = None) -> BenchmarkReport:
    """Tune controllers for published plants.

    Parameters
    ----------
    full : bool
        All plants and the designs of the boom: many minutes.
    progress : callable, optional
        Told in words what comes next.

    Returns
    -------
    BenchmarkReport
    """
    subjects = (field_lines, boom_lines) if full else (field_lines,)
    return measured("tune", [partial(each, full) for each in subjects], _NOTES, progress)


def asked(full: bool) -> tuple[Goal, ...]:
    """Return what is measured: all goals whose plant is there and small enough, and in full all other plants with a gain."""
    there = plant_names()
    goals = tuple(goal for goal in GOALS if goal.plant in there)
    if not full:
        return tuple(goal for goal in goals if plant(goal.plant).states <= _QUICK_STATES)
    others = tuple(Goal(name) for name in there if name not in {goal.plant for goal in goals})
    return goals + others


def field_lines(full: bool, tell: Tell) -> list[Row | Sheet]:
    """Tune for the plants, one after another."""
    found = []
    for goal in asked(full):
        tell(f"tuning {goal.name}")
        found.append(tuned(goal))
    columns = ("plant", "states", "order", "norm", "goal", "published", "bound", "s a start", "s in all", "certified")
    sheet = Sheet(
        "norms reached, of the loops closed and certified anew", columns, tuple(each.cells() for each in found)
    )
    return [*(each.row() for each in found), sheet]


def tuned(goal: Goal, starts: int = _STARTS, seed: int = 0) -> Outcome:
    """Tune for a goal and verify the loop anew."""
    p = plant(goal.plant)
    bound = full_order_bound(partition(p.P, p.nmeas, p.ncon), Deadline.after(_BOUND_PATIENCE)).lower
    structure = tunable.state_space(goal.order) if goal.order else tunable.gain()
    start = time.process_time()
    try:
        design = tune(p.P, p.nmeas, p.ncon, structure, starts=starts, seed=seed, time_limit=_PATIENCE)
    except SynthesisError as error:
        return Outcome(goal, p, nan, bound, time.process_time() - start, starts, False, " ".join(str(error).split()))
    seconds = time.process_time() - start
    loop = close_loop(p.P, design.controller)
    norm = hinf_norm(loop)
    stable = bool(loop.poles().real.max(initial=-inf) < 0.0)
    certified = stable and norm.certified and norm.lower <= design.gamma * (1.0 + _AGREE)
    return Outcome(goal, p, norm.upper, bound, seconds, starts, certified)
