"""Solving a transcribed slew: first guess, bounds, IPOPT, and the answer in the units of the plant."""

from dataclasses import dataclass, field, replace

import numpy as np

from boomctl.arrays import Array
from boomctl.exceptions import LimitsTooTightError, SlewError
from boomctl.printing import compact, count
from boomctl.slew.deadline import SlewDeadline, solved
from boomctl.slew.linear import Guess
from boomctl.slew.nlp.interval import Units
from boomctl.slew.nlp.transcription import Transcription, transcribe
from boomctl.slew.objectives import OBJECTIVES
from boomctl.slew.problem import AT_LIMIT, Limits, SlewProblem
from boomctl.slew.torque import TorqueProfile, held, ramped

_OPTIONS = {
    "ipopt.print_level": 0,
    "ipopt.sb": "yes",
    "print_time": False,
    "error_on_fail": False,
    "calc_lam_p": False,
    "ipopt.constr_viol_tol": 1e-10,  # of scaled conditions: a replay then finds the scheme's error, not IPOPT's
    "ipopt.acceptable_iter": 0,  # no answer that is only acceptable
    "ipopt.bound_relax_factor": 0.0,  # the torque's limit is kept to the last digit
    "ipopt.honor_original_bounds": "yes",
    "ipopt.max_iter": 500,  # a safeguard; a mesh that takes more is passed over for a finer one
    "ipopt.nlp_scaling_method": "none",  # the transcription scales
    "ipopt.mu_strategy": "adaptive",
    # the order and the threshold of pivots: left to itself MUMPS loses digits where payloads are nearly equal, and takes
    # up to 27 iterations for 3, each twice as long (measured)
    "ipopt.mumps_pivot_order": 0,
    "ipopt.mumps_pivtol": 1e-4,
    "ipopt.fixed_variable_treatment": "make_parameter",
    "ipopt.warm_start_init_point": "yes",
    "ipopt.warm_start_bound_push": 1e-6,  # starts are near the answer: left almost where they are
    "ipopt.warm_start_mult_bound_push": 1e-6,
    "ipopt.warm_start_slack_bound_push": 1e-6,
    "ipopt.mu_init": 1e-4,  # for the same reason
}
_TOLERANCE, _SHARE = 1e-9, 1e-3  # of the optimality conditions at most, and as a share of the end state's tolerance
_LEAST_TIME = 1e-3  # of the duration over its typical size: a bound that only keeps it positive
_SHOWN = 1e-6  # of a scaled condition: a smaller miss is that of the solver
_NEAR = 1e-3  # of a scaled condition: a limit that is nearer is met, in words (a choice)


@dataclass(frozen=True, eq=False)
class Solution:
    """An answer: torque history, value of the programme's cost, iterations, and where a solver starts from it."""

    history: TorqueProfile
    cost: float
    nit: int
    raw: dict[str, Array] = field(repr=False)

    __repr__ = compact


def solve(t: Transcription, problem: SlewProblem, start: Guess | Solution, limits: Limits) -> Solution:
    """Solve a programme for the data of a problem.

    Parameters
    ----------
    t : Transcription
    problem : SlewProblem
    start : Guess or Solution
        Where to start: a guess, or a solution of the same programme with other data.
    limits : Limits
        The problem's, or tighter ones, which keep the motion within those between the nodes too.

    Raises
    ------
    SlewError
        If no slew is found; it says what is missed most, and when, and which limits are met.
    """
    arguments = _bounds(t, problem, limits)
    if isinstance(start, Solution):
        arguments |= start.raw
    else:
        arguments["x0"] = _start(t, start)
    unit = OBJECTIVES[problem.objective].unit(t.units)
    stage = f"collocation of {count(t.points, 'point')} on {t.intervals} intervals"
    options = _OPTIONS | t.derivatives | {"ipopt.tol": min(_TOLERANCE, _SHARE * problem.rtol)}
    raw, statistics = solved(t.nlp, options, arguments, problem.deadline, stage, unit)
    x = np.array(raw["x"]).ravel()
    duration = problem.duration if t.layout.duration is None else float(x[t.layout.duration]) * t.units.time
    assert duration is not None
    if not statistics["success"]:
        said, missed = _failure(t, problem, duration, x, np.array(raw["g"]).ravel(), arguments)
        if statistics["return_status"] == "Infeasible_Problem_Detected":
            raise LimitsTooTightError(said, missed)
        raise SlewError(said)
    edges, torques = np.linspace(0.0, duration, t.intervals + 1), x[t.layout.torques] * t.units.torque
    history = ramped(edges, torques) if problem.ramps else held(edges, torques)
    again = {"x0": x, **{f"{name}0": np.array(raw[name]).ravel() for name in ("lam_x", "lam_g")}}
    return Solution(history, unit * float(raw["f"]), int(statistics["iter_count"]), again)


def _bounds(t: Transcription, problem: SlewProblem, limits: Limits) -> dict[str, Array]:
    """Data, and bounds of unknowns and conditions."""
    units, layout = t.units, t.layout
    p = np.array([(problem.duration or 0.0) / units.time, *limits.beside_torque.values()])
    lower, upper = np.full(layout.size, -np.inf), np.full(layout.size, np.inf)
    lower[layout.torques], upper[layout.torques] = (s * problem.limits.torque / units.torque for s in (-1, 1))
    lower[layout.states[0]] = upper[layout.states[0]] = problem.start / units.states
    if problem.ramps and (not OBJECTIVES[problem.objective].bounds_tip or "torque_rate" in problem.limits.given):
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
    """First guess."""
    units, layout = t.units, t.layout
    x = np.zeros(layout.size)
    x[layout.states] = guess.states / units.states
    x[layout.torques] = guess.torques / units.torque
    slopes = np.diff(guess.states, axis=0) / (guess.duration / t.intervals) / units.states * units.time
    # one block of points a plant; the mean rate serves all points
    x[layout.rates] = np.hstack([np.tile(slopes[:, own], t.points) for _, own in t.problem.parts])
    if layout.duration is not None:
        x[layout.duration] = guess.duration / units.time
    return x


def _failure(
    t: Transcription, problem: SlewProblem, duration: float, x: Array, g: Array, arguments: dict[str, Array]
) -> tuple[str, float]:
    """Return in words what is missed most, and when, and which limits are met; and the sum of all misses, scaled."""
    said = problem.plants[0].with_unit
    missed = np.nan_to_num(np.maximum(arguments["lbg"] - g, g - arguments["ubg"]), nan=np.inf)
    rows = missed[: -len(t.ends)].reshape(t.intervals, -1)[:, t.defects :]
    over = {}
    for kind in problem.limits.beside_torque:
        worst = rows[:, [name == f"{kind}_limit" for name in t.names]].max(axis=1)
        # limits of the motion are kept at the ends of intervals
        over[kind] = np.append(-np.inf, worst) if kind in problem.plants[0].rows else worst
    words = {kind: f"{kind}_limit = {said(kind, f'{most:g}')}" for kind, most in problem.limits.given.items()}
    most = max(over, key=lambda kind: over[kind].max(), default="")
    what = "the end state cannot be reached"
    if most and over[most].max() > _SHOWN:
        what = f"{words[most]} is exceeded most at t = {np.argmax(over[most]) * duration / t.intervals:.4g} s"
    met = {kind: each > -_NEAR for kind, each in over.items()}
    met["torque"] = np.abs(x[t.layout.torques]) * t.units.torque > AT_LIMIT * problem.limits.torque
    shares = [
        f"{words[kind]} is met from t = {np.argmax(each) * duration / t.intervals:.4g} s, for {np.mean(each):.0%} of the time"
        for kind, each in sorted(met.items(), key=lambda item: -np.mean(item[1]))
        if each.any()
    ]
    sentence = "; ".join([f"no slew of {duration:.6g} s was found: {what}", *shares])
    return sentence, float(np.maximum(missed, 0.0).sum())


def prepare(problem: SlewProblem, intervals: int, points: int, guess: Guess) -> Transcription:
    """Transcribe a problem on a mesh, in units of a guess; it serves any data."""
    sizes, tip = guess.sizes, 1.0
    if "tip" in problem.plants[0].rows:
        row = np.concatenate([plant.rows["tip"] for plant in problem.plants])
        tip = float(max(np.abs(row * sizes).max(), 1e-12))
    units = Units(sizes, problem.limits.torque, problem.duration or guess.duration, tip)
    return transcribe(replace(problem, deadline=SlewDeadline()), intervals, points, units)  # it tells nobody
