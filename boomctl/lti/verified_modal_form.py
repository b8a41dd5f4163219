"""Modal coordinates that answer for themselves: how far their system can be from the one given, at any frequency.

The eigenvectors ``V`` of a solver are taken for a change of coordinates like any other.  In them the system is
``diag(p) + E`` with ``E = V^-1 (A V - V diag(p))``, whose residual keeps twice the digits; one step of perturbation
theory takes out what of ``E`` it can, and what stays bounds the distance: with ``|E| <= F`` and ``r = |Re p|``,
``|(s - diag(p) - E)^-1| <= (diag(r) - F)^-1`` entry by entry, on the imaginary axis; in discrete time on the unit circle,
with ``r = 1 - |p|``.
"""

from dataclasses import dataclass
from math import inf

import numpy as np
from scipy.linalg import lapack

from boomctl.arrays import Array
from boomctl.lti.frequency import singular_values, triangular
from boomctl.lti.modal import ModalSystem
from boomctl.lti.rounding import DIGIT, EPS
from boomctl.lti.system import Lti

INVERSE = 0.1  # distance from one of an inverse times its matrix up to which it is one to build on (a choice)
_FIRST_ORDER = 0.01  # of the distance of two poles: couplings above that are not for perturbation theory (a choice)
_NEUMANN = 8  # terms of (1 + X)^-1, of which each is smaller by a power of _FIRST_ORDER
_DIGITS = 1e-7  # of the strongest mode: modal coordinates that are off by less are not compared with others (a choice)
_CANCELS = 1e6  # times the whole response: modes of more cancel, and their Gramians keep few digits (a choice)
_CONTRACTS = 0.5  # change of A times its resolvent from which on a series of changes is not trusted (a choice)
_BETWEEN = 2.0  # a resonance is this much higher than at the frequencies looked at, at most: they lie at its top


@dataclass(frozen=True)
class VerifiedModalForm:
    """A stable system in modal coordinates, and bounds of its distance from the given one.

    Attributes
    ----------
    modal : ModalSystem
    gap : float
        Of the responses at all frequencies: the H-infinity norm of the difference is not larger.
    energy_gap : float
        Of the impulse responses: the H2 norm of the difference is not larger.
    """

    modal: ModalSystem
    gap: float
    energy_gap: float


def verified_modal_form(system: Lti, doubt: float = 0.0) -> VerifiedModalForm | None:
    """Return a stable system in modal coordinates with the bound of their error; None where they carry too few digits.

    Parameters
    ----------
    system : Lti
        Stable.
    doubt : float
        How far each entry of ``A`` may be from that of the system that is meant.
    """
    A, n = system.A, len(system.A)
    if not n:
        return VerifiedModalForm(ModalSystem(np.zeros(0, complex), system.B + 0j, system.C + 0j, system.D), 0.0, 0.0)
    poles, _, V = system.eigensystem
    first = np.flatnonzero(poles.imag > 0.0)
    try:
        with np.errstate(over="ignore", invalid="ignore"):  # what overflows here is no basis: the next check says so
            acts = np.linalg.norm(np.linalg.solve(V, system.B + 0j), axis=1)
            reads = np.linalg.norm(system.C @ V, axis=0)
            shown = (acts > 0.0) & (reads > 0.0)
            V = V * np.sqrt(np.where(shown, acts, 1.0) / np.where(shown, reads, 1.0))
            V[:, first + 1] = V[:, first].conj()
            W = np.linalg.inv(V)
    except np.linalg.LinAlgError:
        return None
    with np.errstate(over="ignore", invalid="ignore"):
        F = np.abs(np.eye(n) - W @ V) + (n + 4) * EPS * (np.abs(W) @ np.abs(V))
    if not np.isfinite(F).all() or F.sum(axis=1).max() > INVERSE:
        return None
    wide = np.clongdouble
    u = (n + 4) * float(np.finfo(wide).eps)
    V_, p_ = V.astype(wide), poles.astype(wide)
    size_V, size_W = np.abs(V), np.abs(W)

    one = np.flatnonzero(poles.imag >= 0.0)  # of a pair the other column is conjugate, and so is its product
    product, lost = np.empty_like(V_), np.empty((n, n))
    product[:, one], lost[:, one] = _product(A, V[:, one])
    product[:, first + 1], lost[:, first + 1] = product[:, first].conj(), lost[:, first]
    residual = (product - V_ * p_).astype(complex)
    E = W @ residual
    lost = lost + u * (np.abs(A) @ size_V + size_V * np.abs(poles)) + doubt * size_V.sum(axis=0)
    dE = size_W @ (lost + (n + 4) * EPS * np.abs(residual))
    dE = dE + _beyond(F, np.abs(E) + dE)  # |V^-1| <= (1 - F)^-1 |W|
    B = W @ system.B
    B = B + (W @ (system.B - V_ @ B).astype(complex)).astype(wide)
    left = np.abs(system.B - V_ @ B).astype(float) + u * (np.abs(system.B) + size_V @ np.abs(B).astype(float))
    dB, C = size_W @ left, system.C @ V_
    dB = dB + _beyond(F, dB)
    dC = u * (np.abs(system.C) @ size_V)

    better = p_ + np.diag(E)
    between, moved = (better[None, :] - better[:, None]).astype(complex), (p_ - better).astype(complex)
    np.fill_diagonal(between, 1.0)
    size_E = np.abs(E)
    weak = (size_E * n <= _FIRST_ORDER * np.abs(between)) & (between != 0.0)
    np.fill_diagonal(weak, False)
    X = np.where(weak, E / np.where(weak, between, 1.0), 0.0)
    size_X, size_C = np.abs(X), np.abs(C).astype(float)
    C_new, change = C + C.astype(complex) @ X, np.zeros_like(B, complex)
    for _ in range(_NEUMANN):
        change = X @ (B - change).astype(complex)
    B_new = B - change
    size_B = np.abs(B_new).astype(float)
    dB = dB + np.abs(change - X @ B_new.astype(complex)) + 2.0 * u * size_B + (n + 4) * EPS * (size_X @ size_B)
    dB = dB + _beyond(size_X, dB)  # |(1 + X)^-1| <= (1 - |X|)^-1
    dC = dC + dC @ size_X + u * size_C + (n + 4) * EPS * (size_C @ size_X)
    # from each pole as it was to the others as they are now
    rest = np.diag(moved) + (moved[:, None] - between) * X + E + E @ X
    rounding = 4.0 * EPS * (2.0 * size_E + np.abs(moved)[:, None] * size_X) + (n + 4) * EPS * (size_E @ size_X)
    F = np.abs(rest) + dE + dE @ size_X + rounding
    F = F + _beyond(size_X, F)

    if (better.imag[first] <= 0.0).any():  # a pair that is none: two equal real poles
        return None
    chosen = _paired(first, better.astype(complex), B_new.astype(complex), C_new.astype(complex), system.D)
    F[np.diag_indices(n)] += np.abs(better - chosen.poles).astype(float)
    dB, dC = dB + np.abs(B_new - chosen.B).astype(float), dC + np.abs(C_new - chosen.C).astype(float)
    return VerifiedModalForm(chosen, *_distances(chosen, F, dB, dC, system.dt != 0.0))


def _product(A: Array, X: Array) -> tuple[Array, Array]:
    """Return the product of a real and a complex matrix in long numbers, and by how much its entries may be off.

    Each matrix is parted in its leading bits, as few as products of such numbers and their sums have no rounding, and what is
    left, whose products are small (Ozaki et al. 2012, Numerical Algorithms 59).
    """
    n = A.shape[1]
    bits = (np.finfo(float).nmant + 1 - (n - 1).bit_length()) // 2
    parts = np.concatenate([X.real, X.imag], axis=1)
    (rows, A1), (columns, X1) = _leading(A, 1, bits), _leading(parts, 0, bits)
    product = (A1 @ X1).astype(np.longdouble) + (A1 @ (parts - X1) + (A - A1) @ parts)
    # what is left of an entry is at most half of its last leading bit; the sum of both products is rounded once more
    sums = np.abs(A).sum(axis=1, keepdims=True) * columns + rows * np.abs(parts).sum(axis=0)
    lost = (n + 2) * EPS * 2.0**-bits * sums
    k = X.shape[1]
    return product[:, :k] + 1j * product[:, k:], lost[:, :k] + lost[:, k:]


def _leading(M: Array, axis: int, bits: int) -> tuple[Array, Array]:
    """Return powers of two above the entries of rows or columns, and the entries rounded to so many bits below these."""
    largest = np.abs(M).max(axis=axis, keepdims=True)
    above = np.frexp(largest)[1]
    far = np.ldexp(1.5, above + np.finfo(float).nmant - bits)
    return np.where(largest > 0.0, np.ldexp(1.0, above), 0.0), M + far - far


def _beyond(F: Array, M: Array) -> Array:
    """Return what ``(1 - F)^-1 M - M`` is at most, of entries not below zero; rows of ``F`` sum to less than one."""
    share, first = float(F.sum(axis=1).max()), F @ M
    return first + share / (1.0 - share) * first.max(axis=0)


def rounding_doubt(system: Lti, doubt: float = 0.0) -> float:
    """Return how much rounding of a stable system's matrices may change its response, where that shows most.

    To all orders of the change, as seen at the resonances; ``inf`` where rounding alone may make it unstable.
    """
    if not len(system.A) or not system.D.size:
        return 0.0
    size = DIGIT * float(np.linalg.norm(system.A)) + len(system.A) * doubt
    asked = [np.abs(system.poles), np.abs(system.poles.imag)] if system.dt == 0.0 else [np.abs(system.rates.imag)]
    omega = np.unique(np.concatenate([[0.0], *asked]))
    eye, worst, turned = np.eye(len(system.A)), 0.0, triangular(system)  # by a unitary matrix: sizes stay as they are
    for w in omega:
        resolvent, at_pole = lapack.ztrtri(system.boundary(w) * eye - turned.T)
        if at_pole:
            return inf
        share = size * np.linalg.norm(resolvent)  # of all its singular values: at a resonance the largest rules
        if share >= _CONTRACTS:
            return inf
        reads, acts = np.linalg.norm(turned.C @ resolvent, 2), np.linalg.norm(resolvent @ turned.B, 2)
        worst = max(worst, float(reads * size * acts / (1.0 - share)))
    return _BETWEEN * worst


def in_verified_modal_form(system: Lti, doubt: float = 0.0) -> tuple[ModalSystem | None, float]:
    """Return a stable system in modal coordinates, None where its own keep more digits, and a bound of what is lost."""
    result = verified_modal_form(system, doubt)
    if result is None:
        return None, rounding_doubt(system, doubt)
    modal = result.modal
    peak = singular_values(modal.response(np.abs(modal.poles)))[0].max() if len(modal.poles) and modal.D.size else 0.0
    cancels = modal.sizes.max(initial=0.0) > _CANCELS * peak
    if not cancels and result.gap <= _DIGITS * peak:
        return modal, result.gap
    own = rounding_doubt(system, doubt)
    return (modal, result.gap) if not cancels and result.gap <= own else (None, own)


def _paired(first: Array, poles: Array, B: Array, C: Array, D: Array) -> ModalSystem:
    """Return a modal system whose pairs are conjugate to the last digit."""
    poles, B, C = poles.copy(), B.copy(), C.copy()
    poles[first + 1], B[first + 1], C[:, first + 1] = poles[first].conj(), B[first].conj(), C[:, first].conj()
    single = np.setdiff1d(np.arange(len(poles)), np.concatenate([first, first + 1]))
    poles[single], B[single], C[:, single] = poles[single].real, B[single].real, C[:, single].real
    return ModalSystem(poles, B, C, D)


@np.errstate(over="ignore", invalid="ignore")  # what overflows here is no bound: the last check says so
def _distances(modal: ModalSystem, F: Array, dB: Array, dC: Array, discrete: bool) -> tuple[float, float]:
    """Return what errors of a modal system, bounded entry by entry, change of its response and its H2 norm at most."""
    decay = 1.0 - np.abs(modal.poles) if discrete else -modal.poles.real
    if decay.min() <= 0.0:
        return inf, inf
    try:
        resolvent = np.linalg.inv(np.eye(len(F)) - F / decay[:, None]) / decay
    except np.linalg.LinAlgError:
        return inf, inf
    if not (resolvent >= 0.0).all():
        return inf, inf
    B, C = np.abs(modal.B), np.abs(modal.C)
    change = (C + dC) @ resolvent @ (F @ (B / decay[:, None]) + dB) + dC @ (B / decay[:, None])
    if not np.isfinite(change).all():
        return inf, inf
    far = float(np.linalg.norm(change, 2)) if change.size else 0.0
    # the energy of z' = p z + v is that of v/sqrt(2 r) for an impulse, at most that of v over r for what F feeds back; that
    # of z+ = p z + v is v/sqrt(1 - |p|^2), and 1 - |p|^2 = (1 - |p|)(1 + |p|)
    energy = decay * (2.0 - decay) if discrete else 2.0 * decay
    own, added = (np.linalg.norm(rows, axis=1) / np.sqrt(energy) for rows in (B, dB))
    states = (resolvent * decay) @ (own + added)
    moved = added + F @ states / decay
    reads, lost = np.linalg.norm(C, axis=0), np.linalg.norm(dC, axis=0)
    return far, float((reads + lost) @ moved + lost @ own)
