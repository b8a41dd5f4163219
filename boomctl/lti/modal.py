"""State space in modal coordinates: unstable and rigid-body parts split off, stable modes one by one.

A lightly damped mode is well conditioned in its own coordinates: its Gramians are nearly diagonal there, while in any
other coordinates they are sums of numbers that nearly cancel.
"""

from dataclasses import dataclass

import numpy as np
from scipy import linalg

from boomctl.arrays import Array
from boomctl.lti.system import Lti

_AXIS = 1e-9
_RIGID = 1e-7
_CLUSTER = 10.0
_CONDITION = 1e9
_RESIDUAL = 1e-9


@dataclass(frozen=True)
class ModalSystem:
    """A stable system in modal coordinates, ``y = C z + D u``, ``z' = diag(poles) z + B u``.

    Conjugate poles stand side by side, the one of positive imaginary part first; each mode is scaled so that its row
    of ``B`` and its column of ``C`` are of equal length.
    """

    poles: Array
    B: Array
    C: Array
    D: Array

    @property
    def sizes(self) -> Array:
        """Bound of each mode's response at any frequency: ``|c| |b| / |Re pole|``."""
        lengths = np.linalg.norm(self.C, axis=0) * np.linalg.norm(self.B, axis=1)
        return lengths / np.abs(self.poles.real)

    def only(self, chosen: Array) -> "ModalSystem":
        """Return the system of the modes chosen; both of a pair, or none."""
        return ModalSystem(self.poles[chosen], self.B[chosen], self.C[:, chosen], self.D)

    @property
    def mixing(self) -> Array:
        """The unitary matrix from modal to real coordinates."""
        J = np.eye(len(self.poles), dtype=complex)
        first = np.flatnonzero(self.poles.imag > 0.0)
        J[first, first], J[first, first + 1] = np.sqrt(0.5), np.sqrt(0.5)
        J[first + 1, first], J[first + 1, first + 1] = -1j * np.sqrt(0.5), 1j * np.sqrt(0.5)
        return J

    @property
    def blocks(self) -> Lti:
        """The same system in real coordinates, a block of two a pair."""
        J = self.mixing
        A = (J * self.poles) @ J.conj().T
        return Lti(np.real(A), np.real(J @ self.B), np.real(self.C @ J.conj().T), self.D)

    def response(self, omega: Array) -> Array:
        """Return the frequency response, shape (outputs, inputs, frequencies)."""
        shares = 1.0 / (1j * omega[None, :] - self.poles[:, None])
        terms = (self.C.T[:, :, None] * self.B[:, None, :]).reshape(len(self.poles), self.D.size)
        return (terms.T @ shares).reshape(*self.D.shape, len(omega)) + self.D[:, :, None]


def spectral_parts(system: Lti) -> tuple[Lti, Lti]:
    """Return the stable part (with ``D``) and the kept part (unstable, on the axis, rigid-body; without ``D``).

    The split is an ordered Schur form and a Sylvester equation, so that Jordan blocks (rigid bodies) stay whole.
    """
    n = len(system.A)
    nothing = Lti(np.zeros((0, 0)), system.B[:0], system.C[:, :0], np.zeros_like(system.D))
    if n == 0:
        return system, nothing
    poles = linalg.eigvals(system.A)
    kept = _kept(poles)
    count = int(kept.sum())
    if count == 0:
        return system, nothing
    T, Z = _ordered(system.A, poles, kept)
    X = linalg.solve_sylvester(T[:count, :count], -T[count:, count:], -T[:count, count:])
    B, C = Z.T @ system.B, system.C @ Z
    slow = Lti(T[:count, :count], B[:count] - X @ B[count:], C[:, :count], np.zeros_like(system.D))
    fast = Lti(T[count:, count:], B[count:], C[:, :count] @ X + C[:, count:], system.D)
    return fast, slow


def _kept(poles: Array) -> Array:
    """Return which poles are unstable, on the axis, or near zero with one that is (a Jordan block, rounded)."""
    size = np.abs(poles)
    kept = poles.real >= -_AXIS * size
    near = kept & (size <= _RIGID * size.max())
    if near.any():
        kept |= size <= max(_CLUSTER * float(size[near].max()), 1e2 * np.finfo(float).eps * float(size.max()))
    return kept


def _ordered(A: Array, poles: Array, kept: Array) -> tuple[Array, Array]:
    """Return the real Schur form with the kept poles first."""
    chosen, others = poles[kept], poles[~kept]

    def first(re: float, im: float = 0.0) -> bool:
        value = complex(re, im)
        return bool(np.abs(chosen - value).min() < np.abs(others - value).min(initial=np.inf))

    T, Z, count = linalg.schur(A, output="real", sort=first)  # type: ignore[misc]
    if count != len(chosen):
        raise ValueError(
            f"{len(chosen)} unstable, undamped or rigid-body poles do not separate from the others "
            f"({count} found in the Schur form): poles too close to the imaginary axis to tell"
        )
    return T, Z


def diagonalized(system: Lti) -> ModalSystem | None:
    """Return a stable system in modal coordinates, or None where it has no well-conditioned ones."""
    n = len(system.A)
    if n == 0:
        return ModalSystem(np.zeros(0, complex), system.B.astype(complex), system.C.astype(complex), system.D)
    poles, V = linalg.eig(system.A)
    if np.linalg.cond(V) > _CONDITION:
        return None
    residual = np.abs(system.A @ V - V * poles).max()
    if residual > _RESIDUAL * np.abs(system.A).max():
        return None
    B, C = np.linalg.solve(V, system.B.astype(complex)), system.C @ V
    reads, acts = np.linalg.norm(C, axis=0), np.linalg.norm(B, axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        scale = np.where((reads > 0.0) & (acts > 0.0), np.sqrt(reads / acts), 1.0)
    return ModalSystem(poles, B * scale[:, None], C / scale, system.D)
