"""All controllers of a level that can be reached, from its two Riccati solutions.

Source: Zhou, Doyle & Glover, Robust and Optimal Control (1996), theorem 17.1.
"""

from dataclasses import dataclass

import numpy as np
from scipy import linalg

from boomctl.arrays import Array
from boomctl.lti.system import Lti
from boomctl.synthesis.hinf.two_riccati import Level, gains
from boomctl.synthesis.plants.partition import Normalised


@dataclass(frozen=True)
class Controllers:
    """A family of controllers in normalised signals: one for each stable system smaller than the level.

    ``x' = A x + B1 y + B2 q``, ``u = C1 x + D11 y + D12 q``, ``p = C2 x + D21 y``, closed by ``q = Q p``.
    """

    gamma: float
    A: Array
    B1: Array
    B2: Array
    C1: Array
    C2: Array
    D11: Array
    D12: Array
    D21: Array

    def member(self, Q: Array | None = None) -> Lti:
        """Return the controller of a constant ``Q`` whose norm is below the level; None stands for zero, the central one."""
        if Q is None:
            return Lti(self.A, self.B1, self.C1, self.D11)
        B, D = self.B2 @ Q, self.D12 @ Q
        return Lti(self.A + B @ self.C2, self.B1 + B @ self.D21, self.C1 + D @ self.C2, self.D11 + D @ self.D21)

    def posed_for(self, D22: Array) -> Lti:
        """Return the member, of three, with which ``I + D_K D22`` is farthest from singular, in normalised signals."""
        left, _, right = linalg.svd(self.D21 @ D22 @ self.D12, full_matrices=False)
        aligned = 0.5 * self.gamma * (left @ right).T
        members = [self.member(), self.member(aligned), self.member(-aligned)]
        return max(members, key=lambda K: _farness(np.eye(len(K.D)) + K.D @ D22))


def _farness(matrix: Array) -> float:
    values = linalg.svdvals(matrix)
    return float(values[-1] / max(1.0, values[0]))


def controllers_of(ready: Normalised, level: Level) -> Controllers:
    """Return all controllers of a level.

    Raises
    ------
    ValueError
        The level has no Riccati solutions.
    """
    F, L = gains(ready, level)
    m1, p1 = ready.B1.shape[1], len(ready.C1)
    m, p, g2 = m1 - len(ready.C2), p1 - ready.B2.shape[1], level.gamma**2
    F12, F2, L12, L2 = F[m:m1], F[m1:], L[:, p:p1], L[:, p1:]
    D = ready.D11
    D11, D12, D21, D22 = D[:p, :m], D[:p, m:], D[p:, :m], D[p:, m:]
    tall = np.linalg.inv(g2 * np.eye(p) - D11 @ D11.T)
    wide = np.linalg.inv(g2 * np.eye(m) - D11.T @ D11)
    E11 = -D21 @ D11.T @ tall @ D12 - D22
    E12 = linalg.cholesky(np.eye(len(D22)) - D21 @ wide @ D21.T, lower=True)
    E21 = linalg.cholesky(np.eye(D22.shape[1]) - D12.T @ tall @ D12)
    X, Y = np.asarray(level.X), np.asarray(level.Y)
    coupling = np.linalg.inv(np.eye(len(X)) - Y @ X / g2)
    B2 = coupling @ (ready.B2 + L12) @ E12
    C2 = -E21 @ (ready.C2 + F12)
    B1 = -coupling @ L2 + B2 @ np.linalg.solve(E12, E11)
    inner = np.linalg.solve(E21, C2)
    A = ready.A + np.hstack([ready.B1, ready.B2]) @ F + B1 @ inner
    return Controllers(level.gamma, A, B1, B2, F2 + E11 @ inner, C2, E11, E12, E21)
