"""Time limit, progress reports and interrupts of a search for a slew.

How they stop IPOPT is in `nlp.program`.
"""

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

from boomctl.progress import Deadline, OutOfTimeError


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
