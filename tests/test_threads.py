"""Tests of `one_blas_thread`: numbers of BLAS threads during calls and after them."""

import inspect
import subprocess
import sys
import threading
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
import scipy.linalg  # noqa: F401 - a BLAS library beside the one of NumPy
from threadpoolctl import threadpool_info, threadpool_limits

import boomctl as bc
from boomctl.threads import one_blas_thread


def blas():
    """Return the BLAS libraries that boomctl uses; other tests load that of ctrlsys."""
    return [pool for pool in threadpool_info() if pool["user_api"] == "blas" and "ctrlsys" not in pool["filepath"]]


def threads():
    return [pool["num_threads"] for pool in blas()]


@one_blas_thread
def inside(*arguments, **keywords):
    """Return the numbers of threads during a call."""
    return threads()


@pytest.fixture(autouse=True)
def three_threads():
    with threadpool_limits(3, user_api="blas"):
        libraries = [pool["filepath"] for pool in blas()]
        assert set(threads()) == {3}
        yield  # may load further libraries
        assert {pool["num_threads"] for pool in blas() if pool["filepath"] in libraries} == {3}


def test_call_small_system_one_thread():
    assert set(inside(bc.spray_boom(), omega=[1.0])) == {1}


@pytest.mark.parametrize("wrap", [lambda s: s, lambda s: [s, s], lambda s: {"name": s}], ids=["system", "list", "dict"])
def test_call_large_system_threads_kept(wrap):
    n = 800
    large = bc.structure.SecondOrderModel(np.eye(n), np.eye(n), np.eye(n), {"force": np.ones(n)}, {"place": np.ones(n)})
    assert set(inside(wrap(large))) == set(inside(0.0, plant=wrap(large))) == {3}
    with one_blas_thread:  # threads of the process: limited by an enclosing call
        assert set(inside(wrap(large))) == {1}


def test_user_limit_one_unchanged():
    with threadpool_limits(1, user_api="blas"):
        assert set(inside()) == {1}
        assert set(threads()) == {1}


def test_libraries_with_other_names_are_searched(monkeypatch):
    monkeypatch.setattr("boomctl.threads._NAMES", [])
    with type(one_blas_thread)():
        assert set(threads()) == {1}
    assert set(threads()) == {3}


@one_blas_thread
def failing():
    raise ArithmeticError("wrong")


def test_nested_calls_restore_last():
    with one_blas_thread:
        assert set(inside()) == {1}
        with pytest.raises(ArithmeticError):
            failing()
        assert set(threads()) == {1}
    assert set(threads()) == {3}
    with pytest.raises(ArithmeticError, match="wrong"):
        failing()
    assert set(threads()) == {3}


def test_overlapping_threads_restore_last():
    first, second = threading.Event(), threading.Event()

    @one_blas_thread
    def begin():
        first.set()
        assert second.wait(30.0)

    @one_blas_thread
    def end(begun):
        second.set()
        begun.result(30.0)  # the call that limited the threads ends before this one
        return threads()

    with ThreadPoolExecutor(2) as pool:
        begun = pool.submit(begin)
        assert first.wait(30.0)
        assert set(pool.submit(end, begun).result(30.0)) == {1}


@pytest.mark.slow
def test_library_loaded_later_limited():
    """In a process of its own: SciPy's library is loaded between calls and SLICOT's during one."""
    program = """if True:
        from boomctl.threads import one_blas_thread
        from threadpoolctl import threadpool_info, threadpool_limits
        def threads():
            return [pool["num_threads"] for pool in threadpool_info() if pool["user_api"] == "blas"]
        inside = one_blas_thread(threads)
        import numpy
        assert set(inside()) == {1}
        import scipy.linalg
        threadpool_limits(3)
        assert len(threads()) > 1
        assert set(inside()) == {1}
        with one_blas_thread:
            import slycot
            assert len(inside()) > 2
            assert set(inside()) == {1}
        assert sorted(threads())[-2:] == [3, 3]
        threadpool_limits(3)
        assert set(inside()) == {1}
        assert set(threads()) == {3}
    """
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=120)
    assert not done.returncode, done.stderr


class OwnThreads:
    """A library whose numbers of threads belong to threads of Python, as with OpenMP."""

    def __init__(self, count):
        self.count, self.own = count, threading.local()

    def get_num_threads(self):
        return getattr(self.own, "count", self.count)

    def set_num_threads(self, count):
        self.own.count = count


def test_threads_of_openmp_counted_apart(monkeypatch):
    library = OwnThreads(4)
    functions = library.get_num_threads, library.set_num_threads
    monkeypatch.setattr("boomctl.threads._libraries", lambda: {False: [], True: [functions]})
    limit, ready, leave = type(one_blas_thread)(), threading.Barrier(2), threading.Barrier(2)

    def overlap(first):
        with limit:
            ready.wait(30.0)
            inside = library.get_num_threads()
            if first:
                leave.wait(30.0)
        if not first:
            leave.wait(30.0)
        return inside, library.get_num_threads()

    with ThreadPoolExecutor(2) as pool:
        assert list(pool.map(overlap, [True, False])) == [(1, 4), (1, 4)]


def test_public_functions_of_systems_use_one_thread():
    packages = [bc, *(getattr(bc, name) for name in dir(bc) if inspect.ismodule(getattr(bc, name)))]
    offered = [getattr(package, name) for package in packages for name in getattr(package, "__all__", ())]
    systems = {"system", "plant", "P", "model", "family", "h", "structure"}
    found = {each for each in offered if inspect.isfunction(each) and systems & {*inspect.signature(each).parameters}}
    free = {each.__name__ for each in found if not hasattr(each, "__wrapped__")}
    assert free == {
        "animate_slew",
        "hub_beam",
        "scale_signals",
        "select_channels",
        "with_state_outputs",
    }  # compute no matrix
