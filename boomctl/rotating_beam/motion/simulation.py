"""Simulation problem of a hub-beam, and its first steps."""

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from math import ceil, log2
from typing import final

import numpy as np

from boomctl.arrays import Array
from boomctl.exceptions import SimulationError
from boomctl.maneuvers import HubProfile, Maneuver, PrescribedMotion, Torque, TorqueDriven
from boomctl.rotating_beam.jumps import steps_resolving
from boomctl.rotating_beam.modal.equations import Equations
from boomctl.rotating_beam.motion.problems import PrescribedProblem, Problem, TorqueDrivenProblem
from boomctl.rotating_beam.motion.refinement import Accuracy
from boomctl.rotating_beam.motion.steady_rotation import SteadyRotation, steady_rotation

_WATCHED = 16.0  # Watched times in a period of the lowest mode: its phase changes by 22 degrees between two.
_CAUTION = 2.0  # Largest error over the difference of two levels of steps where a user's function has a kink.
_LONGEST = 3e5  # Longest motion, in radians of the slowest mode; limits time and memory.
# First step times the lowest frequency of the beam, for vibrations in closed form: nearly a period.  It is shorter for a
# tolerance below `_LOOSE`, by a root of the ratio, so that one or two halvings suffice.
_PHASE, _LOOSE, _ROOT = 5.5, 1e-6, 7.0
_PHASE_GRADED = 1.4  # First step times the lowest frequency, for polynomials: a quarter of a period.


@final
@dataclass(frozen=True, eq=False)
class Simulation:
    """Simulation problem: equations, maneuver, requested times, initial state and tolerances.

    Attributes
    ----------
    equations : Equations
    maneuver : PrescribedMotion or TorqueDriven
    timepts : ndarray, k
        Requested times, s.
    start : pair of ndarray, N
        Coordinates and rates of hub and beam at t = 0.
    rtol, atol : float
        Limit ``atol + rtol max |displacement|`` [m] on the errors of the free end's displacement and of the hub angle times
        the radius.
    length : float
        Length of the beam, m.
    radius : float
        Distance of the free end from the axis, m.
    """

    equations: Equations
    maneuver: Maneuver
    timepts: Array
    start: tuple[Array, Array]
    rtol: float
    atol: float
    length: float
    radius: float

    @property
    def end(self) -> float:
        """Last requested time, s."""
        return float(self.timepts[-1])

    @property
    def beam(self) -> tuple[Array, Array]:
        """Coordinates and rates of the beam at t = 0."""
        return self.start[0][1:], self.start[1][1:]

    @property
    def tip_rows(self) -> Array:
        """Displacements of the free end over the beam's coordinates, with one common largest value, 2 x (N - 1)."""
        return np.array([self.equations.tip.transverse, self.equations.tip.axial])

    @cached_property
    def problem(self) -> Problem:
        """Equations to be solved by collocation."""
        if isinstance(self.maneuver, PrescribedMotion):
            return PrescribedProblem(self.equations, self.maneuver)
        return TorqueDrivenProblem(self.equations, self.maneuver)

    @cached_property
    def steady(self) -> SteadyRotation | None:
        """Closed form of the motion once the hub speed is constant; None if it never is, or no closed form exists."""
        maneuver, terms = self.maneuver, self.equations.beam_speed_terms
        if terms is None or isinstance(maneuver, TorqueDriven) or maneuver.steady_from >= self.end > 0.0:
            return None
        return steady_rotation(terms, maneuver)

    @cached_property
    def watched(self) -> Array:
        """Requested times, with further times from 0 on that resolve the vibration of the lowest mode."""
        timepts = self.timepts
        gap = 2.0 * np.pi / self.equations.frequency_range[0] / _WATCHED
        if max(timepts[0], (timepts[1:] - timepts[:-1]).max(initial=0.0)) <= gap:
            return timepts
        return np.union1d(timepts, np.linspace(0.0, self.end, int(np.ceil(self.end / gap)) + 1))

    @property
    def user_defined(self) -> bool:
        """True if the maneuver consists of a user's functions, which may be discontinuous between breakpoints."""
        return isinstance(self.maneuver, HubProfile | Torque)

    @property
    def caution(self) -> float:
        """Largest error of a motion over the difference of two levels of steps."""
        return _CAUTION if self.user_defined else 1.0

    def accuracy(self, rows: tuple[Array, ...]) -> Accuracy:
        """Return the accuracy to which two levels of steps must agree."""
        return Accuracy(self.rtol / self.caution, self.atol / self.caution, rows)

    def first_steps(self, end: float, *, graded: bool) -> Array:
        """Return the ends of the coarsest steps up to a time [s]: equal between breakpoints; short at a function's jumps.

        Graded after breakpoints, down to the time scale of the highest mode, steps resolve the vibrations excited there:
        for polynomials, which on two levels of steps, both too coarse for the vibrations, could agree without them.
        Vibrations in closed form may start from longer, equal steps.

        Raises
        ------
        SimulationError
            If the motion is far too long.
        """
        lowest, highest = self.equations.frequency_range
        if end * lowest > _LONGEST:
            raise SimulationError(
                f"the motion until t = {end:g} s is {end * lowest:.2g} radians of the slowest mode; expected at most "
                f"{_LONGEST:g}, which is about {_LONGEST / lowest:.2g} s here"
            )
        phase = _PHASE_GRADED if graded else _PHASE * min(1.0, self.rtol / _LOOSE) ** (1.0 / _ROOT)
        corners = [0.0, *(item for item in self.maneuver.breakpoints if 0.0 < item < end), end]
        parts: list[Array] = [np.zeros(1)]
        for left, right in pairwise(corners):
            count = max(1, ceil((right - left) * lowest / phase))
            if graded:
                halvings = max(0, ceil(log2((right - left) / count * highest / phase)))
                parts.append(left + (right - left) / count * 0.5 ** np.arange(halvings, 0, -1))
            parts.append(right - (right - left) / count * np.arange(count - 1, -1, -1))
        edges = np.concatenate(parts)
        return steps_resolving(edges, self.problem.drive) if self.user_defined else edges
