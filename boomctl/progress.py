"""What a long computation is doing: told to a function of the caller's, or shown on a terminal and in a notebook.

A computation runs within :func:`computing` and tells its stages.  Who listens is, in this order: the function given to it
(``progress=``), the one of the :func:`progress_callback` around it, and else, after three seconds, one line on a terminal's
standard error or in a notebook, which goes away when the computation ends.  Where neither is there, nothing is shown.
A computation within another tells through the outer one, and :func:`tell` tells through the one under way, if any.
"""

import math
import os
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field
from typing import Any

_QUIET_FOR = 3.0  # s before anything is shown: who waits less needs no word (a choice)
_REDRAWN = 0.2  # s between two looks of the line shown: often enough to be seen alive (a choice)


@dataclass(frozen=True)
class Progress:
    """What a computation is doing.

    Attributes
    ----------
    task : str
        The computation; within another computation, the outer one.
    stage : str
        What it does now, in words.
    elapsed : float
        Time since it began [s].
    completed, total : int or None
        Steps done, and how many there are, where that is known.

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
    """The time for a computation is over; the message says what was being done."""


@dataclass(frozen=True, eq=False)
class Deadline:
    """Time for a computation, from when this is made.

    Attributes
    ----------
    limit : float
        s; infinite: none.
    begun : float
        Of the monotonic clock, s.
    """

    limit: float = math.inf
    begun: float = field(default_factory=time.monotonic)

    @property
    def elapsed(self) -> float:
        """Since the computation began."""
        return time.monotonic() - self.begun

    @property
    def over(self) -> bool:
        """Whether no time is left."""
        return self.elapsed >= self.limit

    def check(self, doing: str) -> None:
        """Tell what is done, and raise `OutOfTimeError` if no time is left for it."""
        tell(doing)
        if self.over:
            raise OutOfTimeError(doing)


Listener = Callable[[Progress], object]
Tell = Callable[..., None]


@dataclass
class _Computation:
    """A computation that is under way: what it told last, and who listens."""

    task: str
    listener: Listener | None
    began: float = field(default_factory=time.monotonic)
    stage: str = ""
    completed: int | None = None
    total: int | None = None

    def now(self) -> Progress:
        return Progress(self.task, self.stage, time.monotonic() - self.began, self.done, self.total)

    def tell(self, stage: str = "", done: int | None = None, total: int | None = None) -> None:
        """Say what comes now, and how many steps are done of how many; an error of the listener ends the computation."""
        self.stage, self.done, self.total = stage, done, total
        if self.listener is not None:
            self.listener(self.now())


_HEARD_BY: ContextVar[Listener | None] = ContextVar("boomctl_progress_listener", default=None)
_OUTER: ContextVar[_Computation | None] = ContextVar("boomctl_computation", default=None)


@contextmanager
def progress_callback(listener: Listener | None) -> Iterator[None]:
    """Let a function be told what the computations within are doing.

    Parameters
    ----------
    listener : callable or None
        A function of a `Progress`, called at each stage; an exception that it raises ends the computation.  None:
        nothing is told and nothing shown.

    Returns
    -------
    context manager
        For a ``with`` block: whatever runs within it is heard.

    Raises
    ------
    TypeError
        Neither a function nor None.

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
    """Run a computation; what is told within is of it.  A function is given that tells of it wherever it is called."""
    outer = _OUTER.get()
    listener = _checked("progress", progress)
    if outer is not None and listener is None:
        yield outer.tell
        return
    computation = _Computation(task, listener or _HEARD_BY.get())
    token = _OUTER.set(computation)
    line = _Line(computation) if computation.listener is None and _seen() else None
    try:
        yield computation.tell
    finally:
        _OUTER.reset(token)
        if line is not None:
            line.end()


def tell(stage: str, done: int | None = None, total: int | None = None) -> None:
    """Say what the computation under way does now; where there is none, nothing."""
    computation = _OUTER.get()
    if computation is not None:
        computation.tell(stage, done, total)


@contextmanager
def silent() -> Iterator[None]:
    """Run computations of which nothing is told, within one that tells its own steps."""
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
    """Return whether somebody may be looking: a terminal, or a notebook."""
    if os.environ.get("TERM") == "dumb":
        return False
    if getattr(sys.modules.get("multiprocessing"), "parent_process", lambda: None)() is not None:
        return False  # who started this process shows what it waits for
    return "ipykernel" in sys.modules or (sys.stderr is not None and sys.stderr.isatty())


class _Line:
    """A line that says what a computation does, drawn by a thread of its own once it has taken a while."""

    def __init__(self, computation: _Computation) -> None:
        self._computation, self._ended = computation, threading.Event()
        self._thread = threading.Thread(target=self._draw, name="boomctl-progress", daemon=True)
        self._thread.start()

    def _draw(self) -> None:
        if self._ended.wait(_QUIET_FOR):
            return
        from rich.console import Console
        from rich.errors import LiveError
        from rich.markup import escape

        if self._ended.is_set():  # while rich was loaded
            return
        console = Console(stderr=True)
        try:
            with console.status(escape(str(self._computation.now()))) as shown:
                while not self._ended.wait(_REDRAWN):
                    shown.update(escape(str(self._computation.now())))
        except LiveError:  # another line or bar of rich stands there already
            return

    def end(self) -> None:
        self._ended.set()
        self._thread.join(timeout=1.0)  # it redraws five times a second
