"""What comes of points: the function called at one or at many, whatever it raises kept beside what it returned."""

import os
import platform
import time
import traceback
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from boomctl.processes import end_with_parent
from boomctl.progress import counted
from boomctl.threads import one_blas_thread

VALUE = "value"  # name of the column of a function that returns one thing, not things by name
_TRACE = 20  # calls that are kept of a traceback, the last ones: where it happened and how it came there (a choice)


@dataclass(frozen=True)
class Outcome:
    """What came of a point.

    Attributes
    ----------
    columns : dict of str to Any, or None
        What the function returned, by name; None where it failed.
    seconds : float
        How long it took [s].
    error, trace : str
        What it raised, in one line and with the calls that led there; empty where it did not fail.
    """

    columns: dict[str, Any] | None
    seconds: float
    error: str = ""
    trace: str = ""


def here() -> tuple[str, int]:
    """Return which process this is, among all machines."""
    return platform.node(), os.getpid()


def computed(
    function: Callable[..., Any], arguments: Sequence[dict[str, Any]], asked_by: tuple[str, int]
) -> list[Outcome]:
    """Return what came of points; a process of its own computes with one BLAS thread, and for who asks alone."""
    if asked_by == here():
        return outcomes(function, arguments)
    end_with_parent()
    # the process that waits reports progress
    with one_blas_thread, counted(lambda stage: None):
        return outcomes(function, arguments)


def outcomes(function: Callable[..., Any], arguments: Sequence[dict[str, Any]]) -> list[Outcome]:
    """Return what came of points: together, if the function can, and one after the other where that fails."""
    many = getattr(function, "many", None)
    if many is not None and len(arguments) > 1:
        began = time.perf_counter()
        try:
            found = [columns(value) for value in many(list(arguments))]
        except (Exception, SystemExit):  # one bad point spoils the call for all: below each is tried by itself
            found = []
        if len(found) == len(arguments):
            each = (time.perf_counter() - began) / len(found)
            return [Outcome(value, each) for value in found]
    return [outcome(function, point) for point in arguments]


def outcome(function: Callable[..., Any], arguments: dict[str, Any]) -> Outcome:
    """Return what came of one point."""
    began = time.perf_counter()
    try:
        found = columns(function(**arguments))
    except (Exception, SystemExit) as error:  # what ends a script ends a point alone
        return failed(error, time.perf_counter() - began)
    return Outcome(found, time.perf_counter() - began)


def failed(error: BaseException, seconds: float = 0.0) -> Outcome:
    """Return the outcome of a point that raised something."""
    text = " ".join(str(error).split())
    trace = "".join(traceback.format_exception(type(error), error, error.__traceback__, limit=-_TRACE))
    return Outcome(None, seconds, f"{type(error).__name__}: {text}" if text else type(error).__name__, trace)


def columns(value: Any) -> dict[str, Any]:
    """Return what a function returned as columns by name; numbers of NumPy's become Python's."""
    named = value if isinstance(value, Mapping) else {VALUE: value}
    for name in named:
        if not isinstance(name, str):
            raise TypeError(f"the function returned a mapping with the key {name!r}; expected names")
    return {
        name: cell.item() if isinstance(cell, np.generic) or (isinstance(cell, np.ndarray) and cell.ndim == 0) else cell
        for name, cell in named.items()
    }
