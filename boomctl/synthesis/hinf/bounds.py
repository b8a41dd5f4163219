"""The lowest level that can be reached, and levels that no controller beats.

Whatever the controller, the closed loop at one frequency is ``P11 + P12 Q P21`` with some matrix ``Q``.  The least
norm over all matrices is the larger of ``P11`` without what the controls reach and ``P11`` without what the
measurements see (Parrott 1978; Davis, Kahan & Weinberger 1982).  State feedback changes neither what the controls
reach nor the rest, and the H2-optimal one makes what they reach orthonormal (Zhou, Doyle & Glover 1996, theorem 13.34),
so that an undamped mode does no harm to the digits.  Where rounding leaves the feedback short of optimal, the bound
holds nevertheless.
"""

import time
from dataclasses import dataclass, replace

import numpy as np
from scipy import linalg

from boomctl.arrays import Array
from boomctl.lti.frequency import SEARCHED, highest_peak, resonance_grid
from boomctl.lti.rounding import TINY
from boomctl.lti.system import Lti
from boomctl.printing import compact
from boomctl.progress import tell
from boomctl.synthesis.assumptions import SynthesisError
from boomctl.synthesis.hinf.normal_form import NormalizedPlant
from boomctl.synthesis.hinf.two_riccati import COUPLING, Level, gains, level_of
from boomctl.synthesis.plants.partition import GeneralizedPlant

# Levels tried upwards, as multiples of the first guess: tight where it is a bound, wide where it only has the right unit.
_GROWTH = (1.01, 1.1, 1.5, 3.0, 10.0, 100.0, 1e4, 1e6, 1e9)
_STEPS = 60  # levels looked at: every third halves the span, and 20 halvings take a ratio of 1e9 to 1 + 2e-5
_SLOWEST = 1e-9  # share of the fastest pole below which the frequency bound is not looked for: no peak lies there
_NOTHING = 1e-8  # share of the plant's own size below which a level counts as zero
_ABOVE = 1e-3  # how far above the radius of a level that only the coupling refuses another one can be reached
REFUTED = (
    1e-6  # a verified norm below a bound by more than this share refutes it: a tenth of what norms are certified to
)


@dataclass(frozen=True)
class Deadline:
    """A moment at which a computation gives up."""

    limit: float
    end: float

    @classmethod
    def after(cls, limit: float) -> "Deadline":
        """Return the moment ``limit`` seconds from now."""
        return cls(limit, time.monotonic() + limit)

    def check(self, doing: str) -> None:
        """Tell what is done, and raise :class:`SynthesisError` if no time is left for it."""
        tell(doing)
        if time.monotonic() >= self.end:
            raise SynthesisError(f"the time limit of {self.limit:g} s ran out while {doing}; no controller is returned")


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


def lowest_level(ready: NormalizedPlant, tolerance: float, deadline: Deadline) -> Bounds:
    """Return the lowest level that can be reached, to within ``tolerance`` of what bounds it from below.

    Raises
    ------
    SynthesisError
        Not even the H2 Riccati equations could be solved; no level can be reached; out of time.
    """
    relaxed = level_of(ready, np.inf)
    if relaxed.X is None or relaxed.Y is None:
        raise SynthesisError(f"the Riccati equations of H2 synthesis could not be solved: {relaxed.reason}")
    F, L = gains(ready, relaxed)
    F2, L2 = F[ready.nw :], L[:, ready.nz :]
    frequency, omega = frequency_bound(ready, F2, L2)
    parts = (ready.A, ready.A + ready.B2 @ F2, ready.A + L2 @ ready.C2)
    band = max((float(np.abs(linalg.eigvals(part)).max()) for part in parts if len(part)), default=0.0)
    reached, levels = _lowest_reached(max(frequency, relaxed.radius), ready, tolerance, deadline)
    riccati, reason = _proven([relaxed, *levels])
    return Bounds(reached=reached, frequency=frequency, omega=omega, riccati=riccati, reason=reason, band=band)


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


def _lowest_reached(
    low: float, ready: NormalizedPlant, tolerance: float, deadline: Deadline
) -> tuple[float, list[Level]]:
    """Return the lowest level above ``low`` that can be reached, as closely as asked for, and all that were looked at."""
    levels = _reached(ready, low if low > 0.0 else _size(ready), deadline)
    floor, step = _NOTHING * _size(ready), 0
    while True:
        # as the level falls, the radius grows
        low = max(low, *(level.gamma if level.reason else level.radius for level in levels))
        high = min(level.gamma for level in levels if not level.reason)
        if step == _STEPS or high <= max(low * (1.0 + tolerance), floor):
            return high, levels
        deadline.check("searching for the lowest level")
        middle = float(np.sqrt(max(low, 1e-3 * high) * high))  # of an open span, three decades
        guess = middle if step % 3 == 2 else _secant(levels, tolerance)
        levels.append(level_of(ready, guess if low < guess < high else middle))
        step += 1


def _reached(ready: NormalizedPlant, base: float, deadline: Deadline) -> list[Level]:
    """Return levels that grow until the last can be reached; where only the coupling fails, its radius can be."""
    levels: list[Level] = []
    enough = np.inf
    for growth in _GROWTH:
        deadline.check("looking for a level that can be reached")
        levels.append(level_of(ready, min(growth * base, enough)))
        if not levels[-1].reason:
            return levels
        if np.isfinite(levels[-1].radius):
            enough = levels[-1].radius * (1.0 + _ABOVE)
    raise SynthesisError(f"no level up to {_GROWTH[-1] * base:.3g} can be reached: {levels[-1].reason}")


def _secant(levels: list[Level], tolerance: float) -> float:
    """Return a level just above where a line through two levels says that the radius equals it; nan without two."""
    below = max((v for v in levels if v.reason and v.radius > 0.0), key=lambda v: v.gamma, default=None)
    above = min((v for v in levels if not v.reason and v.radius > 0.0), key=lambda v: v.gamma, default=None)
    if below is None or above is None:
        return np.nan
    a, b = np.log(below.radius / below.gamma), np.log(above.radius / above.gamma)
    return float(below.gamma * (above.gamma / below.gamma) ** (a / (a - b)) * (1.0 + 0.4 * tolerance))


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
    closed = plant.A + plant.B2 @ F
    system = Lti(closed, plant.system.B, plant.C1 + plant.D12 @ F, plant.system.D[: plant.nz])

    def rest(omega: Array) -> Array:
        G = system.response(omega, quiet=True).transpose(2, 0, 1)
        inputs, reached = G[:, :, :nw], G[:, :, nw:]
        basis = np.linalg.qr(reached)[0]  # orthonormal but for rounding, which light damping and long chains magnify
        left = inputs - basis @ (np.conj(np.swapaxes(basis, 1, 2)) @ inputs)
        return np.linalg.norm(left, 2, axis=(1, 2)) if min(left.shape[1:]) > 1 else np.linalg.norm(left, axis=(1, 2))

    size = np.abs(np.concatenate([np.linalg.eigvals(closed), np.linalg.eigvals(plant.A)]))
    size = size[size > _SLOWEST * size.max()]
    low, high = (size.min(), size.max()) if len(size) else (1.0, 1.0)
    grid = resonance_grid(np.zeros(0), low / 10.0, high * 10.0, points=SEARCHED, also=[0.0, *size])
    peak, omega = highest_peak(rest, grid)
    return (peak, omega) if peak >= last else (last, np.inf)
