"""Checks of input: errors in one line that name parameter, value and requirement."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from decimal import ROUND_CEILING, ROUND_FLOOR, Context
from difflib import get_close_matches
from pathlib import Path
from typing import Any, TypeVar
from warnings import warn_explicit

import numpy as np
from numpy.typing import ArrayLike

from boomctl.arrays import Array
from boomctl.exceptions import BoomctlWarning
from boomctl.printing import PART

FASTEST = 1e60  # rad/s; the fourth power of larger frequencies may overflow.
_LARGEST_WHOLE = 2**53  # whole numbers up to here are also numbers in double precision
# Magnitudes of parameters; products and quotients of three of them do not overflow.
SMALLEST, _LARGEST = 1e-100, 1e100
MOST = 1000  # jobs, starts, eigenfrequencies, or samples of a delay: more are an error of the user
_FEW = 7  # Digits of a limit in a message.
_INNER = {"boomctl", "contextlib", "functools"}  # packages whose calls are not the user's
_Kind = TypeVar("_Kind")


def shown(value: object) -> str:
    """Return a value as text for a message, in one short line."""
    text = " ".join(repr(value).split())
    return text if len(text) <= PART else f"{text[:PART]}..."


def warn_user(message: str, category: type[Warning] = BoomctlWarning) -> None:
    """Issue a warning at the line that called the library."""
    frame = sys._getframe(1)
    while frame.f_globals.get("__name__", "").partition(".")[0] in _INNER and frame.f_back is not None:
        frame = frame.f_back
    registry = frame.f_globals.setdefault("__warningregistry__", {})
    module = frame.f_globals.get("__name__", "<unknown>")
    warn_explicit(message, category, frame.f_code.co_filename, frame.f_lineno, module=module, registry=registry)


def exactly(value: float) -> str:
    """Return a number in as few digits as identify it."""
    short = f"{value:g}"
    return short if float(short) == value else repr(float(value))


def up_to(limit: float) -> str:
    """Return a number of few digits that is not above a limit, for messages."""
    return _towards(limit, ROUND_FLOOR)


def from_on(limit: float, digits: int = _FEW) -> str:
    """Return a number of few digits that is not below a limit, for messages."""
    return _towards(limit, ROUND_CEILING, digits)


def _towards(limit: float, rounding: str, digits: int = _FEW) -> str:
    short = f"{limit:.{digits}g}"
    if float(short) == limit or not np.isfinite(limit):
        return short
    return f"{float(Context(prec=digits, rounding=rounding).create_decimal(float(limit))):.{digits}g}"


def instance(name: str, value: object, kind: type[_Kind] | tuple[type[_Kind], ...], expected: str = "") -> _Kind:
    """Return ``value`` if it is an instance of a class; a TypeError names the class and how to make an instance.

    The attribute ``_made_by`` of the class names the function that makes instances, if it is not the class.
    """
    if not isinstance(value, kind):
        kinds = kind if isinstance(kind, tuple) else (kind,)
        wanted = expected or " or ".join(k.__name__ for k in kinds)
        ways = dict.fromkeys(getattr(k, "_made_by", "") for k in kinds)
        made = "".join(f"; {way} makes one" for way in ways if way)
        raise TypeError(f"{name} = {shown(value)}: expected {wanted}, got {type(value).__name__}{made}")
    return value


def truth(name: str, value: object) -> bool:
    """Return ``value`` if it is True or False."""
    if not isinstance(value, (bool, np.bool_)):
        raise TypeError(f"{name} = {shown(value)}: expected True or False, got {type(value).__name__}")
    return bool(value)


def sequence(name: str, value: object, of: str = "values") -> tuple[Any, ...]:
    """Return the items of a sequence; a string or no sequence raises a TypeError."""
    if type(value) is tuple:  # nearly every one is
        return value
    unmasked(name, value)
    if isinstance(value, (str, bytes)) or not isinstance(value, Iterable) or getattr(value, "ndim", 1) == 0:
        raise TypeError(f"{name} = {shown(value)}: expected a sequence of {of}, got {type(value).__name__}")
    return tuple(value)


def mapping(name: str, value: object, of: str) -> Mapping[Any, Any]:
    """Return ``value`` if it is a mapping."""
    if not isinstance(value, Mapping):
        raise TypeError(f"{name} = {shown(value)}: expected a mapping of {of}, got {type(value).__name__}")
    return value


def function_of(name: str, value: object, of: str) -> Callable[..., Any]:
    """Return ``value`` if it is a function; a system of python-control is not."""
    if not callable(value) or hasattr(value, "ninputs"):
        raise TypeError(f"{name} = {shown(value)}: expected a function of {of}, got {type(value).__name__}")
    return value


def path(name: str, value: object) -> Path:
    """Return ``value`` as the path of a file or folder."""
    if not isinstance(value, (str, os.PathLike)) or not isinstance(os.fspath(value), str):
        raise TypeError(f"{name} = {shown(value)}: expected a path, got {type(value).__name__}")
    try:
        whole = b"\0" not in os.fsencode(value)
    except UnicodeEncodeError:
        whole = False
    if not whole:
        raise ValueError(f"{name} = {shown(value)}: expected a path without null characters and lone surrogates")
    return Path(value)


def real(name: str, value: object) -> float:
    """Return ``value`` as a finite float.

    Raises
    ------
    TypeError
        If ``value`` is not a real number.
    ValueError
        If ``value`` is not finite.
    """
    if type(value) is float and -_LARGEST <= value <= _LARGEST:  # as nearly all of a model's hundred values
        return value
    if isinstance(value, (bool, np.bool_)) or not isinstance(value, (int, float, np.integer, np.floating)):
        raise TypeError(f"{name} = {shown(value)}: expected a real number, got {type(value).__name__}")
    try:
        number = float(value)
    except OverflowError:
        number = np.inf
    if not np.isfinite(number):
        raise ValueError(f"{name} = {shown(value)}: expected a finite number")
    if abs(number) > _LARGEST:
        raise ValueError(f"{name} = {value!r}: expected a number of at most {_LARGEST:g} in size")
    return number


def within(name: str, value: object, low: float, high: float, unit: str = "") -> float:
    """Return ``value`` as a finite float from ``low`` to ``high``."""
    number = real(name, value)
    if not low <= number <= high:
        of = f" {unit}" if unit else ""
        raise ValueError(f"{name} = {value!r}: expected a number from {low:g} to {high:g}{of}")
    return number


def positive(name: str, value: object) -> float:
    """Return ``value`` as a finite float above zero."""
    number = real(name, value)
    if number <= 0.0:
        raise ValueError(f"{name} = {value!r}: expected a number greater than zero")
    if number < SMALLEST:
        raise ValueError(f"{name} = {value!r}: expected a number of at least {SMALLEST:g}")
    return number


def nonnegative(name: str, value: object) -> float:
    """Return ``value`` as a finite float not below zero."""
    number = real(name, value)
    if number < 0.0:
        raise ValueError(f"{name} = {value!r}: expected zero or a number greater than zero")
    return number


def whole(name: str, value: object, least: int = 1, most: int = _LARGEST_WHOLE) -> int:
    """Return ``value`` as an integer from ``least`` to ``most``."""
    if isinstance(value, (bool, np.bool_)) or not isinstance(value, (int, np.integer)):
        raise TypeError(f"{name} = {shown(value)}: expected a whole number, got {type(value).__name__}")
    if value < least:
        raise ValueError(f"{name} = {value!r}: expected a whole number not below {least}")
    if value > most:
        given = f" = {value!r}" if value <= _LARGEST_WHOLE else ""
        raise ValueError(f"{name}{given}: expected a whole number of at most {most}")
    return int(value)


def unmasked(name: str, value: object) -> None:
    """Raise a TypeError for a masked array, or a list or tuple that contains one: a conversion would drop the mask."""
    masked = getattr(sys.modules.get("numpy.ma"), "MaskedArray", None)  # not imported: there is no masked array
    if masked is None:
        return
    if isinstance(value, masked) or (isinstance(value, (list, tuple)) and any(isinstance(x, masked) for x in value)):
        raise TypeError(
            f"`{name}` must not be a masked array. Fill or drop the masked entries (`.filled`, `.compressed`)."
        )


def plain_array(name: str, value: ArrayLike) -> Array:
    """Return ``value`` as an array of its own type; masked arrays and rows of different lengths raise an error."""
    unmasked(name, value)
    try:
        return np.asarray(value)
    except ValueError:
        raise ValueError(f"{name}: expected an array, got rows of different lengths") from None
    except Exception:  # what pretends to be a sequence and is none may fail in any way
        raise TypeError(f"{name}: expected an array, got {type(value).__name__}") from None


def finite_array(name: str, value: ArrayLike, ndim: int | None = None) -> Array:
    """Return ``value`` as a real array without NaN or infinity, of ``ndim`` dimensions if that is given."""
    array = plain_array(name, value)
    if array.dtype.kind not in "iuf":
        raise TypeError(f"{name}: expected real numbers, got an array of {array.dtype}")
    if ndim is not None and array.ndim != ndim:
        raise ValueError(f"{name}: expected {ndim} dimension(s), got shape {array.shape}")
    if not np.isfinite(array).all():
        where = tuple(int(i) for i in np.argwhere(~np.isfinite(array))[0])
        raise ValueError(f"{name}: expected finite numbers, got {array[where]} at {where}")
    numbers = array.astype(float)
    if numbers.size and not -_LARGEST <= numbers.min() <= numbers.max() <= _LARGEST:
        where = tuple(int(i) for i in np.unravel_index(np.abs(numbers).argmax(), numbers.shape))
        raise ValueError(f"{name}: expected numbers of at most {_LARGEST:g} in size, got {numbers[where]:g} at {where}")
    return numbers


def span(name: str, value: ArrayLike) -> tuple[float, float]:
    """Return ``value`` as two finite numbers, nonnegative and ascending."""
    ends = finite_array(name, value)
    if ends.shape != (2,) or not 0.0 <= ends[0] < ends[1]:
        raise ValueError(f"`{name}` must be two nonnegative numbers, ascending, got {shown(value)}.")
    return float(ends[0]), float(ends[1])


def no_signals(name: str, value: object, expected: str) -> None:
    """Raise an error for names of signals in place of a grid or a controller.

    Raises
    ------
    TypeError
        If `value` is a name or contains one; it states where signals are named.
    """
    given = [value] if isinstance(value, str) else value
    if isinstance(given, list | tuple) and any(isinstance(item, str) for item in given):
        raise TypeError(f"{name} = {shown(value)}: expected {expected}; signals are named by inputs= and outputs=")


def frequencies(name: str, value: ArrayLike) -> Array:
    """Return ``value`` as a one-dimensional array of angular frequencies, rad/s, none negative."""
    no_signals(name, value, "frequencies")
    omega = np.atleast_1d(finite_array(name, value))
    if omega.ndim != 1 or omega.size == 0:
        raise ValueError(f"{name}: expected one dimension and at least one frequency, got shape {omega.shape}")
    wrong = omega[(omega != 0.0) & ~((omega >= SMALLEST) & (omega <= FASTEST))]
    if wrong.size:
        raise ValueError(
            f"{name}: expected zeros or frequencies from {SMALLEST:g} to {FASTEST:g} rad/s, got {wrong[0]}"
        )
    return omega


def known(what: str, name: object, choices: Iterable[str], there: str = "there are") -> str:
    """Return ``name`` if it is among ``choices``; otherwise raise an error that lists them and suggests the nearest."""
    listed = list(choices)
    if isinstance(name, str) and name in listed:
        return str(name)
    close = get_close_matches(str(name), listed, n=1, cutoff=0.5)
    hint = f"; did you mean {close[0]!r}?" if close else ""
    raise ValueError(f"unknown {what} {shown(name)}{hint} ({there}: {', '.join(listed) or 'none'})")


def signal_name(what: str, name: object) -> str:
    """Return ``name`` if python-control takes it as a signal's name: not empty, without a dot."""
    if not isinstance(name, str):
        raise TypeError(f"{what} = {shown(name)}: expected a string")
    if not name or "." in name:
        raise ValueError(f"{what} = {name!r}: expected a name that is not empty and has no dot in it")
    return name


def names(
    what: str, wanted: str | Sequence[str] | None, choices: Sequence[str], there: str = "there are"
) -> tuple[str, ...]:
    """Return the wanted names, each known and none twice; ``None`` means all of ``choices``; no names are a TypeError."""
    if wanted is None:
        return tuple(choices)
    if not isinstance(wanted, Iterable) or getattr(wanted, "ndim", 1) == 0:
        raise TypeError(f"{what} = {shown(wanted)}: expected a name or a sequence of names")
    listed = (wanted,) if isinstance(wanted, str) else tuple(wanted)
    for name in listed:
        known(what, name, choices, there)
    if len(set(listed)) != len(listed):
        twice = next(name for name in listed if listed.count(name) > 1)
        raise ValueError(f"{what} {twice!r} is given twice")
    return listed


def some_names(what: str, wanted: str | Sequence[str] | None, choices: Sequence[str]) -> tuple[str, ...]:
    """Return the wanted names as `names` does; an empty selection raises an error."""
    result = names(what, wanted, choices)
    if not result:
        raise ValueError(f"`{what}s` must have at least one name, got none.")
    return result


def job_count(value: Any) -> int:
    """Return a number of joblib's jobs: positive, or negative for all cores but some."""
    if instance("n_jobs", value, int) == 0 or isinstance(value, bool) or abs(value) > MOST:
        raise ValueError(f"`n_jobs` must be a nonzero integer up to {MOST}, got {shown(value)}. Pass -1 for all cores.")
    return value
