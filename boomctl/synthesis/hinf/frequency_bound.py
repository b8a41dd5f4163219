"""A level that no controller can beat, frequency by frequency.

Whatever the controller, the closed loop at one frequency is ``P11 + P12 Q P21`` with some matrix ``Q``.  The least
norm over all matrices is the larger of ``P11`` without what the controls reach and ``P11`` without what the
measurements see (Parrott 1978; Davis, Kahan & Weinberger 1982).  State feedback changes neither what the controls
reach nor the rest, and the H2-optimal one makes the reach orthonormal (Zhou, Doyle & Glover 1996, theorem 13.34), so
that an undamped mode does no harm to the digits.  Where rounding leaves the feedback short of optimal, the bound holds
nevertheless.
"""

from collections.abc import Callable

import numpy as np

from boomctl.arrays import Array
from boomctl.lti.system import Lti
from boomctl.synthesis.plants.partition import Normalised

_POINTS = 90
_ZOOMS = 4
_ZOOM = 9


def frequency_bound(ready: Normalised, F: Array, L: Array) -> tuple[float, float]:
    """Return a norm that no controller goes below, and the frequency at which that is so [rad/s], infinity included.

    ``F`` and ``L`` are H2-optimal: state feedback to the controls, output injection from the measurements.
    """
    reach = _beyond(ready.A, ready.B1, ready.B2, ready.C1, ready.D11, ready.D12, F)
    sight = _beyond(ready.A.T, ready.C1.T, ready.C2.T, ready.B1.T, ready.D11.T, ready.D21.T, L.T)
    return max(reach, sight)


def _beyond(A: Array, B1: Array, B2: Array, C1: Array, D11: Array, D12: Array, F: Array) -> tuple[float, float]:
    """Return the peak over frequency of what no control reaches, and its frequency."""
    free = len(C1) - B2.shape[1]
    if free == 0:
        return 0.0, np.inf
    last = float(np.linalg.norm(D11[:free], 2))
    if not len(A):
        return last, np.inf
    closed = A + B2 @ F
    system = Lti(closed, np.hstack([B1, B2]), C1 + D12 @ F, np.hstack([D11, D12]))

    def rest(omega: Array) -> Array:
        G = np.moveaxis(system.response(omega), 2, 0)
        inputs, reach = G[:, :, : B1.shape[1]], G[:, :, B1.shape[1] :]
        basis = np.linalg.qr(reach)[0]  # orthonormal but for rounding, which light damping and long chains magnify
        left = inputs - basis @ (np.conj(np.swapaxes(basis, 1, 2)) @ inputs)
        return np.linalg.norm(left, 2, axis=(1, 2)) if min(left.shape[1:]) > 1 else np.linalg.norm(left, axis=(1, 2))

    peak, omega = _peak(rest, np.concatenate([np.linalg.eigvals(closed), np.linalg.eigvals(A)]))
    return (peak, omega) if peak >= last else (last, np.inf)


def _peak(rest: Callable[[Array], Array], poles: Array) -> tuple[float, float]:
    size = np.abs(poles)
    size = size[size > 1e-9 * size.max()]
    low, high = (size.min(), size.max()) if len(size) else (1.0, 1.0)
    grid = np.unique(np.concatenate([[0.0], np.geomspace(low / 10.0, high * 10.0, _POINTS), np.abs(poles)]))
    values = rest(grid)
    best = int(np.argmax(values))
    peak, at = float(values[best]), float(grid[best])
    a, b = float(grid[max(best - 1, 0)]), float(grid[min(best + 1, len(grid) - 1)])
    for _ in range(_ZOOMS):
        fine = np.linspace(a, b, _ZOOM)
        values = rest(fine)
        best = int(np.argmax(values))
        if values[best] > peak:
            peak, at = float(values[best]), float(fine[best])
        a, b = float(fine[max(best - 1, 0)]), float(fine[min(best + 1, _ZOOM - 1)])
    return peak, at
