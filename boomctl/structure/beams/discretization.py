"""What every beam discretisation hands to the assembly: coordinates, mass, strain rows, interpolation."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

import numpy as np
from scipy import sparse

from boomctl.arrays import Array
from boomctl.checks import finite_array, whole

if TYPE_CHECKING:
    from boomctl.structure.parts import Beam

Interpolation = tuple[Array, Array]


@dataclass(frozen=True)
class BeamMesh:
    """A beam turned into coordinates.

    Attributes
    ----------
    nodes : ndarray
        Stations of the nodes [m], ascending.
    names : tuple of str
        One name a coordinate, along the beam: ``w0, phi0, w1, phi1, ...``.
    mass : sparse array
        Mass matrix.
    strain : sparse array
        One line a strain mode; the stiffness matrix is ``strain^T diag(stiffness) strain``.
    stiffness, damping : ndarray
        Stiffness and damping coefficient of each strain mode.
    massless : ndarray of int
        Coordinates without mass, to be condensed.
    order : int
        Polynomial order of the deflection within an element.
    """

    nodes: Array
    names: tuple[str, ...]
    mass: sparse.csr_array
    strain: sparse.csr_array
    stiffness: Array
    damping: Array
    massless: Array
    order: int

    def interpolation(self, station: float, derivative: int) -> Interpolation:
        """Return indices and coefficients of deflection (``derivative`` 0) or slope (1) at ``station``."""
        from boomctl.structure.beams.elements import shape_functions

        e = int(np.clip(np.searchsorted(self.nodes, station, side="right") - 1, 0, len(self.nodes) - 2))
        near = e if station - self.nodes[e] <= self.nodes[e + 1] - station else e + 1
        per_node = self.order - 1
        if abs(station - self.nodes[near]) <= 1e-12 * (self.nodes[-1] - self.nodes[0]):
            return np.array([per_node * near + derivative]), np.array([1.0])
        h = self.nodes[e + 1] - self.nodes[e]
        xi = 2.0 * (station - self.nodes[e]) / h - 1.0
        coefficients = shape_functions(np.array([xi]), h, self.order, derivative)[:, 0]
        return per_node * e + element_coordinates(self.order), coefficients


class Discretization(Protocol):
    """A way to turn a beam into coordinates."""

    def mesh(self, beam: "Beam", attachments: Sequence[float]) -> BeamMesh:
        """Return the mesh of ``beam``; something is attached to it at the stations ``attachments``."""
        ...


def element_coordinates(order: int) -> Array:
    """Return the places, counted from an element's first, of its coordinates ``w1, phi1, w2, phi2, bubbles``."""
    per_node = order - 1
    return np.array([0, 1, per_node, per_node + 1, *range(2, per_node)])


@dataclass(frozen=True)
class SectionValues:
    """Section properties, one value an element."""

    mass_per_length: Array
    bending_stiffness: Array
    damping: Array


def section_values(beam: "Beam", nodes: Array) -> SectionValues:
    """Return the section properties of ``beam`` in each interval between ``nodes``."""
    ends = np.cumsum([section.length for section in beam.sections])
    which = np.minimum(np.searchsorted(ends, 0.5 * (nodes[1:] + nodes[:-1])), len(beam.sections) - 1)

    def of(attribute: str) -> Array:
        return np.array([getattr(section, attribute) for section in beam.sections])[which]

    return SectionValues(of("mass_per_length"), of("bending_stiffness"), of("damping"))


def element_nodes(beam: "Beam", elements: int | Sequence[float]) -> Array:
    """Return node stations: ``elements`` equal elements, or those given; section ends are nodes in any case.

    On a stepped beam a number of elements is shared out among the sections by their length.

    Raises
    ------
    ValueError
        Fewer elements than sections; stations not ascending or not from 0 to the beam's length.
    """
    length = beam.length
    ends = np.cumsum([section.length for section in beam.sections])[:-1]
    if isinstance(elements, (int, np.integer)):
        marks = np.concatenate([[0.0], ends, [length]])
        return shared_out(marks, whole("elements", elements), f"beam {beam.name!r} has {len(marks) - 1} sections")
    nodes = finite_array(f"node stations of beam {beam.name!r}", np.asarray(elements), ndim=1)
    if len(nodes) < 2 or not (np.diff(nodes) > 0.0).all():
        raise ValueError(f"node stations of beam {beam.name!r}: expected at least two, ascending")
    if abs(nodes[0]) > 1e-9 * length or abs(nodes[-1] - length) > 1e-9 * length:
        span = f"run from {nodes[0]:g} to {nodes[-1]:g} m"
        raise ValueError(f"node stations of beam {beam.name!r} {span}; expected 0 to {length:g} m")
    missing = [end for end in ends if np.abs(nodes - end).min() > 1e-9 * length]
    return np.sort(np.concatenate([nodes, missing]))


def shared_out(marks: Array, elements: int, why: str) -> Array:
    """Return nodes of ``elements`` elements, equal between ``marks`` and as alike as can be among the intervals."""
    widths = np.diff(marks)
    if elements < len(widths):
        raise ValueError(f"elements = {elements}: {why}, expected at least as many elements")
    shares = np.ones(len(widths), dtype=int)
    for _ in range(elements - len(widths) if len(widths) > 1 else 0):
        shares[np.argmax(widths / shares)] += 1
    if len(widths) == 1:
        shares[0] = elements
    pieces = [np.linspace(a, b, n + 1)[:-1] for a, b, n in zip(marks[:-1], marks[1:], shares, strict=True)]
    return np.concatenate([*pieces, marks[-1:]])
