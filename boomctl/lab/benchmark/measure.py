"""Measure the settings of a scene, each in a new Python process with the default number of BLAS threads.

The process makes the problem and calls the method: the first call, with what it imports, is the cold one.  Later calls
have another value of a parameter each, so that nothing stored from an earlier call is the answer; their median is the hot
run time.  Both include everything that is built from the parameters.
"""

import gc
import os
import pickle
import re
import subprocess
import sys
import time
import warnings
from collections.abc import Callable
from dataclasses import replace
from importlib import import_module
from math import inf, isfinite, sqrt
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory
from typing import Any

from boomctl.lab.benchmark.diagram import Diagram, Point
from boomctl.lab.benchmark.scene import Scene, Setting

_CHANGES = 1e-9, 1e-6  # least and largest relative change of a parameter: new to every cache, the same problem
_GOLDEN = (sqrt(5.0) - 1.0) / 2.0  # its multiples modulo one are all different and spread evenly
_MOST_CALLS = 200  # hot calls in a process: the median of so many lies within a few per cent
_ONCE = 3.0  # s of a later call, above which one process is enough: what disturbs it is a small part of it
_LONG_CALL = 20.0  # s of a first call that is also the later one: what only a first call does is a small part of it
_THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
_KIBIBYTE = 1024.0  # bytes: unit of the resident memory that Linux reports
_STATUS = Path("/proc/self/status")  # has the largest one since the program began; getrusage: with that of its parent
_WORDS = 160  # characters of a message that are shown


def scene_at(location: str) -> Scene:
    """Return the scene that a function makes, named "module:function"."""
    module, _, name = location.partition(":")
    return getattr(import_module(module), name)()


def measured(key: str, location: str, *, quick: bool, time_limit: float, progress: Callable[[str], None]) -> Diagram:
    """Measure a scene.

    Parameters
    ----------
    key : str
        Its short name.
    place : str
        What makes it, "module:function".
    quick : bool
        One process for each of a third of the settings; otherwise three for each of all whose calls are short, in turn,
        so that a machine that is slow for a while is slow for every method.
    time_limit : float
        Of one process [s]; a longer one is ended, and the setting has failed.
    progress : callable
        Called with the name of the next setting.

    Returns
    -------
    Diagram
        A setting that raises, takes too long or gives no finite error is a point with ``failed``.
    """
    scene = scene_at(location)
    chosen = scene.few if quick else dict(enumerate(scene.settings))
    runs: dict[int, list[dict[str, Any]]] = {k: [] for k in chosen}
    for _ in range(1 if quick else 3):
        for k, setting in chosen.items():
            progress(f"{key}: {setting.method}, {setting.label}")
            if setting.missing:
                runs[k] = [{"failed": setting.missing}]
            elif not any("failed" in run or run["hot"][0][0] > _ONCE for run in runs[k]):
                runs[k].append(_in_new_process(location, k, 0.1 if quick else 0.5, time_limit))
    progress(f"{key}: reference solution")
    problem = scene.problem()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        reference = scene.reference(problem)
        points = [_point(scene, problem, reference, setting, runs[k]) for k, setting in chosen.items()]
    compared, sized = (tuple(p for p in points if bool(p.size) is other) for other in (False, True))
    return Diagram(key, scene.title, scene.question, scene.measure, compared, scene.remarks, sized)


def _point(scene: Scene, problem: Any, reference: Any, setting: Setting, runs: list[dict[str, Any]]) -> Point:
    point = Point(setting.method, setting.label, setting.ours, setting.verified, size=setting.size, call=setting.call)
    failed = next((run["failed"] for run in runs if "failed" in run), "")
    if failed:
        return replace(point, failed=failed)
    error = inf if setting.size else float(scene.error(problem, reference, runs[0]["answer"]))
    if not setting.size and not isfinite(error):
        return replace(point, failed="the error of its answer is not finite")
    cold, cold_processor = (median(values) for values in zip(*(run["cold"] for run in runs), strict=True))
    hot, hot_processor = (median(values) for values in zip(*(turn for run in runs for turn in run["hot"]), strict=True))
    times = {"cold": cold, "hot": hot, "cold_processor": cold_processor, "hot_processor": hot_processor}
    return replace(point, error=error, memory=max(filter(None, (run["memory"] for run in runs)), default=None), **times)


def _in_new_process(location: str, index: int, duration: float, time_limit: float) -> dict[str, Any]:
    """Return what :func:`main` stores of one setting, or why it stores nothing."""
    environment = {name: value for name, value in os.environ.items() if name not in _THREADS}
    environment["PYTHONPATH"] = os.pathsep.join(filter(None, sys.path))
    with TemporaryDirectory(prefix="boomctl-") as folder:
        stored = Path(folder) / "answer.pickle"
        words = [sys.executable, "-P", "-m", __name__, location, str(index), str(duration), str(stored)]
        try:
            done = subprocess.run(words, env=environment, capture_output=True, text=True, timeout=time_limit)
        except subprocess.TimeoutExpired:
            return {"failed": f"no answer within {time_limit:g} s"}
        if not stored.is_file():
            return {"failed": f"exit code {done.returncode}: {' '.join(done.stderr.split())[-_WORDS:]}"}
        return pickle.loads(stored.read_bytes())


def main(location: str, index: str, duration: str, stored: str) -> None:
    """Solve the problem of a scene at one setting, and store answer and run times, or the message of an exception."""
    scene = scene_at(location)
    setting = scene.settings[int(index)]
    problem = scene.problem()
    warnings.simplefilter("ignore")
    gc.collect()
    try:
        answer, *cold = _timed(setting, problem, 0.0)
        hot = [cold] if cold[0] > _LONG_CALL else []
        while not hot or (sum(turn[0] for turn in hot) < float(duration) and len(hot) < _MOST_CALLS):
            low, high = _CHANGES
            hot.append(_timed(setting, problem, low + (high - low) * ((len(hot) + 1) * _GOLDEN % 1.0))[1:])
        peak = re.search(r"VmHWM:\s+(\d+) kB", _STATUS.read_text()) if _STATUS.exists() else None
        memory = None if peak is None else _KIBIBYTE * int(peak[1])
        result = {"answer": None if setting.size else answer, "cold": cold, "hot": hot, "memory": memory}
    except Exception as raised:  # Any exception is the reason of the failure.
        result = {"failed": f"{type(raised).__name__}: {' '.join(str(raised).split())}"[:_WORDS]}
    Path(stored).write_bytes(pickle.dumps(result))


def _timed(setting: Setting, problem: Any, change: float) -> list[Any]:
    """Return an answer, its run time and its processor time [s]."""
    processor, elapsed = time.process_time(), time.perf_counter()
    answer = setting.solve(problem, change)
    return [answer, time.perf_counter() - elapsed, time.process_time() - processor]


if __name__ == "__main__":
    main(*sys.argv[1:])
