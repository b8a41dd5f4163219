"""Polynomial approximation of functions of several variables on the box [-1, 1]^n."""

from collections.abc import Callable, Mapping, Sequence
from itertools import product
from math import inf

import numpy as np
from numpy.polynomial import chebyshev
from numpy.typing import NDArray

from boomctl.arrays import Array
from boomctl.lti.rounding import SOLVED, TINY

_FIRST_POINTS = 5  # Chebyshev points of the first approximation; doubled until it suffices.
_INSIDE = 24  # Random test points, in addition to the vertices.
FEW_PARAMETERS = 10  # Largest number of parameters for which all vertices are test points.
_TERMS = 2_000  # Largest number of terms; more raise an error.
_WIDER = 1.25  # Growth of the total degree if the approximation fails at a test point.

Functions = Callable[[Sequence[Array]], dict[str, Array]]
"""Function of points that returns the stacked values of each function."""

Sizes = Callable[[Mapping[str, Array]], Mapping[str, Array | float]]
"""Function of such values that returns the rounding error of each function."""


def series(values: Array) -> Array:
    """Return Chebyshev coefficients of values at Chebyshev points."""
    count = len(values)
    return np.tensordot(np.linalg.inv(chebyshev.chebvander(chebyshev.chebpts1(count), count - 1)), values, 1)


def known_along(at: Callable[[Array], dict[str, Array]], negligible: Sizes, degree: int) -> dict[str, Array]:
    """Return functions at the Chebyshev points of a line, so many that the remainder is rounding; at most degree + 1.

    Parameters
    ----------
    at : callable
        Function of points of the line that returns the stacked values of each function.
    negligible : callable
        Function of such values that returns the rounding error of each function.
    degree : int
        Largest degree of interest.
    """
    count = min(_FIRST_POINTS, degree + 1)
    while True:
        result = at(chebyshev.chebpts1(count))
        least = negligible(result)
        if count > degree or all((np.abs(series(stack)[-2:]) <= least[name]).all() for name, stack in result.items()):
            return result
        count = min(2 * count - 1, degree + 1)


def points_along(at: Functions, axis: Array, negligible: Sizes, degree: int, spare: int = 0) -> int:
    """Return the number of Chebyshev points that a variable needs for all values of the others.

    It follows from the last coefficient above rounding, plus ``spare`` points.
    """

    def line(places: Array, others: float = 0.0) -> dict[str, Array]:
        return at([float(x) * axis + others * (axis == 0.0) for x in places])

    middle, last = known_along(line, negligible, degree), 0
    count = len(next(iter(middle.values())))
    for stacks in (middle, *(line(chebyshev.chebpts1(count), others) for others in (-1.0, 1.0))):
        least = negligible(stacks)
        for name, stack in stacks.items():
            there = (np.abs(series(stack)) > least[name]).reshape(count, -1).any(axis=1)
            last = max(last, *np.flatnonzero(there).tolist(), 0)
    return min(count, last + 1 + spare)


def tried_points(size: int) -> list[Array]:
    """Return the vertices of a box (a random sample of them above `FEW_PARAMETERS`), and random points inside it."""
    rng = np.random.default_rng(0)
    inside = rng.uniform(-1.0, 1.0, (_INSIDE, size))
    if size > FEW_PARAMETERS:
        return [*rng.choice([-1.0, 1.0], (2**FEW_PARAMETERS, size)), *inside]
    return [*(np.array(corner) for corner in product((-1.0, 1.0), repeat=size)), *inside]


def fitted(
    at: Functions,
    counts: Sequence[int],
    wanted: Mapping[str, Array],
    negligible: Sizes,
    exact: float,
    what: str,
    groups: Sequence[Sequence[int]] = (),
    powers: bool = True,
) -> tuple[dict[str, dict[tuple[int, ...], Array]], dict[str, Array], float]:
    """Return functions as polynomials, the error of each entry, and the largest error relative to rounding.

    The basis contains products of Chebyshev polynomials. The sum of their degrees, each relative to the degree that its axis
    needs, is limited by one, then by more, until all test points agree. Coefficients are least squares at twice as many
    Chebyshev-distributed points (Cohen & Migliorati 2017).

    Parameters
    ----------
    at : callable
        Function of points that returns the stacked values of each function.
    counts : sequence of int
        Number of points that each axis needs.
    wanted : mapping
        Values at `tried_points`.
    negligible : callable
        Function of values that returns the rounding error of each function.
    exact : float
        Largest error at a test point, relative to rounding.
    what : str
        Name of the functions in error messages.
    groups : sequence of sequence of int
        Groups of variables that may occur in one product; by default one group of all.
    powers : bool
        True for coefficients of powers, False for those of Chebyshev polynomials, which are accurate at high degrees.

    Raises
    ------
    ValueError
        If the polynomials need too many terms.
    """
    size, rng = len(counts), np.random.default_rng(2)
    places, stacks, reach = np.zeros((0, size)), {}, 1.0
    tried = np.array(tried_points(size))
    while True:
        chosen, beyond = _degrees_of_groups(counts, reach + SOLVED, groups or [range(size)])
        if len(chosen) > _TERMS:
            raise ValueError(f"{what}: polynomials of it have more than {_TERMS} terms")
        more = np.cos(np.pi * rng.uniform(size=(2 * len(chosen) - len(places), size)))
        places, new = np.concatenate([places, more]), at([*more])
        stacks = {name: np.concatenate([stacks.get(name, stack[:0]), stack]) for name, stack in new.items()}
        products, known = _products(places, chosen), _products(tried, chosen)
        inverse = np.linalg.pinv(products)
        result, off, miss = {}, {}, 0.0
        for name, least in negligible(stacks).items():
            coefficients = np.tensordot(inverse, stacks[name], 1)
            coefficients[np.abs(coefficients) <= least] = 0.0
            misses = ((known, wanted[name]), (products, stacks[name]))
            off[name] = np.maximum(*(np.abs(np.tensordot(T, coefficients, 1) - X).max(axis=0) for T, X in misses))
            result[name] = _by_term(_in_powers(coefficients, chosen) if powers else coefficients, chosen)
            miss = max(miss, float((off[name] / np.maximum(least, TINY)).max(initial=0.0)))
        if miss <= exact or beyond == inf:
            return result, off, miss
        reach = max(_WIDER * reach, beyond)  # by one term at least


def _degrees_of_groups(
    counts: Sequence[int], reach: float, groups: Sequence[Sequence[int]]
) -> tuple[NDArray[np.int_], float]:
    """Return the degrees of products of variables of one group, and the smallest sum above the limit."""
    result, least = [np.zeros((1, len(counts)), int)], inf
    for group in groups:
        own, beyond = _degrees([counts[i] for i in group], reach)
        wide = np.zeros((len(own), len(counts)), int)
        wide[:, list(group)] = own
        result.append(wide[own.any(axis=1)])
        least = min(least, beyond)
    return np.concatenate(result), least


def _degrees(counts: Sequence[int], reach: float) -> tuple[NDArray[np.int_], float]:
    """Return the degrees, each below its count, whose relative sum is within a limit, and the smallest sum above it.

    It ends where there are too many terms.
    """
    chosen, shares, beyond = np.zeros((1, 0), int), np.zeros(1), inf
    for count in counts:
        powers = np.arange(count)
        totals = (shares[:, None] + powers / max(count - 1, 1)).ravel()
        longer = np.column_stack([np.repeat(chosen, count, axis=0), np.tile(powers, len(chosen))])
        within = totals <= reach
        chosen, shares, beyond = longer[within], totals[within], min(beyond, totals[~within].min(initial=inf))
        if len(chosen) > _TERMS:
            break
    return np.pad(chosen, ((0, 0), (0, len(counts) - chosen.shape[1]))), float(beyond)


def _products(places: Array, degrees: Array) -> Array:
    """Return products of Chebyshev polynomials at points (n, k): (n, terms)."""
    result = np.ones((len(places), len(degrees)))
    for x, degree in zip(places.T, degrees.T, strict=True):
        result *= np.cos(np.arccos(np.clip(x, -1.0, 1.0))[:, None] * degree)
    return result


def _in_powers(coefficients: Array, degrees: Array) -> Array:
    """Return a sum of products of Chebyshev polynomials as a sum of powers of the same degrees."""
    most = int(degrees.max(initial=0)) + 1
    table = np.array([np.pad(chebyshev.cheb2poly(np.eye(most)[k, : k + 1]), (0, most - 1 - k)) for k in range(most)])
    change = np.ones((len(degrees), len(degrees)))
    for degree in degrees.T:
        change *= table[degree[:, None], degree]  # of the first in powers, the second
    return np.tensordot(change, coefficients, (0, 0))


def _by_term(coefficients: Array, degrees: Array) -> dict[tuple[int, ...], Array]:
    """Return nonzero coefficients by the indices of the factors of their terms."""
    return {
        tuple(np.repeat(np.arange(len(degree)), degree).tolist()): X
        for degree, X in zip(degrees, coefficients, strict=True)
        if X.any() or not degree.any()
    }
