"""The benchmark of what suspensions are designed with: run time and error in one run, beside general-purpose tools."""

from collections.abc import Callable

from boomctl.benchmark.boom.scene import Progress
from boomctl.benchmark.report import BenchmarkReport, Row
from boomctl.benchmark.suspension.h_infinity import h_infinity_lines
from boomctl.benchmark.suspension.loop import loop_lines
from boomctl.benchmark.suspension.reduction import reduction_lines
from boomctl.benchmark.timing import environment, one_thread

Lines = Callable[[int, Progress], list[Row]]
"""Returns the rows of a subject, given the number of rounds and who is told what comes next."""

_LINES: tuple[Lines, ...] = (reduction_lines, h_infinity_lines, loop_lines)
_ROUNDS, _ROUNDS_FULL = 3, 9

_NOTES = (
    "Time: median processor time of jobs that take turns in one process, one BLAS thread. Ratio: peer over ours.",
    "Reduction: the error is the H-infinity norm of the difference from the full model over that of the full model, "
    "verified against 60 modes, the bound of all others included; each call of ours gets a model of its own, built "
    "beforehand with its two halves, and verifies its result within the time.",
)


def run(full: bool = False, progress: Progress | None = None) -> BenchmarkReport:
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
    tell: Progress = progress if progress is not None else lambda text: None
    rounds = _ROUNDS_FULL if full else _ROUNDS
    with one_thread():
        rows = [row for lines in _LINES for row in lines(rounds, tell)]
    return BenchmarkReport(tuple(rows), (), _NOTES, environment(), "boomctl benchmark suspension")
