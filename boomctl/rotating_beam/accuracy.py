"""The cheapest model of the hub-beam that is as exact as asked for in a manoeuvre, tried against the geometrically exact one.

Each model is judged by its own motion, solved as `simulate` will solve it: the largest error of the free end's transverse
displacement over the largest displacement.  The reference is the geometrically exact beam, refined until two of different
order agree far better than the accuracy asked for.  What a motion costs is estimated from the steps that it took.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from boomctl.arrays import Array
from boomctl.checks import exactly, instance, plain_array, positive, shown, up_to
from boomctl.printing import count
from boomctl.progress import computing, tell
from boomctl.rotating_beam.beam import HubBeam, in_model
from boomctl.rotating_beam.chosen import ModelChoice
from boomctl.rotating_beam.manoeuvres import Manoeuvre, PrescribedMotion, TorqueDriven
from boomctl.rotating_beam.parameters import HubBeamParameters
from boomctl.rotating_beam.result import SimulationError

# accuracies that can be asked for: below, the reference's rounding shows; above, none is meant (measured)
ACCURACIES = (1e-7, 1.0)
_PERIODS = 5.0  # of the slowest mode at rest, that follow a manoeuvre where no time is given (a choice)
_MOST_PERIODS = 1000.0  # of it, in which models are compared: half a minute for each exact beam (measured)

# Of the accuracy asked for.  What is found of a model, and what its reference may be wrong by, are to be within its share.
_SHARE = 0.96  # of an assumed-modes model: the rest is its solver's, and what lies between the instants (derived)
_SOLVED = 0.02  # tolerance of its solver: its cost hardly depends on that in most motions (measured)
_LOOSE = 0.3  # the same where what it changes, which is far less, is seen to be allowed for (a choice)
_SHARE_EXACT = 0.7  # of a geometrically exact beam: one more polynomial lowers its error tenfold
_SOLVED_EXACT = 0.28  # tolerance of its solver: a halved step, which it may save, halves the cost
# by which references may differ: at first, and where a model's error lies so near to the limit (choices)
_CONVERGED = (0.25, 0.03)
_FIRST, _ONWARD = 1e-3, 0.03  # tolerance of the first reference; of others over what the last two differed by (choices)
_NEGLIGIBLE = 0.1  # of what references may differ by: no tolerance is tighter (a choice)
# share of the cost of what was chosen, below which a model so near is worth a finer reference (a choice)
_CHEAPER = 0.5

EXACT = "geometrically-exact"
_HEAVY = ("tlam", "foam", "cfoam")  # with axial modes: each may cost as much as an exact beam
_FUTILE = 2  # further modes that mend nothing before a model is given up: one may be hardly excited (a choice)
# times what the last modes moved the tip by, that all further ones may: what modes add tends to zero swiftly (a choice)
_MENDED = 3.0
_REFERENCES = (5, 7, 10, 14, 20, 28, 40, 60)  # polynomials of references, until two agree: factors of sqrt 2 (a choice)
_FEWEST = 3  # polynomials of an exact beam that may be chosen: with fewer its steps are shorter, for no gain (measured)
_MODES = (1, 2, 3, 4, 5, 6, 8, 10, 12, 16, 20, 25, 30)  # tried of assumed modes: each costs a quarter more at most
_INSTANTS = 24.0  # compared in a period of the second bending mode: of it 1 % may lie between them (derived)
_FEWEST_INSTANTS, _MOST_INSTANTS = 500, 20_000  # in the manoeuvre and in all (choices)
_UNEVEN = 1.01  # power that spaces them unevenly, so that no vibration is in step with them (a choice)
_ROUNDING = 1e-14  # of the radius of the free end: displacements are no more exact (measured)

# Processor time of a simulation by the way it took: s, s a step, and s a step for each coordinate to the power at the end.
# Fitted to 1,900 simulations of 45 random machines, and within a factor of 1.5 of most of them (measured); orders of
# magnitude lie between models, so that the choice between them hardly depends on the machine that computes.
_COSTS = {
    "modal collocation": (4e-4, 0.0, 7e-6, 2),
    "free-hub modes": (0.0, 2.5e-5, 2.7e-6, 1),
    "collocation": (1.6e-3, 2.4e-5, 1.7e-6, 2),
    "collocation, cfoam": (3.9e-3, 0.0, 6.1e-5, 1),
    "collocation of momenta": (2e-2, 1.9e-4, 4.5e-6, 1),
}


def chosen_beam(
    p: HubBeamParameters, accuracy: float | None, manoeuvre: Manoeuvre | None, time: ArrayLike | None
) -> HubBeam:
    """Return the hub-beam in the cheapest model that reaches an accuracy in a manoeuvre; see `hub_beam`."""
    if accuracy is None:
        raise ValueError("accuracy = None: expected a number; accuracy and manoeuvre go together")
    if manoeuvre is None:
        raise ValueError("manoeuvre = None: expected one as spin_up, sine_torque, ... return it; it goes with accuracy")
    instance("manoeuvre", manoeuvre, (PrescribedMotion, TorqueDriven), "one as spin_up, sine_torque, ... return it")
    wanted = positive("accuracy", accuracy)
    if not ACCURACIES[0] <= wanted <= ACCURACIES[1]:
        raise ValueError(f"accuracy = {exactly(wanted)}: expected {ACCURACIES[0]:g} to {ACCURACIES[1]:g}")
    slowest = float(in_model(p, EXACT, _FEWEST).frequencies_hz()[0])
    until = _own_time(manoeuvre, slowest) if time is None else _last(time)
    if until * slowest > _MOST_PERIODS:
        raise ValueError(
            f"time = {exactly(until)}: expected at most {up_to(_MOST_PERIODS / slowest)} s, {_MOST_PERIODS:g} periods of the "
            f"slowest mode"
        )
    try:
        hash(manoeuvre)
    except TypeError:  # made of a function that cannot be told from others
        choice = _choose(p, wanted, manoeuvre, until)
    else:
        choice = _known(p, wanted, manoeuvre, until)
    made: Any = in_model(p, choice.model, choice.modes)  # every model is a dataclass
    return replace(made, chosen=choice)


def _own_time(manoeuvre: Manoeuvre, slowest: float) -> float:
    ends = [each for each in manoeuvre.breakpoints if each > 0.0]
    if not ends:
        raise ValueError("time = None: expected the last instant [s], for the manoeuvre does not say when it ends")
    return max(ends) + _PERIODS / slowest


def _last(time: ArrayLike) -> float:
    """Return the last of some instants, or the only one [s]."""
    if not isinstance(time, (list, tuple, np.ndarray)):
        return positive("time", time)
    instants = plain_array("time", time)
    if instants.ndim != 1 or not instants.size:
        raise ValueError(f"time of shape {instants.shape}: expected an instant [s], or one dimension of them")
    return positive("time[-1]", instants[-1])


@lru_cache(maxsize=64)
def _known(p: HubBeamParameters, accuracy: float, manoeuvre: Manoeuvre, time: float) -> ModelChoice:
    return _choose(p, accuracy, manoeuvre, time)


class _Run(NamedTuple):
    """A simulation: displacements at the instants compared, none if it cannot be followed; its cost [s]; its tolerance."""

    tip: Array | None
    cost: float
    tolerance: tuple[float, float]


class _Trial(NamedTuple):
    """A model that was tried: its error, whether it is exact enough, or would be if the reference were exact, and its run."""

    model: str
    modes: int
    error: float
    enough: bool
    perhaps: bool
    run: _Run


class _Reference(NamedTuple):
    """Displacements of the geometrically exact beam at the instants compared, and what `ModelChoice` says of it."""

    tip: Array
    largest: float
    agreement: tuple[int, int, float]


def _choose(p: HubBeamParameters, accuracy: float, manoeuvre: Manoeuvre, time: float) -> ModelChoice:
    instants, search, found = _instants(p, manoeuvre, time), None, None
    with computing("choice of a model"):
        for true in _references(p, accuracy, manoeuvre, instants):
            runs = {} if search is None else search.runs
            search = _Search(p, accuracy, manoeuvre, instants, true, runs, {})
            found = search.cheapest()
            found = found if found is None else search.solved_loosely(found)
            limit = math.inf if found is None else _CHEAPER * found.run.cost
            if not any(each.perhaps and each.run.cost < limit for each in search.tried.values()):
                break
    assert search is not None  # or there was no reference, which is an error
    if found is None:
        best = min(search.tried.values(), key=lambda each: each.error)
        raise ValueError(
            f"accuracy = {exactly(accuracy)}: expected at least {1.5 * best.error:.1g} in this manoeuvre; {best.modes} modes "
            f"of {best.model} come as near as any"
        )
    return ModelChoice(
        accuracy=accuracy,
        time=time,
        manoeuvre=manoeuvre,
        model=found.model,
        modes=found.modes,
        error=found.error,
        rtol=found.run.tolerance[0],
        atol=found.run.tolerance[1],
        largest=search.true.largest,
        reference=search.true.agreement,
        tried=tuple(each[:3] for each in search.tried.values()),
    )


def _instants(p: HubBeamParameters, manoeuvre: Manoeuvre, time: float) -> Array:
    """Return the instants at which motions are compared: more of them than vibrate, and enough in the manoeuvre itself."""
    second = float(in_model(p, EXACT, _REFERENCES[0]).frequencies_hz()[1])
    points = int(np.clip(_INSTANTS * second * time, _FEWEST_INSTANTS, _MOST_INSTANTS))
    even = [np.linspace(0.0, min(each, time), _FEWEST_INSTANTS) for each in manoeuvre.breakpoints[-1:] if each > 0.0]
    return np.unique(np.concatenate([time * np.linspace(0.0, 1.0, points) ** _UNEVEN, *even]))


def _references(p: HubBeamParameters, accuracy: float, manoeuvre: Manoeuvre, instants: Array) -> Iterator[_Reference]:
    """Refine the geometrically exact beam: each time that the motions of two of them agree so well as to be a reference.

    Raises
    ------
    ValueError
        There is not even a first one: they do not agree, cannot be followed so exactly, or do not move.
    """
    rounding = _ROUNDING * (p.hub_radius + p.length)
    fewer, before, unsolved, apart, level, rtol = 0, np.zeros_like(instants), 0.0, math.inf, 0, _FIRST
    for modes in _REFERENCES:
        tell(f"geometrically exact beam with {modes} polynomials")
        rtol = max(rtol, _NEGLIGIBLE * _CONVERGED[level] * accuracy)
        try:
            run = in_model(p, EXACT, modes)._solved(manoeuvre, instants, (rtol, rounding))
        except SimulationError as failure:
            if level:
                return
            raise ValueError(
                f"accuracy = {exactly(accuracy)}: expected a larger one, or a shorter time; the geometrically exact beam "
                f"cannot be followed so exactly: {failure}"
            ) from None
        tip = run.tip
        largest = float(np.abs(tip).max())
        if largest <= rounding:
            raise ValueError(f"manoeuvre = {shown(manoeuvre)}: expected one that moves the beam from rest")
        if fewer:
            difference = float(np.abs(tip - before).max())
            apart, rtol = (
                (difference + unsolved + run.error + rounding) / largest,
                _ONWARD * difference / largest,
            )
            if apart <= _CONVERGED[level] * accuracy:
                yield _Reference(tip, largest, (fewer, modes, apart))
                level += 1
                if level == len(_CONVERGED):
                    return
        fewer, before, unsolved = modes, tip, run.error
    if not level:
        raise ValueError(
            f"accuracy = {exactly(accuracy)}: expected at least {apart / _CONVERGED[0]:.2g}; geometrically exact beams of "
            f"{_REFERENCES[-2]} and {_REFERENCES[-1]} polynomials differ by {apart:.1e} in this manoeuvre"
        )


@dataclass(frozen=True, eq=False)
class _Search:
    """Models that are tried against a reference.

    Attributes
    ----------
    p, accuracy, manoeuvre
        What is asked for.
    instants : ndarray
        At which motions are compared [s].
    true : _Reference
        What they are compared with.
    runs, tried : dict
        By model and modes: the simulations, of searches before too, and how they are judged here, in turn.
    """

    p: HubBeamParameters
    accuracy: float
    manoeuvre: Manoeuvre
    instants: Array
    true: _Reference
    runs: dict[tuple[str, int], _Run]
    tried: dict[tuple[str, int], _Trial]

    def cheapest(self) -> _Trial | None:
        """Return the cheapest model that is exact enough, if there is one."""
        # with the hub's motion prescribed the two are one; else they cost the same, and take turns
        light = ("sfoam",) if isinstance(self.manoeuvre, PrescribedMotion) else ("sfoam", "sfoam-consistent")
        found = self.with_fewest_modes(light, math.inf)
        if found is not None:
            return found
        exact = self.with_fewest_polynomials()
        dearest = math.inf if exact is None else exact.run.cost
        rivals = [exact, *(self.with_fewest_modes((model,), dearest) for model in _HEAVY)]
        return min((each for each in rivals if each is not None), key=lambda each: each.run.cost, default=None)

    def with_fewest_modes(self, models: tuple[str, ...], dearest: float) -> _Trial | None:
        """Return the first of some models, with more and more modes, that is exact enough and no dearer than a limit [s].

        A model is given up where further modes have twice moved the tip so little that they cannot mend its error.
        """
        last: dict[str, Array] = {}
        futile = dict.fromkeys(models, 0)
        for modes in _MODES:
            for model in tuple(futile):
                new = self.attempt(model, modes)
                if new.enough and new.run.cost <= dearest:
                    return new
                if new.run.tip is None or new.run.cost > dearest:
                    del futile[model]
                    continue
                if model in last:
                    moved = _apart(new.run.tip, last[model], self.true.largest)
                    futile[model] = futile[model] + 1 if new.error > _MENDED * moved and not new.perhaps else 0
                if futile[model] == _FUTILE:
                    del futile[model]
                last[model] = new.run.tip
        return None

    def with_fewest_polynomials(self) -> _Trial | None:
        """Return the geometrically exact beam with the fewest polynomials that is exact enough, by bisection."""
        enough, finer, _ = self.true.agreement
        low, high, found = _FEWEST - 1, enough, None
        while high - low > 1:
            middle = (low + high) // 2
            trial = self.attempt(EXACT, middle)
            low, high, found = (low, middle, trial) if trial.enough else (middle, high, found)
        for modes in (high, finer):
            if found is not None:
                break
            trial = self.attempt(EXACT, modes)
            found = trial if trial.enough else None
        return found

    def attempt(self, model: str, modes: int) -> _Trial:
        """Simulate a model as users will, and judge it; one that cannot be followed has an infinite error."""
        if (model, modes) not in self.runs:
            tell(f"{model} with {count(modes, 'mode')}")
            self.runs[model, modes] = self.run(model, modes, _SOLVED_EXACT if model == EXACT else _SOLVED)
        self.tried[model, modes] = self.judged(model, modes, self.runs[model, modes])
        return self.tried[model, modes]

    def run(self, model: str, modes: int, share: float) -> _Run:
        """Simulate a model, its solver's error at most a share of the accuracy, however little of the motion is simulated."""
        rtol = 0.5 * share * self.accuracy
        return _run(in_model(self.p, model, modes), self.manoeuvre, self.instants, (rtol, rtol * self.true.largest))

    def judged(self, model: str, modes: int, run: _Run) -> _Trial:
        """Compare a simulation with the reference."""
        error = _apart(run.tip, self.true.tip, self.true.largest)
        allowed, unsure = self.accuracy * (_SHARE_EXACT if model == EXACT else _SHARE), self.true.agreement[2]
        enough = error + unsure <= allowed
        return _Trial(model, modes, error, enough, not enough and error - unsure <= allowed, run)

    def solved_loosely(self, found: _Trial) -> _Trial:
        """Return an assumed-modes model with a loose tolerance, if that costs less, and what it changes is allowed for."""
        if found.model == EXACT:
            return found
        loose = self.judged(found.model, found.modes, self.run(found.model, found.modes, _LOOSE))
        worst = found.error + _apart(loose.run.tip, found.run.tip, self.true.largest) + self.true.agreement[2]
        if loose.run.cost >= found.run.cost or worst > _SHARE * self.accuracy:
            return found
        self.tried[found.model, found.modes] = loose
        return loose


def _run(beam: HubBeam, manoeuvre: Manoeuvre, instants: Array, tolerance: tuple[float, float]) -> _Run:
    try:
        with np.errstate(all="ignore"):  # a model without stiffness may leave all numbers
            run = beam.simulate(manoeuvre, instants, rtol=tolerance[0], atol=tolerance[1])
    except SimulationError:
        return _Run(None, math.inf, tolerance)
    coordinates, cost = len(beam.state_names) // 2 - 1, 0.0
    for way in run.path:
        name = way.removesuffix(" (given up)")
        alone, a_step, each, power = _COSTS.get(f"{name}, {beam.model}", _COSTS.get(name, (0.0, 0.0, 0.0, 1)))
        cost += alone + run.steps * (a_step + each * coordinates**power)
    return _Run(run.tip_displacement, cost, tolerance)


def _apart(tip: Array | None, other: Array | None, largest: float) -> float:
    """Return by how much two motions differ, relative to the largest displacement; inf for what is beyond all numbers."""
    if tip is None or other is None:
        return math.inf
    with np.errstate(all="ignore"):
        found = float(np.abs(tip - other).max()) / largest
    return found if math.isfinite(found) else math.inf
