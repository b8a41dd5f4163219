"""Curvature and stretch of a planar beam as Legendre series, and the rows that turn them into positions.

The beam is described by its strains: the stretch ``eps(s)`` and the curvature ``kappa(s) = d phi/d s``
per *undeformed* arc length ``s``. Rotation and position follow by integration from the root,

    phi(x) = theta + int_0^x kappa ds,      z(x) = r_A e^{i theta} + int_0^x (1 + eps) e^{i phi} ds,

with the plane written as complex numbers. The root conditions hold by construction, the conditions at the
free end are natural ones, and any polynomial is admissible, so the Ritz series converges spectrally. A tip mass
inside the beam makes stretch and shear force jump there; the beam is then cut into two spans.
"""

from dataclasses import dataclass

import numpy as np
from numpy.polynomial.legendre import leggauss, legvander

from boomctl.arrays import Array
from boomctl.gauss import integrated_legendre, lagrange_integrals
from boomctl.rotating_beam.parameters import HubBeamParameters

EXTRA_NODES = 10  # Quadrature nodes in addition to the polynomials on a span, as the energy is not a polynomial.


@dataclass(frozen=True, eq=False)
class StrainBasis:
    """Rows of a discretized beam over the coordinates ``q = (theta, curvatures, stretches)``.

    Node 0 is the hub: its "tangent" ``e^{i theta}`` carries the hub radius, so that hub and beam need no
    separate formulas. The others are Gauss-Legendre nodes of the spans.

    Attributes
    ----------
    rotation, stretch
        Angle and stretch of every node over the coordinates, shape ``(nodes, coordinates)``.
    integration
        Positions of the mass points from the tangents at the nodes, shape ``(points, nodes)`` [m].
    point_masses
        Quadrature masses, then the tip mass, shape ``(points,)`` [kg].
    tip_row
        Position of the free end ``x = L`` from the tangents, shape ``(nodes,)`` [m].
    stiffness
        Diagonal of the (diagonal) stiffness matrix, shape ``(coordinates,)``; 0 for the hub angle.
    hub_inertia
        Inertia of the hub [kg m^2].
    length
        Of the beam [m].
    """

    rotation: Array
    stretch: Array
    integration: Array
    point_masses: Array
    tip_row: Array
    stiffness: Array
    hub_inertia: float
    length: float

    @property
    def coordinates(self) -> int:
        """Number of coordinates, the hub angle among them."""
        return self.stiffness.size

    @property
    def bending(self) -> slice:
        """Indices of the curvature coordinates."""
        return slice(1, 1 + (self.coordinates - 1) // 2)

    @property
    def stretching(self) -> slice:
        """Indices of the stretch coordinates."""
        return slice(1 + (self.coordinates - 1) // 2, self.coordinates)


def strain_basis(parameters: HubBeamParameters, modes: int) -> StrainBasis:
    """Discretize the beam with ``modes`` Legendre polynomials of curvature and of stretch on each span.

    Parameters
    ----------
    parameters
        The hub-beam.
    modes
        Number of polynomials, at least 1.

    Returns
    -------
    StrainBasis
        One span, or two if a tip mass sits inside the beam.
    """
    inside = parameters.tip_mass > 0.0 and 0.0 < parameters._mass_position < parameters.length
    ends = np.array([0.0, *([parameters._mass_position] if inside else []), parameters.length])
    nodes, weights = leggauss(modes + EXTRA_NODES)
    halves = 0.5 * np.diff(ends)
    rotation, stretch = _strain_rows(halves, nodes, modes)
    integration = np.array([_row_to(parameters, halves, weights, k) for k in range(halves.size) for _ in nodes])
    within = lagrange_integrals(nodes, nodes)
    for k, half in enumerate(halves):
        start, end = k * nodes.size, (k + 1) * nodes.size
        integration[start:end, start + 1 : end + 1] = half * within
    masses = parameters.mass_per_length * np.kron(halves, weights)
    if parameters.tip_mass > 0.0:
        row = _row_to(parameters, halves, weights, int(np.searchsorted(ends, parameters._mass_position)))
        integration, masses = np.vstack([integration, row]), np.append(masses, parameters.tip_mass)
    rigidities = (parameters.bending_stiffness, parameters.axial_stiffness)
    return StrainBasis(
        rotation=rotation,
        stretch=stretch,
        integration=integration,
        point_masses=masses,
        tip_row=_row_to(parameters, halves, weights, halves.size),
        stiffness=np.concatenate([[0.0], np.repeat(rigidities, halves.size * modes)]),
        hub_inertia=float(parameters.hub_inertia),
        length=float(parameters.length),
    )


def _strain_rows(halves: Array, nodes: Array, modes: int) -> tuple[Array, Array]:
    """Rotation and stretch of hub and nodes over the coordinates; the polynomials are orthonormal on their span."""
    bending, per_span = halves.size * modes, nodes.size
    rotation = np.zeros((1 + halves.size * per_span, 1 + 2 * bending))
    stretch = np.zeros_like(rotation)
    rotation[:, 0] = 1.0
    for k, half in enumerate(halves):
        scale = np.sqrt((2 * np.arange(modes) + 1) / (2.0 * half))
        own = 1 + k * modes + np.arange(modes)
        start, end = 1 + k * per_span, 1 + (k + 1) * per_span
        rotation[start:end, own] = half * integrated_legendre(nodes, modes - 1) * scale
        rotation[end:, own] = half * integrated_legendre(np.ones(1), modes - 1) * scale
        stretch[start:end, bending + own] = legvander(nodes, modes - 1) * scale
    return rotation, stretch


def _row_to(parameters: HubBeamParameters, halves: Array, weights: Array, spans: int) -> Array:
    """Row of the position where ``spans`` spans end: the hub radius, then the Gauss weights of those spans."""
    reached = np.where(np.arange(halves.size) < spans, halves, 0.0)
    return np.concatenate([[parameters.hub_radius], np.kron(reached, weights)])
