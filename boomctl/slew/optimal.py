"""Optimal slews: the best torque for a problem, played back and certified."""

from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from boomctl.slew.least_time.arc_count import stretched
from boomctl.slew.least_time.linear_start import least_time, linear_time_problem
from boomctl.slew.least_time.newton import Sharpened, sharpened
from boomctl.slew.nlp.bounds import effort_gap, time_gap
from boomctl.slew.nlp.dynamics import hub_jerk
from boomctl.slew.nlp.programme import Programme, Solution, prepare
from boomctl.slew.nlp.transcription import Scheme, transcribe
from boomctl.slew.problem import SlewProblem, changed, slew_problem
from boomctl.slew.reference import cheapest, effort_guess, guess_from, typical_sizes
from boomctl.slew.replay import Motion, binding, end_error, other_models, played, violation
from boomctl.slew.result import LimitsTooTight, SlewCertificate, SlewError, SlewResult
from boomctl.slew.torque import TorqueHistory

if TYPE_CHECKING:
    import control

    from boomctl.slew.plant import SlewMachine

_MESHES = (50, 100, 200, 400, 800)
_MESH_GAP = 1e-4
_TOO_MUCH = 0.05
_ROUNDS = 10
_WRONG = 1e-4
_EXCESS = 1e-9
_HIGHEST = 9  # order for which collocation points are tabulated


@dataclass(frozen=True, eq=False)
class _Plan:
    """A torque before it is judged; what is known of its optimality."""

    history: TorqueHistory
    method: str
    gap: float
    optimality: str
    intervals: int | None = None
    programme: Programme | None = None
    solution: Solution | None = None


def optimal_slew(
    h: "SlewMachine | control.StateSpace",
    angle: float | None,
    torque_limit: float,
    objective: str = "time",
    duration: float | None = None,
    *,
    torque_rate_limit: float | None = None,
    speed_limit: float | None = None,
    tip_limit: float | None = None,
    moment_limit: float | None = None,
    final_speed: float = 0.0,
    initial_state: ArrayLike | None = None,
    final_state: ArrayLike | None = None,
    tip_masses: tuple[float, ...] = (),
    method: str = "collocation",
    tolerance: float = 1e-6,
    intervals: int | None = None,
) -> SlewResult:
    """Turn a flexible beam, or any linear system, through an angle in the best way that the limits allow.

    Parameters
    ----------
    h : hub-beam or control.StateSpace
        A linear system's first input is the torque, its first output the angle; it ends at the rest with ``A x = 0`` and
        that angle. Outputs "tip_displacement" and "root_moment" are known by name.
    angle, torque_limit : float
        Angle to turn through, rad (None leaves it free), and largest torque either way, N m.
    objective, duration : str, float or None
        "time"; or in a given duration [s] "effort" (integral of the torque squared), "jerk" (of the hub's jerk squared),
        "torque-rate" (of the torque's slope squared), "tip" (largest tip displacement).
    torque_rate_limit, speed_limit, tip_limit, moment_limit : float or None
        Limits of the torque's slope [N m/s], hub speed [rad/s], tip displacement [m] and bending moment at the clamp [N m].
    final_speed : float
        Hub speed at the end, rad/s: a spin-up, the beam in steady rotation.
    initial_state, final_state : array_like or None
        In the order of the system's states; None is rest. A final state prescribes all that the torque moves.
    tip_masses : tuple of float
        Other payloads, kg, left without vibration by the same torque; the angle is that of h itself.
    method : str
        "collocation" (Gauss-Legendre), "radau" (Radau IIA) or "shooting", on the same mesh.
    tolerance : float
        Of the end state in the replay, relative.
    intervals : int or None
        Of the mesh; None refines it until halving it changes the cost by less than 1e-4.

    Returns
    -------
    SlewResult

    Raises
    ------
    TypeError, ValueError, SlewError
        Of a bad argument; of an infeasible ask, naming the limits, since when they bind and what would do.
    """
    problem = slew_problem(
        h, angle, torque_limit, objective, duration, torque_rate_limit, speed_limit, tip_limit, moment_limit,
        final_speed, initial_state, final_state, tip_masses, method, tolerance, intervals,
    )  # fmt: skip
    return _judged(problem, _planned(problem))


def resolve(result: SlewResult, *, angle: float | None = None, torque_limit: float | None = None) -> SlewResult:
    """Solve a slew's programme again with other data, started from its solution; nothing is built anew.

    Parameters
    ----------
    result : SlewResult
        Of `optimal_slew` with method "collocation" or "shooting" in its certificate.
    angle, torque_limit : float or None
        What is new; None: as before.

    Returns
    -------
    SlewResult

    Raises
    ------
    TypeError, ValueError
        If the slew was not planned by a programme, or its angle was free or part of given states.
    SlewError
        As `optimal_slew`.
    """
    planned = _known(result).plan
    if planned is None or planned.programme is None or planned.solution is None:
        raise ValueError("result: expected a slew planned by collocation or shooting; plan this one anew")
    problem = changed(planned.problem, angle, torque_limit)
    solution = _kept(problem, planned.programme, planned.solution)
    intervals = planned.programme.transcription.scheme.intervals
    plan = _Plan(solution.history, problem.method, np.nan, "stationary", intervals, planned.programme, solution)
    return _judged(problem, replace(plan, gap=result.certificate.optimality_gap))


def _known(result: SlewResult) -> SlewResult:
    if not isinstance(result, SlewResult):
        raise TypeError(f"result = {type(result).__name__}: expected what optimal_slew returns")
    return result


def _kept(problem: SlewProblem, programme: Programme, before: Solution) -> Solution:
    """Solve again, the limits tightened until the replay keeps them."""
    backoff, worst = dict.fromkeys(problem.limits, 1.0), np.inf
    for _ in range(_ROUNDS):
        before = programme.solve(problem, None, before, backoff)
        excess = violation(problem, before.history, played(problem, before.history))
        worst = max((excess[kind] for kind in problem.limits), default=0.0)
        if worst <= _EXCESS:
            return before
        backoff = _tightened(backoff, excess)
    raise SlewError(f"result: solved again on its mesh a limit is exceeded by {worst:.1e}; plan this one anew")


def _tightened(backoff: dict[str, float], excess: dict[str, float]) -> dict[str, float]:
    """Factors of the limits, smaller where one is exceeded."""
    return {kind: factor / (1.0 + 1.1 * excess[kind] + 1e-6 * (excess[kind] > 0.0)) for kind, factor in backoff.items()}


@dataclass(frozen=True, eq=False)
class Planned:
    """What a result remembers of its planning: the problem, the programme and its solution where there was one."""

    problem: SlewProblem
    programme: Programme | None
    solution: Solution | None


def _planned(problem: SlewProblem) -> _Plan:
    if problem.objective != "time" or problem.limits:
        return _programmed(problem)
    extremal, history = least_time(problem)
    if problem.linear:
        linear = linear_time_problem(problem)
        gap = time_gap(linear, extremal)
        return _Plan(history, "switching times", gap, "proved" if problem.waits and gap < 1.0 else "extremal")
    found = _sharp(problem, history)
    if found is None:
        plan = _programmed(problem, history)
        bold = stretched(plan.history.left / problem.torque_limit, plan.history.duration, problem.torque_limit)
        found = _sharp(problem, bold)
        if found is None:
            return plan
    return _Plan(found.history, "switching times", found.gain, "extremal")


def _sharp(problem: SlewProblem, history: TorqueHistory) -> Sharpened | None:
    found = sharpened(problem, history)
    return found if found is not None and found.gain < _WRONG else None


def _first(problem: SlewProblem, start: TorqueHistory | None, intervals: int) -> TorqueHistory:
    """A torque to start from."""
    if start is not None:
        return start
    if problem.objective != "time":
        assert problem.duration is not None
        return cheapest(problem, problem.duration, intervals).history
    history = least_time(problem)[1]
    stretch = 1.5 if problem.limits else 1.05
    return cheapest(problem, stretch * history.duration, intervals).history


def _programmed(problem: SlewProblem, start: TorqueHistory | None = None) -> _Plan:
    """Refine mesh and order until replay and halved mesh agree."""
    ramp = problem.objective in ("jerk", "torque-rate", "tip") or "rate" in problem.limits
    if problem.intervals is None:
        plan = _refined(problem, start, ramp)
    else:
        programme, solution = _solved(problem, problem.intervals, ramp, start)
        other = _companion(problem, ramp, solution)
        gap = abs(solution.cost - other.cost) / max(abs(solution.cost), 1e-300)
        plan = _Plan(solution.history, problem.method, gap, "stationary", problem.intervals, programme, solution)
    if problem.linear and problem.objective == "effort" and not problem.limits:
        return replace(plan, gap=effort_gap(problem, plan.history), optimality="proved")
    return plan


def _refined(problem: SlewProblem, start: TorqueHistory | None, ramp: bool) -> _Plan:
    """Halve the intervals until that changes the cost by little; a mesh too coarse for any slew is passed over.

    Limits that a mesh exceeds by much, or by no less than a mesh half as fine did, are too tight on any mesh.
    """
    cost, failure, before = np.inf, SlewError("no mesh was tried"), np.inf
    for intervals in _MESHES:
        last = intervals == _MESHES[-1]
        try:
            programme, solution = _solved(problem, intervals, ramp, start, rough=not last)
            gap = abs(solution.cost - cost) / max(abs(solution.cost), 1e-300)
            if gap < _MESH_GAP and not last:
                programme, solution = _solved(problem, intervals, ramp, solution.history)
        except LimitsTooTight as error:
            if error.excess > min(_TOO_MUCH, 0.5 * before):
                raise
            failure, before = error, error.excess
            continue
        except SlewError as error:
            failure = error
            continue
        cost, start = solution.cost, solution.history
        if gap < _MESH_GAP or last:
            return _Plan(solution.history, problem.method, gap, "stationary", intervals, programme, solution)
    raise failure


def _companion(problem: SlewProblem, ramp: bool, solution: Solution) -> Solution:
    """The solution on a mesh half as fine, or twice as fine where that one allows none."""
    assert problem.intervals is not None
    if problem.intervals >= 4 * problem.ends.shape[0]:
        try:
            return _solved(problem, problem.intervals // 2, ramp, solution.history)[1]
        except SlewError:
            pass
    return _solved(problem, 2 * problem.intervals, ramp, solution.history)[1]


def _solved(
    problem: SlewProblem, intervals: int, ramp: bool, start: TorqueHistory | None, rough: bool = False
) -> tuple[Programme, Solution]:
    """Solve on a mesh, with the order raised and the limits tightened until the replay keeps what was asked.

    A rough solution is not replayed: it tells the cost, and where to start on the next mesh.
    """
    if problem.objective == "effort" and not problem.limits and problem.duration is not None:
        guess = effort_guess(problem, problem.duration, intervals)
    else:
        guess = guess_from(problem, _first(problem, start, intervals), intervals, ramp)
    time = problem.duration or guess.duration
    order, backoff = 1 if problem.method == "shooting" else 3, dict.fromkeys(problem.limits, 1.0)
    programme, before, missed, worst = None, None, np.inf, np.inf
    for _ in range(_ROUNDS):
        if programme is None:
            scheme = Scheme(
                problem.method, problem.objective, intervals, order, ramp, problem.duration is None,
                tuple(sorted(problem.limits)),
            )  # fmt: skip
            units = typical_sizes(guess)
            programme = prepare(
                transcribe(problem.plants, scheme, units, problem.torque_limit, time, problem.ends), problem.tolerance
            )
        solution = programme.solve(problem, guess, before, backoff)
        if rough:
            return programme, solution
        motions = played(problem, solution.history)
        excess = violation(problem, solution.history, motions)
        worst = max((excess[kind] for kind in problem.limits), default=0.0)
        missed = end_error(problem, motions)
        if missed > problem.tolerance:
            if order >= _HIGHEST and problem.method != "shooting":
                break
            order, programme, before = 2 * order if problem.method == "shooting" else order + 1, None, None
        elif worst > _EXCESS:
            backoff, before = _tightened(backoff, excess), solution
        else:
            return programme, solution
    raise SlewError(
        f"intervals = {intervals}: the replay misses the end by {missed:.1e} or exceeds a limit by "
        f"{worst:.1e}; expected {problem.tolerance:.1e}. More intervals may help"
    )


def _judged(problem: SlewProblem, plan: _Plan) -> SlewResult:
    """Play a plan back and put the result together."""
    history = plan.history
    motions = played(problem, history)
    error, excess = end_error(problem, motions), violation(problem, history, motions)
    if error > max(problem.tolerance, 1e-12):
        raise SlewError(
            f"the replay ends {error:.1e} off the end state; expected {problem.tolerance:.1e}. "
            "A larger tolerance, or the objective 'effort' with a given duration, may do"
        )
    certificate = SlewCertificate(
        plan.method,
        error,
        max(excess.values()),
        binding(problem, history, motions),
        plan.gap,
        plan.optimality,
        int(history.switches.size) if plan.method == "switching times" else None,
        plan.intervals,
    )
    first, plant = motions[0], problem.plants[0]
    rows = {name: first.places @ row for name, row in plant.rows.items()}
    return SlewResult(
        objective=problem.objective,
        duration=history.duration,
        cost=_cost(problem, history, motions),
        time=first.time,
        torque=history(first.time),
        hub_angle=rows["angle"],
        hub_speed=rows["speed"],
        tip_displacement=rows.get("tip"),
        root_moment=rows.get("moment"),
        states=first.states,
        residual_energy=first.residual_energy,
        end_error=error,
        certificate=certificate,
        history=history,
        replay=partial(other_models, problem, history),
        plan=Planned(problem, plan.programme, plan.solution),
    )


def _cost(problem: SlewProblem, history: TorqueHistory, motions: tuple[Motion, ...]) -> float:
    """The objective's value, from the torque and the replay."""
    if problem.objective == "time":
        return history.duration
    if problem.objective == "effort":
        return history.effort
    if problem.objective == "torque-rate":
        return float(np.sum((history.right - history.left) ** 2 / np.diff(history.edges)))
    if problem.objective == "tip":
        pairs = zip(motions, problem.plants, strict=True)
        return max(float(np.abs(motion.places @ plant.rows["tip"]).max()) for motion, plant in pairs)
    return _jerk_squared(problem, history, motions[0])


def _jerk_squared(problem: SlewProblem, history: TorqueHistory, motion: Motion) -> float:
    """Integral of the hub's jerk squared along the replay, whose instants include all corners of the torque."""
    middle = 0.5 * (motion.time[1:] + motion.time[:-1])
    k = np.clip(np.searchsorted(history.edges, middle) - 1, 0, history.left.size - 1)
    slope = ((history.right - history.left) / np.diff(history.edges))[k]
    jerk, squares = hub_jerk(problem.plants[0]).map(middle.size), []
    for t, places in ((motion.time[:-1], motion.places[:-1]), (motion.time[1:], motion.places[1:])):
        torque = history.left[k] + slope * (t - history.edges[k])
        squares.append(np.array(jerk(places.T, torque[None, :], slope[None, :])).ravel() ** 2)
    return float(0.5 * np.sum((squares[0] + squares[1]) * np.diff(motion.time)))
