"""Plants with balanced states, and loops that a controller closes around them."""

from dataclasses import dataclass
from functools import cached_property
from math import log

import numpy as np
from scipy import linalg

from boomctl.arrays import Array
from boomctl.lti.modal import block_diagonal
from boomctl.lti.rounding import ALIKE, DEPENDENT, ROOT, TINY
from boomctl.synthesis.plants.partition import GeneralizedPlant

_POINTS = 24  # logarithmically spaced grid points, in addition to the resonances
_SPREAD = np.arange(_POINTS) / (_POINTS - 1.0)
_OFFSETS = np.array([-1.0, 0.0, 1.0])  # grid points around a resonance, in half-widths


@dataclass(eq=False)
class ScaledPlant(GeneralizedPlant):
    """Generalized plant with balanced states, and its derivatives by plant parameters.

    Attributes
    ----------
    jacobian, hessian : ndarray or None
        First and second derivatives of ``[[A, B], [C, D]]`` by plant parameters, (k, r, c) and (k, k, r, c).
    order : int
        Order of the controller.
    """

    jacobian: Array | None = None
    hessian: Array | None = None
    order: int = 0

    @cached_property
    def frame(self) -> tuple[Array, Array, Array, Array]:
        """Plant augmented with controller states that are not yet connected.

        It contains ``[[A, B], [C, D]]`` from disturbances to performance, its input matrix from the rates of the controller
        states and the controls, its output matrix to these states and the measurements, and the feedthrough between them.
        """
        n, order, nz, nw = len(self.A), self.order, self.nz, self.nw
        end = n + order
        M, M12 = np.zeros((end + nz, end + nw)), np.zeros((end + nz, order + self.ncon))
        M21, through = np.zeros((order + self.nmeas, end + nw)), np.zeros((order + self.nmeas, order + self.ncon))
        M[:n, :n], M[:n, end:], M[end:, :n], M[end:, end:] = self.A, self.B1, self.C1, self.D11
        M12[:n, order:], M12[end:, order:], M12[n:end, :order] = self.B2, self.D12, np.eye(order)
        M21[order:, :n], M21[order:, end:], M21[:order, n:end] = self.C2, self.D21, np.eye(order)
        through[order:, order:] = self.D22
        return M, M12, M21, through


def without_jordan_blocks(A: Array) -> Array:
    """Return a matrix with defective eigenvalues, for example of weights, separated by a small perturbation.

    Used only by the search: responses are then fast to compute, with an error of the order of the perturbation.
    """
    if not len(A) or independent(A) is not None:
        return A
    blocks, columns, widths = block_diagonal(A, ROOT**-0.5)
    start, perturbation = 0, np.zeros_like(A)
    for width in widths:
        part = slice(start, start + width)
        block = blocks[part, part]
        if width > 1 and independent(block) is None:  # the transposed nilpotent part separates them most
            nilpotent = block - np.eye(width) * np.trace(block) / width
            size = float(np.linalg.norm(nilpotent))
            perturbation[part, part] = ROOT * float(np.linalg.norm(block)) * nilpotent.T / max(size, TINY)
        start += width
    result = A + columns @ perturbation @ np.linalg.inv(columns)
    return result if independent(result) is not None else A


def independent(A: Array) -> tuple[Array, Array, Array] | None:
    """Return eigenvalues, the inverse of the eigenvectors and the eigenvectors, if these are independent."""
    try:
        values, vectors = np.linalg.eig(A)
        inverse = np.linalg.inv(vectors)
    except np.linalg.LinAlgError:
        return None
    if not np.abs(inverse).sum(axis=1).max() <= 1.0 / ROOT:  # for unit vectors
        return None
    return values.astype(complex), inverse.astype(complex), vectors.astype(complex)


@dataclass(frozen=True)
class Closed:
    """Closed loop, and its derivatives by the controller's matrices ``[[A, B], [C, D]]``.

    A change ``d`` of the controller changes ``[[A, B], [C, D]]`` of the loop by ``before @ d @ after`` to first order;
    ``around`` is the feedback of ``d`` on itself.  If the plant depends on plant parameters, ``d`` is block diagonal with
    the changes of the controller's and of the plant's matrix.
    """

    A: Array
    B: Array
    C: Array
    D: Array
    before: Array
    after: Array
    around: Array

    @cached_property
    def coordinates(self) -> tuple[Array, Array, Array]:
        """``A`` in coordinates for fast solving, and the transformations into and out of them.

        If the eigenvectors are independent, modal coordinates, with ``A`` the vector of eigenvalues; otherwise those of
        the Schur form.
        """
        if not len(self.A):
            return np.zeros(0, complex), self.A.astype(complex), self.A.astype(complex)
        result = independent(self.A)
        if result is not None:
            return result
        T, Z = linalg.schur(self.A, output="complex", check_finite=False)
        return T, Z.conj().T, Z

    @cached_property
    def poles(self) -> Array:
        """Eigenvalues [rad/s]."""
        A = self.coordinates[0]
        return A if A.ndim == 1 else np.diagonal(A)

    @property
    def abscissa(self) -> float:
        """Largest real part of the poles."""
        return float(self.poles.real.max(initial=-np.inf))

    @cached_property
    def frequencies(self) -> Array:
        """Ascending frequencies, from zero, that resolve all resonances [rad/s]."""
        poles = self.poles
        size = np.abs(poles)
        top = float(size.max(initial=0.0))
        rates = size[size > ROOT * top]
        if not len(rates):
            return np.zeros(1)
        resonant = poles[poles.imag > 0.0]
        width = np.maximum(np.abs(resonant.real), ALIKE * np.abs(resonant))
        near = (resonant.imag[:, None] + width[:, None] * _OFFSETS).ravel()
        low, high = log(0.1 * float(rates.min())), log(10.0 * top)
        spread = np.exp(low + (high - low) * _SPREAD)
        real = -poles.real[(poles.imag == 0.0) & (size > ROOT * top)]
        result = np.concatenate([[0.0], spread, near[near > 0.0], np.abs(real)])
        result.sort()
        return result[np.append(True, result[1:] > result[:-1])]

    @cached_property
    def inverses(self) -> Array:
        """Inverse distances of these frequencies from the poles, (poles, frequencies)."""
        with np.errstate(all="ignore"):
            return 1.0 / (1j * self.frequencies - self.poles[:, None])

    @cached_property
    def modes(self) -> tuple[Array, Array, Array]:
        """Poles, left eigenvectors as rows and right ones as columns, normalized to products of one."""
        if self.coordinates[0].ndim == 1:
            return self.coordinates
        values, left, right = linalg.eig(self.A, left=True, right=True, check_finite=False)
        left = left.conj().T  # type: ignore[union-attr]
        return values, left / (left * right.T).sum(axis=1)[:, None], right


def close(plant: ScaledPlant, K: Array) -> Closed | None:
    """Return the closed loop of a plant and a controller ``[[A, B], [C, D]]``; None if it is not well-posed."""
    n, order, nu, ny, nw, nz = len(plant.A), plant.order, plant.ncon, plant.nmeas, plant.nw, plant.nz
    end = n + order
    M, M12, M21, through = plant.frame
    gain, before, after, around, inverse = K, M12, M21, through, np.eye(len(K))
    if through.any():
        left = np.eye(len(K)) - K @ through
        if linalg.svdvals(left)[-1] <= DEPENDENT:
            return None
        inverse = np.linalg.inv(left)
        gain = inverse @ K
        before, after, around = M12 @ inverse, (np.eye(len(M21)) + through @ gain) @ M21, through @ inverse
    M = M + M12 @ gain @ M21
    if plant.jacobian is not None:  # rows and columns of the plant's matrix in the loop
        adds, reads = np.zeros((end + nz, n + nz + ny)), np.zeros((n + nw + nu, end + nw))
        adds[:n, :n], adds[end:, n : n + nz] = np.eye(n), np.eye(nz)
        adds[:, n + nz :] = M12 @ gain[:, order:]
        reads[:n, :n], reads[n : n + nw, end:] = np.eye(n), np.eye(nw)
        reads[n + nw :] = gain[order:] @ M21
        controls, measured = order + ny + n + nw, order + nu + n + nz  # offsets of their rows and columns
        whole = np.zeros((controls + nu, measured + ny))
        whole[: order + ny, : order + nu] = around
        whole[order : order + ny, measured:] = np.eye(ny) + plant.D22 @ gain[order:, order:]
        whole[controls:, : order + nu] = inverse[order:]
        whole[controls:, measured:] = gain[order:, order:]
        before, after, around = np.hstack([before, adds]), np.vstack([after, reads]), whole
    return Closed(M[:end, :end], M[:end, end:], M[end:, :end], M[end:, end:], before, after, around)
