"""Points of a box of parameters: as text, and the worst of them that a search visits."""

from collections.abc import Callable
from itertools import product
from math import inf

import numpy as np

from boomctl.arrays import Array
from boomctl.chebyshev import FEW_PARAMETERS
from boomctl.lti.rounding import ALIKE

_STEPS = (0.5, 0.25, 0.125, 0.0625)  # of a pattern search, in half-widths of the box (a choice)


def listed_values(values: dict[str, float]) -> str:
    """Return values of parameters as text."""
    return ", ".join(f"{name} = {value:.5g}" for name, value in values.items())


def pattern_search(
    value: Callable[[Array], float], size: int, factor: float, start: Array | None = None, enough: float = inf
) -> tuple[Array, float, int]:
    """Return where in the box ``value`` is largest among the points a pattern search visits.

    It begins at a point, or at the worst of the box's middle, the middles of its faces, and its corners: of 400 random boxes
    of 2 to 5 parameters a lattice of three to the power of these found the worst in no more (measured).  Of more than
    `FEW_PARAMETERS` the corner between the worse faces is tried alone.  It ends where a value is ``enough``.
    """
    faces = np.kron(np.eye(size), [[-1.0], [1.0]])
    corners = list(product((-1.0, 1.0), repeat=size)) if 1 < size <= FEW_PARAMETERS else np.zeros((0, size))
    # a zero has no sign here: places are told apart by their bits
    begins = [*(factor * np.concatenate([np.zeros((1, size)), faces, corners]) + 0.0)] if start is None else [start]
    at, top, values = begins[0], -inf, []
    while len(values) < len(begins) and top < enough:
        point = begins[len(values)]
        values.append(value(point))
        if values[-1] > top:
            at, top = point, values[-1]
        if len(values) == 1 + 2 * size and size > FEW_PARAMETERS and start is None:
            low, high = np.array(values[1:]).reshape(size, 2).T
            begins.append(np.where(high > low, factor, -factor))
    tried = len(values)
    for step in _STEPS:
        moved = top < enough
        while moved:
            moved = False
            for axis, sign in product(range(size), (-1.0, 1.0)):
                point = at.copy()
                point[axis] = np.clip(point[axis] + sign * step * factor, -factor, factor)
                if (point == at).all():
                    continue
                tried += 1
                result = value(point)
                # by how much a point must be worse than the worst so far, relative, to be gone to: more than rounding
                if result > top * (1.0 + ALIKE * np.sign(top)):
                    at, top, moved = point, result, result < enough
    return at, top, tried
