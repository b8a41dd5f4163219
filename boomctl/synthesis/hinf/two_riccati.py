"""The two Riccati equations of H-infinity synthesis.

They tell whether a level can be reached (Glover & Doyle 1988), where it cannot, why, and all controllers that reach it
(Zhou, Doyle & Glover, Robust and Optimal Control, 1996, theorem 17.1).
"""

import warnings
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import linalg

from boomctl.arrays import Array, blocks
from boomctl.lti.rounding import TINY
from boomctl.lti.system import Lti, lower_lft, static
from boomctl.synthesis.hinf.normal_form import NormalizedPlant
from boomctl.synthesis.plants.partition import GeneralizedPlant

_NEGATIVE = 1e-8  # share of the largest eigenvalue of X that rounding may have made negative: half of all digits
_EPS = 1e-14  # share of the largest entry of X by which rounding may have moved an eigenvalue: fifty units
_MARGIN = 10.0  # a solution is taken to be wrong by so many Newton steps: a choice, since one step only estimates it
_LOSES_LITTLE = 1e-3  # least singular value of I + D_K D22 over its largest: three digits are lost at most (a choice)
COUPLING = "control and estimation together do not reach it (rho(XY) >= gamma^2)"


@dataclass(frozen=True)
class _StateFeedback:
    """The equation ``F'X + X F - X G X + Q = 0`` of a level; estimation is state feedback of the dual plant.

    ``weight`` is ``(gamma^2 I - D'D)^-1``, with ``D`` the direct way from the disturbances to the performance signals that
    weigh no control; ``direct`` is that to those which do.  By ``entry`` the disturbances drive the states, and
    ``through`` is ``D'C``.
    """

    plant: GeneralizedPlant
    entry: Array
    weight: Array
    through: Array
    direct: Array
    F: Array
    G: Array
    Q: Array

    def gain(self, X: Array) -> Array:
        """Return the worst disturbance and the best control, as rows over the states."""
        C12 = self.plant.C1[self.plant.nz - self.plant.ncon :]
        worst = self.weight @ (self.through + self.entry.T @ X)
        return np.vstack([worst, -C12 - self.plant.B2.T @ X - self.direct @ worst])


def _state_feedback(plant: GeneralizedPlant, gamma: float) -> _StateFeedback:
    """Return the equation of a plant with ``D12 = [0; I]``.  An infinite level gives that of H2."""
    free, B2 = plant.nz - plant.ncon, plant.B2
    D, direct, C, C12 = plant.D11[:free], plant.D11[free:], plant.C1[:free], plant.C1[free:]
    identity = np.eye(plant.nw)
    weight = np.zeros_like(identity) if np.isinf(gamma) else np.linalg.inv(gamma**2 * identity - D.T @ D)
    entry = plant.B1 - B2 @ direct
    through = D.T @ C
    F = plant.A - B2 @ C12 + entry @ weight @ through
    G = B2 @ B2.T - entry @ weight @ entry.T
    return _StateFeedback(
        plant=plant,
        entry=entry,
        weight=weight,
        through=through,
        direct=direct,
        F=F,
        G=G,
        Q=C.T @ C + through.T @ weight @ through,
    )


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
    ready : NormalizedPlant
        What the equations are of.
    X, Y : (n, n) ndarray or None
        Stabilizing solutions, as far as they were computed.
    """

    gamma: float
    reason: str
    radius: float
    ready: NormalizedPlant
    X: Array | None = None
    Y: Array | None = None

    @cached_property
    def bound(self) -> float:
        """A level that no controller beats, as far as this one tells; zero where rounding could have made it.

        The error of a solution is taken from one Newton step.  As the level falls, X and Y grow: the radius at a level
        that is reached bounds the lowest one, and so does a level at which a solution is indefinite.
        """
        errors = [0.0, 0.0]
        for k, (X, plant) in enumerate(((self.X, self.ready), (self.Y, self.ready.dual))):
            if X is None:
                continue
            errors[k] = _MARGIN * _error(_state_feedback(plant, self.gamma), X)
            if (
                np.isfinite(self.gamma)
                and len(X)
                and np.linalg.eigvalsh(X)[0] < -max(errors[k], _EPS * np.abs(X).max())
            ):
                return self.gamma
        if self.X is None or self.Y is None or not np.isfinite(self.radius):
            return 0.0
        sizes = [np.linalg.norm(X, 2) if len(X) else 0.0 for X in (self.X, self.Y)]
        lost = errors[0] * sizes[1] + errors[1] * sizes[0] + errors[0] * errors[1]
        radius = float(np.sqrt(max(self.radius**2 - lost, 0.0)))
        return min(radius, self.gamma)


def level_of(ready: NormalizedPlant, gamma: float) -> Level:
    """Return what the two Riccati equations say of a level; ``inf`` gives those of H2."""
    X = _stabilizing(_state_feedback(ready, gamma))
    if X is None:
        return Level(gamma, "with all states known no controller reaches it (no stabilizing X)", np.nan, ready)
    if _indefinite(X):
        return Level(gamma, "with all states known no controller reaches it (X is indefinite)", np.nan, ready, X=X)
    Y = _stabilizing(_state_feedback(ready.dual, gamma))
    if Y is None:
        reason = "with all states driven at will no controller reaches it (no stabilizing Y)"
        return Level(gamma, reason, np.nan, ready)
    if _indefinite(Y):
        reason = "with all states driven at will no controller reaches it (Y is indefinite)"
        return Level(gamma, reason, np.nan, ready, Y=Y)
    values = np.linalg.eigvals(X @ Y).real if len(X) else np.zeros(1)
    radius = float(np.sqrt(max(values.max(), 0.0)))
    return Level(gamma, COUPLING if radius >= gamma else "", radius, ready, X=X, Y=Y)


def _indefinite(X: Array) -> bool:
    if not len(X):
        return False
    values = np.linalg.eigvalsh(X)
    return bool(values[0] < -_NEGATIVE * max(abs(values[-1]), abs(values[0]), TINY))


def _stabilizing(equation: _StateFeedback) -> Array | None:
    """Return the stabilizing solution from the stable subspace of the Hamiltonian matrix; None if there is none."""
    n = len(equation.F)
    if n == 0:
        return np.zeros((0, 0))
    size_g, size_q = np.linalg.norm(equation.G), np.linalg.norm(equation.Q)
    scale = np.sqrt(size_q / size_g) if size_g > 0.0 and size_q > 0.0 else 1.0
    hamiltonian = blocks([[equation.F, -equation.G * scale], [-equation.Q / scale, -equation.F.T]])
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


def _error(equation: _StateFeedback, X: Array) -> float:
    """Return the size of the Newton step from a solution; infinite if it does not stabilize."""
    if not len(X):
        return 0.0
    closed = equation.F - equation.G @ X
    residual = equation.F.T @ X + X @ equation.F - X @ equation.G @ X + equation.Q
    if np.linalg.eigvals(closed).real.max() >= 0.0:
        return np.inf
    try:
        with warnings.catch_warnings():
            # next to the axis SciPy moves an eigenvalue by its rounding: the step is as long as ever
            warnings.simplefilter("ignore", RuntimeWarning)
            step = linalg.solve_continuous_lyapunov(closed.T, -residual)
    except np.linalg.LinAlgError:
        return np.inf
    return float(np.linalg.norm(step, 2)) if np.isfinite(step).all() else np.inf


def gains(ready: NormalizedPlant, level: Level) -> tuple[Array, Array]:
    """Return the state feedback and the output injection of a level's Riccati solutions.

    Raises
    ------
    ValueError
        The level has no such solutions.
    """
    if level.X is None or level.Y is None:
        raise ValueError(f"gamma = {level.gamma:g}: {level.reason}")
    F = _state_feedback(ready, level.gamma).gain(level.X)
    return F, _state_feedback(ready.dual, level.gamma).gain(level.Y).T


def suboptimal_controller(ready: NormalizedPlant, level: Level, D22: Array) -> Lti:
    """Return a controller of a level in normalized signals: the central one, where its loop is well-posed.

    Otherwise it is the one, of three, with which ``I + D_K D22`` is farthest from singular.

    Raises
    ------
    ValueError
        The level has no Riccati solutions.
    """
    family = _all_controllers(ready, level)

    def well_posedness(K: Lti) -> float:
        values = linalg.svdvals(np.eye(len(K.D)) + K.D @ D22)
        return float(values[-1] / max(1.0, values[0]))

    central = lower_lft(family.system, static(np.zeros((family.ncon, family.nmeas))))
    if well_posedness(central) >= _LOSES_LITTLE:
        return central
    left, _, right = linalg.svd(family.D21 @ D22 @ family.D12, full_matrices=False)
    aligned = 0.5 * level.gamma * (left @ right).T
    return max(central, *(lower_lft(family.system, static(Q)) for Q in (aligned, -aligned)), key=well_posedness)


def _all_controllers(ready: NormalizedPlant, level: Level) -> GeneralizedPlant:
    """Return all controllers of a level, from its Riccati solutions.

    Closed by ``q = Q p`` with any stable ``Q`` smaller than the level, what comes back is a controller of the level,
    ``u = K y``: its first input is ``y``, its first output ``u``.

    Raises
    ------
    ValueError
        The level has no Riccati solutions.
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
    X, Y = np.asarray(level.X), np.asarray(level.Y)
    coupling = np.linalg.inv(np.eye(len(X)) - Y @ X / g2)
    B2 = coupling @ (ready.B2 + L12) @ E12
    C2 = -E21 @ (ready.C2 + F12)
    B1 = -coupling @ L2 + B2 @ np.linalg.solve(E12, E11)
    inner = np.linalg.solve(E21, C2)
    A = ready.A + ready.system.B @ F + B1 @ inner
    through = blocks([[E11, E12], [E21, np.zeros((len(E21), len(E12)))]])
    family = Lti(A, np.hstack([B1, B2]), np.vstack([F2 + E11 @ inner, C2]), through)
    return GeneralizedPlant(family, nmeas=ready.nmeas, ncon=ready.ncon)
