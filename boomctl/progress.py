"""Progress of long computations: a callback, or a line on a terminal or in a notebook.

A computation runs within :func:`computing` and reports its stages to, in this order: its ``progress=`` function, the function
of the enclosing :func:`progress_callback`, or, after three seconds, a line on standard error of a terminal or in a notebook,
which is removed at the end. A nested computation reports through the outer one, and so does :func:`tell`.
"""

import math
import os
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from dataclasses import dataclass, field
from typing import Any

_QUIET_FOR = 3.0  # Time before the line is shown [s].
_REDRAWN = 0.2  # Interval between updates of the line [s].


@dataclass(frozen=True)
class Progress:
    """Progress of a computation.

    Attributes
    ----------
    task : str
        Name of the computation; of a nested one, the outer computation.
    stage : str
        Current stage.
    elapsed : float
        Time since the start [s].
    completed, total : int or None
        Number of steps completed, and in all, if known.

    Examples
    --------
    >>> import boomctl as bc
    >>> bc.Progress("reduction", "core", elapsed=1.5, completed=2, total=10).stage
    'core'
    """

    task: str
    stage: str
    elapsed: float
    completed: int | None = None
    total: int | None = None

    def __str__(self) -> str:
        of = "" if self.total is None else f" of {self.total}"
        count = "" if self.completed is None else f" {self.completed}{of}"
        stage = f": {self.stage}" if self.stage else ""
        return f"{self.task}{stage}{count} ({self.elapsed:.0f} s)"


class OutOfTimeError(Exception):
    """Raised if the time limit of a computation is exceeded; the message names the stage."""


@dataclass(frozen=True, eq=False)
class Deadline:
    """Time limit of a computation, from the creation of this record.

    Attributes
    ----------
    limit : float
        Time limit [s]; infinite for none.
    start_time : float
        Start, by the monotonic clock [s].
    """

    limit: float = math.inf
    start_time: float = field(default_factory=time.monotonic)

    @property
    def elapsed(self) -> float:
        """Time since the start [s]."""
        return time.monotonic() - self.start_time

    @property
    def over(self) -> bool:
        """True if no time is left."""
        return self.elapsed >= self.limit

    def check(self, doing: str) -> None:
        """Report a stage, and raise `OutOfTimeError` if no time is left."""
        tell(doing)
        if self.over:
            raise OutOfTimeError(doing)


Listener = Callable[[Progress], object]
Tell = Callable[..., None]


@dataclass
class _Computation:
    """A running computation: its listener, and its last stage with the number of steps."""

    task: str
    listener: Listener | None
    began: float = field(default_factory=time.monotonic)
    said: tuple[str, int | None, int | None] = "", None, None

    def now(self) -> Progress:
        stage, done, total = self.said
        return Progress(self.task, stage, time.monotonic() - self.began, done, total)

    def tell(self, stage: str = "", done: int | None = None, total: int | None = None) -> None:
        """Report a stage and the number of steps; an error of the listener ends the computation."""
        self.said = stage, done, total
        if self.listener is not None:
            self.listener(self.now())


_HEARD_BY: ContextVar[Listener | None] = ContextVar("boomctl_progress_listener", default=None)
_OUTER: ContextVar[_Computation | None] = ContextVar("boomctl_computation", default=None)


@contextmanager
def progress_callback(listener: Listener | None) -> Iterator[None]:
    """Call a function at each stage of the computations in a block.

    Parameters
    ----------
    listener : callable or None
        Function of a `Progress`; an exception that it raises ends the computation. If None, nothing is reported or
        shown.

    Returns
    -------
    context manager
        For a ``with`` block.

    Raises
    ------
    TypeError
        If `listener` is neither a function nor None.

    Examples
    --------
    >>> import boomctl as bc
    >>> heard = []
    >>> with bc.progress_callback(heard.append):
    ...     small = bc.reduce(bc.spray_boom().select("actuator_left", "tip_left"), order=6)
    >>> heard[0].task
    'reduction'
    """
    checked = _checked("listener", listener)
    token = _HEARD_BY.set((lambda told: None) if checked is None else checked)
    try:
        yield
    finally:
        _HEARD_BY.reset(token)


@contextmanager
def computing(task: str, progress: Listener | None = None) -> Iterator[Tell]:
    """Run a computation, and yield a function that reports its stages."""
    outer = _OUTER.get()
    listener = _checked("progress", progress)
    if outer is not None and listener is None:
        yield outer.tell
        return
    computation = _Computation(task, listener or _HEARD_BY.get())
    token = _OUTER.set(computation)
    ended, line = threading.Event(), None
    if computation.listener is None and _seen():
        line = threading.Thread(target=_draw, args=(computation, ended), name="boomctl-progress", daemon=True)
        line.start()
    try:
        yield computation.tell
    finally:
        _OUTER.reset(token)
        ended.set()
        if line is not None:
            line.join(timeout=1.0)  # it redraws five times a second


def tell(stage: str, done: int | None = None, total: int | None = None) -> None:
    """Report a stage of the running computation, if there is one."""
    computation = _OUTER.get()
    if computation is not None:
        computation.tell(stage, done, total)


@contextmanager
def silent() -> Iterator[None]:
    """Run computations that do not report, within one that reports its own steps."""
    token = _OUTER.set(_Computation("", None))
    try:
        yield
    finally:
        _OUTER.reset(token)


def _checked(name: str, listener: Any) -> Listener | None:
    if listener is not None and not callable(listener):
        raise TypeError(f"{name} = {listener!r}: expected a function of a Progress, or None")
    return listener


def _seen() -> bool:
    """Return True on a terminal or in a notebook."""
    if os.environ.get("TERM") == "dumb":
        return False
    if getattr(sys.modules.get("multiprocessing"), "parent_process", lambda: None)() is not None:
        return False  # The parent process shows its progress.
    return "ipykernel" in sys.modules or (sys.stderr is not None and sys.stderr.isatty())


def _draw(computation: _Computation, ended: threading.Event) -> None:
    """Draw the progress line, in a thread of its own, after some time and until the computation has ended."""
    if ended.wait(_QUIET_FOR):
        return
    from rich.console import Console
    from rich.errors import LiveError
    from rich.markup import escape

    # Another display of rich may be active.
    with suppress(LiveError), Console(stderr=True).status(escape(str(computation.now()))) as shown:
        while not ended.wait(_REDRAWN):
            shown.update(escape(str(computation.now())))
