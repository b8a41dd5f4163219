"""Coulomb friction as a set-valued law: the force that holds if it can, the force of sliding if it cannot.

Within a step the friction force is constant but for one change, where sliding comes to rest; its mean is found from
the exact motion of the plant, which is linear in it, so that the slip velocity at the end of the step obeys the law
``-F sign(v)``, any force within ``[-F, F]`` at rest.  Nothing is smoothed.  Sliding, sticking, reversal and
break-away are each of second order in the step.

Source: Moreau (1988) and Jean (1999) for the time stepping; the division of the step at the reversal is ours.
"""

from dataclasses import dataclass
from typing import NamedTuple

from boomctl.checks import exactly, nonnegative, positive, signal_name, whole
from boomctl.lti.rounding import SUMMED


@dataclass(frozen=True)
class CoulombFriction:
    """Coulomb friction between the two bodies on which an input of the plant acts.

    Parameters
    ----------
    force : float
        Friction force while sliding [N].
    static_force : float, optional
        Force that must be exceeded to break away [N]; by default ``force``.
    input : str
        Name of the force input of the plant through which friction acts.
    output : str
        Name of the slip: the displacement on which that force does work.
    substeps : int
        Number of steps of the computation from one instant asked for to the next; the result's ``error_estimate`` tells
        whether they are enough.

    Attributes
    ----------
    breakaway : float
        Largest force that holds [N].

    Raises
    ------
    TypeError, ValueError
        A force not positive, ``static_force`` below ``force``, fewer than one step.

    Examples
    --------
    >>> import boomctl as bc
    >>> bc.CoulombFriction(3.0, static_force=4.0).breakaway
    4.0
    >>> bc.CoulombFriction(3.0).breakaway
    3.0
    """

    force: float
    static_force: float | None = None
    input: str = "cradle"
    output: str = "cradle_slip"
    substeps: int = 4

    def __post_init__(self) -> None:
        positive("force", self.force)
        signal_name("input", self.input)
        signal_name("output", self.output)
        whole("substeps", self.substeps)
        if self.static_force is not None and nonnegative("static_force", self.static_force) < self.force:
            raise ValueError(
                f"static_force = {exactly(self.static_force)}: expected no less than force = {exactly(self.force)}"
            )

    @property
    def breakaway(self) -> float:
        """Largest force that holds [N]."""
        return float(self.force if self.static_force is None else self.static_force)


class Slip(NamedTuple):
    """Slip velocity, whether it is at rest, and the mean force that held it over the whole step before (or ``None``).

    The load is extrapolated from that force to find where the slip breaks away, which matters where ``static_force``
    exceeds ``force``.
    """

    velocity: float
    stuck: bool
    held: float | None

    def after(self, step: "FrictionStep") -> "Slip":
        """Return the state at the end of a step."""
        return Slip(step.velocity, step.stuck, step.force if step.stuck and step.sliding == 0.0 else None)


class FrictionStep(NamedTuple):
    """Mean friction force over a step [N], slip velocity at its end, and how the step went.

    ``sliding`` is the share of the step before sliding came to rest (1: it did not, 0: it stuck from the beginning),
    ``first`` the force during that share.
    """

    force: float
    velocity: float
    stuck: bool
    sliding: float
    first: float


def friction_step(slip: Slip, free: float, gain: float, law: CoulombFriction) -> FrictionStep:
    """Return the friction force over a step.

    Parameters
    ----------
    slip : Slip
        At the beginning of the step.
    free : float
        Slip velocity at the end if there were no friction [m/s].
    gain : float
        What a unit force over the step adds to it [m/s/N].
    law : CoulombFriction
    """
    velocity, stuck, held = slip
    holding = -free / gain
    if stuck:
        return _from_rest(holding, free, gain, law, held)
    direction = 1.0 if velocity > 0.0 else -1.0
    first = -law.force * direction
    end = free + gain * first
    if end * direction > 0.0:
        return FrictionStep(first, end, False, 1.0, first)
    share = velocity / (velocity - end) if velocity != end else 1.0
    rest = 1.0 - share
    if rest < SUMMED:  # share of a step: what rounding leaves of it is no rest
        return FrictionStep(holding, 0.0, True, 1.0, first)
    needed = (holding - share * first) / rest
    if abs(needed) <= law.breakaway:
        return FrictionStep(holding, 0.0, True, share, first)
    mean = share * first + rest * (law.force if needed > 0.0 else -law.force)
    return FrictionStep(mean, free + gain * mean, False, share, first)


def _from_rest(holding: float, free: float, gain: float, law: CoulombFriction, held: float | None) -> FrictionStep:
    slope = 0.0 if held is None or law.breakaway == law.force else holding - held
    start, end = holding - 0.5 * slope, holding + 0.5 * slope
    if max(abs(start), abs(end)) <= law.breakaway:
        return FrictionStep(holding, 0.0, True, 0.0, holding)
    sign = 1.0 if (end if abs(end) > abs(start) else start) > 0.0 else -1.0
    share = 0.0
    if sign * start < law.breakaway and slope != 0.0:
        share = min(max((sign * law.breakaway - start) / slope, 0.0), 1.0)
    mean = share * (start + 0.5 * share * slope) + (1.0 - share) * sign * law.force
    velocity = free + gain * mean
    if velocity * sign >= 0.0:
        return FrictionStep(holding, 0.0, True, 0.0, holding)
    return FrictionStep(mean, velocity, False, 0.0, holding)
