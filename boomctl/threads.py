"""Number of BLAS threads: one while a small problem is computed.

Several BLAS threads spend more time on waiting for one another than they save with matrices of a few hundred rows, on a
busy machine ten times more.  The public functions that compute with matrices therefore run with one BLAS thread, unless
one of their arguments is a large system, and restore the numbers of threads afterwards.  These numbers belong to the
process: another thread of Python computes with one BLAS thread meanwhile, too.  Where threads are limited to one already,
by ``OMP_NUM_THREADS`` or ``threadpoolctl``, nothing changes.
"""

import os
import sys
from collections.abc import Callable
from functools import partial, wraps
from itertools import chain
from threading import Lock, get_ident
from typing import Any, TypeVar, cast

_LARGE = 1500  # States of a system from which the user's BLAS threads are used: two threads save time above 1,600.
_HELD = ("_of", "nominal", "model", "system")  # attributes of records that hold a system
# Compiled modules with a BLAS library each, which may be the same.
_LOADERS = ("numpy.linalg._umath_linalg", "scipy.linalg._fblas", "slycot._wrapper")
# Names of the functions of OpenBLAS, which depend on who compiled it.
_NAMES = [f"{prefix}openblas_{{}}{suffix}" for prefix in ("scipy_", "") for suffix in ("64_", "", "_64")]

_Function = TypeVar("_Function", bound=Callable[..., Any])
_Library = tuple[Callable[[], Any], Callable[[int], Any]]  # Functions that return and that set the number of threads.


class _OneBlasThread:
    """A context in which BLAS runs with one thread, and a decorator of functions that do unless an argument is large.

    Contexts overlap in any order: the first one limits the threads, the last one restores them.  OpenMP has numbers of
    threads for each thread of Python, other libraries one for the process: contexts are counted for both.
    """

    def __init__(self) -> None:
        self._lock = Lock()
        self._loaded: tuple[bool, ...] | None = None
        self._libraries: dict[bool, list[_Library]] = {}  # by whether numbers belong to threads of Python
        self._depth: dict[int, int] = {}  # of the process (0) and of threads of Python
        self._before: dict[int, list[tuple[Callable[[int], Any], int]]] = {}
        if hasattr(os, "register_at_fork"):  # a process forked while another thread holds the lock cannot release it
            release = self._lock.release
            os.register_at_fork(before=self._lock.acquire, after_in_parent=release, after_in_child=release)

    def __enter__(self) -> None:
        with self._lock:
            loaded = tuple(name in sys.modules for name in _LOADERS)
            new = loaded != self._loaded
            if new:
                self._libraries = _libraries()
                self._loaded = loaded
            for owner in (0, get_ident()):
                depth = self._depth.get(owner, 0)
                if new or not depth:
                    counts = [(change, threads()) for threads, change in self._libraries[owner != 0]]
                    more = [(change, count) for change, count in counts if count and count > 1]
                    self._before.setdefault(owner, []).extend(more)
                    for change, _ in more:
                        change(1)
                self._depth[owner] = depth + 1

    def __exit__(self, *error: object) -> None:
        with self._lock:
            for owner in (get_ident(), 0):
                self._depth[owner] -= 1
                if not self._depth[owner]:
                    for change, count in self._before[owner]:
                        change(count)
                    del self._depth[owner], self._before[owner]

    def __call__(self, function: _Function) -> _Function:
        @wraps(function)
        def limited(*args: Any, **kwargs: Any) -> Any:
            if any(_states(argument) >= _LARGE for argument in chain(args, kwargs.values())):
                return function(*args, **kwargs)
            with self:
                return function(*args, **kwargs)

        return cast(_Function, limited)


def _libraries() -> dict[bool, list[_Library]]:
    """Return the BLAS libraries of the modules, by whether their numbers of threads belong to threads of Python.

    OpenBLAS with threads of its own is found through the module that is linked with it.  If a module has another one,
    `threadpoolctl` searches all libraries of the process, which takes 10 ms.
    """
    from ctypes import CDLL

    result: dict[bool, list[_Library]] = {False: [], True: []}
    try:
        for file in [sys.modules[name].__file__ for name in _LOADERS if name in sys.modules]:
            linked = CDLL(file)
            name = next(name for name in _NAMES if hasattr(linked, name.format("get_parallel")))
            if getattr(linked, name.format("get_parallel"))() > 1:  # threads of OpenMP
                raise AttributeError
            get, change = (getattr(linked, name.format(f"{verb}_num_threads")) for verb in ("get", "set"))
            result[False].append((get, change))
    except (AttributeError, OSError, StopIteration):
        from threadpoolctl import ThreadpoolController

        result[False] = []
        for library in ThreadpoolController().select(user_api="blas").lib_controllers:
            own = library.internal_api == "openblas" and getattr(library, "threading_layer", "") == "openmp"
            result[own].append((library.get_num_threads, partial(_set_threads, library)))
    return result


def _set_threads(library: Any, threads: int) -> None:
    """Set a number of threads, from any thread of Python: threadpoolctl leaves that to the first one until it is cleared."""
    clear = getattr(library, "clear_controlling_thread", lambda force: None)
    clear(force=True)
    library.set_num_threads(threads)
    clear(force=True)


def _states(argument: object) -> int:
    """Return the number of states of a system, of the one that a record holds, or of the first of several; else zero.

    Nothing is computed: only attributes that are stored are read.
    """
    if isinstance(argument, (dict, list, tuple)):
        values = argument.values() if isinstance(argument, dict) else argument
        return _states(next(iter(values), None))
    stored = getattr(argument, "__dict__", None)
    if not isinstance(stored, dict):
        return 0
    matrix, structure = stored.get("A"), stored.get("structure")
    if matrix is not None:
        return int(getattr(matrix, "shape", (0,))[0])
    if structure is not None:
        return 2 * len(getattr(structure, "coordinates", ()))
    return max((_states(stored[name]) for name in _HELD if name in stored), default=0)


one_blas_thread = _OneBlasThread()
