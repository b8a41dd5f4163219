"""The two Riccati equations of H-infinity synthesis (Glover & Doyle 1988), solved apart from any native solver.

They tell whether a level can be reached, and where it cannot, why; with them goes the central controller.
"""

from dataclasses import dataclass

import numpy as np
from scipy import linalg

from boomctl.analysis.norm import StateMatrices
from boomctl.arrays import Array
from boomctl.synthesis.partition import Normalised

__all__ = ["Level", "central_controller", "gains", "level_of"]

_NEGATIVE = 1e-8
_CLEARLY = 1e-6
_RESIDUAL = 1e-6


@dataclass(frozen=True)
class Level:
    """What the Riccati equations say of one level.

    Attributes
    ----------
    gamma : float
    reason : str
        Empty where the level can be reached; otherwise what fails.
    clear : bool
        Whether a failure was confirmed by residuals; a level that fails unclearly bounds nothing.
    radius : float
        Square root of the spectral radius of ``X Y``; nan where one of them does not exist.
    X, Y : (n, n) ndarray or None
        Stabilising solutions.
    """

    gamma: float
    reason: str
    clear: bool
    radius: float
    X: Array | None = None
    Y: Array | None = None


def level_of(ready: Normalised, gamma: float) -> Level:
    """Return what the two Riccati equations say of a level; ``inf`` gives those of H2."""
    X, rest = _riccati(*_control_data(ready), gamma)
    if X is None:
        return Level(gamma, "with all states known no controller reaches it (no stabilising X)", False, np.nan)
    sign = _negative(X)
    if sign:
        clear = rest <= _RESIDUAL and sign > _CLEARLY
        return Level(gamma, "with all states known no controller reaches it (X is indefinite)", clear, np.nan)
    Y, other = _riccati(*_filter_data(ready), gamma)
    if Y is None:
        return Level(gamma, "with all states driven at will no controller reaches it (no stabilising Y)", False, np.nan)
    sign = _negative(Y)
    if sign:
        clear = other <= _RESIDUAL and sign > _CLEARLY
        return Level(gamma, "with all states driven at will no controller reaches it (Y is indefinite)", clear, np.nan)
    values = linalg.eigvals(X @ Y).real if len(X) else np.zeros(1)
    radius = float(np.sqrt(max(values.max(), 0.0)))
    if radius >= gamma:
        clear = max(rest, other) <= _RESIDUAL and radius >= gamma * (1.0 + _CLEARLY)
        return Level(gamma, "control and estimation together do not reach it (rho(XY) >= gamma^2)", clear, radius, X, Y)
    return Level(gamma, "", max(rest, other) <= _RESIDUAL, radius, X, Y)


def _negative(X: Array) -> float:
    """Return how far below zero the least eigenvalue lies, relative to the largest; zero if that is rounding."""
    if not len(X):
        return 0.0
    values = linalg.eigvalsh(X)
    share = -values[0] / max(abs(values[-1]), abs(values[0]), np.finfo(float).tiny)
    return float(share) if share > _NEGATIVE else 0.0


_Data = tuple[Array, Array, Array, Array, int]


def _control_data(ready: Normalised) -> _Data:
    D = np.hstack([ready.D11, ready.D12])
    return ready.A, np.hstack([ready.B1, ready.B2]), ready.C1, D, ready.B1.shape[1]


def _filter_data(ready: Normalised) -> _Data:
    D = np.hstack([ready.D11.T, ready.D21.T])
    return ready.A.T, np.hstack([ready.C1.T, ready.C2.T]), ready.B1.T, D, len(ready.C1)


def _weight(D: Array, free: int, gamma: float) -> Array:
    """Return the inverse of ``D'D - gamma^2 [I 0; 0 0]``; at an infinite level only the rest of it is inverted."""
    gram = D.T @ D
    if np.isinf(gamma):
        inverse = np.zeros_like(gram)
        inverse[free:, free:] = linalg.inv(gram[free:, free:])
        return inverse
    gram[:free, :free] -= gamma**2 * np.eye(free)
    return linalg.inv(gram)


def _riccati(A: Array, B: Array, C: Array, D: Array, free: int, gamma: float) -> tuple[Array | None, float]:
    """Return the stabilising solution of a Riccati equation and its relative residual; None if there is none."""
    n = len(A)
    if n == 0:
        return np.zeros((0, 0)), 0.0
    inverse = _weight(D, free, gamma)
    F = A - B @ inverse @ D.T @ C
    G, Q = B @ inverse @ B.T, C.T @ C - C.T @ D @ inverse @ D.T @ C
    size_g, size_q = np.linalg.norm(G), np.linalg.norm(Q)
    scale = np.sqrt(size_q / size_g) if size_g > 0.0 and size_q > 0.0 else 1.0
    hamiltonian = np.block([[F, -G * scale], [-Q / scale, -F.T]])
    try:
        _, Z, count = linalg.schur(hamiltonian, sort="lhp")
        if count != n:
            return None, np.inf
        X = linalg.solve(Z[:n, :n].T, Z[n:, :n].T).T * scale
    except linalg.LinAlgError:
        return None, np.inf
    X = 0.5 * (X + X.T)
    terms = (F.T @ X, X @ F, X @ G @ X, Q)
    size = sum(float(np.linalg.norm(term)) for term in terms)
    rest = float(np.linalg.norm(terms[0] + terms[1] - terms[2] + terms[3]))
    return X, rest / max(size, np.finfo(float).tiny)


def gains(ready: Normalised, level: Level) -> tuple[Array, Array]:
    """Return the state feedback and the output injection of a level's Riccati solutions.

    Raises
    ------
    ValueError
        The level has no such solutions.
    """
    if level.X is None or level.Y is None:
        raise ValueError(f"gamma = {level.gamma:g}: {level.reason}")
    _, B, C, D, free = _control_data(ready)
    F = -_weight(D, free, level.gamma) @ (D.T @ C + B.T @ level.X)
    _, B, C, D, free = _filter_data(ready)
    L = -(_weight(D, free, level.gamma) @ (D.T @ C + B.T @ level.Y)).T
    return F, L


def central_controller(ready: Normalised, level: Level) -> StateMatrices:
    """Return the central controller of a level that can be reached, in normalised signals.

    Source: Zhou, Doyle & Glover, Robust and Optimal Control (1996), theorem 17.1.
    """
    g, n, m1, p1 = level.gamma, len(ready.A), ready.B1.shape[1], len(ready.C1)
    m2, p2 = ready.B2.shape[1], len(ready.C2)
    F, L = gains(ready, level)
    assert level.X is not None
    assert level.Y is not None
    F12, F2, L12, L2 = F[m1 - p2 : m1], F[m1:], L[:, p1 - m2 : p1], L[:, p1:]
    D = ready.D11
    D11, D12, D21, D22 = (
        D[: p1 - m2, : m1 - p2],
        D[: p1 - m2, m1 - p2 :],
        D[p1 - m2 :, : m1 - p2],
        D[p1 - m2 :, m1 - p2 :],
    )
    tall = linalg.inv(g**2 * np.eye(p1 - m2) - D11 @ D11.T) if p1 > m2 else np.zeros((0, 0))
    wide = linalg.inv(g**2 * np.eye(m1 - p2) - D11.T @ D11) if m1 > p2 else np.zeros((0, 0))
    E11 = -D21 @ D11.T @ tall @ D12 - D22
    E12 = linalg.cholesky(np.eye(m2) - D21 @ wide @ D21.T, lower=True)
    E21 = linalg.cholesky(np.eye(p2) - D12.T @ tall @ D12)
    coupling = linalg.inv(np.eye(n) - level.Y @ level.X / g**2)
    B2 = coupling @ (ready.B2 + L12) @ E12
    C2 = -E21 @ (ready.C2 + F12)
    B1 = -coupling @ L2 + B2 @ linalg.solve(E12, E11)
    C1 = F2 + E11 @ linalg.solve(E21, C2)
    A = ready.A + np.hstack([ready.B1, ready.B2]) @ F + B1 @ linalg.solve(E21, C2)
    return StateMatrices(A, B1, C1, E11)
