"""Solving a transcribed slew: first guess, bounds, IPOPT, and the answer in the units of the plant."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from boomctl.arrays import Array
from boomctl.exceptions import LimitsTooTightError, SlewError
from boomctl.printing import compact, count
from boomctl.slew.deadline import solved
from boomctl.slew.linear import Guess
from boomctl.slew.nlp.interval import Units
from boomctl.slew.nlp.transcription import Scheme, Transcription, transcribe
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
    """An answer: torque history, value of the programme's cost, iterations, multipliers."""

    history: TorqueProfile
    cost: float
    nit: int
    raw: dict[str, Any] = field(repr=False)

    __repr__ = compact


@dataclass(frozen=True, eq=False)
class Programme:
    """A programme for any data, and the tolerance of the end state in a replay, relative."""

    transcription: Transcription
    tolerance: float

    __repr__ = compact

    def solve(self, problem: SlewProblem, start: Guess | Solution, limits: Limits | None = None) -> Solution:
        """Solve for the data of a problem.

        Parameters
        ----------
        problem : SlewProblem
        start : Guess or Solution
            Where to start: a guess, or a solution of the same programme with other data.
        limits : Limits or None
            Tighter ones than the problem's, which keep the motion within those between the nodes too.

        Raises
        ------
        SlewError
            If no slew is found; it says what is missed most, and when, and which limits are met.
        """
        arguments = self._bounds(problem, limits or problem.limits)
        if isinstance(start, Solution):
            arguments |= {f"{name}0": start.raw[name] for name in ("lam_x", "lam_g")}
            arguments["x0"] = np.array(start.raw["x"]).ravel()
        else:
            arguments |= self._start(problem, start)
        scheme = self.transcription.scheme
        unit = OBJECTIVES[scheme.objective].unit(self.transcription.units)
        stage = f"collocation of {count(scheme.points, 'point')} on {scheme.intervals} intervals"
        options = _OPTIONS | self.transcription.derivatives | {"ipopt.tol": min(_TOLERANCE, _SHARE * self.tolerance)}
        nlp, deadline = self.transcription.nlp, problem.deadline
        raw, statistics = solved(nlp, options, arguments, deadline, stage, unit)
        if not statistics["success"]:
            said, missed = self._failure(problem, raw, arguments)
            if statistics["return_status"] == "Infeasible_Problem_Detected":
                raise LimitsTooTightError(said, missed)
            raise SlewError(said)
        return self._read(problem, raw, int(statistics["iter_count"]))

    def _bounds(self, problem: SlewProblem, limits: Limits) -> dict[str, Array]:
        """Data, and bounds of unknowns and conditions."""
        t, units, layout = self.transcription, self.transcription.units, self.transcription.layout
        p = np.array([(problem.duration or 0.0) / units.time, *(limits.given[kind] for kind in t.scheme.limits)])
        lower, upper = np.full(layout.size, -np.inf), np.full(layout.size, np.inf)
        lower[layout.torques], upper[layout.torques] = (s * problem.limits.torque / units.torque for s in (-1, 1))
        lower[layout.states[0]] = upper[layout.states[0]] = problem.start / units.states
        if t.scheme.ramp and (not OBJECTIVES[problem.objective].bounds_tip or "torque_rate" in t.scheme.limits):
            ends = layout.torques[[0, -1]]
            lower[ends] = upper[ends] = 0.0
        if layout.duration is not None:
            lower[layout.duration] = _LEAST_TIME
        if layout.bound is not None:
            lower[layout.bound] = 0.0
        target, inequalities = t.ends @ (problem.target / units.states), np.full(len(t.names), -np.inf)
        stages = np.tile(np.concatenate([np.zeros(t.defects), inequalities]), t.scheme.intervals)
        low = np.concatenate([stages, np.full(t.last, -np.inf), target])
        high = np.concatenate([np.zeros(t.stages_end + t.last), target])
        return {"lbx": lower, "ubx": upper, "lbg": low, "ubg": high, "p": p}

    def _start(self, problem: SlewProblem, guess: Guess) -> dict[str, Array]:
        """First guess."""
        t, units, layout = self.transcription, self.transcription.units, self.transcription.layout
        N, x = t.scheme.intervals, np.zeros(layout.size)
        x[layout.states] = guess.states / units.states
        x[layout.torques] = guess.torques / units.torque
        slopes = np.diff(guess.states, axis=0) / (guess.duration / N) / units.states * units.time
        # one block of points a plant; the mean rate serves all points
        x[layout.rates] = np.hstack([np.tile(slopes[:, own], t.scheme.points) for own in t.blocks])
        if layout.duration is not None:
            x[layout.duration] = guess.duration / units.time
        return {"x0": x}

    def _read(self, problem: SlewProblem, raw: dict[str, Any], iterations: int) -> Solution:
        scheme, units, layout = self.transcription.scheme, self.transcription.units, self.transcription.layout
        x = np.array(raw["x"]).ravel()
        duration = problem.duration
        if layout.duration is not None:
            duration = float(x[layout.duration]) * units.time
        assert duration is not None
        edges = np.linspace(0.0, duration, scheme.intervals + 1)
        torques = x[layout.torques] * units.torque
        history = ramped(edges, torques) if scheme.ramp else held(edges, torques)
        unit = OBJECTIVES[scheme.objective].unit(units)
        return Solution(history, unit * float(raw["f"]), iterations, raw)

    def _failure(self, problem: SlewProblem, raw: dict[str, Any], arguments: dict[str, Array]) -> tuple[str, float]:
        """Return in words what is missed most, and when, and which limits are met; and the sum of all misses, scaled."""
        t, N, said = self.transcription, self.transcription.scheme.intervals, problem.plants[0].with_unit
        g, x = np.array(raw["g"]).ravel(), np.array(raw["x"]).ravel()
        missed = np.nan_to_num(np.maximum(arguments["lbg"] - g, g - arguments["ubg"]), nan=np.inf)
        duration = problem.duration or float(x[t.layout.duration or 0]) * t.units.time
        rows = missed[: t.stages_end].reshape(N, t.stage_rows)[:, t.defects :]
        given = {
            f"{kind}_limit": f"{kind}_limit = {said(kind, f'{most:g}')}" for kind, most in problem.limits.given.items()
        }
        over = {name: rows[:, [each == name for each in t.names]].max(axis=1) for name in given if name in t.names}
        most = max(over, key=lambda name: over[name].max(), default="")
        what = "the end state cannot be reached"
        if most and over[most].max() > _SHOWN:
            what = f"{given[most]} is exceeded most at t = {np.argmax(over[most]) * duration / N:.4g} s"
        met = {name: each > -_NEAR for name, each in over.items()}
        met["torque_limit"] = np.abs(x[t.layout.torques]) * t.units.torque > AT_LIMIT * problem.limits.torque
        shares = [
            f"{given[name]} is met from t = {np.argmax(each) * duration / N:.4g} s, for {np.mean(each):.0%} of the time"
            for name, each in sorted(met.items(), key=lambda item: -np.mean(item[1]))
            if each.any()
        ]
        return "; ".join([f"no slew of {duration:.6g} s was found: {what}", *shares]), float(
            np.maximum(missed, 0.0).sum()
        )


def prepare(problem: SlewProblem, scheme: Scheme, guess: Guess, tolerance: float) -> Programme:
    """Transcribe a problem in units of a guess; it serves any data.

    Parameters
    ----------
    problem : SlewProblem
    scheme : Scheme
    guess : Guess
    tolerance : float
        Of the end state in a replay, relative.
    """
    sizes, tip = guess.sizes, 1.0
    if "tip" in problem.plants[0].rows:
        row = np.concatenate([plant.rows["tip"] for plant in problem.plants])
        tip = float(max(np.abs(row * sizes).max(), 1e-12))
    units = Units(sizes, problem.limits.torque, problem.duration or guess.duration, tip)
    return Programme(transcribe(problem.parts, problem.ends, scheme, units), tolerance)
