"""Independent parts of a reproduction, computed in parallel processes or one after the other in this one."""

import os
import signal
from collections.abc import Callable, Mapping
from concurrent.futures import ProcessPoolExecutor, as_completed
from multiprocessing import active_children, get_context
from typing import Any

Jobs = Mapping[str, Callable[[], Any]]
"""Functions by name; they and their results can be pickled."""


def run_jobs(jobs: Jobs, workers: int | None, tell: Callable[[str], None] = lambda text: None) -> dict[str, Any]:
    """Return what each function returns, by its name.

    Parameters
    ----------
    jobs : mapping of str to callable
        The longest first, so that no process is left alone with one at the end.
    workers : int or None
        Processes, each with one BLAS thread unless the environment says otherwise; 1: this process computes everything,
        None: as many as `ProcessPoolExecutor` takes.
    tell : callable
        Called before each job, or with jobs that are not done.

    Raises
    ------
    Exception
        What a job raises, the other jobs being ended.
    BrokenProcessPool
        A process ended without an answer.
    """
    if workers == 1 or len(jobs) < 2:
        found = {}
        for name, work in jobs.items():
            tell(name)
            found[name] = work()
        return found
    others = active_children()
    with ProcessPoolExecutor(workers, get_context("spawn"), _prepare_worker) as pool:
        names = {pool.submit(work): name for name, work in jobs.items()}
        left = list(jobs)
        try:
            tell(_summary(left))
            for future in as_completed(names):
                future.result()  # an error ends the other jobs
                left.remove(names[future])
                if left:
                    tell(_summary(left))
        except BaseException:
            for process in set(active_children()).difference(others):
                process.terminate()
            raise
    return {name: future.result() for future, name in names.items()}


def _summary(left: list[str]) -> str:
    return left[0] if len(left) == 1 else f"{left[0]} and {len(left) - 1} more"


def _prepare_worker() -> None:
    """Limit the BLAS threads of a process before it loads numpy, and let an interrupt end it without a traceback."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ.setdefault(name, "1")
