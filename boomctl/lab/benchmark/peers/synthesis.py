"""Controllers by other programs: slycot's SB10AD, and SciPy's simplex search over a gain."""

from typing import Any

import numpy as np
from scipy.optimize import minimize

from boomctl.arrays import Array
from boomctl.lti.python_control import control

_LARGEST = 1e3  # entry of a gain


def sb10ad(
    P: control.StateSpace, nmeas: int, ncon: int, job: int, level: float, gtol: float = 0.0
) -> control.StateSpace:
    """Return slycot's controller: job 1 bisects from a level, job 4 takes the level."""
    import slycot

    matrices = (np.array(part, dtype=float, order="F") for part in (P.A, P.B, P.C, P.D))
    found = slycot.sb10ad(P.nstates, P.ninputs, P.noutputs, ncon, nmeas, level, *matrices, job, gtol, 0.0)
    return control.ss(*found[1:5])


def simplex_gain(P: control.StateSpace, nmeas: int, ncon: int, n_starts: int) -> Array:
    """Return the best gain of some starts of Nelder and Mead's search for the least norm of the loop, by ``linfnorm``.

    Where the loop is unstable, the search lowers the real part of its poles, which counts as large.
    """

    def value(entries: Array) -> float:
        loop = P.lft(control.ss([], [], [], entries.reshape(ncon, nmeas)), ncon, nmeas)
        abscissa = float(loop.poles().real.max())
        return 1e3 * (1.0 + abscissa) if abscissa >= 0.0 else float(control.linfnorm(loop)[0])

    rng, found = np.random.default_rng(0), []
    options: dict[str, Any] = {"method": "Nelder-Mead", "bounds": [(-_LARGEST, _LARGEST)] * (ncon * nmeas)}
    for _ in range(n_starts):
        found.append(minimize(value, rng.standard_normal(ncon * nmeas), **options))
    return min(found, key=lambda each: each.fun).x.reshape(ncon, nmeas)
