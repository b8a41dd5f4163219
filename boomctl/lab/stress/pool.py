"""Cases side by side, in processes that can be ended: one that hangs, dies or eats the memory costs its own line alone."""

import os
import signal
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from multiprocessing import get_context
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from threading import current_thread, main_thread

from boomctl.lab.stress.case import Case, Line, Outcome, tried
from boomctl.progress import end_with_parent

_MEMORY = (
    8 * 2**30
)  # bytes that a case may ask for: what a small machine has, libraries of some 3 GB of addresses included
_START = 20.0  # s for a new process to begin: python and numpy on a busy machine (a choice)
_THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


def cores() -> int:
    """Return how many processors this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


@dataclass
class _Worker:
    process: BaseProcess
    connection: Connection
    place: int = -1
    began: float = 0.0
    fresh: bool = True


def all_tried(cases: Sequence[Case], workers: int, tell: Callable[[str], None]) -> list[Line]:
    """Return what came of each case, in their order; ``tell`` is told the name of each when it begins."""
    lines: dict[int, Line] = {}
    waiting = iter(range(len(cases)))
    running: list[_Worker] = []
    try:
        for _ in range(min(workers, len(cases))):
            running.append(_started())
            _give(running[-1], cases, next(waiting), tell)
        while running:
            ready = set(wait([w.connection for w in running], timeout=0.2))
            for i, worker in enumerate(list(running)):
                case = cases[worker.place]
                spent = time.monotonic() - worker.began
                if worker.connection in ready:
                    line = _answer(worker, case, spent)
                elif spent > case.seconds + (_START if worker.fresh else 0.0):
                    line = Line(case, Outcome.BROKEN, None, f"no answer in {case.seconds:g} s")
                else:
                    continue
                lines[worker.place] = replace(line, seconds=spent)
                worker.fresh = False
                if line.error is None and line.outcome is Outcome.BROKEN and not _alive(worker, line):
                    _end(worker)
                    worker = running[i] = _started()
                following = next(waiting, None)
                if following is None:
                    _end(worker)
                    running[i] = replace(worker, place=-1)
                else:
                    _give(worker, cases, following, tell)
            running = [w for w in running if w.place >= 0]
    finally:
        for worker in running:
            _end(worker)
    return [lines[i] for i in range(len(cases))]


def _answer(worker: _Worker, case: Case, spent: float) -> Line:
    try:
        line = worker.connection.recv()
    except (EOFError, ConnectionError):
        return Line(case, Outcome.BROKEN, None, f"the process that computed it has ended, after {spent:.1f} s")
    return line


def _alive(worker: _Worker, line: Line) -> bool:
    """Return whether a process that left a broken line can go on: it has answered, and did not run out of memory."""
    return not line.said.startswith(("no answer", "the process", "more memory"))


def _give(worker: _Worker, cases: Sequence[Case], place: int, tell: Callable[[str], None]) -> None:
    worker.place, worker.began = place, time.monotonic()
    tell(cases[place].name)
    worker.connection.send(cases[place])


def _started() -> _Worker:
    context = get_context("spawn")
    ours, theirs = context.Pipe()
    process = context.Process(target=_serve, args=(theirs,), daemon=False)
    with _one_thread(), _deaf():
        process.start()
    theirs.close()
    return _Worker(process, ours)


def _end(worker: _Worker) -> None:
    worker.process.kill()
    worker.process.join()
    worker.connection.close()


@contextmanager
def _one_thread() -> Iterator[None]:
    """Let processes that begin meanwhile compute with one thread each, unless the environment says otherwise."""
    added = [name for name in _THREADS if name not in os.environ]
    os.environ.update(dict.fromkeys(added, "1"))
    try:
        yield
    finally:
        for name in added:
            del os.environ[name]


@contextmanager
def _deaf() -> Iterator[None]:
    """Let processes that begin meanwhile ignore interrupts all their life: this one answers, and ends them."""
    if current_thread() is not main_thread():
        yield
        return
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


def _serve(connection: Connection) -> None:
    """Try the cases that come until the connection is closed."""
    end_with_parent()
    try:
        import resource  # there is none on Windows

        resource.setrlimit(resource.RLIMIT_AS, (_MEMORY, _MEMORY))
    except ImportError:
        pass
    while True:
        try:
            case = connection.recv()
        except EOFError:
            return
        try:
            line = tried(case)
        except MemoryError:
            line = Line(case, Outcome.BROKEN, None, f"more memory than {_MEMORY / 2**30:g} GB")
        connection.send(line)
