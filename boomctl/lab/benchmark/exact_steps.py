"""Steps exact to rounding, for references: extrapolated midpoint rules, and linear maps in extended precision.

The modified midpoint rule is Gragg's, extrapolated as Bulirsch and Stoer do.  It shares nothing with this package's
solvers, nor with the integrators that these are compared with.

Source: Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I, section II.9.
"""

from collections.abc import Callable
from typing import Any

import numpy as np

from boomctl.arrays import Array

_COLUMNS = 8  # of the extrapolation: order 16
_SERIES_TERMS = 22  # of the series of exp(X) with |X| <= 1/8: what follows is below 1e-40


def extrapolated_step(rate: Callable[[Any, Any], Any], x: Any, t: Any, h: Any, columns: int = _COLUMNS) -> Any:
    """Return the state after a step, of midpoint rules of 2, 4, 6, ... parts, as a CasADi expression.

    Their errors are series in the square of a part.
    """
    result = []
    for count in range(1, columns + 1):
        part = h / (2 * count)
        before, now = x, x + part * rate(x, t)
        for i in range(1, 2 * count):
            before, now = now, before + 2.0 * part * rate(now, t + i * part)
        result.append(now)
    for column in range(1, columns):
        for i in range(columns - 1, column - 1, -1):
            ratio = ((i + 1) / (i + 1 - column)) ** 2
            result[i] = result[i] + (result[i] - result[i - 1]) / (ratio - 1.0)
    return result[-1]


def extended_maps(A: Array, B: Array, h: float) -> tuple[Array, Array, Array]:
    """Return ``exp(A h)``, ``int exp(A s) ds B`` and ``int exp(A (h - s)) s ds B / h`` in extended precision."""
    n, m = B.shape
    big = np.zeros((n + 2 * m, n + 2 * m), dtype=np.longdouble)
    big[:n, :n], big[:n, n : n + m] = A * np.longdouble(h), B * np.longdouble(h)
    big[n : n + m, n + m :] = np.eye(m)
    halvings = max(0, int(np.ceil(np.log2(float(np.abs(big).sum(axis=1).max())))) + 3)
    small = big / np.longdouble(2.0) ** halvings
    total = np.eye(len(big), dtype=np.longdouble)
    term = total.copy()
    for k in range(1, _SERIES_TERMS):
        term = term @ small / np.longdouble(k)
        total = total + term
    for _ in range(halvings):
        total = total @ total
    return total[:n, :n], total[:n, n : n + m], total[:n, n + m :]
