"""What is asked of a slew, checked at the boundary, and refused where no torque can do it."""

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

_RTOL = 1e-6  # Error of the end by default.
_RTOL_AXIAL = 1e-4  # Of models with axial modes by default: the least that planning without them keeps.
MESHES = (50, 100, 200, 400, 800)  # intervals tried, the coarsest and the finest a choice; each halves those before
MESH_GAP = 1e-4  # relative change of the cost by a halved mesh that is accepted: what a user would see
ROUNDS = 10  # solutions on a mesh at most, with a higher order or tighter limits each; a safeguard
_TIGHTER, _AT_LEAST = 1.1, 1e-6  # by how many times an excess, and how much more, a limit is tightened
AT_LIMIT = (
    0.999  # share of a limit from which it counts as met, in words and where a solver keeps bounds to 1e-7 (a choice)
)
_SHARE = 0.1  # of the slowest time constant: what bringing a state to rest takes at least, as a first guess; a choice
_LEAST = 1e-9  # [s], a first guess of a time is never shorter: it only keeps logarithms finite
_MOST_PERIODS = 100  # of a beam's slowest vibration that a slew may last: searches would take hours beyond (a choice)
_SHORTER = 0.9  # share of the rigid body's time that a beam is left: bent, it has a little less inertia; a choice


@dataclass(frozen=True)
class Limits:
    """What a slew may not exceed; None where there is no limit.

    Attributes
    ----------
    torque : float
        N m.
    torque_rate : float or None
        Of the torque's slope, N m/s.
    speed : float or None
        Of the hub, rad/s.
    tip : float or None
        Displacement, m.
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
    def given(self) -> dict[str, float]:
        """The limits that there are, by kind, the torque's first."""
        return {kind: value for kind, value in vars(self).items() if value is not None}

    @property
    def beside_torque(self) -> dict[str, float]:
        """The limits that there are beside the torque's, by kind."""
        return {kind: value for kind, value in self.given.items() if kind != "torque"}

    def most(self, kind: str) -> float:
        """Return the limit of a kind; infinite where there is none."""
        return self.given.get(kind, math.inf)

    def tightened(self, excess: Mapping[str, float]) -> Limits:
        """Return limits beside the torque's that are smaller where a motion exceeds one, by shares of it."""
        smaller = {
            kind: limit / (1.0 + _TIGHTER * excess[kind] + _AT_LEAST * (excess[kind] > 0.0))
            for kind, limit in self.beside_torque.items()
        }
        return replace(self, **smaller)


@dataclass(frozen=True, eq=False)
class SlewProblem:
    """A slew, in the coordinates of its plants.

    Attributes
    ----------
    plants : tuple of SlewPlant
        The one that is to arrive, then the same with other payloads, which are to come to rest.
    objective : str
    duration : float or None
        s; None of minimum time.
    limits : Limits
    angle : float or None
        Turned through, rad; None if free.
    final_speed : float
        rad/s.
    start, target : ndarray, n
        Of all plants, in their coordinates.
    ends : ndarray, m x n
        Rows of the state that are prescribed at the end.
    waits : bool
        Whether the plant can wait at its start or its target.
    rtol : float
    intervals : int or None
    tip_masses : tuple of float
        Of the other payloads, kg.
    deadline : SlewDeadline
        How long it may be sought, and who is told.
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
    waits: bool
    rtol: float
    intervals: int | None
    tip_masses: tuple[float, ...] = ()
    deadline: SlewDeadline = field(default_factory=SlewDeadline)

    __repr__ = compact

    @cached_property
    def parts(self) -> tuple[tuple[SlewPlant, slice], ...]:
        """Plants with their places in the coordinates of all."""
        lasts = itertools.accumulate(plant.n for plant in self.plants)
        return tuple((plant, slice(last - plant.n, last)) for plant, last in zip(self.plants, lasts, strict=True))

    @property
    def fastest(self) -> bool:
        """Whether the least time is asked for under the torque's limit alone: the torque is bang-bang then."""
        return self.objective == "time" and not self.limits.beside_torque

    @property
    def ramps(self) -> bool:
        """Whether the torque is to be continuous and straight on intervals; else it is held there."""
        return OBJECTIVES[self.objective].continuous or self.limits.torque_rate is not None

    @property
    def linear(self) -> bool:
        """Whether what is slewed is a linear system."""
        return self.plants[0].machine is None

    @property
    def stretches(self) -> bool:
        """Whether beams have axial modes, without which they are planned."""
        return bool(self.plants[0].axial.size)

    @property
    def planning_rtol(self) -> float:
        """Error of the end that planning allows; what axial modes add to it is left."""
        return min(self.rtol, _RTOL) if self.stretches else self.rtol

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
        """What the torque pushes."""
        return np.concatenate([plant.B for plant in self.plants])

    @cached_property
    def rigid_time(self) -> float:
        """A time scale, s: the least time of the rigid body with this inertia for this turn, or for this speed.

        A plant without inertia has a time constant of its own; a vibration at the start takes at least a part of its period.
        Where the plant can wait neither at start nor target, more time may be of no use: a time that is hardly enough.
        """
        first, own = self.parts[0]
        if first.inertia is None:
            return 1.0 / float(np.linalg.norm(first.A, 2))
        start, end = self.start[own], self.target[own]
        turn, change = (abs(float(first.rows[name] @ (end - start))) for name in ("angle", "speed"))
        # share of a state's size that counts as nothing
        if not np.any(np.abs(self.ends[:, own] @ first.rest(1.0, 0.0)) > ALIKE):
            turn = 0.0
        torque = self.limits.torque / first.inertia
        if self.waits:
            rigid = max(2.0 * math.sqrt(turn / torque), change / torque)
            return rigid if first.still(start) else max(rigid, _SHARE / first.slowest, _LEAST)
        fast = max(abs(float(first.rows["speed"] @ z)) for z in (start, end))
        dash = 2.0 * turn / (fast + math.sqrt(fast**2 + 2.0 * torque * turn)) if turn > 0.0 else 0.0
        return max(0.5 * dash, change / torque, _SHARE / first.slowest, _LEAST)


def warn_of_turns(angle: float) -> None:
    """Warn where a beam is to turn further than once round [rad]: that may be an angle in degrees."""
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
    """Check and put together what is asked; the arguments are those of `optimal_slew`."""
    known("objective", objective, OBJECTIVES)
    if (duration is None) != (objective == "time"):
        raise ValueError(
            f"duration = {duration!r}: expected none with objective 'time'"
            if objective == "time"
            else f"duration = None: expected a number of seconds with objective {objective!r}"
        )
    masses = tuple(nonnegative("tip_masses", mass) for mass in sequence("tip_masses", tip_masses, "masses in kg"))
    plants = _plants(h, masses)
    for kind, output in (("tip", "tip_displacement"), ("moment", "root_moment")):
        limited = kind in limits.given or (kind == "tip" and OBJECTIVES[objective].bounds_tip)
        if limited and kind not in plants[0].rows:
            raise ValueError(f"{kind}_limit: the system has no output {output!r}; name one so, or leave the limit out")
    turn, speed = None if angle is None else real("angle", angle), real("final_speed", final_speed)
    start, target, ends, waits = _end_conditions(plants, turn, speed, initial_state, final_state)
    default = _RTOL_AXIAL if plants[0].axial.size else _RTOL
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
        waits=waits,
        rtol=default if rtol is None else positive("rtol", rtol),
        intervals=None if intervals is None else whole("intervals", intervals, 4),
        tip_masses=masses,
        deadline=SlewDeadline() if deadline is None else deadline,
    )
    _check_feasible(problem)
    return problem


def _plants(h: object, masses: tuple[float, ...]) -> tuple[SlewPlant, ...]:
    """The plant and its like with other payloads; one that is there already would come to rest by itself."""
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
    """Start, target, prescribed rows of the end, and whether the plant can wait at either."""
    first = plants[0]
    if final is not None and final_speed != 0.0:
        raise ValueError("final_state: expected None beside final_speed; give one of the two")

    def given(name: str, value: ArrayLike) -> Array:
        x = finite_array(name, value, 1)
        if first.machine is not None:
            raise ValueError(f"{name}: expected None for a hub-beam, which begins at rest and ends in steady rotation")
        if x.size != first.n:
            raise ValueError(f"{name}: expected {first.n} numbers, one a state, got {x.size}")
        return first.from_state @ x

    start = first.rest(0.0, 0.0) if initial is None else given("initial_state", initial)
    begin = float(first.rows["angle"] @ start)
    rested = first.rest(begin + (angle or 0.0), final_speed)
    target = rested if final is None else given("final_state", final)
    led = float(first.rows["angle"] @ target) - begin
    # share of a limit by which given states may exceed it: rounding of what users print and read again
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
    """Check what needs no search: a slew that leads somewhere, states within the limits, a rigid body's least times."""
    (plant, own), T, limits = problem.parts[0], problem.duration, problem.limits
    alone = problem.start if T is None else problem.start + matrix_expm1(T * problem.A) @ problem.start
    scale = np.abs(problem.ends) @ np.maximum(np.abs(alone), np.abs(problem.target))
    if np.all(np.abs(problem.ends @ (alone - problem.target)) <= ALIKE * scale):
        if T is None or problem.waits:
            raise ValueError("angle: the plant is at its end state already; expected a slew that leads somewhere")
        raise ValueError("duration: the plant comes to its end state by itself; expected a slew that needs a torque")
    last = "final_speed" if problem.final_speed else "final_state"
    for name, state, t in (("initial_state", problem.start, "0"), (last, problem.target, "t_f")):
        for kind in (kind for kind in limits.given if kind in plant.rows):
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
    if T is not None and problem.waits and plant.inertia is not None:
        _check_duration(problem, T, plant.inertia)


def _check_duration(problem: SlewProblem, T: float, inertia: float) -> None:
    """Check a duration against a rigid body's least times, less a tenth: a beam that bends may have a little less inertia."""
    plant, own = problem.parts[0]
    turn, change = (abs(float(plant.rows[name] @ (problem.target - problem.start)[own])) for name in ("angle", "speed"))
    if problem.angle is None or change or np.any(np.abs(plant.rows["speed"] @ problem.start[own]) > 0.0):
        turn = 0.0
    margin = 1.0 - 1e-12 if problem.linear else _SHORTER  # rounding alone where the plant is what it seems
    name, unit = plant.labels["angle"]
    around = f"{turn:g} {unit}" if unit else f"a change of {name} by {turn:g}"
    faster = f"a change of {plant.with_unit('speed', f'{change:g}')}"
    body = f"{inertia:.4g} kg m^2" if plant.labels is LABELS else f"inertia {inertia:.4g}"
    torque, rate, speed = (problem.limits.most(kind) for kind in ("torque", "torque_rate", "speed"))
    # a rigid body's least times under a limit, and the limit that would do
    for what, least, kind, needed in (
        (around, turn / speed, "speed", turn / T),
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
