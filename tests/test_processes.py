"""Processes that compute for this one: each dies alone, is replaced, computes with one thread, and leaves nobody behind."""

import os
import signal
import sys
import threading
import time
from concurrent.futures import BrokenExecutor
from concurrent.futures.process import BrokenProcessPool
from multiprocessing import get_context
from pathlib import Path

import pytest

from boomctl.processes import Processes, _quiet_start, cores

METHODS = ["spawn", None] if sys.platform == "win32" else ["spawn", "fork"]


class Unsendable(Exception):
    """An error that says more than it pickles."""

    def __init__(self, what, why):
        super().__init__(what)


def unsendable():
    raise Unsendable("this", "that")


def greedy():
    raise MemoryError


def noted_and_asleep(folder):
    (Path(folder) / str(os.getpid())).touch()
    time.sleep(60.0)


def runs(pid):
    """Return whether a process is there; one that has ended and that nobody asked for is none."""
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    return True


def ask(processes, work, *arguments, **limit):
    return processes.submit(processes.ask, work, *arguments, **limit).result()


@pytest.mark.parametrize("method", METHODS)
def test_one_that_dies_costs_its_own_answer_and_is_replaced(method):
    with Processes(1, method) as processes:
        first = ask(processes, os.getpid)
        assert ask(processes, os.getpid) == first != os.getpid()
        with pytest.raises(BrokenProcessPool, match="has ended without an answer"):
            ask(processes, os._exit, 3)
        assert ask(processes, os.getpid) not in (first, os.getpid())
        answers = [processes.submit(processes.ask, *task) for task in ((abs, -1), (os._exit, 3), (abs, -2))]
    assert [answers[0].result(), answers[2].result()] == [1, 2]
    assert isinstance(answers[1].exception(), BrokenExecutor)


@pytest.mark.parametrize("method", METHODS)
def test_one_that_gives_no_answer_in_time_is_ended(method):
    with Processes(1, method) as processes:
        first = ask(processes, os.getpid)
        with pytest.raises(TimeoutError, match=r"no answer in 0\.5 s"):
            ask(processes, time.sleep, 60.0, seconds=0.5)
        assert ask(processes, os.getpid, seconds=60.0) != first
        assert not runs(first)


def test_what_does_not_pickle_is_an_error_of_its_own_alone():
    with Processes(1) as processes:
        first = ask(processes, os.getpid)
        for work in (lambda: 1, threading.Lock, unsendable):
            answer = processes.submit(processes.ask, work)
            assert answer.exception() is not None
            assert not isinstance(answer.exception(), BrokenExecutor)
        assert ask(processes, os.getpid) == first


def test_an_error_says_where_it_arose():
    with Processes(1) as processes, pytest.raises(ValueError, match="invalid literal") as caught:
        ask(processes, int, "seven")
    assert "Traceback" in caught.value.__notes__[0]


def test_one_that_ran_out_of_memory_is_replaced():
    with Processes(1) as processes:
        first = ask(processes, os.getpid)
        with pytest.raises(MemoryError):
            ask(processes, greedy)
        assert ask(processes, os.getpid) != first


@pytest.mark.slow
@pytest.mark.parametrize("method", METHODS)
def test_an_error_in_the_block_ends_them_in_the_middle_of_what_they_do(method, tmp_path):
    asked, began = [], 0.0
    with pytest.raises(KeyboardInterrupt), Processes(2, method) as processes:  # noqa: PT012 - it is raised in the block
        asked += [processes.submit(processes.ask, noted_and_asleep, tmp_path) for _ in range(5)]
        while len(list(tmp_path.iterdir())) < 2:
            time.sleep(0.02)
        began = time.monotonic()
        raise KeyboardInterrupt
    assert time.monotonic() < began + 30.0  # half of what they sleep
    assert all(future.cancelled() or isinstance(future.exception(), BrokenExecutor) for future in asked)
    assert not any(runs(int(path.name)) for path in tmp_path.iterdir())


def test_they_compute_with_one_thread_and_the_environment_stays_as_it_was(monkeypatch):
    monkeypatch.delenv("OMP_NUM_THREADS", raising=False)
    monkeypatch.setenv("MKL_NUM_THREADS", "3")
    with Processes(1) as processes:
        found = [ask(processes, os.getenv, name) for name in ("OMP_NUM_THREADS", "MKL_NUM_THREADS")]
    assert found == ["1", "3"]
    assert "OMP_NUM_THREADS" not in os.environ


@pytest.mark.parametrize("method", METHODS)
def test_they_ignore_interrupts_and_this_process_does_not(method):
    before = signal.getsignal(signal.SIGINT)
    with Processes(1, method) as processes:
        assert ask(processes, signal.getsignal, signal.SIGINT) == signal.SIG_IGN
        if hasattr(signal, "pthread_sigmask"):  # from the first moment on
            assert signal.SIGINT in ask(processes, signal.pthread_sigmask, signal.SIG_BLOCK, ())
    assert signal.getsignal(signal.SIGINT) == before


@pytest.mark.skipif(not hasattr(signal, "pthread_sigmask"), reason="signals of POSIX")
def test_an_interrupt_that_comes_while_they_start_is_heard_afterwards():
    before, started = signal.signal(signal.SIGINT, signal.default_int_handler), []
    try:
        with pytest.raises(KeyboardInterrupt), _quiet_start():  # noqa: PT012 - what follows it must run
            signal.raise_signal(signal.SIGINT)
            started.append(True)
    finally:
        signal.signal(signal.SIGINT, before)
    assert started


@pytest.mark.skipif(not hasattr(signal, "pthread_sigmask"), reason="signals of POSIX")
@pytest.mark.parametrize("method", METHODS)
def test_and_ends_those_that_have_started(monkeypatch, method):
    """This process waits for them at its end: it did so for ever."""
    process = get_context(method).Process
    start, started = process.start, []

    def interrupted(self):
        start(self)
        started.append(self)
        if len(started) == 2:
            signal.raise_signal(signal.SIGINT)

    monkeypatch.setattr(process, "start", interrupted)
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        with pytest.raises(KeyboardInterrupt):
            Processes(3, method)
        for each in started:
            each.join(20.0)
        assert len(started) == 2
        assert not any(each.is_alive() for each in started)
    finally:
        signal.signal(signal.SIGINT, before)
        for each in started:
            each.kill()


@pytest.mark.skipif(not hasattr(signal, "pthread_sigmask"), reason="signals of POSIX")
def test_interrupts_are_heard_again_where_one_is_raised_as_they_are_masked(monkeypatch):
    mask, environment = signal.pthread_sigmask, dict(os.environ)
    before = mask(signal.SIG_BLOCK, ())

    def raising(how, signals):
        found = mask(how, signals)
        if signal.SIGINT in signals:
            raise KeyboardInterrupt
        return found

    monkeypatch.setattr(signal, "pthread_sigmask", raising)
    with pytest.raises(KeyboardInterrupt), _quiet_start():
        pass
    assert mask(signal.SIG_SETMASK, before) == before
    assert dict(os.environ) == environment


def test_a_machine_has_cores():
    assert 1 <= cores() <= (os.cpu_count() or 1)
