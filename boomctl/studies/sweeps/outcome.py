"""Outcomes of points: what the function returned, or what it raised."""

import time
import traceback
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import numpy as np

from boomctl.progress import silent
from boomctl.threads import one_blas_thread

_VALUE = "value"  # column of a function that returns no mapping
_TRACE_CALLS = 20  # last calls of a traceback that are stored


@dataclass(frozen=True)
class Outcome:
    """The outcome of a point.

    Attributes
    ----------
    columns : dict of str to Any, or None
        Values that the function returned, by name; None where it failed.
    seconds : float
        Run time [s].
    error, trace : str
        The exception in one line, and the calls that led to it; empty where the function did not fail.
    """

    columns: dict[str, Any] | None
    seconds: float
    error: str = ""
    trace: str = ""


def outcomes(function: Callable[..., Any], points: Mapping[int, dict[str, Any]]) -> dict[int, Outcome]:
    """Return the outcomes of points by place: of all at once by ``function.many``, or one by one where that fails."""
    many = getattr(function, "many", None)
    with silent():
        if many is not None and len(points) > 1:
            begun = time.perf_counter()
            with suppress(Exception, SystemExit):
                found = [_columns(value) for value in many(list(points.values()))]
                share = (time.perf_counter() - begun) / len(points)
                return {k: Outcome(columns, share) for k, columns in zip(points, found, strict=True)}
        return {k: _outcome(function, point) for k, point in points.items()}


def outcomes_in_worker(function: Callable[..., Any], points: Mapping[int, dict[str, Any]]) -> dict[int, Outcome]:
    """Return the outcomes of points by place, computed with one BLAS thread."""
    with one_blas_thread:
        return outcomes(function, points)


def _outcome(function: Callable[..., Any], arguments: dict[str, Any]) -> Outcome:
    begun = time.perf_counter()
    try:
        return Outcome(_columns(function(**arguments)), time.perf_counter() - begun)
    except (Exception, SystemExit) as error:  # a function that calls sys.exit fails at one point
        text = " ".join(f"{type(error).__name__}: {error}".split()).removesuffix(":")
        trace = "".join(traceback.format_exception(type(error), error, error.__traceback__, limit=-_TRACE_CALLS))
        return Outcome(None, time.perf_counter() - begun, text, trace)


def _columns(value: Any) -> dict[str, Any]:
    """Return what a function returned by name; scalars of NumPy become Python's."""
    named = value if isinstance(value, Mapping) else {_VALUE: value}
    for name in named:
        if not isinstance(name, str):
            raise TypeError(f"the function returned a mapping with the key {name!r}; expected names")
    return {
        name: cell.item() if isinstance(cell, np.generic) or (isinstance(cell, np.ndarray) and cell.ndim == 0) else cell
        for name, cell in named.items()
    }
