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

From call to result: ``HubBeam.simulate`` calls ``AssumedModesBeam._motion``, which makes a ``Simulation`` of its
``equations``; :func:`motion_of` solves it by ``modal_refine`` for a prescribed motion, ``free_motion`` for a torque, or
``refine``, each with an estimate of its error.
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
from boomctl.rotating_beam.motion.simulation import Simulation
from boomctl.rotating_beam.motion.steady_rotation import vibration_amplitudes
from boomctl.rotating_beam.motion.trajectory import FreeTrajectory
from boomctl.rotating_beam.result import Motion, known_states, small_deformation_until


def motion_of(simulation: Simulation) -> Motion:
    """Solve a motion by the first applicable method; by collocation if that does not reach the tolerance.

    Parameters
    ----------
    simulation : Simulation

    Raises
    ------
    SimulationError
        If the mass matrix ceases to be positive definite, the motion overflows, or the tolerance is not reached.
    """
    if simulation.end == 0.0:
        y, rate = (item[None] for item in simulation.start)
        return _sampled(simulation, y, rate, 0.0, 0, ("initial state",))
    maneuver, driven = simulation.maneuver, isinstance(simulation.maneuver, TorqueDriven)
    if isinstance(maneuver, PrescribedMotion) and maneuver.steady_from <= 0.0 and simulation.steady is not None:
        q, v = simulation.steady(simulation.beam, simulation.watched)
        return _sampled(simulation, *_with_hub(simulation, q, v), 0.0, 0, (simulation.steady.name,))
    if (simulation.equations.free_hub_form if driven else simulation.equations.normal_form) is None:
        return _collocated(simulation)
    motion = _by_free_modes(simulation) if driven else _by_modes(simulation)
    if motion is not None:
        return motion
    name, motion = "free-hub modes" if driven else "modal collocation", _collocated(simulation)
    return replace(motion, stages=(f"{name} (given up)", *motion.stages))


def _by_modes(simulation: Simulation) -> Motion | None:
    form, maneuver = simulation.equations.normal_form, simulation.maneuver
    assert form is not None
    assert isinstance(maneuver, PrescribedMotion)
    end = min(simulation.end, maneuver.steady_from)
    edges = simulation.first_steps(end, graded=False)
    accuracy = simulation.accuracy((simulation.tip_rows,))
    result = modal_refine(form, maneuver, edges, simulation.beam, accuracy, vibrates_on=end < simulation.end)
    if result is None:
        return None
    trajectory, error = result
    return _moved(simulation, trajectory, simulation.caution * error, "modal collocation")


def _by_free_modes(simulation: Simulation) -> Motion | None:
    form, corners = simulation.equations.free_hub_form, np.array([*simulation.maneuver.breakpoints, simulation.end])
    assert form is not None
    if simulation.user_defined:
        edges = simulation.first_steps(simulation.end, graded=False)
        jumps = np.flatnonzero(np.diff(edges) < 4.0 * SUMMED * simulation.end)  # `steps_resolving` halves no further
        corners = np.concatenate([corners, edges[jumps], edges[jumps + 1]])
    result = free_motion(form, simulation, np.unique(corners[(corners > 0.0) & (corners <= simulation.end)]))
    return None if result is None else _moved(simulation, *result, "free-hub modes")


def _collocated(simulation: Simulation) -> Motion:
    equations, maneuver, problem, start = (
        simulation.equations,
        simulation.maneuver,
        simulation.problem,
        simulation.start,
    )
    end, accuracy, steady = simulation.end, simulation.accuracy((simulation.tip_rows,)), simulation.steady
    if isinstance(maneuver, PrescribedMotion):
        start = simulation.beam
        if steady is not None:
            assert equations.beam_speed_terms is not None
            amplitudes = vibration_amplitudes(equations.beam_speed_terms, steady.speed, equations.tip.transverse)
            end, accuracy = steady.begin, replace(accuracy, modal=amplitudes)
    else:
        rows = np.zeros((3, equations.size))
        rows[:2, 1:], rows[2, 0] = simulation.tip_rows, simulation.radius
        accuracy = simulation.accuracy((rows[:2], rows[2:]))
    trajectory, error = refine(problem, simulation.first_steps(end, graded=True), start, accuracy)
    late = int(np.searchsorted(simulation.watched, end, side="right"))
    y, rate = trajectory(simulation.watched[:late])
    stages: tuple[str, ...] = ("collocation",)
    if steady is not None:
        tail = steady((trajectory.q[-1], trajectory.v[-1]), simulation.watched[late:])
        y, rate = (np.concatenate(pair) for pair in zip((y, rate), tail, strict=True))
        stages = (*stages, steady.name)
    if isinstance(maneuver, PrescribedMotion):
        y, rate = _with_hub(simulation, y, rate)
    return _sampled(simulation, y, rate, simulation.caution * error, trajectory.edges.size - 1, stages)


def _with_hub(simulation: Simulation, q: Array, v: Array) -> tuple[Array, Array]:
    """Return coordinates and rates of hub and beam at the watched times, the hub's motion prescribed."""
    maneuver = simulation.maneuver
    assert isinstance(maneuver, PrescribedMotion)
    angle, speed = maneuver.angle(simulation.watched), maneuver.speed(simulation.watched)
    return np.column_stack([angle, q]), np.column_stack([speed, v])


def _moved(simulation: Simulation, trajectory: ModalTrajectory | FreeTrajectory, error: float, stage: str) -> Motion:
    """Return the motion of a trajectory that is known at any time."""
    row, watched = simulation.equations.tip.transverse, simulation.watched
    displacement, tip_rate = trajectory.displacement(row, watched), partial(_tip_rate, trajectory, watched, row)
    until = partial(small_deformation_until, watched, displacement, simulation.length, tip_rate)
    tip, states = _at_timepts(simulation, displacement), partial(trajectory, simulation.timepts)
    return Motion(tip, until, states, error, trajectory.steps, (stage,))


def _tip_rate(trajectory: ModalTrajectory | FreeTrajectory, timepts: Array, row: Array, part: slice) -> Array:
    return trajectory(timepts[part])[1][:, 1:] @ row


def _sampled(
    simulation: Simulation, y: Array, rate: Array, error: float, steps: int, stages: tuple[str, ...]
) -> Motion:
    """Return the motion of coordinates and rates at the watched times."""
    row = simulation.equations.tip.transverse
    tip = y[:, 1:] @ row
    tip_rate = (rate[:, 1:] @ row).__getitem__
    until = partial(small_deformation_until, simulation.watched, tip, simulation.length, tip_rate)
    states = partial(known_states, _at_timepts(simulation, y), _at_timepts(simulation, rate))
    return Motion(_at_timepts(simulation, tip), until, states, error, steps, stages)


def _at_timepts(simulation: Simulation, watched: Array) -> Array:
    """Select the values at the requested times from the values at the watched times."""
    if simulation.watched is simulation.timepts:
        return watched
    return watched[np.searchsorted(simulation.watched, simulation.timepts)]
