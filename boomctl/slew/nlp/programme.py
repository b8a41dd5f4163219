"""Solving a transcribed slew: bounds, first guess, IPOPT, and the answer in the units of the plant.

Fatrop is not used. On the benchmark of least effort (shooting, 3 modes, 200 intervals, the same programme and states to
start from, CasADi's interface with the stages given) it found the same optimum to 5e-9, in 13 iterations and 0.45 s of
processor time with its building; IPOPT, which also takes the multipliers of the linear part, in 4 and 0.08 s.
"""

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from boomctl.arrays import Array
from boomctl.slew.nlp.diagnosis import Relaxed, relaxed
from boomctl.slew.nlp.transcription import Transcription
from boomctl.slew.problem import LIMITS, UNITS, SlewProblem
from boomctl.slew.result import LimitsTooTight, SlewError
from boomctl.slew.torque import TorqueHistory, held, ramped

_OPTIONS = {
    "ipopt.print_level": 0,
    "ipopt.sb": "yes",
    "print_time": False,
    "error_on_fail": False,
    "calc_lam_p": False,
    "ipopt.tol": 1e-10,
    "ipopt.constr_viol_tol": 1e-10,
    "ipopt.acceptable_iter": 0,
    "ipopt.bound_relax_factor": 0.0,
    "ipopt.honor_original_bounds": "yes",
    "ipopt.max_iter": 500,
    "ipopt.nlp_scaling_method": "none",
    "ipopt.mu_strategy": "adaptive",
    "ipopt.fixed_variable_treatment": "make_parameter",
    "ipopt.warm_start_init_point": "yes",
    "ipopt.warm_start_bound_push": 1e-6,
    "ipopt.warm_start_mult_bound_push": 1e-6,
    "ipopt.warm_start_slack_bound_push": 1e-6,
    "ipopt.mu_init": 1e-4,
}


@dataclass(frozen=True, eq=False)
class Guess:
    """A start.

    Attributes
    ----------
    duration : float
        s.
    torques : ndarray
        At intervals or nodes, N m.
    states : ndarray, (N + 1) x n
        At nodes.
    costates : ndarray, N x n, or None
        Of least effort, at the ends of the intervals: the free torque is ``costate^T B``.
    free : ndarray, N, or None
        The torque of least effort without limit, N m.
    """

    duration: float
    torques: Array
    states: Array
    costates: Array | None = None
    free: Array | None = None


@dataclass(frozen=True, eq=False)
class Solution:
    """An answer: torque history, states at nodes, duration [s], value of the programme's cost, iterations, multipliers."""

    history: TorqueHistory
    states: Array
    duration: float
    cost: float
    iterations: int
    raw: dict[str, Any] = field(repr=False)


@dataclass(frozen=True, eq=False)
class Programme:
    """A programme with its solver, for any data."""

    transcription: Transcription
    solver: Any
    tolerance: float

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle what it was made of; the solver is built anew."""
        return prepare, (self.transcription, self.tolerance)

    def solve(
        self,
        problem: SlewProblem,
        guess: Guess | None,
        before: Solution | None = None,
        backoff: dict[str, float] | None = None,
    ) -> Solution:
        """Solve for the data of a problem.

        Parameters
        ----------
        problem : SlewProblem
        guess : Guess or None
            Where to start.
        before : Solution or None
            A solution of the same programme with other data to start from instead.
        backoff : dict of str to float
            Factors by which limits are tightened.

        Raises
        ------
        SlewError
            If no slew is found; it names the limit that is missed most, and when.
        """
        arguments = self._bounds(problem, backoff or {})
        if before is not None:
            arguments |= {f"{name}0": before.raw[name] for name in ("lam_x", "lam_g")}
            arguments["x0"] = np.array(before.raw["x"]).ravel()
        else:
            assert guess is not None
            arguments["x0"] = self._start(guess)
            if guess.costates is not None and self.transcription.scheme.method == "shooting" and not problem.limits:
                arguments |= self._multipliers(guess)
        raw = self.solver(**arguments)
        if not self.solver.stats()["success"]:
            raw = self._again(problem, arguments, raw)
        return self._read(problem, raw, int(self.solver.stats()["iter_count"]))

    def _again(self, problem: SlewProblem, arguments: dict[str, Array], raw: dict[str, Any]) -> dict[str, Any]:
        """Let the limits give: where none has to, start from what that finds; else say which gives, when and how much."""
        limits = {"torque": problem.torque_limit, **problem.limits}
        found = relaxed(self.transcription, arguments, limits, problem.duration)
        if found is None:
            raise SlewError(self._failure(problem, raw, arguments["lbg"], arguments["ubg"]))
        if found.excesses:
            most = found.excesses[0]
            raise LimitsTooTight(_told(problem, found, limits), most.needed / limits[most.kind] - 1.0)
        plain = {name: value for name, value in arguments.items() if not name.startswith("lam")}
        raw = self.solver(**(plain | {"x0": found.unknowns}))
        if not self.solver.stats()["success"]:
            raise SlewError(
                f"a slew of {found.duration:.6g} s within all limits exists, but no best one was found on "
                f"{self.transcription.scheme.intervals} intervals; expected a finer mesh or wider limits"
            )
        return raw

    def _bounds(self, problem: SlewProblem, factor: dict[str, float]) -> dict[str, Array]:
        """Data, and bounds of unknowns and conditions."""
        layout = self.transcription.layout
        limits = {kind: value * factor.get(kind, 1.0) for kind, value in problem.limits.items()}
        time = (problem.duration or 0.0) / layout.time_unit
        p = np.array([time, *(limits.get(k, 0.0) for k in ("rate", "speed", "tip", "moment"))])
        lower, upper = np.full(layout.size, -np.inf), np.full(layout.size, np.inf)
        lower[layout.torques], upper[layout.torques] = (s * problem.torque_limit / layout.torque_unit for s in (-1, 1))
        lower[layout.states[0]] = upper[layout.states[0]] = problem.start / layout.unit
        if self.transcription.scheme.ramp and (problem.objective != "tip" or "rate" in problem.limits):
            ends = layout.torques[[0, -1]]
            lower[ends] = upper[ends] = 0.0
        if layout.duration is not None:
            lower[layout.duration] = 1e-3
        if layout.bound is not None:
            lower[layout.bound] = 0.0
        low, high = self._constraint_bounds(problem)
        return {"lbx": lower, "ubx": upper, "lbg": low, "ubg": high, "p": p}

    def _constraint_bounds(self, problem: SlewProblem) -> tuple[Array, Array]:
        t, N = self.transcription, self.transcription.scheme.intervals
        rows = np.full((t.count - t.paths - t.ends.shape[0]) // N, 0.0)
        low = np.zeros(rows.size)
        low[t.defects :] = -np.inf
        target = t.ends @ (problem.target / t.layout.unit)
        low = np.concatenate([np.tile(low, N), np.full(t.paths, -np.inf), target])
        high = np.concatenate([np.zeros(rows.size * N + t.paths), target])
        return low, high

    def _start(self, guess: Guess) -> Array:
        layout, scheme = self.transcription.layout, self.transcription.scheme
        x = np.zeros(layout.size)
        x[layout.states] = guess.states / layout.unit
        x[layout.torques] = guess.torques / layout.torque_unit
        if scheme.method != "shooting":
            h = guess.duration / scheme.intervals
            slopes = np.diff(guess.states, axis=0) / h / layout.unit * layout.time_unit
            # one block of points a plant; the mean rate serves all points
            blocks = self.transcription.blocks
            x[layout.rates] = np.hstack([np.tile(slopes[:, own], scheme.order) for own in blocks])
        if layout.duration is not None:
            x[layout.duration] = guess.duration / layout.time_unit
        return x

    def _multipliers(self, guess: Guess) -> dict[str, Array]:
        """Those of the linear part's least effort; near them the programme needs few iterations."""
        assert guess.costates is not None
        assert guess.free is not None
        t, layout, N = self.transcription, self.transcription.layout, self.transcription.scheme.intervals
        h, unit = guess.duration / N, layout.torque_unit
        dynamics = -2.0 / (N * unit**2 * h) * guess.costates * layout.unit
        ends = np.linalg.lstsq(t.ends.T, dynamics[-1], rcond=None)[0]
        bounds = np.zeros(layout.size)
        bounds[layout.torques] = 2.0 / N * (guess.free - guess.torques) / unit
        return {"lam_g0": np.concatenate([dynamics.ravel(), ends]), "lam_x0": bounds}

    def _read(self, problem: SlewProblem, raw: dict[str, Any], iterations: int) -> Solution:
        layout, scheme = self.transcription.layout, self.transcription.scheme
        x = np.array(raw["x"]).ravel()
        duration = problem.duration
        if layout.duration is not None:
            duration = float(x[layout.duration]) * layout.time_unit
        assert duration is not None
        edges = np.linspace(0.0, duration, scheme.intervals + 1)
        torques = x[layout.torques] * layout.torque_unit
        history = ramped(edges, torques) if scheme.ramp else held(edges, torques)
        # time and tip are in units of the programme's own start: without them meshes could not be compared
        unit = {"time": layout.time_unit, "tip": layout.tip_unit}.get(scheme.objective, 1.0)
        cost = unit * float(raw["f"])
        return Solution(history, x[layout.states] * layout.unit, duration, cost, iterations, raw)

    def _failure(self, problem: SlewProblem, raw: dict[str, Any], low: Array, high: Array) -> str:
        """In words: which condition is missed most, and when."""
        t, N = self.transcription, self.transcription.scheme.intervals
        g = np.array(raw["g"]).ravel()
        lack = np.maximum(low - g, g - high)
        lack = np.maximum(np.where(np.isfinite(lack), lack, 0.0), 0.0)
        each = (t.count - t.paths - t.ends.shape[0]) // N
        x = np.array(raw["x"]).ravel()
        duration = problem.duration or float(x[t.layout.duration or 0]) * t.layout.time_unit
        names = t.names
        worst, where, when = 0.0, "the end state", duration
        stages = lack[: each * N].reshape(N, each)
        for j in range(each - t.defects):
            k = int(np.argmax(stages[:, t.defects + j]))
            if stages[k, t.defects + j] > max(worst, 1e-7):
                worst, where, when = float(stages[k, t.defects + j]), names[j], k * duration / N
        torques = np.abs(x[t.layout.torques]) * t.layout.torque_unit
        share = np.mean(torques > 0.999 * problem.torque_limit)
        bound = f"torque_limit = {problem.torque_limit:g} N m binds on {share:.0%} of it"
        return f"no slew of {duration:.6g} s was found: {where} cannot be met at t = {when:.4g} s; {bound}"


def _told(problem: SlewProblem, found: Relaxed, limits: dict[str, float]) -> str:
    """Which limits bind, when, and what would do."""
    parts = []
    for each in found.excesses:
        name, unit = {"torque": "torque_limit", **LIMITS}[each.kind], UNITS[each.kind]
        parts.append(
            f"{name} = {limits[each.kind]:g} {unit} binds from t = {each.first:.4g} s, most at t = {each.worst:.4g} s; "
            f"{each.needed:.4g} {unit} would do"
        )
    for kind, when in found.met.items():
        name = {"torque": "torque_limit", **LIMITS}[kind]
        parts.append(f"{name} = {limits[kind]:g} {UNITS[kind]} is met from t = {when:.4g} s")
    how_long = f"of {found.duration:.6g} s " if problem.duration is not None else ""
    return f"no slew {how_long}keeps the limits: {'; and '.join(parts)}"


def prepare(transcription: Transcription, tolerance: float) -> Programme:
    """Build the solver of a programme; it is kept in the programme and used for any data."""
    import casadi as ca

    options = _OPTIONS | transcription.options | {"ipopt.tol": min(1e-9, 1e-3 * tolerance)}
    if transcription.scheme.objective == "effort":  # the first guess is near enough to be left where it is
        options |= {f"ipopt.warm_start_{kind}_push": 1e-9 for kind in ("bound", "mult_bound", "slack_bound")}
    return Programme(transcription, ca.nlpsol("slew", "ipopt", transcription.nlp, options), tolerance)
