"""Momenta, forces and their derivatives of the geometrically exact beam, closed form, vectorized over times.

With the tangent ``u = (1 + eps) e^{i phi}`` at the nodes, positions are ``z = W u``, and everything in the
kinetic energy ``T = 1/2 sum_k m_k |z_k'|^2 + 1/2 J_h theta'^2`` is local to a node but for the one real matrix
``W^T diag(m) W``. The rotary inertia of the section is neglected, as Bai et al. (2009) do. The potential energy is
``U = 1/2 int (EA eps^2 + EI kappa^2) ds``, with ``kappa`` the derivative of the rotation along the undeformed arc
length (Simo & Vu-Quoc 1986 without shear).
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from boomctl.arrays import Array
from boomctl.rotating_beam.exact.basis import StrainBasis


@dataclass(frozen=True, eq=False)
class ExactBeamDynamics:
    """Energies and generalized momenta and forces over ``q`` and ``v = q'``.

    ``q`` and ``v`` have shape ``(..., coordinates)``; results follow the leading dimensions. ``damping`` is a
    symmetric matrix over the coordinates, or None.
    """

    basis: StrainBasis
    damping: Array | None = None

    @cached_property
    def mass_kernel(self) -> Array:
        """``W^T diag(m) W``, complex only to spare a conversion in each product, shape ``(nodes, nodes)`` [kg m^2]."""
        rows = self.basis.integration
        return (rows.T @ (self.basis.point_masses[:, None] * rows)).astype(complex)

    @cached_property
    def rest_mass(self) -> Array:
        """Mass matrix of the undeformed beam, shape ``(coordinates, coordinates)``."""
        return self.mass_matrix(np.zeros(self.basis.coordinates))

    def _nodes(self, q: Array, v: Array) -> tuple[Array, ...]:
        """Direction, tangent, tangent's rate, rotation's rate and stretch's rate at the nodes."""
        basis = self.basis
        direction = np.exp(1j * (q @ basis.rotation.T))
        tangent = direction * (1.0 + q @ basis.stretch.T)
        turn, stretching = v @ basis.rotation.T, v @ basis.stretch.T
        return direction, tangent, stretching * direction + 1j * turn * tangent, turn, stretching

    def momentum_and_force(self, q: Array, v: Array) -> tuple[Array, Array]:
        """``p = dT/dv`` and ``dT/dq - dU/dq - C v``."""
        basis = self.basis
        direction, tangent, rate, turn, _ = self._nodes(q, v)
        impulse = (rate @ self.mass_kernel).conj()
        along = direction * impulse
        across = turn * np.imag(along)
        p = -np.imag(tangent * impulse) @ basis.rotation + np.real(along) @ basis.stretch
        g = -np.imag(rate * impulse) @ basis.rotation - across @ basis.stretch
        p[..., 0] += basis.hub_inertia * v[..., 0]
        g -= basis.stiffness * q
        if self.damping is not None:
            g -= v @ self.damping
        return p, g

    def _motions(self, direction: Array, tangent: Array) -> Array:
        """Return the derivatives of the tangents with respect to the coordinates, ``(..., nodes, coordinates)``."""
        return (1j * tangent)[..., None] * self.basis.rotation + direction[..., None] * self.basis.stretch

    def mass_matrix(self, q: Array) -> Array:
        """``M(q)``, shape ``(..., coordinates, coordinates)``, symmetric positive definite."""
        direction, tangent, *_ = self._nodes(q, np.zeros_like(q))
        motions = self._motions(direction, tangent)
        mass = np.real(np.swapaxes(motions.conj(), -1, -2) @ (self.mass_kernel @ motions))
        mass[..., 0, 0] += self.basis.hub_inertia
        return mass

    def convective_force(self, q: Array, v: Array) -> Array:
        """Return ``M'(q, v) v - dT/dq``, the terms of the equations quadratic in v; the first entry is ``-Q_theta``."""
        direction, tangent, _, turn, stretching = self._nodes(q, v)
        acceleration = 2j * stretching * turn * direction - turn**2 * tangent
        force = (acceleration @ self.mass_kernel).conj()
        return -np.imag(tangent * force) @ self.basis.rotation + np.real(direction * force) @ self.basis.stretch

    def acceleration(self, q: Array, v: Array, torque: float) -> Array:
        """Return ``q''`` with the hub free under ``torque`` [N m]; one time, shape ``(coordinates,)``."""
        force = -self.convective_force(q, v) - self.basis.stiffness * q
        if self.damping is not None:
            force -= self.damping @ v
        force[0] += torque
        return np.linalg.solve(self.mass_matrix(q), force)

    def linearization(self, q: Array, v: Array) -> tuple[Array, Array, Array]:
        """Return the derivatives of momentum and force: ``dp/dv = M``, ``dp/dq`` and ``-dg/dq = d^2(U - T)/dq^2``.

        ``dg/dv`` is the transpose of ``dp/dq`` less the damping. Small motion about a steady rotation obeys
        ``M a + (dp/dq - (dp/dq)^T + C) v + K q = f``.
        """
        basis, kernel = self.basis, self.mass_kernel
        direction, tangent, rate, turn, _ = self._nodes(q, v)
        motions = self._motions(direction, tangent)
        rates = (1j * rate)[..., None] * basis.rotation + (1j * turn * direction)[..., None] * basis.stretch
        impulse = (rate @ kernel).conj()
        adjoint, along = np.swapaxes(motions.conj(), -1, -2), direction * impulse
        mass = np.real(adjoint @ (kernel @ motions))
        mass[..., 0, 0] += basis.hub_inertia
        mixed = basis.rotation.T @ (np.imag(along)[..., None] * basis.stretch)
        own = basis.rotation.T @ (np.real(tangent * impulse)[..., None] * basis.rotation)
        coupling = np.real(adjoint @ (kernel @ rates)) - own - mixed - np.swapaxes(mixed, -1, -2)
        mixed = basis.rotation.T @ ((turn * np.real(along))[..., None] * basis.stretch)
        own = basis.rotation.T @ (np.real(rate * impulse)[..., None] * basis.rotation)
        stiffness = own + mixed + np.swapaxes(mixed, -1, -2) + np.diag(basis.stiffness)
        stiffness -= np.real(np.swapaxes(rates.conj(), -1, -2) @ (kernel @ rates))
        return mass, coupling, stiffness

    def energy(self, q: Array, v: Array) -> Array:
        """``T + U`` [J]."""
        rate = self._nodes(q, v)[2]
        kinetic = 0.5 * np.sum(np.real(rate.conj() * (rate @ self.mass_kernel)), axis=-1)
        kinetic += 0.5 * self.basis.hub_inertia * v[..., 0] ** 2
        return kinetic + 0.5 * np.sum(self.basis.stiffness * q**2, axis=-1)

    def positions(self, q: Array) -> Array:
        """Positions of clamp, Gauss points and free end in fixed axes, complex [m]."""
        basis = self.basis
        _, tangent, *_ = self._nodes(q, np.zeros_like(q))
        points = basis.integration[: tangent.shape[-1] - 1]
        clamp = basis.integration[0, 0] * tangent[..., :1]
        return np.concatenate([clamp, tangent @ points.T, (tangent @ basis.tip_row)[..., None]], axis=-1)

    def tip(self, q: Array) -> Array:
        """Position of the free end in axes that turn with the hub, complex: along, across [m]."""
        _, tangent, *_ = self._nodes(q, np.zeros_like(q))
        return (tangent @ self.basis.tip_row) * np.exp(-1j * q[..., 0])

    def tip_rate(self, q: Array, v: Array) -> Array:
        """Rate of :meth:`tip`, complex [m/s]."""
        _, tangent, rate, *_ = self._nodes(q, v)
        return ((rate - 1j * v[..., :1] * tangent) @ self.basis.tip_row) * np.exp(-1j * q[..., 0])

    def tip_row(self, q: Array) -> Array:
        """Return the derivative of :meth:`tip` with respect to the coordinates, complex; one time."""
        direction, tangent, *_ = self._nodes(q, np.zeros_like(q))
        row = self.basis.tip_row @ self._motions(direction, tangent)
        row[0] = 0.0
        return row * np.exp(-1j * q[0])

    def extension(self, q: Array) -> Array:
        """Integral of the stretch over the beam [m]."""
        return q @ (self.basis.stretch.T @ self.basis.tip_row)
