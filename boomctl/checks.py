"""Checks at the boundary: bad input is refused in one line that names parameter, value and what was expected."""

from collections.abc import Iterable, Sequence
from difflib import get_close_matches
from math import isfinite

import numpy as np
from numpy.typing import ArrayLike

from boomctl.arrays import Array


def real(name: str, value: object) -> float:
    """Return ``value`` as a finite float.

    Raises
    ------
    TypeError
        ``value`` is not a real number.
    ValueError
        ``value`` is not finite.
    """
    if type(value) is float and isfinite(value):  # nearly every value is one: a model's description asks for a hundred
        return value
    if isinstance(value, (bool, np.bool_)) or not isinstance(value, (int, float, np.integer, np.floating)):
        raise TypeError(f"{name} = {value!r}: expected a real number, got {type(value).__name__}")
    try:
        number = float(value)
    except OverflowError:
        raise ValueError(
            f"{name}: expected a finite number, got an integer beyond all floating-point numbers"
        ) from None
    if not np.isfinite(number):
        raise ValueError(f"{name} = {value!r}: expected a finite number")
    return number


def positive(name: str, value: object) -> float:
    """Return ``value`` as a finite float above zero."""
    number = real(name, value)
    if number <= 0.0:
        raise ValueError(f"{name} = {value!r}: expected a number greater than zero")
    return number


def nonnegative(name: str, value: object) -> float:
    """Return ``value`` as a finite float not below zero."""
    number = real(name, value)
    if number < 0.0:
        raise ValueError(f"{name} = {value!r}: expected zero or a number greater than zero")
    return number


def whole(name: str, value: object, least: int = 1) -> int:
    """Return ``value`` as an integer not below ``least``."""
    if isinstance(value, (bool, np.bool_)) or not isinstance(value, (int, np.integer)):
        raise TypeError(f"{name} = {value!r}: expected a whole number, got {type(value).__name__}")
    if value < least:
        raise ValueError(f"{name} = {value!r}: expected a whole number not below {least}")
    return int(value)


def plain_array(name: str, value: ArrayLike) -> Array:
    """Return ``value`` as an array of whatever it holds; rows of different lengths are refused by name."""
    try:
        return np.asarray(value)
    except ValueError:
        raise ValueError(f"{name}: expected an array, got rows of different lengths") from None


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
    return array.astype(float)


def frequencies(name: str, value: ArrayLike) -> Array:
    """Return ``value`` as a one-dimensional array of angular frequencies, rad/s, none negative."""
    omega = np.atleast_1d(finite_array(name, value))
    if omega.ndim != 1 or omega.size == 0:
        raise ValueError(f"{name}: expected one dimension and at least one frequency, got shape {omega.shape}")
    if (omega < 0.0).any():
        raise ValueError(f"{name}: expected frequencies not below zero, got {omega.min()}")
    return omega


def known(what: str, name: object, choices: Iterable[str]) -> str:
    """Return ``name`` if it is among ``choices``; otherwise say which exist and suggest the nearest."""
    listed = list(choices)
    if isinstance(name, str) and name in listed:
        return str(name)
    close = get_close_matches(str(name), listed, n=1, cutoff=0.5)
    hint = f"; did you mean {close[0]!r}?" if close else ""
    raise ValueError(f"unknown {what} {name!r}{hint} (there are: {', '.join(listed) or 'none'})")


def signal_name(what: str, name: object) -> str:
    """Return ``name`` if python-control takes it as a signal's name: not empty, without a dot."""
    if not isinstance(name, str):
        raise TypeError(f"{what} = {name!r}: expected a string")
    if not name or "." in name:
        raise ValueError(f"{what} = {name!r}: expected a name that is not empty and has no dot in it")
    return name


def names(what: str, wanted: str | Sequence[str] | None, choices: Sequence[str]) -> tuple[str, ...]:
    """Return the wanted names, each known and none twice; ``None`` means all of ``choices``; no names are a TypeError."""
    if wanted is None:
        return tuple(choices)
    if not isinstance(wanted, Iterable):
        raise TypeError(f"{what} = {wanted!r}: expected a name or a sequence of names")
    listed = (wanted,) if isinstance(wanted, str) else tuple(wanted)
    for name in listed:
        known(what, name, choices)
    if len(set(listed)) != len(listed):
        twice = next(name for name in listed if listed.count(name) > 1)
        raise ValueError(f"{what} {twice!r} is asked for twice")
    return listed
