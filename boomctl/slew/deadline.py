"""How long a slew may be sought, who is told how far it has come, and how it is stopped.

CasADi's solvers run in a thread of their own and let Python run beside them; the calling thread waits, looks at the clock,
tells of progress, and hears an interrupt at once. The solver is asked to stop at its next iteration.
"""

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from threading import Event, Lock, Thread
from typing import Any

import casadi as ca
import numpy as np

from boomctl.arrays import Array
from boomctl.progress import Deadline, OutOfTime

THREAD = "boomctl-slew"  # name of the threads in which solvers run
_POLL = 0.05  # [s] between two looks at clock and progress: a tenth of what a user notices
_KEPT = 1e-6  # miss of scaled conditions from which an iteration counts as a slew: what a replay is held to
# [s] that an interrupt, or the end of the time, waits for the solver's next iteration; a longer one ends by itself, unheard
_GRACE = 1.0


@dataclass(frozen=True)
class SlewProgress:
    """How far the search for a slew has come.

    Attributes
    ----------
    stage : str
        What is done, in words.
    seconds : float
        Time since the search began [s].
    objective : float or None
        Of the best iteration so far of this stage that keeps all conditions on its mesh; in seconds where the least time is
        asked for, else over a typical size. None before there is one.
    violation : float or None
        Largest miss of a scaled condition in the solver's last iteration; None between solvers.

    Examples
    --------
    >>> import boomctl as bc
    >>> steps = []
    >>> beam = bc.hub_beam(modes=1)
    >>> slew = bc.optimal_slew(beam, 1.0, 200.0, "effort", duration=4.0, intervals=20, progress=steps.append)
    >>> steps[0].stage
    'sensitivity of the end to 20 steps'
    """

    stage: str
    seconds: float
    objective: float | None
    violation: float | None


@dataclass(frozen=True, eq=False)
class SlewDeadline(Deadline):
    """Time for the search for a slew, who is told of it, and whether it is interrupted.

    Attributes
    ----------
    tell : callable or None
        Told a `SlewProgress`.
    heard : list
        Interrupts since the search began; see `listening`.
    """

    tell: Callable[[SlewProgress], object] | None = None
    heard: list[int] = field(default_factory=list)

    def check(self, doing: str, objective: float | None = None) -> None:
        """Tell what is done; or raise `OutOfTime`, or `KeyboardInterrupt` if one was heard."""
        self.obey()
        if self.tell is not None:
            self.tell(SlewProgress(doing, self.seconds, objective, None))
        if self.over:
            raise OutOfTime(doing)

    def obey(self) -> None:
        """Raise `KeyboardInterrupt` if an interrupt was heard."""
        if self.heard:
            raise KeyboardInterrupt


@contextmanager
def listening(deadline: SlewDeadline) -> Iterator[None]:
    """Note interrupts, so that the search obeys them between its steps; a second one is obeyed wherever it comes.

    Within a call of CasADi Python's own handler raises where CasADi takes it for a wrong argument, or swallows it.
    """
    before = signal.getsignal(signal.SIGINT)
    if threading.current_thread() is not threading.main_thread() or not callable(before):
        yield
        return

    def hear(number: int, frame: Any) -> None:
        deadline.heard.append(number)
        if len(deadline.heard) > 1:
            before(number, frame)

    signal.signal(signal.SIGINT, hear)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
        if deadline.heard:
            before(signal.SIGINT, None)


class Watch(ca.Callback):
    """What IPOPT asks after every iteration whether it is to go on; it notes how far the iteration has come."""

    def __init__(self, unknowns: int, conditions: int) -> None:
        ca.Callback.__init__(self)
        self.sizes = {"x": unknowns, "lam_x": unknowns, "g": conditions, "lam_g": conditions, "f": 1}
        self.stop = False
        self.iterations = 0
        self.seen: tuple[float, float] | None = None
        self.bounds: tuple[Array, Array] | None = None
        self.running = Lock()
        self.construct("watch", {})

    def get_n_in(self) -> int:
        return ca.nlpsol_n_out()

    def get_n_out(self) -> int:
        return 1

    def get_name_in(self, i: int) -> str:
        return ca.nlpsol_out(i)

    def get_name_out(self, i: int) -> str:
        return "ret"

    def get_sparsity_in(self, i: int) -> ca.Sparsity:
        return ca.Sparsity.dense(self.sizes.get(ca.nlpsol_out(i), 0), 1)

    def eval(self, arg: Any) -> list[int]:
        self.iterations += 1
        if self.bounds is not None:
            values = dict(zip(ca.nlpsol_out(), arg, strict=True))
            g, (low, high) = np.array(values["g"]).ravel(), self.bounds
            self.seen = float(values["f"]), float(np.max(np.maximum(low - g, g - high), initial=0.0))
        return [int(self.stop)]


def solved(
    solver: Any, watch: Watch, arguments: dict[str, Array], deadline: SlewDeadline, stage: str, unit: float = 1.0
) -> dict[str, Any]:
    """Let a solver of CasADi solve, within a deadline.

    Parameters
    ----------
    solver : casadi.Function
        Made with the watch as its "iteration_callback".
    watch : Watch
    arguments : dict of str to ndarray
        Of the solver, by name.
    deadline : SlewDeadline
    stage : str
        In words.
    unit : float
        What a cost of one is worth.

    Raises
    ------
    OutOfTime
        If no time is left; the solver has stopped then.
    KeyboardInterrupt
        On an interrupt, at most a second later.
    """
    found: list[dict[str, Any]] = []
    failed: list[BaseException] = []
    done = Event()  # an interrupt within Thread.join may leave a thread that runs marked as ended (CPython 3.11)

    def run() -> None:
        with watch.running:
            try:
                found.append(solver(**arguments))
            except BaseException as error:
                failed.append(error)
            finally:
                done.set()

    deadline.check(stage)
    with watch.running:  # an interrupted solution may still be under way
        watch.stop, watch.iterations, watch.seen = False, 0, None
        watch.bounds = (arguments["lbg"], arguments["ubg"]) if deadline.tell is not None else None
    # no daemon: Python would end its life in the midst of CasADi, which aborts the process
    thread = Thread(target=run, name=THREAD)
    thread.start()
    told, over = 0, False
    best: float | None = None
    try:
        while not done.wait(_POLL):
            deadline.obey()
            if deadline.over:
                over = watch.stop = True
            if deadline.seconds > deadline.limit + _GRACE:
                raise OutOfTime(stage)
            seen: Any = watch.seen  # of the other thread
            if deadline.tell is not None and seen is not None and watch.iterations > told:
                told, (cost, violation) = watch.iterations, seen
                if violation <= _KEPT:
                    best = unit * cost if best is None else min(best, unit * cost)
                deadline.tell(SlewProgress(f"{stage}, iteration {told}", deadline.seconds, best, violation))
    except BaseException:
        watch.stop = True
        done.wait(_GRACE)
        raise
    if failed:
        raise failed[0]
    if over and not solver.stats()["success"]:
        raise OutOfTime(stage)
    return found[0]
