"""``control.hinfsyn`` as a peer: in a process of its own, which is ended if it hangs."""

import atexit
import os
import time
from concurrent.futures import BrokenExecutor
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from boomctl.arrays import Array
from boomctl.lti.python_control import control
from boomctl.processes import Processes

PATIENCE = 120.0  # given to a call of the peer before it is killed [s]; one that ends takes a few


@dataclass(frozen=True)
class Answer:
    """What the peer said: processor time [s], the norm it claims, its controller's matrices; None where it said none."""

    seconds: float | None
    gamma: float | None
    K: tuple[Array, ...] | None
    error: str = ""

    @cached_property
    def controller(self) -> control.StateSpace | None:
        """The controller, None where there is none."""
        return None if self.K is None else control.ss(*self.K)


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

    def ask(self, P: control.StateSpace, nmeas: int, ncon: int) -> Answer:
        """Run it once."""
        plant = tuple(np.asarray(getattr(P, name), dtype=float) for name in "ABCD")
        asked = self._processes.submit(self._processes.ask, _called, plant, nmeas, ncon, seconds=PATIENCE)
        try:
            answer = asked.result()
        except (TimeoutError, BrokenExecutor):
            return Answer(None, None, None, f"killed after {PATIENCE:g} s")
        self._spent += answer.seconds
        return answer


def _called(plant: tuple[Array, ...], nmeas: int, ncon: int) -> Answer:
    """Return what the peer says, whose compiled code writes to standard output, in this process."""
    nothing = os.open(os.devnull, os.O_WRONLY)
    for stream in (1, 2):
        os.dup2(nothing, stream)
    os.close(nothing)
    P = control.ss(*plant)
    began = time.process_time()
    try:
        K, _, gamma, _ = control.hinfsyn(P, nmeas, ncon)
    except Exception as error:
        return Answer(time.process_time() - began, None, None, " ".join(str(error).split()))
    spent = time.process_time() - began
    return Answer(spent, float(gamma), tuple(np.asarray(part) for part in (K.A, K.B, K.C, K.D)))
