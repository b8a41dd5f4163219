"""Selection of the first hub-beam model that meets a requested accuracy in a maneuver, against the geometrically exact beam.

Each model is evaluated by its motion, solved as `simulate` will solve it: the largest error of the free end's transverse
displacement relative to the largest displacement.  The reference is the geometrically exact beam, refined until two beams
with different numbers of polynomials agree to a tenth of the requested accuracy.
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
from boomctl.lti.rounding import COMPUTED
from boomctl.maneuvers import Maneuver, PrescribedMotion, TorqueDriven
from boomctl.printing import count
from boomctl.progress import computing, tell
from boomctl.rotating_beam.beam import HubBeam, in_model
from boomctl.rotating_beam.parameters import HubBeamParameters
from boomctl.rotating_beam.selection import ModelChoice
from boomctl.threads import one_blas_thread

# Range of the requested accuracy, relative; below it the rounding errors of the reference are visible.
ACCURACIES = (1e-7, 1.0)
_PERIODS = 5.0  # Periods of the slowest mode of the beam at rest, added after the last breakpoint if no time is given.
_MOST_PERIODS = 1000.0  # Longest comparison of models, in periods of the slowest mode; limits the run time.

# Fractions of the requested accuracy.  Error of a model plus error of its reference must be below its fraction.
_FRACTION = 0.96  # Assumed-modes model: the rest is for its solver and for errors between the compared times.
_SOLVED = 0.02  # Tolerance of its solver; the run time depends weakly on it in most motions.
_FRACTION_EXACT = 0.7  # Geometrically exact beam: one more polynomial lowers its error tenfold.
_SOLVED_EXACT = 0.28  # Tolerance of its solver; a looser tolerance can save one halving of the step.
# Allowed difference of two references.  It is added to the error of each model, so that any value keeps the accuracy: a
# larger one may reject a model that is accurate enough, a smaller one needs finer references.  0.25, 0.1 and 0.03 chose the
# same models in 14 random maneuvers.
_SETTLING = 0.1
_FIRST, _ONWARD = 1e-3, 0.03  # Tolerance of the first reference; of the next ones, relative to the last difference.
_NEGLIGIBLE = 0.1  # Tightest tolerance of a reference, relative to the allowed difference of two references.

EXACT = "geometrically-exact"
_FEWEST = 3  # Fewest polynomials of a candidate exact beam: with fewer its steps are shorter, without a gain.
# Candidate models and their numbers of modes, in the order in which they are tested.
_CANDIDATES = (*(("sfoam", n) for n in (1, 2, 3, 5, 8)), *((EXACT, n) for n in (_FEWEST, 4, 6, 8, 12)))
_REFERENCES = (5, 7, 10, 14, 20, 28, 40, 60)  # Polynomials of the references, in factors of about sqrt 2.
_TIMES = 24.0  # Compared times in a period of the second bending mode: a peak between two is 1 % higher at most.
_FEWEST_TIMES, _MOST_TIMES = 500, 20_000  # Limits: least number within the maneuver, largest number in total.
_SPACING = 1.01  # Power by which the times are spaced unevenly, to avoid aliasing with a vibration.


@one_blas_thread
def chosen_beam(
    p: HubBeamParameters, accuracy: float | None, maneuver: Maneuver | None, time: ArrayLike | None
) -> HubBeam:
    """Return the hub-beam in the first model that reaches an accuracy in a maneuver; see `hub_beam`."""
    if accuracy is None:
        raise ValueError("accuracy = None: expected a number; accuracy and maneuver go together")
    if maneuver is None:
        raise ValueError("maneuver = None: expected a maneuver with accuracy, such as spin_up(...)")
    instance(
        "maneuver", maneuver, (PrescribedMotion, TorqueDriven), "a maneuver, such as spin_up(...) or sine_torque(...)"
    )
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
    except TypeError:  # consists of a function that is not hashable
        choice = _choose(p, wanted, maneuver, until)
    else:
        choice = _known(p, wanted, maneuver, until)
    beam: Any = in_model(p, choice.model, choice.modes)  # every model is a dataclass
    return replace(beam, selection=choice)


def _own_time(maneuver: Maneuver, slowest: float) -> float:
    ends = [item for item in maneuver.breakpoints if item > 0.0]
    if not ends:
        raise ValueError("timepts = None: expected the last time [s], for the maneuver has no breakpoint after t = 0")
    return max(ends) + _PERIODS / slowest


def _last(time: ArrayLike) -> float:
    """Return the last of several times, or the only time [s]."""
    if not isinstance(time, (list, tuple, np.ndarray)):
        return positive("timepts", time)
    times = plain_array("timepts", time)
    if times.ndim != 1 or not times.size:
        raise ValueError(f"timepts of shape {times.shape}: expected a time [s], or a one-dimensional array of times")
    return positive("timepts[-1]", times[-1])


@lru_cache(maxsize=64)
def _known(p: HubBeamParameters, accuracy: float, maneuver: Maneuver, time: float) -> ModelChoice:
    return _choose(p, accuracy, maneuver, time)


class _Trial(NamedTuple):
    """Tested model: its error, whether it is accurate enough, and the tolerance of its simulation."""

    model: str
    modes: int
    error: float
    enough: bool
    tolerance: tuple[float, float]


class _Reference(NamedTuple):
    """Displacements of the geometrically exact beam at the compared times, and its entries in `ModelChoice`."""

    tip: Array
    largest: float
    agreement: tuple[int, int, float]


def _choose(p: HubBeamParameters, accuracy: float, maneuver: Maneuver, time: float) -> ModelChoice:
    times = _compared_times(p, maneuver, time)
    with computing("choice of a model"):
        true = _reference(p, accuracy, maneuver, times)
        trials = list(_trials(p, accuracy, maneuver, times, true))
    result = trials[-1]
    if not result.enough:
        best = min(trials, key=lambda trial: trial.error)
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
        tried=tuple(item[:3] for item in trials),
    )


def _compared_times(p: HubBeamParameters, maneuver: Maneuver, time: float) -> Array:
    """Return the times at which motions are compared: they resolve the second bending mode and the maneuver."""
    second = float(in_model(p, EXACT, _REFERENCES[0]).eigenfrequencies_hz()[1])
    points = int(np.clip(_TIMES * second * time, _FEWEST_TIMES, _MOST_TIMES))
    even = [np.linspace(0.0, min(item, time), _FEWEST_TIMES) for item in maneuver.breakpoints[-1:] if item > 0.0]
    return np.unique(np.concatenate([time * np.linspace(0.0, 1.0, points) ** _SPACING, *even]))


def _reference(p: HubBeamParameters, accuracy: float, maneuver: Maneuver, times: Array) -> _Reference:
    """Refine the geometrically exact beam until the motions of two refinements agree.

    Raises
    ------
    ValueError
        If no two refinements agree, a refinement cannot be simulated to the tolerance, or the beam does not move.
    """
    rounding = COMPUTED * (p.hub_radius + p.length)
    fewer, before, unsolved, gap, rtol = 0, np.zeros_like(times), 0.0, math.inf, _FIRST
    for modes in _REFERENCES:
        tell(f"geometrically exact beam with {modes} polynomials")
        rtol = max(rtol, _NEGLIGIBLE * _SETTLING * accuracy)
        try:
            run = in_model(p, EXACT, modes)._solved(maneuver, times, (rtol, rounding))
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
            gap, rtol = (difference + unsolved + run.error + rounding) / largest, _ONWARD * difference / largest
            if gap <= _SETTLING * accuracy:
                return _Reference(run.tip, largest, (fewer, modes, gap))
        fewer, before, unsolved = modes, run.tip, run.error
    raise ValueError(
        f"accuracy = {exactly(accuracy)}: expected at least {gap / _SETTLING:.2g}; geometrically exact beams of "
        f"{_REFERENCES[-2]} and {_REFERENCES[-1]} polynomials differ by {gap:.1e} in this maneuver"
    )


def _trials(
    p: HubBeamParameters, accuracy: float, maneuver: Maneuver, times: Array, true: _Reference
) -> Iterator[_Trial]:
    """Test the candidate models in turn, up to the first that is accurate enough."""
    for model, modes in _CANDIDATES:
        tell(f"{model} with {count(modes, 'mode')}")
        rtol = 0.5 * (_SOLVED_EXACT if model == EXACT else _SOLVED) * accuracy
        tolerance = rtol, rtol * true.largest
        error = _error(in_model(p, model, modes), maneuver, times, tolerance, true)
        enough = error + true.agreement[2] <= accuracy * (_FRACTION_EXACT if model == EXACT else _FRACTION)
        yield _Trial(model, modes, error, enough, tolerance)
        if enough:
            return


def _error(beam: HubBeam, maneuver: Maneuver, times: Array, tolerance: tuple[float, float], true: _Reference) -> float:
    """Return a model's error relative to the largest displacement; inf if its motion overflows or is not solved."""
    try:
        with np.errstate(all="ignore"):  # a model that has lost its stiffness may overflow
            tip = beam.simulate(maneuver, times, rtol=tolerance[0], atol=tolerance[1]).tip_displacement
            error = float(np.abs(tip - true.tip).max()) / true.largest
    except SimulationError:
        return math.inf
    return error if math.isfinite(error) else math.inf
