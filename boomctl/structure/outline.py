"""Where the parts of a machine are, and how they move with its coordinates: what pictures of its motion are drawn from.

A structure carries its :class:`Outline` through every change of coordinates as one more matrix; nothing is computed until a
picture is asked for.
"""

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from boomctl.arrays import Array
from boomctl.printing import compact


@dataclass(frozen=True, eq=False)
class Line:
    """A body as a line of points, and how these move.

    Attributes
    ----------
    name : str
        Of the body.
    bends : bool
        Whether it is a beam.
    points : (k, 2) ndarray
        Where they rest [m].
    x, y : (k, n) ndarray
        Rows that read their displacements [m] off the coordinates.
    """

    name: str
    bends: bool
    points: Array
    x: Array
    y: Array

    __repr__ = compact


@dataclass(frozen=True, eq=False)
class Outline:
    """A machine's lines, over coordinates that its own follow from by matrices, the first applied last.

    Attributes
    ----------
    machine : object
        With the method ``lines()``, which returns them over its own coordinates.
    maps : tuple of ndarray
        ``q = maps[0] @ maps[1] @ ... z``.
    parity : int
        1 where the coordinates move symmetrically alone, -1 antisymmetrically; 0 without such a restriction.
    """

    machine: Any = field(repr=False)
    maps: tuple[Array, ...] = field(default=(), repr=False)
    parity: int = 0

    def moved(self, shapes: Array) -> tuple[tuple[Line, Array], ...]:
        """Return each line, and how its points move (motions, points, 2) with motions of the coordinates in columns."""
        for T in reversed(self.maps):
            shapes = T @ shapes
        lines: tuple[Line, ...] = self.machine.lines()
        return tuple((line, np.stack([(line.x @ shapes).T, (line.y @ shapes).T], axis=2)) for line in lines)


def mapped(outline: Outline | None, T: Array, parity: int = 0) -> Outline | None:
    """Return an outline, if there is one, over coordinates ``z`` with ``q = T z``."""
    return None if outline is None else Outline(outline.machine, (*outline.maps, T), parity or outline.parity)
