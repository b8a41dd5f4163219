"""From a maneuver to the motion at the instants asked for: which way is taken, and what its failures mean.

=================  ==================================================================================================
initial state      only t = 0 is asked for: nothing is to be found
steady rotation    at constant hub speed the beam's equations have a closed form, exact but for rounding
modal collocation  without damping and axial modes each mode vibrates in closed form: few, long steps
free-hub modes     a torque moves slow modes, which the fast ones follow: each mode's motion is exact, long windows settle
                   by sweeps
collocation        any equations, any maneuver, and what misses the tolerance in another way; steady rotation follows it
                   where the hub's speed becomes constant
=================  ==================================================================================================
"""

from dataclasses import replace
from functools import partial

import numpy as np

from boomctl.arrays import Array
from boomctl.maneuvers import PrescribedMotion, TorqueDriven
from boomctl.rotating_beam.motion.free_hub import free_motion
from boomctl.rotating_beam.motion.modal_collocation import ModalTrajectory, modal_refine
from boomctl.rotating_beam.motion.refinement import refine
from boomctl.rotating_beam.motion.scene import Scene
from boomctl.rotating_beam.motion.steady_rotation import vibration_amplitudes
from boomctl.rotating_beam.motion.trajectory import FreeTrajectory
from boomctl.rotating_beam.result import Motion, kept_states, small_deformation_until

_JUMP = 1e-11  # of the whole time: steps so short are there for a jump of the torque that lies in them


def motion_of(scene: Scene) -> Motion:
    """Find a motion in the first of the ways that applies; by collocation where that misses the tolerance.

    Parameters
    ----------
    scene : Scene

    Raises
    ------
    SimulationError
        If the mass matrix ceases to be positive definite, the motion grows out of bounds, or the tolerance is not
        reached.
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
    found = _by_free_modes(scene) if driven else _by_modes(scene)
    if found is not None:
        return found
    name, found = "free-hub modes" if driven else "modal collocation", _collocated(scene)
    return replace(found, stages=(f"{name} (given up)", *found.stages))


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
    edges = scene.first_steps(scene.end, graded=False)
    if scene.given:
        jumps = np.flatnonzero(np.diff(edges) < _JUMP * scene.end)
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
    """Coordinates and rates of hub and beam at the watched instants, the hub's motion prescribed."""
    maneuver = scene.maneuver
    assert isinstance(maneuver, PrescribedMotion)
    angle, speed = maneuver.angle(scene.watched), maneuver.speed(scene.watched)
    return np.column_stack([angle, q]), np.column_stack([speed, v])


def _moved(scene: Scene, trajectory: ModalTrajectory | FreeTrajectory, error: float, stage: str) -> Motion:
    """A motion that is known at any instant."""
    row, watched = scene.equations.tip.transverse, scene.watched
    displacement = trajectory.displacement(row, watched)

    def tip_rate(part: slice) -> Array:
        return trajectory(watched[part])[1][:, 1:] @ row

    until = small_deformation_until(watched, displacement, scene.length, tip_rate)
    asked, states = _asked(scene, displacement), partial(trajectory, scene.timepts)
    return Motion(asked, until, states, error, trajectory.steps, (stage,))


def _sampled(scene: Scene, y: Array, rate: Array, error: float, steps: int, stages: tuple[str, ...]) -> Motion:
    """A motion of coordinates and rates at the watched instants."""
    row = scene.equations.tip.transverse
    tip = y[:, 1:] @ row
    until = small_deformation_until(scene.watched, tip, scene.length, lambda part: rate[part, 1:] @ row)
    states = partial(kept_states, _asked(scene, y), _asked(scene, rate))
    return Motion(_asked(scene, tip), until, states, error, steps, stages)


def _asked(scene: Scene, watched: Array) -> Array:
    """Of values at the watched instants those at the instants asked for."""
    if scene.watched is scene.timepts:
        return watched
    return watched[np.searchsorted(scene.watched, scene.timepts)]
