"""The lowest H-infinity level that is reached, and lower bounds for all controllers.

At one frequency the closed loop of any controller is ``P11 + P12 Q P21`` with some matrix ``Q``. The least norm over all
matrices is the larger of ``P11`` without the range of ``P12`` and ``P11`` without that of ``P21'`` (Parrott 1978; Davis,
Kahan & Weinberger 1982). State feedback changes neither, and the H2-optimal one makes the range of ``P12`` orthonormal
(Zhou, Doyle & Glover 1996, theorem 13.34), so that the bound is accurate for undamped modes too.
"""

from dataclasses import dataclass, replace

import numpy as np

from boomctl.arrays import Array
from boomctl.exceptions import SynthesisError
from boomctl.lti.frequency import SEARCHED, confirmed_peak, highest_peak, resonance_grid, singular_values
from boomctl.lti.modal import partial_fractions
from boomctl.lti.rounding import TINY
from boomctl.lti.system import Lti
from boomctl.printing import compact
from boomctl.progress import Deadline
from boomctl.synthesis.hinf.normal_form import NormalizedPlant
from boomctl.synthesis.hinf.two_riccati import COUPLING, Level, gains, level_of
from boomctl.synthesis.plants.partition import GeneralizedPlant

FIRST_LEVEL = 0.95  # Excess of the first level over the lower bound, relative to rtol. The rest is for rounding errors.
_SEARCH_RTOL = 0.25  # Accuracy of the lowest level, relative to rtol.
_SECANT_MARGIN = 0.5  # Excess of a level over the secant, relative to rtol and slope, so that it is reached.
_FIRST_GROWTH, _MAX_GROWTH = 1.1, 1e10  # Growth of the first levels, squared with each one that is not reached.
_MAX_LEVELS = 80  # Every fourth one halves the interval; 20 halvings reduce a ratio of 1e9 to 1 + 2e-5.
_COUPLED_RTOL = 1e-3  # Excess of the next level over the radius of one that only the coupling excludes.
_SLOWEST = 1e-9  # Poles below this fraction of the fastest one set no frequency of the bound.
_ZERO_LEVEL = 1e-8  # A level below this fraction of the gain of the plant is zero.
REFUTED_RTOL = 1e-6  # A verified norm refutes a bound that exceeds it by more; a tenth of the tolerance of norms.


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
        Condition that fails below it.
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
            return "none: the lower bound is zero"
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
            0.0 if bound > norm * (1.0 + REFUTED_RTOL) else min(bound, norm) for bound in (self.frequency, self.riccati)
        )
        return replace(self, frequency=frequency, riccati=riccati, reason=self.reason if riccati > 0.0 else "")


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
        raise SynthesisError(f"The Riccati equations of H2 synthesis could not be solved: {relaxed.reason}.")
    F, L = gains(ready, relaxed)
    F2, L2 = F[ready.nw :], L[:, ready.nz :]
    frequency, omega = frequency_bound(ready, F2, L2)
    poles = ready.system.poles, *(np.linalg.eigvals(A) for A in (ready.A + ready.B2 @ F2, ready.A + L2 @ ready.C2))
    band = float(np.abs(np.concatenate(poles)).max(initial=0.0))
    levels = _bisected(ready, relaxed, frequency, rtol, np.inf if wanted is None else wanted, deadline)
    reached = min((level for level in levels if not level.reason), key=lambda level: level.gamma)
    best = max(levels, key=lambda level: level.lower_bound)
    reason = (best.reason or COUPLING) if best.lower_bound > 0.0 else ""
    return Bounds(reached.gamma, frequency, omega, best.lower_bound, reason, band), reached


def _bisected(
    ready: NormalizedPlant, relaxed: Level, frequency: float, rtol: float, wanted: float, deadline: Deadline
) -> list[Level]:
    """Return levels among which the lowest one reached is as close to a lower bound as requested.

    The levels grow until one is reached. Then the interval is divided at the secant or, every fourth time, halved.
    """
    size, tolerance = _gain(ready), _SEARCH_RTOL * rtol
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


def _gain(ready: NormalizedPlant) -> float:
    """Return an estimate of the gain of the plant: the first level, if there is no lower bound."""
    B1, C1 = np.linalg.norm(ready.B1), np.linalg.norm(ready.C1)
    rate = np.linalg.norm(ready.A) + C1 * np.linalg.norm(ready.B2) + B1 * np.linalg.norm(ready.C2)
    return float(np.linalg.norm(ready.D11) + C1 * B1 / max(rate, TINY)) or 1.0


def frequency_bound(ready: NormalizedPlant, F: Array, L: Array) -> tuple[float, float]:
    """Return a norm that no controller goes below, and the frequency at which this holds [rad/s], possibly infinite.

    ``F`` and ``L`` are the H2-optimal state feedback to the controls and output injection from the measurements.
    """
    return max(_unreachable_gain(ready, F), _unreachable_gain(ready.dual, L.T))


def _unreachable_gain(plant: GeneralizedPlant, F: Array) -> tuple[float, float]:
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
    size = size[size > _SLOWEST * size.max()]
    low, high = (size.min(), size.max()) if len(size) else (1.0, 1.0)
    grid = resonance_grid(np.zeros(0), low / 10.0, high * 10.0, points=SEARCHED, also=[0.0, *size])
    peak, omega = confirmed_peak(
        highest_peak(by_modes, grid), lambda omega: rest(system.response(omega, quiet=True)), grid
    )
    return (peak, omega) if peak >= last else (last, np.inf)
