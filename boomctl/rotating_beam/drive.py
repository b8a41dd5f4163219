"""Steps that are short where a user's torque or hub acceleration jumps or is swift, which it need not say.

No finite number of samples finds everything. A function is looked at in Gauss points of each step, and at even instants:
every 0.5 ms, and at 16,384 to 1,048,576 instants in all. What is shorter has to be named as a breakpoint.
"""

from collections.abc import Callable

import numpy as np
from numpy.polynomial import legendre

from boomctl.arrays import Array
from boomctl.gauss import gauss_method

_GAP = 5e-4  # s between instants: a pulse of 1 N m so short moves the tip of Table 1's beam by 1e-5 m (a choice)
_FEWEST, _MOST = 2**14, 2**20  # instants, so that short motions are seen as finely, and long ones end (choices)
_POINTS = 10  # Gauss points at which a function is looked at on each step (a choice)
_ROUGH = 1e-6  # of its largest value: what is farther off a polynomial means that none follows the function
_SMALLEST = 1e-12  # of the whole time: a jump within so short a step is as good as at its edge
_PASSES = 45  # halvings of a first step: 2^-45 is below the smallest step
_NEAR_END = 1e-6  # Distance over the step of further instants to its ends: a jump between Gauss point and end is found.
_EDGE = 1e-9  # of a step: so near to its ends an instant may belong to the next one


def even_instants(end: float) -> Array:
    """Return the even instants at which a function is looked at, from 0 to an end [s]."""
    return np.linspace(0.0, end, int(np.clip(np.ceil(end / _GAP), _FEWEST, _MOST)) + 1)


def off_polynomials(values: Array, begin: Array, length: Array, instants: Array, found: Array) -> tuple[Array, Array]:
    """Return by how much a function is off the polynomials through its Gauss points, and in which steps that was found.

    Parameters
    ----------
    values : ndarray, m x s
        At s Gauss points of each of m steps.
    begin, length : ndarray, m
        Of the steps, s.
    instants, found : ndarray, k
        Instants within the steps, and the values there.

    Returns
    -------
    apart : ndarray, k
        Zero at instants that lie at an end of a step.
    step : ndarray of int, k
    """
    degree = values.shape[1] - 1
    step = np.clip(np.searchsorted(begin, instants, side="right") - 1, 0, len(begin) - 1)
    place = (instants - begin[step]) / length[step]
    terms = values @ gauss_method(degree + 1).terms.T
    apart = np.abs(found - np.einsum("ki,ki->k", legendre.legvander(2.0 * place - 1.0, degree), terms[step]))
    return np.where((place > _EDGE) & (place < 1.0 - _EDGE), apart, 0.0), step


def resolving(edges: Array, function: Callable[[Array], Array]) -> Array:
    """Halve steps until a polynomial follows a function on each: its jumps then lie within very short ones.

    Parameters
    ----------
    edges : ndarray
        Ends of the first steps, from 0 on, s.
    function : callable
        Torque or hub acceleration of an array of instants.
    """
    nodes, terms = gauss_method(_POINTS).nodes, gauss_method(_POINTS).terms
    ends = np.array([_NEAR_END, 1.0 - _NEAR_END])
    at_ends = legendre.legvander(2.0 * ends - 1.0, _POINTS - 1) @ terms
    instants = even_instants(float(edges[-1]))
    result = function(instants)
    largest = float(np.abs(result).max())
    for _ in range(_PASSES):
        length = np.diff(edges)
        values = function(edges[:-1, None] + length[:, None] * nodes)
        largest = max(largest, float(np.abs(values).max()))
        rough = np.abs(values @ terms[-2:].T).max(axis=1) > _ROUGH * largest
        near_ends = function(edges[:-1, None] + length[:, None] * ends)
        rough |= np.abs(near_ends - values @ at_ends.T).max(axis=1) > _ROUGH * largest
        apart, step = off_polynomials(values, edges[:-1], length, instants, result)
        rough[step[apart > _ROUGH * largest]] = True
        rough &= 0.5 * length > _SMALLEST * edges[-1]
        if not rough.any():
            break
        # what was not rough is not looked at again
        open_ = rough[step]
        instants, result = instants[open_], result[open_]
        edges = np.sort(np.concatenate([edges, (edges[:-1] + 0.5 * length)[rough]]))
    return edges
