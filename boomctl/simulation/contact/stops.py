"""End stops: hard, inelastic, one-sided, by complementarity.

A stop that the motion would pass within the step meets it with an impulse at the beginning of the step and a constant
force over it, such that at the end position and velocity both rest against the stop; where that would have to pull,
the motion is on its way back already, and an impulse alone keeps it from passing.  Which stops are touched, and how, is
decided for all of them together, by trying the cases in order of likelihood.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import chain, combinations, product

import numpy as np

from boomctl.arrays import Array
from boomctl.lti.rounding import ALIKE
from boomctl.printing import compact

_DEPENDENT = 1e10  # condition of the stops' equations from which they count as one: six digits of a force are left

Set = tuple[int, ...]


@dataclass(frozen=True)
class StopContact:
    """A stop touched from ``time`` to ``end_time``.

    Attributes
    ----------
    output : str
        The stroke that ended.
    side : int
        +1 at the upper, -1 at the lower end.
    time, end_time : float
        First and last moment of contact [s].
    impact_speed : float
        Stroke velocity at which it was met [m/s].
    impulse : float
        Total impulse that the stop gave while it was touched [N s].
    peak_force : float
        Largest mean force over a step [N].
    """

    output: str
    side: int
    time: float
    end_time: float
    impact_speed: float
    impulse: float
    peak_force: float

    __repr__ = compact


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
    answers: dict[tuple[Set, Set], Array | None] = field(default_factory=dict, repr=False, compare=False)

    def answer(self, touched: Set, leaving: Set) -> Array | None:
        """Return what amounts (2 stops) per unit of ``[strokes, then velocities]`` wanted of the stops touched.

        Strokes of all of them, velocities of those that are not left at once; ``None`` if these depend on each other.
        Found once for each choice of stops.
        """
        if (touched, leaving) in self.answers:
            return self.answers[touched, leaving]
        count, rows, resting = len(self.limits), list(touched), [i for i in touched if i not in leaving]
        columns = rows + [count + i for i in resting]
        matrix = np.vstack([self.position[np.ix_(rows, columns)], self.velocity[np.ix_(resting, columns)]])
        scale = np.concatenate([np.abs(self.position[rows, rows]), np.abs(self.velocity[resting, resting])])
        result = np.zeros((2 * count, len(columns)))
        try:
            result[columns] = np.linalg.inv(matrix / scale[:, None]) / scale
            sizes = (
                np.abs(matrix / scale[:, None]).sum(axis=1).max() * np.abs(result[columns] * scale).sum(axis=1).max()
            )
        except np.linalg.LinAlgError:
            sizes = np.inf
        self.answers[touched, leaving] = result if sizes < _DEPENDENT else None
        return self.answers[touched, leaving]


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
    ArithmeticError
        No set of stops is consistent.
    """
    strokes, rates, limits = position.tolist(), velocity.tolist(), maps.limits.tolist()
    over = [0.0 if abs(x) <= limit else (1.0 if x > 0.0 else -1.0) for x, limit in zip(strokes, limits, strict=True)]
    if not any(over):
        return None
    count = len(limits)
    for touched, leaving, side in _cases(over):
        answer = maps.answer(touched, leaving)
        if answer is None:
            continue
        wanted = [a * limits[i] - strokes[i] for i, a in zip(touched, side, strict=True)]
        wanted += [-rates[i] for i in touched if i not in leaving]
        amounts = answer @ np.array(wanted)
        end = position + maps.position @ amounts
        if _consistent(maps, end.tolist(), amounts.tolist(), (touched, side)):
            sides = np.zeros(count)
            sides[list(touched)] = side
            return StopStep(amounts[:count] + amounts[count:], amounts, sides)
    raise ArithmeticError(
        "no consistent set of end stops was found: over one step the stops contradict each other; expected finer timepts"
    )


def _consistent(maps: StopMaps, end: list[float], amounts: list[float], met: tuple[Set, tuple[float, ...]]) -> bool:
    """Return whether no stop is passed, each pushes, and each that is touched would be passed without what it does."""
    count, limits = len(end), maps.limits.tolist()
    for i, side in zip(*met, strict=True):
        if (amounts[i] + amounts[count + i]) * side > 0.0:
            return False
        own = float(maps.position[i, i]) * amounts[i] + float(maps.position[i, count + i]) * amounts[count + i]
        if (end[i] - own) * side < limits[i] * (1.0 - ALIKE):  # of a stroke: what may be left over where a stop is met
            return False
    return all(abs(x) <= limit * (1.0 + ALIKE) for x, limit in zip(end, limits, strict=True))


def _cases(over: list[float]) -> Iterator[tuple[Set, Set, tuple[float, ...]]]:
    """Yield the stops that may be touched, those of them that are left at once, and the sides; the likely ones first.

    ``over`` is the side of a stop that is passed without stops, zero where none is.  Any stop may be met on either side,
    because what stops one stroke may drive another.
    """
    count, seen = len(over), set[Set]()
    first = tuple(i for i, side in enumerate(over) if side)
    fewer = (choice for size in range(len(first), 0, -1) for choice in combinations(first, size))
    others = (choice for size in range(1, count + 1) for choice in combinations(range(count), size))
    for touched in chain(fewer, others):
        if touched in seen:
            continue
        seen.add(touched)
        for side in product(*((over[i], -over[i]) if over[i] else (1.0, -1.0) for i in touched)):
            for size in range(len(touched) + 1):
                for leaving in combinations(touched, size):
                    yield touched, leaving, side


def merged_hits(
    names: Sequence[str], h: float, start: float, touched: list[tuple[int, int, int, float, float]]
) -> tuple[StopContact, ...]:
    """Return hits from single steps ``(stop, side, step, impulse, speed)``; consecutive steps are one hit."""
    hits: list[StopContact] = []
    last: dict[int, int] = {}
    open_hit: dict[int, int] = {}
    for stop, side, step, impulse, speed in touched:
        going_on = last.get(stop) == step - 1 and hits[open_hit[stop]].side == side
        last[stop] = step
        until = start + (step + 1) * h
        if going_on:
            old = hits[open_hit[stop]]
            largest = max(old.peak_force, abs(impulse) / h)
            hits[open_hit[stop]] = replace(old, end_time=until, impulse=old.impulse + impulse, peak_force=largest)
        else:
            open_hit[stop] = len(hits)
            hits.append(StopContact(names[stop], side, start + step * h, until, speed, impulse, abs(impulse) / h))
    return tuple(hits)
