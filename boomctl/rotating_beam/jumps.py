"""Steps that are short where a user's torque or hub acceleration jumps or changes fast, without declared breakpoints.

No finite number of samples resolves every function. A function is evaluated at the Gauss points of each step, and at equally
spaced times: every 0.5 ms, and 16,384 to 1,048,576 times in all. Shorter features must be declared as breakpoints.
"""

from collections.abc import Callable

import numpy as np
from numpy.polynomial import legendre

from boomctl.arrays import Array
from boomctl.gauss import gauss_method
from boomctl.lti.rounding import ALIKE, SUMMED

_GAP = 5e-4  # Spacing of the times [s]: a pulse of 1 N m and this duration moves the tip of Table 1's beam by 1e-5 m.
_FEWEST, _MOST = 2**14, 2**20  # Limits of the number of times: resolution of short motions, cost of long motions.
_POINTS = 10  # Gauss points at which a function is evaluated on each step.
_ROUGH = 1e-6  # Deviation from a polynomial, relative to the largest value, above which a step is halved.
_NEAR_END = 1e-6  # Distance over the step of further times to its ends: a jump between Gauss point and end is found.


def even_times(end: float) -> Array:
    """Return the equally spaced times at which a function is evaluated, from 0 to an end [s]."""
    return np.linspace(0.0, end, int(np.clip(np.ceil(end / _GAP), _FEWEST, _MOST)) + 1)


def polynomial_errors(values: Array, begin: Array, length: Array, times: Array, samples: Array) -> tuple[Array, Array]:
    """Return the deviation of a function from the polynomials through its Gauss points, and the step of each sample.

    Parameters
    ----------
    values : ndarray, m x s
        Function at s Gauss points of each of m steps.
    begin, length : ndarray, m
        Start times and lengths of the steps, s.
    times, samples : ndarray, k
        Times within the steps, and the function there.

    Returns
    -------
    error : ndarray, k
        Zero at times that coincide with an end of a step.
    step : ndarray of int, k
    """
    degree = values.shape[1] - 1
    step = np.clip(np.searchsorted(begin, times, side="right") - 1, 0, len(begin) - 1)
    position = (times - begin[step]) / length[step]
    terms = values @ gauss_method(degree + 1).terms.T
    error = np.abs(samples - np.einsum("ki,ki->k", legendre.legvander(2.0 * position - 1.0, degree), terms[step]))
    return np.where((position > ALIKE) & (position < 1.0 - ALIKE), error, 0.0), step


def steps_resolving(edges: Array, function: Callable[[Array], Array]) -> Array:
    """Halve steps until a polynomial approximates a function on each step; jumps are then within very short steps.

    Parameters
    ----------
    edges : ndarray
        Ends of the first steps, from 0 on, s.
    function : callable
        Torque or hub acceleration of an array of times.
    """
    nodes, terms = gauss_method(_POINTS).nodes, gauss_method(_POINTS).terms
    ends = np.array([_NEAR_END, 1.0 - _NEAR_END])
    at_ends = legendre.legvander(2.0 * ends - 1.0, _POINTS - 1) @ terms
    times = even_times(float(edges[-1]))
    result = function(times)
    largest = float(np.abs(result).max())
    while True:
        length = np.diff(edges)
        values = function(edges[:-1, None] + length[:, None] * nodes)
        largest = max(largest, float(np.abs(values).max()))
        rough = np.abs(values @ terms[-2:].T).max(axis=1) > _ROUGH * largest
        near_ends = function(edges[:-1, None] + length[:, None] * ends)
        rough |= np.abs(near_ends - values @ at_ends.T).max(axis=1) > _ROUGH * largest
        error, step = polynomial_errors(values, edges[:-1], length, times, result)
        rough[step[error > _ROUGH * largest]] = True
        rough &= 0.5 * length > SUMMED * edges[-1]
        if not rough.any():
            return edges
        # samples in smooth steps are not checked again
        open_ = rough[step]
        times, result = times[open_], result[open_]
        edges = np.sort(np.concatenate([edges, (edges[:-1] + 0.5 * length)[rough]]))
