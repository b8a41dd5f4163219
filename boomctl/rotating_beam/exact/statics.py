"""Steady rotation of the geometrically exact beam, and small motion about it."""

import numpy as np

from boomctl.arrays import Array, blocks
from boomctl.rotating_beam.exact.basis import StrainBasis
from boomctl.rotating_beam.exact.dynamics import ExactBeamDynamics


def axial_matrices(basis: StrainBasis) -> tuple[Array, Array, Array]:
    """Stiffness and mass of the straight beam over the stretches, and the pull ``V`` of a unit speed squared.

    A straight beam that turns at ``w`` is at rest where ``(K - w^2 M) b = w^2 V``.
    """
    positions = basis.integration @ basis.stretch[:, basis.stretching]
    weighted = basis.point_masses[:, None] * positions
    stiffness = np.diag(basis.stiffness[basis.stretching])
    return stiffness, positions.T @ weighted, weighted.T @ basis.integration.sum(axis=1)


def critical_speed(basis: StrainBasis) -> float:
    """Hub speed at which the axial stiffness is lost: ``det(K - w^2 M) = 0`` [rad/s]."""
    from scipy.linalg import eigh

    stiffness, mass, _ = axial_matrices(basis)
    return float(1.0 / np.sqrt(eigh(mass, stiffness, eigvals_only=True)[-1]))


def steady_rotation(basis: StrainBasis, hub_speed: float) -> Array:
    """Coordinates of the straight, stretched beam that turns steadily; the hub angle is 0.

    Parameters
    ----------
    basis
        The discretised beam.
    hub_speed
        Below the critical speed in magnitude [rad/s].

    Returns
    -------
    ndarray
        Shape ``(coordinates,)``.
    """
    stiffness, mass, pull = axial_matrices(basis)
    q = np.zeros(basis.coordinates)
    q[basis.stretching] = np.linalg.solve(stiffness - hub_speed**2 * mass, hub_speed**2 * pull)
    return q


def small_motion(dynamics: ExactBeamDynamics, hub_speed: float) -> tuple[Array, Array, Array]:
    """Matrices of ``M a + G v + K q = f`` about steady rotation, over all coordinates; damping is part of ``G``."""
    mass, coupling, stiffness = dynamics.linearisation(*_steady_state(dynamics.basis, hub_speed))
    gyroscopic = coupling - coupling.T
    if dynamics.damping is not None:
        gyroscopic = gyroscopic + dynamics.damping
    return mass, gyroscopic, stiffness


def transverse_frequencies(dynamics: ExactBeamDynamics, hub_speed: float) -> Array:
    """Bending frequencies of the stretched beam, hub motion prescribed, stretches and Coriolis terms frozen [rad/s]."""
    from scipy.linalg import eigh

    mass, _, stiffness = small_motion(dynamics, hub_speed)
    own = dynamics.basis.bending
    return 1.0 / np.sqrt(eigh(mass[own, own], stiffness[own, own], eigvals_only=True)[::-1])


def coupled_frequencies(dynamics: ExactBeamDynamics, hub_speed: float) -> Array:
    """All frequencies with the hub motion prescribed, Coriolis terms included, ascending [rad/s].

    With ``M = L L^T`` and ``K = R R^T`` the periods are eigenvalues of a skew-symmetric matrix, which keeps
    the low frequencies exact beside axial ones 1e4 times higher.
    """
    from scipy.linalg import cholesky, solve_triangular

    mass, coupling, stiffness = dynamics.linearisation(*_steady_state(dynamics.basis, hub_speed))
    root = cholesky(stiffness[1:, 1:], lower=True)
    cross = solve_triangular(root, cholesky(mass[1:, 1:], lower=True), lower=True)
    half = solve_triangular(root, (coupling - coupling.T)[1:, 1:], lower=True)
    gyroscopic = solve_triangular(root, half.T, lower=True).T
    periods = np.linalg.eigvalsh(1j * blocks([[np.zeros_like(cross), -cross.T], [cross, gyroscopic]]))
    return 1.0 / periods[periods > 0.0][::-1]


def _steady_state(basis: StrainBasis, hub_speed: float) -> tuple[Array, Array]:
    q = steady_rotation(basis, hub_speed)
    v = np.zeros_like(q)
    v[0] = hub_speed
    return q, v


def damping_matrix(basis: StrainBasis, ratio: float) -> Array | None:
    """Damping that gives every clamped mode of the beam at rest the same ``ratio``; None for a ratio of 0."""
    if ratio == 0.0:
        return None
    from scipy.linalg import eigh

    mass = ExactBeamDynamics(basis).rest_mass[1:, 1:]
    squares, shapes = eigh(np.diag(basis.stiffness[1:]), mass)
    weighted = mass @ shapes
    damping = np.zeros((basis.coordinates, basis.coordinates))
    damping[1:, 1:] = (weighted * (2.0 * ratio * np.sqrt(squares))) @ weighted.T
    return damping
