"""Run time and error of optimal slews, beside exact solutions and programmes written by hand."""

from dataclasses import replace
from functools import partial

import numpy as np

from boomctl.arrays import Array
from boomctl.lab.benchmark.report import BenchmarkReport, Measured, Row, Sheet, Tell, measured, race
from boomctl.lab.benchmark.slew.peers import Effort, Failed, has_rockit, opti_fastest, opti_slew, rockit_slew
from boomctl.lab.benchmark.timing import Job, interleaved
from boomctl.lti.python_control import control
from boomctl.rotating_beam.assumed_modes import AssumedModesBeam
from boomctl.rotating_beam.parameters import HubBeamParameters
from boomctl.slew.linear import effort_guess
from boomctl.slew.nlp.mesh_study import mesh_study
from boomctl.slew.nlp.programme import Programme, Solution, prepare
from boomctl.slew.nlp.transcription import Scheme
from boomctl.slew.optimal import optimal_slew
from boomctl.slew.problem import Limits, SlewProblem, changed, slew_problem
from boomctl.slew.torque import TorqueHistory, held

EFFORT = Effort(AssumedModesBeam(HubBeamParameters(), "sfoam", 3), np.pi / 2, 200.0, 3.0, 200)
"""A quarter turn in 3 s, a little more than the least time; intervals so short that RK4 is stable on them."""
_ONE_MODE = 2.0  # ratio of the nonlinear slew with one mode, where building and first calls are most of the time
_COARSE = 40  # intervals so long that RK4 is unstable in the third mode
_FINE = 8
"""Substeps with which a peer is as exact as ours, for the comparison of optima."""


def run(full: bool = False, progress: Tell | None = None) -> BenchmarkReport:
    """Measure all scenes, the jobs of a scene in turns in one process on one thread.

    Parameters
    ----------
    full : bool
        More repetitions.
    progress : callable, optional
        Told in words what comes next.

    Returns
    -------
    BenchmarkReport
    """
    subjects = (minimum_time_rows, nonlinear_rows, effort_rows, coarse_rows, mesh_sheets)
    return measured("slew", [partial(each, full) for each in subjects], _NOTES, progress)


def _repeats(full: bool) -> int:
    return 7 if full else 3


_NOTES = (
    "Time: median processor time; jobs take turns in one process, one BLAS thread. Ratio: peer over ours.",
    "Minimum time: certificates and replays included in the time; error: relative, of the duration against the exact one "
    "(rigid body, two masses: switching equations in 40 digits) or its proved distance from optimality (hub-beam).",
    "Nonlinear beams: 0.1 kg at the tip, a quarter turn under 200 N m; the peer, Opti with RK4 mapped over 200 intervals "
    "(5 modes: 400), holds the torque on each; error: as for minimum effort. Shares: duration over ours.",
    "Minimum effort: SFOAM, 3 modes, a quarter turn in 3 s under 200 N m, the torque held on equal intervals; time: building "
    "and solving, first guess included; error: largest of hub angle [rad], hub speed [rad/s] and tip [m] at the end of a "
    "replay with the package's simulation to 1e-10.",
    "Opti in a loop is the customary form (CasADi's example of direct multiple shooting); mapped is the fastest that we "
    "could write it.",
    f"Same optimum: costs of ours and the peer with {_FINE} RK4 substeps an interval, relative.",
)


def minimum_time_rows(full: bool, tell: Tell) -> list[Row]:
    """Linear plants: proved optimal, and beside exact solutions where there are any."""
    tell("minimum time")

    rigid = control.ss([[0, 1], [0, 0]], [[0], [1 / 241.0]], [[1, 0]], 0)
    masses = [[0, 0, 1, 0], [0, 0, 0, 1], [-1, 1, 0, 0], [1, -1, 0, 0]]
    two = control.ss(masses, [[0], [0], [1], [0]], [[1, 0, 0, 0]], 0)
    scenes: dict[str, tuple[object, float, float, float | None, float]] = {
        "rigid body": (rigid, np.pi / 2, 200.0, 2.0 * np.sqrt(241.0 * np.pi / 400.0), 1e-10),
        "two masses and a spring": (two, 1.0, 1.0, _two_masses(), 1e-8),
    }
    for modes in (1, 2, 3):
        beam = AssumedModesBeam(HubBeamParameters(), "sfoam", modes).linearize()
        scenes[f"linear hub-beam, modes: {modes}"] = (beam, np.pi / 2, 200.0, None, 1e-6)
    jobs = {name: Job(lambda _, s=scene: optimal_slew(s[0], s[1], s[2])) for name, scene in scenes.items()}
    times = interleaved(jobs, _repeats(full))
    rows = []
    for name, (system, angle, limit, exact, wanted) in scenes.items():
        found = optimal_slew(system, angle, limit)
        error = abs(found.certificate.optimality_gap) if exact is None else abs(found.duration / exact - 1.0)
        job = f"{name}; switches: {found.certificate.switches}"
        met = error <= wanted and found.certificate.optimality == "proved"
        rows.append(Row("Minimum time", job, ours=times[name], target=f"<= {wanted:g}", error=error, met=met))
    return rows


def nonlinear_rows(full: bool, tell: Tell) -> list[Row]:
    """Switching times to the accuracy of a replay, against a torque that is held on a mesh."""
    tell("minimum time of nonlinear beams")
    rows, section = [], "Minimum time, nonlinear beam"
    scenes = [("sfoam", 1, 200), ("sfoam", 3, 200), ("foam", 1, 0)]
    if full:
        scenes += [("sfoam", 5, 400), ("foam", 2, 0)]
    for model, modes, intervals in scenes:
        beam = AssumedModesBeam(HubBeamParameters(tip_mass=0.1), model, modes)
        effort = Effort(beam, np.pi / 2, 200.0, 3.5, max(1, intervals))
        jobs = {"ours": Job(lambda _, beam=beam: optimal_slew(beam, np.pi / 2, 200.0))}
        if intervals:
            jobs["Opti"] = Job(lambda _, effort=effort: opti_fastest(effort))
        times = interleaved(jobs, 1 if modes > 3 else _repeats(full))
        found = optimal_slew(beam, np.pi / 2, 200.0)
        mine, theirs, share = Measured(times["ours"], _end_error(effort, found.history)), Measured(), ""
        if intervals:
            duration, torques = opti_fastest(effort)
            history = held(np.linspace(0.0, duration, intervals + 1), torques)
            theirs = Measured(times["Opti"], _end_error(effort, history))
            share = f"; share {duration / found.duration:.7f}"
        job = f"{model}, modes: {modes}; switches: {found.certificate.switches}{share}"
        certificate = found.certificate
        met = mine.error <= 1e-6 and certificate.optimality == "extremal" and certificate.optimality_gap <= 1e-6
        target = "<= 1e-06"
        if intervals and modes == 1:
            target = f">= {_ONE_MODE:g}x, <= 1e-06"
            met = met and theirs.seconds >= _ONE_MODE * mine.seconds and mine.error <= theirs.error
        rows.append(race(section, job, mine, theirs, target, met))
    return rows


def _two_masses() -> float:
    """Minimum time of the two-mass move: its switching equations about the middle, in 40 digits."""
    import mpmath as mp

    with mp.workdps(40):
        w = mp.sqrt(2)

        def equations(half: object, b: object) -> tuple[object, object]:
            turn = half**2 - 2 * b**2 - 2  # pyright: ignore
            swing = mp.cos(w * half) - 2 * mp.cos(w * b) + 1
            return turn, swing

        return float(2 * mp.findroot(equations, (mp.mpf("2.1"), mp.mpf("1.1")))[0])


def _problem(effort: Effort) -> SlewProblem:
    limits = Limits(effort.torque_limit)
    return slew_problem(effort.beam, effort.angle, limits, "effort", effort.duration, method="shooting")


def ours(effort: Effort) -> tuple[Programme, Solution]:
    """Build and solve the programme by shooting."""
    problem = _problem(effort)
    guess = effort_guess(problem, effort.duration, effort.intervals)
    programme = prepare(problem, Scheme("shooting", "effort", effort.intervals, 1), guess, 1e-7)
    return programme, programme.solve(problem, guess)


def _again(programme: Programme, solution: Solution, effort: Effort) -> Solution:
    return programme.solve(changed(_problem(effort), 0.99 * effort.angle, 0.99 * effort.torque_limit), solution)


def _end_error(effort: Effort, history: TorqueHistory) -> float:
    """In a replay."""
    end = np.array([history.duration])
    r = effort.beam.simulate_torque(history, end, history.breakpoints, rtol=1e-10, atol=1e-13)
    return max(abs(float(r.hub_angle[0]) - effort.angle), abs(float(r.hub_speed[0])), abs(float(r.tip_displacement[0])))


def _history(effort: Effort, torques: Array) -> TorqueHistory:
    return held(np.linspace(0.0, effort.duration, effort.intervals + 1), torques)


def effort_rows(full: bool, tell: Tell) -> list[Row]:
    """Least effort on one mesh, beside the same programme written by hand."""
    tell("minimum effort")
    effort, section = EFFORT, "Minimum effort, 3 modes, 200 intervals"
    programme, solution = ours(effort)
    jobs = {
        "ours": Job(lambda _: ours(effort)),
        "Opti": Job(lambda _: opti_slew(effort)),
        "mapped": Job(lambda _: opti_slew(effort, mapped=True)),
        "again": Job(lambda _: _again(programme, solution, effort)),
    }
    if has_rockit():
        jobs["rockit"] = Job(lambda _: rockit_slew(effort))
    times = interleaved(jobs, _repeats(full))
    mine, again = Measured(times["ours"], _end_error(effort, solution.history)), times["again"]
    theirs = _end_error(effort, _history(effort, opti_slew(effort)))
    met = times["Opti"] >= 5.0 * mine.seconds and theirs >= 50.0 * mine.error
    opti, mapped = Measured(times["Opti"], theirs), Measured(times["mapped"], theirs)
    first = "new data; peer: first solve, ours"
    rows = [
        race(section, "peer: Opti, RK4 in a loop", mine, opti, ">= 5x, 50x exact", met),
        race(section, "peer: Opti, RK4 mapped", mine, mapped),
        race(section, first, Measured(again), Measured(mine.seconds), ">= 2x", mine.seconds >= 2.0 * again),
    ]
    if not has_rockit():
        return [*rows, Row(section, "peer: rockit", note="not installed")]
    gap = abs(solution.history.effort / _history(effort, rockit_slew(effort, _FINE)).effort - 1.0)
    rockit = Measured(times["rockit"], _end_error(effort, _history(effort, rockit_slew(effort))))
    faster = rockit.seconds > mine.seconds
    rows.append(race(section, "peer: rockit, RK4", mine, rockit, "faster", faster))
    same = "same optimum as rockit, RK4 refined"
    return [*rows, Row(section, same, target="<= 1e-06", error=gap, met=faster and gap <= 1e-6)]


def coarse_rows(full: bool, tell: Tell) -> list[Row]:
    """A mesh on which RK4 is unstable: it takes a feasible slew for an infeasible one."""
    tell("a coarse mesh")
    effort = replace(EFFORT, intervals=_COARSE)
    mine, theirs = Measured(error=_end_error(effort, ours(effort)[1].history)), Measured()
    try:
        theirs, found = Measured(error=_end_error(effort, _history(effort, opti_slew(effort)))), "solved"
    except Failed as failure:
        found = str(failure)
    job = f"{_COARSE} intervals; peer, Opti, RK4: {found}"
    return [race("Minimum effort on a coarse mesh", job, mine, theirs, "solvable, 1e-3", mine.error < 1e-3)]


def mesh_sheets(full: bool, tell: Tell) -> list[Sheet]:
    """Errors of our schemes over the number of intervals."""
    tell("error against mesh size")
    study = mesh_study(EFFORT.beam, EFFORT.angle, EFFORT.torque_limit, 3.2)
    columns = ("scheme", *(str(int(n)) for n in study.intervals), "order")
    lines = tuple((line.name, *(float(e) for e in line.errors), line.order) for line in study.lines)
    return [Sheet("Error against the number of intervals", columns, lines)]
