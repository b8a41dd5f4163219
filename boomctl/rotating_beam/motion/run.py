"""From a maneuver to the motion at the instants asked for: which way is taken, and what its failures mean."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import NamedTuple, final

import numpy as np

from boomctl.arrays import Array
from boomctl.exceptions import SimulationError
from boomctl.maneuvers import HubProfile, Maneuver, PrescribedMotion, Torque
from boomctl.rotating_beam.drive import even_instants, resolving
from boomctl.rotating_beam.modal.equations import Equations
from boomctl.rotating_beam.motion.free_hub import FreeScene, free_motion
from boomctl.rotating_beam.motion.free_trajectory import FreeTrajectory
from boomctl.rotating_beam.motion.modal_collocation import ModalTrajectory, modal_refine
from boomctl.rotating_beam.motion.problems import PrescribedProblem, Problem, TorqueDrivenProblem
from boomctl.rotating_beam.motion.refinement import Accuracy, first_steps, refine
from boomctl.rotating_beam.motion.steady_rotation import steady_motion, vibration_amplitudes
from boomctl.rotating_beam.result import Motion, kept_states, small_deformation_until

_WATCHED = 16.0  # instants in a period of the lowest mode at which the tip is watched: it turns by 22 degrees between
_JUMP = 1e-11  # of the whole time: steps so short are there for a jump of the torque that lies in them
_CAUTION = 2.0  # times the difference of two levels of steps, the error where a user's function has a kink (measured)
_LONGEST = 3e5  # radians of the slowest mode that a motion may last: half a minute and some gigabytes (measured)


class Way(NamedTuple):
    """A way to find a motion.

    Attributes
    ----------
    name : str
    applies : callable
        Whether it can be taken in a scene.
    find : callable
        Returns the motion, or None if it misses the tolerance.
    """

    name: str
    applies: "Callable[[Scene], bool]"
    find: "Callable[[Scene], Motion | None]"


WAYS = (
    # only t = 0 is asked for: nothing is to be found
    Way(
        "initial state",
        lambda scene: scene.end == 0.0,
        lambda scene: _initial_state(scene),
    ),
    # at constant hub speed the beam's equations have a closed form, exact but for rounding
    Way(
        "steady rotation",
        lambda scene: scene.steady_from <= 0.0,
        lambda scene: _steady(scene),
    ),
    # without damping and axial modes each mode vibrates in closed form: few, long steps
    Way(
        "modal collocation",
        lambda scene: scene.prescribed is not None and scene.equations.normal_form is not None,
        lambda scene: _by_modes(scene),
    ),
    # a torque moves slow modes, which the fast ones follow: each mode's motion is exact, long windows settle by sweeps
    Way(
        "free-hub modes",
        lambda scene: scene.prescribed is None and scene.equations.free_hub_form is not None,
        lambda scene: _by_free_modes(scene),
    ),
    # any equations, any maneuver; steady rotation follows it where the hub's speed becomes constant
    Way(
        "collocation",
        lambda scene: True,
        lambda scene: _collocated(scene),
    ),
)
"""In the order tried. The first that applies and keeps the tolerance gives the motion; `Motion.stages` names all that ran."""


@final
@dataclass(frozen=True, eq=False)
class Scene:
    """A motion that is asked for.

    Attributes
    ----------
    equations : Equations
    maneuver : PrescribedMotion or TorqueDriven
    timepts : ndarray, k
        Instants, s.
    start : pair of ndarray, N
        Coordinates and rates of hub and beam at t = 0.
    rtol, atol : float
        The error of the free end's displacement is kept below ``atol + rtol max |displacement|``, m.
    length : float
        Of the beam, m.
    radius : float
        Distance of the free end from the axis, m: what the error of the hub's angle is multiplied by.
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
        """The last instant, s."""
        return float(self.timepts[-1])

    @property
    def prescribed(self) -> PrescribedMotion | None:
        """The maneuver, if the hub's motion is prescribed."""
        return self.maneuver if isinstance(self.maneuver, PrescribedMotion) else None

    @property
    def steady_from(self) -> float:
        """Instant from which the motion has a closed form, s; inf if it never has."""
        if self.prescribed is None or self.equations.beam_speed_terms is None:
            return np.inf
        return self.prescribed.steady_from

    @cached_property
    def watched(self) -> Array:
        """The instants asked for, and enough others that no swing of the lowest mode passes unseen, from 0 on."""
        timepts = self.timepts
        gap = 2.0 * np.pi / self.equations.frequency_range[0] / _WATCHED
        if max(timepts[0], (timepts[1:] - timepts[:-1]).max(initial=0.0)) <= gap:
            return timepts
        return np.union1d(timepts, np.linspace(0.0, self.end, int(np.ceil(self.end / gap)) + 1))

    @property
    def given(self) -> bool:
        """Whether the maneuver is made of a user's functions, which may be less smooth than they say."""
        return isinstance(self.maneuver, HubProfile | Torque)

    @property
    def caution(self) -> float:
        """Times the difference of two levels of steps that the error of a motion may be."""
        return _CAUTION if self.given else 1.0

    def accuracy(self, rows: tuple[Array, ...]) -> Accuracy:
        """Accuracy that two levels of steps have to agree to."""
        return Accuracy(self.rtol / self.caution, self.atol / self.caution, rows)

    def asked(self, watched: Array) -> Array:
        """Of values at the watched instants those at the instants asked for."""
        return watched if self.watched is self.timepts else watched[np.searchsorted(self.watched, self.timepts)]


def motion_of(scene: Scene) -> Motion:
    """Find a motion in the first of the :data:`WAYS` that applies and keeps the tolerance.

    Parameters
    ----------
    scene : Scene

    Raises
    ------
    SimulationError
        If the mass matrix ceases to be positive definite, the motion grows out of bounds, or the tolerance is not
        reached.
    """
    given_up: tuple[str, ...] = ()
    for way in WAYS:
        if way.applies(scene):
            result = way.find(scene)
            if result is not None:
                return replace(result, stages=given_up + result.stages) if given_up else result
            given_up += (f"{way.name} (given up)",)
    raise AssertionError("the last way applies always, and raises what it cannot do")


def _initial_state(scene: Scene) -> Motion:
    y, rate = (item[None] for item in scene.start)
    return _sampled(scene, y, rate, 0.0, 0, ("initial state",))


def _steady(scene: Scene) -> Motion:
    beam = scene.start[0][1:], scene.start[1][1:]
    q, v, name = _steady_from(scene, 0.0, beam, scene.watched)
    return _sampled(scene, *_with_hub(scene, q, v), 0.0, 0, (name,))


def _by_modes(scene: Scene) -> Motion | None:
    form, maneuver, tip = scene.equations.normal_form, scene.prescribed, scene.equations.tip
    assert form is not None
    assert maneuver is not None
    end = min(scene.end, scene.steady_from)
    edges = _first_steps(scene, PrescribedProblem(scene.equations, maneuver), end, graded=False)
    beam = scene.start[0][1:], scene.start[1][1:]
    accuracy = scene.accuracy((np.stack([tip.transverse, tip.axial]),))
    result = modal_refine(form, maneuver, edges, beam, accuracy, vibrates_on=end < scene.end)
    if result is None:
        return None
    trajectory, error = result
    displacement = trajectory.displacement(tip.transverse, scene.watched)
    until = small_deformation_until(
        scene.watched, displacement, scene.length, lambda part: trajectory(scene.watched[part])[1] @ tip.transverse
    )
    states = partial(_modal_states, trajectory, maneuver, scene.timepts)
    steps = trajectory.edges.size - 1
    return Motion(scene.asked(displacement), until, states, scene.caution * error, steps, ("modal collocation",))


def _modal_states(trajectory: ModalTrajectory, maneuver: PrescribedMotion, timepts: Array) -> tuple[Array, Array]:
    q, v = trajectory(timepts)
    return np.column_stack([maneuver.angle(timepts), q]), np.column_stack([maneuver.speed(timepts), v])


def _by_free_modes(scene: Scene) -> Motion | None:
    form = scene.equations.free_hub_form
    assert form is not None
    result = free_motion(form, _free_scene(scene))
    return None if result is None else _free_motion(scene, *result)


def _free_scene(scene: Scene) -> FreeScene:
    maneuver, tip = scene.maneuver, scene.equations.tip
    assert not isinstance(maneuver, PrescribedMotion)
    corners = np.array([*maneuver.breakpoints, scene.end])
    _refuse_long(scene, scene.end)
    if scene.given:
        edges = _first_steps(scene, TorqueDrivenProblem(scene.equations, maneuver), scene.end, graded=False)
        jumps = np.flatnonzero(np.diff(edges) < _JUMP * scene.end)
        corners = np.concatenate([corners, edges[jumps], edges[jumps + 1]])
    return FreeScene(
        maneuver=maneuver,
        start=scene.start,
        corners=np.unique(corners[(corners > 0.0) & (corners <= scene.end)]),
        rows=np.stack([tip.transverse, tip.axial]),
        radius=scene.radius,
        rtol=scene.rtol,
        atol=scene.atol,
        looked_at=even_instants(scene.end) if scene.given else None,
    )


def _free_motion(scene: Scene, trajectory: FreeTrajectory, error: float) -> Motion:
    row = scene.equations.tip.transverse
    displacement = trajectory.displacement(row, scene.watched)

    def tip_rate(part: slice) -> Array:
        return trajectory(scene.watched[part])[1][:, 1:] @ row

    until = small_deformation_until(scene.watched, displacement, scene.length, tip_rate)
    states = partial(trajectory, scene.timepts)
    return Motion(scene.asked(displacement), until, states, error, trajectory.steps, ("free-hub modes",))


def _collocated(scene: Scene) -> Motion:
    tip, maneuver = scene.equations.tip, scene.maneuver
    if not isinstance(maneuver, PrescribedMotion):
        rows = np.zeros((3, scene.equations.size))
        rows[0, 1:], rows[1, 1:], rows[2, 0] = tip.transverse, tip.axial, scene.radius
        accuracy = scene.accuracy((rows[:2], rows[2:]))
        problem = TorqueDrivenProblem(scene.equations, maneuver)
        trajectory, error = refine(problem, _first_steps(scene, problem, scene.end, graded=True), scene.start, accuracy)
        y, rate = trajectory(scene.watched)
        return _sampled(scene, y, rate, scene.caution * error, trajectory.edges.size - 1, ("collocation",))

    terms, end = scene.equations.beam_speed_terms, min(scene.end, scene.steady_from)
    accuracy = scene.accuracy((np.stack([tip.transverse, tip.axial]),))
    if terms is not None and end < scene.end:
        accuracy = replace(accuracy, modal=vibration_amplitudes(terms, float(maneuver.speed(end)), tip.transverse))
    beam = scene.start[0][1:], scene.start[1][1:]
    problem = PrescribedProblem(scene.equations, maneuver)
    trajectory, error = refine(problem, _first_steps(scene, problem, end, graded=True), beam, accuracy)
    stages = ("collocation",)
    late = int(np.searchsorted(scene.watched, end, side="right"))
    q, v = trajectory(scene.watched[:late])
    if late < scene.watched.size:
        last = trajectory.q[-1], trajectory.v[-1]
        q_late, v_late, name = _steady_from(scene, end, last, scene.watched[late:])
        q, v, stages = np.concatenate([q, q_late]), np.concatenate([v, v_late]), (*stages, name)
    return _sampled(scene, *_with_hub(scene, q, v), scene.caution * error, trajectory.edges.size - 1, stages)


def _refuse_long(scene: Scene, end: float) -> None:
    radians = end * scene.equations.frequency_range[0]
    if radians > _LONGEST:
        raise SimulationError(
            f"the motion until t = {end:g} s is {radians:.2g} radians of the slowest mode; expected at most {_LONGEST:g},"
            f" which is about {_LONGEST / scene.equations.frequency_range[0]:.2g} s here"
        )


def _first_steps(scene: Scene, problem: Problem, end: float, *, graded: bool) -> Array:
    _refuse_long(scene, end)
    edges = first_steps(scene.equations, scene.maneuver.breakpoints, end, graded=graded)
    return resolving(edges, problem.drive) if scene.given else edges


def _steady_from(scene: Scene, begin: float, beam: tuple[Array, Array], timepts: Array) -> tuple[Array, Array, str]:
    """Coordinates and rates of the beam at constant hub speed from an instant on, and the way that they are found."""
    terms, maneuver = scene.equations.beam_speed_terms, scene.prescribed
    assert terms is not None
    assert maneuver is not None
    q, v, form = steady_motion(terms, float(maneuver.speed(begin)), beam, timepts - begin)
    finite = np.isfinite(q).all(axis=1) & np.isfinite(v).all(axis=1)
    if not finite.all():
        time = timepts[np.argmin(finite)]
        raise SimulationError(
            f"the deflection exceeds every number by t = {time:.6g} s: the model has lost its stiffness"
        )
    return q, v, f"steady rotation by {form}"


def _with_hub(scene: Scene, q: Array, v: Array) -> tuple[Array, Array]:
    """Coordinates and rates of hub and beam at the watched instants, the hub's motion prescribed."""
    maneuver = scene.prescribed
    assert maneuver is not None
    angle, speed = maneuver.angle(scene.watched), maneuver.speed(scene.watched)
    return np.column_stack([angle, q]), np.column_stack([speed, v])


def _sampled(scene: Scene, y: Array, rate: Array, error: float, steps: int, stages: tuple[str, ...]) -> Motion:
    """A motion of coordinates and rates at the watched instants."""
    row = scene.equations.tip.transverse
    tip = y[:, 1:] @ row
    until = small_deformation_until(scene.watched, tip, scene.length, lambda part: rate[part, 1:] @ row)
    states = partial(kept_states, scene.asked(y), scene.asked(rate))
    return Motion(scene.asked(tip), until, states, error, steps, stages)
