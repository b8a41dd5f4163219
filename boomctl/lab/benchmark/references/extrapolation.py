"""Motions to rounding, for references: Gragg's modified midpoint rule, extrapolated as Bulirsch and Stoer do.

It shares nothing with this package's solvers, nor with the integrators that these are compared with.

Source: Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I, section II.9.
"""

from collections.abc import Callable
from typing import Any

import numpy as np

from boomctl.arrays import Array
from boomctl.lab.benchmark.peers.integrators import Ode

_COLUMNS = 8  # of the extrapolation: order 16, at which 600 steps in 6 s leave 5e-13 of SFOAM with 5 modes (measured)


def extrapolated(equations: Ode, timepts: Array, substeps: int, columns: int = _COLUMNS) -> Array:
    """Return the tip's displacement in equal steps of order ``2 columns``.

    Parameters
    ----------
    equations : Ode
        Smooth between any two instants; the motion starts from rest.
    timepts : ndarray, k
        Instants, equally spaced from 0 [s].
    substeps : int
        Steps from an instant to the next.
    columns : int
        Of the extrapolation.

    Returns
    -------
    ndarray, k
        In m.
    """
    import casadi as ca

    h = float(timepts[1] - timepts[0]) / substeps
    rate = ca.Function("rate", [equations.x, equations.t], [equations.ode], {"cse": True})
    x, t = ca.SX.sym("x", equations.x.numel()), ca.SX.sym("t")
    step = ca.Function("step", [x, t], [extrapolated_step(rate, x, t, h, columns)])
    state = np.zeros(equations.x.numel())
    tip = np.zeros(timepts.size)
    for k in range(1, timepts.size):
        for i in range(substeps):
            state = step(state, ((k - 1) * substeps + i) * h)
        tip[k] = equations.tip @ np.array(state).ravel()
    return tip


def extrapolated_step(rate: Callable[[Any, Any], Any], x: Any, t: Any, h: Any, columns: int = _COLUMNS) -> Any:
    """Return the state after a step, of midpoint rules of 2, 4, 6, ... parts.

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
