"""The benchmark of what suspensions are designed with: run time and error in one run, beside general-purpose tools."""

from collections.abc import Callable
from functools import partial
from importlib.util import find_spec
from typing import Any

from boomctl.boom.factory import spray_boom
from boomctl.boom.model import ACTUATORS, TIPS
from boomctl.boom.parameters import BoomParameters
from boomctl.lab.benchmark.precision.scenes.boom_reduction import balanced_by_pymor, referee
from boomctl.lab.benchmark.report import BenchmarkReport, Measured, Row, Tell, measured, race
from boomctl.lab.benchmark.suspension.h_infinity import h_infinity_lines
from boomctl.lab.benchmark.suspension.loop import loop_lines
from boomctl.lab.benchmark.timing import Job, interleaved
from boomctl.lti.python_control import control
from boomctl.reduction.reduce import reduce
from boomctl.structure.model import SecondOrderModel

_REDUCTION = "Reduction of the boom, actuators -> tips, verification included; peers do not verify"
_RATIO = 50.0  # of balred's processor time over ours, which this package promised itself
_REFEREE_MODES = 60  # of the core that judges errors; the bound of all other modes is added to each
_ROUNDS, _ROUNDS_FULL = 3, 9  # turns of each job, of which the median counts
_NOTES = (
    "Time: median processor time of jobs that take turns in one process, one BLAS thread. Ratio: peer over ours.",
    "Reduction: the error is the H-infinity norm of the difference from the full model over that of the full model, "
    "verified against 60 modes, the bound of all others included; each call of ours gets a model of its own, built "
    "beforehand with its two halves, and verifies its result within the time.",
)


def run(full: bool = False, progress: Tell | None = None) -> BenchmarkReport:
    """Measure all jobs.

    Parameters
    ----------
    full : bool
        More rounds.
    progress : callable, optional
        Told in words what comes next.

    Returns
    -------
    BenchmarkReport
    """
    rounds = _ROUNDS_FULL if full else _ROUNDS
    return measured("suspension", [partial(lines, rounds) for lines in _SUBJECTS], _NOTES, progress)


def reduction_lines(rounds: int, tell: Tell, elements: int = 200, order: int = 10) -> list[Row]:
    """Race ``reduce`` against ``control.balred`` and, where it is installed, pyMOR's balanced truncation.

    The error of each is the H-infinity norm of its difference from the full model, relative to that of the full model:
    verified against a core of more modes than ours reduces, whose own bound is added.
    """

    def fresh() -> SecondOrderModel:
        return spray_boom(BoomParameters(), elements=elements).select(ACTUATORS, TIPS)

    model = fresh()
    system = model.to_statespace()
    answers: dict[str, Any] = {}

    def ours(given: SecondOrderModel) -> None:
        answers["ours"] = reduce(given, order=order).system

    def balred(_: object) -> None:
        answers["control.balred"] = control.balred(system, order)

    jobs = {"ours": Job(ours, fresh), "control.balred": Job(balred)}
    if find_spec("pymor") is not None:
        jobs["pyMOR"] = Job(
            lambda given: answers.update({"pyMOR": balanced_by_pymor(given.to_statespace(), order)}), fresh
        )
    tell(f"reduction of {elements} elements to order {order}")
    times = interleaved(jobs, rounds)
    error = referee(model, _REFEREE_MODES)
    errors = {name: error(answer) for name, answer in answers.items()}
    best = min(error for name, error in errors.items() if name != "ours")
    rows = []
    for name in (name for name in jobs if name != "ours"):
        wanted = name == "control.balred"
        met = times[name] >= _RATIO * times["ours"] and errors["ours"] <= best if wanted else None
        target = f">= {_RATIO:g}x, error" if wanted else ""
        job = f"{name}: {elements} elements to order {order}"
        mine, theirs = Measured(times["ours"], errors["ours"]), Measured(times[name], errors[name])
        rows.append(race(_REDUCTION, job, mine, theirs, target, met))
    return rows


_SUBJECTS: tuple[Callable[[int, Tell], list[Row]], ...] = (reduction_lines, h_infinity_lines, loop_lines)
