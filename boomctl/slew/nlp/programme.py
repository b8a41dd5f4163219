"""Solving a transcribed slew: first guess, bounds, IPOPT, and the answer in the units of the plant.

Fatrop is not used. On the benchmark of least effort (shooting, 3 modes, 200 intervals, the same programme and states to
start from, CasADi's interface with the stages given) it found the same optimum to 5e-9, in 13 iterations and 0.45 s of
processor time with its building; IPOPT, started with multipliers of the linear part, in 4 and 0.08 s.
"""

from dataclasses import dataclass, field
from typing import Any

import casadi as ca
import numpy as np

from boomctl.arrays import Array
from boomctl.printing import compact
from boomctl.slew.deadline import Watch, solved
from boomctl.slew.linear import Guess
from boomctl.slew.nlp.diagnosis import Relaxed, relaxed
from boomctl.slew.nlp.interval import Units
from boomctl.slew.nlp.transcription import Scheme, Transcription, transcribe
from boomctl.slew.objectives import OBJECTIVES
from boomctl.slew.problem import AT_LIMIT, Limits, SlewProblem
from boomctl.slew.result import LimitsTooTight, SlewError
from boomctl.slew.torque import TorqueHistory, held, ramped

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
_SHOWN = 1e-7  # of a scaled condition: a smaller miss is not told


@dataclass(frozen=True, eq=False)
class Solution:
    """An answer: torque history, value of the programme's cost, iterations, multipliers."""

    history: TorqueHistory
    cost: float
    iterations: int
    raw: dict[str, Any] = field(repr=False)

    __repr__ = compact


@dataclass(frozen=True, eq=False)
class Programme:
    """A programme with its solver, for any data."""

    transcription: Transcription
    tolerance: float
    solver: Any
    watch: Watch

    __repr__ = compact

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle what it was made of; the solver is built anew."""
        return _solvable, (self.transcription, self.tolerance)

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
            If no slew is found; it names the limit that is missed most, and when.
        """
        arguments = self._bounds(problem, limits or problem.limits)
        if isinstance(start, Solution):
            arguments |= {f"{name}0": start.raw[name] for name in ("lam_x", "lam_g")}
            arguments["x0"] = np.array(start.raw["x"]).ravel()
        else:
            arguments |= self._start(problem, start)
        raw = self._run(problem, arguments)
        if not self.solver.stats()["success"]:
            raw = self._again(problem, arguments, raw)
        return self._read(problem, raw)

    def _run(self, problem: SlewProblem, arguments: dict[str, Array]) -> dict[str, Any]:
        scheme = self.transcription.scheme
        unit = OBJECTIVES[scheme.objective].unit(self.transcription.units)
        stage = f"{scheme.method} of order {scheme.order} on {scheme.intervals} intervals"
        return solved(self.solver, self.watch, arguments, problem.deadline, stage, unit)

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
        if t.scheme.method != "shooting":
            slopes = np.diff(guess.states, axis=0) / (guess.duration / N) / units.states * units.time
            # one block of points a plant; the mean rate serves all points
            x[layout.rates] = np.hstack([np.tile(slopes[:, own], t.scheme.order) for own in t.blocks])
        if layout.duration is not None:
            x[layout.duration] = guess.duration / units.time
        return {"x0": x}

    def _again(self, problem: SlewProblem, arguments: dict[str, Array], raw: dict[str, Any]) -> dict[str, Any]:
        """Let the limits give: where none has to, start from what that finds; else say which gives, when and how much."""
        limits = problem.limits.given
        found = relaxed(self.transcription, arguments, limits, problem.duration, problem.deadline)
        if found is None:
            raise SlewError(self._failure(problem, raw, arguments["lbg"], arguments["ubg"]))
        if found.excesses:
            most = found.excesses[0]
            raise LimitsTooTight(_told(problem, found), most.needed / limits[most.kind] - 1.0)
        plain = {name: value for name, value in arguments.items() if not name.startswith("lam")}
        raw = self._run(problem, plain | {"x0": found.unknowns})
        if not self.solver.stats()["success"]:
            raise SlewError(
                f"a slew of {found.duration:.6g} s within all limits exists, but no best one was found on "
                f"{self.transcription.scheme.intervals} intervals; expected a finer mesh or wider limits"
            )
        return raw

    def _read(self, problem: SlewProblem, raw: dict[str, Any]) -> Solution:
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
        return Solution(history, unit * float(raw["f"]), int(self.solver.stats()["iter_count"]), raw)

    def _failure(self, problem: SlewProblem, raw: dict[str, Any], low: Array, high: Array) -> str:
        """In words: which condition is missed most, and when."""
        t, N = self.transcription, self.transcription.scheme.intervals
        g, x = np.array(raw["g"]).ravel(), np.array(raw["x"]).ravel()
        missed = np.maximum(low - g, g - high)
        missed = np.maximum(np.where(np.isfinite(missed), missed, 0.0), 0.0)
        duration = problem.duration or float(x[t.layout.duration or 0]) * t.units.time
        worst, where, when = 0.0, "the end state", duration
        stages = missed[: t.stages_end].reshape(N, t.stage_rows)
        for j, name in enumerate(t.names):
            k = int(np.argmax(stages[:, t.defects + j]))
            if stages[k, t.defects + j] > max(worst, _SHOWN):
                worst, where, when = float(stages[k, t.defects + j]), name, k * duration / N
        torques, most = np.abs(x[t.layout.torques]) * t.units.torque, problem.limits.torque
        limit = problem.plants[0].with_unit("torque", f"{most:g}")
        bound = f"torque_limit = {limit} binds on {np.mean(torques > AT_LIMIT * most):.0%} of it"
        return f"no slew of {duration:.6g} s was found: {where} cannot be met at t = {when:.4g} s; {bound}"


def _told(problem: SlewProblem, found: Relaxed) -> str:
    """Which limits bind, when, and what would do."""
    said = problem.plants[0].with_unit
    given = {kind: f"{kind}_limit = {said(kind, f'{limit:g}')}" for kind, limit in problem.limits.given.items()}
    parts = [
        f"{given[each.kind]} binds from t = {each.first:.4g} s, most at t = {each.worst:.4g} s; "
        f"{said(each.kind, f'{each.needed:.4g}')} would do"
        for each in found.excesses
    ]
    parts += [f"{given[kind]} is met from t = {when:.4g} s" for kind, when in found.met.items()]
    how_long = f"of {found.duration:.6g} s " if problem.duration is not None else ""
    return f"no slew {how_long}keeps the limits: {'; and '.join(parts)}"


def prepare(problem: SlewProblem, scheme: Scheme, guess: Guess, tolerance: float) -> Programme:
    """Transcribe a problem in units of a guess and build the solver; both serve any data.

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
    return _solvable(transcribe(problem.parts, problem.ends, scheme, units), tolerance)


def _solvable(transcription: Transcription, tolerance: float) -> Programme:
    """A programme with its solver."""
    options = _OPTIONS | transcription.derivatives | {"ipopt.tol": min(_TOLERANCE, _SHARE * tolerance)}
    watch = Watch(transcription.layout.size, int(transcription.nlp.size1_out(1)))
    options |= {"iteration_callback": watch}
    return Programme(transcription, tolerance, ca.nlpsol("slew", "ipopt", transcription.nlp, options), watch)
