"""Equations of motion of the hub-beam models, as the solvers use them, vectorized over times.

The coordinates are ``y = (theta, q)``: the hub angle, then the beam's (axial, if the model has them, then transverse).
The first dimension of all arrays is time, with k times; N is the number of coordinates.
"""

from abc import ABC, abstractmethod
from functools import cached_property
from typing import NamedTuple

import numpy as np

from boomctl.arrays import Array, blocks


class Tangents(NamedTuple):
    """Derivatives of the residual with respect to accelerations, rates and coordinates, each k x N x N."""

    mass: Array
    damping: Array
    stiffness: Array


class Tip(NamedTuple):
    """Rows that read the free end off the beam's coordinates.

    Attributes
    ----------
    transverse, axial : ndarray, N - 1
        ``v(L) = transverse q`` and ``w_1(L) = axial q``.
    shortening : ndarray, N - 1 x N - 1
        ``w_c(L) = -1/2 q^T shortening q``.
    """

    transverse: Array
    axial: Array
    shortening: Array


class Inertia(NamedTuple):
    """Mass matrices ``[[hub, coupling], [coupling^T, beam]]`` in their blocks.

    Attributes
    ----------
    hub : ndarray, k
    coupling : ndarray, k x (N - 1)
    beam : ndarray, (N - 1) x (N - 1), the same at all times, or k x (N - 1) x (N - 1)
        Always positive definite.
    """

    hub: Array
    coupling: Array
    beam: Array

    def solve_beam(self, right: Array) -> Array:
        """``beam^-1 right``, k x (N - 1)."""
        if self.beam.ndim == 2:
            return np.linalg.solve(self.beam, right.T).T
        return np.linalg.solve(self.beam, right[..., None])[..., 0]

    def momenta(self, rate: Array) -> Array:
        """Mass matrix times rates, k x N."""
        result = np.empty_like(rate)
        result[:, 0] = self.hub * rate[:, 0] + np.sum(self.coupling * rate[:, 1:], axis=1)
        beam = rate[:, 1:] @ self.beam if self.beam.ndim == 2 else np.einsum("kij,kj->ki", self.beam, rate[:, 1:])
        result[:, 1:] = self.coupling * rate[:, :1] + beam
        return result

    def margin(self) -> Array:
        """Schur complement ``hub - coupling beam^-1 coupling^T``, k; positive definite means > 0."""
        return self.hub - np.sum(self.coupling * self.solve_beam(self.coupling), axis=1)


class BeamSpeedTerms(NamedTuple):
    """Beam equations that are linear in its coordinates once the hub's motion is given.

    ``M q'' + (C + w G) q' + (K + w^2 K_w + a K_a) q = w^2 f_w + a f_a`` at a hub speed w and acceleration a.
    """

    M: Array
    C: Array
    G: Array
    K: Array
    K_w: Array
    K_a: Array
    f_w: Array
    f_a: Array


class NormalForm(NamedTuple):
    """``x'' + (stiffness + w^2 slope) x = a push`` at a hub speed w and acceleration a; ``q = to_q x``, ``x = to_x q``."""

    to_q: Array
    to_x: Array
    stiffness: Array
    slope: Array
    push: Array


class FreeHubForm(NamedTuple):
    """Equations with the hub free, in coordinates (r, x) in which the mass matrix of the straight beam is unity.

    With ``theta = r / sqrt(inertia) + lean x``, ``q = to_q x``, hub speed w, hub acceleration a and torque tau they are
    ``r'' / push_0 = h`` and ``x'' + damping x' + (stiffness - w^2 slope) x = lean h + f``, where

    ``h = tau - (2 axial x + x^T slope x) a - couple - 2 w (axial x' + x^T slope x')``, ``couple = -(gyro x) x''`` and
    ``f = (gyro x) a + 2 w gyro x' + w^2 axial``.

    Attributes
    ----------
    inertia : float
        Of everything, undeformed, kg m^2.
    to_q : ndarray, n x n
    lean : ndarray, n
        Hub angle over x at zero angular momentum.
    softest : float
        Lowest eigenvalue of the stiffness, rad^2/s^2.
    stiffness, slope, gyro, damping : ndarray, n x n
        The third is skew.
    axial : ndarray, n
    keeps_inertia_torque : bool
        True if h has its last term.
    has_axial : bool
        True if the model has axial modes, with the terms `gyro` and `axial`.
    decay : float
        Largest decay rate of any motion, 1/s; 0 without damping.
    """

    inertia: float
    to_q: Array
    lean: Array
    softest: float
    stiffness: Array
    slope: Array
    gyro: Array
    damping: Array
    axial: Array
    keeps_inertia_torque: bool
    has_axial: bool
    decay: float


class Equations(ABC):
    """Equations of motion ``residual(y, y', y'') = (tau, 0)`` of a model.

    Attributes
    ----------
    M, C, K : ndarray, N - 1 x N - 1
        Mass of the straight beam, damping, and stiffness at rest, over the beam's coordinates.
    tip : Tip
        The free end.
    """

    M: Array
    C: Array
    K: Array
    tip: Tip

    @property
    def size(self) -> int:
        """Number of coordinates N."""
        return self.M.shape[0] + 1

    @cached_property
    def frequency_range(self) -> tuple[float, float]:
        """Lowest and highest natural frequency of the beam at rest, rad/s."""
        squares = np.linalg.eigvals(np.linalg.solve(self.M, self.K)).real
        return float(np.sqrt(squares.min())), float(np.sqrt(squares.max()))

    @cached_property
    def beam_speed_terms(self) -> BeamSpeedTerms | None:
        """Beam equations at a given hub motion if they are linear, else None."""
        return None

    @cached_property
    def normal_form(self) -> NormalForm | None:
        """Beam equations at a given hub motion if the hub's speed merely stiffens it, else None."""
        return None

    @cached_property
    def free_hub_form(self) -> FreeHubForm | None:
        """Equations of hub and beam in coordinates with unit mass, if the kinetic energy is of second order, else None."""
        return None

    @abstractmethod
    def residual(self, y: Array, rate: Array, acceleration: Array) -> Array:
        """Left-hand sides of the equations of motion, k x N; the hub's is the torque that it needs."""

    @abstractmethod
    def tangents(self, y: Array, rate: Array, acceleration: Array) -> Tangents:
        """Return the derivatives of the residual with respect to accelerations, rates and coordinates."""

    @abstractmethod
    def inertia(self, y: Array) -> Inertia:
        """Mass matrix in its blocks."""

    @abstractmethod
    def inertia_torque(self, y: Array, rate: Array) -> Array:
        """Q_theta, k: the hub equation's terms quadratic in the rates, on the side of the torque (Eqs. 32, 37)."""

    def state_derivative(self, x: Array, torque: float) -> Array:
        """Return the derivative of the state (coordinates, rates), 2 N, under a torque [N m].

        Raises
        ------
        ValueError
            If the mass matrix is not positive definite.
        """
        y, rate = x[None, : self.size], x[None, self.size :]
        force = -self.residual(y, rate, np.zeros_like(y))
        force[0, 0] += torque
        inertia = self.inertia(y)
        margin = inertia.margin()[0]
        if not margin > 0.0:
            raise ValueError(
                f"mass matrix margin = {margin:g} kg m^2: expected > 0; the deformation is outside the model"
            )
        turning = (force[0, 0] - inertia.coupling[0] @ inertia.solve_beam(force[:, 1:])[0]) / margin
        bending = inertia.solve_beam(force[:, 1:] - turning * inertia.coupling)[0]
        return np.concatenate([rate[0], [turning], bending])


def block_diagonal(first: Array, second: Array) -> Array:
    """Two square blocks, of the axial and the transverse coordinates, on a diagonal."""
    across = np.zeros((len(first), len(second)))
    return blocks([[first, across], [across.T, second]])
