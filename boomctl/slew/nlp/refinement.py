"""Slews by nonlinear programming: mesh, points and limits are refined until a replay satisfies the problem."""

from dataclasses import replace

import numpy as np

from boomctl.exceptions import LimitsTooTightError, SlewError
from boomctl.lti.rounding import ALIKE
from boomctl.progress import OutOfTimeError
from boomctl.slew.linear import Guess, guess_from
from boomctl.slew.nlp.program import Solution, prepare, solve
from boomctl.slew.nlp.transcription import Transcription
from boomctl.slew.problem import MESH_GAP, MESHES, ROUNDS, Limits, SlewProblem
from boomctl.slew.replay import Candidate, prescribed_error, replayed, violation
from boomctl.slew.torque import TorqueProfile

_TOO_MUCH = 0.05  # violation of limits on a mesh above which finer meshes are assumed infeasible too
_SEARCH = 0.6  # fraction of the time limit for mesh refinement; the rest is for a verified result on a coarser mesh
_HIGHEST = 9  # collocation points at most, of order 18: beyond, the replay error is not due to the steps
_POINTS = 3  # initial collocation points, of order 6: terminal error below the tolerance on most meshes


def refined(problem: SlewProblem, first: TorqueProfile) -> Candidate:
    """Solve on the specified mesh, or on finer ones until halving the intervals changes the cost by less than `MESH_GAP`.

    A mesh without a solution is skipped. Limits are too tight on any mesh if a mesh exceeds them by much, or not by less
    than a mesh half as fine.

    Parameters
    ----------
    problem : SlewProblem
    first : TorqueProfile
        Initial guess.

    Raises
    ------
    SlewError
        If no mesh has a solution that a replay confirms.
    """
    if problem.intervals is not None:
        return _compared(problem, _verified(problem, _rough(problem, first, problem.intervals)))
    solutions: list[Candidate] = []
    try:
        candidate = _on_finer_meshes(problem, first, solutions)
    except OutOfTimeError as over:
        if not solutions:
            raise
        # a coarser mesh, on which points can be added in the remaining time
        candidate = _verified(problem, solutions[max(0, len(solutions) - 2)])
        return replace(candidate, stages=(*solutions[-1].stages, f"out of time: {over}"))
    return _verified(problem, candidate)


def _on_finer_meshes(problem: SlewProblem, first: TorqueProfile, solutions: list[Candidate]) -> Candidate:
    """Solve on successively finer meshes; append all solutions to a list.

    A mesh takes twice as long as one half as fine; it is not started if that exceeds the remaining time.
    """
    failure, before, took, stages = SlewError("no mesh was solved"), np.inf, 0.0, ()
    limit = problem.deadline.limit
    for intervals in MESHES:
        start_time, stages = problem.deadline.elapsed, (*stages, f"collocation on {intervals} intervals")
        if solutions:  # reserve time for verification
            problem = replace(problem, deadline=replace(problem.deadline, limit=_SEARCH * limit))
        if 2.0 * took > problem.deadline.limit - start_time:
            raise OutOfTimeError(stages[-1])
        try:
            candidate = _rough(problem, first, intervals)
        except LimitsTooTightError as error:
            if error.excess > min(_TOO_MUCH, 0.5 * before):
                raise
            failure, before = error, error.excess
            continue
        except SlewError as error:
            failure = error
            continue
        finally:
            took = problem.deadline.elapsed - start_time
        gap = _gap(candidate, solutions[-1]) if solutions else np.inf
        solutions.append(replace(candidate, gap=gap, stages=stages))
        first = candidate.profile
        if gap < MESH_GAP:
            break
    if not solutions:
        raise failure
    return solutions[-1]


def _gap(candidate: Candidate, other: Candidate) -> float:
    """Return the relative change of the cost of a nonlinear program."""
    return abs(candidate.solution.cost - other.solution.cost) / max(abs(candidate.solution.cost), 1e-300)


def _compared(problem: SlewProblem, candidate: Candidate) -> Candidate:
    """Set the gap to the change of the cost on a mesh half as fine, or twice as fine if that has no solution."""
    intervals = candidate.profile.start_values.size
    points = candidate.program.points
    # with fewer than two intervals per end condition no unknowns would remain free
    halved = [(intervals // 2, min(points + 1, _HIGHEST))] if intervals >= 4 * problem.ends.shape[0] else []
    for count, degree in (*halved, (2 * intervals, points)):
        try:
            return replace(candidate, gap=_gap(candidate, _rough(problem, candidate.profile, count, degree)))
        except OutOfTimeError as over:
            return replace(candidate, stages=(*candidate.stages, f"out of time: {over}"))
        except SlewError:
            continue
    return candidate


def _rough(problem: SlewProblem, first: TorqueProfile, intervals: int, points: int = _POINTS) -> Candidate:
    """Solve on a mesh from an initial torque, without a replay: for its cost, and as the start on the next mesh."""
    guess = guess_from(problem, first, intervals, problem.ramps)
    candidate = solved(problem, prepare(problem, intervals, points, guess), guess, problem.limits)
    return replace(candidate, stages=(f"collocation on {intervals} intervals",))


def _verified(problem: SlewProblem, rough: Candidate) -> Candidate:
    """Add points and tighten the limits until a replay satisfies the end and the limits between the nodes too."""
    candidate, intervals = rough, rough.profile.start_values.size
    for points in range(candidate.program.points, _HIGHEST + 1):
        if points > candidate.program.points:
            candidate = _rough(problem, candidate.profile, intervals, points)
        candidate = within_limits(problem, candidate)
        assert candidate.motions is not None
        if prescribed_error(problem, candidate.motions) <= problem.rtol:
            return replace(candidate, gap=rough.gap, stages=rough.stages)
    raise SlewError(
        f"intervals = {intervals}: the replay error at the end is above {problem.rtol:.1e}; use more intervals, or a"
        " larger rtol"
    )


def solved(problem: SlewProblem, program: Transcription, start: Guess | Solution, limits: Limits) -> Candidate:
    """Solve a nonlinear program."""
    solution = solve(program, problem, start, limits)
    return Candidate(solution.profile, "collocation", np.inf, "stationary", program, solution)


def within_limits(problem: SlewProblem, candidate: Candidate) -> Candidate:
    """Replay a solution; while it meets the end but exceeds limits, tighten these and solve again."""
    limits, worst = problem.limits, np.inf
    for _ in range(ROUNDS):
        motions = replayed(problem, candidate.profile)
        excess = violation(problem, candidate.profile, motions)
        worst = max((excess[kind] for kind in limits.without_torque), default=0.0)
        # relative excess at the rounding error of the integrator
        if worst <= ALIKE or prescribed_error(problem, motions) > problem.rtol:
            return replace(candidate, motions=motions)
        limits = limits.tightened(excess)
        candidate = solved(problem, candidate.program, candidate.solution, limits)
    raise SlewError(f"intervals: on this mesh a limit is exceeded by {worst:.1e}; more intervals may help")
