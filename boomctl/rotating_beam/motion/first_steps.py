"""The coarsest steps that a simulation starts from."""

from collections.abc import Callable
from itertools import pairwise
from math import ceil, log2

import numpy as np
from numpy.polynomial import legendre

from boomctl.arrays import Array
from boomctl.rotating_beam.modal.equations import Equations

_FIRST_PHASE, _FIRST_PHASE_GRADED = 5.5, 1.4
"""First step times the lowest frequency of the beam."""
_POINTS = 10
_SMALLEST = 1e-12
_PASSES = 45


def first_steps(equations: Equations, breakpoints: tuple[float, ...], end: float, *, graded: bool) -> Array:
    """Ends of the coarsest steps: equal between the instants at which the manoeuvre is not smooth.

    Graded after these, down to the time scale of the highest mode, they catch the vibrations that are excited there.
    Otherwise polynomials on two levels of steps, both too coarse for them, could agree on leaving them out.

    Parameters
    ----------
    equations : Equations
    breakpoints : tuple of float
        Instants at which the manoeuvre is not smooth, s.
    end : float
        Instant at which the last step ends, s.
    graded : bool
        Whether to grade the steps, for polynomials; vibrations in closed form may start from longer, equal steps.
    """
    lowest, highest = equations.frequency_range
    phase = _FIRST_PHASE_GRADED if graded else _FIRST_PHASE
    corners = [0.0, *(each for each in breakpoints if 0.0 < each < end), end]
    edges: list[Array] = [np.zeros(1)]
    for left, right in pairwise(corners):
        count = max(1, ceil((right - left) * lowest / phase))
        if graded:
            halvings = ceil(log2(highest / lowest))
            edges.append(left + (right - left) / count * 0.5 ** np.arange(halvings, 0, -1))
        edges.append(right - (right - left) / count * np.arange(count - 1, -1, -1))
    return np.concatenate(edges)


def resolving(edges: Array, drive: Callable[[Array], Array]) -> Array:
    """Halve steps until a polynomial follows the drive on each, so that its jumps lie within very short ones.

    Parameters
    ----------
    edges : ndarray, m + 1
        Ends of the steps, s.
    drive : callable
        Torque, or acceleration of the hub, of an array of instants.
    """
    points, _ = legendre.leggauss(_POINTS)
    highest = np.linalg.inv(legendre.legvander(points, _POINTS - 1))[-2:]
    for _ in range(_PASSES):
        half = 0.5 * np.diff(edges)
        values = drive(edges[:-1, None] + half[:, None] * (1.0 + points))
        rough = np.abs(values @ highest.T).max(axis=1) > 1e-4 * np.abs(values).max()
        rough &= half > _SMALLEST * edges[-1]
        if not rough.any():
            break
        edges = np.sort(np.concatenate([edges, (edges[:-1] + half)[rough]]))
    return edges
