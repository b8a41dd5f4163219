"""Independent solutions to compare with: Lagrange multipliers, matrix exponentials."""

import numpy as np
from scipy import linalg

from tests.stress.references import dense_response

ROOTS = {
    "clamped-free": (1.8751040687119611, 4.694091132974175, 7.854757438237613, 10.995540734875467),
    "free-free": (4.730040744862704, 7.853204624095838, 10.995607838001671, 14.137165491257464),
    "pinned-free": (3.9266023120479188, 7.068582745628732, 10.210176122813031, 13.351768777754093),
    "pinned-pinned": (np.pi, 2 * np.pi, 3 * np.pi, 4 * np.pi),
}
"""``beta L`` of uniform beams, in textbooks since Rayleigh: natural frequency ``beta^2 sqrt(EI/rhoA)``."""


def direct(model, omega):
    """Return the response of a force-driven model, (outputs, inputs, frequencies), one solution a frequency."""
    B, L = model.ports.B[0], model.ports.L[0]
    return np.stack([L @ np.linalg.solve(model.K + 1j * w * model.C - w * w * model.M, B) for w in omega], axis=2)


def natural_frequencies(model):
    """Return the undamped natural frequencies [rad/s], ascending: ``1/(1 + omega^2)`` are the eigenvalues solved for.

    Good to some ``eps (1 + omega^2)``, relative, also beside rigid-body modes.
    """
    mu = linalg.eigvalsh(model.M, model.K + model.M)[::-1]
    return np.sqrt(np.maximum(1.0 / mu - 1.0, 0.0))


def kkt_response(matrices, B, L, moved, forced, omega):
    """Return displacements and multipliers of the Lagrange-multiplier system, in sixty digits.

    ``[D, -J; J^T, 0] [z; f_p] = [B_forced f; d]`` with ``J = B[:, moved]``.

    Returns
    -------
    Y : (outputs, moved + forced, frequencies) complex array
        ``L z`` for unit displacements, then for unit forces.
    F : (moved, moved + forced, frequencies) complex array
        The forces ``f_p``.
    """
    J, one = B[:, moved], np.eye(len(moved))
    M, C, K = (linalg.block_diag(X, 0.0 * one) for X in matrices)
    K[: len(J), len(J) :], K[len(J) :, : len(J)] = -J, J.T
    inputs = np.block([[0.0 * J, B[:, forced]], [one, np.zeros((len(moved), len(forced)))]])
    found = dense_response(M, C, K, inputs, linalg.block_diag(L, one), omega)
    return found[: len(L)], found[len(L) :]


def state_space_response(system, omega):
    """Return the response of a state space, of continuous or discrete time, (outputs, inputs, frequencies)."""
    s = 1j * np.asarray(omega)
    if system.dt:
        s = np.exp(s * (1.0 if system.dt is True else system.dt))
    pencils = s[:, None, None] * np.eye(len(system.A)) - system.A
    return np.moveaxis(system.C @ np.linalg.solve(pencils, system.B + 0j) + system.D, 0, -1)


def gains(system, omega):
    """Return the largest singular value of a state space at each frequency."""
    return np.linalg.norm(state_space_response(system, omega), 2, axis=(0, 1))


def motions(rng, count, omega):
    """Return ``S, R, w0`` of a generator ``w' = S w, d = R w``: every ``d`` a random cubic plus a sine of ``omega``."""
    S = np.zeros((6, 6))
    S[0, 1] = S[1, 2] = S[2, 3] = 1.0
    S[4, 5], S[5, 4] = omega, -omega
    return S, rng.standard_normal((count, 6)), rng.standard_normal(6)


def integrated(A, x0, timepts):
    """Return the states of ``x' = A x`` at the times given, one column a time."""
    return np.stack([linalg.expm(A * t) @ x0 for t in timepts], axis=1)


def constrained(matrices, J, S, R):
    """Return ``N, P, A`` of the prescribed motion ``J^T z = R w``.

    ``z = P w + N v`` and ``(v, v', w)' = A (v, v', w)``; ``N`` is an orthonormal basis of the null space of ``J^T``.
    """
    M, C, K = matrices
    N = linalg.null_space(J.T)
    P = linalg.lstsq(J.T, R)[0]
    forcing = -N.T @ (M @ P @ S @ S + C @ P @ S + K @ P)
    m = N.T @ M @ N
    k, r = N.shape[1], len(S)
    A = np.zeros((2 * k + r, 2 * k + r))
    A[:k, k : 2 * k] = np.eye(k)
    A[k : 2 * k] = np.linalg.solve(m, np.hstack([-N.T @ K @ N, -N.T @ C @ N, forcing]))
    A[2 * k :, 2 * k :] = S
    return N, P, A


def prescribed_motion(matrices, J, S, R, w0, v0, timepts):
    """Return the coordinates ``z`` and their rates, one column a time, from ``v(0), v'(0) = v0``."""
    N, P, A = constrained(matrices, J, S, R)
    k = N.shape[1]
    x = integrated(A, np.concatenate([*v0, w0]), timepts)
    return P @ x[2 * k :] + N @ x[:k], P @ S @ x[2 * k :] + N @ x[k : 2 * k]
