"""The process for native synthesis: warm, killed in time, started anew, safe between threads, no guard in scripts."""

import os
import signal
import subprocess
import sys
import threading
from pathlib import Path
from types import SimpleNamespace

import control
import numpy as np
import pytest

import boomctl as bc
from boomctl.lti.system import Lti
from boomctl.synthesis.hinf.native import NativeFailure, Worker, shared_worker
from tests.synthesis.plants import resonators, weighed


def matrices(P: control.StateSpace) -> Lti:
    return Lti(P.A, P.B, P.C, P.D)


@pytest.fixture(scope="module")
def small():
    return matrices(weighed(resonators(2, 0.01, 1)))


@pytest.fixture
def worker():
    worker = Worker()
    yield worker
    worker.close()


def test_one_process_serves_all_calls_and_ends_when_closed(worker, small):
    worker.warm()
    first = worker.pid
    K = worker.controller(small, 1, 1, 2.0, 60.0)
    assert worker.controller(small, 1, 1, 2.0, 60.0).A.shape == K.A.shape == (4, 4)
    assert worker.pid == first
    worker.close()
    assert worker.pid is None


def test_refusals_come_back_in_words(worker, small):
    with pytest.raises(NativeFailure) as refused:
        worker.controller(small, 1, 1, 1e-9, 60.0)
    assert str(refused.value)
    assert worker.pid is not None


def test_a_call_that_takes_too_long_is_killed_and_the_next_one_works(worker, small):
    large = matrices(weighed(resonators(100, 0.01, 1)))
    worker.warm()
    first = worker.pid
    with pytest.raises(NativeFailure, match=r"longer than 0\.005 s and was killed"):
        worker.controller(large, 1, 1, 100.0, 0.005)
    assert worker.pid is None
    worker.controller(small, 1, 1, 2.0, 60.0)
    assert worker.pid not in (None, first)


def test_an_interrupted_call_leaves_no_answer_to_the_next_one(worker, small, monkeypatch):
    """An interrupt reaches a notebook's kernel alone, not the child, whose answer would be taken for the next one."""
    large = matrices(weighed(resonators(20, 0.01, 1)))
    worker.warm()
    process = worker._process
    read = process.stdout.read

    def interrupted(count):
        read(0)
        raise KeyboardInterrupt

    monkeypatch.setattr(process, "stdout", SimpleNamespace(read=interrupted, close=process.stdout.close))
    with pytest.raises(KeyboardInterrupt):
        worker.controller(large, 1, 1, 100.0, 60.0)
    assert worker.pid is None
    assert worker.controller(small, 1, 1, 2.0, 60.0).A.shape == (4, 4)


def test_time_limits_beyond_what_clocks_hold(worker, small):
    assert worker.controller(small, 1, 1, 2.0, 1e99).A.shape == (4, 4)
    assert bc.h_infinity(weighed(resonators(2, 0.01, 1)), 1, 1, time_limit=1e99).gamma > 0.0


def test_a_worker_that_dies_is_replaced(worker, small):
    worker.warm()
    first = worker.pid
    os.kill(first, 9)
    os.waitid(os.P_PID, first, os.WEXITED | os.WNOWAIT)
    assert worker.controller(small, 1, 1, 2.0, 60.0).A.shape == (4, 4)
    assert worker.pid not in (None, first)


def test_threads_share_it():
    P = weighed(resonators(3, 0.01, 2))
    found: list[float] = []
    threads = [threading.Thread(target=lambda: found.append(bc.h_infinity(P, 1, 1).gamma)) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(found) == 4
    assert np.ptp(found) == 0.0


def test_synthesis_says_that_its_time_ran_out():
    with pytest.raises(bc.SynthesisError, match="time limit of 1e-06 s ran out while"):
        bc.h_infinity(weighed(resonators(3, 0.01, 2)), 1, 1, time_limit=1e-6)


def test_a_native_solver_out_of_order_does_not_stop_synthesis(monkeypatch):
    def broken(self, *arguments):
        raise NativeFailure("out of order")

    monkeypatch.setattr(Worker, "controller", broken)
    design = bc.h_infinity(weighed(resonators(3, 0.01, 2)), 1, 1)
    assert design.certificate.solver == "two Riccati equations"
    assert design.gamma <= 1.01 * design.certificate.lower
    first, *_, last = design.certificate.path
    assert first.startswith("SLICOT SB10FD at gamma = ")
    assert first.endswith(": out of order")
    assert last == f"two Riccati equations at gamma = {design.certificate.level:.6g}: passed"


def test_a_process_that_cannot_start_does_not_stop_synthesis(monkeypatch):
    shared_worker().close()
    monkeypatch.setattr(sys, "executable", "/nowhere/python")
    design = bc.h_infinity(weighed(resonators(3, 0.01, 2)), 1, 1)
    assert design.certificate.solver == "two Riccati equations"


@pytest.mark.skipif(not hasattr(signal, "SIGSTOP"), reason="processes cannot be stopped here")
def test_a_native_solver_that_hangs_is_killed_and_synthesis_goes_on():
    P = weighed(resonators(3, 0.01, 2))
    bc.h_infinity(P, 1, 1)
    hung = shared_worker().pid
    os.kill(hung, signal.SIGSTOP)
    design = bc.h_infinity(P, 1, 1, time_limit=3.0)
    assert design.certificate.solver == "two Riccati equations"
    assert design.gamma <= 1.01 * design.certificate.lower
    assert bc.h_infinity(P, 1, 1).certificate.solver == "SLICOT SB10FD"
    assert shared_worker().pid not in (None, hung)


@pytest.mark.slow
def test_scripts_need_no_guard_and_leave_no_process(tmp_path):
    script = tmp_path / "script.py"
    script.write_text(
        "import boomctl as bc, control\n"
        "from boomctl.synthesis.hinf.native import shared_worker\n"
        "P = control.ss(1.0, [[1, 0, 1]], [[1], [0], [1]], [[0, 0, 0], [0, 0, 1], [0, 1, 0]])\n"
        "print('gamma', bc.h_infinity(P, 1, 1).gamma, shared_worker().pid)\n"
    )
    root = str(Path(bc.__file__).parents[1])
    environment = os.environ | {"PYTHONPATH": root, "OMP_NUM_THREADS": "1"}
    run = subprocess.run(
        [sys.executable, str(script)], cwd=tmp_path, env=environment, capture_output=True, text=True, timeout=120
    )
    assert run.returncode == 0, run.stderr
    (line,) = run.stdout.splitlines()
    assert float(line.split()[1]) == pytest.approx(1.0 + np.sqrt(3.0), rel=0.0101)
    with pytest.raises(ProcessLookupError):
        os.kill(int(line.split()[2]), 0)


def test_the_shared_worker_is_one():
    assert shared_worker() is shared_worker()
