"""A scene measured: points of run time and error, fronts, how far one front is ahead of another, promises held or not."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from math import inf, isfinite
from typing import Literal

Way = Literal["cold", "hot"]
Shown = Literal["front", "unknowns", "promises"]
_ALIKE = 1e-6  # of an error, by which two programs on one mesh differ at most: rounding (measured: 1e-9)


@dataclass(frozen=True)
class Kept:
    """A promise, and what was found of it.

    Attributes
    ----------
    text : str
        What the number is.
    value : float or None
        The number; None where this run did not measure what it needs.
    bound : float or None
        What was promised; None where the number is only told.
    least : bool
        Whether the number is to be as large at least, and not at most.
    """

    text: str
    value: float | None
    bound: float | None = None
    least: bool = False

    @property
    def held(self) -> bool | None:
        """Whether the bound is kept; None without a bound, or where this run did not try it."""
        if self.value is None or self.bound is None:
            return None
        return self.value >= self.bound if self.least else self.value <= self.bound


@dataclass(frozen=True)
class Point:
    """A competitor at one setting, measured.

    Attributes
    ----------
    competitor, label, ours, call
        As of the setting.
    error : float
        Relative error of its answer; infinite if there is none.
    cold, hot : float or None
        Median processor time of a call [s], from new parameters and with the model ready; None where there is no such way.
    memory : int or None
        The most memory that a call held at a time [bytes]; None where it was not measured.
    calls : int
        How many calls the median is of.
    failed : str
        Why there is no answer; empty where there is one.
    size : int or None
        As of the setting.
    found : mapping of str to float
        Further numbers of its answer, as the scene finds them.
    """

    competitor: str
    label: str
    ours: bool
    error: float
    cold: float | None = None
    hot: float | None = None
    memory: int | None = None
    calls: int = 0
    call: str = ""
    failed: str = ""
    size: int | None = None
    found: Mapping[str, float] = field(default_factory=dict, hash=False)

    def seconds(self, way: Way) -> float | None:
        """Return the run time of a way; a hot call takes no longer than a cold one where only that was measured."""
        return self.cold if way == "cold" else self.cold if self.hot is None else self.hot


@dataclass(frozen=True)
class Lead:
    """Our front beside a point of the others' front.

    Attributes
    ----------
    error : float
        Of the point.
    other : Point
    ours : Point or None
        The fastest of ours that is at least as exact; None where none is.
    ratio : float
        The other's run time over ours; zero where none of ours is as exact.
    """

    error: float
    other: Point
    ours: Point | None
    ratio: float


@dataclass(frozen=True)
class Diagram:
    """All points of a scene, and what is said of them."""

    key: str
    title: str
    question: str
    measure: str
    points: tuple[Point, ...]
    missing: tuple[str, ...] = ()
    remarks: tuple[str, ...] = ()
    kept: tuple[Kept, ...] = ()
    shows: Shown = "front"

    def front(self, way: Way, ours: bool | None = None) -> tuple[Point, ...]:
        """Return the points than which none is both faster and at least as exact, the fastest first.

        Parameters
        ----------
        way : "cold" or "hot"
        ours : bool, optional
            Only ours, or only the others'.
        """
        chosen = (p for p in self.points if ours is None or p.ours is ours)
        timed = [p for p in chosen if p.seconds(way) is not None and isfinite(p.error)]
        kept: list[Point] = []
        for point in sorted(timed, key=lambda p: (p.seconds(way), p.error)):
            if not kept or point.error < kept[-1].error:
                kept.append(point)
        return tuple(kept)

    def leads(self, way: Way) -> tuple[Lead, ...]:
        """Return our front beside each point of the others' front."""
        mine = self.front(way, ours=True)
        found = []
        for other in self.front(way, ours=False):
            best = self.cheapest(other.error, way, mine)
            taken, theirs = None if best is None else best.seconds(way), other.seconds(way)
            found.append(Lead(other.error, other, best, theirs / taken if taken and theirs else 0.0))
        return tuple(found)

    def cheapest(self, error: float, way: Way, among: Iterable[Point] | None = None) -> Point | None:
        """Return the fastest point that is at least so exact, but for rounding; None if there is none."""
        exact = error * (1.0 + _ALIKE)
        within = [
            p for p in (self.points if among is None else among) if p.error <= exact and p.seconds(way) is not None
        ]
        return min(within, key=lambda p: p.seconds(way) or inf, default=None)

    @property
    def competitors(self) -> dict[str, tuple[Point, ...]]:
        """The points of each competitor, in the order of its settings."""
        names = dict.fromkeys(p.competitor for p in self.points)
        return {name: tuple(p for p in self.points if p.competitor == name) for name in names}
