"""Motions to rounding, for references: Gragg's modified midpoint rule, extrapolated as Bulirsch and Stoer do.

It shares nothing with this package's solvers, nor with the integrators that these are compared with.

Source: Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I, section II.9.
"""

from collections.abc import Callable
from typing import Any

_COLUMNS = 8  # of the extrapolation: order 16


def extrapolated_step(rate: Callable[[Any, Any], Any], x: Any, t: Any, h: Any, columns: int = _COLUMNS) -> Any:
    """Return the state after a step, of midpoint rules of 2, 4, 6, ... parts, as a CasADi expression.

    Their errors are series in the square of a part.
    """
    found = []
    for count in range(1, columns + 1):
        part = h / (2 * count)
        before, now = x, x + part * rate(x, t)
        for i in range(1, 2 * count):
            before, now = now, before + 2.0 * part * rate(now, t + i * part)
        found.append(now)
    for column in range(1, columns):
        for i in range(columns - 1, column - 1, -1):
            ratio = ((i + 1) / (i + 1 - column)) ** 2
            found[i] = found[i] + (found[i] - found[i - 1]) / (ratio - 1.0)
    return found[-1]
