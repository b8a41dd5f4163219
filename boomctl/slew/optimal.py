"""Optimal slews: the torque is computed by the first method that succeeds, then simulated and certified.

Methods, in order; the stages of a result list those used:

1. Minimum time of a linear plant under the torque limit only: switching times. The problem is convex, the times are
   exact, and weak duality proves that they are optimal.
2. Minimum time of a nonlinear plant under the torque limit only: durations of arcs, accurate to the tolerance. They start
   from those of the linear part, or with one mode from the rigid body with its slowest vibration, in closed form.
3. Minimum effort without a torque rate limit: the torque held on a mesh is a closed form, clipped at its limit, with one
   unknown per terminal condition and active limit. For a linear plant under the torque limit only, weak duality bounds
   the optimality gap; for others the closed form is iterated along the motion.
4. A nonlinear program on a mesh, for all other problems and if method 2 fails; the arcs of a bang-bang torque from it are
   the start of another attempt by method 2.

Beams with axial modes are planned without them, and simulated with them.

From call to certificate: :func:`optimal_slew` makes a ``SlewProblem`` (``slew_problem``, ``plant_of``); ``_searched`` takes
the torque of the first method that succeeds (``least_time``, ``least_time_arcs``, ``_least_effort``, ``refined``);
``replayed`` simulates it, and ``_certified`` measures the errors (``prescribed_error``, ``violation``).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from math import inf, radians
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from boomctl.checks import instance, positive, real
from boomctl.exceptions import SlewError
from boomctl.lti.rounding import ALIKE, SUMMED
from boomctl.printing import compact
from boomctl.progress import OutOfTimeError, computing
from boomctl.slew.deadline import SlewDeadline, SlewProgress, noting_interrupts
from boomctl.slew.effort import effort_on_mesh
from boomctl.slew.end_map import end_map
from boomctl.slew.least_time.arc_count import arcs_behind
from boomctl.slew.least_time.arcs import least_time_arcs, led_to_end
from boomctl.slew.least_time.linear import least_time, rigid_and_slowest, time_gap
from boomctl.slew.linear import effort_gap, least_effort
from boomctl.slew.nlp.program import Solution
from boomctl.slew.nlp.refinement import refined, solved, within_limits
from boomctl.slew.nlp.transcription import Transcription
from boomctl.slew.objectives import OBJECTIVES
from boomctl.slew.plant import is_machine
from boomctl.slew.problem import MESH_GAP, MESHES, ROUNDS, Limits, SlewProblem, slew_problem, warn_of_turns
from boomctl.slew.replay import Candidate, binding, free_errors, prescribed_error, replayed, violation
from boomctl.slew.result import SlewCertificate, SlewResult
from boomctl.slew.torque import TorqueProfile
from boomctl.threads import one_blas_thread

if TYPE_CHECKING:
    import control

    from boomctl.rotating_beam.assumed_modes import AssumedModesBeam

TIME_LIMIT = 120.0  # default time limit of a search [s]: ten times that of the slowest design
_FAILED = 2  # meshes without a torque of least effort after which the method stops
_LONGER = 1.5  # duration of an initial guess with limits other than the torque's, over the linear part's least time


@dataclass(frozen=True, eq=False)
class Planned:
    """Data of a result for replanning: arguments, problem, and a nonlinear program with its solution."""

    arguments: dict[str, Any]
    problem: SlewProblem
    program: Transcription | None
    solution: Solution | None

    __repr__ = compact


def _nonlinear_program(problem: SlewProblem, least: TorqueProfile | None) -> Candidate:
    """Solve a nonlinear program on a mesh; if its torque is bang-bang, then optimize the durations of its arcs."""
    if least is None or not problem.is_bang_bang:
        duration = problem.duration or (0.0 if least is None else _LONGER * least.duration)
        least = least_effort(problem, duration, problem.intervals or MESHES[0]).profile
    candidate, limit = refined(problem, least), problem.limits.torque
    if problem.is_bang_bang:
        bang, ran = least_time_arcs(
            problem, arcs_behind(candidate.profile.start_values / limit, candidate.profile.duration, limit)
        )
        return replace(bang or candidate, stages=(*candidate.stages, *ran))
    return candidate


def _least_effort(problem: SlewProblem) -> tuple[Candidate | None, tuple[str, ...]]:
    """Compute the held torque of least effort, with one unknown per terminal condition and active limit.

    The gap is that of weak duality for a linear plant under the torque limit only; otherwise the change of the effort on a
    mesh half as fine, or twice as fine if that has no solution. None if a limit is too low (a nonlinear program then
    reports where) or Newton's method fails, on the two coarsest meshes.
    """
    requested = problem.intervals
    proved = problem.linear and not problem.limits.without_torque
    result, stages, gap = None, (), inf
    try:
        for intervals in MESHES if requested is None else (requested,):
            stages = (*stages, f"least effort on {intervals} intervals")
            finer = _effort_within(problem, intervals)
            if finer is None:
                if result is not None or len(stages) == _FAILED:
                    break
                continue
            coarser, result = result, finer
            gap = result.gap if coarser is None else abs(coarser.profile.effort / result.profile.effort - 1.0)
            if gap < MESH_GAP:
                break
        if result is not None and gap == inf and not proved:
            finer = _effort_within(problem, 2 * result.profile.start_values.size)
            gap = inf if finer is None else abs(finer.profile.effort / result.profile.effort - 1.0)
    except OutOfTimeError as over:
        if result is None:
            raise
        stages = (*stages, f"out of time: {over}")
    if result is None:
        return None, (*stages, "no least effort found")
    return replace(result, gap=effort_gap(problem, result.profile) if proved else gap), stages


def _effort_within(problem: SlewProblem, intervals: int) -> Candidate | None:
    """Compute the least effort on a mesh; tighten limits until the replay satisfies them between the nodes too, or None."""
    duration, limits = problem.duration, problem.limits
    assert duration is not None
    if not limits.without_torque and problem.linear:
        least = least_effort(problem, duration, intervals)
        return Candidate(least.profile, "least effort", inf, "proved") if least.residual <= ALIKE else None
    result = None
    for _ in range(ROUNDS):
        result = effort_on_mesh(problem, duration, intervals, limits, result)
        if result is None:
            return None
        candidate = Candidate(result.profile, "least effort", result.more, "stationary")
        if not limits.without_torque:
            return candidate
        motions = replayed(problem, candidate.profile)
        excess = violation(problem, candidate.profile, motions)
        # relative excess at the rounding error of the integrator
        if max(excess.values()) <= ALIKE:
            return replace(candidate, motions=motions)
        limits = limits.tightened(excess)
    return None


@one_blas_thread
def optimal_slew(
    system: AssumedModesBeam | control.StateSpace,
    angle: float | None = None,
    torque_limit: float | None = None,
    objective: str = "time",
    duration: float | None = None,
    *,
    angle_deg: float | None = None,
    torque_rate_limit: float | None = None,
    speed_limit: float | None = None,
    tip_limit: float | None = None,
    moment_limit: float | None = None,
    final_speed: float = 0.0,
    initial_state: ArrayLike | None = None,
    final_state: ArrayLike | None = None,
    tip_masses: tuple[float, ...] = (),
    rtol: float | None = None,
    intervals: int | None = None,
    time_limit: float = TIME_LIMIT,
    progress: Callable[[SlewProgress], object] | None = None,
) -> SlewResult:
    """Compute an optimal slew of a flexible beam or a linear system within limits.

    Parameters
    ----------
    system : hub-beam or control.StateSpace
        The first input of a linear system is the torque, its first output the angle; the terminal state satisfies
        ``A x = 0`` at the slew angle. Outputs "tip_displacement" and "root_moment" are identified by name.
        Reports and plots use its signal names, and show units if these are "torque" and "hub_angle".
    angle : float or None
        Slew angle [rad]. If None, the final angle is free (spin-up), or that of ``final_state``.
    torque_limit : float
        Largest absolute torque [N m].
    angle_deg : float, optional
        The angle in degrees, in place of ``angle``.
    objective : {"time", "effort", "jerk", "torque-rate", "tip"}
        Minimize the duration; the integral of the squared torque, hub jerk or torque rate; or the largest tip
        displacement.
    duration : float or None
        Duration [s], for every objective except "time".
    torque_rate_limit, speed_limit, tip_limit, moment_limit : float or None
        Limits on the magnitudes of the torque rate [N m/s], hub speed [rad/s], tip displacement [m] and bending moment
        at the clamp [N m].
    final_speed : float
        Final hub speed [rad/s] (spin-up); the beam ends in steady rotation.
    initial_state, final_state : array_like or None
        Initial and terminal state of a linear system. If None, the system is at rest.
    tip_masses : tuple of float
        Other tip masses [kg] that the same torque must also bring to rest. The slew angle is that of `system`.
    rtol : float, optional
        Maximum relative error of the terminal state in a verification simulation, by default 1e-6. For beams with axial
        modes, such as FOAM, the slew is optimized without these modes and verified with them; the default is then 1e-4.
        If the error exceeds `rtol`, the switching times of a bang-bang torque are corrected on the full model; for other
        torques, SlewError is raised.
        The terminal axial motion is not constrained, but is included in ``terminal_error``.
    intervals : int or None
        Number of intervals of the mesh. If None, the mesh is refined until halving its intervals changes the cost by
        less than 1e-4, relative, or it has 800 intervals; the certificate states the change.
    time_limit : float
        Time limit of the optimization [s], without verification. If it is exceeded, the slew on the finest mesh so far
        is returned, if its verification succeeds.
    progress : callable or None
        Called with a `SlewProgress` at each stage and iteration.

    Returns
    -------
    SlewResult
        Torque and motion over time, and a ``certificate`` of the verification.

    Raises
    ------
    TypeError, ValueError
        If an argument is invalid or missing.
    SlewError
        If no torque within the limits is found (the message names the largest violation, its time and the active limits),
        or the time limit is exceeded before a slew is verified (the message names the stage).
    KeyboardInterrupt
        If interrupted, within two seconds, also while a solver runs.

    Warns
    -----
    BoomctlWarning
        If the angle of a hub-beam exceeds one revolution: it may be in degrees.

    Examples
    --------
    >>> import boomctl as bc
    >>> import control
    >>> A, B, C = [[0.0, 1.0], [0.0, 0.0]], [[0.0], [1.0]], [[1.0, 0.0]]
    >>> rigid = control.ss(A, B, C, 0.0, inputs="torque", outputs="angle")  # of unit inertia
    >>> slew = bc.optimal_slew(rigid, angle=1.0, torque_limit=1.0)
    >>> round(slew.duration, 4), slew.certificate.n_switches, slew.certificate.optimality_status
    (2.0, 1, 'proved')
    """
    if torque_limit is None:
        raise TypeError("torque_limit: expected the largest torque [N m], got none")
    arguments = {
        "h": system,
        "angle": _turned(not is_machine(system), angle, angle_deg),
        "limits": Limits(torque_limit, torque_rate_limit, speed_limit, tip_limit, moment_limit),
        "objective": objective,
        "duration": duration,
        "final_speed": final_speed,
        "initial_state": initial_state,
        "final_state": final_state,
        "tip_masses": tip_masses,
        "rtol": rtol,
        "intervals": intervals,
    }
    with _search(time_limit, progress) as deadline:
        return _planned(arguments, slew_problem(**arguments, deadline=deadline))


@contextmanager
def _search(time_limit: float, progress: Callable[[SlewProgress], object] | None) -> Iterator[SlewDeadline]:
    """Limit the time of a search and report its progress, by default to the listeners of computations."""
    if progress is not None and not callable(progress):
        raise TypeError(f"progress = {progress!r}: expected a function of a SlewProgress, or None")
    limit = positive("time_limit", time_limit)
    try:
        with computing("optimal slew") as tell:
            deadline = SlewDeadline(limit, tell=progress or (lambda item: tell(item.stage)))
            with noting_interrupts(deadline):
                yield deadline
    except OutOfTimeError as over:
        raise SlewError(
            f"time_limit = {limit:g} s: exceeded before a slew was verified; stage: {over}. "
            "Expected more time, fewer modes or payloads, or a larger tolerance"
        ) from None


def _turned(linear: bool, angle: float | None, angle_deg: float | None) -> float | None:
    """Return the specified angle [rad], None if it is free."""
    if angle_deg is not None:
        if angle is not None:
            raise ValueError("angle, angle_deg: expected one of them, got both")
        return radians(real("angle_deg", angle_deg))
    if angle is not None and not linear:
        warn_of_turns(real("angle", angle))
    return angle


def _planned(arguments: dict[str, Any], problem: SlewProblem, before: Planned | None = None) -> SlewResult:
    """Plan a slew, from an earlier nonlinear program if any, and certify it.

    With axial modes, which planning neglects, switching times are corrected if necessary.
    """
    if before is None or before.program is None or before.solution is None:
        candidate = _searched(problem)
    else:
        candidate = within_limits(problem, solved(problem, before.program, before.solution, problem.limits))
        candidate = replace(candidate, stages=("collocation, solved again on its mesh",))
    motions = replayed(problem, candidate.profile) if candidate.motions is None else candidate.motions
    if problem.stretches:
        candidate = replace(candidate, stages=("planned without axial modes", *candidate.stages))
        ends = end_map(problem, candidate.profile)
        for _ in range(ROUNDS if candidate.method == "switching times" else 0):
            if prescribed_error(problem, motions) <= problem.rtol:
                break
            end = np.concatenate([motion.coordinates[-1] for motion in motions])
            corrected = led_to_end(ends, candidate.profile, ends.rows @ end - ends.target)
            if corrected is None:
                break
            problem.deadline.check("switching times corrected with axial modes", corrected.duration)
            motions, stages = (
                replayed(problem, corrected),
                (*candidate.stages, "switching times corrected with axial modes"),
            )
            candidate = replace(candidate, profile=corrected, stages=tuple(dict.fromkeys(stages)))
    return _certified(arguments, problem, replace(candidate, motions=motions))


def _searched(problem: SlewProblem) -> Candidate:
    """Compute a torque by the first method that succeeds."""
    stages, result, least = (), None, None
    if problem.is_bang_bang and not problem.linear:
        first = rigid_and_slowest(problem)
        if first is not None and first.start_values.size == problem.ends.shape[0]:  # as many arcs as conditions
            result, ran = least_time_arcs(problem, first)
            stages = ("rigid body and slowest mode", *ran)
    if problem.objective == "time" and result is None:
        extremal = least_time(problem)  # of the linear part: initial guess of all other methods
        least, stages = extremal.profile, (*stages, "linear switching times")
        if problem.is_bang_bang and problem.linear:  # already the solution: compute its gap
            gap = time_gap(problem, extremal)
            optimality = "proved" if problem.can_wait and gap < 1.0 else "extremal"
            return Candidate(least, "switching times", gap, optimality, stages=stages)
        if problem.is_bang_bang:
            result, ran = least_time_arcs(problem, least)
            stages += ran
    if problem.objective == "effort" and problem.limits.torque_rate is None:
        result, stages = _least_effort(problem)
    if result is None:
        result = _nonlinear_program(problem, least)
        stages += result.stages
    return replace(result, stages=stages)


@one_blas_thread
def replan(
    result: SlewResult,
    *,
    angle: float | None = None,
    torque_limit: float | None = None,
    angle_deg: float | None = None,
    time_limit: float = TIME_LIMIT,
    progress: Callable[[SlewProgress], object] | None = None,
) -> SlewResult:
    """Solve a planned slew again with another angle or torque limit, started from its solution.

    A nonlinear program is reused on its mesh without building it again, and no optimality gap is estimated: it is inf.
    A slew planned without a nonlinear program is planned from scratch.

    Parameters
    ----------
    result : SlewResult
        Result of `optimal_slew`.
    angle, torque_limit : float or None
        New angle [rad] and new limit [N m]. If None, unchanged.
    angle_deg : float, optional
        The new angle in degrees, in place of ``angle``.
    time_limit, progress
        As in `optimal_slew`.

    Returns
    -------
    SlewResult
        The new slew, with its certificate.

    Raises
    ------
    TypeError, ValueError
        If `result` is not planned by `optimal_slew`, or `angle` is given and was free or part of specified states.
    SlewError
        As `optimal_slew`.

    Warns
    -----
    BoomctlWarning
        As `optimal_slew`.

    Examples
    --------
    >>> import boomctl as bc
    >>> slew = bc.optimal_slew(bc.hub_beam(modes=1), 1.0, 200.0, "effort", 4.0, intervals=40)
    >>> further = bc.slew.replan(slew, angle=1.1)
    >>> round(further.cost / slew.cost, 3)  # about 1.1 squared
    1.21
    """
    before = instance("result", result, SlewResult).plan
    if before is None:
        raise ValueError("result: expected a slew that optimal_slew planned; plan this one again")
    arguments = dict(before.arguments)
    if angle is not None or angle_deg is not None:
        if before.problem.angle is None or not before.problem.can_wait:
            raise ValueError("angle: expected None, for the slew had a free angle or given states")
        arguments["angle"] = _turned(before.problem.linear, angle, angle_deg)
    if torque_limit is not None:
        arguments["limits"] = replace(before.problem.limits, torque=torque_limit)
    with _search(time_limit, progress) as deadline:
        return _planned(arguments, slew_problem(**arguments, deadline=deadline), before)


def _certified(arguments: dict[str, Any], problem: SlewProblem, candidate: Candidate) -> SlewResult:
    """Evaluate a torque by its replay, and build the result."""
    # the stored problem has no callback
    profile, deadline, problem = candidate.profile, problem.deadline, replace(problem, deadline=SlewDeadline())
    motions = candidate.motions
    assert motions is not None
    error, free = prescribed_error(problem, motions), free_errors(problem, motions)
    excess, whole = violation(problem, profile, motions), max(error, *free.values(), 0.0)
    if error > max(problem.rtol, SUMMED):  # rounding error is always accepted
        other = "" if problem.objective == "effort" else ", or the objective 'effort' with a given duration"
        raise SlewError(
            f"the replay ends {error:.1e} off the end state; expected at most {problem.rtol:.1e}. A larger rtol{other} may do"
        )
    certificate = SlewCertificate(
        method=candidate.method,
        terminal_error=whole,
        prescribed_terminal_error=error,
        free_terminal_errors=free,
        constraint_violation=max(excess.values()),
        active_constraints=binding(problem, profile, motions),
        optimality_gap=candidate.gap,
        optimality_status=candidate.optimality,
        n_switches=int(profile.switching_times.size) if candidate.method == "switching times" else None,
        intervals=None if candidate.method == "switching times" else int(profile.start_values.size),
    )
    profile = replace(profile, unit=problem.plants[0].labels["torque"][1])
    paths = [(plant, item.time, item.coordinates) for plant, item in zip(problem.plants, motions, strict=True)]
    first = motions[0]
    rows = {name: first.coordinates @ row for name, row in problem.plants[0].rows.items()}
    return SlewResult(
        objective=problem.objective,
        duration=profile.duration,
        cost=OBJECTIVES[problem.objective].value(profile, paths),
        time=first.time,
        torque=profile(first.time),
        hub_angle=rows["angle"],
        hub_speed=rows["speed"],
        tip_displacement=rows.get("tip"),
        root_moment=rows.get("moment"),
        states=first.states,
        residual_energy=first.residual_energy,
        terminal_error=whole,
        certificate=certificate,
        torque_profile=profile,
        plan=Planned(arguments, problem, candidate.program, candidate.solution),
        stages=candidate.stages,
        small_deformation_until=first.small_deformation_until,
        elapsed=deadline.elapsed,
    )
