"""A slew by a nonlinear programme: mesh, points and limits are refined until a replay keeps what was asked."""

from dataclasses import dataclass, replace

import numpy as np

from boomctl.exceptions import LimitsTooTightError, SlewError
from boomctl.lti.rounding import ALIKE
from boomctl.progress import OutOfTimeError
from boomctl.slew.linear import Guess, guess_from, least_effort
from boomctl.slew.nlp.programme import Programme, Solution, prepare
from boomctl.slew.nlp.transcription import Scheme
from boomctl.slew.objectives import OBJECTIVES
from boomctl.slew.problem import MESH_GAP, MESHES, ROUNDS, SlewProblem
from boomctl.slew.replay import Motion, played, prescribed_error, violation
from boomctl.slew.torque import TorqueProfile

_TOO_MUCH = 0.05  # by which a coarse mesh may exceed a limit and a finer still keep it; a choice
_SEARCH = 0.6  # share of the time in which meshes are refined; the rest is for a verified answer on a coarser one
_HIGHEST = 9  # collocation points, order 17 and more: beyond, a step is not what the replay finds in error; a choice
_POINTS = 3  # collocation points at first, order 6: errors of the end below the tolerance on most meshes (a choice)
_LONGER = 1.5  # times the linear part's least time: what a first guess takes within more limits than the torque's


@dataclass(frozen=True, eq=False)
class Refined:
    """A programme and its solution, which a replay confirms.

    Attributes
    ----------
    programme : Programme
    solution : Solution
    gap : float
        Change of the cost when the mesh is halved, relative; infinite if there was no time for another mesh.
    stages : tuple of str
        The meshes that were tried, in words.
    motions : tuple of Motion or None
        The replay of the solution; None where it was not replayed.
    """

    programme: Programme
    solution: Solution
    gap: float
    stages: tuple[str, ...]
    motions: tuple[Motion, ...] | None = None


def refined(problem: SlewProblem, least: TorqueProfile | None) -> Refined:
    """Solve on the mesh asked for, or on finer ones until halving the intervals changes the cost by little.

    A mesh too coarse for any slew is passed over. Limits that a mesh exceeds by much, or by no less than a mesh half as fine
    did, are too tight on any mesh.

    Parameters
    ----------
    problem : SlewProblem
    least : TorqueProfile or None
        The linear part's slew of least time, from which a slew of free duration starts.

    Raises
    ------
    SlewError
        If no mesh has a solution that a replay confirms; if the time is over before, the message says what was reached.
    """
    if problem.intervals is not None:
        stages = (f"collocation on {problem.intervals} intervals",)
        guess = _guess(problem, least, None, problem.intervals)
        programme, solution, motions = _solved(problem, guess, problem.intervals)
        try:
            gap = _gap(solution.cost, _companion(problem, programme, solution).cost)
        except OutOfTimeError as over:
            return Refined(programme, solution, np.inf, (*stages, f"out of time: {over}"), motions)
        return Refined(programme, solution, gap, stages, motions)
    best: list[Refined] = []
    try:
        return _on_finer_meshes(problem, least, best)
    except OutOfTimeError as over:
        if not best:
            raise
        result = best[-1]
        motions = played(problem, result.solution.history)
        excess = violation(problem, result.solution.history, motions)
        stages = (*result.stages, f"out of time: {over}")
        # relative, over a limit, in a replay: rounding of the integrator
        if prescribed_error(problem, motions) <= problem.rtol and max(excess.values()) <= ALIKE:
            return replace(result, stages=stages, motions=motions)
        result = best[max(0, len(best) - 2)]  # a coarser mesh, on which points can be added in the time that is left
        intervals = result.programme.transcription.scheme.intervals
        guess = _guess(problem, least, result.solution.history, intervals)
        programme, solution, motions = _solved(problem, guess, intervals)
        return Refined(programme, solution, result.gap, (*stages, f"collocation on {intervals} intervals"), motions)


def _on_finer_meshes(problem: SlewProblem, least: TorqueProfile | None, best: list[Refined]) -> Refined:
    """Solve on finer and finer meshes; all that is solved on the way is entered in `best`.

    A mesh takes twice as long as one half as fine, and is not begun where that is more than what is left.
    """
    cost, failure, before, stages, coarser = np.inf, SlewError("no mesh was tried"), np.inf, (), None
    whole, took = problem.deadline, 0.0
    for intervals in MESHES:
        if best:  # there is something to fall back on
            problem = replace(problem, deadline=replace(whole, limit=_SEARCH * whole.limit))
        last, stages = intervals == MESHES[-1], (*stages, f"collocation on {intervals} intervals")
        begun = problem.deadline.elapsed
        if 2.0 * took > problem.deadline.limit - begun:
            raise OutOfTimeError(stages[-1])
        try:
            guess = _guess(problem, least, coarser, intervals)
            programme, solution, motions = _solved(problem, guess, intervals, rough=not last)
            gap = _gap(solution.cost, cost)
            best.append(Refined(programme, solution, gap, stages))
            if gap < MESH_GAP and not last:
                guess = _guess(problem, least, solution.history, intervals)
                programme, solution, motions = _solved(problem, guess, intervals)
        except LimitsTooTightError as error:
            if error.excess > min(_TOO_MUCH, 0.5 * before):
                raise
            failure, before = error, error.excess
            continue
        except SlewError as error:
            failure = error
            continue
        finally:
            took = problem.deadline.elapsed - begun
        cost, coarser = solution.cost, solution.history
        if gap < MESH_GAP or last:
            return Refined(programme, solution, gap, stages, motions)
    raise failure


def _gap(cost: float, other: float) -> float:
    return abs(cost - other) / max(abs(cost), 1e-300)


def _companion(problem: SlewProblem, programme: Programme, solution: Solution) -> Solution:
    """The solution on a mesh half as fine, or twice as fine where that one is too coarse; it is about as exact as the given.

    Too coarse is a mesh that allows no slew. The solution tells the cost alone: it is not replayed.
    """
    scheme = programme.transcription.scheme
    intervals, points = scheme.intervals, scheme.points
    if intervals >= 4 * problem.ends.shape[0]:  # fewer than two an end condition would leave nothing to choose
        guess = _guess(problem, None, solution.history, intervals // 2)
        try:
            return _solved(problem, guess, intervals // 2, rough=True, points=min(points + 1, _HIGHEST))[1]
        except SlewError:
            pass
    guess = _guess(problem, None, solution.history, 2 * intervals)
    return _solved(problem, guess, 2 * intervals, rough=True, points=points)[1]


def _ramps(problem: SlewProblem) -> bool:
    """Whether the torque is to be continuous."""
    return OBJECTIVES[problem.objective].continuous or problem.limits.torque_rate is not None


def _guess(problem: SlewProblem, least: TorqueProfile | None, before: TorqueProfile | None, intervals: int) -> Guess:
    """Where to start: from the torque of another mesh; else from the linear part's least time, or least effort."""
    if before is None and problem.fastest:
        before = least
    if before is None:
        duration = problem.duration or (0.0 if least is None else _LONGER * least.duration)
        before = least_effort(problem, duration, intervals).history
    return guess_from(problem, before, intervals, _ramps(problem))


def _solved(
    problem: SlewProblem, guess: Guess, intervals: int, rough: bool = False, points: int = _POINTS
) -> tuple[Programme, Solution, tuple[Motion, ...] | None]:
    """Solve on a mesh, with points added and the limits tightened until the replay, returned too, keeps what was asked.

    A rough solution is not replayed: it tells the cost, and where to start on the next mesh.
    """
    limits = problem.limits
    programme, before, missed, worst = None, guess, np.inf, np.inf
    for _ in range(ROUNDS):
        if programme is None:
            kinds = tuple(limits.beside_torque)
            scheme = Scheme(
                objective=problem.objective,
                intervals=intervals,
                points=points,
                ramp=_ramps(problem),
                free_time=problem.duration is None,
                limits=kinds,
            )
            programme = prepare(problem, scheme, guess, problem.rtol)
        solution = programme.solve(problem, before, limits)
        if rough:
            return programme, solution, None
        motions = played(problem, solution.history)
        excess = violation(problem, solution.history, motions)
        worst = max((excess[kind] for kind in limits.beside_torque), default=0.0)
        missed = prescribed_error(problem, motions)
        if missed > problem.rtol:
            if points >= _HIGHEST:
                break
            points, programme, before = points + 1, None, guess
        elif worst > ALIKE:
            limits, before = limits.tightened(excess), solution
        else:
            return programme, solution, motions
    raise SlewError(
        f"intervals = {intervals}: the replay misses the end by {missed:.1e} or exceeds a limit by "
        f"{worst:.1e}; expected {problem.rtol:.1e}. More intervals may help"
    )


def solved_again(problem: SlewProblem, programme: Programme, before: Solution) -> tuple[Solution, tuple[Motion, ...]]:
    """Solve a programme with other data, the limits tightened until the replay, returned too, keeps them."""
    limits, worst = problem.limits, np.inf
    for _ in range(ROUNDS):
        before = programme.solve(problem, before, limits)
        motions = played(problem, before.history)
        excess = violation(problem, before.history, motions)
        worst = max((excess[kind] for kind in limits.beside_torque), default=0.0)
        if worst <= ALIKE:
            return before, motions
        limits = limits.tightened(excess)
    raise SlewError(f"result: solved again on its mesh a limit is exceeded by {worst:.1e}; plan this one anew")
