"""A measured scene: points of run time and error, their fronts, and by how much our front leads."""

from collections.abc import Iterable
from dataclasses import dataclass
from math import inf, isfinite, log
from typing import Literal

from boomctl.lti.rounding import LEVEL

Calls = Literal["cold", "hot"]


@dataclass(frozen=True)
class Point:
    """A method at one setting, measured.

    Attributes
    ----------
    method, label, ours, verified
        As of the setting.
    error : float
        Of the answer; infinite where there is none.
    cold, hot : float or None
        Run time [s] of the first call in a new process, and of later calls there; the problem is built in either.
    cold_processor, hot_processor : float or None
        The same as processor time of all threads [s].
    memory : float or None
        Largest resident memory of the process, with Python and all that it imports [bytes].
    size : int
        As of the setting; nonzero where run time is measured over the size of the problem.
    failed : str
        Why there is no answer; empty where there is one.
    call : str
        As of the setting.
    """

    method: str
    label: str
    ours: bool
    verified: bool
    error: float = inf
    cold: float | None = None
    hot: float | None = None
    cold_processor: float | None = None
    hot_processor: float | None = None
    memory: float | None = None
    size: int = 0
    failed: str = ""
    call: str = ""

    def elapsed(self, calls: Calls) -> float | None:
        """Return the run time of the first call, or of a later one [s]."""
        return self.cold if calls == "cold" else self.hot


@dataclass(frozen=True)
class Diagram:
    """All points of a scene: those with errors, and those of other sizes, whose run time alone is measured."""

    key: str
    title: str
    question: str
    measure: str
    points: tuple[Point, ...]
    remarks: tuple[str, ...] = ()
    sized: tuple[Point, ...] = ()

    def front(self, calls: Calls, ours: bool | None = None) -> tuple[Point, ...]:
        """Return the points that no other one beats in both run time and error, the fastest first.

        Parameters
        ----------
        way : "cold" or "hot"
        ours : bool, optional
            Only ours, or only those of others.
        """
        chosen = [p for p in self.points if ours in (None, p.ours) and isfinite(p.error)]
        front: list[Point] = []
        for point in sorted(chosen, key=lambda p: (p.elapsed(calls) or inf, p.error)):
            if point.elapsed(calls) is not None and (not front or point.error < front[-1].error):
                front.append(point)
        return tuple(front)

    def leads(self, calls: Calls) -> list[tuple[float, Point, Point | None]]:
        """Compare each point of the others' front with our fastest one of no larger error, but for rounding.

        Returns
        -------
        list of (float, Point, Point or None)
            Run time of the other over that of ours, the other, and ours: 0 and None where ours has no such error; the least
            first.
        """
        result = []
        for other in self.front(calls, ours=False):
            able = (p for p in self.front(calls, ours=True) if p.error <= other.error * (1.0 + LEVEL))
            best, theirs = next(able, None), other.elapsed(calls)
            taken = best and best.elapsed(calls)
            result.append((theirs / taken if taken and theirs else 0.0, other, best))
        return sorted(result, key=lambda lead: lead[0])

    @property
    def methods(self) -> dict[str, tuple[Point, ...]]:
        """The points of each method, in the order of its settings."""
        return by_method(self.points)


def by_method(points: Iterable[Point]) -> dict[str, tuple[Point, ...]]:
    """Return the points of each method, in their order."""
    listed = tuple(points)
    return {name: tuple(p for p in listed if p.method == name) for name in dict.fromkeys(p.method for p in listed)}


def exponent(points: Iterable[Point]) -> float | None:
    """Return the exponent of run time over size, from the smallest to the largest problem; None if one is missing."""
    first, *_, last = sorted(points, key=lambda p: p.size)
    return log(last.hot / first.hot) / log(last.size / first.size) if first.hot and last.hot else None
