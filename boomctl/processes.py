"""Processes that compute for this one: each dies alone, and none outlives the one that asks.

They compute with one BLAS thread each, unless the environment says otherwise.  Interrupts they ignore: this process answers
them, and ends the others.
"""

import os
import signal
import threading
import traceback
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from multiprocessing import get_context, parent_process, resource_tracker
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from types import TracebackType
from typing import Any

_BLAS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")  # what numpy's libraries read at their start
_MASKS = hasattr(signal, "pthread_sigmask")  # not on Windows, where no process inherits what becomes of interrupts
_WATCH = "boomctl-parent"  # name of the thread that looks whether the parent is there
_LOOKED = 1.0  # s between two looks whether the parent is there: how long a process outlives it (a choice)


def cores() -> int:
    """Return how many processors this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def end_with_parent() -> None:
    """Let this process end when the one that started it does, however that ends: it computes for nobody any more."""
    parent, began = parent_process(), os.getppid()
    if parent is None or any(each.name == _WATCH for each in threading.enumerate()):
        return

    def look() -> None:
        # processes forked later hold this one's pipe to its parent, which then seems to live as long as they do
        while parent.is_alive() and os.getppid() == began:
            parent.join(_LOOKED)
        os._exit(1)

    threading.Thread(target=look, name=_WATCH, daemon=True).start()


@dataclass(frozen=True, eq=False)
class _Process:
    """A process, and the connection to it."""

    process: BaseProcess
    connection: Connection

    def answer(self, work: Callable[..., Any], arguments: tuple[Any, ...], seconds: float | None) -> Any:
        """Return what a function returns, and its error; EOFError or OSError where the process has ended."""
        self.connection.send((work, arguments))
        ready = wait([self.connection, self.process.sentinel], seconds)
        if not ready:
            raise TimeoutError(f"no answer in {seconds:g} s")
        if self.connection not in ready:
            raise EOFError
        return self.connection.recv()

    def end(self) -> None:
        """End a process that has nothing to do, or has ended."""
        with suppress(OSError):
            self.connection.send(None)
        self.process.join()
        self.connection.close()


class Processes(ThreadPoolExecutor):
    """Threads with a process each, which they may ask to compute; an executor of ``concurrent.futures``.

    For a ``with`` block, as ``processes.submit(processes.ask, work, ...)``.  An error that leaves the block ends the
    processes in the middle of what they do.

    Parameters
    ----------
    count : int
        How many.
    method : str, optional
        How `multiprocessing` starts them: by default as the system does.
    """

    def __init__(self, count: int, method: str | None = None) -> None:
        super().__init__(count, initializer=self._take)
        self._context = get_context(method)
        self._changing, self._closed = threading.Lock(), False
        self._all: set[_Process] = set()
        if _MASKS and self._context.get_start_method() != "fork":
            resource_tracker.ensure_running()  # where it starts later, it lets interrupts through again
        try:
            for _ in range(count):  # here, not in the threads: a process is best forked while there are few of them
                self._started()
        except BaseException:
            self._kill()
            raise
        self._free, self._of_thread = list(self._all), threading.local()

    def _take(self) -> None:
        self._of_thread.process = self._free.pop()

    def ask(self, work: Callable[..., Any], *arguments: Any, seconds: float | None = None) -> Any:
        """Return, in one of the threads, what a function of a module returns in its process; whatever it raises is raised.

        Raises
        ------
        BrokenProcessPool
            The process has ended without an answer; another one takes its place.
        TimeoutError
            There is no answer within so many seconds [s]; the process is ended, and another one takes its place.
        """
        try:
            found, error = self._of_thread.process.answer(work, arguments, seconds)
        except TimeoutError:
            self._replace()
            raise
        except (EOFError, OSError):
            self._replace()
            raise BrokenProcessPool("the process that computed it has ended without an answer") from None
        if isinstance(error, MemoryError):
            self._replace()
        if error is not None:
            raise error
        return found

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if kind is not None:
            self._kill()
        self.shutdown()
        for each in self._all:
            each.end()

    def _kill(self) -> None:
        self.shutdown(wait=False, cancel_futures=True)
        with self._changing:
            self._closed = True
            for each in self._all:
                each.process.kill()

    def _replace(self) -> None:
        old = self._of_thread.process
        with self._changing:
            if not self._closed:
                old.process.kill()
                old.end()
                self._all.discard(old)
                self._of_thread.process = self._started()

    def _started(self) -> _Process:
        ours, theirs = self._context.Pipe()
        process = self._context.Process(target=_serve, args=(theirs,))  # type: ignore[attr-defined]
        started = _Process(process, ours)
        with _quiet_start():
            process.start()
            self._all.add(started)  # before an interrupt is heard, which ends it, too
        theirs.close()
        return started


@contextmanager
def _quiet_start() -> Iterator[None]:
    """Let processes that begin meanwhile compute with one thread and hear no interrupts, from the first moment on.

    One that comes meanwhile is for this process, which hears it afterwards.
    """
    added = [name for name in _BLAS if name not in os.environ]
    before = signal.pthread_sigmask(signal.SIG_BLOCK, ()) if _MASKS else set()
    try:
        os.environ.update(dict.fromkeys(added, "1"))
        if _MASKS:
            # one that came just now may be raised here, blocked
            signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        yield
    finally:
        for name in added:
            os.environ.pop(name, None)  # another thread's start may have ended before
        if _MASKS:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _serve(connection: Connection) -> None:
    """Do what comes over a connection until it is closed; errors go back with the place at which they arose."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    end_with_parent()
    while True:
        try:
            task = connection.recv()
        except EOFError:
            return
        except Exception as error:  # what it is to do is not found here
            task = _raised, (error,)
        if task is None:
            return
        work, arguments = task
        try:
            answer = work(*arguments), None
        except Exception as error:
            error.add_note(traceback.format_exc())
            answer = None, error
        try:
            connection.send(answer)
        except OSError:
            return  # nobody listens any more
        except Exception as error:  # it does not pickle
            connection.send((None, error))


def _raised(error: Exception) -> None:
    raise error
