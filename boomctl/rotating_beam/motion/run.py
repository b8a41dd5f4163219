"""Motion at the requested times for a maneuver, by the first applicable method.

=================  ==================================================================================================
initial state      only t = 0 is requested: nothing to solve
steady rotation    at constant hub speed the beam's equations have a closed form, exact to rounding error
modal collocation  without damping and axial modes each mode vibrates in closed form: few, long steps
free-hub modes     a torque excites slow modes, which the fast modes follow: each mode's motion is exact, the forces in long
                   windows are solved by fixed-point sweeps
collocation        any equations, any maneuver, and if another method does not reach the tolerance; followed by steady
                   rotation when the hub's speed becomes constant
=================  ==================================================================================================

From call to result: ``HubBeam.simulate`` calls ``AssumedModesBeam._motion``, which makes a ``Scene`` of its ``equations``;
:func:`motion_of` solves it by ``modal_refine`` for a prescribed motion, ``free_motion`` for a torque, or ``refine``, each
with an estimate of its error.
"""

from dataclasses import replace
from functools import partial

import numpy as np

from boomctl.arrays import Array
from boomctl.lti.rounding import SUMMED
from boomctl.maneuvers import PrescribedMotion, TorqueDriven
from boomctl.rotating_beam.motion.free_hub import free_motion
from boomctl.rotating_beam.motion.modal_collocation import ModalTrajectory, modal_refine
from boomctl.rotating_beam.motion.refinement import refine
from boomctl.rotating_beam.motion.scene import Scene
from boomctl.rotating_beam.motion.steady_rotation import vibration_amplitudes
from boomctl.rotating_beam.motion.trajectory import FreeTrajectory
from boomctl.rotating_beam.result import Motion, known_states, small_deformation_until


def motion_of(scene: Scene) -> Motion:
    """Solve a motion by the first applicable method; by collocation if that does not reach the tolerance.

    Parameters
    ----------
    scene : Scene

    Raises
    ------
    SimulationError
        If the mass matrix ceases to be positive definite, the motion overflows, or the tolerance is not reached.
    """
    if scene.end == 0.0:
        y, rate = (item[None] for item in scene.start)
        return _sampled(scene, y, rate, 0.0, 0, ("initial state",))
    maneuver, driven = scene.maneuver, isinstance(scene.maneuver, TorqueDriven)
    if isinstance(maneuver, PrescribedMotion) and maneuver.steady_from <= 0.0 and scene.steady is not None:
        q, v = scene.steady(scene.beam, scene.watched)
        return _sampled(scene, *_with_hub(scene, q, v), 0.0, 0, (scene.steady.name,))
    if (scene.equations.free_hub_form if driven else scene.equations.normal_form) is None:
        return _collocated(scene)
    motion = _by_free_modes(scene) if driven else _by_modes(scene)
    if motion is not None:
        return motion
    name, motion = "free-hub modes" if driven else "modal collocation", _collocated(scene)
    return replace(motion, stages=(f"{name} (given up)", *motion.stages))


def _by_modes(scene: Scene) -> Motion | None:
    form, maneuver = scene.equations.normal_form, scene.maneuver
    assert form is not None
    assert isinstance(maneuver, PrescribedMotion)
    end = min(scene.end, maneuver.steady_from)
    edges = scene.first_steps(end, graded=False)
    accuracy = scene.accuracy((scene.tip_rows,))
    result = modal_refine(form, maneuver, edges, scene.beam, accuracy, vibrates_on=end < scene.end)
    if result is None:
        return None
    trajectory, error = result
    return _moved(scene, trajectory, scene.caution * error, "modal collocation")


def _by_free_modes(scene: Scene) -> Motion | None:
    form, corners = scene.equations.free_hub_form, np.array([*scene.maneuver.breakpoints, scene.end])
    assert form is not None
    if scene.user_defined:
        edges = scene.first_steps(scene.end, graded=False)
        jumps = np.flatnonzero(np.diff(edges) < 4.0 * SUMMED * scene.end)  # `resolving` halves no further
        corners = np.concatenate([corners, edges[jumps], edges[jumps + 1]])
    result = free_motion(form, scene, np.unique(corners[(corners > 0.0) & (corners <= scene.end)]))
    return None if result is None else _moved(scene, *result, "free-hub modes")


def _collocated(scene: Scene) -> Motion:
    equations, maneuver, problem, start = scene.equations, scene.maneuver, scene.problem, scene.start
    end, accuracy, steady = scene.end, scene.accuracy((scene.tip_rows,)), scene.steady
    if isinstance(maneuver, PrescribedMotion):
        start = scene.beam
        if steady is not None:
            assert equations.beam_speed_terms is not None
            amplitudes = vibration_amplitudes(equations.beam_speed_terms, steady.speed, equations.tip.transverse)
            end, accuracy = steady.begin, replace(accuracy, modal=amplitudes)
    else:
        rows = np.zeros((3, equations.size))
        rows[:2, 1:], rows[2, 0] = scene.tip_rows, scene.radius
        accuracy = scene.accuracy((rows[:2], rows[2:]))
    trajectory, error = refine(problem, scene.first_steps(end, graded=True), start, accuracy)
    late = int(np.searchsorted(scene.watched, end, side="right"))
    y, rate = trajectory(scene.watched[:late])
    stages: tuple[str, ...] = ("collocation",)
    if steady is not None:
        tail = steady((trajectory.q[-1], trajectory.v[-1]), scene.watched[late:])
        y, rate = (np.concatenate(pair) for pair in zip((y, rate), tail, strict=True))
        stages = (*stages, steady.name)
    if isinstance(maneuver, PrescribedMotion):
        y, rate = _with_hub(scene, y, rate)
    return _sampled(scene, y, rate, scene.caution * error, trajectory.edges.size - 1, stages)


def _with_hub(scene: Scene, q: Array, v: Array) -> tuple[Array, Array]:
    """Return coordinates and rates of hub and beam at the watched times, the hub's motion prescribed."""
    maneuver = scene.maneuver
    assert isinstance(maneuver, PrescribedMotion)
    angle, speed = maneuver.angle(scene.watched), maneuver.speed(scene.watched)
    return np.column_stack([angle, q]), np.column_stack([speed, v])


def _moved(scene: Scene, trajectory: ModalTrajectory | FreeTrajectory, error: float, stage: str) -> Motion:
    """Return the motion of a trajectory that is known at any time."""
    row, watched = scene.equations.tip.transverse, scene.watched
    displacement, tip_rate = trajectory.displacement(row, watched), partial(_tip_rate, trajectory, watched, row)
    until = partial(small_deformation_until, watched, displacement, scene.length, tip_rate)
    tip, states = _at_timepts(scene, displacement), partial(trajectory, scene.timepts)
    return Motion(tip, until, states, error, trajectory.steps, (stage,))


def _tip_rate(trajectory: ModalTrajectory | FreeTrajectory, timepts: Array, row: Array, part: slice) -> Array:
    return trajectory(timepts[part])[1][:, 1:] @ row


def _sampled(scene: Scene, y: Array, rate: Array, error: float, steps: int, stages: tuple[str, ...]) -> Motion:
    """Return the motion of coordinates and rates at the watched times."""
    row = scene.equations.tip.transverse
    tip = y[:, 1:] @ row
    tip_rate = (rate[:, 1:] @ row).__getitem__
    until = partial(small_deformation_until, scene.watched, tip, scene.length, tip_rate)
    states = partial(known_states, _at_timepts(scene, y), _at_timepts(scene, rate))
    return Motion(_at_timepts(scene, tip), until, states, error, steps, stages)


def _at_timepts(scene: Scene, watched: Array) -> Array:
    """Select the values at the requested times from the values at the watched times."""
    if scene.watched is scene.timepts:
        return watched
    return watched[np.searchsorted(scene.watched, scene.timepts)]
