"""Positions of the parts of a machine and their motion with its coordinates, for plots of its motion.

A structure transforms its :class:`Outline` in every change of coordinates by one more matrix, which is only evaluated for a
plot.
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
        Name of the body.
    is_beam : bool
        True for a beam.
    points : (k, 2) ndarray
        Positions of its points at rest [m].
    x, y : (k, n) ndarray
        Rows that read their displacements [m] off the coordinates.
    """

    name: str
    is_beam: bool
    points: Array
    x: Array
    y: Array

    __repr__ = compact


@dataclass(frozen=True, eq=False)
class Outline:
    """A machine's lines, over coordinates from which those of the machine follow by matrices, the first applied last.

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
        """Return each line with the displacements of its points (motions, points, 2); ``shapes`` are columns of motions."""
        for T in reversed(self.maps):
            shapes = T @ shapes
        lines: tuple[Line, ...] = self.machine.lines()
        return tuple((line, np.stack([(line.x @ shapes).T, (line.y @ shapes).T], axis=2)) for line in lines)
