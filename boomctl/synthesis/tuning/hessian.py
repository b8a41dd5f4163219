"""Second derivatives of peaks of singular values by the free numbers, the frequency following its peak.

A change ``d`` of the controller's matrices, and of the plant's, changes a response by ``L d (I - S d)^-1 R``, so that all
derivatives are known in closed form; a simple singular value is an eigenvalue of ``[[0, G], [G^H, 0]]``, whose second
derivative is that of perturbation theory (Lancaster 1964).
"""

import numpy as np

from boomctl.arrays import Array
from boomctl.synthesis.tuning.point import Piece, Point

_APART = 1e-3  # share by which another singular value must lie away: nearer ones are pieces of their own (a choice)
_SHARP = 1e-12  # curvature over frequency, relative, from which on a peak follows its top


def peak_hessian(point: Point, piece: Piece) -> Array:
    """Return the second derivatives of the logarithm of a peak."""
    loop, rows, columns = point.part(piece.model, piece.channel)
    n, k = len(loop.A), len(point.x)
    slopes = point.slopes(piece.model).reshape(k, loop.before.shape[1], -1)
    B, C, D = loop.part(columns, rows)
    before, after = loop.before[:n], loop.after[:, :n]
    through, into = loop.before[n + rows].astype(complex), loop.after[:, n + columns].astype(complex)
    moving = np.isfinite(piece.omega) and n > 0 and piece.omega > 0.0
    P = np.zeros((n, n), complex)  # what it is at infinite frequency
    if np.isfinite(piece.omega) and n:
        P = np.linalg.inv(1j * piece.omega * np.eye(n) - loop.A)
    CP, PB = C @ P, P @ B
    left, right, around = CP @ before + through, after @ PB + into, after @ P @ before + loop.around
    G = CP @ B + D
    U, values, Vh = np.linalg.svd(G)
    u, v, top = U[:, 0], Vh[0].conj(), float(values[0])
    l, r = u.conj() @ left, right @ v
    a, b = np.tensordot(slopes, l, (1, 0)), slopes @ r  # l dK, dK r for every free number
    alpha, beta = a @ right @ Vh.conj().T, b @ (U.conj().T @ left).T  # u^H G_i V and U^H G_i v
    mixed = a @ around @ b.T
    second = np.real(mixed + mixed.T) + np.real(_bent(point.bends(piece.model), l, r))
    gradient = np.real(a @ r)
    size = k
    if moving:
        CPP, PPB = CP @ P, P @ PB
        by_omega = -1j * (CP @ PB)
        alpha = np.vstack([alpha, u.conj() @ by_omega @ Vh.conj().T])
        beta = np.vstack([beta, U.conj().T @ by_omega @ v])
        turned = np.tensordot(slopes, -1j * (u.conj() @ CPP @ before), (1, 0)) @ r + a @ (-1j * (after @ PPB @ v))
        twice = -2.0 * (u.conj() @ CPP @ PB @ v)
        second = np.block([[second, np.real(turned)[:, None]], [np.real(turned)[None, :], np.real(twice)]])
        gradient = np.append(gradient, np.real(u.conj() @ by_omega @ v))
        size = k + 1
    second = second + _from_others(alpha, beta, values, top, size)
    whole = second / top - np.outer(gradient, gradient) / top**2
    if not moving:
        return whole
    bend = whole[k, k]
    if bend >= -_SHARP / max(piece.omega, 1.0) ** 2:
        return whole[:k, :k]
    return whole[:k, :k] - np.outer(whole[:k, k], whole[k, :k]) / bend


def _from_others(alpha: Array, beta: Array, values: Array, top: float, size: int) -> Array:
    """Return what the other singular vectors bring to the second derivatives."""
    found = np.zeros((size, size))
    count, widest = len(values), max(alpha.shape[1], beta.shape[1])
    for j in range(widest):
        if j < count:
            for sign in (1.0, -1.0):
                gap = top - sign * values[j]
                if gap <= _APART * top:
                    continue
                c = 0.5 * (sign * alpha[:, j] + beta[:, j].conj())
                found += 2.0 * np.real(np.outer(c, c.conj())) / gap
        else:
            for vectors in (alpha, beta):
                if j < vectors.shape[1]:
                    c = vectors[:, j]
                    found += 2.0 * 0.5 * np.real(np.outer(c, c.conj())) / top
    return found


def _bent(bends: Array | None, l: Array, r: Array) -> Array:
    """Return what the second derivatives of the controller's and the plant's own matrices bring."""
    return np.zeros(1) if bends is None else np.tensordot(np.tensordot(bends, l, (2, 0)), r, (2, 0))
