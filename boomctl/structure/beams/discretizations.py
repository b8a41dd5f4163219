"""Beam discretisations as interchangeable parts: finite elements, high-order elements, discrete elements."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from boomctl.checks import known, whole
from boomctl.structure.beams.discretization import BeamMesh, element_nodes, section_values, shared_out
from boomctl.structure.beams.elements import element_mesh

if TYPE_CHECKING:
    from boomctl.structure.parts import Beam


@dataclass(frozen=True)
class FiniteElements:
    """Hermite finite elements with consistent mass.

    What is attached inside an element acts on its interpolated displacement.

    Parameters
    ----------
    elements : int or sequence of float
        A number of equal elements, or node stations from the beam's start [m].
    order : int
        Polynomial order within an element: 3 (cubic, the default) to 20.
    """

    elements: int | tuple[float, ...] = 6
    order: int = 3

    def __post_init__(self) -> None:
        if isinstance(self.elements, (int, np.integer)):
            whole("elements", self.elements)
        if not 3 <= whole("order", self.order, least=3) <= 20:
            raise ValueError(f"order = {self.order}: expected 3 to 20")

    def mesh(self, beam: "Beam", attachments: Sequence[float]) -> BeamMesh:
        """Return the mesh of ``beam``; ``attachments`` need not be nodes."""
        nodes = element_nodes(beam, self.elements)
        return element_mesh(nodes, section_values(beam, nodes), self.order)


@dataclass(frozen=True)
class DiscreteElements:
    """Discrete elements: massless cubic beam elements between mass allocation points.

    Whatever is attached to the beam must be at a mass allocation point (Anthonis & Ramon 2003, section 4).

    Parameters
    ----------
    elements : int or sequence of float
        A number of elements, shared out among the intervals between attachments by their length, or node stations [m].
    mass : "hermite", "linear" or "lumped"
        How mass is allocated: through Hermitian interpolation, through linear interpolation, or geometrically,
        half of each element to either of its ends.
    """

    elements: int | tuple[float, ...] = 6
    mass: str = "hermite"

    def __post_init__(self) -> None:
        if isinstance(self.elements, (int, np.integer)):
            whole("elements", self.elements)
        known("mass allocation", self.mass, ("hermite", "linear", "lumped"))

    def mesh(self, beam: "Beam", attachments: Sequence[float]) -> BeamMesh:
        """Return the mesh of ``beam``; each of ``attachments`` must be a node or becomes one.

        Raises
        ------
        ValueError
            An attachment is not at one of the node stations given, or there are fewer elements than intervals.
        """
        if isinstance(self.elements, (int, np.integer)):
            marks = element_nodes(beam, (0.0, *distinct(attachments, beam.length), beam.length))
            why = f"beam {beam.name!r} has {len(marks) - 1} intervals between attachments"
            nodes = shared_out(marks, whole("elements", self.elements), why)
        else:
            nodes = element_nodes(beam, self.elements)
        for station in attachments:
            if np.abs(nodes - station).min() > 1e-9 * beam.length:
                raise ValueError(
                    f"discrete elements of beam {beam.name!r}: something is attached at station {station:g} m,"
                    " which is not a mass allocation point; expected a node there"
                )
        return element_mesh(nodes, section_values(beam, nodes), 3, self.mass)


def distinct(stations: Sequence[float], length: float) -> list[float]:
    """Return the stations inside the beam, those closer than rounding counted once."""
    kept: list[float] = []
    for station in sorted(stations):
        if 1e-9 * length < station < (1.0 - 1e-9) * length and (not kept or station - kept[-1] > 1e-9 * length):
            kept.append(station)
    return kept
