"""Independent parts of a reproduction, computed in parallel or one after the other, and their chapters of the report."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from joblib import Parallel, delayed

from boomctl.report import Section

Jobs = Mapping[str, Callable[[], Any]]
"""Functions by name; they and their results can be pickled."""


@dataclass(frozen=True)
class Chapter:
    """Sections of a report, and what they put into ``results.json``."""

    sections: tuple[Section, ...]
    results: dict[str, Any]


def run_jobs(
    jobs: Jobs, workers: int | None, tell: Callable[[str, int, int], Any] = lambda stage, done, total: None
) -> dict[str, Any]:
    """Return what each function returns, by its name.

    Parameters
    ----------
    jobs : mapping of str to callable
        The longest first, so that no process computes alone at the end.
    workers : int or None
        Processes of joblib, which share the processors; 1: this process computes everything, None: one a processor.
    tell : callable
        Called with the first job that is not done, with the number of those that are, and with that of all.

    Raises
    ------
    Exception
        What a job raises; joblib ends the other jobs.
    BrokenProcessPool
        A process ended without an answer.
    """
    answers = Parallel(workers or -1, return_as="generator")(delayed(work)() for work in jobs.values())
    result = {}
    for name in jobs:
        tell(name, len(result), len(jobs))
        result[name] = next(answers)
    next(answers, None)  # which ends them
    return result
