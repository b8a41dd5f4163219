"""What feedback along a slew is worth: machines that differ from the planned one, with and without it."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from boomctl.printing import compact
from boomctl.slew.tracking.monte_carlo import TrackingStudy
from boomctl.slew.tracking.tracked import TrackedSlew

_RTOL, _ATOL = 1e-7, 1e-9  # of motions in which errors of millimetres are looked for (a choice)


@dataclass(frozen=True)
class Spread:
    """How machines may differ from the one planned for: what `TrackedSlew.monte_carlo` draws.

    Parameters
    ----------
    stiffness : float
        Half-width of what multiplies the bending stiffness, around one.
    tip_mass, friction : (float, float)
        Ends of the ranges of the tip mass [kg] and of the torque of friction on the hub [N m].

    Examples
    --------
    >>> import boomctl as bc
    >>> bc.studies.slew.Spread(stiffness=0.1, tip_mass=(0.0, 0.05), friction=(0.0, 2.0)).stiffness
    0.1
    """

    stiffness: float
    tip_mass: tuple[float, float]
    friction: tuple[float, float]


@dataclass(frozen=True, eq=False)
class FeedbackLine:
    """One machine that follows a slew.

    Attributes
    ----------
    machine : str
        What it is, in words.
    open_vibration, vibration : float
        Largest distance of the tip from the plan after the end, by the plan alone and with feedback [m].
    open_angle_error, angle_error : float
        Of the hub at the last instant [rad].
    """

    machine: str
    open_vibration: float
    vibration: float
    open_angle_error: float
    angle_error: float

    __repr__ = compact

    @property
    def ratio(self) -> float:
        """By how many times feedback makes the vibration smaller."""
        return self.open_vibration / self.vibration


@dataclass(frozen=True, eq=False)
class FeedbackStudy:
    """What feedback along a slew is worth.

    Attributes
    ----------
    lines : tuple of FeedbackLine
        The machine planned for, then others.
    open, closed : TrackingStudy
        Many machines, by the plan alone and with feedback: the same ones.
    """

    lines: tuple[FeedbackLine, ...]
    open: TrackingStudy
    closed: TrackingStudy

    __repr__ = compact

    @property
    def stiffness_ratio(self) -> float:
        """The least ratio among machines that differ in their stiffness alone."""
        return min(line.ratio for line in self.lines if line.machine.startswith("stiffness"))

    @property
    def verdict(self) -> str:
        """What it is worth, in words."""
        before, after = (float(np.quantile(each.vibration, 0.95)) for each in (self.open, self.closed))
        return (
            f"with feedback a stiffness that is wrong leaves at most 1/{int(self.stiffness_ratio)} of the vibration; of "
            f"{self.closed.vibration.size} machines drawn 95 % stay below {1e3 * after:.0f} mm, without feedback below "
            f"{1e3 * before:.0f} mm"
        )


def judged(tracked: TrackedSlew, spread: Spread, runs: int) -> FeedbackStudy:
    """Follow a slew by the machine planned for, by the ends of the spread one at a time, and by many drawn.

    Parameters
    ----------
    tracked : TrackedSlew
    spread : Spread
    runs : int
        How many are drawn.
    """
    nominal, off = tracked.machine.parameters.tip_mass, spread.stiffness
    machines = {
        "as planned": {},
        f"stiffness \u2212{100 * off:g} %": {"stiffness": 1.0 - off},
        f"stiffness +{100 * off:g} %": {"stiffness": 1.0 + off},
        **{f"tip mass {mass:g} kg": {"tip_mass": mass} for mass in spread.tip_mass if mass != nominal},
        **{f"friction {each:g} N m": {"friction": each} for each in spread.friction if each},
    }
    normal = {"stiffness": 1.0, "friction": 0.0, "tip_mass": nominal}
    asked = {name: [each.get(name, value) for each in machines.values()] for name, value in normal.items()}
    free, held = _both(tracked, len(machines), asked)
    found = zip(free.vibration, held.vibration, np.abs(free.angle_error), np.abs(held.angle_error), strict=True)
    lines = tuple(FeedbackLine(name, *numbers) for name, numbers in zip(machines, found, strict=True))
    return FeedbackStudy(lines, *_both(tracked, runs, vars(spread)))


def _both(tracked: TrackedSlew, runs: int, asked: Mapping[str, Any]) -> tuple[TrackingStudy, TrackingStudy]:
    """Without and with feedback."""
    free, held = (tracked.monte_carlo(runs, feedback=on, **asked) for on in (False, True))
    return free, held


@dataclass(frozen=True)
class Followed:
    """A slew followed by a beam with another tip mass [kg], without feedback (open) and with it.

    The angle errors are absolute, at the last instant [rad]; the swings are the largest tip displacements in the last slowest
    period [m].
    """

    tip_mass: float
    final_angle_error: float
    open_final_angle_error: float
    tip_swing: float
    open_tip_swing: float


def followed(tracked: TrackedSlew, tip_mass: float) -> Followed:
    """Follow a slew by a beam with another tip mass.

    Parameters
    ----------
    tracked : TrackedSlew
    tip_mass : float
        kg.
    """
    late = tracked.time >= tracked.time[-1] - tracked.period
    found = {}
    for opening in ("", "open_"):
        run = tracked.simulate(tracked.machine.with_tip_mass(tip_mass), feedback=not opening, rtol=_RTOL, atol=_ATOL)
        error = abs(run["hub_angle"][-1] - tracked.reference["hub_angle"][-1])
        found[f"{opening}final_angle_error"] = float(error)
        found[f"{opening}tip_swing"] = float(np.abs(run["tip_displacement"][late]).max())
    return Followed(tip_mass, **found)
