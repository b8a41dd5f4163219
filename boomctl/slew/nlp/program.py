"""Solution of a transcribed slew by IPOPT: initial guess, bounds, and the result in the units of the plant."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from math import inf
from typing import Any

import casadi as ca
import numpy as np

from boomctl.arrays import Array
from boomctl.exceptions import LimitsTooTightError, SlewError
from boomctl.printing import compact, count
from boomctl.progress import OutOfTimeError
from boomctl.slew.deadline import SlewDeadline
from boomctl.slew.linear import Guess
from boomctl.slew.nlp.transcription import Transcription, transcribe
from boomctl.slew.objectives import OBJECTIVES, Units
from boomctl.slew.problem import AT_LIMIT, RTOL, Limits, SlewProblem
from boomctl.slew.torque import TorqueProfile, held, ramped

_OPTIONS = {
    "ipopt.print_level": 0,
    "ipopt.sb": "yes",
    "print_time": False,
    "error_on_fail": False,
    "calc_lam_p": False,
    "ipopt.constr_viol_tol": 1e-10,  # scaled; the replay error is then that of the scheme, not of IPOPT
    "ipopt.acceptable_iter": 0,  # do not accept results at the acceptable level
    "ipopt.bound_relax_factor": 0.0,  # the torque limit holds exactly
    "ipopt.max_iter": 500,  # if exceeded, the next finer mesh is used
    "ipopt.nlp_scaling_method": "none",  # the transcription scales
    "ipopt.mu_strategy": "adaptive",
    # pivot order and threshold: with its defaults MUMPS is inaccurate for nearly equal payloads, and needs more and slower
    # iterations
    "ipopt.mumps_pivot_order": 0,
    "ipopt.mumps_pivtol": 1e-4,
    "ipopt.warm_start_init_point": "yes",
    "ipopt.warm_start_bound_push": 1e-6,  # warm starts are near the solution and are shifted little
    "ipopt.warm_start_mult_bound_push": 1e-6,
    "ipopt.warm_start_slack_bound_push": 1e-6,
    "ipopt.mu_init": 1e-4,  # for the same reason
}
_TOLERANCE, _FRACTION = 1e-9, 1e-3  # tolerance of IPOPT at most, and as a fraction of the end state's tolerance
_LEAST_TIME = 1e-3  # lower bound of the scaled duration, to keep it positive


@dataclass(frozen=True, eq=False)
class Solution:
    """Solution of a nonlinear program: torque profile, cost, iterations, and data for a warm start."""

    profile: TorqueProfile
    cost: float
    nit: int
    raw: dict[str, Array] = field(repr=False)

    __repr__ = compact


class _Watch(ca.Callback):
    """Iteration callback of IPOPT; an exception within it is stored and stops the solver."""

    def __init__(self, on_iteration: Callable[[float, Array], None], conditions: int) -> None:
        ca.Callback.__init__(self)
        self.on_iteration, self.sizes = on_iteration, {"f": 1, "g": conditions}
        self.failed: BaseException | None = None
        self.construct("watch", {})

    def get_n_in(self) -> int:
        return ca.nlpsol_n_out()

    def get_name_in(self, i: int) -> str:
        return ca.nlpsol_out(i)

    def get_sparsity_in(self, i: int) -> ca.Sparsity:
        return ca.Sparsity.dense(self.sizes.get(ca.nlpsol_out(i), 0), 1)

    def eval(self, arg: Any) -> list[int]:
        values = dict(zip(ca.nlpsol_out(), arg, strict=True))
        try:
            self.on_iteration(float(values["f"]), np.array(values["g"]).ravel())
        except BaseException as error:  # CasADi would suppress it
            self.failed = error
        return [int(self.failed is not None)]


def solve(t: Transcription, problem: SlewProblem, start: Guess | Solution, limits: Limits) -> Solution:
    """Solve a nonlinear program for the data of a problem.

    Parameters
    ----------
    t : Transcription
    problem : SlewProblem
    start : Guess or Solution
        Initial guess, or a solution of the same program with other data.
    limits : Limits
        Limits of the problem, or tighter ones to satisfy them between the nodes too.

    Raises
    ------
    SlewError
        If no slew is found; the message names the largest violation, its time, and the active limits.
    """
    arguments = _bounds(t, problem, limits)
    if isinstance(start, Solution):
        arguments |= start.raw
    else:
        arguments["x0"] = _start(t, start)
    unit = OBJECTIVES[problem.objective].unit(t.units)
    stage = f"collocation of {count(t.points, 'point')} on {t.intervals} intervals"
    options = _OPTIONS | t.derivatives | {"ipopt.tol": min(_TOLERANCE, _FRACTION * problem.rtol)}
    raw, statistics = _solved(t.nlp, options, arguments, problem.deadline, stage, unit)
    x = np.array(raw["x"]).ravel()
    duration = problem.duration if t.layout.duration is None else float(x[t.layout.duration]) * t.units.time
    assert duration is not None
    if not statistics["success"]:
        message, excess = _failure(t, problem, duration, x, np.array(raw["g"]).ravel(), arguments)
        if statistics["return_status"] == "Infeasible_Problem_Detected":
            raise LimitsTooTightError(message, excess)
        raise SlewError(message)
    edges, torques = np.linspace(0.0, duration, t.intervals + 1), x[t.layout.torques] * t.units.torque
    profile = ramped(edges, torques) if problem.ramps else held(edges, torques)
    again = {"x0": x, **{f"{name}0": np.array(raw[name]).ravel() for name in ("lam_x", "lam_g")}}
    return Solution(profile, unit * float(raw["f"]), int(statistics["iter_count"]), again)


def _solved(
    nlp: ca.Function,
    options: dict[str, Any],
    arguments: dict[str, Array],
    deadline: SlewDeadline,
    stage: str,
    unit: float,
) -> tuple[dict[str, Any], dict[str, Any]]:
    """Solve a nonlinear program by IPOPT within a time limit; return result and statistics.

    IPOPT stops at its wall time limit; its iteration callback reports progress and stops it after an interrupt. ``unit`` is
    the objective at a scaled cost of one.
    """
    deadline.check(stage)
    objectives: list[float | None] = [None]

    def on_iteration(cost: float, g: Array) -> None:
        """Report an iteration, with the objective of the best feasible iterate so far."""
        violation = float(np.max(np.maximum(arguments["lbg"] - g, g - arguments["ubg"]), initial=0.0))
        candidates = [
            value for value in (objectives[-1], unit * cost if violation <= RTOL else None) if value is not None
        ]
        objectives.append(min(candidates, default=None))
        deadline.check(f"{stage}, iteration {len(objectives) - 1}", objectives[-1], violation)

    watch = _Watch(on_iteration, arguments["lbg"].size)
    options = options | {"iteration_callback": watch}
    if deadline.limit < inf:
        left = deadline.limit - deadline.elapsed
        if left <= 0.0:  # IPOPT requires a positive limit
            raise OutOfTimeError(stage)
        options["ipopt.max_wall_time"] = left
    solver = ca.nlpsol("slew", "ipopt", nlp, options)
    result, statistics = solver(**arguments), solver.stats()
    if watch.failed is not None:
        raise watch.failed
    if statistics["return_status"] == "Maximum_WallTime_Exceeded":
        raise OutOfTimeError(stage)
    return result, statistics


def _bounds(t: Transcription, problem: SlewProblem, limits: Limits) -> dict[str, Array]:
    """Return the data, and bounds of unknowns and conditions."""
    units, layout = t.units, t.layout
    p = np.array([(problem.duration or 0.0) / units.time, *limits.without_torque.values()])
    lower, upper = np.full(layout.size, -np.inf), np.full(layout.size, np.inf)
    lower[layout.torques], upper[layout.torques] = (s * problem.limits.torque / units.torque for s in (-1, 1))
    lower[layout.states[0]] = upper[layout.states[0]] = problem.start / units.states
    if problem.ramps and (not OBJECTIVES[problem.objective].bounds_tip or "torque_rate" in problem.limits.by_kind):
        ends = layout.torques[[0, -1]]
        lower[ends] = upper[ends] = 0.0
    if layout.duration is not None:
        lower[layout.duration] = _LEAST_TIME
    if layout.bound is not None:
        lower[layout.bound] = 0.0
    target, inequalities = t.ends @ (problem.target / units.states), np.full(len(t.names), -np.inf)
    stages = np.tile(np.concatenate([np.zeros(t.defects), inequalities]), t.intervals)
    high = np.concatenate([np.zeros(stages.size), target])
    return {"lbx": lower, "ubx": upper, "lbg": np.concatenate([stages, target]), "ubg": high, "p": p}


def _start(t: Transcription, guess: Guess) -> Array:
    """Return the initial values of the unknowns."""
    units, layout = t.units, t.layout
    x = np.zeros(layout.size)
    x[layout.states] = guess.states / units.states
    x[layout.torques] = guess.torques / units.torque
    rates = np.diff(guess.states, axis=0) / (guess.duration / t.intervals) / units.states * units.time
    # one block of points per plant; the mean rate is used at all points
    x[layout.rates] = np.hstack([np.tile(rates[:, own], t.points) for _, own in t.problem.parts])
    if layout.duration is not None:
        x[layout.duration] = guess.duration / units.time
    return x


def _failure(
    t: Transcription, problem: SlewProblem, duration: float, x: Array, g: Array, arguments: dict[str, Array]
) -> tuple[str, float]:
    """Return a message on the largest violation and the active limits, and the sum of all scaled violations."""
    with_unit = problem.plants[0].with_unit
    violations = np.nan_to_num(np.maximum(arguments["lbg"] - g, g - arguments["ubg"]), nan=np.inf)
    rows = violations[: -len(t.ends)].reshape(t.intervals, -1)[:, t.defects :]
    over = {}
    for kind in problem.limits.without_torque:
        worst = rows[:, [name == f"{kind}_limit" for name in t.names]].max(axis=1)
        # limits of the motion apply at the ends of intervals
        over[kind] = np.append(-np.inf, worst) if kind in problem.plants[0].rows else worst
    words = {kind: f"{kind}_limit = {with_unit(kind, f'{most:g}')}" for kind, most in problem.limits.by_kind.items()}
    most = max(over, key=lambda kind: over[kind].max(), default="")
    what = "the end state cannot be reached"
    if most and over[most].max() > RTOL:
        what = f"{words[most]} is exceeded most at t = {np.argmax(over[most]) * duration / t.intervals:.4g} s"
    met = {kind: near > AT_LIMIT - 1.0 for kind, near in over.items()}
    met["torque"] = np.abs(x[t.layout.torques]) * t.units.torque > AT_LIMIT * problem.limits.torque
    active = [
        f"{words[kind]} is active from t = {np.argmax(near) * duration / t.intervals:.4g} s,"
        f" {100.0 * np.mean(near):.0f} % of the time"
        for kind, near in sorted(met.items(), key=lambda item: -np.mean(item[1]))
        if near.any()
    ]
    sentence = "; ".join([f"no slew of {duration:.6g} s was found: {what}", *active])
    return sentence, float(np.maximum(violations, 0.0).sum())


def prepare(problem: SlewProblem, intervals: int, points: int, guess: Guess) -> Transcription:
    """Transcribe a problem on a mesh, in units of a guess; the program accepts any data."""
    sizes, tip = guess.sizes, 1.0
    if "tip" in problem.plants[0].rows:
        row = np.concatenate([plant.rows["tip"] for plant in problem.plants])
        tip = float(max(np.abs(row * sizes).max(), 1e-12))
    units = Units(sizes, problem.limits.torque, problem.duration or guess.duration, tip)
    return transcribe(replace(problem, deadline=SlewDeadline()), intervals, points, units)  # without a callback
