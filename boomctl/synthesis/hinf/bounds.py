"""The lowest level that can be reached, and levels that no controller beats.

Whatever the controller, the closed loop at one frequency is ``P11 + P12 Q P21`` with some matrix ``Q``.  The least
norm over all matrices is the larger of ``P11`` without what the controls reach and ``P11`` without what the
measurements see (Parrott 1978; Davis, Kahan & Weinberger 1982).  State feedback changes neither what the controls
reach nor the rest, and the H2-optimal one makes what they reach orthonormal (Zhou, Doyle & Glover 1996, theorem 13.34),
so that an undamped mode does no harm to the digits.  Where rounding leaves the feedback short of optimal, the bound
holds nevertheless.
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

# Of the tolerance, how far above a bound a controller is looked for first: what is left is for rounding (a choice)
CLOSEST = 0.95
_SEARCH = 0.25  # share of the tolerance to which the lowest level is found: the rest is left to the controllers
_BESIDE = 0.5  # of the tolerance that is left above a level that a line tells, whose slope it allows for (a choice)
_FREE = 0.5  # radius over its level up to which the coupling is far from setting the lowest level (a choice)
# Levels tried upwards after that, as multiples of the first guess: wide where it only has the right unit.
_GROWTH = (1.1, 1.5, 3.0, 10.0, 100.0, 1e4, 1e6, 1e9)
_STEPS = 60  # levels looked at: every third halves the span, and 20 halvings take a ratio of 1e9 to 1 + 2e-5
_SLOWEST = 1e-9  # share of the fastest pole below which the frequency bound is not looked for: no peak lies there
_NOTHING = 1e-8  # share of the plant's own size below which a level counts as zero
_ABOVE = 1e-3  # how far above the radius of a level that only the coupling refuses another one can be reached
REFUTED = (
    1e-6  # a verified norm below a bound by more than this share refutes it: a tenth of what norms are certified to
)


@dataclass(frozen=True)
class Bounds:
    """The lowest level reached, between bounds that no controller beats.

    Attributes
    ----------
    reached : float
        The Riccati equations say that this level can be reached.
    frequency, omega : float
        What no controller beats at one frequency [rad/s].
    riccati : float
        The highest level at which they were seen to fail.
    reason : str
        Why.
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
        """What no controller beats."""
        return max(self.frequency, self.riccati)

    @property
    def why(self) -> str:
        """Which of the two says so."""
        if self.lower == 0.0:
            return "none: nothing bounds the norm from below"
        if self.frequency >= self.riccati:
            return f"at {self.omega:.4g} rad/s no controller goes below {self.frequency:.6g}"
        return f"below {self.riccati:.6g} {self.reason}"

    def below(self, norm: float) -> "Bounds":
        """Return what the verified norm of a loop does not refute; a bound it beats was made by rounding, and is zero.

        Parameters
        ----------
        norm : float
            That norm.

        Returns
        -------
        Bounds
            No bound lies above the norm.
        """
        frequency, riccati = (
            0.0 if bound > norm * (1.0 + REFUTED) else min(bound, norm) for bound in (self.frequency, self.riccati)
        )
        return replace(self, frequency=frequency, riccati=riccati, reason=self.reason if riccati > 0.0 else "")


def lowest_level(
    ready: NormalizedPlant, tolerance: float, deadline: Deadline, wanted: float | None = None
) -> tuple[Bounds, Level]:
    """Return the lowest level that can be reached, to within ``tolerance`` of what bounds it from below, and its equations.

    Where the coupling sets it, it is found to a quarter of that; where one is wanted, the search goes on until that is
    reached.

    Raises
    ------
    SynthesisError
        Not even the H2 Riccati equations could be solved; no level can be reached.
    OutOfTimeError
        There was no time left for it.
    """
    relaxed = level_of(ready, np.inf)
    if relaxed.X is None or relaxed.Y is None:
        raise SynthesisError(f"the Riccati equations of H2 synthesis could not be solved: {relaxed.reason}")
    F, L = gains(ready, relaxed)
    F2, L2 = F[ready.nw :], L[:, ready.nz :]
    frequency, omega = frequency_bound(ready, F2, L2)
    poles = ready.system.poles, *(np.linalg.eigvals(A) for A in (ready.A + ready.B2 @ F2, ready.A + L2 @ ready.C2))
    band = float(np.abs(np.concatenate(poles)).max(initial=0.0))
    levels = _reached(relaxed, frequency, tolerance, deadline)
    first = levels[-1]
    enough = frequency * (1.0 + tolerance) if wanted is None else min(frequency * (1.0 + tolerance), wanted)
    if first.gamma > enough or first.radius > _FREE * first.gamma:
        levels = _refined(levels, frequency, _SEARCH * tolerance, np.inf if wanted is None else wanted, deadline)
    reached = min((level for level in levels if not level.reason), key=lambda level: level.gamma)
    riccati, reason = _proven(levels)
    return Bounds(reached.gamma, frequency, omega, riccati, reason, band), reached


def _proven(levels: list[Level]) -> tuple[float, str]:
    """Return the highest level that one of these shows to be out of reach, and why."""
    best, reason = 0.0, ""
    for level in sorted(levels, key=_promise, reverse=True):
        if _promise(level) <= best:
            break
        if level.bound > best:
            best, reason = level.bound, level.reason or COUPLING
    return best, reason


def _promise(level: Level) -> float:
    return min(level.radius, level.gamma) if np.isfinite(level.radius) else (level.gamma if level.reason else 0.0)


def _reached(relaxed: Level, frequency: float, tolerance: float, deadline: Deadline) -> list[Level]:
    """Return that of H2 and levels that grow until the last can be reached; where only the coupling fails, its radius can."""
    levels, enough = [relaxed], np.inf
    base = max(frequency, relaxed.radius) or _size(relaxed.ready)
    for growth in (1.0 + CLOSEST * tolerance, *_GROWTH):
        deadline.check("looking for a level that can be reached")
        levels.append(level_of(relaxed.ready, min(growth * base, enough)))
        if not levels[-1].reason:
            return levels
        if np.isfinite(levels[-1].radius):
            enough = _secant(levels, tolerance) if len(levels) == 2 else levels[-1].radius * (1.0 + _ABOVE)
    raise SynthesisError(f"no level up to {_GROWTH[-1] * base:.3g} can be reached: {levels[-1].reason}")


def _refined(levels: list[Level], low: float, tolerance: float, wanted: float, deadline: Deadline) -> list[Level]:
    """Return levels among which the lowest above ``low`` that can be reached is found as closely as asked for.

    They go on to a wanted one, as long as it may be reached.
    """
    levels, ready = levels.copy(), levels[0].ready
    floor, step = _NOTHING * _size(ready), 0
    while True:
        # as the level falls, the radius grows
        low = max(low, *(level.gamma if level.reason else level.radius for level in levels))
        high = min(level.gamma for level in levels if not level.reason)
        near = high <= max(low * (1.0 + tolerance), floor) and not low < wanted < high
        if near or step == _STEPS:
            return levels
        deadline.check("searching for the lowest level")
        middle = float(np.sqrt(max(low, 1e-3 * high) * high))  # of an open span, three decades
        guess = middle if step % 3 == 2 else _secant(levels, tolerance)
        levels.append(level_of(ready, guess if low < guess < high else middle))
        step += 1


def _secant(levels: list[Level], tolerance: float) -> float:
    """Return a level just above where a line through two levels says that the radius equals it; nan without two.

    It is one of inverse squares: those of the radius fall by that of the level where the solutions are near those of H2.
    """
    below = [v for v in levels if v.reason and v.radius > 0.0]
    above = sorted((v for v in levels if not v.reason and v.radius > 0.0), key=lambda v: v.gamma)
    ends = [*above[: 1 if below else 2], *sorted(below, key=lambda v: v.gamma)[-1:]]
    if len(ends) < 2:
        return np.nan
    unit = ends[0].radius
    with np.errstate(divide="ignore", over="ignore", invalid="ignore"):  # radii too far apart, or the same
        inverse = (unit / np.array([(v.gamma, v.radius) for v in ends])) ** 2
        gap = inverse[:, 1] - inverse[:, 0]
        slope = (inverse[1, 0] - inverse[0, 0]) / (gap[1] - gap[0])
        return float(unit / np.sqrt(inverse[0, 0] - slope * gap[0]) * (1.0 + _BESIDE * tolerance * abs(slope)))


def _size(ready: NormalizedPlant) -> float:
    """Return a level to start from where nothing bounds it from below."""
    B1, C1 = np.linalg.norm(ready.B1), np.linalg.norm(ready.C1)
    rate = np.linalg.norm(ready.A) + C1 * np.linalg.norm(ready.B2) + B1 * np.linalg.norm(ready.C2)
    return float(np.linalg.norm(ready.D11) + C1 * B1 / max(rate, TINY)) or 1.0


def frequency_bound(ready: NormalizedPlant, F: Array, L: Array) -> tuple[float, float]:
    """Return a norm that no controller goes below, and the frequency at which that is so [rad/s], infinity included.

    ``F`` and ``L`` are H2-optimal: state feedback to the controls, output injection from the measurements.
    """
    return max(_out_of_reach(ready, F), _out_of_reach(ready.dual, L.T))


def _out_of_reach(plant: GeneralizedPlant, F: Array) -> tuple[float, float]:
    """Return the peak over frequency of what no control reaches, and its frequency."""
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
        # orthonormal but for rounding, which light damping and long chains magnify
        basis = np.linalg.qr(G[:, :, nw:], mode="complete")[0][:, :, plant.ncon :]
        return singular_values((np.conj(np.swapaxes(basis, 1, 2)) @ G[:, :, :nw]).transpose(1, 2, 0))[0]

    size = np.abs(np.concatenate([system.poles, plant.system.poles]))
    size = size[size > _SLOWEST * size.max()]
    low, high = (size.min(), size.max()) if len(size) else (1.0, 1.0)
    grid = resonance_grid(np.zeros(0), low / 10.0, high * 10.0, points=SEARCHED, also=[0.0, *size])

    def quick(omega: Array) -> Array:
        response = fractions.response(omega)  # of eigenvectors that may be dependent
        return rest(response) if np.isfinite(response).all() else np.full(len(omega), np.inf)

    result = highest_peak(quick, grid)
    peak, omega = confirmed_peak(result, lambda omega: rest(system.response(omega, quiet=True)), grid)
    return (peak, omega) if peak >= last else (last, np.inf)
