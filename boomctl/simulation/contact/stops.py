"""End stops: hard, inelastic, one-sided, by complementarity.

A stop that the motion would pass within the step exerts an impulse at the start of the step and a constant force over it,
such that at the end the stroke is at the stop with zero velocity.  If that needs a tensile force, the motion has already
reversed, and the stop exerts the impulse alone.  The touched stops and their kind of contact are determined for all stops
together, by testing the cases in order of likelihood.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import chain, combinations, product

import numpy as np

from boomctl.arrays import Array
from boomctl.lti.rounding import ALIKE
from boomctl.printing import compact

_DEPENDENT = 1e10  # Condition number of the stops' equations from which they count as dependent: six digits remain.

Set = tuple[int, ...]


@dataclass(frozen=True)
class StopContact:
    """Contact with an end stop from ``time`` to ``end_time``.

    Attributes
    ----------
    output : str
        Name of the stroke.
    side : int
        +1 at the upper, -1 at the lower end.
    time, end_time : float
        Start and end of the contact [s].
    impact_speed : float
        Stroke velocity at the start [m/s].
    impulse : float
        Total impulse of the stop during the contact [N s].
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
    """Linear maps of the stops over a step: effect of impulses at its start and of ``h`` times forces.

    ``position`` and ``velocity`` are (stops, 2 stops): strokes and stroke velocities at the end per impulse and per
    ``h`` times force; ``states`` (n, 2 stops) is the same map for the states.  ``limits`` are the allowed strokes.
    """

    position: Array
    velocity: Array
    states: Array
    limits: Array
    answers: dict[tuple[Set, Set], Array | None] = field(default_factory=dict, repr=False, compare=False)

    def answer(self, touched: Set, leaving: Set) -> Array | None:
        """Return the amounts (2 stops) per unit change of ``[strokes, then velocities]`` of the touched stops.

        Strokes of all touched stops, velocities of those that are not ``leaving``; ``None`` if the equations are dependent.
        Cached for each choice of stops.
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
    """Impulses (stops,) over a step, the amounts that act on the states (2 stops,), and the touched side of each."""

    impulses: Array
    amounts: Array
    sides: Array


def stop_step(maps: StopMaps, position: Array, velocity: Array) -> StopStep | None:
    """Return the effect of the stops in a step, ``None`` if none is touched.

    Parameters
    ----------
    position, velocity : (stops,) ndarray
        Strokes and their velocities at the end of the step without stops.

    Raises
    ------
    ArithmeticError
        If no set of stops is consistent.
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
    """Return True if no stop is passed, each touched stop pushes, and would be passed without its own effect."""
    count, limits = len(end), maps.limits.tolist()
    for i, side in zip(*met, strict=True):
        if (amounts[i] + amounts[count + i]) * side > 0.0:
            return False
        own = float(maps.position[i, i]) * amounts[i] + float(maps.position[i, count + i]) * amounts[count + i]
        if (end[i] - own) * side < limits[i] * (1.0 - ALIKE):  # tolerance relative to the stroke limit
            return False
    return all(abs(x) <= limit * (1.0 + ALIKE) for x, limit in zip(end, limits, strict=True))


def _cases(over: list[float]) -> Iterator[tuple[Set, Set, tuple[float, ...]]]:
    """Yield candidate sets of touched stops, the stops of them with an impulse alone, and the sides; likely cases first.

    ``over`` is the side of a stop that is passed without stops, zero if none is.  Any stop may be touched on either side,
    because the force of one stop may drive another stroke.
    """
    count, tested = len(over), set[Set]()
    first = tuple(i for i, side in enumerate(over) if side)
    fewer = (choice for size in range(len(first), 0, -1) for choice in combinations(first, size))
    others = (choice for size in range(1, count + 1) for choice in combinations(range(count), size))
    for touched in chain(fewer, others):
        if touched in tested:
            continue
        tested.add(touched)
        for side in product(*((over[i], -over[i]) if over[i] else (1.0, -1.0) for i in touched)):
            for size in range(len(touched) + 1):
                for leaving in combinations(touched, size):
                    yield touched, leaving, side


def merged_hits(
    names: Sequence[str], h: float, start: float, touched: list[tuple[int, int, int, float, float]]
) -> tuple[StopContact, ...]:
    """Return contacts from single steps ``(stop, side, step, impulse, speed)``; consecutive steps are one contact."""
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
