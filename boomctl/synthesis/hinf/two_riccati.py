"""The two Riccati equations of H-infinity synthesis (Glover & Doyle 1988), solved apart from any native solver.

They tell whether a level can be reached, and where it cannot, why.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import linalg

from boomctl.arrays import Array
from boomctl.synthesis.plants.partition import Normalised

_NEGATIVE = 1e-8
_MARGIN = 10.0
COUPLING = "control and estimation together do not reach it (rho(XY) >= gamma^2)"


@dataclass(frozen=True)
class _Side:
    """One equation, ``F'X + X F - X G X + Q = 0``, of state feedback; estimation is the same of the transposed plant.

    ``weight`` is ``(gamma^2 I - D'D)^-1`` with ``D`` what the performance signals beyond the controls take directly.
    """

    B1: Array
    B2: Array
    direct: Array
    weight: Array
    through: Array
    F: Array
    G: Array
    Q: Array

    def residual(self, X: Array) -> Array:
        """Return what remains of the equation."""
        return self.F.T @ X + X @ self.F - X @ self.G @ X + self.Q

    def gain(self, X: Array, C12: Array) -> Array:
        """Return the worst disturbance and the best control, as rows over the states."""
        worst = self.weight @ (self.through + self.B1.T @ X)
        return np.vstack([worst, -C12 - self.B2.T @ X - self.direct @ worst])


def _side(A: Array, B1: Array, B2: Array, C1: Array, D11: Array, gamma: float) -> _Side:
    """Return the equation's data; ``D12`` is ``[0; I]``.  An infinite level gives those of H2."""
    free = len(C1) - B2.shape[1]
    D, direct, C, C12 = D11[:free], D11[free:], C1[:free], C1[free:]
    size = B1.shape[1]
    weight = np.zeros((size, size)) if np.isinf(gamma) else np.linalg.inv(gamma**2 * np.eye(size) - D.T @ D)
    entry = B1 - B2 @ direct
    through = D.T @ C
    F = A - B2 @ C12 + entry @ weight @ through
    G = B2 @ B2.T - entry @ weight @ entry.T
    return _Side(entry, B2, direct, weight, through, F, G, C.T @ C + through.T @ weight @ through)


def _control_side(ready: Normalised, gamma: float) -> _Side:
    return _side(ready.A, ready.B1, ready.B2, ready.C1, ready.D11, gamma)


def _filter_side(ready: Normalised, gamma: float) -> _Side:
    return _side(ready.A.T, ready.C1.T, ready.C2.T, ready.B1.T, ready.D11.T, gamma)


@dataclass(frozen=True)
class Level:
    """What the Riccati equations say of one level.

    Attributes
    ----------
    gamma : float
    reason : str
        Empty where the level can be reached; otherwise what fails.
    radius : float
        Square root of the spectral radius of ``X Y``; nan where one of them does not exist or is indefinite.
    X, Y : (n, n) ndarray or None
        Stabilising solutions, as far as they were computed.
    """

    gamma: float
    reason: str
    radius: float
    ready: Normalised
    X: Array | None = None
    Y: Array | None = None

    @cached_property
    def bound(self) -> float:
        """A level that no controller beats, as far as this one tells; zero where rounding could have made it.

        The error of a solution is taken from one Newton step.  As the level falls, X and Y grow: the radius at a level
        that is reached bounds the lowest one, and so does a level at which a solution is indefinite.
        """
        errors = [0.0, 0.0]
        for k, (X, side) in enumerate(((self.X, _control_side), (self.Y, _filter_side))):
            if X is None:
                continue
            errors[k] = _MARGIN * _error(side(self.ready, self.gamma), X)
            if np.isfinite(self.gamma) and len(X) and linalg.eigvalsh(X)[0] < -max(errors[k], 1e-14 * np.abs(X).max()):
                return self.gamma
        if self.X is None or self.Y is None or not np.isfinite(self.radius):
            return 0.0
        sizes = [np.linalg.norm(X, 2) if len(X) else 0.0 for X in (self.X, self.Y)]
        lost = errors[0] * sizes[1] + errors[1] * sizes[0] + errors[0] * errors[1]
        radius = float(np.sqrt(max(self.radius**2 - lost, 0.0)))
        return min(radius, self.gamma)


def level_of(ready: Normalised, gamma: float) -> Level:
    """Return what the two Riccati equations say of a level; ``inf`` gives those of H2."""
    X = _stabilising(_control_side(ready, gamma))
    if X is None:
        return Level(gamma, "with all states known no controller reaches it (no stabilising X)", np.nan, ready)
    if _indefinite(X):
        return Level(gamma, "with all states known no controller reaches it (X is indefinite)", np.nan, ready, X)
    Y = _stabilising(_filter_side(ready, gamma))
    if Y is None:
        reason = "with all states driven at will no controller reaches it (no stabilising Y)"
        return Level(gamma, reason, np.nan, ready)
    if _indefinite(Y):
        reason = "with all states driven at will no controller reaches it (Y is indefinite)"
        return Level(gamma, reason, np.nan, ready, None, Y)
    values = linalg.eigvals(X @ Y).real if len(X) else np.zeros(1)
    radius = float(np.sqrt(max(values.max(), 0.0)))
    return Level(gamma, COUPLING if radius >= gamma else "", radius, ready, X, Y)


def _indefinite(X: Array) -> bool:
    if not len(X):
        return False
    values = linalg.eigvalsh(X)
    return bool(values[0] < -_NEGATIVE * max(abs(values[-1]), abs(values[0]), np.finfo(float).tiny))


def _stabilising(side: _Side) -> Array | None:
    """Return the stabilising solution from the stable subspace of the Hamiltonian matrix; None if there is none."""
    n = len(side.F)
    if n == 0:
        return np.zeros((0, 0))
    size_g, size_q = np.linalg.norm(side.G), np.linalg.norm(side.Q)
    scale = np.sqrt(size_q / size_g) if size_g > 0.0 and size_q > 0.0 else 1.0
    hamiltonian = np.block([[side.F, -side.G * scale], [-side.Q / scale, -side.F.T]])
    if not np.isfinite(hamiltonian).all():
        return None
    try:
        _, Z, count = linalg.schur(hamiltonian, sort="lhp")
        if count != n:
            return None
        X = np.linalg.solve(Z[:n, :n].T, Z[n:, :n].T).T * scale
    except np.linalg.LinAlgError:
        return None
    return 0.5 * (X + X.T) if np.isfinite(X).all() else None


def _error(side: _Side, X: Array) -> float:
    """Return the size of the Newton step from a solution; infinite if it does not stabilise."""
    closed = side.F - side.G @ X
    if not len(X):
        return 0.0
    if linalg.eigvals(closed).real.max() >= 0.0:
        return np.inf
    try:
        step = linalg.solve_continuous_lyapunov(closed.T, -side.residual(X))
    except np.linalg.LinAlgError:
        return np.inf
    return float(np.linalg.norm(step, 2)) if np.isfinite(step).all() else np.inf


def gains(ready: Normalised, level: Level) -> tuple[Array, Array]:
    """Return the state feedback and the output injection of a level's Riccati solutions.

    Raises
    ------
    ValueError
        The level has no such solutions.
    """
    if level.X is None or level.Y is None:
        raise ValueError(f"gamma = {level.gamma:g}: {level.reason}")
    F = _control_side(ready, level.gamma).gain(level.X, ready.C1[len(ready.C1) - ready.B2.shape[1] :])
    L = _filter_side(ready, level.gamma).gain(level.Y, ready.B1[:, ready.B1.shape[1] - len(ready.C2) :].T).T
    return F, L
