"""Definition of a slew problem, with checks of its arguments and of its feasibility."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import block_diag

from boomctl.arrays import Array
from boomctl.checks import (
    exactly,
    finite_array,
    from_on,
    known,
    nonnegative,
    positive,
    real,
    sequence,
    warn_user,
    whole,
)
from boomctl.exceptions import SlewError
from boomctl.lti.hold import matrix_expm1
from boomctl.lti.rounding import ALIKE
from boomctl.printing import compact
from boomctl.slew.deadline import SlewDeadline
from boomctl.slew.objectives import OBJECTIVES
from boomctl.slew.plant import LABELS, SlewPlant, is_machine, plant_of

RTOL = 1e-6  # Default relative tolerance of the end state, and of scaled constraints.
_RTOL_AXIAL = 1e-4  # Default for models with axial modes: about the error of planning without them.
MESHES = (50, 100, 200, 400, 800)  # numbers of intervals, in order
MESH_GAP = 1e-4  # relative change of the cost by a halved mesh at which refinement stops
ROUNDS = 10  # solutions on a mesh at most, with tighter limits in each
_TIGHTER, _AT_LEAST = 1.1, 1e-6  # factor on the relative excess, and offset, by which a limit is tightened
AT_LIMIT = 0.999  # fraction of a limit above which it counts as active
_START_FRACTION = 0.1  # initial guess of the time to bring a state to rest, as a fraction of the slowest time constant
_LEAST = 1e-9  # shortest initial guess of a time [s]: keeps logarithms finite
_MOST_PERIODS = 100  # longest slew in periods of a beam's slowest vibration: limits the run time of searches
_SHORTER = 0.9  # fraction of the rigid body's least time accepted for a beam, whose inertia decreases in bending


@dataclass(frozen=True)
class Limits:
    """Limits of a slew; None for no limit.

    Attributes
    ----------
    torque : float
        Absolute torque, N m.
    torque_rate : float or None
        Derivative of the torque, N m/s.
    speed : float or None
        Hub speed, rad/s.
    tip : float or None
        Tip displacement, m.
    moment : float or None
        Bending moment at the clamp, N m.
    """

    torque: float
    torque_rate: float | None = None
    speed: float | None = None
    tip: float | None = None
    moment: float | None = None

    def __post_init__(self) -> None:
        for kind, value in vars(self).items():
            if value is not None or kind == "torque":
                object.__setattr__(self, kind, positive(f"{kind}_limit", value))

    @property
    def by_kind(self) -> dict[str, float]:
        """Limits by kind, the torque's first."""
        return {kind: value for kind, value in vars(self).items() if value is not None}

    @property
    def without_torque(self) -> dict[str, float]:
        """Limits other than the torque's, by kind."""
        return {kind: value for kind, value in self.by_kind.items() if kind != "torque"}

    def most(self, kind: str) -> float:
        """Return the limit of a kind; infinite if there is none."""
        return self.by_kind.get(kind, math.inf)

    def tightened(self, excess: Mapping[str, float]) -> Limits:
        """Return limits reduced by the relative excess of a motion; the torque limit is unchanged."""
        smaller = {
            kind: limit / (1.0 + _TIGHTER * excess[kind] + _AT_LEAST * (excess[kind] > 0.0))
            for kind, limit in self.without_torque.items()
        }
        return replace(self, **smaller)


@dataclass(frozen=True, eq=False)
class SlewProblem:
    """A slew, in the coordinates of its plants.

    Attributes
    ----------
    plants : tuple of SlewPlant
        The plant to slew, then the same with other payloads, which must come to rest.
    objective : str
    duration : float or None
        Duration, s; None for minimum time.
    limits : Limits
    angle : float or None
        Slew angle, rad; None if free.
    final_speed : float
        Hub speed at the end, rad/s.
    start, target : ndarray, n
        Initial and terminal coordinates of all plants.
    ends : ndarray, m x n
        Rows of the state that are prescribed at the end.
    can_wait : bool
        True if start or target is an equilibrium.
    rtol : float
    intervals : int or None
    tip_masses : tuple of float
        Tip masses of the other payloads, kg.
    deadline : SlewDeadline
        Time limit and progress callback of the search.
    """

    plants: tuple[SlewPlant, ...]
    objective: str
    duration: float | None
    limits: Limits
    angle: float | None
    final_speed: float
    start: Array
    target: Array
    ends: Array
    can_wait: bool
    rtol: float
    intervals: int | None
    tip_masses: tuple[float, ...] = ()
    deadline: SlewDeadline = field(default_factory=SlewDeadline)

    __repr__ = compact

    @cached_property
    def parts(self) -> tuple[tuple[SlewPlant, slice], ...]:
        """Plants with their slices of the joint coordinates."""
        lasts = itertools.accumulate(plant.n for plant in self.plants)
        return tuple((plant, slice(last - plant.n, last)) for plant, last in zip(self.plants, lasts, strict=True))

    @property
    def is_bang_bang(self) -> bool:
        """True for minimum time under the torque limit only: the torque is bang-bang."""
        return self.objective == "time" and not self.limits.without_torque

    @property
    def ramps(self) -> bool:
        """True for a continuous torque, linear on intervals; otherwise it is held there."""
        return OBJECTIVES[self.objective].continuous or self.limits.torque_rate is not None

    @property
    def linear(self) -> bool:
        """True if the plant is a linear system."""
        return self.plants[0].machine is None

    @property
    def stretches(self) -> bool:
        """True if the beam has axial modes, which planning neglects."""
        return bool(self.plants[0].axial.size)

    @property
    def planning_rtol(self) -> float:
        """Tolerance of the end state in planning, without the effect of axial modes."""
        return min(self.rtol, RTOL) if self.stretches else self.rtol

    @property
    def fastest_vibration(self) -> float:
        """Frequency of the fastest vibration, rad/s."""
        return max(float(np.abs(plant.poles.imag).max()) for plant in self.plants)

    @cached_property
    def A(self) -> Array:
        """Linear part of all plants."""
        return block_diag(*[plant.A for plant in self.plants])

    @cached_property
    def B(self) -> Array:
        """Input vector of all plants."""
        return np.concatenate([plant.B for plant in self.plants])

    @cached_property
    def turn(self) -> float:
        """Absolute slew angle, rad; 0 if it is free."""
        first, own = self.parts[0]
        # rounding error relative to a state
        if not np.any(np.abs(self.ends[:, own] @ first.rest(1.0, 0.0)) > ALIKE):
            return 0.0
        return abs(float(first.rows["angle"] @ (self.target - self.start)[own]))

    @cached_property
    def rigid_time(self) -> float:
        """Time scale, s: the least time of the rigid body with the plant's inertia for the angle, or for the speed.

        Without inertia it is a fraction of the slowest time constant; an initial vibration takes at least one of its period.
        If neither start nor target is an equilibrium, more time may be infeasible: the estimate is then low.
        """
        first, own = self.parts[0]
        if first.inertia is None:
            slowest = _START_FRACTION / first.slowest if self.can_wait else 0.0
            return slowest or 1.0 / float(np.linalg.norm(first.A, 2))
        start, end = self.start[own], self.target[own]
        turn, change = self.turn, abs(float(first.rows["speed"] @ (end - start)))
        torque = self.limits.torque / first.inertia
        if self.can_wait:
            rigid = max(2.0 * math.sqrt(turn / torque), change / torque)
            return rigid if first.still(start) else max(rigid, _START_FRACTION / first.slowest, _LEAST)
        fast = max(abs(float(first.rows["speed"] @ z)) for z in (start, end))
        dash = 2.0 * turn / (fast + math.sqrt(fast**2 + 2.0 * torque * turn)) if turn > 0.0 else 0.0
        return max(0.5 * dash, change / torque, _START_FRACTION / first.slowest, _LEAST)


def warn_of_turns(angle: float) -> None:
    """Warn if an angle exceeds one revolution [rad]: it may be in degrees."""
    if abs(angle) > math.tau:
        warn_user(
            f"angle = {angle:g} rad: {angle / math.tau:.3g} turns; {angle:g} degrees (angle_deg = {angle:g} in"
            f" optimal_slew) are {math.radians(angle):.3g} rad"
        )


def slew_problem(
    h: object,
    angle: float | None,
    limits: Limits,
    objective: str = "time",
    duration: float | None = None,
    *,
    final_speed: float = 0.0,
    initial_state: ArrayLike | None = None,
    final_state: ArrayLike | None = None,
    tip_masses: tuple[float, ...] = (),
    rtol: float | None = None,
    intervals: int | None = None,
    deadline: SlewDeadline | None = None,
) -> SlewProblem:
    """Check the arguments of `optimal_slew` and build the problem."""
    known("objective", objective, OBJECTIVES)
    if (duration is None) != (objective == "time"):
        raise ValueError(
            f"duration = {duration!r}: expected none with objective 'time'"
            if objective == "time"
            else f"duration = None: expected a duration [s] with objective {objective!r}"
        )
    masses = tuple(nonnegative("tip_masses", mass) for mass in sequence("tip_masses", tip_masses, "masses in kg"))
    plants = _plants(h, masses)
    for kind, output in (("tip", "tip_displacement"), ("moment", "root_moment")):
        limited = kind in limits.by_kind or (kind == "tip" and OBJECTIVES[objective].bounds_tip)
        if limited and kind not in plants[0].rows:
            raise ValueError(f"{kind}_limit: the system has no output {output!r}; name one so, or leave the limit out")
    turn, speed = None if angle is None else real("angle", angle), real("final_speed", final_speed)
    start, target, ends, waits = _end_conditions(plants, turn, speed, initial_state, final_state)
    default = _RTOL_AXIAL if plants[0].axial.size else RTOL
    problem = SlewProblem(
        plants=plants,
        objective=objective,
        duration=None if duration is None else positive("duration", duration),
        limits=limits,
        angle=turn,
        final_speed=speed,
        start=start,
        target=target,
        ends=ends,
        can_wait=waits,
        rtol=default if rtol is None else positive("rtol", rtol),
        intervals=None if intervals is None else whole("intervals", intervals, 4),
        tip_masses=masses,
        deadline=SlewDeadline() if deadline is None else deadline,
    )
    _check_feasible(problem)
    return problem


def _plants(h: object, masses: tuple[float, ...]) -> tuple[SlewPlant, ...]:
    """Return the plant, and the plants with other payloads without duplicates."""
    first = plant_of(h)
    if not masses:
        return (first,)
    if not is_machine(h):
        raise ValueError("tip_masses: expected none for a linear system; they are of a hub-beam")
    others = (plant_of(h.with_tip_mass(mass)) for mass in dict.fromkeys(masses))
    return (first, *(item for item in others if not np.array_equal(item.A, first.A)))


def _end_conditions(
    plants: tuple[SlewPlant, ...],
    angle: float | None,
    final_speed: float,
    initial: ArrayLike | None,
    final: ArrayLike | None,
) -> tuple[Array, Array, Array, bool]:
    """Return start, target, prescribed rows of the end, and whether start or target is an equilibrium."""
    first = plants[0]
    if final is not None and final_speed != 0.0:
        raise ValueError("final_state: expected None with final_speed; give one of the two")

    def checked_state(name: str, value: ArrayLike) -> Array:
        x = finite_array(name, value, 1)
        if first.machine is not None:
            raise ValueError(f"{name}: expected None for a hub-beam, which begins at rest and ends in steady rotation")
        if x.size != first.n:
            raise ValueError(f"{name}: expected {first.n} numbers, one a state, got {x.size}")
        return first.from_state @ x

    start = first.rest(0.0, 0.0) if initial is None else checked_state("initial_state", initial)
    begin = float(first.rows["angle"] @ start)
    rested = first.rest(begin + (angle or 0.0), final_speed)
    target = rested if final is None else checked_state("final_state", final)
    led = float(first.rows["angle"] @ target) - begin
    # rounding of printed states is accepted
    if final is not None and angle is not None and abs(led - angle) > ALIKE * max(abs(led), abs(angle)):
        raise ValueError(
            f"angle = {angle!r}: expected None or {first.with_unit('angle', f'{led:.9g}')}, as the final_state has it; "
            "it is given by both"
        )
    rows = np.eye(first.n)
    if angle is None and final is None:  # the angle is free: rows across the direction of rest
        rows = np.linalg.svd(first.rest(1.0, 0.0)[None, :])[2][1:]
    others = [np.delete(np.eye(plant.n), [0, plant.n // 2], axis=0) for plant in plants[1:]]
    starts = [start, *(plant.rest(0.0, 0.0) for plant in plants[1:])]
    targets = [target, *(plant.rest(angle or 0.0, final_speed) for plant in plants[1:])]
    still = first.still(start) or first.still(target)
    return np.concatenate(starts), np.concatenate(targets), block_diag(rows, *others), still


def _check_feasible(problem: SlewProblem) -> None:
    """Check conditions that need no search: states differ and are within limits, a rigid body's least times."""
    (plant, own), T, limits = problem.parts[0], problem.duration, problem.limits
    alone = problem.start if T is None else problem.start + matrix_expm1(T * problem.A) @ problem.start
    scale = np.abs(problem.ends) @ np.maximum(np.abs(alone), np.abs(problem.target))
    if np.all(np.abs(problem.ends @ (alone - problem.target)) <= ALIKE * scale):
        if T is None or problem.can_wait:
            raise ValueError(
                "angle: the plant is at its end state already; expected another angle (or angle_deg), speed or state"
            )
        raise ValueError("duration: the plant comes to its end state by itself; expected a slew that needs a torque")
    last = "final_speed" if problem.final_speed else "final_state"
    for name, state, t in (("initial_state", problem.start, "0"), (last, problem.target, "t_f")):
        for kind in (kind for kind in limits.by_kind if kind in plant.rows):
            size = abs(float(plant.rows[kind] @ state[own]))
            if size > limits.most(kind) * (1.0 + ALIKE):
                raise SlewError(
                    f"{kind}_limit = {plant.with_unit(kind, f'{limits.most(kind):g}')}: the {name} has"
                    f" {plant.with_unit(kind, f'{size:.4g}')} at t = {t}; expected states within the limit"
                )
    least, what = (problem.rigid_time, "angle") if T is None else (T, "duration")
    if plant.frequencies is not None and least > _MOST_PERIODS * plant.period:
        value = problem.angle if what == "angle" and problem.angle is not None else least
        raise ValueError(
            f"{what} = {exactly(value)}: the slew lasts about {least:.4g} s, {least / plant.period:.3g} periods of the"
            f" slowest vibration; expected at most {_MOST_PERIODS}: a nearer end, or a larger torque_limit"
        )
    if T is None:
        return
    if problem.turn > limits.most("speed") * T:
        raise SlewError(
            f"duration = {exactly(T)} s: too short for {_turn(problem, problem.turn)} at speed_limit ="
            f" {plant.with_unit('speed', exactly(limits.most('speed')))}, which takes at least"
            f" {from_on(problem.turn / limits.most('speed'))} s"
        )
    if problem.can_wait and plant.inertia is not None:
        _check_duration(problem, T, plant.inertia)


def _turn(problem: SlewProblem, turn: float) -> str:
    """Return a slew angle in words."""
    name, unit = problem.plants[0].labels["angle"]
    return f"{turn:g} {unit}" if unit else f"a change of {name} by {turn:g}"


def _check_duration(problem: SlewProblem, T: float, inertia: float) -> None:
    """Check a duration against a rigid body's least times, less a tenth: a beam that bends may have a little less inertia."""
    plant, own = problem.parts[0]
    turn, change = problem.turn, abs(float(plant.rows["speed"] @ (problem.target - problem.start)[own]))
    if problem.angle is None or change or np.any(np.abs(plant.rows["speed"] @ problem.start[own]) > 0.0):
        turn = 0.0
    margin = 1.0 - 1e-12 if problem.linear else _SHORTER  # rounding error only for a linear plant
    around = _turn(problem, turn)
    faster = f"a change of {plant.with_unit('speed', f'{change:g}')}"
    body = f"{inertia:.4g} kg m^2" if plant.labels is LABELS else f"inertia {inertia:.4g}"
    torque, rate = (problem.limits.most(kind) for kind in ("torque", "torque_rate"))
    # a rigid body's least times under a limit, and the limit that suffices
    for what, least, kind, needed in (
        (around, (32.0 * turn * inertia / rate) ** (1 / 3), "torque_rate", 32.0 * inertia * turn / T**3),
        (faster, 2.0 * math.sqrt(inertia * change / rate), "torque_rate", 4.0 * inertia * change / T**2),
        (around, 2.0 * math.sqrt(turn * inertia / torque), "torque", 4.0 * inertia * turn / T**2),
        (faster, inertia * change / torque, "torque", inertia * change / T),
    ):
        if margin * least > T:
            raise SlewError(
                f"duration = {exactly(T)} s: too short for {what}; a rigid body of {body} takes {from_on(least)} s"
                f" at {kind}_limit = {plant.with_unit(kind, exactly(problem.limits.most(kind)))}, or needs"
                f" {plant.with_unit(kind, from_on(needed))}"
            )
