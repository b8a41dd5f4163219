"""Rows: the small displacement of a point along a direction as a linear combination of named coordinates."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from math import cos, sin

import numpy as np
from scipy import sparse


@dataclass(frozen=True)
class Row:
    """A linear combination of coordinates, ``sum(terms[name] * coordinate[name])``.

    In a system of small motions everything is a row: a spring adds ``k r^T r``, a force acts through ``r^T``,
    an output reads ``r z``.
    """

    terms: Mapping[str, float] = field(default_factory=dict)

    @classmethod
    def of(cls, coordinate: str) -> "Row":
        """Return the row that reads one coordinate."""
        return cls({coordinate: 1.0})

    def __add__(self, other: "Row") -> "Row":
        terms = dict(self.terms)
        for name, value in other.terms.items():
            terms[name] = terms.get(name, 0.0) + value
        return Row({name: value for name, value in terms.items() if value != 0.0})

    def __mul__(self, factor: float) -> "Row":
        return Row({name: factor * value for name, value in self.terms.items() if factor * value != 0.0})

    __rmul__ = __mul__

    def __neg__(self) -> "Row":
        return self * -1.0

    def __sub__(self, other: "Row") -> "Row":
        return self + (-other)


@dataclass(frozen=True)
class Frame:
    """The small motion of a body-fixed frame whose origin rests at ``(x0, y0)``: two displacements, one rotation."""

    x0: float
    y0: float
    x: Row = field(default_factory=Row)
    y: Row = field(default_factory=Row)
    theta: Row = field(default_factory=Row)

    def moved_to(self, x0: float, y0: float) -> "Frame":
        """Return the motion of the point of the same rigid body that rests at ``(x0, y0)``."""
        dx, dy = x0 - self.x0, y0 - self.y0
        return Frame(x0, y0, self.x - dy * self.theta, self.y + dx * self.theta, self.theta)

    def along(self, angle: float) -> Row:
        """Return the displacement along the direction at ``angle`` (rad, from the x axis)."""
        c, s = cos(angle), sin(angle)
        c, s = (0.0 if abs(c) < 1e-15 else c), (0.0 if abs(s) < 1e-15 else s)
        return c * self.x + s * self.y


def row_matrix(rows: Sequence[Row], index: Mapping[str, int]) -> sparse.csr_array:
    """Stack rows into a sparse matrix, one line a row and one column a coordinate of ``index``."""
    data, line, column = [], [], []
    for i, row in enumerate(rows):
        for name, value in row.terms.items():
            data.append(value)
            line.append(i)
            column.append(index[name])
    return sparse.csr_array((np.array(data, float), (line, column)), shape=(len(rows), len(index)))
