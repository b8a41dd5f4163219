"""Bounds, in closed form, of what undamped modes left out of a structure contribute to its response.

With modes ``V`` kept and ``W`` left out, ``D(s) = s^2 M + s C + K`` in blocks, and ``S`` the Schur complement of ``D_VV``,
the response that is lost is

    (L_W - L_V D_VV^-1 D_VW) S^-1 (B_W - D_WV D_VV^-1 B_V),   D_WV = s C_WV.

Both outer factors are loads on the modes left out: the structure's own, and those that the kept modes put on them through
the damping.  Scaled by the frequencies left out, the inverse of ``S`` is bounded by stiffness at low frequencies and by
dissipation at all.  Two bounds follow:

- :func:`tail_bound`, of all modes above a frequency, without computing them.  Damping is stiffness-proportional but for a
  few dampers, ``C = beta K + U diag(gamma) U^T``; compliances ``u^2 = |U_W / w_W|^2`` come from static solutions with the
  kept modes taken out of the loads, so that nothing cancels.  ``S`` is at least ``1 - w^2/w_W^2 - w g u^2`` by stiffness
  and ``b w`` by dissipation.
- :func:`truncation_bound`, of any modes, when all are known.  With ``X = C_WV/w_W``, ``S`` is at least
  ``1 - w^2/w_W^2 - w |X C_VV^-1 X^T|`` by stiffness and ``w`` times the smallest eigenvalue of
  ``C_WW/w_W^2 - X C_VV^-1 X^T`` by dissipation.
"""

from dataclasses import dataclass
from itertools import pairwise
from math import inf

import numpy as np
from scipy import linalg

from boomctl.arrays import Array, blocks
from boomctl.lti.frequency import resonance_grid
from boomctl.lti.modal import ModalSystem, diagonalized, side_of_axis
from boomctl.lti.rounding import ALIKE, EPS, SOLVED, SUMMED, TINY
from boomctl.lti.system import Lti
from boomctl.structure.damping import Damping
from boomctl.structure.model import SecondOrderModel

# of the stiffness, relative to the lowest mode left out: the static solution of a floating structure exists
_SHIFT = 1e-3
_INTERVALS = 400  # of the frequency axis, beside those at the resonances (a choice)
# places of their ends around a resonance, in half-widths (a choice)
_PLACES = np.array([-8.0, -3.0, -1.0, 0.0, 1.0, 3.0, 8.0])
_LOW, _HIGH = 1e-4, 100.0  # from the lowest mode left out down, from the highest pole up, cut into intervals (a choice)
# share of the damping's norm by which the dissipation may be less than computed
_ROUNDING = 1e3 * EPS


@dataclass(frozen=True)
class Loads:
    """How a structure is driven and read: ``D(s) x = (B0 + s B1) d``, outputs ``L x``."""

    B0: Array
    B1: Array
    L: Array


def loads_of(model: SecondOrderModel) -> Loads | None:
    """Return loads and rows of a model that imposes forces or displacements and reads displacements; None otherwise."""
    ports = model.ports
    plain = not any(ports.integrators) and all(b is None for b in ports.bandwidths)
    higher = any(matrix.any() for matrix in (*ports.L[1:], *ports.E[1:], ports.B[2]))
    return Loads(ports.B[0], ports.B[1], ports.L[0]) if plain and not higher else None


def tail_bound(
    model: SecondOrderModel, loads: Loads, damping: Damping, V: Array, lowest: float, core: tuple[Array, ModalSystem]
) -> float:
    """Return a bound of the response that the modes beside ``V`` add, at all frequencies; ``inf`` where there is none.

    Parameters
    ----------
    model : SecondOrderModel
        Symmetric, ``M`` positive definite.
    loads : Loads
    damping : Damping
    V : (n, k) ndarray
        Mass-normalized modes kept, all that lie below ``lowest``.
    lowest : float
        No mode left out is lower [rad/s].
    core : (k, k) ndarray, ModalSystem
        Damping among the modes kept; and from inputs ``d`` and forces ``L^T`` to displacements ``U^T x``, in modal
        coordinates.
    """
    C_V, closed = core
    gamma, U_V = damping.gamma, V.T @ damping.U
    N, rest = _at_dampers(loads.B1, damping)
    b0, b1, reads, *u = _compliances(model, V, lowest, (loads.B0, rest, loads.L.T, *damping.U.T[:, :, None]))
    coupling = damping_between(C_V, U_V * gamma)
    if coupling is None:
        return inf
    u_all = float(np.sum(np.square(u)))
    between = np.diag(gamma) - coupling
    dissipated = damping.beta - u_all * max(0.0, -float(linalg.eigvalsh(between).min(initial=0.0)))
    if dissipated <= 0.0:
        return inf
    softened = u_all * (np.abs(gamma).max(initial=0.0) + float(np.linalg.norm(coupling, 2) if len(gamma) else 0.0))
    ends = intervals(closed, lowest)
    by_outputs, by_inputs = damper_forces(closed, N, np.abs(gamma), loads.B0.shape[1], ends)
    reads, b0 = reads + np.array(u) @ by_outputs, b0 + np.array(u) @ by_inputs
    return _over_intervals(ends, reads, b0, b1, lowest=lowest, softened=softened, dissipated=dissipated)


def _over_intervals(
    ends: tuple[Array, Array],
    reads: Array,
    b0: Array,
    b1: float,
    *,
    lowest: float,
    softened: float,
    dissipated: float,
) -> float:
    """Return the largest of ``reads |S^-1| (b0 + w b1)`` over all intervals, in each of which ``reads`` and ``b0`` hold."""
    low, high = ends
    stiff = 1.0 - (high / lowest) ** 2 - high * softened
    with np.errstate(divide="ignore"):
        inverse = np.minimum(np.where(stiff > 0.0, 1.0 / stiff, inf), 1.0 / (dissipated * low))
    parts = reads * inverse * (b0 + high * b1)
    last = reads[-1] * (b0[-1] / low[-1] + b1) / dissipated  # of the open one, where the frequency cancels
    return float(max(parts[:-1].max(), last))


def intervals(closed: ModalSystem, lowest: float) -> tuple[Array, Array]:
    """Return the ends of intervals that cover the frequency axis, fine near the core's poles; the last one is open."""
    top = _HIGH * max(lowest, float(np.abs(closed.poles).max(initial=0.0)))
    upper = closed.poles[closed.poles.imag > 0.0]
    ends = resonance_grid(upper, _LOW * lowest, top, points=_INTERVALS, places=_PLACES, also=[0.0, 2.0 * top])
    return ends[:-1], ends[1:]


def _at_dampers(B1: Array, damping: Damping) -> tuple[Array, Array]:
    """Return ``N`` and what is left of ``B1 = U diag(gamma) N + rest``: motions of the dampers' far ends."""
    loaded = damping.U * damping.gamma
    if not loaded.shape[1] or not B1.any():
        return np.zeros((loaded.shape[1], B1.shape[1])), B1
    N = np.linalg.lstsq(loaded, B1, rcond=None)[0]
    rest = B1 - loaded @ N
    return N, np.where(np.abs(rest) > SOLVED * np.abs(B1).max(), rest, 0.0)


def _compliances(model: SecondOrderModel, V: Array, lowest: float, columns: tuple[Array, ...]) -> list[float]:
    """Return the square root of the largest compliance of each group of loads, over the modes left out."""
    shift = _SHIFT * lowest**2
    factor = linalg.cho_factor(model.K + shift * model.M)
    stacked = np.hstack(columns)
    for _ in range(2):
        stacked = stacked - model.M @ (V @ (V.T @ stacked))
    gram = (1.0 + _SHIFT) * (stacked.T @ linalg.cho_solve(factor, stacked))
    ends = np.cumsum([0, *(block.shape[1] for block in columns)])
    blocks = [gram[a:b, a:b] for a, b in pairwise(ends)]
    return [float(np.sqrt(max(linalg.eigvalsh(0.5 * (g + g.T)).max(initial=0.0), 0.0))) for g in blocks]


def damping_between(C_V: Array, loaded: Array) -> Array | None:
    """Return ``loaded^T C_V^-1 loaded``, or None where the kept modes do not dissipate what is loaded."""
    values, X = linalg.eigh(C_V)
    good = values > SUMMED * max(values[-1], 0.0)  # what dissipates; the rest must not be loaded but for rounding
    seen = X.T @ loaded
    if np.abs(seen[~good]).max(initial=0.0) > ALIKE * np.abs(seen).max(initial=0.0):
        return None
    return seen[good].T @ (seen[good] / values[good, None])


def damper_forces(
    closed: ModalSystem, N: Array, gamma: Array, inputs: int, ends: tuple[Array, Array]
) -> tuple[Array, Array]:
    """Return bounds of the core's damper forces over each interval, shape (dampers, intervals).

    First those that a unit force at the outputs makes, then those of a unit input.  A mode's part is at most
    ``|c| |b| w/|i w - p|``; over the open interval that stands last, ``w`` cancels or, in a unit input's, is ``high``.
    """
    low, high = ends
    poles = closed.poles[:, None]
    off = np.maximum(0.0, np.maximum(low - poles.imag, poles.imag - high))
    gain = high / np.hypot(poles.real, off)
    gain[:, -1] = low[-1] / np.maximum(low[-1] - np.abs(closed.poles), TINY)
    C = gamma[:, None] * np.abs(closed.C)
    acting, reading = (np.linalg.norm(B, axis=1) for B in (closed.B[:, :inputs], closed.B[:, inputs:]))
    ends_move = (gamma * np.linalg.norm(N, axis=1))[:, None] * high
    return C @ (reading[:, None] * gain), C @ (acting[:, None] * gain) + ends_move


def truncation_bound(stiffness: Array, C: Array, loads: Loads, kept: Array) -> float:
    """Return a bound of the response that some modes add, at all frequencies; ``inf`` where they do not dissipate.

    Parameters
    ----------
    stiffness : (n,) ndarray
        Squares of the undamped frequencies of all modes [rad^2/s^2].
    C : (n, n) ndarray
        Damping between the mass-normalized modes.
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
    ours, others = (Loads(loads.B0[k], loads.B1[k], loads.L[:, k]) for k in (kept, ~kept))
    m = loads.B0.shape[1]
    one = np.eye(kept.sum())
    closed = motions(modal_states(one, np.diag(stiffness[kept]), C[np.ix_(kept, kept)], ours, one), X)
    if closed is None or (side_of_axis(closed.poles) >= 0).any():
        return inf
    lowest = float(w.min())
    ends = intervals(closed, lowest)
    forces = damper_forces(closed, np.zeros((len(w), m)), np.ones(len(w)), m, ends)
    by_outputs, by_inputs = (np.linalg.norm(item, axis=0) for item in forces)
    b0, b1, reads = (float(np.linalg.norm(item / w[:, None], 2)) for item in (others.B0, others.B1, others.L.T))
    softened = float(np.linalg.norm(between, 2))
    reads, b0 = reads + by_outputs, b0 + by_inputs
    return _over_intervals(ends, reads, b0, b1, lowest=lowest, softened=softened, dissipated=dissipated)


def motions(core: Lti, rows: Array) -> ModalSystem | None:
    """Return the modes kept, from inputs and forces at the outputs to ``rows`` of their coordinates."""
    k = len(core.A) // 2
    B = np.hstack([core.B, np.vstack([np.zeros((k, len(core.C))), core.C[:, :k].T])])
    return diagonalized(Lti(core.A, B, np.hstack([rows, np.zeros_like(rows)]), np.zeros((len(rows), B.shape[1]))))


def modal_states(M: Array, K: Array, C: Array, loads: Loads, V: Array) -> Lti:
    """Return the kept modes with states ``x`` and ``x' - B1 d``."""
    k = V.shape[1]
    B0, B1, L = V.T @ loads.B0, V.T @ loads.B1, loads.L @ V
    inverse = np.linalg.inv(M)
    B1 = inverse @ B1
    A = blocks([[np.zeros((k, k)), np.eye(k)], [-inverse @ K, -inverse @ C]])
    return Lti(
        A,
        np.vstack([B1, inverse @ B0 - inverse @ C @ B1]),
        np.hstack([L, np.zeros_like(L)]),
        np.zeros((len(L), B0.shape[1])),
    )
