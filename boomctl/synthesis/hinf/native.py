"""Native H-infinity synthesis in a process of its own: kept warm, killed when its time is up, started anew when needed.

Native solvers hang on some plants.  They run in a child that costs milliseconds a call; scripts need no guard for
it, since the child runs this package's worker and not their own file.
"""

import atexit
import os
import subprocess
import sys
import threading
from contextlib import suppress
from functools import cache
from pathlib import Path

import numpy as np

from boomctl.arrays import Array
from boomctl.lti.system import Lti
from boomctl.synthesis.hinf import _worker
from boomctl.synthesis.hinf._worker import ANSWER, READY, REQUEST

_START = 120.0  # seconds a child may take to start: a second on an idle machine, much more on a crowded one
_THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS")


class NativeFailure(RuntimeError):
    """The native solver returned no controller: it refused, or ran out of time and was killed."""


class Worker:
    """A child process that runs native synthesis, one request at a time; safe to share between threads."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._process: subprocess.Popen[bytes] | None = None
        self._spent = 0.0

    @property
    def processor_time(self) -> float:
        """Processor time that children have spent on the requests they answered [s]."""
        return self._spent

    @property
    def pid(self) -> int | None:
        """Process id of the child, None before the first request and after a kill."""
        return self._process.pid if self._process is not None and self._process.poll() is None else None

    def warm(self) -> None:
        """Start the child if it does not run.

        Raises
        ------
        NativeFailure
            It cannot be started.
        """
        with self._lock:
            self._started()

    def controller(self, plant: Lti, nmeas: int, ncon: int, gamma: float, limit: float) -> Lti:
        """Return SLICOT's SB10FD controller of a level.

        Raises
        ------
        NativeFailure
            It refused, or took longer than ``limit`` seconds and was killed.
        """
        (n, m), p = plant.B.shape, len(plant.C)
        parts = (plant.A, plant.B, plant.C, plant.D)
        body = b"".join(np.ascontiguousarray(part, dtype=float).tobytes() for part in parts)
        with self._lock:
            process = self._started()
            ok, states, data = self._exchange(process, REQUEST.pack(n, m, p, ncon, nmeas, gamma) + body, limit)
        if not ok:
            raise NativeFailure(data.decode("utf-8", "replace"))
        return _controller(np.frombuffer(data), states, nmeas, ncon)

    def close(self) -> None:
        """End the child."""
        with self._lock:
            self._drop()

    def _started(self) -> "subprocess.Popen[bytes]":
        if self._process is not None and self._process.poll() is None:
            return self._process
        self._drop()
        # by its file: so it runs from a source tree as well as installed, and imports nothing of this package
        command = [sys.executable, "-P", str(Path(_worker.__file__).resolve())]
        environment = os.environ | dict.fromkeys(_THREADS, "1")
        pipe, nothing = subprocess.PIPE, subprocess.DEVNULL
        try:
            self._process = subprocess.Popen(command, stdin=pipe, stdout=pipe, stderr=nothing, env=environment)
        except OSError as error:
            raise NativeFailure(f"the process for native synthesis could not be started ({error})") from None
        try:
            greeting = self._guarded(self._process, len(READY), _START)
        except BaseException:  # an interrupt: whoever comes next must not take a late greeting for an answer
            self._drop()
            raise
        if greeting != READY:
            self._drop()
            raise NativeFailure("the process for native synthesis could not be started")
        return self._process

    def _exchange(self, process: "subprocess.Popen[bytes]", data: bytes, limit: float) -> tuple[bool, int, bytes]:
        killed = threading.Event()

        def expire() -> None:
            killed.set()
            process.kill()

        timer = threading.Timer(min(limit, threading.TIMEOUT_MAX), expire)
        timer.daemon = True
        timer.start()
        try:
            assert process.stdin is not None
            assert process.stdout is not None
            process.stdin.write(data)
            process.stdin.flush()
            head = process.stdout.read(ANSWER.size)
            ok, states, length, spent = ANSWER.unpack(head) if len(head) == ANSWER.size else (0, 0, -1, 0.0)
            body = process.stdout.read(length) if length > 0 else b""
        except OSError:
            ok, states, length, spent, body = 0, 0, -1, 0.0, b""
        except BaseException:  # an interrupt: whoever asks next must not be given the answer to this request
            self._drop()
            raise
        finally:
            timer.cancel()
        if killed.is_set() or length != len(body):
            self._drop()
            why = f"it took longer than {limit:.3g} s and was killed" if killed.is_set() else "its process died"
            raise NativeFailure(why)
        self._spent += spent
        return bool(ok), states, body

    def _guarded(self, process: "subprocess.Popen[bytes]", count: int, limit: float) -> bytes:
        timer = threading.Timer(limit, process.kill)
        timer.daemon = True
        timer.start()
        try:
            assert process.stdout is not None
            return process.stdout.read(count)
        finally:
            timer.cancel()

    def _drop(self) -> None:
        process, self._process = self._process, None
        if process is None:
            return
        process.kill()
        process.wait()
        for pipe in (process.stdin, process.stdout):
            if pipe is not None:
                with suppress(OSError):
                    pipe.close()


def _controller(numbers: Array, n: int, nmeas: int, ncon: int) -> Lti:
    sizes = np.cumsum([n * n, n * nmeas, ncon * n])
    A, B, C, D = np.split(numbers, sizes)
    return Lti(A.reshape(n, n), B.reshape(n, nmeas), C.reshape(ncon, n), D.reshape(ncon, nmeas))


@cache
def _worker_of(process: int) -> Worker:
    worker = Worker()
    atexit.register(_close_own, worker, process)
    return worker


def _close_own(worker: Worker, process: int) -> None:
    if os.getpid() == process:
        worker.close()


def shared_worker() -> Worker:
    """Return the worker of this process; it ends with it."""
    return _worker_of(os.getpid())
