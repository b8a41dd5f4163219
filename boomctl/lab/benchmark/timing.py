"""Run times that can be compared: jobs take turns in one process, on one thread, and medians stand for them.

What is measured is the processor time of this process; with one thread that is the run time of a machine at leisure.
"""

import gc
import os
import platform
import subprocess
import sys
import time
import tracemalloc
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from math import ceil
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

_TURN = 0.05  # least duration of a turn [s]: two hundred times the resolution of the processor's clock or more
_MOST_CALLS = 100  # in a turn: what is called so often has its caches warm
_PACKAGES = ("boomctl", "numpy", "scipy", "control", "slycot", "mpmath")


@dataclass(frozen=True)
class Job:
    """Something to time: ``work`` is given what ``prepare`` returns, which is made anew before each call, untimed."""

    work: Callable[[Any], object]
    prepare: Callable[[], Any] = lambda: None


@contextmanager
def one_thread() -> Iterator[None]:
    """Run with one BLAS thread; the number of before is restored."""
    from threadpoolctl import threadpool_limits

    with threadpool_limits(limits=1):
        yield


def _once(job: Job) -> float:
    ready = job.prepare()
    enabled = gc.isenabled()
    gc.disable()
    try:
        start = time.process_time()
        job.work(ready)
        return time.process_time() - start
    finally:
        if enabled:
            gc.enable()


def interleaved(jobs: Mapping[str, Job], repeats: int, warm: bool = True) -> dict[str, float]:
    """Return the median processor time of each job [s], the jobs taking turns.

    Parameters
    ----------
    jobs : mapping from name to Job
    repeats : int
        How many rounds.
    warm : bool
        Run each job once before, unmeasured, so that no one pays for imports and tables made once.
    """
    if warm:
        for job in jobs.values():
            _once(job)
    gc.collect()
    rounds = [{name: _once(job) for name, job in jobs.items()} for _ in range(repeats)]
    return {name: float(np.median([turn[name] for turn in rounds])) for name in jobs}


def in_turns(runs: Mapping[str, Callable[[], object]], repeats: int) -> dict[str, float]:
    """Return the median processor time of a call [s], the runs taking turns of at least 50 ms.

    A short run is called again and again in its turn, as it is in use; called once, it would first of all pay for the
    caches that its neighbours, which keep them warm by themselves, have filled.

    Parameters
    ----------
    runs : mapping from name to callable
    repeats : int
        Number of turns of each.
    """
    calls = {name: min(_MOST_CALLS, ceil(_TURN / max(_called_again(run), 1e-6))) for name, run in runs.items()}
    jobs = {name: Job(lambda _, run=run, name=name: _repeat(run, calls[name])) for name, run in runs.items()}
    return {name: taken / calls[name] for name, taken in interleaved(jobs, repeats, warm=False).items()}


def _called_again(run: Callable[[], object]) -> float:
    """Processor time of a call after a first one, s."""
    run()
    return process_time_of(run)


def process_time_of(run: Callable[[], object]) -> float:
    """Return the processor time of a call [s]."""
    start = time.process_time()
    run()
    return time.process_time() - start


def _repeat(run: Callable[[], object], calls: int) -> None:
    for _ in range(calls):
        run()


def peak_memory(job: Job) -> int:
    """Return the most memory that a job held at a time, beyond what was there before [bytes]."""
    ready = job.prepare()
    gc.collect()
    tracing = tracemalloc.is_tracing()
    if not tracing:
        tracemalloc.start()
    try:
        before = tracemalloc.get_traced_memory()[0]
        tracemalloc.reset_peak()
        job.work(ready)
        return tracemalloc.get_traced_memory()[1] - before
    finally:
        if not tracing:
            tracemalloc.stop()


def fresh_processes(codes: Sequence[str], repeats: int) -> dict[str, float]:
    """Return the median processor time of processes [s], each new and running some lines of Python, taking turns.

    Bytecode is compiled beforehand, as it is in an installed package, also where Python is told not to write it.
    """
    ending = "\nimport sys, time; sys.stderr.write(str(time.process_time()))"

    def once(code: str) -> float:
        words = [sys.executable, "-c", code + ending]
        done = subprocess.run(words, capture_output=True, text=True, check=True, timeout=120, env=variables)
        return float(done.stderr)

    with TemporaryDirectory(prefix="boomctl-") as folder:
        variables = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
        if sys.dont_write_bytecode:
            variables["PYTHONPYCACHEPREFIX"] = folder
        for code in codes:
            once(code)
        rounds = [[once(code) for code in codes] for _ in range(repeats)]
    return dict(zip(codes, np.median(rounds, axis=0).tolist(), strict=True))


def environment(packages: Sequence[str] = _PACKAGES) -> dict[str, str]:
    """Return versions, cores and threads, for whoever compares runs."""
    from threadpoolctl import threadpool_info

    facts = {"python": platform.python_version(), "system": f"{platform.system()} {platform.machine()}"}
    for package in packages:
        try:
            facts[package] = version(package)
        except PackageNotFoundError:
            facts[package] = "source tree" if package == "boomctl" else "not installed"
    facts["cores"] = str(os.cpu_count() or 1)
    with one_thread():
        pools = threadpool_info()
    blas = {f"{pool['internal_api']} {pool['version']}: {pool['num_threads']}" for pool in pools}
    facts["threads while timing"] = "; ".join(sorted(blas))
    return facts
