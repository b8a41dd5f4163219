"""Run time and error of optimal slews, beside exact solutions and programmes written by hand."""

from dataclasses import replace

import numpy as np

from boomctl.arrays import Array
from boomctl.benchmark.boom.scene import Progress
from boomctl.benchmark.report import BenchmarkReport, Row, Sheet
from boomctl.benchmark.slew.peers import Effort, Failed, has_rockit, opti_fastest, opti_slew, rockit_slew
from boomctl.benchmark.timing import Job, environment, interleaved, one_thread
from boomctl.rotating_beam import HubBeam, HubBeamParameters
from boomctl.slew import TorqueHistory, mesh_study, optimal_slew
from boomctl.slew.linear import effort_guess
from boomctl.slew.nlp.programme import Programme, Solution, prepare
from boomctl.slew.nlp.transcription import Scheme
from boomctl.slew.problem import Limits, SlewProblem, changed, slew_problem
from boomctl.slew.torque import held

_EFFORT = Effort(HubBeam(HubBeamParameters(), "sfoam", 3), np.pi / 2, 200.0, 3.0, 200)
_COARSE = 40
_FINE = 8
"""Substeps with which a peer is as exact as ours, for the comparison of optima."""


def run(full: bool = False, progress: Progress | None = None) -> BenchmarkReport:
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
    tell: Progress = progress if progress is not None else lambda text: None
    repeats = 7 if full else 3
    with one_thread():
        tell("minimum time")
        rows = _minimum_time(repeats)
        tell("minimum time of nonlinear beams")
        rows += _nonlinear_rows(repeats, full)
        tell("minimum effort")
        rows += _effort_rows(repeats)
        tell("a coarse mesh")
        rows.append(_coarse_row())
        tell("error against mesh size")
        sheet = _mesh_sheet()
    return BenchmarkReport(tuple(rows), (sheet,), _NOTES, environment(), "boomctl benchmark slew")


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


def _minimum_time(repeats: int) -> list[Row]:
    import control

    rigid = control.ss([[0, 1], [0, 0]], [[0], [1 / 241.0]], [[1, 0]], 0)
    masses = [[0, 0, 1, 0], [0, 0, 0, 1], [-1, 1, 0, 0], [1, -1, 0, 0]]
    two = control.ss(masses, [[0], [0], [1], [0]], [[1, 0, 0, 0]], 0)
    scenes: dict[str, tuple[object, float, float, float | None, float]] = {
        "rigid body": (rigid, np.pi / 2, 200.0, 2.0 * np.sqrt(241.0 * np.pi / 400.0), 1e-10),
        "two masses and a spring": (two, 1.0, 1.0, _two_masses(), 1e-8),
    }
    for modes in (1, 2, 3):
        beam = HubBeam(HubBeamParameters(), "sfoam", modes).linearize()
        scenes[f"linear hub-beam, modes: {modes}"] = (beam, np.pi / 2, 200.0, None, 1e-6)
    jobs = {name: Job(lambda _, s=scene: optimal_slew(s[0], s[1], s[2])) for name, scene in scenes.items()}
    times = interleaved(jobs, repeats)
    rows = []
    for name, (system, angle, limit, exact, wanted) in scenes.items():
        found = optimal_slew(system, angle, limit)
        error = abs(found.certificate.optimality_gap) if exact is None else abs(found.duration / exact - 1.0)
        job = f"{name}; switches: {found.certificate.switches}"
        met = error <= wanted and found.certificate.optimality == "proved"
        rows.append(Row("Minimum time", job, times[name], None, f"<= {wanted:g}", error, None, met))
    return rows


def _nonlinear_rows(repeats: int, full: bool) -> list[Row]:
    """Switching times to the accuracy of a replay, against a torque that is held on a mesh."""
    rows, section = [], "Minimum time, nonlinear beam"
    scenes = [("sfoam", 1, 200), ("sfoam", 3, 200), ("foam", 1, 0)]
    if full:
        scenes += [("sfoam", 5, 400), ("foam", 2, 0)]
    for model, modes, intervals in scenes:
        beam = HubBeam(HubBeamParameters(tip_mass=0.1), model, modes)
        effort = Effort(beam, np.pi / 2, 200.0, 3.5, max(1, intervals))
        jobs = {"ours": Job(lambda _, beam=beam: optimal_slew(beam, np.pi / 2, 200.0))}
        if intervals:
            jobs["Opti"] = Job(lambda _, effort=effort: opti_fastest(effort))
        times = interleaved(jobs, 1 if modes > 3 else repeats)
        found = optimal_slew(beam, np.pi / 2, 200.0)
        error, theirs, share = _end_error(effort, found.history), None, ""
        if intervals:
            duration, torques = opti_fastest(effort)
            theirs = _end_error(effort, held(np.linspace(0.0, duration, intervals + 1), torques))
            share = f"; share {duration / found.duration:.7f}"
        job = f"{model}, modes: {modes}; switches: {found.certificate.switches}{share}"
        met = error <= 1e-6 and found.certificate.optimality == "extremal" and found.certificate.optimality_gap <= 1e-6
        rows.append(Row(section, job, times["ours"], times.get("Opti"), "<= 1e-06", error, theirs, met))
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


def _effort_rows(repeats: int) -> list[Row]:
    effort, section = _EFFORT, "Minimum effort, 3 modes, 200 intervals"
    programme, solution = ours(effort)
    jobs = {
        "ours": Job(lambda _: ours(effort)),
        "Opti": Job(lambda _: opti_slew(effort)),
        "mapped": Job(lambda _: opti_slew(effort, mapped=True)),
        "again": Job(lambda _: _again(programme, solution, effort)),
    }
    if has_rockit():
        jobs["rockit"] = Job(lambda _: rockit_slew(effort))
    times = interleaved(jobs, repeats)
    mine, error = times["ours"], _end_error(effort, solution.history)
    theirs = _end_error(effort, _history(effort, opti_slew(effort)))
    met = bool(times["Opti"] >= 5.0 * mine and theirs >= 50.0 * error)
    rows = [
        Row(section, "peer: Opti, RK4 in a loop", mine, times["Opti"], ">= 5x, 50x exact", error, theirs, met),
        Row(section, "peer: Opti, RK4 mapped", mine, times["mapped"], "", error, theirs),
        Row(
            section,
            "new data; peer: first solve, ours",
            times["again"],
            mine,
            ">= 2x",
            None,
            None,
            bool(mine >= 2.0 * times["again"]),
        ),
    ]
    if not has_rockit():
        return [*rows, Row(section, "peer: rockit", note="not installed")]
    gap = abs(solution.history.effort / _history(effort, rockit_slew(effort, _FINE)).effort - 1.0)
    coarse = _end_error(effort, _history(effort, rockit_slew(effort)))
    met = bool(times["rockit"] > mine and gap <= 1e-6)
    rows.append(
        Row(section, "peer: rockit, RK4", mine, times["rockit"], "faster", error, coarse, times["rockit"] > mine)
    )
    rows.append(Row(section, "same optimum as rockit, RK4 refined", None, None, "<= 1e-06", gap, None, met))
    return rows


def _coarse_row() -> Row:
    """A mesh on which RK4 is unstable: it takes a feasible slew for an infeasible one."""
    effort = replace(_EFFORT, intervals=_COARSE)
    error = _end_error(effort, ours(effort)[1].history)
    try:
        theirs, found = _end_error(effort, _history(effort, opti_slew(effort))), "solved"
    except Failed as failure:
        theirs, found = None, str(failure)
    job = f"{_COARSE} intervals; peer, Opti, RK4: {found}"
    return Row("Minimum effort on a coarse mesh", job, None, None, "solvable, 1e-3", error, theirs, error < 1e-3)


def _mesh_sheet() -> Sheet:
    study = mesh_study(_EFFORT.beam, _EFFORT.angle, _EFFORT.torque_limit, 3.2)
    columns = ("scheme", *(str(int(n)) for n in study.intervals), "order")
    lines = tuple((line.name, *(float(e) for e in line.errors), line.order) for line in study.lines)
    return Sheet("Error against the number of intervals", columns, lines)
