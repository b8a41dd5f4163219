"""How long a slew may be sought, who is told how far it has come, and how it is stopped.

IPOPT ends at a limit of its wall time; its iteration callback tells of progress, and ends it after an interrupt.
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
    """Time for the search for a slew, a function that is told a `SlewProgress`, and the interrupts that were noted."""

    tell: Callable[[SlewProgress], object] = id
    interrupts: list[int] = field(default_factory=list)

    def check(self, doing: str, objective: float | None = None, violation: float | None = None) -> None:
        """Tell what is done; raise `OutOfTimeError` if no time is left for it, `KeyboardInterrupt` after an interrupt."""
        if self.interrupts:
            raise KeyboardInterrupt
        self.tell(SlewProgress(doing, self.elapsed, objective, violation))
        if self.over:
            raise OutOfTimeError(doing)


@contextmanager
def noting_interrupts(deadline: SlewDeadline) -> Iterator[None]:
    """Note interrupts, which the next check obeys; a second one is obeyed wherever it comes.

    CasADi takes an exception while it reads its arguments for a wrong argument, or for none.
    """
    before = signal.getsignal(signal.SIGINT)
    if threading.current_thread() is not threading.main_thread() or not callable(before):
        yield
        return

    def note(number: int, frame: Any) -> None:
        deadline.interrupts.append(number)
        if len(deadline.interrupts) > 1:
            before(number, frame)

    signal.signal(signal.SIGINT, note)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
    if deadline.interrupts:
        before(signal.SIGINT, None)


class _Watch(ca.Callback):
    """What IPOPT calls after every iteration; what is raised within is kept, and ends the solution."""

    def __init__(self, seen: Callable[[float, Array], None], conditions: int) -> None:
        ca.Callback.__init__(self)
        self.seen, self.sizes = seen, {"f": 1, "g": conditions}
        self.failed: BaseException | None = None
        self.construct("watch", {})

    def get_n_in(self) -> int:
        return ca.nlpsol_n_out()

    def get_name_in(self, i: int) -> str:
        return ca.nlpsol_out(i)

    def get_sparsity_in(self, i: int) -> ca.Sparsity:
        return ca.Sparsity.dense(self.sizes.get(ca.nlpsol_out(i), 0), 1)

    def eval(self, arg: Any) -> list[int]:
        values = dict(zip(ca.nlpsol_out(), arg, strict=True))
        try:
            self.seen(float(values["f"]), np.array(values["g"]).ravel())
        except BaseException as error:  # CasADi would hide it
            self.failed = error
        return [int(self.failed is not None)]


def solved(
    nlp: Any, options: dict[str, Any], arguments: dict[str, Array], deadline: SlewDeadline, stage: str, unit: float
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
    told: list[float | None] = [None]

    def seen(cost: float, g: Array) -> None:
        """Tell of an iteration, with the cost of the best one so far that is a slew."""
        violation = float(np.max(np.maximum(arguments["lbg"] - g, g - arguments["ubg"]), initial=0.0))
        kept = [value for value in (told[-1], unit * cost if violation <= _KEPT else None) if value is not None]
        told.append(min(kept, default=None))
        deadline.check(f"{stage}, iteration {len(told) - 1}", told[-1], violation)

    watch = _Watch(seen, arguments["lbg"].size)
    options = options | {"iteration_callback": watch}
    if deadline.limit < inf:
        options["ipopt.max_wall_time"] = max(deadline.limit - deadline.elapsed, _LEAST)
    solver = ca.nlpsol("slew", "ipopt", nlp, options)
    result, statistics = solver(**arguments), solver.stats()
    if watch.failed is not None:
        raise watch.failed
    if statistics["return_status"] == "Maximum_WallTime_Exceeded":
        raise OutOfTimeError(stage)
    return result, statistics
