"""Polynomials of several variables through values at Chebyshev points, from -1 to 1 in each."""

from collections.abc import Callable, Mapping
from itertools import product

import numpy as np
from numpy.polynomial import chebyshev

from boomctl.arrays import Array

_FIRST_POINTS = 5  # at which a polynomial is tried first: enough for squares (a choice)


def points(counts: tuple[int, ...]) -> list[Array]:
    """Return the points of a grid, the last variable running first."""
    return [np.array(point) for point in product(*(chebyshev.chebpts1(count) for count in counts))]


def series(values: Array, counts: tuple[int, ...]) -> Array:
    """Return coefficients of products of Chebyshev polynomials, shape (*counts, ...), of values at the points of a grid."""
    found = values.reshape(*counts, *values.shape[1:])
    for axis, count in enumerate(counts):
        to_series = np.linalg.inv(chebyshev.chebvander(chebyshev.chebpts1(count), count - 1))
        found = np.moveaxis(np.tensordot(to_series, found, (1, axis)), 0, axis)
    return found


def powers(coefficients: Array, counts: tuple[int, ...]) -> Array:
    """Return coefficients of products of powers, of those of Chebyshev polynomials."""
    found = coefficients
    for axis, count in enumerate(counts):
        to_powers = np.array([np.pad(chebyshev.cheb2poly(unit), (0, count))[:count] for unit in np.eye(count)]).T
        found = np.moveaxis(np.tensordot(to_powers, found, (1, axis)), 0, axis)
    return found


def points_needed(
    at: Callable[[Array], Mapping[str, Array]],
    negligible: Callable[[Mapping[str, Array]], Mapping[str, Array | float]],
    degree: int,
) -> int:
    """Return at how many points of a line functions are to be known, so that what is left is rounding; at most degree + 1.

    Parameters
    ----------
    at : callable
        From points of the line to values of each function there, stacked.
    negligible : callable
        From such values to what of each function is rounding.
    degree : int
        Largest degree of interest.
    """
    count = _FIRST_POINTS
    while count <= degree:
        found = at(chebyshev.chebpts1(count))
        least = negligible(found)
        if all((np.abs(series(stack, (count,))[-2:]) <= least[name]).all() for name, stack in found.items()):
            return count
        count = 2 * count - 1
    return degree + 1
