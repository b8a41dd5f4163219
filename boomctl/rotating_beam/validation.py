"""Checks of what only hub-beams have: modes, instants, states, functions of time."""

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from boomctl.arrays import Array
from boomctl.checks import whole

MAX_MODES = 200
"""Largest number of mode shapes a direction for which the modal integrals are known to keep 1e-12 relative."""


def mode_count(value: object) -> int:
    """Return the number of modes as an int between 1 and `MAX_MODES`, or raise TypeError or ValueError."""
    count = whole("modes", value)
    if count > MAX_MODES:
        raise ValueError(f"modes = {value!r}: expected 1 to {MAX_MODES}; beyond, the integrals lose their 1e-12")
    return count


def function_of_time(name: str, value: object) -> Callable[..., object]:
    """Return `value` if it can be called, or raise TypeError."""
    if not callable(value):
        raise TypeError(f"{name} = {value!r}: expected a function of time")
    return value


def time_points(value: ArrayLike) -> Array:
    """Return the instants at which a simulation is wanted: one-dimensional, finite, ascending, from 0 on.

    Raises
    ------
    ValueError
        If they are none, negative, not finite or not strictly ascending.
    """
    try:
        timepts = np.array(value, dtype=float)
    except (TypeError, ValueError) as error:
        raise TypeError("timepts: expected a sequence of real numbers [s]") from error
    if timepts.ndim != 1 or timepts.size == 0:
        raise ValueError(f"timepts of shape {timepts.shape}: expected one dimension and at least one instant")
    if not np.isfinite(timepts).all():
        raise ValueError("timepts: expected finite instants")
    if timepts[0] < 0.0:
        raise ValueError(f"timepts[0] = {timepts[0]!r}: expected instants >= 0; a manoeuvre starts at 0")
    if (timepts[1:] <= timepts[:-1]).any():
        raise ValueError("timepts: expected strictly ascending instants")
    return timepts


def state_vector(value: ArrayLike, size: int) -> Array:
    """Return an initial state of `size` finite numbers, or raise ValueError."""
    try:
        state = np.array(value, dtype=float)
    except (TypeError, ValueError) as error:
        raise TypeError(f"initial: expected {size} real numbers") from error
    if state.shape != (size,):
        raise ValueError(f"initial of shape {state.shape}: expected ({size},), the states of to_nlsys() in their order")
    if not np.all(np.isfinite(state)):
        raise ValueError("initial: expected finite numbers")
    return state
