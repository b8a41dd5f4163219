"""Many frequencies of a small model at once: undamped modes, and dampers as an update of low rank.

In undamped modes the dynamic stiffness is diagonal but for the damping, and damping is mostly proportional to
stiffness but for a few dampers.  Woodbury's formula then leaves a system of as many equations as there are dampers.
The result is verified against direct solutions at probe frequencies and at the peaks.
"""

import numpy as np
from scipy import linalg

from boomctl.arrays import Array
from boomctl.structure.matrices import Structure, dense
from boomctl.structure.ports import Ports, evaluate

_AGREEMENT = (  # with a dense solution, relative: what rounding takes of both, with room (a choice)
    1e-10  # with a dense solution, relative, that is asked for: what both lose to rounding, with room (a choice)
)
_PROBES = 3  # frequencies checked beside the peaks: the first, the middle, the last (a choice)
_MOST_DAMPERS = 6  # an update by more costs about as much as dense solutions (a choice)
_SAME_DAMPING = 1e-13  # of the largest damper; a smaller one is rounding of the proportional damping
_FLOOR = 1e-6  # of a row's largest value; smaller values are compared with it, since they matter to nobody (a choice)


def respond_by_modes(structure: Structure, ports: Ports, omega: Array) -> Array | None:
    """Return the response (outputs, inputs, frequencies), or None where this way is not accurate."""
    s = 1j * omega
    used_B = [k for k in range(3) if ports.B[k].any()]
    used_L = [k for k in range(3) if ports.L[k].any()]
    if not used_B or not used_L:
        return None
    columns, lines = np.hstack([ports.B[k] for k in used_B]), np.vstack([ports.L[k] for k in used_L])
    sums = _receptance(structure, lines, columns, s)
    if sums is None:
        return None
    p, m = len(ports.outputs), len(ports.inputs)
    Y = np.moveaxis(evaluate(ports.E, s), 0, 2)
    for a, power_L in enumerate(used_L):
        for b, power_B in enumerate(used_B):
            part = sums[a * p : (a + 1) * p, b * m : (b + 1) * m]
            Y = Y + (part * s ** (power_L + power_B) if power_L + power_B else part)
    after, before = ports.conditioning(s)
    return after.T[:, None, :] * Y * before.T[None, :, :]


def _modes(structure: Structure) -> tuple[Array, Array, Array] | None:
    """Return modes with unit modal stiffness, their modal masses and their damping; None for a floating structure.

    Modes of unit stiffness keep the digits that count: the modal masses of high modes are small, as is their part.
    """
    M, C, K = (dense(matrix) for matrix in (structure.M, structure.C, structure.K))
    try:
        mass, V = linalg.eigh(M, K, check_finite=False)
    except linalg.LinAlgError:
        return None
    damping = V.T @ C @ V
    return V, mass, 0.5 * (damping + damping.T)


def _receptance(structure: Structure, lines: Array, columns: Array, s: Array) -> Array | None:
    """Return ``lines (s^2 M + s C + K)^-1 columns``, (lines, columns, len(s)), or None if a probe disagrees."""
    found = _modes(structure)
    if found is None:
        return None
    V, mass, damping = found
    size, U = np.linalg.eigh(damping)
    beta = float(np.median(size))
    size = size - beta
    large = np.abs(size) > _SAME_DAMPING * np.abs(size).max(initial=np.finfo(float).tiny)
    if large.sum() > _MOST_DAMPERS:
        return None
    left, right = np.vstack([lines @ V, U[:, large].T]), np.hstack([V.T @ columns, U[:, large]])
    with np.errstate(divide="ignore", invalid="ignore"):
        inverse = 1.0 / ((1.0 + beta * s)[None, :] + mass[:, None] * (s * s)[None, :])
        both = _pair(left, right, inverse)
        sums = both[: len(lines), : columns.shape[1]]
        if large.any():
            sums = sums - _update(both, len(lines), columns.shape[1], size[large], s)
    return sums if _agrees(structure, sums, lines, columns, s) else None


def _pair(left: Array, right: Array, inverse: Array) -> Array:
    """Return ``left diag(inverse) right`` at each frequency."""
    products = (left[:, None, :] * right.T[None, :, :]).reshape(-1, len(inverse))
    return (products @ inverse.view(float)).view(complex).reshape(len(left), right.shape[1], -1)


def _update(both: Array, p: int, m: int, size: Array, s: Array) -> Array:
    """Return Woodbury's term of dampers of the given size.

    ``both`` pairs ``p`` lines, then the dampers, with ``m`` columns, then the dampers.
    """
    small = both[p:, m:] + np.eye(len(size))[:, :, None] / (size[:, None, None] * s)
    into, out = both[p:, :m], both[:p, m:]
    if len(size) == 1:
        return out * (into / small)
    if len(size) == 2:
        (a, b), (c, d) = small
        determinant = a * d - b * c
        first, second = (d * into[0] - b * into[1]) / determinant, (a * into[1] - c * into[0]) / determinant
        return out[:, 0, None] * first + out[:, 1, None] * second
    if not np.isfinite(small).all():
        return np.full((p, m, len(s)), np.nan, dtype=complex)
    solved = np.linalg.solve(np.moveaxis(small, 2, 0), np.moveaxis(into, 2, 0))
    return np.moveaxis(np.moveaxis(out, 2, 0) @ solved, 0, 2)


def _agrees(structure: Structure, sums: Array, lines: Array, columns: Array, s: Array) -> bool:
    """Compare with direct solutions at probe frequencies and where the response is largest."""
    if not np.isfinite(sums).all():
        return False
    probes = np.linspace(0, len(s) - 1, _PROBES).astype(int)
    peaks = np.argmax(np.abs(sums).reshape(-1, len(s)), axis=1)
    check = np.unique(np.concatenate([probes, peaks]))
    at = s[check]
    truth = np.moveaxis(lines @ np.linalg.solve(structure.at(at), columns.astype(complex)), 0, 2)
    floor = _FLOOR * np.abs(truth).max(axis=1, keepdims=True)
    return bool((np.abs(sums[:, :, check] - truth) <= _AGREEMENT * np.maximum(np.abs(truth), floor)).all())
