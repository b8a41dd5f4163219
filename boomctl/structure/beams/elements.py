"""Beam discretizations: finite elements, high-order elements, discrete elements."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from boomctl.arrays import Array
from boomctl.checks import exactly, finite_array, from_on, known, whole
from boomctl.structure.beams.mesh import BeamMesh, element_mesh
from boomctl.structure.parts import Beam

MOST_ELEMENTS = 1_000_000  # Limit on the elements of a beam; a finer mesh only adds rounding error.
_ELEMENT = 5e-13  # Shortest element relative to the beam; modes are inaccurate with shorter ones.


@dataclass(frozen=True)
class FiniteElements:
    """Discretization of a beam by Hermite finite elements with consistent mass.

    Attachments inside an element act on its interpolated displacement.

    Parameters
    ----------
    elements : int or sequence of float
        A number of equal elements, or node stations from the beam's start [m].
    order : int
        Polynomial order within an element: 3 (cubic, the default) to 20.

    Raises
    ------
    TypeError, ValueError
        A number of elements or an order out of range.

    Examples
    --------
    >>> import boomctl as bc
    >>> s = bc.structure
    >>> stretch = s.BeamSegment(length=2.0, mass_per_length=3.0, bending_stiffness=5e3)
    >>> beam = s.Beam("beam", s.GROUND.at(0.0), s.fixed(), (0.0, 0.0), (stretch,), s.FiniteElements(2, order=6))
    >>> s.Assembly((beam,)).assemble().eigenfrequencies_hz(2).round(3)  # two elements of high order do
    array([ 5.711, 35.792])
    """

    elements: int | tuple[float, ...] = 6
    order: int = 3

    def __post_init__(self) -> None:
        object.__setattr__(self, "elements", _elements(self.elements))
        whole("order", self.order, 3, 20)

    def mesh(self, beam: Beam, attachments: Sequence[float]) -> BeamMesh:
        """Return the mesh of a beam; attachments need not be at nodes.

        Parameters
        ----------
        beam : Beam
            The beam.
        attachments : sequence of float
            Stations of the attachments [m].

        Returns
        -------
        BeamMesh
            Nodes and matrices of the elements.

        Raises
        ------
        TypeError, ValueError
            Node stations that do not ascend from one end of the beam to the other.
        """
        nodes = element_nodes(beam, self.elements)
        return element_mesh(nodes, element_sections(beam, nodes), self.order)


@dataclass(frozen=True)
class DiscreteElements:
    """Discrete elements: massless cubic beam elements between mass points.

    All attachments to the beam must be at mass points (Anthonis & Ramon 2003, section 4).

    Parameters
    ----------
    elements : int or sequence of float
        Number of elements, distributed over the intervals between attachments by length, or node stations [m].
    mass : "hermite", "linear" or "lumped"
        Mass allocation: by Hermitian interpolation, by linear interpolation, or geometrically, half of each element to
        either of its ends.

    Raises
    ------
    TypeError, ValueError
        If the number of elements is not whole or out of range, or if ``mass`` is unknown.

    Examples
    --------
    >>> import boomctl as bc
    >>> s = bc.structure
    >>> stretch = s.BeamSegment(length=2.0, mass_per_length=3.0, bending_stiffness=5e3)
    >>> beam = s.Beam("beam", s.GROUND.at(0.0), s.fixed(), (0.0, 0.0), (stretch,), s.DiscreteElements(8, "lumped"))
    >>> s.Assembly((beam,)).assemble().eigenfrequencies_hz(2).round(3)  # 5.711 and 35.792 Hz exactly
    array([ 5.671, 34.926])
    """

    elements: int | tuple[float, ...] = 6
    mass: str = "hermite"

    def __post_init__(self) -> None:
        object.__setattr__(self, "elements", _elements(self.elements))
        known("mass allocation", self.mass, ("hermite", "linear", "lumped"))

    def mesh(self, beam: Beam, attachments: Sequence[float]) -> BeamMesh:
        """Return the mesh of ``beam``; each of ``attachments`` must be a node or becomes one.

        Parameters
        ----------
        beam : Beam
            The beam.
        attachments : sequence of float
            Stations of the attachments [m].

        Returns
        -------
        BeamMesh
            Nodes and matrices of the elements.

        Raises
        ------
        ValueError
            If an attachment is not at a node, or if there are fewer elements than intervals.
        """
        if isinstance(self.elements, int):
            marks = element_nodes(beam, (0.0, *distinct(attachments, beam.length), beam.length))
            why = f"beam {beam.name!r} has {len(marks) - 1} intervals between attachments"
            nodes = shared_out(marks, self.elements, why)
        else:
            nodes = element_nodes(beam, self.elements)
        for station in attachments:
            if np.abs(nodes - station).min() > 1e-9 * beam.length:
                raise ValueError(
                    f"discrete elements of beam {beam.name!r}: something is attached at station {station:g} m,"
                    " which is not a mass allocation point; expected a node there"
                )
        return element_mesh(nodes, element_sections(beam, nodes), 3, self.mass)


def _elements(elements: int | Sequence[float]) -> int | tuple[float, ...]:
    """Return a checked number of elements, or their node stations."""
    if isinstance(elements, (int, np.integer)):
        return whole("elements", elements, most=MOST_ELEMENTS)
    return tuple(finite_array("elements", elements, ndim=1).tolist())


def distinct(stations: Sequence[float], length: float) -> list[float]:
    """Return the distinct stations inside the beam, to within rounding."""
    result: list[float] = []
    for station in sorted(stations):
        if 1e-9 * length < station < (1.0 - 1e-9) * length and (not result or station - result[-1] > 1e-9 * length):
            result.append(station)
    return result


def element_sections(beam: Beam, nodes: Array) -> Array:
    """Return the index of the segment of ``beam`` for each interval between ``nodes``."""
    ends = np.cumsum([section.length for section in beam.segments])
    return np.minimum(np.searchsorted(ends, 0.5 * (nodes[1:] + nodes[:-1])), len(beam.segments) - 1)


def element_nodes(beam: Beam, elements: int | Sequence[float]) -> Array:
    """Return node stations: ``elements`` equal elements, or the stations in ``elements``; segment ends are always nodes.

    On a stepped beam a number of elements is distributed over the segments by length.

    Raises
    ------
    ValueError
        If there are fewer elements than segments, if stations do not ascend from 0 to the beam's length, or if an element
        is shorter than 5e-13 of the beam.
    """
    length = beam.length
    ends = np.cumsum([section.length for section in beam.segments])[:-1]
    if isinstance(elements, int):
        marks = np.concatenate([[0.0], ends, [length]])
        nodes = shared_out(marks, elements, f"beam {beam.name!r} has {len(marks) - 1} segments")
    else:
        nodes = np.array(elements, dtype=float)
        if len(nodes) < 2 or not (np.diff(nodes) > 0.0).all():
            raise ValueError(f"node stations of beam {beam.name!r}: expected at least two, ascending")
        if abs(nodes[0]) > 1e-9 * length or abs(nodes[-1] - length) > 1e-9 * length:
            span = f"run from {exactly(nodes[0])} to {exactly(nodes[-1])} m"
            raise ValueError(f"node stations of beam {beam.name!r} {span}; expected 0 to {exactly(length)} m")
        missing = [end for end in ends if np.abs(nodes - end).min() > 1e-9 * length]
        nodes = np.sort(np.concatenate([nodes, missing]))
    widths = np.diff(nodes)
    shortest = int(np.argmin(widths))
    if widths[shortest] < _ELEMENT * length:
        raise ValueError(
            f"beam {beam.name!r}: between {exactly(nodes[shortest])} and {exactly(nodes[shortest + 1])} m its element is"
            f" {widths[shortest]:.2g} m long; expected at least {from_on(_ELEMENT * length)} m, or one node for both"
        )
    return nodes


def shared_out(marks: Array, elements: int, why: str) -> Array:
    """Return nodes of ``elements`` elements, equal between ``marks`` and as equal as possible among the intervals."""
    widths = np.diff(marks)
    if elements < len(widths):
        raise ValueError(f"elements = {elements}: {why}, expected at least as many elements")
    counts = np.ones(len(widths), dtype=int)
    for _ in range(elements - len(widths) if len(widths) > 1 else 0):
        counts[np.argmax(widths / counts)] += 1
    if len(widths) == 1:
        counts[0] = elements
    intervals = [np.linspace(a, b, n + 1)[:-1] for a, b, n in zip(marks[:-1], marks[1:], counts, strict=True)]
    return np.concatenate([*intervals, marks[-1:]])
