"""A case: what is tried, what is promised, what was seen, and the one of four words for it."""

import linecache
import warnings
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from enum import StrEnum
from math import isfinite
from pathlib import Path
from typing import Any

import numpy as np

_PACKAGE = Path(__file__).parents[2]
SCALES = (1e-9, 1e-6, 1e-3, 1e3, 1e6, 1e9)  # by which units are changed: up to nine powers of ten
_SECONDS = 20.0  # that a case may take before it counts as hung (a choice: what a user waits without asking)


class Outcome(StrEnum):
    """How a case ended."""

    HELD = "held"
    REFUSED = "refused"
    UNCERTIFIED = "uncertified"
    BROKEN = "BROKEN"


@dataclass(frozen=True)
class Seen:
    """What a case saw.

    Attributes
    ----------
    error : float
        Largest error against the reference, in the measure that the case names.
    certified : bool
        Whether the answer was said to be certain; False where a certificate said that it is not.
    said : str
        What was said with the answer, if anything.
    """

    error: float
    certified: bool = True
    said: str = ""


@dataclass(frozen=True)
class Case:
    """One line of the table.

    Attributes
    ----------
    area : str
        What part of the package it is of.
    what : str
        What is tried; cases that differ in the amount alone have the same words here.
    amount : str
        How much of it.
    promise : float or None
        Largest error that is promised; None where nothing but a refusal will do.
    measure : str
        What the error is, and against what it is measured.
    work : callable
        A function of a module that returns a :class:`Seen`, or raises what the package raises.
    arguments : tuple
        What it is given.
    answered : bool
        Whether a refusal counts as broken: what everybody may ask for.
    full : bool
        Whether it takes long, and is tried with ``--full`` alone.
    seconds : float
        How long it may take.
    """

    area: str
    what: str
    amount: str
    promise: float | None
    measure: str
    work: Callable[..., Seen]
    arguments: tuple[Any, ...] = ()
    answered: bool = False
    full: bool = False
    seconds: float = _SECONDS

    @property
    def name(self) -> str:
        """Area, what is tried and how much of it."""
        return f"{self.area}: {self.what}, {self.amount}"


def rows(
    area: str,
    what: str,
    measure: str,
    work: Callable[..., Seen],
    over: Iterable[Any],
    *,
    promise: float | Callable[[Any], float] | None,
    amount: str | Callable[[Any], str] = "{:g}",
    answered: bool | Callable[[Any], bool] = False,
    full: bool | Callable[[Any], bool] = False,
    seconds: float = _SECONDS,
) -> Iterator[Case]:
    """Return the cases of one thing that is tried over several amounts, each of which ``work`` is given.

    Parameters
    ----------
    area, what, measure, work, seconds
        As of :class:`Case`.
    over : iterable
        The amounts.
    promise, answered, full
        As of :class:`Case`, or functions of an amount.
    amount : str or callable
        How an amount is written: a format, or a function of it.
    """
    for value in over:
        words = amount(value) if callable(amount) else amount.format(value)
        promised = promise(value) if callable(promise) else promise
        must = answered(value) if callable(answered) else answered
        long = full(value) if callable(full) else full
        yield Case(area, what, words, promised, measure, work, (value,), must, long, seconds)


@dataclass(frozen=True)
class Line:
    """A case and what came of it.

    Attributes
    ----------
    case : Case
    outcome : Outcome
    error : float or None
        As seen; None without an answer.
    said : str
        The reason of a refusal, of a doubt, or of what is broken.
    seconds : float
        Time that it took.
    """

    case: Case
    outcome: Outcome
    error: float | None = None
    said: str = ""
    seconds: float = 0.0


def said_by_us(error: BaseException) -> bool:
    """Return whether an error was raised by a statement of this package, for its user: not one of an inner library.

    A library's error has its innermost line elsewhere, or, where the library is compiled, at a line of ours that calls it
    and raises nothing.
    """
    if not isinstance(error, (ValueError, TypeError, RuntimeError, OSError, ArithmeticError)) or not str(error).strip():
        return False
    trace = error.__traceback__
    while trace is not None and trace.tb_next is not None:
        trace = trace.tb_next
    if trace is None:
        return False
    file = trace.tb_frame.f_code.co_filename
    raised = linecache.getline(file, trace.tb_lineno).strip()
    return Path(file).is_relative_to(_PACKAGE) and raised.startswith("raise ")


def tried(case: Case) -> Line:
    """Try a case, here and now."""
    with warnings.catch_warnings(record=True) as noted:
        warnings.simplefilter("always")
        try:
            seen = case.work(*case.arguments)
        except MemoryError:
            raise
        except Exception as error:
            return _refusal(case, error)
    ours = [w for w in noted if w.category.__module__.startswith("boomctl.")]
    inner = [w for w in noted if issubclass(w.category, RuntimeWarning)]
    if inner:
        return Line(case, Outcome.BROKEN, seen.error, f"a warning of an inner library: {inner[0].message}")
    said = "; ".join([seen.said, *(str(w.message) for w in ours)]).strip("; ")
    return Line(case, _judged(case, seen, doubted=bool(ours)), seen.error, said)


def _judged(case: Case, seen: Seen, doubted: bool) -> Outcome:
    if case.promise is None:
        return Outcome.BROKEN
    if isfinite(seen.error) and seen.error <= case.promise:
        return Outcome.HELD
    return Outcome.UNCERTIFIED if doubted or not seen.certified else Outcome.BROKEN


def _refusal(case: Case, error: Exception) -> Line:
    said = " ".join(str(error).split())
    if not said_by_us(error):
        return Line(case, Outcome.BROKEN, None, f"an error of an inner library: {type(error).__name__}: {said}")
    if case.answered:
        return Line(case, Outcome.BROKEN, None, f"refused, though it can be answered: {said}")
    return Line(case, Outcome.REFUSED, None, said)


def relative(found: Any, true: Any) -> float:
    """Return the largest difference of two arrays over the largest true value; infinite if their shapes differ."""
    a, b = np.asarray(found, dtype=complex), np.asarray(true, dtype=complex)
    if a.shape != b.shape or not np.isfinite(a).all():
        return float("inf")
    scale = float(np.abs(b).max(initial=0.0))
    difference = float(np.abs(a - b).max(initial=0.0))
    return difference / scale if scale > 0.0 else difference


def each_relative(found: Any, true: Any) -> float:
    """Return the largest relative difference of two arrays, value by value."""
    a, b = np.asarray(found, dtype=complex), np.asarray(true, dtype=complex)
    if a.shape != b.shape or not np.isfinite(a).all():
        return float("inf")
    size = np.abs(b)
    return float((np.abs(a - b) / np.where(size > 0.0, size, 1.0)).max(initial=0.0))
