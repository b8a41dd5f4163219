"""How long a slew may be sought, who is told how far it has come, and how it is stopped.

IPOPT ends at a limit of its wall time; its iteration callback tells of progress and ends it after an interrupt.
"""

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from math import inf
from typing import Any

import casadi as ca
import numpy as np

from boomctl.arrays import Array
from boomctl.progress import Deadline, OutOfTimeError

_KEPT = 1e-6  # miss of scaled conditions from which an iteration counts as a slew: what a replay is held to
_LEAST = 1e-3  # [s] of wall time, which IPOPT wants to be positive


@dataclass(frozen=True)
class SlewProgress:
    """How far the search for a slew has come.

    Attributes
    ----------
    stage : str
        What is done, in words.
    elapsed : float
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
    elapsed: float
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
        Interrupts since the search began; see `progress_callback`.
    """

    tell: Callable[[SlewProgress], object] | None = None
    heard: list[int] = field(default_factory=list)

    def check(self, doing: str, objective: float | None = None) -> None:
        """Tell what is done; or raise `OutOfTimeError`, or `KeyboardInterrupt` if one was heard."""
        self.obey()
        if self.tell is not None:
            self.tell(SlewProgress(doing, self.elapsed, objective, None))
        if self.over:
            raise OutOfTimeError(doing)

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
    """What IPOPT calls after every iteration: it tells of progress, and ends the solution after an interrupt.

    It also ends the solution where another iteration that takes as long as the last one would be over too late.
    """

    def __init__(self, arguments: dict[str, Array], deadline: SlewDeadline, stage: str, unit: float) -> None:
        ca.Callback.__init__(self)
        self.low, self.high = arguments["lbg"], arguments["ubg"]
        self.sizes = {"x": arguments["x0"].size, "lam_x": arguments["x0"].size, "f": 1}
        self.sizes |= {"g": self.low.size, "lam_g": self.low.size}
        self.deadline, self.stage, self.unit = deadline, stage, unit
        self.iterations, self.before, self.late = 0, deadline.elapsed, False
        self.best: float | None = None
        self.failed: BaseException | None = None
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
        try:
            if self.deadline.tell is not None:
                self._tell(dict(zip(ca.nlpsol_out(), arg, strict=True)))
        except BaseException as error:  # CasADi would hide it
            self.failed = error
        now = self.deadline.elapsed
        self.late, self.before = 2.0 * now - self.before > self.deadline.limit, now
        return [int(self.failed is not None or self.late or bool(self.deadline.heard))]

    def _tell(self, values: dict[str, Any]) -> None:
        assert self.deadline.tell is not None
        self.iterations += 1
        g = np.array(values["g"]).ravel()
        violation = float(np.max(np.maximum(self.low - g, g - self.high), initial=0.0))
        if violation <= _KEPT:
            cost = self.unit * float(values["f"])
            self.best = cost if self.best is None else min(self.best, cost)
        stage = f"{self.stage}, iteration {self.iterations}"
        self.deadline.tell(SlewProgress(stage, self.deadline.elapsed, self.best, violation))


def solved(
    nlp: Any,
    options: dict[str, Any],
    arguments: dict[str, Array],
    deadline: SlewDeadline,
    stage: str,
    unit: float = 1.0,
) -> tuple[dict[str, Any], dict[str, Any]]:
    """Solve a programme by IPOPT, within a deadline.

    Parameters
    ----------
    nlp : casadi.Function
        ``(x, p) -> f, g``.
    options : dict
        Of CasADi's interface to IPOPT.
    arguments : dict of str to ndarray
        Of the solver, by name.
    deadline : SlewDeadline
    stage : str
        In words.
    unit : float
        What a cost of one is worth.

    Returns
    -------
    found, statistics : dict
        As CasADi returns them.

    Raises
    ------
    OutOfTimeError
        If no time is left.
    KeyboardInterrupt
        On an interrupt, after the iteration in which it came.
    """
    deadline.check(stage)
    watch = Watch(arguments, deadline, stage, unit)
    options = options | {"iteration_callback": watch}
    if deadline.limit < inf:
        options["ipopt.max_wall_time"] = max(deadline.limit - deadline.elapsed, _LEAST)
    solver = ca.nlpsol("slew", "ipopt", nlp, options)
    result, statistics = solver(**arguments), solver.stats()
    if watch.failed is not None:
        raise watch.failed
    deadline.obey()
    if not statistics["success"] and (watch.late or statistics["return_status"] == "Maximum_WallTime_Exceeded"):
        raise OutOfTimeError(stage)
    return result, statistics
