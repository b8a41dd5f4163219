"""The two Riccati equations of H-infinity synthesis at a level (Glover & Doyle 1988).

They show whether a controller reaches the level, and parametrize all controllers that do (Zhou, Doyle & Glover, Robust
and Optimal Control, 1996, theorem 17.1).
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy import linalg

from boomctl.arrays import Array, blocks
from boomctl.lti.rounding import TINY
from boomctl.lti.system import Lti, lower_lft, static
from boomctl.synthesis.hinf.normal_form import NormalizedPlant
from boomctl.synthesis.plants.partition import GeneralizedPlant

_INDEFINITE_RTOL = 1e-8  # A negative eigenvalue of X below this fraction of the largest one is rounding error.
# Least ratio of the singular values of I + D_K D22. The loop of the central controller loses three digits below it.
_MIN_WELL_POSEDNESS = 1e-3
COUPLING = "state feedback and estimation together do not reach it (rho(XY) >= gamma^2)"


def _disturbance_terms(plant: GeneralizedPlant, gamma: float) -> tuple[Array, Array, Array]:
    """Return ``W, E, S`` of the worst disturbance ``w = W (S + E' X) x`` of a plant with ``D12 = [0; I]`` at a level."""
    free = plant.nz - plant.ncon
    D, identity = plant.D11[:free], np.eye(plant.nw)
    weight = np.zeros_like(identity) if np.isinf(gamma) else np.linalg.inv(gamma**2 * identity - D.T @ D)
    return weight, plant.B1 - plant.B2 @ plant.D11[free:], D.T @ plant.C1[:free]


def _riccati_equation(plant: GeneralizedPlant, gamma: float) -> tuple[Array, Array, Array]:
    """Return ``F, G, Q`` of the state-feedback equation ``F'X + X F - X G X + Q = 0``; an infinite level gives that of H2."""
    free, B2 = plant.nz - plant.ncon, plant.B2
    C, C12 = plant.C1[:free], plant.C1[free:]
    weight, entry, through = _disturbance_terms(plant, gamma)
    weighted = weight @ through
    return plant.A - B2 @ C12 + entry @ weighted, B2 @ B2.T - entry @ weight @ entry.T, C.T @ C + through.T @ weighted


def _gain(plant: GeneralizedPlant, gamma: float, X: Array) -> Array:
    """Return the gain of the worst disturbance and the best control over the states, in this order."""
    free = plant.nz - plant.ncon
    weight, entry, through = _disturbance_terms(plant, gamma)
    worst = weight @ (through + entry.T @ X)
    return np.vstack([worst, -plant.C1[free:] - plant.B2.T @ X - plant.D11[free:] @ worst])


@dataclass(frozen=True)
class Level:
    """Solutions of the Riccati equations at one level.

    Attributes
    ----------
    gamma : float
    reason : str
        Empty if the level is reached, otherwise the case that fails.
    radius : float
        Square root of the spectral radius of ``X Y``; NaN if a solution does not exist or is indefinite.
    lower_bound : float
        Norm that no controller goes below, by this level: the radius grows as the level falls.
    X, Y : (n, n) ndarray or None
        Stabilizing solutions, None if they were not both computed.
    """

    gamma: float
    reason: str
    radius: float = np.nan
    lower_bound: float = 0.0
    X: Any = None
    Y: Any = None


def level_of(ready: NormalizedPlant, gamma: float) -> Level:
    """Solve the two Riccati equations at a level; ``inf`` gives those of H2."""
    solutions = []
    for plant, name, case in ((ready, "X", "with all states measured"), (ready.dual, "Y", "with all states actuated")):
        solution = _stabilizing(*_riccati_equation(plant, gamma))
        if solution is None:
            return Level(gamma, f"{case}, no controller reaches it (no stabilizing {name})")
        values = np.linalg.eigvalsh(solution) if len(solution) else np.zeros(1)
        if values[0] < -_INDEFINITE_RTOL * max(np.abs(values[[0, -1]]).max(), TINY):
            reason = f"{case}, no controller reaches it ({name} is indefinite)"
            return Level(gamma, reason, lower_bound=gamma if np.isfinite(gamma) else 0.0)
        solutions.append(solution)
    X, Y = solutions
    values = np.linalg.eigvals(X @ Y).real if len(X) else np.zeros(1)
    radius = float(np.sqrt(max(values.max(), 0.0)))
    return Level(gamma, COUPLING if radius >= gamma else "", radius, min(radius, gamma), X, Y)


def _stabilizing(F: Array, G: Array, Q: Array) -> Array | None:
    """Return the stabilizing solution from the stable subspace of the Hamiltonian matrix; None if there is none."""
    n = len(F)
    if n == 0:
        return np.zeros((0, 0))
    norm_g, norm_q = np.linalg.norm(G), np.linalg.norm(Q)
    scale = np.sqrt(norm_q / norm_g) if norm_g > 0.0 and norm_q > 0.0 else 1.0
    hamiltonian = blocks([[F, -G * scale], [-Q / scale, -F.T]])
    if not np.isfinite(hamiltonian).all():
        return None
    try:
        _, Z, count = linalg.schur(hamiltonian, sort="lhp")
        X = np.linalg.solve(Z[:n, :n].T, Z[n:, :n].T).T * scale
    except np.linalg.LinAlgError:
        return None
    return 0.5 * (X + X.T) if count == n and np.isfinite(X).all() else None


def gains(ready: NormalizedPlant, level: Level) -> tuple[Array, Array]:
    """Return the state feedback and the output injection of a level that has Riccati solutions."""
    return _gain(ready, level.gamma, level.X), _gain(ready.dual, level.gamma, level.Y).T


def suboptimal_controller(ready: NormalizedPlant, level: Level, D22: Array) -> Lti:
    """Return the central controller of a level that is reached, in normalized signals, if its loop is well-posed.

    Otherwise return that one of three controllers for which ``I + D_K D22`` is best conditioned.
    """
    family = _all_controllers(ready, level)

    def well_posedness(K: Lti) -> float:
        values = linalg.svdvals(np.eye(len(K.D)) + K.D @ D22)
        return float(values[-1] / max(1.0, values[0]))

    central = lower_lft(family.system, static(np.zeros((family.ncon, family.nmeas))))
    if not D22.any() or well_posedness(central) >= _MIN_WELL_POSEDNESS:
        return central
    left, _, right = linalg.svd(family.D21 @ D22 @ family.D12, full_matrices=False)
    aligned = 0.5 * level.gamma * (left @ right).T
    return max(central, *(lower_lft(family.system, static(Q)) for Q in (aligned, -aligned)), key=well_posedness)


def _all_controllers(ready: NormalizedPlant, level: Level) -> GeneralizedPlant:
    """Return the parametrization of all controllers of a level.

    Closed by any stable ``Q`` with a norm below the level it is a controller ``u = K y``: its first input is ``y``, its
    first output ``u``.
    """
    F, L = gains(ready, level)
    m1, p1 = ready.nw, ready.nz
    m, p, g2 = m1 - ready.nmeas, p1 - ready.ncon, level.gamma**2
    F12, F2, L12, L2 = F[m:m1], F[m1:], L[:, p:p1], L[:, p1:]
    D = ready.D11
    D11, D12, D21, D22 = D[:p, :m], D[:p, m:], D[p:, :m], D[p:, m:]
    tall = np.linalg.inv(g2 * np.eye(p) - D11 @ D11.T)
    wide = np.linalg.inv(g2 * np.eye(m) - D11.T @ D11)
    E11 = -D21 @ D11.T @ tall @ D12 - D22
    E12 = linalg.cholesky(np.eye(len(D22)) - D21 @ wide @ D21.T, lower=True)
    E21 = linalg.cholesky(np.eye(D22.shape[1]) - D12.T @ tall @ D12)
    coupling = np.linalg.inv(np.eye(len(level.X)) - level.Y @ level.X / g2)
    B2 = coupling @ (ready.B2 + L12) @ E12
    C2 = -E21 @ (ready.C2 + F12)
    B1 = -coupling @ L2 + B2 @ np.linalg.solve(E12, E11)
    inner = np.linalg.solve(E21, C2)
    A = ready.A + ready.system.B @ F + B1 @ inner
    through = blocks([[E11, E12], [E21, np.zeros((len(E21), len(E12)))]])
    family = Lti(A, np.hstack([B1, B2]), np.vstack([F2 + E11 @ inner, C2]), through)
    return GeneralizedPlant(family, nmeas=ready.nmeas, ncon=ready.ncon)
