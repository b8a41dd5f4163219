"""``control.hinfsyn`` as a peer: in a process of its own, which is ended if it hangs."""

import atexit
import os
import time
from concurrent.futures import BrokenExecutor

import numpy as np

from boomctl.arrays import Array
from boomctl.lti.python_control import control
from boomctl.processes import Processes

PATIENCE = 120.0  # given to a call of the peer before it is killed [s]; one that ends takes a few


class HinfsynProcess:
    """The process.  It ends with this one, or with the ``with`` block; one in which a call takes too long is replaced."""

    def __init__(self) -> None:
        self._processes, self._spent = Processes(1, "spawn"), 0.0
        atexit.register(self.__exit__)

    @property
    def processor_time(self) -> float:
        """Processor time that it has spent on the calls it answered [s]."""
        return self._spent

    def __enter__(self) -> "HinfsynProcess":
        return self

    def __exit__(self, *raised: object) -> None:
        atexit.unregister(self.__exit__)
        self._processes.__exit__(None, None, None)

    def ask(self, P: control.StateSpace, nmeas: int, ncon: int) -> control.StateSpace:
        """Return the controller that it finds.

        Raises
        ------
        RuntimeError
            It finds none, or was killed.
        """
        plant = tuple(np.asarray(getattr(P, name), dtype=float) for name in "ABCD")
        asked = self._processes.submit(self._processes.ask, _called, plant, nmeas, ncon, seconds=PATIENCE)
        try:
            spent, K = asked.result()
        except (TimeoutError, BrokenExecutor):
            raise RuntimeError(f"killed after {PATIENCE:g} s") from None
        self._spent += spent
        return control.ss(*K)


def _called(plant: tuple[Array, ...], nmeas: int, ncon: int) -> tuple[float, tuple[Array, ...]]:
    """Return the time that it takes and its controller's matrices; its compiled code writes to standard output."""
    nothing = os.open(os.devnull, os.O_WRONLY)
    for stream in (1, 2):
        os.dup2(nothing, stream)
    os.close(nothing)
    P = control.ss(*plant)
    began = time.process_time()
    try:
        K = control.hinfsyn(P, nmeas, ncon)[0]
    except Exception as error:
        raise RuntimeError(" ".join(str(error).split())) from None
    return time.process_time() - began, tuple(np.asarray(part) for part in (K.A, K.B, K.C, K.D))
