"""What a file must hold to be a controller: checked once, whatever the kind of file."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from boomctl.arrays import Array
from boomctl.checks import nonnegative, shown
from boomctl.lti.system import Lti

_LARGEST = np.finfo(float).max.item()
_KINDS = ("inputs", "outputs", "states")


def checked_controller(held: Mapping[str, Any]) -> Lti:
    """Return the controller of which a file holds matrices, names and sampling time.

    Parameters
    ----------
    held : mapping
        ``A, B, C, D``: arrays of numbers, or lists of rows; ``inputs, outputs, states``: lists of names;
        ``sample_time``: a number [s], 0 in continuous time, or True where it is not said.

    Raises
    ------
    KeyError
        One of them is not there.
    TypeError, ValueError
        It is something else, in one line.
    """
    inputs, outputs, states = (_names(kind, held[kind]) for kind in _KINDS)
    n, m, p = len(states), len(inputs), len(outputs)
    shapes = {"A": (n, n), "B": (n, m), "C": (p, n), "D": (p, m)}
    A, B, C, D = (_matrix(letter, held[letter], shape) for letter, shape in shapes.items())
    time = held["sample_time"]
    return Lti(A, B, C, D, inputs, outputs, states, np.nan if time is True else nonnegative("sample_time", time))


def _names(kind: str, given: object) -> tuple[str, ...]:
    if not isinstance(given, (list, tuple)) or not all(isinstance(name, str) for name in given):
        raise TypeError(f"{kind} = {shown(given)}: expected a list of names")
    if len({name.replace(".", "_") for name in given}) < len(given):  # python-control allows no dots
        raise ValueError(f"{kind} = {shown(given)}: expected names that are there once")
    return tuple(given)


def _matrix(letter: str, given: object, shape: tuple[int, int]) -> Array:
    """Return a matrix of numbers; of lists each must be a row, for NumPy takes texts and truth values for numbers too."""
    if isinstance(given, np.ndarray) and given.dtype.kind in "iuf":
        given = given.tolist() if given.size else [[] for _ in range(shape[0])]
    if not isinstance(given, list) or not all(isinstance(row, list) for row in given):
        raise TypeError(f"{letter} = {shown(given)}: expected a list of rows of numbers")
    if len(given) != shape[0] or any(len(row) != shape[1] for row in given):
        found = f"{len(given)} of {' or '.join(map(str, sorted({len(row) for row in given}))) or 0}"
        raise ValueError(f"{letter}: expected {shape[0]} rows of {shape[1]} numbers, as there are names, got {found}")
    for value in (value for row in given for value in row):
        if type(value) not in (int, float) or not -_LARGEST <= value <= _LARGEST:
            raise ValueError(f"expected finite numbers in {letter}, got {shown(value)}")
    return np.array(given, dtype=float).reshape(shape)
