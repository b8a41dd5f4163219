"""Points of a box of parameters: text form, and pattern search for the worst one."""

from collections.abc import Callable
from itertools import product
from math import inf

import numpy as np

from boomctl.arrays import Array
from boomctl.chebyshev import FEW_PARAMETERS
from boomctl.lti.rounding import ALIKE

_STEPS = (0.5, 0.25, 0.125, 0.0625)  # Step lengths of the pattern search, in half-widths of the box.


def listed_values(values: dict[str, float]) -> str:
    """Return parameter values as text."""
    return ", ".join(f"{name} = {value:.5g}" for name, value in values.items())


def pattern_search(
    value: Callable[[Array], float], size: int, start: Array | None = None, enough: float = inf
) -> tuple[Array, float, int]:
    """Return the point of a pattern search at which ``value`` is largest, that value, and the number of evaluations.

    The search starts at ``start``, or at the worst of the midpoint of the box, the midpoints of its faces, and its vertices.
    With more than `FEW_PARAMETERS` parameters only the vertex between the worse faces is evaluated.  The search stops at a
    value of at least ``enough``.
    """
    faces = np.kron(np.eye(size), [[-1.0], [1.0]])
    corners = list(product((-1.0, 1.0), repeat=size)) if 1 < size <= FEW_PARAMETERS else np.zeros((0, size))
    # Adding 0.0 removes negative zeros: callers cache values by the bytes of a point.
    begins = [*(np.concatenate([np.zeros((1, size)), faces, corners]) + 0.0)] if start is None else [start]
    at, top, values = begins[0], -inf, []
    while len(values) < len(begins) and top < enough:
        point = begins[len(values)]
        values.append(value(point))
        if values[-1] > top:
            at, top = point, values[-1]
        if len(values) == 1 + 2 * size and size > FEW_PARAMETERS and start is None:
            low, high = np.array(values[1:]).reshape(size, 2).T
            begins.append(np.where(high > low, 1.0, -1.0))
    count = len(values)
    for step in _STEPS:
        moved = top < enough
        while moved:
            moved = False
            for axis, sign in product(range(size), (-1.0, 1.0)):
                point = at.copy()
                point[axis] = np.clip(point[axis] + sign * step, -1.0, 1.0)
                if (point == at).all():
                    continue
                count += 1
                result = value(point)
                # Accept a point only if its value exceeds the largest one by more than rounding error.
                if result > top * (1.0 + ALIKE * np.sign(top)):
                    at, top, moved = point, result, result < enough
    return at, top, count
