"""What a scene promises of its diagram: a number that is read off it, and the bound that the number keeps."""

from collections.abc import Callable
from dataclasses import dataclass
from math import inf

import numpy as np

from boomctl.lab.benchmark.diagram import Diagram, Kept, Point, Way

_WAYS: dict[Way, str] = {"cold": "from new parameters", "hot": "model ready"}


@dataclass(frozen=True)
class Promise:
    """A number read off a diagram, and its bound.

    Attributes
    ----------
    text : str
        What the number is.
    read : callable
        Takes a diagram to the number; None where the diagram has not what it needs.
    bound : float or None
        What this package promised itself; None where the number is only told.
    least : bool
        Whether the number is to be as large at least, and not at most.
    of_time : bool
        Whether it is made of run times, which a quick run's small sizes do not tell.
    """

    text: str
    read: Callable[[Diagram], float | None]
    bound: float | None = None
    least: bool = False
    of_time: bool = False

    def of(self, diagram: Diagram) -> Kept:
        """Return what a diagram says of it."""
        return Kept(self.text, self.read(diagram), self.bound, self.least)


@dataclass(frozen=True)
class Who:
    """Points of a diagram: of competitors whose names begin so, at one setting or any, as exact as asked for."""

    name: str
    label: str = ""
    error: float = inf

    def __str__(self) -> str:
        """Return it in words."""
        exact = "" if self.error == inf else f" to {self.error:.0e}"
        return ", ".join(filter(None, [self.name, self.label])) + exact

    def points(self, diagram: Diagram) -> list[Point]:
        """Return all of them, exact enough or not."""
        found = [p for p in diagram.points if p.competitor.startswith(self.name)]
        return [p for p in found if self.label in ("", p.label)]

    def fastest(self, diagram: Diagram, way: Way) -> float | None:
        """Return the shortest run time of those exact enough [s]: infinite if there is none, None if none was asked."""
        points = self.points(diagram)
        best = diagram.cheapest(self.error, way, points)
        return None if not points else inf if best is None else best.seconds(way)


def times_as_fast(ours: Who, other: Who, ratio: float | None, way: Way = "hot") -> Promise:
    """Promise that another takes so many times as long as ours, at least; None: only tell how many."""
    return Promise(
        f"{other}: times the run time of {ours}, {_WAYS[way]}", _ratio(other, ours, way), ratio, True, of_time=True
    )


def times_the_cost(ours: Who, other: Who, ratio: float, way: Way = "hot") -> Promise:
    """Promise that ours takes so many times as long as another, at most."""
    return Promise(
        f"{ours}: times the run time of {other}, {_WAYS[way]}", _ratio(ours, other, way), ratio, of_time=True
    )


def _ratio(top: Who, bottom: Who, way: Way) -> Callable[[Diagram], float | None]:
    def read(diagram: Diagram) -> float | None:
        above, below = top.fastest(diagram, way), bottom.fastest(diagram, way)
        if not above or not below or above == inf:
            return None  # nobody was asked, or none of the other's settings is so exact
        return 0.0 if below == inf else above / below

    return read


def seconds(who: Who, most: float, way: Way = "cold") -> Promise:
    """Promise that a call takes so long at most [s]."""
    return Promise(f"{who}: run time [s], {_WAYS[way]}", lambda diagram: who.fastest(diagram, way), most, of_time=True)


def exact(who: Who, error: float) -> Promise:
    """Promise that every answer is as exact as that."""
    return Promise(f"{who}: error", lambda diagram: _largest(who.points(diagram), lambda p: p.error), error)


def no_less_exact(ours: Who, other: Who, share: float = 1.0) -> Promise:
    """Promise that the error of ours is no larger than so large a share of another's."""

    def read(diagram: Diagram) -> float | None:
        mine, theirs = (_largest(who.points(diagram), lambda p: p.error) for who in (ours, other))
        return None if mine is None or theirs is None else 0.0 if theirs == inf else mine / theirs if theirs else inf

    return Promise(f"{ours}: error over that of {other}", read, share)


def number(who: Who, name: str, bound: float | None, least: bool = False) -> Promise:
    """Promise the bound of a number that the scene finds of each answer."""

    def read(diagram: Diagram) -> float | None:
        sign = -1.0 if least else 1.0
        found = _largest(who.points(diagram), lambda p: sign * p.found.get(name, sign * inf))
        return None if found is None else sign * found

    return Promise(f"{who}: {name}", read, bound, least)


def growth(who: Who, exponent: float, of: str = "run time") -> Promise:
    """Promise how run time, or memory, grows with size at most: the slope of the logarithms over the upper half of the sizes.

    What a call costs beside the growing part makes it smaller.
    """

    def read(diagram: Diagram) -> float | None:
        values = [(p.size, p.seconds("hot") if of == "run time" else p.memory) for p in who.points(diagram)]
        pairs = [(size, value) for size, value in values if size and value]
        if len(pairs) < 2:
            return None
        sizes, upper = np.log(pairs[-max(2, (len(pairs) + 1) // 2) :]).T
        return float(np.polyfit(sizes, upper, 1)[0])

    return Promise(f"{who}: exponent of {of} over size", read, exponent, of_time=True)


def _largest(points: list[Point], value: Callable[[Point], float]) -> float | None:
    return max(map(value, points), default=None)
