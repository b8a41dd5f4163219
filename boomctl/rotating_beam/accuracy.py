"""The first model of the hub-beam that is as exact as asked for in a maneuver, tried against the geometrically exact one.

Each model is judged by its own motion, solved as `simulate` will solve it: the largest error of the free end's transverse
displacement over the largest displacement.  The reference is the geometrically exact beam, refined until two of different
order agree far better than the accuracy asked for.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from boomctl.arrays import Array
from boomctl.checks import exactly, instance, plain_array, positive, shown, up_to
from boomctl.exceptions import SimulationError
from boomctl.maneuvers import Maneuver, PrescribedMotion, TorqueDriven
from boomctl.printing import count
from boomctl.progress import computing, tell
from boomctl.rotating_beam.beam import HubBeam, in_model
from boomctl.rotating_beam.parameters import HubBeamParameters
from boomctl.rotating_beam.selection import ModelChoice

# accuracies that can be asked for: below, the reference's rounding shows; above, none is meant (measured)
ACCURACIES = (1e-7, 1.0)
_PERIODS = 5.0  # of the slowest mode at rest, that follow a maneuver where no time is given (a choice)
_MOST_PERIODS = 1000.0  # of it, in which models are compared: half a minute for each exact beam (measured)

# Of the accuracy asked for.  What is found of a model, and what its reference may be wrong by, are to be within its share.
_SHARE = 0.96  # of an assumed-modes model: the rest is its solver's, and what lies between the instants (derived)
_SOLVED = 0.02  # tolerance of its solver: its cost hardly depends on that in most motions (measured)
_SHARE_EXACT = 0.7  # of a geometrically exact beam: one more polynomial lowers its error tenfold
_SOLVED_EXACT = 0.28  # tolerance of its solver: a halved step, which it may save, halves the cost
_CONVERGED = 0.1  # by which references may differ (a choice)
_FIRST, _ONWARD = 1e-3, 0.03  # tolerance of the first reference; of others over what the last two differed by (choices)
_NEGLIGIBLE = 0.1  # of what references may differ by: no tolerance is tighter (a choice)

EXACT = "geometrically-exact"
_FEWEST = 3  # polynomials of an exact beam that may be chosen: with fewer its steps are shorter, for no gain (measured)
_TRIED = (*(("sfoam", n) for n in (1, 2, 3, 5, 8)), *((EXACT, n) for n in (_FEWEST, 4, 6, 8, 12)))  # in turn (a choice)
_REFERENCES = (5, 7, 10, 14, 20, 28, 40, 60)  # polynomials of references, until two agree: factors of sqrt 2 (a choice)
_INSTANTS = 24.0  # compared in a period of the second bending mode: of it 1 % may lie between them (derived)
_FEWEST_INSTANTS, _MOST_INSTANTS = 500, 20_000  # in the maneuver and in all (choices)
_UNEVEN = 1.01  # power that spaces them unevenly, so that no vibration is in step with them (a choice)
_ROUNDING = 1e-14  # of the radius of the free end: displacements are no more exact (measured)


def chosen_beam(
    p: HubBeamParameters, accuracy: float | None, maneuver: Maneuver | None, time: ArrayLike | None
) -> HubBeam:
    """Return the hub-beam in the first model that reaches an accuracy in a maneuver; see `hub_beam`."""
    if accuracy is None:
        raise ValueError("accuracy = None: expected a number; accuracy and maneuver go together")
    if maneuver is None:
        raise ValueError("maneuver = None: expected one as spin_up, sine_torque, ... return it; it goes with accuracy")
    instance("maneuver", maneuver, (PrescribedMotion, TorqueDriven), "one as spin_up, sine_torque, ... return it")
    wanted = positive("accuracy", accuracy)
    if not ACCURACIES[0] <= wanted <= ACCURACIES[1]:
        raise ValueError(f"accuracy = {exactly(wanted)}: expected {ACCURACIES[0]:g} to {ACCURACIES[1]:g}")
    slowest = float(in_model(p, EXACT, _FEWEST).eigenfrequencies_hz()[0])
    until = _own_time(maneuver, slowest) if time is None else _last(time)
    if until * slowest > _MOST_PERIODS:
        raise ValueError(
            f"timepts = {exactly(until)}: expected at most {up_to(_MOST_PERIODS / slowest)} s, {_MOST_PERIODS:g} "
            "periods of the "
            f"slowest mode"
        )
    try:
        hash(maneuver)
    except TypeError:  # made of a function that cannot be told from others
        choice = _choose(p, wanted, maneuver, until)
    else:
        choice = _known(p, wanted, maneuver, until)
    made: Any = in_model(p, choice.model, choice.modes)  # every model is a dataclass
    return replace(made, selection=choice)


def _own_time(maneuver: Maneuver, slowest: float) -> float:
    ends = [item for item in maneuver.breakpoints if item > 0.0]
    if not ends:
        raise ValueError("timepts = None: expected the last instant [s], for the maneuver does not say when it ends")
    return max(ends) + _PERIODS / slowest


def _last(time: ArrayLike) -> float:
    """Return the last of some instants, or the only one [s]."""
    if not isinstance(time, (list, tuple, np.ndarray)):
        return positive("timepts", time)
    instants = plain_array("timepts", time)
    if instants.ndim != 1 or not instants.size:
        raise ValueError(f"time of shape {instants.shape}: expected an instant [s], or one dimension of them")
    return positive("timepts[-1]", instants[-1])


@lru_cache(maxsize=64)
def _known(p: HubBeamParameters, accuracy: float, maneuver: Maneuver, time: float) -> ModelChoice:
    return _choose(p, accuracy, maneuver, time)


class _Trial(NamedTuple):
    """A model that was tried: its error, whether it is exact enough, and the tolerance of its simulation."""

    model: str
    modes: int
    error: float
    enough: bool
    tolerance: tuple[float, float]


class _Reference(NamedTuple):
    """Displacements of the geometrically exact beam at the instants compared, and what `ModelChoice` says of it."""

    tip: Array
    largest: float
    agreement: tuple[int, int, float]


def _choose(p: HubBeamParameters, accuracy: float, maneuver: Maneuver, time: float) -> ModelChoice:
    instants = _instants(p, maneuver, time)
    with computing("choice of a model"):
        true = _reference(p, accuracy, maneuver, instants)
        tried = list(_trials(p, accuracy, maneuver, instants, true))
    result = tried[-1]
    if not result.enough:
        best = min(tried, key=lambda each: each.error)
        raise ValueError(
            f"accuracy = {exactly(accuracy)}: expected at least {1.5 * best.error:.1g} in this maneuver; {best.modes} modes "
            f"of {best.model} come as near as any"
        )
    return ModelChoice(
        accuracy=accuracy,
        time=time,
        maneuver=maneuver,
        model=result.model,
        modes=result.modes,
        error=result.error,
        rtol=result.tolerance[0],
        atol=result.tolerance[1],
        largest=true.largest,
        reference=true.agreement,
        tried=tuple(item[:3] for item in tried),
    )


def _instants(p: HubBeamParameters, maneuver: Maneuver, time: float) -> Array:
    """Return the instants at which motions are compared: more of them than vibrate, and enough in the maneuver itself."""
    second = float(in_model(p, EXACT, _REFERENCES[0]).eigenfrequencies_hz()[1])
    points = int(np.clip(_INSTANTS * second * time, _FEWEST_INSTANTS, _MOST_INSTANTS))
    even = [np.linspace(0.0, min(item, time), _FEWEST_INSTANTS) for item in maneuver.breakpoints[-1:] if item > 0.0]
    return np.unique(np.concatenate([time * np.linspace(0.0, 1.0, points) ** _UNEVEN, *even]))


def _reference(p: HubBeamParameters, accuracy: float, maneuver: Maneuver, instants: Array) -> _Reference:
    """Refine the geometrically exact beam until the motions of two of them agree so well as to be a reference.

    Raises
    ------
    ValueError
        There is none: they do not agree, cannot be followed so exactly, or do not move.
    """
    rounding = _ROUNDING * (p.hub_radius + p.length)
    fewer, before, unsolved, apart, rtol = 0, np.zeros_like(instants), 0.0, math.inf, _FIRST
    for modes in _REFERENCES:
        tell(f"geometrically exact beam with {modes} polynomials")
        rtol = max(rtol, _NEGLIGIBLE * _CONVERGED * accuracy)
        try:
            run = in_model(p, EXACT, modes)._solved(maneuver, instants, (rtol, rounding))
        except SimulationError as failure:
            raise ValueError(
                f"accuracy = {exactly(accuracy)}: expected a larger one, or a shorter time; the geometrically exact beam "
                f"cannot be followed so exactly: {failure}"
            ) from None
        largest = float(np.abs(run.tip).max())
        if largest <= rounding:
            raise ValueError(f"maneuver = {shown(maneuver)}: expected one that moves the beam from rest")
        if fewer:
            difference = float(np.abs(run.tip - before).max())
            apart, rtol = (difference + unsolved + run.error + rounding) / largest, _ONWARD * difference / largest
            if apart <= _CONVERGED * accuracy:
                return _Reference(run.tip, largest, (fewer, modes, apart))
        fewer, before, unsolved = modes, run.tip, run.error
    raise ValueError(
        f"accuracy = {exactly(accuracy)}: expected at least {apart / _CONVERGED:.2g}; geometrically exact beams of "
        f"{_REFERENCES[-2]} and {_REFERENCES[-1]} polynomials differ by {apart:.1e} in this maneuver"
    )


def _trials(
    p: HubBeamParameters, accuracy: float, maneuver: Maneuver, instants: Array, true: _Reference
) -> Iterator[_Trial]:
    """Yield models that are tried in turn, to the first that is exact enough."""
    for model, modes in _TRIED:
        tell(f"{model} with {count(modes, 'mode')}")
        rtol = 0.5 * (_SOLVED_EXACT if model == EXACT else _SOLVED) * accuracy
        tolerance = rtol, rtol * true.largest
        error = _error(in_model(p, model, modes), maneuver, instants, tolerance, true)
        enough = error + true.agreement[2] <= accuracy * (_SHARE_EXACT if model == EXACT else _SHARE)
        yield _Trial(model, modes, error, enough, tolerance)
        if enough:
            return


def _error(
    beam: HubBeam, maneuver: Maneuver, instants: Array, tolerance: tuple[float, float], true: _Reference
) -> float:
    """Return a model's error relative to the largest displacement; inf for what is beyond all numbers."""
    try:
        with np.errstate(all="ignore"):  # a model without stiffness may leave all numbers
            tip = beam.simulate(maneuver, instants, rtol=tolerance[0], atol=tolerance[1]).tip_displacement
            error = float(np.abs(tip - true.tip).max()) / true.largest
    except SimulationError:
        return math.inf
    return error if math.isfinite(error) else math.inf
