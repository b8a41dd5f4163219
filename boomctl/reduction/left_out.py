"""A bound, known beforehand, of what undamped modes left out of a structure contribute, whatever modes they are.

With modes ``V`` kept and ``W`` left out, ``D(s) = s^2 + s C + diag(w^2)`` and its Schur complement ``S``, the response
that is lost is ``(L_W - L_V D_VV^-1 D_VW) S^-1 (B_W - D_WV D_VV^-1 B_V)`` with ``D_WV = s C_WV``. Scaled by the
frequencies left out, ``S`` is at least ``1 - w^2/w_W^2 - w |X C_VV^-1 X^T|``, ``X = C_WV/w_W``, by stiffness, and at
least ``w`` times the smallest eigenvalue of ``C_WW/w_W^2 - X C_VV^-1 X^T`` by dissipation.
"""

from math import inf

import numpy as np
from scipy import linalg

from boomctl.arrays import Array
from boomctl.lti.modal import ModalSystem, diagonalized
from boomctl.lti.system import Lti
from boomctl.reduction.core import core_states
from boomctl.reduction.structural_tail import Loads, damper_forces, damping_between, intervals

_ROUNDING = 1e3 * float(np.finfo(float).eps)


def left_out_bound(stiffness: Array, C: Array, loads: Loads, kept: Array) -> float:
    """Return a bound of the response that some modes add, at all frequencies; ``inf`` where they do not dissipate.

    Parameters
    ----------
    stiffness : (n,) ndarray
        Squares of the undamped frequencies of all modes [rad^2/s^2].
    C : (n, n) ndarray
        Damping between the mass-normalised modes.
    loads : Loads
        On the modes.
    kept : (n,) ndarray of bool
        Which modes are not left out.
    """
    if kept.all():
        return 0.0
    w = np.sqrt(np.maximum(stiffness[~kept], 0.0))
    if not w.min() > 0.0:
        return inf
    X = C[np.ix_(~kept, kept)] / w[:, None]
    between = damping_between(C[np.ix_(kept, kept)], X.T)
    if between is None:
        return inf
    own = C[np.ix_(~kept, ~kept)] / np.outer(w, w)
    dissipated = float(linalg.eigvalsh(own - between).min()) - _ROUNDING * float(np.linalg.norm(own))
    if dissipated <= 0.0:
        return inf
    ours, others = _only(loads, kept), _only(loads, ~kept)
    m = loads.B0.shape[1]
    closed = _motions(stiffness[kept], C[np.ix_(kept, kept)], ours, X)
    if closed is None or (closed.poles.real >= 0.0).any():
        return inf
    low, high = intervals(closed, float(w.min()))
    stiff = 1.0 - (high / w.min()) ** 2 - high * float(np.linalg.norm(between, 2))
    with np.errstate(divide="ignore"):
        inverse = np.minimum(np.where(stiff > 0.0, 1.0 / stiff, inf), 1.0 / (dissipated * low))
    forces = damper_forces(closed, np.zeros((len(w), m)), np.ones(len(w)), m, (low, high))
    by_outputs, by_inputs = (np.linalg.norm(each, axis=0) for each in forces)
    b0, b1, reads = (float(np.linalg.norm(each / w[:, None], 2)) for each in (others.B0, others.B1, others.L.T))
    parts = (reads + by_outputs) * inverse * (b0 + by_inputs + high * b1)
    last = (reads + by_outputs[-1]) * ((b0 + by_inputs[-1]) / low[-1] + b1) / dissipated
    return float(max(parts[:-1].max(), last))


def _motions(stiffness: Array, C: Array, loads: Loads, rows: Array) -> ModalSystem | None:
    """Return the modes kept, from inputs and forces at the outputs to ``rows`` of their coordinates."""
    k, m, p, r = len(stiffness), loads.B0.shape[1], len(loads.L), len(rows)
    core = core_states(np.eye(k), np.diag(stiffness), C, loads, np.eye(k))
    B = np.hstack([core.B, np.vstack([np.zeros((k, p)), loads.L.T])])
    return diagonalized(Lti(core.A, B, np.hstack([rows, np.zeros((r, k))]), np.zeros((r, m + p))))


def _only(loads: Loads, chosen: Array) -> Loads:
    return Loads(loads.B0[chosen], loads.B1[chosen], loads.L[:, chosen])
