"""The two Riccati equations of H-infinity synthesis, the lowest level reached, and lower bounds for all controllers.

The equations show whether a controller reaches a level, and parametrize all controllers that do (Glover & Doyle 1988; Zhou,
Doyle & Glover, Robust and Optimal Control, 1996, theorem 17.1).

At one frequency the closed loop of any controller is ``P11 + P12 Q P21`` with some matrix ``Q``. The least norm over all
matrices is the larger of ``P11`` without the range of ``P12`` and ``P11`` without that of ``P21'`` (Parrott 1978; Davis,
Kahan & Weinberger 1982). State feedback changes neither, and the H2-optimal one makes the range of ``P12`` orthonormal
(Zhou, Doyle & Glover 1996, theorem 13.34), so that the bound is accurate for undamped modes too.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy import linalg

from boomctl.arrays import Array, blocks
from boomctl.exceptions import SynthesisError
from boomctl.lti.frequency import SEARCHED, confirmed_peak, highest_peak, resonance_grid, singular_values
from boomctl.lti.modal import partial_fractions
from boomctl.lti.rounding import ALIKE, LEVEL, TINY
from boomctl.lti.system import Lti, lower_lft, static
from boomctl.printing import compact
from boomctl.progress import Deadline
from boomctl.synthesis.lq.riccati import even, schur_solution
from boomctl.synthesis.plants.partition import GeneralizedPlant, NormalizedPlant, with_feedthrough

FIRST_LEVEL = 0.95  # Excess of the first level over the lower bound, relative to rtol. The rest is for rounding errors.
_SEARCH_RTOL = 0.25  # Accuracy of the lowest level, relative to rtol.
_SECANT_MARGIN = 0.5  # Excess of a level over the secant, relative to rtol and slope, so that it is reached.
_FIRST_GROWTH, _MAX_GROWTH = 1.1, 1e10  # Growth of the first levels, squared with each one that is not reached.
_MAX_LEVELS = 80  # Every fourth one halves the interval; 20 halvings reduce a ratio of 1e9 to 1 + 2e-5.
_COUPLED_RTOL = 1e-3  # Excess of the next level over the radius of one that only the coupling excludes.
_INDEFINITE_RTOL = 1e-8  # A negative eigenvalue of X below this fraction of the largest one is rounding error.
_ZERO_LEVEL = 1e-8  # A level below this fraction of the gain of the plant is zero.
# Least ratio of the singular values of I + D_K D22. The loop of the central controller loses three digits below it.
_MIN_WELL_POSEDNESS = 1e-3
_COUPLING = "state feedback and estimation together do not reach it (rho(XY) >= gamma^2)"


def _disturbance_terms(plant: GeneralizedPlant, gamma: float) -> tuple[Array, Array, Array]:
    """Return ``W, E, S`` of the worst disturbance ``w = W (S + E' X) x`` of a plant with ``D12 = [0; I]`` at a level."""
    free = plant.nz - plant.ncon
    D, identity = plant.D11[:free], np.eye(plant.nw)
    weight = np.zeros_like(identity) if np.isinf(gamma) else np.linalg.inv(gamma**2 * identity - D.T @ D)
    return weight, plant.B1 - plant.B2 @ plant.D11[free:], D.T @ plant.C1[:free]


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
    """Solve ``F'X + X F - X G X + Q = 0`` of state feedback and of the filter at a level; ``inf`` gives those of H2."""
    solutions = []
    for plant, name, case in ((ready, "X", "state-feedback"), (ready.dual, "Y", "filter")):
        free, B2 = plant.nz - plant.ncon, plant.B2
        C, C12 = plant.C1[:free], plant.C1[free:]
        weight, entry, through = _disturbance_terms(plant, gamma)
        weighted = weight @ through
        F, G = plant.A - B2 @ C12 + entry @ weighted, B2 @ B2.T - entry @ weight @ entry.T
        solution = schur_solution(F, G, C.T @ C + through.T @ weighted)
        if solution is None:
            return Level(gamma, f"the {case} Riccati equation has no stabilizing solution {name}")
        solution = even(solution)
        values = np.linalg.eigvalsh(solution) if len(solution) else np.zeros(1)
        negligible = ALIKE * np.linalg.norm(F) / np.linalg.norm(G) if G.any() else TINY  # Its gain does not change F.
        if values[0] < -max(_INDEFINITE_RTOL * np.abs(values[[0, -1]]).max(), negligible):
            reason = f"the solution {name} of the {case} Riccati equation is not positive semidefinite"
            return Level(gamma, reason, lower_bound=gamma if np.isfinite(gamma) else 0.0)
        solutions.append(solution)
    X, Y = solutions
    values = np.linalg.eigvals(X @ Y).real if len(X) else np.zeros(1)
    radius = float(np.sqrt(max(values.max(), 0.0)))
    return Level(gamma, _COUPLING if radius >= gamma else "", radius, min(radius, gamma), X, Y)


def suboptimal_controller(ready: NormalizedPlant, level: Level, D22: Array) -> Lti:
    """Return the central controller of a level, in the signals of the plant, which has ``D22``, if its loop is well-posed.

    Otherwise return that one of three controllers for which ``I + D_K D22`` is best conditioned.

    Raises
    ------
    ValueError
        If the level is not reached, or if the loop is not well-posed.
    """
    if level.reason:
        raise ValueError(level.reason)
    family, inward, outward = _all_controllers(ready, level), ready.from_measurements, ready.from_controls
    through = inward @ D22 @ outward

    def well_posedness(K: Lti) -> float:
        values = linalg.svdvals(np.eye(len(K.D)) + K.D @ through)
        return float(values[-1] / max(1.0, values[0]))

    K = lower_lft(family.system, static(np.zeros((family.ncon, family.nmeas))))
    if well_posedness(K) < _MIN_WELL_POSEDNESS:
        left, _, right = linalg.svd(family.D21 @ through @ family.D12, full_matrices=False)
        aligned = 0.5 * level.gamma * (left @ right).T
        K = max(K, *(lower_lft(family.system, static(Q)) for Q in (aligned, -aligned)), key=well_posedness)
    return with_feedthrough(Lti(K.A, K.B @ inward, outward @ K.C, outward @ K.D @ inward), D22)


def _all_controllers(ready: NormalizedPlant, level: Level) -> GeneralizedPlant:
    """Return the parametrization of all controllers of a level.

    Closed by any stable ``Q`` with a norm below the level it is a controller ``u = K y``: its first input is ``y``, its
    first output ``u``.
    """
    F, L = _gain(ready, level.gamma, level.X), _gain(ready.dual, level.gamma, level.Y).T
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


@dataclass(frozen=True)
class Bounds:
    """The lowest level reached, and lower bounds for all controllers.

    Attributes
    ----------
    reached : float
        Level at which the Riccati equations have solutions.
    frequency, omega : float
        Lower bound at one frequency, and this frequency [rad/s].
    riccati : float
        Lower bound by the Riccati equations.
    reason : str
        Condition that fails below it, or why there is no lower bound.
    band : float
        Largest magnitude of the poles of the plant and of the H2-optimal loop [rad/s].
    """

    reached: float
    frequency: float
    omega: float
    riccati: float
    reason: str
    band: float

    __repr__ = compact

    @property
    def lower(self) -> float:
        """Lower bound for all controllers."""
        return max(self.frequency, self.riccati)

    @property
    def why(self) -> str:
        """Origin of the lower bound."""
        if self.lower == 0.0:
            return f"none: {self.reason or 'the lower bound is zero'}"
        if self.frequency >= self.riccati:
            return f"lower bound {self.frequency:.6g} at {self.omega:.4g} rad/s"
        return f"below {self.riccati:.6g} {self.reason}"

    def below(self, norm: float) -> "Bounds":
        """Return the bounds that the verified norm of a loop does not refute; a refuted bound is zero.

        Parameters
        ----------
        norm : float
            Verified norm.

        Returns
        -------
        Bounds
            Bounds up to the norm.
        """
        frequency, riccati = (
            0.0 if bound > norm * (1.0 + LEVEL) else min(bound, norm) for bound in (self.frequency, self.riccati)
        )
        return replace(
            self,
            frequency=frequency,
            riccati=riccati,
            reason=self.reason if riccati > 0.0 or self.riccati == 0.0 else "",
        )


def lowest_level(
    ready: NormalizedPlant, rtol: float, deadline: Deadline, wanted: float | None = None
) -> tuple[Bounds, Level]:
    """Return the lowest level that is reached, within ``rtol`` of its lower bound, and its Riccati solutions.

    If ``wanted`` is given, the search continues until that level is reached or excluded.

    Raises
    ------
    SynthesisError
        If the Riccati equations of H2 have no solutions, or if no level is reached.
    OutOfTimeError
        If the time is up.
    """
    relaxed = level_of(ready, np.inf)
    if relaxed.reason:
        raise SynthesisError(f"No suboptimal controller was found at gamma = inf (H2 synthesis): {relaxed.reason}.")
    F, L = (_gain(plant, np.inf, X)[plant.nw :] for plant, X in ((ready, relaxed.X), (ready.dual, relaxed.Y)))
    frequency, omega = max(unreachable_gain(ready, F), unreachable_gain(ready.dual, L))
    poles = ready.system.poles, *(np.linalg.eigvals(A) for A in (ready.A + ready.B2 @ F, ready.A + L.T @ ready.C2))
    band = float(np.abs(np.concatenate(poles)).max(initial=0.0))
    levels = _bisected(ready, relaxed, frequency, rtol, np.inf if wanted is None else wanted, deadline)
    reached = min((level for level in levels if not level.reason), key=lambda level: level.gamma)
    best = max(levels, key=lambda level: level.lower_bound)
    reason = (best.reason or _COUPLING) if best.lower_bound > 0.0 else ""
    return Bounds(reached.gamma, frequency, omega, best.lower_bound, reason, band), reached


def _bisected(
    ready: NormalizedPlant, relaxed: Level, frequency: float, rtol: float, wanted: float, deadline: Deadline
) -> list[Level]:
    """Return levels among which the lowest one reached is as close to a lower bound as requested.

    The levels grow until one is reached. Then the interval is divided at the secant or, every fourth time, halved.
    """
    B1, C1 = np.linalg.norm(ready.B1), np.linalg.norm(ready.C1)
    rate = np.linalg.norm(ready.A) + C1 * np.linalg.norm(ready.B2) + B1 * np.linalg.norm(ready.C2)
    size = float(np.linalg.norm(ready.D11) + C1 * B1 / max(rate, TINY)) or 1.0  # The gain of the plant, estimated.
    tolerance = _SEARCH_RTOL * rtol
    low, high, levels = max(frequency, relaxed.radius), np.inf, [relaxed]
    base, growth = low or size, _FIRST_GROWTH
    gamma = base * (1.0 + FIRST_LEVEL * rtol)
    while len(levels) <= _MAX_LEVELS:
        deadline.check("searching for the lowest level")
        level = level_of(ready, gamma)
        levels.append(level)
        low, high = max(low, gamma if level.reason else level.radius), high if level.reason else min(high, gamma)
        near = max(low * (1.0 + tolerance), min(frequency * (1.0 + rtol), wanted), _ZERO_LEVEL * size)
        if high <= near and not low < wanted < high:
            break
        secant = _secant(levels, tolerance)
        if np.isfinite(high):
            middle = float(np.sqrt(max(low, 1e-3 * high) * high))  # three decades, if there is no lower bound
            gamma = secant if low < secant < high and len(levels) % 4 else middle
            continue
        if growth > _MAX_GROWTH:
            raise SynthesisError(f"No level up to {gamma:.3g} is reached: {level.reason}.")
        first = secant if len(levels) == 2 and secant > low else np.nan
        # The radius of a level that only the coupling excludes is reached.
        gamma = float(np.nanmin([growth * base, level.radius * (1.0 + _COUPLED_RTOL), first]))
        growth **= 2
    return levels


def _secant(levels: list[Level], tolerance: float) -> float:
    """Return a level just above that at which the radius equals it, by the secant of two levels; NaN without two.

    Inverse squares are interpolated: those of the radius are affine in those of the level near the H2 solutions.
    """
    failed = [level for level in levels if level.reason and level.radius > 0.0]
    passed = sorted((level for level in levels if not level.reason and level.radius > 0.0), key=lambda v: v.gamma)
    ends = [*passed[: 1 if failed else 2], *sorted(failed, key=lambda v: v.gamma)[-1:]]
    if len(ends) < 2:
        return np.nan
    unit = ends[0].radius
    with np.errstate(divide="ignore", over="ignore", invalid="ignore"):  # of radii that are equal or differ by too much
        inverse = (unit / np.array([(v.gamma, v.radius) for v in ends])) ** 2
        gap = inverse[:, 1] - inverse[:, 0]
        slope = (inverse[1, 0] - inverse[0, 0]) / (gap[1] - gap[0])
        return float(unit / np.sqrt(inverse[0, 0] - slope * gap[0]) * (1.0 + _SECANT_MARGIN * tolerance * abs(slope)))


def unreachable_gain(plant: GeneralizedPlant, F: Array) -> tuple[float, float]:
    """Return the peak over frequency of the gain orthogonal to the controls, and its frequency."""
    free, nw = plant.nz - plant.ncon, plant.nw
    if free == 0:
        return 0.0, np.inf
    last = float(np.linalg.norm(plant.D11[:free], 2))
    if not len(plant.A):
        return last, np.inf
    system = Lti(plant.A + plant.B2 @ F, plant.system.B, plant.C1 + plant.D12 @ F, plant.system.D[: plant.nz])
    fractions = partial_fractions(system)

    def rest(response: Array) -> Array:
        G = response.transpose(2, 0, 1)
        # Orthonormal but for rounding, which light damping and long chains magnify.
        basis = np.linalg.qr(G[:, :, nw:], mode="complete")[0][:, :, plant.ncon :]
        return singular_values((np.conj(np.swapaxes(basis, 1, 2)) @ G[:, :, :nw]).transpose(1, 2, 0))[0]

    def by_modes(omega: Array) -> Array:
        response = fractions.response(omega)
        return rest(response) if np.isfinite(response).all() else np.full(len(omega), np.inf)

    size = np.abs(np.concatenate([system.poles, plant.system.poles]))
    size = size[size > ALIKE * size.max()]  # Slower ones set no frequency of the bound.
    low, high = (size.min(), size.max()) if len(size) else (1.0, 1.0)
    grid = resonance_grid(np.zeros(0), low / 10.0, high * 10.0, points=SEARCHED, also=[0.0, *size])
    peak, omega = confirmed_peak(
        highest_peak(by_modes, grid), lambda omega: rest(system.response(omega, quiet=True)), grid
    )
    return (peak, omega) if peak >= last else (last, np.inf)
