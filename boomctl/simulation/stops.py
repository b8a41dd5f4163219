"""End stops: hard, inelastic, one-sided, by complementarity.

A stop that the motion would pass within the step meets it with an impulse at the beginning of the step and a constant
force over it, such that at the end position and velocity both rest against the stop; where that would have to pull,
the motion is on its way back already, and an impulse alone keeps it from passing.  Which stops are touched, and how, is
decided for all of them together, by trying the cases in order of likelihood.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations, product

import numpy as np

from boomctl.arrays import Array

__all__ = ["StopHit", "StopMaps", "StopStep", "merged_hits", "stop_step"]

_ROUNDING = 1e-9

Set = tuple[int, ...]


@dataclass(frozen=True)
class StopHit:
    """A stop touched from ``time`` to ``until``.

    Attributes
    ----------
    output : str
        The stroke that ended.
    side : int
        +1 at the upper, -1 at the lower end.
    time, until : float
        First and last moment of contact [s].
    speed : float
        Stroke velocity at which it was met [m/s].
    impulse : float
        Total impulse that the stop gave while it was touched [N s].
    largest_force : float
        Largest mean force over a step [N].
    """

    output: str
    side: int
    time: float
    until: float
    speed: float
    impulse: float
    largest_force: float


@dataclass(frozen=True)
class StopMaps:
    """Linear maps of the stops over a step: what impulses ``p`` at its beginning and ``h`` times forces do.

    ``position`` and ``velocity`` are (stops, 2 stops): strokes and stroke velocities at the end per impulse and per
    ``h`` times force; ``states`` (n, 2 stops) likewise for the states.  ``limits`` are the strokes allowed.
    """

    position: Array
    velocity: Array
    states: Array
    limits: Array


@dataclass(frozen=True)
class StopStep:
    """Impulses (stops,) over a step, the amounts that reach the states (2 stops,), and on which side each is touched."""

    impulses: Array
    amounts: Array
    sides: Array


def stop_step(maps: StopMaps, position: Array, velocity: Array) -> StopStep | None:
    """Return what the stops do in a step, ``None`` if nothing.

    Parameters
    ----------
    position, velocity : (stops,) ndarray
        Strokes and their velocities at the end of the step without stops.

    Raises
    ------
    RuntimeError
        No set of stops is consistent.
    """
    count = len(maps.limits)
    over = np.abs(position) > maps.limits
    if not over.any():
        return None
    for touched, leaving, side in _cases(np.where(over, np.sign(position), 0.0)):
        found = _met(maps, position, velocity, (touched, leaving), side)
        if found is None:
            continue
        amounts, sides = found
        if _consistent(maps, position, amounts, sides):
            return StopStep(amounts[:count] + amounts[count:], amounts, sides)
    raise RuntimeError("no consistent set of end stops was found: the stops contradict each other")


def _consistent(maps: StopMaps, position: Array, amounts: Array, sides: Array) -> bool:
    """Return whether no stop is passed, each pushes, and each that is touched would be passed without what it does."""
    count, here = len(sides), np.arange(len(sides))
    shares = maps.position * amounts
    end, own = position + shares.sum(axis=1), shares[here, here] + shares[here, count + here]
    pushed = (amounts[:count] + amounts[count:]) * sides <= 0.0
    needed = (sides == 0.0) | ((end - own) * sides >= maps.limits * (1.0 - _ROUNDING))
    kept = np.abs(end) <= maps.limits * (1.0 + _ROUNDING)
    return bool((pushed & needed & kept).all())


def _cases(over: Array) -> Iterator[tuple[Set, Set, Array]]:
    """Yield the stops that may be touched, those of them that are left at once, and the sides; the likely ones first.

    ``over`` is the side of a stop that is passed without stops, zero where none is.  Any stop may be met on either side,
    because what stops one stroke may drive another.
    """
    count = len(over)
    first = tuple(int(i) for i in np.flatnonzero(over))
    fewer = [choice for size in range(len(first), 0, -1) for choice in combinations(first, size)]
    others = [choice for size in range(1, count + 1) for choice in combinations(range(count), size)]
    for touched in dict.fromkeys([*fewer, *others]):
        for side in product(*((over[i], -over[i]) if over[i] else (1.0, -1.0) for i in touched)):
            for size in range(len(touched) + 1):
                for leaving in combinations(touched, size):
                    yield touched, leaving, np.array(side)


def _met(
    maps: StopMaps, position: Array, velocity: Array, sets: tuple[Set, Set], side: Array
) -> tuple[Array, Array] | None:
    """Return the amounts that bring the stops touched to their limits and those not left at once to rest there."""
    touched, leaving = sets
    count, rows, resting = len(maps.limits), list(touched), [i for i in touched if i not in leaving]
    columns = rows + [count + i for i in resting]
    matrix = np.vstack([maps.position[np.ix_(rows, columns)], maps.velocity[np.ix_(resting, columns)]])
    wanted = np.concatenate([side * maps.limits[rows] - position[rows], -velocity[resting]])
    scale = np.concatenate([np.abs(maps.position[rows, rows]), np.abs(maps.velocity[resting, resting])])
    try:
        solved = np.linalg.solve(matrix / scale[:, None], wanted / scale)
    except np.linalg.LinAlgError:
        return None
    amounts, sides = np.zeros(2 * count), np.zeros(count)
    amounts[columns], sides[rows] = solved, side
    return amounts, sides


def merged_hits(
    names: Sequence[str], h: float, start: float, touched: list[tuple[int, int, int, float, float]]
) -> tuple[StopHit, ...]:
    """Return hits from single steps ``(stop, side, step, impulse, speed)``; consecutive steps are one hit."""
    hits: list[StopHit] = []
    last: dict[int, int] = {}
    open_hit: dict[int, int] = {}
    for stop, side, step, impulse, speed in touched:
        going_on = last.get(stop) == step - 1 and hits[open_hit[stop]].side == side
        last[stop] = step
        if going_on:
            old = hits[open_hit[stop]]
            hits[open_hit[stop]] = StopHit(
                old.output,
                side,
                old.time,
                start + (step + 1) * h,
                old.speed,
                old.impulse + impulse,
                max(old.largest_force, abs(impulse) / h),
            )
        else:
            open_hit[stop] = len(hits)
            hits.append(
                StopHit(names[stop], side, start + step * h, start + (step + 1) * h, speed, impulse, abs(impulse) / h)
            )
    return tuple(hits)
