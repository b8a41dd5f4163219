"""Poles on either side of the imaginary axis, state space in modal coordinates, and block-diagonal forms.

:func:`side_of_axis` defines which poles count as undamped.  It separates a system into a stable part, which may be reduced,
and a part that is retained unchanged (unstable, undamped, rigid-body).

A lightly damped mode is well conditioned in its own coordinates: its Gramians are nearly diagonal there, while in any
other coordinates they are sums of numbers that nearly cancel.

Integrators and rigid bodies, poles at zero (``z = 1``) and their Jordan chains, are identified by deflation.  An eigenvalue
solver perturbs a chain of ``k`` poles at zero by the ``k``-th root of the rounding error, and a pole near slow poles by the
rounding error over their distance, so computed poles do not identify integrators.  The criterion is that ``A`` is singular
to within the rounding error of its entries.  Its null space is then deflated, and the remainder is tested again.
"""

from dataclasses import dataclass, replace
from functools import cached_property
from math import inf
from typing import Any

import numpy as np
from scipy import linalg

from boomctl.arrays import Array, squared
from boomctl.lti.rounding import CANCELLED, DIGIT, EPS, ROOT, SOLVED
from boomctl.lti.system import Lti, parallel, rates_of
from boomctl.printing import compact

# Relative damping |Re p|/|p| up to which a pole counts as undamped.  Rounding alone leaves up to 5e-12 in the computed
# poles of undamped structures (booms of up to 40 elements 2e-13, random coordinates 5e-12), materials have 1e-4 and more.
UNDAMPED = 1e-10
_CLUSTER = 10.0  # Largest ratio of the magnitudes of poles in such a block.
_BLOCK_NOISE = 1e2 * EPS  # Fraction of the fastest pole below which a pole belongs to such a block in any case.
_CONDITION = 1e9  # Largest eigenvector condition of modal coordinates; leaves 7 significant digits.
_CLUSTERED = 1e6  # Multiple of rounding whose k-th root times the norm of A limits the spacing of k poles in a cluster.
_OFF = 1e-3  # Fraction of the radius of a cluster up to which its mean is on the boundary.
# Fraction of the largest pole below which a simple pole may be a pole at zero near other slow poles.
_RIGID = 1e-6
_SPREAD = 10.0  # Largest spread of the poles of a chain, in units of the k-th root of rounding times the norm of A.
_MAPPED = 16.0  # Rounding operations that map a mode to its image.


def side_of_axis(poles: Array, error_bound: Array | float = 0.0) -> Array:
    """Return the side of the imaginary axis of each pole: -1 for stable, 1 for unstable, 0 for undamped.

    A pole is undamped if it is on the axis to within rounding error: if its damping ratio is at most ``UNDAMPED``, if it is
    negligible relative to the fastest pole (an integrator), or if it is unstable by less than its rounding error.

    Parameters
    ----------
    poles : (n,) complex ndarray
    error_bound : float or (n,) ndarray
        Bound on the rounding error of a pole [rad/s], 0 if unknown; within it a pole counts as undamped.
    """
    size = np.abs(poles)
    fastest = size.max(initial=0.0)
    margin = np.maximum(UNDAMPED * size, error_bound)
    side = np.zeros(len(poles), dtype=int)
    # A pole may be a pole at zero to within rounding error, or be moved to the right by rounding error.
    side[(poles.real < -margin) & (size > DIGIT * fastest)] = -1
    side[poles.real > np.maximum(margin, SOLVED * fastest)] = 1
    return side


def sides(poles: Array, dt: float, error_bound: Array | float = 0.0) -> Array:
    """Return the side of the stability boundary of each pole, see :func:`side_of_axis`.

    In discrete time the boundary is the unit circle; poles at it to within rounding of a pole of magnitude one are undamped.
    """
    if dt == 0.0:
        return side_of_axis(poles, error_bound)
    rates = rates_of(poles, dt)
    # A pole at z = 0 has an infinite rate, and equals any pole there to within rounding error.
    side = side_of_axis(np.maximum(rates.real, np.log(EPS) / dt) + 1j * rates.imag)
    side[np.abs(np.abs(poles) - 1.0) <= np.maximum(CANCELLED, error_bound)] = 0
    return side


def transmission_zeros(system: Lti) -> Array:
    """Return the finite transmission zeros [rad/s]; in discrete time without a unit."""
    from slycot import ab08nd  # long to import

    n, (p, m) = len(system.A), system.D.shape
    if not n:
        return np.zeros(0, complex)
    # slycot's default length of the work array is too small for many signals of few states
    result = ab08nd(n, m, p, system.A, system.B, system.C, system.D, ldwork=n + 4 * max(m, p, 1))
    E, F = (matrix[: result[0], : result[0]] for matrix in result[8:10])
    zeros = linalg.eigvals(E, F).astype(complex)
    return zeros[np.isfinite(zeros)]


def boundary_sides(system: Lti) -> Array:
    """Return the side of the stability boundary of each pole, as :func:`sides` does, with clusters as one pole.

    Rounding moves a pole of multiplicity ``k`` by the ``k``-th root of its own size, on a circle around it.  A cluster of
    poles lies on the boundary if its mean does and ``A`` less that point is singular to within rounding.

    Parameters
    ----------
    system : Lti
        Balanced.
    """
    from scipy.cluster import hierarchy  # imports scipy.spatial and scipy.special: only where poles are clustered

    A, dt, poles, side = system.A, system.dt, system.poles, sides(system.poles, system.dt)
    points = np.where(side == 0, _on_boundary(poles, dt), poles)
    if len(points) < 2:
        return side
    norm, members = float(np.linalg.norm(A)), [[k] for k in range(len(A))]
    distances = np.abs(points[:, None] - points)[np.triu_indices(len(A), 1)]
    for first, second, distance, _ in hierarchy.linkage(distances, "single"):
        chosen = members[int(first)] + members[int(second)]
        members.append(chosen)
        point = _on_boundary(poles[chosen].mean(), dt)
        offset = poles[chosen] - point
        growth = float((offset if dt == 0.0 else offset * np.conj(point)).real.sum())
        if (
            distance <= (_CLUSTERED * EPS) ** (1.0 / len(chosen)) * norm
            and abs(growth) <= _OFF * np.abs(offset[side[chosen] != 0]).sum() + len(chosen) * CANCELLED * norm
            and linalg.svdvals(A - point * np.eye(len(A)))[-1] <= len(A) * CANCELLED * norm
        ):
            side[chosen] = 0
    return side


def _on_boundary(poles: Any, dt: float) -> Any:
    """Return the points of the boundary of stability nearest to poles."""
    return 1j * poles.imag if dt == 0.0 else np.exp(1j * np.angle(poles))


def resolved(poles: Array) -> Array:
    """Return which poles are accurate: those not negligible relative to the fastest."""
    size = np.abs(poles)
    return size > SOLVED * size.max(initial=0.0)


@dataclass(frozen=True)
class ModalSystem:
    """A system in modal coordinates, ``y = C z + D u``, ``z' = diag(poles) z + B u``.

    Conjugate poles are adjacent, with the positive imaginary part first.
    """

    poles: Array
    B: Array
    C: Array
    D: Array

    __repr__ = compact

    @property
    def sizes(self) -> Array:
        """Bound of each mode's response at any frequency: ``|c| |b| / |Re pole|``."""
        lengths = np.sqrt(squared(self.C).sum(axis=0)) * np.sqrt(squared(self.B).sum(axis=1))
        return lengths / np.abs(self.poles.real)

    def only(self, chosen: Array) -> "ModalSystem":
        """Return the system of the modes chosen; both of a pair, or none."""
        return ModalSystem(self.poles[chosen], self.B[chosen], self.C[:, chosen], self.D)

    @property
    def mixing(self) -> Array:
        """The unitary matrix from modal to real coordinates."""
        return self.mixed(np.eye(len(self.poles), dtype=complex))

    def mixed(self, rows: Array) -> Array:
        """Return :attr:`mixing` times a matrix."""
        result, first = rows.copy(), np.flatnonzero(self.poles.imag > 0.0)
        one, other = np.sqrt(0.5) * rows[first], np.sqrt(0.5) * rows[first + 1]
        result[first], result[first + 1] = one + other, 1j * (other - one)
        return result

    def real_form(self, matrix: Array) -> Array:
        """Return a matrix in modal coordinates, such as a Gramian, in real ones."""
        return np.real(self.mixed(self.mixed(matrix).conj().T)).T

    @property
    def blocks(self) -> Lti:
        """The same system in real coordinates, a block of two a pair; ``A`` without rounding."""
        A, first = np.diag(self.poles.real), np.flatnonzero(self.poles.imag > 0.0)
        A[first, first + 1], A[first + 1, first] = -self.poles.imag[first], self.poles.imag[first]
        return Lti(A, np.real(self.mixed(self.B)), np.real(self.mixed(self.C.conj().T)).T, self.D)

    def response(self, omega: Array) -> Array:
        """Return the frequency response, shape (outputs, inputs, frequencies)."""
        response = self.terms.T @ (1.0 / (1j * omega - self.poles[:, None]))
        return response.reshape(*self.D.shape, len(omega)) + self.D[:, :, None]

    @cached_property
    def terms(self) -> Array:
        """Residue of each mode: its response times its distance from the frequency, (modes, entries of ``D``)."""
        return (self.C.T[:, :, None] * self.B[:, None, :]).reshape(len(self.poles), self.D.size)


def partial_fractions(system: Lti) -> ModalSystem:
    """Return a system in the coordinates of its eigenvectors, regardless of their accuracy.

    Its response is fast to evaluate, and accurate enough to locate the peaks.
    """
    poles, reads, right = system.eigensystem
    with np.errstate(over="ignore", invalid="ignore"):  # equal poles in a chain have no eigenvectors of their own
        return ModalSystem(poles, reads @ system.B, system.C @ right, system.D)


def continuous_image_of_modes(modes: ModalSystem, dt: float) -> tuple[ModalSystem, float]:
    """Return the image of stable discrete modes under the bilinear map, and a bound on the rounding error of the response.

    With ``w = g (z - 1)/(z + 1)``, ``g = 2/dt``, a mode ``r/(z - pole)`` is ``2 g r/(1 + pole)^2 / (w - p)`` at the pole's
    own image ``p``, less ``r/(1 + pole)``.  The error of an image by one rounding corresponds to no larger error of the pole.
    If ``dt`` is 0, they are unchanged.
    """
    if dt == 0.0:
        return modes, 0.0
    g, after = 2.0 / dt, 1.0 + modes.poles
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        D = (modes.D - ((modes.C / after) @ modes.B)).real
        image = ModalSystem(g * (modes.poles - 1.0) / after, modes.B * (2.0 * g / after**2)[:, None], modes.C, D)
        size, decay = np.linalg.norm(modes.terms, axis=1), 1.0 - np.abs(modes.poles)
        lost = float((size / decay * (1.0 + 1.0 / decay)).sum())
    return image, (len(decay) + _MAPPED) * EPS * lost


def diagonalized(system: Lti) -> ModalSystem | None:
    """Return a system in modal coordinates, or None if the eigenvectors are ill-conditioned.

    Modes are corrected to first order in the residuals of the eigenvalue problem, which keeps slow modes accurate among fast
    ones.  Each is scaled so that its row of ``B`` and its column of ``C`` are of equal length, which keeps Gramians accurate.
    """
    poles, reads, right = system.eigensystem
    if not (np.isfinite(reads).all() and np.linalg.norm(right) * np.linalg.norm(reads) <= _CONDITION * len(poles)):
        return None
    first, single = np.flatnonzero(poles.imag > 0.0), poles.imag == 0.0
    change: Array = reads @ (system.A @ right - right * poles)
    B, C = reads @ system.B, system.C @ right
    with np.errstate(divide="ignore", invalid="ignore"):
        mixed = change / (poles - poles[:, None] + np.diag(np.full(len(poles), inf)))
        equal = ~(np.abs(mixed) <= ROOT)  # to within rounding
        # Modes of nearly defective poles remain as they are: their eigenvectors are nearly parallel.
        defective = equal.any(axis=1) & (np.linalg.norm(reads, axis=1) > ROOT**-0.5)
        mixed[equal | defective | defective[:, None]] = 0.0
        B, C = B - mixed @ B, C + C @ mixed
        read, acts = np.linalg.norm(C, axis=0), np.linalg.norm(B, axis=1)
        scale = np.where((read > 0.0) & (acts > 0.0), np.sqrt(read / acts), 1.0)
    exact, rows, columns = poles + np.where(defective, 0.0, change.diagonal()), B * scale[:, None], C / scale
    item: Array
    for item in (exact, rows, columns.T):  # exactly in pairs
        item[first + 1], item[single] = item[first].conj(), item[single].real
    return ModalSystem(exact, rows, columns, system.D)


@dataclass(frozen=True)
class SpectralParts:
    """A system as the sum of two subsystems.

    Attributes
    ----------
    rest : Lti
        With ``D``.
    retained : Lti
        The part that is split off, without ``D``.
    error_bound : float
        First-order bound on the rounding error of the entries of ``rest.A``; 0 if nothing was split.
    """

    rest: Lti
    retained: Lti
    error_bound: float

    @classmethod
    def of(cls, system: Lti, A: Array, Z: Array, count: int) -> "SpectralParts":
        """Return the sum of the first ``count`` states and the others of ``A``, block triangular, in columns ``Z``."""
        N, rest = A[:count, :count], A[count:, count:]
        X = linalg.solve_sylvester(N, -rest, -A[:count, count:]) if 0 < count < len(A) else np.zeros((count, len(rest)))
        B, C = Z.T @ system.B, system.C @ Z
        norm = 1.0 + (float(np.linalg.norm(X, 2)) if X.size else 0.0)
        return cls(
            Lti(rest, B[count:], C[:, :count] @ X + C[:, count:], system.D, dt=system.dt),
            Lti(N, B[:count] - X @ B[count:], C[:, :count], np.zeros_like(system.D), dt=system.dt),
            CANCELLED * float(np.linalg.norm(system.A)) * norm,
        )


def without_integrators(system: Lti) -> SpectralParts:
    """Return a system as the sum of its integrators, with complete Jordan chains, and the remainder.

    The integrators have an upper triangular ``A`` with zeros on its diagonal, in discrete time ones.
    """
    n, one = len(system.A), 0.0 if system.dt == 0.0 else 1.0
    scaled = system.balanced()
    T, Z, size, count, carried = scaled.A - one * np.eye(n), np.eye(n), np.abs(scaled.A), 0, 0.0
    if one:  # Sampled small entries are sums of terms as large as the largest.
        size[:] = size.max(initial=0.0)
    while count < n:
        values = linalg.svdvals(T[count:, count:])
        if values[-1] > n * CANCELLED * np.linalg.norm(size[count:, count:]) + EPS * values[0] + carried:
            break  # far from singular
        U, values, Vt = linalg.svd(T[count:, count:])
        error_bound = n * CANCELLED * ((np.abs(U).T @ size[count:, count:]) * np.abs(Vt)).sum(axis=1)
        null = values <= error_bound + EPS * values[0] + carried
        if not null.any():
            break
        if not null.all():  # Errors of the null vectors, and of the remainder.
            carried += float(values[0] * values[null].max() / values[~null].min())
        Q = np.eye(n)
        Q[count:, count:] = Vt[null.argsort()[::-1]].T
        T, Z, size = Q.T @ T @ Q, Z @ Q, np.abs(Q).T @ size @ np.abs(Q)
        T[count:, count : count + null.sum()] = 0.0
        count += int(null.sum())
    if count:
        sizes = np.sort(np.abs(system.poles - one))
        moved = _SPREAD * EPS ** (1.0 / count) * float(np.linalg.norm(scaled.A - one * np.eye(n), 2))
        if sizes[count - 1] <= max(_RIGID * sizes[-1], moved):
            return SpectralParts.of(scaled, T + one * np.eye(n), Z, count)
    none = Lti(T[:0, :0], system.B[:0], system.C[:, :0], np.zeros_like(system.D), dt=system.dt)
    return SpectralParts(system, none, 0.0)


def spectral_parts(system: Lti) -> SpectralParts:
    """Return the stable part (with ``D``) and the retained part (unstable, undamped, rigid-body; without ``D``).

    Integrators and rigid bodies are separated first, by structure (:func:`without_integrators`).  Other Jordan blocks are not
    divided: poles near zero are retained with a retained pole there.

    Raises
    ------
    ValueError
        If the two parts coincide to within rounding.
    """
    chain = without_integrators(system)
    poles, dt = chain.rest.poles, system.dt
    retained, size = sides(poles, dt) >= 0, np.abs(poles - (dt != 0.0))
    if not retained.any():
        return chain
    near = retained & (size <= ROOT * size.max())
    if near.any():
        retained |= size <= max(_CLUSTER * float(size[near].max()), _BLOCK_NOISE * float(size.max()))
    parts = split(chain.rest, retained, "unstable, undamped or rigid-body poles")
    return SpectralParts(parts.rest, parallel(chain.retained, parts.retained), chain.error_bound + parts.error_bound)


def split(system: Lti, chosen: Array, what: str = "poles") -> SpectralParts:
    """Return a system as the sum of a retained part, which has the chosen poles, and the rest.

    Computed by an ordered Schur form and a Sylvester equation.

    Parameters
    ----------
    system : Lti
    chosen : (n,) ndarray of bool
        Which of ``system.poles``.
    what : str
        Name of the chosen poles in a message.

    Raises
    ------
    ValueError
        If the chosen poles are too close to others.
    """
    ours, others = system.poles[chosen], system.poles[~chosen]

    def first(re: float, im: float = 0.0) -> bool:
        pole = complex(re, im)
        return bool(np.abs(ours - pole).min(initial=np.inf) < np.abs(others - pole).min(initial=np.inf))

    T, Z, count = linalg.schur(system.A, output="real", sort=first)  # type: ignore[misc]
    if count != len(ours):
        raise ValueError(
            f"{len(ours)} {what} do not separate from the others ({count} found in the Schur form): they are too close"
        )
    return SpectralParts.of(system, T, Z, count)


def residualised(system: Lti, count: int) -> Lti:
    """Return the first ``count`` states with the others at rest, ``x2' = 0`` or ``x2+ = x2``: the static gain is preserved.

    Raises
    ------
    numpy.linalg.LinAlgError
        If the others have no static response, as an integrator.
    """
    r, A, B, C, D = count, system.A, system.B, system.C, system.D
    if r >= len(A):
        return system
    still = A[r:, r:] if system.dt == 0.0 else A[r:, r:] - np.eye(len(A) - r)
    rest = -np.linalg.solve(still, np.hstack([A[r:, :r], B[r:]]))
    X, U = rest[:, :r], rest[:, r:]
    return replace(
        system, A=A[:r, :r] + A[:r, r:] @ X, B=B[:r] + A[:r, r:] @ U, C=C[:, :r] + C[:, r:] @ X, D=D + C[:, r:] @ U,
        state_labels=system.state_labels[:r],
    )  # fmt: skip


def block_diagonal(A: Array, condition: float | None = None) -> tuple[Array, Array, list[int]]:
    """Return a block-diagonal matrix, the columns that bring ``A`` to it, and the widths of its blocks.

    Parameters
    ----------
    A : (n, n) ndarray
        Real.
    condition : float, optional
        Largest condition of the columns; the blocks are the smallest that it allows. By default half of the
        accuracy is preserved.
    """
    from boomctl.lti.python_control import control

    blocks, columns, widths = control.bdschur(A, condmax=condition)
    return blocks, columns, [int(width) for width in widths]
