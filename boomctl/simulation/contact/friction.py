"""Coulomb friction as a set-valued law: the force that keeps the slip at rest if admissible, else the sliding force.

Within a step the friction force is constant except for one change, where sliding comes to rest; its mean is computed from
the exact motion of the plant, which is linear in it, so that the slip velocity at the end of the step obeys the law
``-F sign(v)``, any force within ``[-F, F]`` at rest.  The law is not smoothed.  Sliding, sticking, reversal and break-away
are each of second order in the step.

Source: Moreau (1988) and Jean (1999) for the time stepping, here with a division of the step at the reversal.
"""

from dataclasses import dataclass
from typing import NamedTuple

from boomctl.checks import exactly, nonnegative, positive, signal_name, whole
from boomctl.lti.rounding import SUMMED
from boomctl.printing import compact


@dataclass(frozen=True, repr=False)
class CoulombFriction:
    """Coulomb friction between the two bodies on which an input of the plant acts.

    Parameters
    ----------
    sliding_force : float
        Friction force while sliding [N].
    breakaway_force : float, optional
        Force that must be exceeded to break away [N]; by default ``sliding_force``.
    force_input : str
        Name of the force input of the plant through which friction acts.
    slip_output : str
        Name of the slip: the displacement on which this force does work.
    substeps : int
        Number of integration steps between two requested times; check the ``error_estimate`` of the result.

    Raises
    ------
    TypeError, ValueError
        If a force is not positive, ``breakaway_force`` is below ``sliding_force``, or ``substeps`` is less than 1.

    Examples
    --------
    >>> import boomctl as bc
    >>> law = bc.CoulombFriction(3.0, breakaway_force=4.0)
    >>> law.sliding_force, law.breakaway_force
    (3.0, 4.0)
    """

    sliding_force: float
    breakaway_force: float | None = None
    force_input: str = "cradle"
    slip_output: str = "cradle_slip"
    substeps: int = 4

    __repr__ = compact

    def __post_init__(self) -> None:
        positive("sliding_force", self.sliding_force)
        signal_name("force_input", self.force_input)
        signal_name("slip_output", self.slip_output)
        whole("substeps", self.substeps)
        if (
            self.breakaway_force is not None
            and nonnegative("breakaway_force", self.breakaway_force) < self.sliding_force
        ):
            raise ValueError(
                f"breakaway_force = {exactly(self.breakaway_force)}: expected no less than sliding_force = "
                f"{exactly(self.sliding_force)}"
            )

    @property
    def _breakaway_force(self) -> float:
        """Largest sticking force [N]."""
        return float(self.sliding_force if self.breakaway_force is None else self.breakaway_force)


class Slip(NamedTuple):
    """Slip velocity, sticking or not, and the mean sticking force over the full previous step (or ``None``).

    The load is extrapolated from this force to locate the break-away within a step, which matters if ``breakaway_force``
    exceeds ``sliding_force``.
    """

    velocity: float
    stuck: bool
    held: float | None

    def after(self, step: "FrictionStep") -> "Slip":
        """Return the state at the end of a step."""
        return Slip(step.velocity, step.stuck, step.force if step.stuck and step.sliding == 0.0 else None)


class FrictionStep(NamedTuple):
    """Mean friction force over a step [N], slip velocity at its end, and course of the step.

    ``sliding`` is the fraction of the step before sliding came to rest (1: it did not, 0: it stuck from the start).
    """

    force: float
    velocity: float
    stuck: bool
    sliding: float


def friction_step(slip: Slip, free: float, gain: float, law: CoulombFriction) -> FrictionStep:
    """Return the friction force over a step.

    Parameters
    ----------
    slip : Slip
        Slip at the start of the step.
    free : float
        Slip velocity at the end without friction [m/s].
    gain : float
        Effect of a unit force over the step on this velocity [m/s/N].
    law : CoulombFriction
    """
    velocity, stuck, held = slip
    holding = -free / gain
    if stuck:
        return _from_rest(holding, free, gain, law, held)
    direction = 1.0 if velocity > 0.0 else -1.0
    first = -law.sliding_force * direction
    end = free + gain * first
    if end * direction > 0.0:
        return FrictionStep(first, end, False, 1.0)
    fraction = velocity / (velocity - end) if velocity != end else 1.0
    rest = 1.0 - fraction
    if rest < SUMMED:  # fraction of a step: a shorter rest is a rounding error
        return FrictionStep(holding, 0.0, True, 1.0)
    needed = (holding - fraction * first) / rest
    if abs(needed) <= law._breakaway_force:
        return FrictionStep(holding, 0.0, True, fraction)
    mean = fraction * first + rest * (law.sliding_force if needed > 0.0 else -law.sliding_force)
    return FrictionStep(mean, free + gain * mean, False, fraction)


def _from_rest(holding: float, free: float, gain: float, law: CoulombFriction, held: float | None) -> FrictionStep:
    slope = 0.0 if held is None or law._breakaway_force == law.sliding_force else holding - held
    start, end = holding - 0.5 * slope, holding + 0.5 * slope
    if max(abs(start), abs(end)) <= law._breakaway_force:
        return FrictionStep(holding, 0.0, True, 0.0)
    sign = 1.0 if (end if abs(end) > abs(start) else start) > 0.0 else -1.0
    fraction = 0.0
    if sign * start < law._breakaway_force and slope != 0.0:
        fraction = min(max((sign * law._breakaway_force - start) / slope, 0.0), 1.0)
    mean = fraction * (start + 0.5 * fraction * slope) + (1.0 - fraction) * sign * law.sliding_force
    velocity = free + gain * mean
    if velocity * sign >= 0.0:
        return FrictionStep(holding, 0.0, True, 0.0)
    return FrictionStep(mean, velocity, False, 0.0)
