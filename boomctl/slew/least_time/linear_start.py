"""The least time of a slew's linear part: where nonlinear plants start, and for linear ones the answer itself."""

from dataclasses import replace

from boomctl.slew.least_time.flow import LinearFlow
from boomctl.slew.least_time.switching import Extremal, LinearTimeProblem, SwitchesNotFound, fastest, polished
from boomctl.slew.problem import SlewProblem
from boomctl.slew.result import SlewError
from boomctl.slew.torque import TorqueHistory, bang_bang

_BESIDE = (0.999, 1.001, 0.99, 1.01)


def linear_time_problem(problem: SlewProblem) -> LinearTimeProblem:
    """Minimum time of the linear part without limits other than the torque's."""
    flow = LinearFlow(problem.A, problem.B)
    return LinearTimeProblem(flow, problem.start, problem.ends, problem.ends @ problem.target, problem.torque_limit)


def least_time(problem: SlewProblem) -> tuple[Extremal, TorqueHistory]:
    """Minimum-time slew of the linear part.

    Raises
    ------
    SlewError
        If no torque within the limit leads to the end, or the switching times are not found.
    """
    linear = linear_time_problem(problem)
    try:
        found = fastest(linear, problem.rigid_time)
    except SwitchesNotFound as failure:
        found = _from_beside(linear, problem.rigid_time)
        if found is None:
            raise failure
    return found, bang_bang(found.switches, found.duration, problem.torque_limit, found.sign)


def _from_beside(linear: LinearTimeProblem, guess: float) -> Extremal | None:
    """From a torque limit beside the given one: where a stretch is about to appear, no grid shows how many there are."""
    for factor in _BESIDE:
        try:
            near = fastest(replace(linear, limit=factor * linear.limit), guess)
        except SlewError:
            continue
        found = polished(linear, near)
        if found is not None:
            return found
    return None
