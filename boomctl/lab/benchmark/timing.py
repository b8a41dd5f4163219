"""Measures of runs: processor time of all threads, memory, and the machine and the versions of a run."""

import gc
import os
import platform
import time
import tracemalloc
from collections.abc import Callable
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

_PACKAGES = ("boomctl", "numpy", "scipy", "control", "slycot", "pymor", "casadi", "exudyn", "mpmath")


def processor_time() -> float:
    """Return the processor time of this process and of the processes that it waited for [s]."""
    try:
        import resource
    except ImportError:  # Windows, where it is not counted what a process's children take
        return time.process_time()
    children = resource.getrusage(resource.RUSAGE_CHILDREN)
    return time.process_time() + children.ru_utime + children.ru_stime


def peak_memory(run: Callable[[], object]) -> int:
    """Return the most memory that a call held at a time, beyond what was there before [bytes]."""
    gc.collect()
    tracing = tracemalloc.is_tracing()
    if not tracing:
        tracemalloc.start()
    try:
        before = tracemalloc.get_traced_memory()[0]
        tracemalloc.reset_peak()
        run()
        return tracemalloc.get_traced_memory()[1] - before
    finally:
        if not tracing:
            tracemalloc.stop()


def environment() -> dict[str, str]:
    """Return machine, versions, cores and threads, for whoever compares runs."""
    from threadpoolctl import threadpool_info

    facts = {
        "processor": _processor(),
        "python": platform.python_version(),
        "system": f"{platform.system()} {platform.machine()}",
    }
    for package in _PACKAGES:
        try:
            facts[package] = version(package)
        except PackageNotFoundError:
            facts[package] = "source tree" if package == "boomctl" else "not installed"
    facts["cores"] = str(os.cpu_count() or 1)
    blas = {f"{pool['internal_api']} {pool['version']}: {pool['num_threads']}" for pool in threadpool_info()}
    facts["threads"] = "; ".join(sorted(blas))
    return facts


def _processor() -> str:
    """Return the processor's name, and how busy the machine is."""
    name = platform.processor() or platform.machine()
    listed = Path("/proc/cpuinfo")
    if listed.is_file():
        lines = (line for line in listed.read_text(encoding="utf-8").splitlines() if line.startswith("model name"))
        name = next(lines, f":{name}").split(":", 1)[1].strip()
    load = f", load {os.getloadavg()[0]:.1f}" if hasattr(os, "getloadavg") else ""
    return name + load
