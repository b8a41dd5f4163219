"""How many polynomials a motion of the geometrically exact beam takes, and what those that it does without are worth.

A motion is followed with more polynomials in the same steps: what it then changes by is due to the polynomials, for the
errors of the steps are nearly the same. So coarse steps serve, until no more than a share of their error is left.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import TypeAlias

import numpy as np

from boomctl.arrays import Array
from boomctl.checks import warn_user
from boomctl.progress import tell
from boomctl.rotating_beam.exact.integrator import StepFailed
from boomctl.rotating_beam.exact.run import Run
from boomctl.rotating_beam.result import Motion, SimulationError

MOST_POLYNOMIALS = 60  # a span: the series has converged to rounding long before
_MORE = 1.4  # times the polynomials before, to see what more are worth: about the square root of 2 (a choice)
_LOOSE = 1e-4  # tolerance of the steps in which numbers of polynomials are compared: half a digit beyond a picture
_BESIDE = 0.1  # of what polynomials leave, for the steps: more exact ones would not show (a choice)
_TINY = 1e-15  # of the radius: displacements that are rounding
_JUDGED = 20  # polynomials from which on it is judged whether more of them lead anywhere (a choice)
# A change falls by the same ratio each time where a motion has jumps, by smaller and smaller ones where it is smooth.
_SMOOTH = 0.5  # times the ratio before, that the next one is below where the motion is smooth (a choice)
_LEFT = 1.5  # times what the next polynomials change: what all further ones do, which is less each time by half or more
_TOLD_APART = 3.0  # times a change that the error of the steps may be: what of it changes too is far less (measured)
_COMPARED = 43  # the most of which more are tried: 1.4 times as many are 60
_SHARE = 0.5  # of the tolerance, for polynomials and for steps

Followed: TypeAlias = Callable[[int, float], tuple[Motion, Run | None]]
"""The motion with a number of polynomials, its steps refined to a tolerance."""

Stepped: TypeAlias = Callable[[int, float], Run]
"""The same in steps of a given length [s]."""


def resized(y: Array, modes: int, wanted: int) -> Array:
    """Return coordinates, or their rates, of another number of polynomials: those beyond are left out, or zero."""
    strains = y[..., 1:].reshape(*y.shape[:-1], -1, modes)
    kept = np.zeros((*strains.shape[:-1], wanted))
    least = min(modes, wanted)
    kept[..., :least] = strains[..., :least]
    return np.concatenate([y[..., :1], kept.reshape(*y.shape[:-1], -1)], axis=-1)


def with_enough_polynomials(
    followed: Followed, stepped: Stepped, modes: int, tolerance: tuple[float, float], radius: float
) -> Motion:
    """Return a motion with as many polynomials as keep the tolerance, from a number on.

    Parameters
    ----------
    followed, stepped : callable
    modes : int
        The fewest polynomials.
    tolerance : pair of float
        Relative to the largest displacement, and absolute [m].
    radius : float
        Of the undeformed free end, m.

    Warns
    -----
    UserWarning
        The tolerance does not hold, for the motion is not smooth and no number of polynomials is near enough to it: the
        error says how far it is.
    """
    rtol, atol = tolerance
    enough, apart, ratio, goal, largest = modes, math.inf, math.inf, 0.0, 1.0
    for enough, changed, here in _changes(followed, stepped, modes):
        if here is None:
            return followed(enough, rtol)[0]
        largest = here.largest(radius)
        slower = changed > _SMOOTH * ratio * apart
        ratio, apart, goal = changed / apart, changed, _SHARE * (atol + rtol * largest)
        ahead = math.log(MOST_POLYNOMIALS / enough) / math.log(_MORE)  # sets of polynomials that are left to try
        if apart <= goal or (enough >= _JUDGED and slower and apart * ratio**ahead > goal):
            break
    motion, _ = followed(enough, max(_SHARE * rtol, _BESIDE * apart / max(largest, radius * _TINY)))
    if apart > goal:
        warn_user(
            f"error of the motion: about {apart:.2g} m with {enough} polynomials, {2.0 * goal:.2g} m asked for; the motion "
            "is not smooth enough for that; expected a larger rtol or atol, or no jumps"
        )
    return replace(motion, error=motion.error + apart)


def left_out(followed: Followed, stepped: Stepped, modes: int) -> float:
    """Return what polynomials beyond a number are worth: the change of the free end, m; inf where that is not known."""
    try:
        _, apart, _ = next(_changes(followed, stepped, min(modes, _COMPARED)))
    except SimulationError:
        return math.inf
    return _LEFT * apart


def _changes(followed: Followed, stepped: Stepped, modes: int) -> Iterator[tuple[int, float, Run | None]]:
    """Yield numbers of polynomials, by how much the motion differs from that with the number before, and the motion."""
    found, before = followed(modes, _LOOSE)
    if before is None:  # it ends where it begins
        yield modes, 0.0, None
        return
    error = found.error
    while modes < MOST_POLYNOMIALS:
        more = min(max(math.ceil(_MORE * modes), modes + 2), MOST_POLYNOMIALS)
        tell(f"{more} polynomials")
        try:
            here = stepped(more, before.step)
        except StepFailed:
            before, here = _in_equal_steps(stepped, (modes, more), 0.5 * before.step)
        apart = here.apart(before)
        yield more, apart, here
        modes, before = more, here
        while error > _TOLD_APART * apart:
            (finer,) = _in_equal_steps(stepped, (modes,), 0.5 * before.step)
            error, before = min(error, finer.apart(before)), finer


def _in_equal_steps(stepped: Stepped, numbers: tuple[int, ...], step: float) -> list[Run]:
    """Return the motions with some numbers of polynomials in the same steps, halved until each of them converges."""
    while True:  # steps that are too many end it
        try:
            return [stepped(modes, step) for modes in numbers]
        except StepFailed:
            step *= 0.5
