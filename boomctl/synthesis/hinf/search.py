"""The search for the lowest level that can be reached, with a bound from below that goes with it."""

import time
from dataclasses import dataclass, replace

import numpy as np
from scipy import linalg

from boomctl.synthesis.errors import SynthesisError
from boomctl.synthesis.hinf.frequency_bound import frequency_bound
from boomctl.synthesis.hinf.two_riccati import COUPLING, Level, gains, level_of
from boomctl.synthesis.plants.partition import Normalised

_GROWTH = (1.01, 1.1, 1.5, 3.0, 10.0, 100.0, 1e4, 1e6, 1e9)
_STEPS = 60
_NOTHING = 1e-8
_ABOVE = 1e-3
_REFUTED = 1e-6


@dataclass(frozen=True)
class Deadline:
    """A moment at which a computation gives up."""

    limit: float
    end: float

    @classmethod
    def after(cls, limit: float) -> "Deadline":
        """Return the moment ``limit`` seconds from now."""
        return cls(limit, time.monotonic() + limit)

    def left(self, doing: str) -> float:
        """Return the seconds left.

        Raises
        ------
        SynthesisError
            None is left.
        """
        rest = self.end - time.monotonic()
        if rest <= 0.0:
            raise SynthesisError(f"the time limit of {self.limit:g} s ran out while {doing}; no controller is returned")
        return rest


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

    @property
    def lower(self) -> float:
        """What no controller beats."""
        return max(self.frequency, self.riccati)

    def below(self, norm: float) -> "Bounds":
        """Return what the verified norm of a loop does not refute; a bound it beats was made by rounding, and is zero."""
        frequency, riccati = (
            0.0 if bound > norm * (1.0 + _REFUTED) else min(bound, norm) for bound in (self.frequency, self.riccati)
        )
        return replace(self, frequency=frequency, riccati=riccati, reason=self.reason if riccati > 0.0 else "")


def lowest_level(ready: Normalised, tolerance: float, deadline: Deadline) -> Bounds:
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
    F2, L2 = F[ready.B1.shape[1] :], L[:, len(ready.C1) :]
    frequency, omega = frequency_bound(ready, F2, L2)
    parts = (ready.A, ready.A + ready.B2 @ F2, ready.A + L2 @ ready.C2)
    band = max((float(np.abs(linalg.eigvals(part)).max()) for part in parts if len(part)), default=0.0)
    span, levels = _narrowed(_Span(max(frequency, relaxed.radius), np.inf), ready, tolerance, deadline)
    riccati, reason = _proven([relaxed, *levels])
    return Bounds(span.high, frequency, omega, riccati, reason, band)


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


@dataclass(frozen=True)
class _Span:
    """Levels between which the lowest one seems to lie."""

    low: float
    high: float

    def with_level(self, level: Level) -> "_Span":
        """Return the span narrowed by what a level tells; as the level falls, the radius grows."""
        if level.reason:
            return _Span(max(self.low, level.gamma), self.high)
        return _Span(max(self.low, level.radius), min(self.high, level.gamma))


def _narrowed(span: _Span, ready: Normalised, tolerance: float, deadline: Deadline) -> tuple[_Span, list[Level]]:
    """Return a span as narrow as asked for, and the levels that were looked at."""
    levels = _reached(ready, span.low if span.low > 0.0 else _size(ready), deadline)
    for level in levels:
        span = span.with_level(level)
    floor = _NOTHING * _size(ready)
    for step in range(_STEPS):
        if span.high <= max(span.low * (1.0 + tolerance), floor):
            break
        deadline.left("searching for the lowest level")
        levels.append(level_of(ready, _middle(span) if step % 3 == 2 else _next(span, levels, tolerance)))
        span = span.with_level(levels[-1])
    return span, levels


def _reached(ready: Normalised, base: float, deadline: Deadline) -> list[Level]:
    """Return levels that grow until the last can be reached; where only the coupling fails, its radius can be."""
    levels: list[Level] = []
    enough = np.inf
    for growth in _GROWTH:
        deadline.left("looking for a level that can be reached")
        levels.append(level_of(ready, min(growth * base, enough)))
        if not levels[-1].reason:
            return levels
        if np.isfinite(levels[-1].radius):
            enough = levels[-1].radius * (1.0 + _ABOVE)
    raise SynthesisError(f"no level up to {_GROWTH[-1] * base:.3g} can be reached: {levels[-1].reason}")


def _middle(span: _Span) -> float:
    return float(np.sqrt(max(span.low, 1e-3 * span.high) * span.high))


def _next(span: _Span, levels: list[Level], tolerance: float) -> float:
    """Return a level just above where a line through two levels says that the radius equals it, else the middle."""
    below = max((v for v in levels if v.reason and v.radius > 0.0), key=lambda v: v.gamma, default=None)
    above = min((v for v in levels if not v.reason and v.radius > 0.0), key=lambda v: v.gamma, default=None)
    if below is None or above is None:
        return _middle(span)
    a, b = np.log(below.radius / below.gamma), np.log(above.radius / above.gamma)
    guess = below.gamma * (above.gamma / below.gamma) ** (a / (a - b)) * (1.0 + 0.4 * tolerance)
    return float(guess) if span.low < guess < span.high else _middle(span)


def _size(ready: Normalised) -> float:
    """Return a level to start from where nothing bounds it from below."""
    B1, C1 = np.linalg.norm(ready.B1), np.linalg.norm(ready.C1)
    rate = np.linalg.norm(ready.A) + C1 * np.linalg.norm(ready.B2) + B1 * np.linalg.norm(ready.C2)
    return float(np.linalg.norm(ready.D11) + C1 * B1 / max(rate, np.finfo(float).tiny)) or 1.0
