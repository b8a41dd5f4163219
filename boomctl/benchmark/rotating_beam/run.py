"""Run time and error of the hub-beam's simulations, beside general-purpose integrators on the same equations."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from boomctl.arrays import Array
from boomctl.benchmark.boom.scene import Progress
from boomctl.benchmark.report import BenchmarkReport, Row
from boomctl.benchmark.rotating_beam import exact as hub_beam_exact
from boomctl.benchmark.rotating_beam.peers import (
    INSTANTS,
    SPIN_UP,
    TORQUE,
    Motion,
    casadi_spin_up,
    casadi_torque,
    in_turns,
    scipy_spin_up,
    scipy_torque,
)
from boomctl.benchmark.timing import Job, environment, interleaved, one_thread
from boomctl.rotating_beam import AssumedModesBeam, HubBeamParameters

LADDER = tuple(10.0**-k for k in range(4, 13))
SCIPY_METHODS = ("Radau", "DOP853", "RK45", "LSODA", "BDF")
"""Of solve_ivp; the first is the fastest one known at 1e-6."""

_ERROR, _RESIDUAL_ERROR = 1e-6, 1e-5
_SCIPY_RATIO, _IDAS_RATIO, _RESIDUAL_COST, _FOAM_COST = 100.0, 15.0, 2.0, 10.0

Judge = Callable[[Array], float]


@dataclass(frozen=True)
class _Entry:
    """A run and what judges the displacement that it returns."""

    run: Motion
    judge: Judge


@dataclass(frozen=True)
class _Measured:
    seconds: float
    error: float


def run(full: bool = False, progress: Progress | None = None) -> BenchmarkReport:
    """Measure all scenes, the jobs of a scene in turns in one process on one thread.

    A method with a tolerance gets the loosest one of a ladder at which it is as exact as the scene asks for.

    Parameters
    ----------
    full : bool
        All of SciPy's methods and CasADi's CVODES, and more repetitions; otherwise the fastest ones known.
    progress : callable, optional
        Told in words what comes next.

    Returns
    -------
    BenchmarkReport
    """
    tell: Progress = progress if progress is not None else lambda text: None
    repeats = 15 if full else 5
    with one_thread():
        tell("spin-up")
        entries = _spin_up_entries(full)
        rows = _spin_up_rows(_measure(entries, repeats))
        rows.append(_single_calls(entries, rows[0], repeats))
        tell("torque-driven")
        rows += _torque_rows(_measure(_torque_entries(full), repeats))
        tell("geometrically exact")
        rows += hub_beam_exact.rows(3 if full else 1)
    return BenchmarkReport(tuple(rows), (), _NOTES, environment(), "boomctl benchmark hub-beam")


_NOTES = (
    "Time: median processor time of a call; jobs take turns of at least 50 ms in one process, one BLAS thread; "
    '"one call a turn" is a call right after the peer\'s, with cold caches. Ratio: peer over ours.',
    "Error: largest error of the tip's displacement at 601 instants over its maximum there, against the same equations "
    "solved to 1e-10 or better; residual vibration: over the instants after the spin-up only.",
    "Peers solve the same equations at the loosest of the tolerances 1e-4, 1e-5, ... that keeps the error asked for.",
    "Against the exact beam: the error is that of the model, measured against a converged geometrically exact beam; "
    "exudyn is refined to an error of 1e-3, where it is installed.",
)


def _measure(entries: Mapping[str, _Entry], repeats: int) -> dict[str, _Measured]:
    times = in_turns({name: entry.run for name, entry in entries.items()}, repeats)
    return {name: _Measured(times[name], entry.judge(entry.run())) for name, entry in entries.items()}


def _single_calls(entries: Mapping[str, _Entry], row: Row, repeats: int) -> Row:
    """Return the spin-up beside its first peer with one call a turn: right after the peer, with cold caches."""
    names = {"ours": "ours", "peer": f"solve_ivp {SCIPY_METHODS[0]}"}
    jobs = {key: Job(lambda _, run=entries[name].run: run()) for key, name in names.items()}
    times = interleaved(jobs, repeats)
    met = bool(row.error is not None and row.error <= _ERROR and times["peer"] >= _SCIPY_RATIO * times["ours"])
    job, target = f"{names['peer']}, one call a turn", f">= {_SCIPY_RATIO:g}x"
    return Row(row.section, f"peer: {job}", times["ours"], times["peer"], target, row.error, row.peer_error, met)


def _row(section: str, job: str, ours: _Measured, peer: _Measured | None, target: str = "", met: bool | None = None):
    if peer is None:
        return Row(section, job, ours.seconds, None, target, ours.error, None, met)
    return Row(section, job, ours.seconds, peer.seconds, target, ours.error, peer.error, met)


def _spin_up_rows(found: Mapping[str, _Measured]) -> list[Row]:
    section = "Spin-up 60 s, SFOAM, 5 modes, 1e-6"
    ours, residual = found["ours"], found["residual"]
    exact = ours.error <= _ERROR
    scipy = {name: each for name, each in found.items() if name.startswith("solve_ivp")}
    best = min(scipy, key=lambda name: scipy[name].seconds if scipy[name].error <= _ERROR else np.inf)
    rows = []
    for name, peer in found.items():
        if name == best or name == "CasADi IDAS":
            wanted = _SCIPY_RATIO if name == best else _IDAS_RATIO
            met = exact and peer.seconds >= wanted * ours.seconds
            rows.append(_row(section, f"peer: {name}", ours, peer, f">= {wanted:g}x", met))
        elif name not in ("ours", "residual", "default"):
            rows.append(_row(section, f"peer: {name}", ours, peer))
    cheap = residual.error <= _RESIDUAL_ERROR and residual.seconds < _RESIDUAL_COST * ours.seconds
    rows.append(_row(section, "residual to 1e-5; peer: 1e-6", residual, ours, "< 2x the cost", cheap))
    rows.append(_row(section, "default tolerance 1e-8", found["default"], None))
    return rows


def _torque_rows(found: Mapping[str, _Measured]) -> list[Row]:
    section = "Torque-driven 60 s, 200 N m, 5 modes, 1e-6"
    sfoam, foam = found["SFOAM"], found["FOAM"]
    rows = []
    for name, peer in found.items():
        if name not in ("SFOAM", "FOAM"):
            model = name.split(",")[0]
            rows.append(_row(section, f"{model}; peer:{name.split(',')[1]}", found[model], peer))
    met = max(sfoam.error, foam.error) <= _ERROR and foam.seconds <= _FOAM_COST * sfoam.seconds
    rows.append(_row(section, "FOAM; peer: SFOAM, ours", foam, sfoam, "<= 10x the cost", met))
    return rows


def _judge(exact: Array, which: Array) -> Judge:
    scale = np.abs(exact[which]).max()
    return lambda tip: float(np.abs(tip - exact)[which].max() / scale)


def _loosest(build: Callable[[float], Motion], judge: Judge, wanted: float, ladder: Sequence[float] = LADDER) -> _Entry:
    """The run with the loosest tolerance at which the error is below `wanted`; the tightest if none is."""
    motion = build(ladder[-1])
    for tolerance in ladder:
        motion = build(tolerance)
        if judge(motion()) <= wanted:
            break
    return _Entry(motion, judge)


def _spin_up_entries(full: bool) -> dict[str, _Entry]:
    beam = AssumedModesBeam(HubBeamParameters(), "sfoam", 5)
    exact = beam.simulate(SPIN_UP, INSTANTS, rtol=1e-12, atol=1e-15).tip_displacement
    whole = _judge(exact, INSTANTS >= 0.0)
    residual = _judge(exact, INSTANTS - SPIN_UP.duration > 0.0)

    def ours(tolerance: float) -> Motion:
        return lambda: beam.simulate(SPIN_UP, INSTANTS, rtol=tolerance, atol=1e-15).tip_displacement

    entries = {
        "ours": _Entry(ours(_ERROR), whole),
        "residual": _loosest(ours, residual, _RESIDUAL_ERROR),
        "default": _Entry(ours(1e-8), whole),
    }
    for name in SCIPY_METHODS if full else SCIPY_METHODS[:2]:
        entries[f"solve_ivp {name}"] = _loosest(scipy_spin_up(beam, name), whole, _ERROR)
    for name in ("idas", "cvodes") if full else ("idas",):
        entries[f"CasADi {name.upper()}"] = _loosest(casadi_spin_up(beam, name), whole, _ERROR)
    return entries


def _torque_entries(full: bool) -> dict[str, _Entry]:
    entries = {}
    for model in ("SFOAM", "FOAM"):
        beam = AssumedModesBeam(HubBeamParameters(), model.lower(), 5)
        exact = beam.simulate(TORQUE, INSTANTS, rtol=1e-10, atol=1e-13).tip_displacement
        judge = _judge(exact, INSTANTS >= 0.0)

        def ours(beam: AssumedModesBeam = beam) -> Array:
            return beam.simulate(TORQUE, INSTANTS, rtol=_ERROR, atol=1e-13).tip_displacement

        entries[model] = _Entry(ours, judge)
        entries[f"{model}, CasADi IDAS"] = _loosest(casadi_torque(beam, TORQUE), judge, _ERROR)
        if model == "SFOAM" and full:
            entries["SFOAM, solve_ivp DOP853"] = _loosest(scipy_torque(beam, TORQUE), judge, _ERROR)
    return entries
