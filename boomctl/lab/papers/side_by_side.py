"""Independent pieces of work, side by side in processes of their own, or one after the other in this one."""

import os
import signal
import traceback
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from multiprocessing import get_context
from multiprocessing.connection import Connection, wait
from threading import current_thread, main_thread
from typing import Any

_BLAS = (
    "OMP_NUM_THREADS",
    "OPENBLAS_NUM_THREADS",
    "MKL_NUM_THREADS",
)  # what numpy's libraries read when they are loaded


@dataclass(frozen=True)
class Job:
    """A piece of work that waits for no other.

    Attributes
    ----------
    name : str
        For whoever waits.
    work : callable
        A function of a module, so that another process finds it.
    arguments : tuple
        What it is given; they and what it returns can be pickled.
    """

    name: str
    work: Callable[..., Any]
    arguments: tuple[Any, ...] = ()


def cores() -> int:
    """Return how many processors this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def side_by_side(jobs: Sequence[Job], workers: int, tell: Callable[[str], None] = lambda text: None) -> list[Any]:
    """Return what each job returns, in their order.

    Parameters
    ----------
    jobs : sequence of Job
        The longest first, so that no worker is left alone with one at the end.
    workers : int
        Processes; each computes with one BLAS thread unless the environment says otherwise.  1: this process does it all.
    tell : callable
        Told, whenever a job begins, which ones are under way.

    Raises
    ------
    Exception
        What a job raises, the other jobs being ended.
    RuntimeError
        A process ended without an answer.
    """
    found: dict[int, Any] = {}
    if min(workers, len(jobs)) <= 1:
        for i, job in enumerate(jobs):
            tell(job.name)
            found[i] = job.work(*job.arguments)
        return list(found.values())
    waiting = iter(range(len(jobs)))
    with _processes(min(workers, len(jobs))) as idle:
        busy: dict[Connection, int] = {}
        while len(found) < len(jobs):
            for connection, i in zip(idle, waiting, strict=False):
                connection.send((jobs[i].work, jobs[i].arguments))
                busy[connection] = i
                tell(", ".join(jobs[k].name for k in busy.values()))
            idle = [connection for connection in wait(list(busy)) if isinstance(connection, Connection)]
            for connection in idle:
                i = busy.pop(connection)
                try:
                    error, found[i] = connection.recv()
                except EOFError:
                    raise RuntimeError(f"{jobs[i].name}: the process that computed it has ended") from None
                if error is not None:
                    raise error
    return [found[i] for i in range(len(jobs))]


@contextmanager
def _processes(count: int) -> Iterator[list[Connection]]:
    """Start processes and give the connection to each; however it ends, none of them is left."""
    context, started = get_context("spawn"), []
    set_here = [name for name in _BLAS if name not in os.environ]
    try:
        os.environ.update(dict.fromkeys(set_here, "1"))
        with _deaf():
            for _ in range(count):
                ours, theirs = context.Pipe()
                process = context.Process(target=_serve, args=(theirs,), daemon=True)
                process.start()
                theirs.close()
                started.append((process, ours))
        yield [connection for _, connection in started]
    finally:
        for name in set_here:
            del os.environ[name]
        for process, connection in started:
            process.terminate()
            process.join()
            connection.close()


@contextmanager
def _deaf() -> Iterator[None]:
    """Ignore interrupts for a moment: processes that are started meanwhile ignore them all their life.

    An interrupt of the terminal reaches them all; this process alone is to answer, and to end the others.
    """
    listening = signal.getsignal(signal.SIGINT) if current_thread() is main_thread() else None
    if listening is None:
        yield
        return
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, listening)


def _serve(connection: Connection) -> None:
    """Do what comes over a connection until it is closed; errors go back with the place at which they arose."""
    while True:
        try:
            work, arguments = connection.recv()
        except EOFError:
            return
        try:
            answer = None, work(*arguments)
        except Exception as error:
            error.add_note(traceback.format_exc())
            answer = error, None
        connection.send(answer)
