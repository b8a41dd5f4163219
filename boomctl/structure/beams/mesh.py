"""Beams turned into coordinates: cubic Hermite interpolation, enriched with bubbles of higher order.

Within an element of length ``h``, ``xi`` in [-1, 1], the deflection is the Hermite cubic of the end values
``w1, phi1, w2, phi2`` plus ``h a_k B_k(xi)``, where ``B_k'' = P_k`` (Legendre) and ``B_k`` and ``B_k'`` vanish at both
ends, ``k = 2, 3, ...``.  The curvature is then a Legendre series whose coefficients are the element's strain modes,
so that its stiffness matrix is diagonal in them and rigid motion strains nothing, to the last digit.
"""

from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.polynomial import legendre
from scipy import sparse

from boomctl.arrays import Array


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
    order : int
        Polynomial order of the deflection within an element.
    """

    nodes: Array
    names: tuple[str, ...]
    mass: sparse.csr_array
    strain: sparse.csr_array
    stiffness: Array
    damping: Array
    order: int

    def interpolation(self, station: float, derivative: int) -> tuple[Array, Array]:
        """Return indices and coefficients of deflection (``derivative`` 0) or slope (1) at ``station``."""
        e = int(np.clip(np.searchsorted(self.nodes, station, side="right") - 1, 0, len(self.nodes) - 2))
        near = e if station - self.nodes[e] <= self.nodes[e + 1] - station else e + 1
        per_node = self.order - 1
        if abs(station - self.nodes[near]) <= 1e-12 * (self.nodes[-1] - self.nodes[0]):
            return np.array([per_node * near + derivative]), np.array([1.0])
        h = self.nodes[e + 1] - self.nodes[e]
        xi = 2.0 * (station - self.nodes[e]) / h - 1.0
        coefficients = shape_functions(np.array([xi]), h, self.order, derivative)[:, 0]
        return per_node * e + element_coordinates(self.order), coefficients


@dataclass(frozen=True)
class SectionValues:
    """Section properties, one value an element."""

    mass_per_length: Array
    bending_stiffness: Array
    damping: Array


def element_coordinates(order: int) -> Array:
    """Return the places, counted from an element's first, of its coordinates ``w1, phi1, w2, phi2, bubbles``."""
    per_node = order - 1
    return np.array([0, 1, per_node, per_node + 1, *range(2, per_node)])


def _bubble(k: int, derivative: int) -> Array:
    """Return the Legendre coefficients of ``B_k`` or its derivatives."""
    series = np.zeros(k + 3)
    if derivative == 1:
        series[k + 1], series[k - 1] = 1.0, -1.0
        return series / (2 * k + 1)
    series[k + 2] += 1.0 / (2 * k + 3)
    series[k] -= 1.0 / (2 * k + 3) + 1.0 / (2 * k - 1)
    series[k - 2] += 1.0 / (2 * k - 1)
    return series / (2 * k + 1)


def shape_functions(xi: Array, h: float, order: int, derivative: int) -> Array:
    """Return deflection (``derivative`` 0) or slope (1) of ``w1, phi1, w2, phi2, bubbles`` at ``xi``, one line each.

    Source: Anthonis & Ramon (2003), Eq. (13), for the first four.
    """
    t = 0.5 * (1.0 + xi)
    if derivative == 0:
        lines = [1 - 3 * t**2 + 2 * t**3, h * (t - 2 * t**2 + t**3), 3 * t**2 - 2 * t**3, h * (t**3 - t**2)]
        lines += [h * legendre.legval(xi, _bubble(k, 0)) for k in range(2, order - 1)]
    else:
        lines = [(6 * t**2 - 6 * t) / h, 1 - 4 * t + 3 * t**2, (6 * t - 6 * t**2) / h, 3 * t**2 - 2 * t]
        lines += [2.0 * legendre.legval(xi, _bubble(k, 1)) for k in range(2, order - 1)]
    return np.array(lines)


@cache
def reference_mass(order: int) -> Array:
    """Return the mass matrix of an element of unit length and unit mass, consistent with its shape functions."""
    xi, weight = legendre.leggauss(order + 1)
    shapes = shape_functions(xi, 1.0, order, 0)
    matrix = 0.5 * (shapes * weight) @ shapes.T
    matrix[:4, :4] = np.array([[156, 22, 54, -13], [22, 4, 13, -3], [54, 13, 156, -22], [-13, -3, -22, 4]]) / 420.0
    matrix.setflags(write=False)
    return matrix


def _scatter(blocks: Array, rows: Array, columns: Array, shape: tuple[int, int]) -> sparse.csr_array:
    """Add blocks (element, i, j) into a sparse matrix at ``rows[element, i]``, ``columns[element, j]``."""
    i = np.broadcast_to(rows[:, :, None], blocks.shape).ravel()
    j = np.broadcast_to(columns[:, None, :], blocks.shape).ravel()
    return sparse.coo_array((blocks.ravel(), (i, j)), shape=shape).tocsr()


def _strain_blocks(h: Array, order: int) -> Array:
    """Return, for each element, the strain modes as rows over ``w1, phi1, w2, phi2, bubbles``."""
    modes = order - 1
    blocks = np.zeros((len(h), modes, order + 1))
    blocks[:, 0, [1, 3]] = -1.0, 1.0
    blocks[:, 1, [1, 3]] = 1.0
    blocks[:, 1, 0], blocks[:, 1, 2] = 2.0 / h, -2.0 / h
    for k in range(2, modes):
        blocks[:, k, k + 2] = 1.0
    return blocks


def element_mesh(nodes: Array, section: SectionValues, order: int, mass: str = "hermite") -> BeamMesh:
    """Return the mesh of elements between ``nodes``.

    Parameters
    ----------
    nodes : ndarray
        Node stations [m].
    section : SectionValues
        Section properties of each element.
    order : int
        3 for cubic elements, more for bubbles.
    mass : "hermite", "linear" or "lumped"
        Consistent mass; that of linear interpolation; half of each element concentrated at either node.
    """
    h, count, per_node = np.diff(nodes), len(nodes) - 1, order - 1
    size = per_node * count + 2
    place = per_node * np.arange(count)[:, None] + element_coordinates(order)[None, :]
    scale = np.ones((count, order + 1))
    scale[:, [1, 3]] = h[:, None]
    scale[:, 4:] = h[:, None]
    if mass == "hermite":
        reference = reference_mass(order)
    else:
        reference = np.zeros((order + 1, order + 1))
        reference[np.ix_([0, 2], [0, 2])] = (
            [[1 / 3, 1 / 6], [1 / 6, 1 / 3]] if mass == "linear" else [[0.5, 0], [0, 0.5]]
        )
    blocks = (section.mass_per_length * h)[:, None, None] * scale[:, :, None] * reference * scale[:, None, :]
    line = np.arange(count * per_node).reshape(count, per_node)
    legendre_norm = np.array([1.0, 3.0] + [16.0 / (2 * k + 1) for k in range(2, per_node)])
    stiffness = ((section.bending_stiffness / h)[:, None] * legendre_norm).ravel()
    letters = ("w", "phi", *(f"b{k}_" for k in range(2, per_node)))
    names = [f"{letter}{i}" for i in range(count + 1) for letter in letters][:size]
    return BeamMesh(
        nodes=nodes,
        names=tuple(names),
        mass=_scatter(blocks, place, place, (size, size)),
        strain=_scatter(_strain_blocks(h, order), line, place, (count * per_node, size)),
        stiffness=stiffness,
        damping=stiffness * np.repeat(section.damping, per_node),
        order=order,
    )
