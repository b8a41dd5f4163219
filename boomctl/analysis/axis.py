"""Poles at the imaginary axis, in discrete time at the unit circle: do they decay, and do they show in the response?

An eigenvalue solver cannot tell: it moves poles by rounding.  Where its poles lie so near to the axis that this matters,
the invariant subspace that belongs to them is refined in 60 digits, with the matrices given taken as exact.  Then one of
three things is known of a group of poles: it decays or grows; it lies on the axis, to the last of those digits, and
shows or does not; or the answer would change with the last digit of what was given, and none is told.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy import linalg

from boomctl.arrays import Array
from boomctl.lti.system import Lti

_EPS = float(np.finfo(float).eps)
_MOVED = 32.0  # units of rounding of the entries of A, over the angle of its eigenvectors, by which a pole may be off
_PARALLEL = 1e-8  # least cosine that counts: the root of rounding, that of two poles which rounding has split
_TOGETHER = 4.0  # times what they may be off: poles so near to each other are one group
_DIGITS = 60  # of the refinement; a group of k poles is then known to 60/k of them
_ON_AXIS = 50  # digits of a group of one, 50/k of one of k, to which a real part must be zero: some below _DIGITS
_ROUNDS = 40  # of a refinement: each gains digits, most of them ten and more
_ENTRIES = 8.0  # units of rounding of each entry given, up to which an answer is one of its last digits


@dataclass(frozen=True)
class AxisPoles:
    """What is known of the poles at the imaginary axis.

    Attributes
    ----------
    infinite : complex or None
        A pole that makes the response infinite: one that grows, or one on the axis that shows.  In discrete time its
        rate ``log(z)/dt``.
    doubtful : complex or None
        One of which the digits given do not tell; None if there is an infinite one.  A rate in discrete time.
    silent : (n,) ndarray of bool
        Which of ``poles`` lie on the axis and do not show.
    poles : (n,) complex ndarray
        All poles, as the eigenvalue solver gives them.
    """

    infinite: complex | None
    doubtful: complex | None
    silent: Array
    poles: Array


def poles_at_axis(system: Lti) -> AxisPoles:
    """Return what is known of the poles of a (balanced) system at the imaginary axis."""
    poles, left, right = system.eigensystem
    silent = np.zeros(len(poles), dtype=bool)
    cosine = np.abs(np.einsum("ij,ij->j", left.conj(), right))
    felt = np.einsum("ij,ij->j", np.abs(left), np.abs(system.A) @ np.abs(right))
    off = _MOVED * _EPS * felt / np.maximum(cosine, _PARALLEL)
    rates, beyond = system.rates, poles.real if system.dt == 0.0 else np.abs(poles) - 1.0
    if (beyond < -off).all():
        return AxisPoles(None, None, silent, poles)
    if (beyond > off).any():
        return AxisPoles(complex(rates[beyond > off][0]), None, silent, poles)
    doubtful = None
    for group in _groups(poles, off, (beyond >= -off) & (poles.imag >= 0.0)):
        found = _judged(system, poles, group)
        if found == "infinite":
            return AxisPoles(complex(0.0, abs(rates[group].imag).mean()), None, silent, poles)
        if found == "grows":
            return AxisPoles(complex(max(rates[group].real.max(), _EPS), 0.0), None, silent, poles)
        if found == "doubtful" and doubtful is None:
            doubtful = complex(rates[group].mean())
        elif found == "silent":
            silent[group] = True
            mirrored = np.abs(poles[:, None] - poles[group].conj()).argmin(axis=0)
            silent[mirrored] = True
    return AxisPoles(None, doubtful, silent, poles)


def _groups(poles: Array, off: Array, asked: Array) -> list[Array]:
    """Return groups of poles that lie together, the slowest first, each with at least one of those asked for."""
    near = np.abs(poles[:, None] - poles) <= _TOGETHER * (off[:, None] + off)
    left, found = asked.copy(), []
    for seed in np.argsort(np.abs(poles)):
        if not left[seed]:
            continue
        group, wider = np.zeros(len(poles), dtype=bool), near[seed]
        while (wider & ~group).any():
            group, wider = wider, near[wider].any(axis=0)
        found.append(np.flatnonzero(group))
        left &= ~group
    return found


def _judged(system: Lti, poles: Array, group: Array) -> str:
    """Return of a group of poles whether it "decays", "grows", is "infinite", "silent" or "doubtful"."""
    import mpmath as mp

    with mp.workdps(_DIGITS):
        ours = poles[group]
        right, left = _subspace(system.A, poles, ours), _subspace(system.A.T, poles, ours.conj())
        if right is None or left is None:
            return "doubtful"
        (V, P), (W, _) = right, left
        W = W.H
        try:
            W = mp.inverse(W * V) * W
        except ZeroDivisionError:
            return "doubtful"
        sizes = np.abs(_double(W)) @ np.abs(system.A) @ np.abs(_double(V))
        entries = (_ENTRIES * _EPS * float(np.linalg.norm(sizes))) ** (1.0 / len(group))
        exact = mp.eig(P, left=False, right=False) if len(group) > 1 else [P[0]]
        real = np.array([float(mp.re(p) if system.dt == 0.0 else mp.fabs(p) - 1) for p in exact])
        least = max(float(np.abs(system.A).max()), float(np.finfo(float).tiny)) * 10.0 ** (-_ON_AXIS / len(group))
        if (np.abs(real) > least).any():
            if (real < -entries).all():
                return "decays"
            return "grows" if (real > entries).any() else "doubtful"
        return _shown(system, V, P, W)


def _shown(system: Lti, V: Any, P: Any, W: Any) -> str:
    """Return whether poles on the axis show: ``C V (s - P)^-1 W B`` is not zero."""
    import mpmath as mp

    reads, acts = mp.matrix(system.C.tolist()) * V, W * mp.matrix(system.B.tolist())
    sizes = np.abs(system.C) @ np.abs(_double(V)), np.abs(_double(W)) @ np.abs(system.B)
    size_P, centre = np.abs(_double(P)), sum(P[i, i] for i in range(P.rows)) / P.rows
    shifted, silent = P - centre * mp.eye(P.rows), True
    for _ in range(P.rows):
        moment = np.abs(_double(reads * acts))
        full = sizes[0] @ sizes[1]
        if (moment > _ENTRIES * len(system.A) * _EPS * full).any():
            return "infinite"
        silent = silent and bool((moment <= 10.0**-_ON_AXIS * full).all())
        acts, sizes = shifted * acts, (sizes[0], size_P @ sizes[1])
    return "silent" if silent else "doubtful"


def _subspace(A: Array, poles: Array, ours: Array) -> "tuple[Any, Any] | None":
    """Return ``V`` and ``P`` with ``A V = V P`` in 60 digits, of the poles that lie nearest to ours; None without."""
    import mpmath as mp

    distance = np.abs(poles[:, None] - ours).min(axis=1)
    reach = np.sort(distance)[len(ours) - 1 : len(ours) + 1]
    limit = 0.5 * float(reach.sum()) if len(reach) > 1 else np.inf
    T, Z, count = linalg.schur(A, output="complex", sort=lambda p: bool(np.abs(p - ours).min() < limit))  # type: ignore[misc]
    if count != len(ours):
        return None
    k, n = count, len(A)
    places = [np.flatnonzero(row).tolist() for row in A]
    rows = [[mp.mpf(a) for a in row[there].tolist()] for row, there in zip(A, places, strict=True)]
    first, others = mp.matrix(Z[:, :k].tolist()), Z[:, k:]
    V, before = first.copy(), np.inf
    tiny = float(np.abs(A).max(initial=0.0)) * 10.0 ** (1 - _DIGITS)
    for _ in range(_ROUNDS):
        columns = [[V[i, j] for i in range(n)] for j in range(k)]
        products = [
            [mp.fdot(row, [column[i] for i in there]) for column in columns]
            for row, there in zip(rows, places, strict=True)
        ]
        AV = mp.matrix(products)
        P = mp.inverse(first.H * V) * (first.H * AV)
        residual = AV - V * P
        size = max(abs(residual[i, j]) for i in range(n) for j in range(k))
        if size <= n * tiny:
            return V, P
        if size > 0.1 * before:
            return None
        before = size
        scaled = _double(residual / size)
        with np.errstate(all="ignore"):
            X = others @ linalg.solve_sylvester(T[k:, k:], -T[:k, :k], -others.conj().T @ scaled)
        if not np.isfinite(X).all():
            return None
        V = V + mp.matrix(X.tolist()) * size
    return None


def _double(matrix: Any) -> Array:
    return np.array([[complex(matrix[i, j]) for j in range(matrix.cols)] for i in range(matrix.rows)])
