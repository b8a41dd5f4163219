"""Controllers of a given structure: norms reached on published plants and on the boom, beside what was asked for."""

import json
import os
import subprocess
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache, partial
from math import inf
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from boomctl.analysis.model_norm import hinf_norm
from boomctl.lab.benchmark.promise import Promise, Who, number, seconds
from boomctl.lab.benchmark.references.plants import plant, plant_names
from boomctl.lab.benchmark.scene import Extent, Scene, Setting
from boomctl.lti.rounding import LEVEL
from boomctl.progress import Deadline
from boomctl.synthesis.hinf.full_order import full_order_bound
from boomctl.synthesis.plants.partition import close_loop, partition
from boomctl.tuning.parts import makers as tunable
from boomctl.tuning.tune import tune

STARTS: dict[Extent, int] = {"quick": 2, "whole": 10}
"""Of each tuning; ten are as many as by default."""
_SMALL, _LARGE = 10, 60  # states up to which a start may take a second, and five: what was asked for
_MEASURED_STATES = 12  # states of the plants that are measured where not all are asked for by name
_QUICK = ("HE1", "REA2")  # plants of a quick run
_PATIENCE = 600.0  # given to one tuning [s]
_BOUND_PATIENCE = 60.0  # given to a bound of all orders [s]
_NORM, _BOUND, _CERTIFIED = "norm", "norm over the bound of all orders", "stable, its norm certified anew"

# designs: largest certified peak, proved worst peak, deposit CV and force [N] asked for
LIMITS = {"tuned_suspension": (9.3, 10.2, 0.0112, 13.0), "codesign": (7.9, 9.9, 0.0112, 13.0)}
"""Suspensions of the boom that come with this package, and what was asked of them."""
_NUMBERS = ("peak", "proved worst peak", "deposit CV", "force [N]")
_DESIGN_PATIENCE = 1200.0  # given to the making and judging of one design [s]; they take a minute or two

WITHIN = 1e-3  # share above a norm that passes for it: published values have three to five digits


@dataclass(frozen=True)
class Goal:
    """A norm wanted on a plant with a controller of some order.

    Attributes
    ----------
    plant : str
        In COMPleib.
    order : int
        Of the controller; 0: a gain.
    norm : float or None
        What is asked for; None where only the certificate is.
    within : float
        Share above it that passes.
    published : float or None
        The lowest norm known to be published for the same plant and order, where ``norm`` is not that.
    """

    plant: str
    order: int = 0
    norm: float | None = None
    within: float = WITHIN
    published: float | None = None

    @property
    def limit(self) -> float | None:
        """The highest norm that passes; without a norm asked for, one near that published."""
        if self.norm is None:
            return None if self.published is None else self.published * (1.0 + WITHIN)
        return self.norm * (1.0 + self.within)

    @property
    def name(self) -> str:
        """Plant and order."""
        return self.plant + (f", order {self.order}" if self.order else ", a gain")


GOALS = (
    Goal("HE1", 0, 0.1539),
    Goal("HE1", 2, 0.1166, within=0.0),
    Goal("REA2", 0, 1.149),
    Goal("REA2", 1, 1.1341, within=0.0),
    Goal("AC8", 0, 2.0051),
    Goal("AC8", 1, 1.768, within=0.0),
    Goal("AC4", 1, 0.5589, within=0.0),
    Goal("AC15", 0, 15.19),
    Goal("DIS1", 0, 4.166),
    Goal("TG1", 0, 12.847),
    Goal("HE4", 0, 23.0, within=0.0, published=22.838),
    Goal("WEC1", 0, None, published=4.05),
    Goal("HF1", 0, 0.44722),
    Goal("CM3", 0, 0.81650),
    Goal("BDT2", 0, 0.6848),
    Goal("AC10", 0, 13.24, within=0.0),
    Goal("AC10", 1, None, published=10.21),
)
"""What is measured against a number; all other plants are asked for a certified norm."""


@dataclass(frozen=True)
class Tuned:
    """What tuning came to: its goal, the norm of the loop closed anew, whether that is certified, and no order's bound."""

    goal: Goal
    norm: float
    certified: bool
    bound: float


def tuning(extent: Extent) -> Scene:
    """Return the scene of plants of a few states, for each of which a norm was published or asked for."""
    names = _QUICK if extent == "quick" else [name for name in plant_names() if plant(name).states <= _MEASURED_STATES]
    return _scene("tuning", extent, tuple(goal for goal in GOALS if goal.plant in names))


def tuning_all(extent: Extent) -> Scene:
    """Return the scene of all plants that are there; those without a goal are tuned with a gain."""
    there = plant_names()
    goals = tuple(goal for goal in GOALS if goal.plant in there)
    others = tuple(Goal(name) for name in there if name not in {goal.plant for goal in goals})
    return _scene("tuning-all", extent, goals + others)


def _scene(key: str, extent: Extent, goals: tuple[Goal, ...]) -> Scene:
    starts = STARTS[extent]

    def error(found: Tuned) -> float:
        if not found.certified:
            return inf
        wanted = found.goal.norm or found.goal.published
        return 0.0 if wanted is None else max(found.norm / wanted - 1.0, 0.0)

    return Scene(
        key=key,
        title=f"H-infinity tuning of plants of COMPleib, {starts} starts",
        question="From a published plant (COMPleib 1.1, Leibfritz & Lipinski 2004) to a controller of a given order; run"
        " times are of all starts.",
        measure="Norm of the loop, closed and certified anew, over the one asked for or published, less one if above.",
        settings=tuple(
            Setting(goal.name, plant(goal.plant).data or "own numbers", ours=True, cold=partial(tuned, goal, starts))
            for goal in goals
        ),
        error=error,
        promises=tuple(promise for goal in goals for promise in _promises(goal, starts)),
        found=lambda found: {
            _NORM: found.norm,
            _BOUND: found.norm / found.bound if found.bound else inf,
            _CERTIFIED: float(found.certified),
        },
        shows="promises",
    )


def _promises(goal: Goal, starts: int) -> list[Promise]:
    who, states = Who(goal.name), plant(goal.plant).states
    allowed = 1.0 if states <= _SMALL else 5.0 if states <= _LARGE else None
    found = [
        number(who, _CERTIFIED, 1.0, least=True),
        number(who, _NORM, goal.limit),
        # share by which a norm computed anew may exceed what the result says: a tenth of what norms are certified to
        number(who, _BOUND, 1.0 - LEVEL, least=True),
    ]
    return [*found, *([] if allowed is None else [seconds(who, starts * allowed)])]


def tuned(goal: Goal, starts: int, change: float = 0.0) -> Tuned:
    """Tune for a goal and verify the loop anew; what it is closed from is never kept from another call."""
    p = plant(goal.plant)
    structure = tunable.state_space(goal.order) if goal.order else tunable.gain()
    design = tune(p.P, p.nmeas, p.ncon, structure, starts=starts, seed=0, time_limit=_PATIENCE)
    loop = close_loop(p.P, design.controller)
    norm = hinf_norm(loop)
    stable = bool(loop.poles().real.max(initial=-inf) < 0.0)
    certified = stable and norm.certified and norm.lower <= design.gamma * (1.0 + LEVEL)
    return Tuned(goal, norm.upper, certified, _bound(goal.plant))


@cache
def _bound(name: str) -> float:
    """Return what no controller of any order beats."""
    p = plant(name)
    return full_order_bound(partition(p.P, p.nmeas, p.ncon), Deadline(_BOUND_PATIENCE))[0]


def designs(extent: Extent) -> Scene:
    """Return the scene of the boom's suspensions that were tuned over the whole box, as ``boomctl design`` judges them."""
    return Scene(
        key="designs",
        title="Tuned suspensions of the boom, springs ±30 % and mass ±20 %",
        question="From parameters to a certified controller and its report, each in a process of its own.",
        settings=tuple(Setting(name, "as it comes", ours=True, cold=partial(_judged, name)) for name in LIMITS),
        promises=tuple(
            number(Who(name), what, limit)
            for name, limits in LIMITS.items()
            for what, limit in zip(_NUMBERS, limits, strict=True)
        ),
        found=design_numbers,
        shows="promises",
    )


def design_numbers(found: Mapping[str, Any]) -> dict[str, float]:
    """Return what a design is judged by, from its ``results.json``."""
    bounds = [half["upper_bound"] for half in (found["worst_case"] or {}).values()]
    worst = max(inf if bound is None else bound for bound in bounds) if bounds else inf
    active = found["active"]
    return dict(zip(_NUMBERS, (active["peak_upper_bound"], worst, active["deposit_cv"], active["force"]), strict=True))


def _judged(name: str, change: float) -> dict[str, Any]:
    """Return the results of a design.

    Raises
    ------
    RuntimeError
        It does not come with this package, or fails; the message is its own.
    """
    home = str(Path(__file__).resolve().parents[4])
    paths = os.pathsep.join([home, *filter(None, [os.environ.get("PYTHONPATH")])])
    with TemporaryDirectory(prefix="boomctl-") as folder:
        done = subprocess.run(
            [sys.executable, "-P", "-m", "boomctl.cli", "design", name, "--json", "--out", folder],
            capture_output=True,
            text=True,
            env=os.environ | {"PYTHONPATH": paths},
            timeout=_DESIGN_PATIENCE,
        )
    if done.returncode:
        raise RuntimeError(f"design {name!r}: {done.stderr.strip()}")
    return json.loads(done.stdout)
