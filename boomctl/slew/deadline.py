"""Time limit, progress reports and interrupts of a search for a slew.

IPOPT stops at its wall time limit. Its iteration callback reports progress and stops it after an interrupt.
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

_FEASIBLE = (
    1e-6  # largest violation of a scaled constraint at which an iterate is feasible: the default rtol of a replay
)
_LEAST = 1e-3  # smallest wall time limit [s]: IPOPT requires a positive one


@dataclass(frozen=True)
class SlewProgress:
    """Progress of the search for a slew.

    Attributes
    ----------
    stage : str
        Description of the current stage.
    elapsed : float
        Time since the search began [s].
    objective : float or None
        Objective of the best feasible iterate of this stage; in seconds for minimum time, otherwise relative to a typical
        value. None before the first feasible iterate.
    violation : float or None
        Largest violation of a scaled constraint in the solver's last iterate; None between solvers.

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
    """Time limit of the search for a slew, progress callback (called with a `SlewProgress`) and recorded interrupts."""

    tell: Callable[[SlewProgress], object] = id
    interrupts: list[int] = field(default_factory=list)

    def check(self, doing: str, objective: float | None = None, violation: float | None = None) -> None:
        """Report the stage; raise `OutOfTimeError` after the time limit, `KeyboardInterrupt` after an interrupt."""
        if self.interrupts:
            raise KeyboardInterrupt
        self.tell(SlewProgress(doing, self.elapsed, objective, violation))
        if self.over:
            raise OutOfTimeError(doing)


@contextmanager
def noting_interrupts(deadline: SlewDeadline) -> Iterator[None]:
    """Record interrupts, which the next check raises; a second interrupt is raised immediately.

    CasADi misreads an exception during its argument conversion as a wrong argument, or ignores it.
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
    """Iteration callback of IPOPT; an exception within it is stored and stops the solver."""

    def __init__(self, on_iteration: Callable[[float, Array], None], conditions: int) -> None:
        ca.Callback.__init__(self)
        self.on_iteration, self.sizes = on_iteration, {"f": 1, "g": conditions}
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
            self.on_iteration(float(values["f"]), np.array(values["g"]).ravel())
        except BaseException as error:  # CasADi would suppress it
            self.failed = error
        return [int(self.failed is not None)]


def solved(
    nlp: Any, options: dict[str, Any], arguments: dict[str, Array], deadline: SlewDeadline, stage: str, unit: float
) -> tuple[dict[str, Any], dict[str, Any]]:
    """Solve a nonlinear program by IPOPT within a time limit.

    Parameters
    ----------
    nlp : casadi.Function
        ``(x, p) -> f, g``.
    options : dict
        Options of CasADi's interface to IPOPT.
    arguments : dict of str to ndarray
        Arguments of the solver by name.
    deadline : SlewDeadline
    stage : str
        Description of the stage.
    unit : float
        Objective at a scaled cost of one.

    Returns
    -------
    result, statistics : dict
        Result and statistics of CasADi's solver.

    Raises
    ------
    OutOfTimeError
        If the time limit is exceeded.
    KeyboardInterrupt
        On an interrupt, after the iteration in which it came.
    """
    deadline.check(stage)
    objectives: list[float | None] = [None]

    def on_iteration(cost: float, g: Array) -> None:
        """Report an iteration, with the objective of the best feasible iterate so far."""
        violation = float(np.max(np.maximum(arguments["lbg"] - g, g - arguments["ubg"]), initial=0.0))
        candidates = [
            value for value in (objectives[-1], unit * cost if violation <= _FEASIBLE else None) if value is not None
        ]
        objectives.append(min(candidates, default=None))
        deadline.check(f"{stage}, iteration {len(objectives) - 1}", objectives[-1], violation)

    watch = _Watch(on_iteration, arguments["lbg"].size)
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
