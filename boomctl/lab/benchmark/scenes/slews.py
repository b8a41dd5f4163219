"""Scenes of slews: least time, and least effort in a given time.

Other programs: RK4 multiple shooting in ``casadi.Opti``, mapped over the intervals.  The references share no code with the
package's own planning and replay: the equations are those that CasADi derives from the energies, motions are extrapolated,
optimization problems are ``casadi.Opti``'s.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np
from scipy.optimize import root

from boomctl.arrays import Array
from boomctl.lab.benchmark.exact_steps import extrapolated_step
from boomctl.lab.benchmark.scene import Scene, Setting, settings, sized
from boomctl.lab.benchmark.scenes.hub_beam import machine
from boomctl.rotating_beam.assumed_modes import AssumedModesBeam
from boomctl.slew.optimal import optimal_slew
from boomctl.slew.torque import TorqueProfile, held

_ANGLE, _LIMIT, _NMODES = np.pi / 2, 200.0, 3  # rad, N m: a quarter turn; of SFOAM
_DURATION, _GUESS = 3.0, 3.5  # s: of the slew of least effort (the least time is 2.91 s); from which others begin
_OURS: dict[str, Any] = {"verified": True, "ours": True}
_COUNTS = (1, 2, 4)  # modes at which run times are compared
_EQUAL = 1e-11  # Rounding error of the references, below which errors count as equal.
# IPOPT's options: silent, and solved until the objective no longer limits what errors are compared
_QUIET = {"ipopt.print_level": 0, "ipopt.sb": "yes", "print_time": False, "ipopt.tol": 1e-10}
_PHASE = 1.0  # rad: of the highest mode in a step of the replay; order 16 leaves 1e-15 of that
_SUBSTEPS = 4  # RK4 steps per interval: error of 1e-7 of the effort with 200 intervals and three modes
_ARCS = 20  # steps an arc of a bang-bang torque: each well below a radian of the highest mode


@dataclass(frozen=True)
class Slew:
    """A rest-to-rest slew: the torque is held on equal intervals; ``duration`` [s] is a first guess where it is least."""

    beam: AssumedModesBeam
    angle: float
    torque_limit: float
    duration: float
    intervals: int = 100

    @property
    def target(self) -> Array:
        """State at the end."""
        state = np.zeros(2 * self.beam.equations.size)
        state[0] = self.angle
        return state

    def on(self, intervals: int) -> "Slew":
        """Return the slew on another mesh."""
        return replace(self, intervals=intervals)


def opti_torque(slew: Slew, substeps: int = 1, fastest: bool = False) -> TorqueProfile:
    """Return the torque of least effort, or of least time, with some RK4 steps an interval.

    Raises
    ------
    RuntimeError
        IPOPT ends without a solution.
    """
    import casadi as ca

    f, n, N, limit = slew.beam.to_casadi(), slew.target.size, slew.intervals, slew.torque_limit
    x, u, t = ca.SX.sym("x", n), ca.SX.sym("u"), ca.SX.sym("t")
    step = ca.Function("step", [x, u, t], [_rk4(lambda a: f(a, u)[0], x, t / N / substeps, substeps)])
    opti = ca.Opti()
    X, U = opti.variable(n, N + 1), opti.variable(1, N)
    T = opti.variable() if fastest else slew.duration
    opti.subject_to(X[:, 1:] == step.map(N)(X[:, :-1], U * limit, ca.repmat(ca.MX(T), 1, N)))
    opti.subject_to(X[:, 0] == 0.0)
    opti.subject_to(X[:, N] == slew.target)
    opti.subject_to(opti.bounded(-1.0, U, 1.0))
    s = np.linspace(0.0, 1.0, N + 1)
    opti.set_initial(X[0, :], slew.angle * (3.0 * s**2 - 2.0 * s**3))
    opti.set_initial(X[n // 2, :], slew.angle * 6.0 * s * (1.0 - s) / slew.duration)
    if fastest:
        opti.subject_to(0.1 * slew.duration <= T)
        opti.set_initial(T, slew.duration)
    opti.minimize(T if fastest else ca.sumsqr(U) / N)
    opti.solver("ipopt", _QUIET)
    result = opti.solve()
    edges = np.linspace(0.0, float(result.value(T)), N + 1)
    return held(edges, np.array(result.value(U)).ravel() * limit)


def _rk4(f: Callable[[Any], Any], x: Any, h: Any, steps: int) -> Any:
    for _ in range(steps):
        k1 = f(x)
        k2 = f(x + 0.5 * h * k1)
        k3 = f(x + 0.5 * h * k2)
        k4 = f(x + h * k3)
        x = x + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
    return x


def slew_of(change: float = 0.0, modes: int = _NMODES, duration: float = _DURATION) -> Slew:
    """Return the slew of a machine that is a little changed."""
    return Slew(AssumedModesBeam(machine(change), "sfoam", modes), _ANGLE, _LIMIT, duration)


def _scene(
    title: str, what: str, least: str, reference: Callable[[Any], float], ours: tuple[Setting, ...], remark: str
) -> Scene:
    """Return the scene of a slew; ``what`` is least, ``least`` says how the least one is found."""

    def theirs(intervals: int, substeps: int, modes: int, problem: Any, change: float) -> TorqueProfile:
        slew = slew_of(change, modes, _GUESS if what == "time" else _DURATION)
        return opti_torque(slew.on(intervals), substeps, fastest=what == "time")

    def error(problem: Any, least: float, answer: TorqueProfile) -> float:
        reached = answer.duration if what == "time" else answer.effort
        return max(abs(reached / least - 1.0), end_error(slew_of(), answer), _EQUAL)

    steps = {"Opti, RK4": 1, "Opti, 4 steps of RK4": 4}
    meshes = {method: [(n, count, _NMODES) for n in (50, 100, 200, 400)] for method, count in steps.items()}
    sizes = [(100, 4, modes) for modes in _COUNTS]
    return Scene(
        title=title,
        question=f"From the beam's parameters to the torque of least {what} within {_LIMIT:g} N m; SFOAM, {_NMODES} modes.",
        measure=(
            f"The larger of the relative distance of the {what} from the least one and of the error of the end in a replay"
            f" to rounding: hub angle [rad], hub speed [rad/s] or tip [m]. The least {what} is that of {least}."
        ),
        reference=reference,
        error=error,
        methods=(
            *ours,
            *(
                s
                for name, mesh in meshes.items()
                for s in settings(name, "{} intervals", mesh, theirs, modules=("casadi",))
            ),
            *sized(settings("Opti, 4 steps of RK4", "{2} modes", sizes, theirs, modules=("casadi",))),
        ),
        remarks=(remark,),
    )


def slew_time() -> Scene:
    """Return the scene of least time."""

    def ours(rtol: float, modes: int, problem: Any, change: float) -> TorqueProfile:
        return optimal_slew(slew_of(change, modes).beam, _ANGLE, _LIMIT, rtol=rtol).torque_profile

    cases, sizes = [(rtol, _NMODES) for rtol in (1e-3, 1e-6, 1e-9)], [(1e-3, modes) for modes in _COUNTS]
    call = f"bc.optimal_slew(beam, {_ANGLE:.5g}, {_LIMIT:g}, rtol={{:g}})"

    return _scene(
        "Minimum-time slew",
        "time",
        "switching times, found from Opti's by extrapolated motions",
        lambda problem: least_time(slew_of(duration=_GUESS), 200),
        (
            *settings("optimal_slew", "rtol {:.0e}", cases, ours, **_OURS, call=call),
            *sized(settings("optimal_slew", "{1} modes", sizes, ours, **_OURS)),
        ),
        "Ours replays the torque by another integrator; torques held on a mesh take a little longer.",
    )


def slew_effort() -> Scene:
    """Return the scene of least effort."""

    def ours(intervals: int, modes: int, problem: Any, change: float) -> TorqueProfile:
        beam = slew_of(change, modes).beam
        return optimal_slew(beam, _ANGLE, _LIMIT, "effort", _DURATION, intervals=intervals).torque_profile

    cases, sizes = [(n, _NMODES) for n in (30, 55, 110, 220, 420)], [(110, modes) for modes in _COUNTS]
    call = f'bc.optimal_slew(beam, {_ANGLE:.5g}, {_LIMIT:g}, "effort", {_DURATION:g}, intervals={{}})'

    return _scene(
        f"Minimum-effort slew in {_DURATION:g} s",
        "effort",
        "any torque, extrapolated from Opti's on fine meshes",
        lambda problem: least_effort(slew_of(), 400),
        (
            *settings("optimal_slew", "{} intervals", cases, ours, **_OURS, call=call),
            *sized(settings("optimal_slew", "{1} modes", sizes, ours, **_OURS)),
        ),
        "On one mesh all efforts are alike; ours is replayed by another integrator.",
    )


@cache
def _step(beam: AssumedModesBeam) -> Any:
    """Return the function of state, held torque [N m] and step [s]."""
    import casadi as ca

    f, x, u, h = beam.to_casadi(), ca.SX.sym("x", 2 * beam.equations.size), ca.SX.sym("u"), ca.SX.sym("h")
    return ca.Function("step", [x, u, h], [extrapolated_step(lambda a, _: f(a, u)[0], x, 0.0, h)])


def _end(beam: AssumedModesBeam, torques: Array, lengths: Array, substeps: int) -> Array:
    """Return the state after intervals of some lengths [s] on each of which a torque [N m] is held."""
    state = np.zeros(2 * beam.equations.size)
    for torque, length in zip(torques, lengths, strict=True):
        for _ in range(substeps):
            state = _step(beam)(state, torque, length / substeps)
    return np.array(state).ravel()


def end_error(slew: Slew, profile: TorqueProfile) -> float:
    """Return the error at the end of a held torque: the largest of angle [rad], hub speed [rad/s] and tip [m].

    Raises
    ------
    ValueError
        The torque is not held on its intervals.
    """
    if np.any(profile.start_values != profile.end_values):
        raise ValueError("profile: expected a torque that is held on each interval")
    size, lengths = slew.beam.equations.size, np.diff(profile.edges)
    substeps = int(np.ceil(lengths.max() * slew.beam.equations.frequency_range[1] / _PHASE))
    end = _end(slew.beam, profile.start_values, lengths, substeps)
    tip = slew.beam.equations.tip.transverse @ end[1:size]
    return float(max(abs(end[0] - slew.angle), abs(end[size]), abs(tip)))


def least_effort(slew: Slew, intervals: int) -> float:
    """Return the least integral of the torque squared of any torque, not only of held ones [N^2 m^2 s].

    It is extrapolated from so many intervals and half as many: the excess of held torques falls with the square of their
    length.
    """
    coarse, fine = (opti_torque(slew.on(n), _SUBSTEPS).effort for n in (intervals // 2, intervals))
    return fine - (coarse - fine) / 3.0


def least_time(slew: Slew, intervals: int) -> float:
    """Return the duration [s] of the bang-bang torque with as many arcs as states, found near Opti's.

    Raises
    ------
    RuntimeError
        Opti's has another number of arcs, or the durations do not lead to the end.
    """
    result = opti_torque(slew.on(intervals), _SUBSTEPS, fastest=True)
    fractions, h = result.start_values / slew.torque_limit, result.duration / intervals
    signs = np.sign(fractions)
    turns = np.flatnonzero(signs[1:] != signs[:-1])
    # The momentum gives the switching time within the two intervals.
    parts = fractions[turns] - signs[turns] + fractions[turns + 1] + signs[turns]
    switches = h * (turns + 1.0 + 0.5 * signs[turns] * parts)
    lengths = np.diff(np.concatenate([[0.0], switches, [result.duration]]))
    if lengths.size != slew.target.size:
        raise RuntimeError(f"{lengths.size} arcs for {slew.target.size} states")
    torques = slew.torque_limit * signs[0] * (-1.0) ** np.arange(lengths.size)
    exact = root(lambda d: _end(slew.beam, torques, d, _ARCS) - slew.target, lengths, tol=_EQUAL)
    if np.abs(exact.fun).max() > 1e2 * _EQUAL or exact.x.min() <= 0.0:
        raise RuntimeError(f"the error at the end is {np.abs(exact.fun).max():.1e}")
    return float(exact.x.sum())
