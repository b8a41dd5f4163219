"""Discretization of beams: cubic Hermite interpolation, enriched with bubbles of higher order.

Within an element of length ``h``, ``xi`` in [-1, 1], the deflection is the Hermite cubic of the end values
``w1, phi1, w2, phi2`` plus ``h a_k B_k(xi)``, where ``B_k'' = P_k`` (Legendre) and ``B_k`` and ``B_k'`` vanish at both
ends, ``k = 2, 3, ...``.  The curvature is then a Legendre series whose coefficients are the element's strain modes,
so that its stiffness matrix is diagonal in them and rigid motion has exactly zero strain.
Mass is also such a sum of squares; the number of rows on each element is the rank of its mass matrix.
"""

from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.polynomial import legendre

from boomctl.arrays import Array


@dataclass(frozen=True)
class ElementRows:
    """Rows over a beam's coordinates, equally many on each element, and their weights for a unit property of the beam.

    Attributes
    ----------
    blocks : (elements, rows, order + 1) ndarray
        Over the coordinates of each element, ``w1, phi1, w2, phi2, bubbles``.
    index : (elements, order + 1) ndarray
        Indices of these coordinates among the beam's.
    unit : (elements, rows) ndarray
        Weight of each row: mass for 1 kg/m, stiffness for 1 N m^2.
    """

    blocks: Array
    index: Array
    unit: Array

    def weights(self, values: Array) -> Array:
        """Return the weight of each row, elements having the property ``values``."""
        return (values[:, None] * self.unit).ravel()

    def matrix(self, first: int, width: int) -> Array:
        """Return the rows over ``width`` coordinates, the beam's from ``first`` on."""
        count, lines, _ = self.blocks.shape
        columns = np.broadcast_to(first + self.index[:, None, :], self.blocks.shape)
        full = np.zeros((count * lines, width))
        full[np.arange(count * lines).reshape(count, lines, 1), columns] = self.blocks
        return full


@dataclass(frozen=True)
class BeamMesh:
    """Discretization of a beam, independent of its mass and stiffness.

    Attributes
    ----------
    nodes : ndarray
        Stations of the nodes [m], ascending.
    names : tuple of str
        Names of the coordinates, along the beam: ``w0, phi0, w1, phi1, ...``.
    section : (elements,) ndarray
        Index of the beam's segment of each element.
    inertia, strain : ElementRows
        Rows whose weighted sums of squares are the mass and stiffness matrix: deflections, and strain modes.
    order : int
        Polynomial order of the deflection within an element.
    """

    nodes: Array
    names: tuple[str, ...]
    section: Array
    inertia: ElementRows
    strain: ElementRows
    order: int

    def interpolation(self, station: float, derivative: int) -> tuple[Array, Array]:
        """Return indices and coefficients of deflection (``derivative`` 0) or slope (1) at ``station``."""
        e = min(max(int(self.nodes.searchsorted(station, side="right")) - 1, 0), len(self.nodes) - 2)
        low, high = self.nodes[e : e + 2].tolist()
        near, per_node, h = e if station - low <= high - station else e + 1, self.order - 1, high - low
        if min(abs(station - low), abs(high - station)) <= 1e-12 * (self.nodes[-1] - self.nodes[0]):
            return np.array([per_node * near + derivative]), np.array([1.0])
        coefficients = shape_functions(2.0 * (station - low) / h - 1.0, h, self.order, derivative)
        return per_node * e + element_coordinates(self.order), coefficients


def element_coordinates(order: int) -> Array:
    """Return the indices, relative to an element's first, of its coordinates ``w1, phi1, w2, phi2, bubbles``."""
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


def shape_functions(xi: Array | float, h: float, order: int, derivative: int) -> Array:
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
def _mass_rows(order: int, mass: str) -> Array:
    """Return rows whose squares sum to the mass matrix of an element of unit length and unit mass.

    Each row is even or odd, so that the rows of an element and of its mirror image are images of each other.
    """
    if mass == "lumped":
        return _frozen(np.sqrt(0.5) * np.eye(4)[[0, 2]])
    if mass == "linear":
        rows = np.zeros((2, 4))
        rows[:, [0, 2]] = [[0.5, 0.5], [np.sqrt(1 / 12), -np.sqrt(1 / 12)]]
        return _frozen(rows)
    matrix, parity = np.eye(order + 1), np.eye(order + 1)
    if order > 3:  # bubbles
        xi, weight = legendre.leggauss(order + 1)
        shapes = shape_functions(xi, 1.0, order, 0)
        matrix = 0.5 * (shapes * weight) @ shapes.T
    matrix[:4, :4] = np.array([[156, 22, 54, -13], [22, 4, 13, -3], [54, 13, 156, -22], [-13, -3, -22, 4]]) / 420.0
    parity[:4, :4] = np.sqrt(0.5) * np.array([[1, 0, 1, 0], [0, 1, 0, -1], [1, 0, -1, 0], [0, 1, 0, 1]])
    return _frozen(np.linalg.cholesky(parity @ matrix @ parity.T).T @ parity)


def _frozen(array: Array) -> Array:
    array.setflags(write=False)
    return array


def element_mesh(nodes: Array, section: Array, order: int, mass: str = "hermite") -> BeamMesh:
    """Return the mesh of elements between ``nodes``.

    Parameters
    ----------
    nodes : ndarray
        Node stations [m].
    section : ndarray
        Index of the beam's segment of each element.
    order : int
        3 for cubic elements, more for bubbles.
    mass : "hermite", "linear" or "lumped"
        Consistent mass; mass of linear interpolation; half of each element concentrated at either node.
    """
    h, count, per_node = np.diff(nodes), len(nodes) - 1, order - 1
    index = per_node * np.arange(count)[:, None] + element_coordinates(order)[None, :]
    scale = np.ones((count, order + 1))
    scale[:, [1, 3]] = h[:, None]
    scale[:, 4:] = h[:, None]
    mass_rows = _mass_rows(order, mass)
    inertia = ElementRows(mass_rows * scale[:, None, :], index, np.repeat(h[:, None], len(mass_rows), axis=1))
    modes = np.zeros((count, per_node, order + 1))
    modes[:, 0, [1, 3]] = -1.0, 1.0
    modes[:, 1, [1, 3]] = 1.0
    modes[:, 1, 0], modes[:, 1, 2] = 2.0 / h, -2.0 / h
    modes[:, np.arange(2, per_node), np.arange(4, per_node + 2)] = 1.0
    legendre_norm = np.array([1.0, 3.0] + [16.0 / (2 * k + 1) for k in range(2, per_node)])
    strain = ElementRows(modes, index, legendre_norm / h[:, None])
    letters = ("w", "phi", *(f"b{k}_" for k in range(2, per_node)))
    names = [f"{letter}{i}" for i in range(count + 1) for letter in letters][: per_node * count + 2]
    return BeamMesh(nodes, tuple(names), section, inertia, strain, order)
