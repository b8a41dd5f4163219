"""Coordinates in which stiffness is the unit matrix, computed from rows without forming the stiffness matrix.

With ``S = diag(sqrt k) R = Q T P^T`` (orthogonal, triangular, permutation) and ``q = P T^-1 z``, ``K`` is the unit matrix,
and mass and damping are sums over rows of the relevant magnitude.  Forming the stiffness matrix loses accuracy by the ratio
of the stiffest element to the structure.  Rows sorted by magnitude remain accurate, because Householder's method with sorted
rows and pivoted columns is stable row by row (Cox & Higham 1998).  Slow motions are large in these coordinates, so slow
eigenvalues are accurate.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import linalg
from scipy.linalg import blas, lapack

from boomctl.arrays import Array, blocks, combined
from boomctl.lti.rounding import CANCELLED, EPS, SUMMED, UNDERFLOW
from boomctl.structure.layout import Layout, Weights
from boomctl.structure.ports import Ports

# Smallest singular value of rows of size one below which coordinates are equilibrated and the rank is determined; short
# elements next to long ones also cause small singular values.  Their squares, of a Gram matrix, are still far above rounding.
_CLEAR = 1e-4
_EVENED = 30  # Iterations of equilibration; each takes the square root of the imbalance.


@dataclass(frozen=True)
class StrainForm:
    """A structure over ``z`` with ``q = V z``, where stiffness is one for strains and zero for rigid motions.

    Attributes
    ----------
    V : (n, n) ndarray
        Its last columns are the rigid motions, of unit mass, and free of mass coupling with the others.
    N : (rows, n) ndarray
        Mass rows, ``M = N^T N``.
    C : (n, n) ndarray
        Damping.
    strains : int
        Number of coordinates that are not rigid motions, whose strains are zero to within rounding.
    free : int
        Number of undamped rigid motions, which are the last ones.
    forces : (elastic rows, n) ndarray
        Forces of the elastic rows.
    """

    V: Array
    N: Array
    C: Array
    strains: int
    free: int
    forces: Array

    @property
    def rigid(self) -> int:
        """Number of rigid motions."""
        return len(self.V) - self.strains

    @cached_property
    def matrices(self) -> tuple[Array, Array, Array]:
        """Mass, damping and stiffness matrix over these coordinates."""
        return self.N.T @ self.N, self.C, np.diag(np.arange(len(self.V)) < self.strains).astype(float)

    def ports_matrices(self, ports: Ports) -> tuple[Array, Array]:
        """Return the matrices ``B`` and ``L`` of inputs and outputs over these coordinates."""
        if self.strains < len(self.V):
            result = ports.over_motions(self.V, np.arange(self.strains, len(self.V)))
            B, L = result.B, result.L
        else:
            B, L = self.V.T @ ports.B, ports.L @ self.V
        if ports.strains is not None:
            B[0] = np.where(ports.moved, -(self.forces.T @ ports.strains), B[0])
        if ports.tensions is not None:
            reads = ports.tensions.any(axis=1)
            L[0, reads] = ports.tensions[reads] @ self.forces
        return B, L

    def in_modes(self, ports: Ports) -> tuple[Array, Array]:
        """Return the matrices ``B`` and ``L`` of inputs and outputs over undamped modes."""
        (B, L), own = self.ports_matrices(ports), self.own_modes[1]
        return own.T @ B, L @ own

    def modes(self) -> tuple[Array, Array]:
        """Return undamped frequencies [rad/s], ascending, and mass-normalized shapes over the old coordinates.

        Rigid motions have the frequency zero.  The others follow from the singular values of the mass rows, which are the
        inverse frequencies: slow modes are accurate to rounding error.
        """
        frequencies, own = self.own_modes
        return frequencies, self.V @ own

    @cached_property
    def own_modes(self) -> tuple[Array, Array]:
        """Undamped frequencies and mass-normalized shapes over these coordinates.

        Modes too fast to resolve in the presence of rounding have the frequency of that limit.
        """
        r, rigid = self.strains, len(self.V) - self.strains
        own = np.zeros_like(self.V)
        own[r:, :rigid] = np.eye(rigid)
        _, slowness, mixed = np.linalg.svd(self.N[:, :r], full_matrices=False)
        slowness = np.maximum(slowness, EPS * slowness.max(initial=0.0))
        own[:r, rigid:] = mixed.T / slowness
        return np.concatenate([np.zeros(rigid), 1.0 / slowness]), own

    def poles(self) -> Array:
        """Return all poles, exactly zero for undamped rigid motions; slow poles are accurate to rounding error.

        They are the inverse of the eigenvalues of ``1/s``.
        """
        r, n = self.strains, len(self.V) - self.free
        M, C, K = (matrix[:n, :n] for matrix in self.matrices)
        still = np.zeros(2 * self.free)
        companion = blocks([[np.zeros((n, n)), np.eye(n)], [-M, -C]])
        if n == r:
            slowness = linalg.eigvals(companion)
            return np.concatenate([still, 1.0 / slowness[slowness != 0.0]])
        alpha, beta = linalg.eigvals(companion, linalg.block_diag(np.eye(n), K), homogeneous_eigvals=True)
        return np.concatenate([still, (beta / alpha)[alpha != 0.0]])


def _of_size_one(S: Array) -> Array:
    """Return the rows that are not zero, each at size one."""
    size = np.sqrt((S * S).sum(axis=1, keepdims=True))
    return S / size if size.all() else S[size[:, 0] > 0.0] / size[size > 0.0][:, None]


def parted(lines: Array) -> tuple[Array, int]:
    """Return an orthogonal combination of motions, and the number of those, the last ones, that the lines do not read."""
    if not lines.any():
        return np.eye(lines.shape[1]), lines.shape[1]
    _, spread, motions = np.linalg.svd(_of_size_one(lines))
    return motions.T, lines.shape[1] - int((spread > SUMMED * spread[0]).sum())


def _even(rows: Array) -> Array:
    """Return factors of columns with which all rows and columns have similar norms (Ruiz 2001).

    Entries below rounding of their row are ignored: a rigid motion must not be enlarged until its rounding error strains.
    """
    significant = np.abs(rows) > CANCELLED * np.abs(rows).max(axis=1, keepdims=True)
    factor, scaled = np.ones(rows.shape[1]), np.where(significant, rows, 0.0)
    for _ in range(_EVENED):
        size = np.linalg.norm(scaled, axis=0)
        scale = 1.0 / np.sqrt(np.where(size > 0.0, size, 1.0))
        factor, scaled = factor * scale, scaled * scale
        size = np.linalg.norm(scaled, axis=1)
        scaled = scaled / np.sqrt(np.where(size > 0.0, size, 1.0))[:, None]
    return factor


def unstrained(S: Array, rows: Array, column: Array) -> tuple[Array, Array, Array, int]:
    """Return motions ``V`` that separate unit strains from rigid motions: ``S V = Q``, its last columns exactly zero.

    Parameters
    ----------
    S : (rows, n) ndarray
        Rows, each times the root of its stiffness.
    rows : (rows, n) ndarray
        The same rows without these factors.
    column : (n,) ndarray
        Magnitudes of the coordinates.

    Returns
    -------
    V : (n, n) ndarray
    Q : (rows, n) ndarray
        In the order that follows.
    order : (rows,) ndarray
        Order of the rows, the stiffest first.
    r : int
        Number of columns with strains.
    """
    n = r = S.shape[1]
    unit = _of_size_one(S * column)
    factor, failed = lapack.dpotrf(unit.T @ unit)
    # The inverse of the factor is at least as large as that of the smallest singular value.
    if failed or blas.dnrm2(lapack.dtrtri(factor)[0].ravel()) > 1.0 / _CLEAR:
        spread = np.linalg.svd(unit, compute_uv=False)
        if spread[-1] < _CLEAR:
            column = _even(rows)
            spread = np.linalg.svd(_of_size_one(S * column), compute_uv=False)
        r = int((spread > SUMMED * spread[0]).sum())
    S = S * column
    order = np.argsort(-np.abs(S).max(axis=1), kind="stable")
    T, pivots, tau, _, _ = lapack.dgeqp3(S[order])
    V, Q = np.zeros((n, n)), np.zeros_like(S)
    Q[:, :r] = lapack.dorgqr(T[:, : len(tau)], tau)[0][:, :r]
    V[pivots[:r] - 1, :r] = blas.dtrsm(1.0, T[:r, :r], np.eye(r))
    if r < n:
        V[pivots[:r] - 1, r:] = -V[pivots[:r] - 1, :r] @ T[:r, r:]
        V[pivots[r:] - 1, r:] = np.eye(n - r)
    V *= column[:, None]
    return V, Q, order, r


def strain_form(layout: Layout, weights: Weights) -> StrainForm | None:
    """Return a structure in strain coordinates; None for one without mass or stiffness, or with overflow."""
    n, elastic, N, rows = len(layout.coordinates), weights.k > 0.0, layout.N, layout.R[weights.k > 0.0]
    mass, inertia, root = weights.m @ N**2, np.sqrt(weights.m)[:, None] * N, np.sqrt(weights.k[elastic])[:, None]
    if not (mass > 0.0).all() or not rows.any():
        return None
    V, Q, order, r = unstrained(root * rows, rows, 1.0 / np.sqrt(mass))
    dampers, free = np.sqrt(weights.c[~elastic])[:, None] * layout.R[~elastic], 0
    if r < n:
        _, own, mixed = np.linalg.svd(inertia @ V[:, r:], full_matrices=False)
        V[:, r:] = V[:, r:] @ (mixed.T / own)
        basis, free = parted(combined(dampers, V[:, r:]))
        V[:, r:] = V[:, r:] @ basis
        V[:, r:] = np.where(np.abs(V[:, r:]) * np.sqrt(mass)[:, None] > SUMMED, V[:, r:], 0.0)
        for _ in range(2):  # The first iteration leaves rounding error of strains, which may be large.
            V[:, :r] -= V[:, r:] @ ((inertia @ V[:, r:]).T @ (inertia @ V[:, :r]))
    loss, damped = (weights.c[elastic] / weights.k[elastic])[order], combined(dampers, V)
    damped[:, n - free :] = 0.0
    if np.abs(damped).max(initial=0.0) > 1.0 / UNDERFLOW:
        return None
    forces = np.zeros_like(layout.R)
    forces[elastic.nonzero()[0][order]] = root[order] * Q
    N = np.triu(lapack.dgeqrf(inertia @ V)[0][:n])
    return StrainForm(V, N, Q.T @ (loss[:, None] * Q) + damped.T @ damped, r, free, forces)
