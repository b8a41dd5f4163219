"""Many frequencies of a small model at once: undamped modes, and dampers as an update of low rank.

In undamped modes the dynamic stiffness is diagonal but for the damping, and damping is mostly proportional to
stiffness but for a few dampers.  Woodbury's formula then leaves a system of as many equations as there are dampers.
Where strain rows are known, modes are found a second time among the first ones, through these rows: on a fine mesh the
first ones have lost digits that the rows still have.
The result is verified at probe frequencies and at the peaks: forces that are left over there move no output.
"""

from dataclasses import dataclass

import numpy as np
from scipy import linalg

from boomctl.arrays import Array
from boomctl.structure.damping import separated_damping
from boomctl.structure.matrices import Structure, dense
from boomctl.structure.ports import Ports, evaluate

_AGREEMENT = 1e-10  # what outputs may miss, relative, at the frequencies checked: rounding, with room (a choice)
_SAME_DAMPING = 1e-13  # of the largest damper; a smaller one is rounding of the proportional damping
_MOST_DAMPERS = 6  # an update by more costs about as much as dense solutions (a choice)
_FLOOR = 1e-6  # of a row's largest value; smaller values are compared with it, since they matter to nobody (a choice)


def respond_by_modes(structure: Structure, ports: Ports, omega: Array) -> Array | None:
    """Return the response (outputs, inputs, frequencies), or None where this way is not accurate."""
    s = 1j * omega
    used_B = [k for k in range(3) if ports.B[k].any()]
    used_L = [k for k in range(3) if ports.L[k].any()]
    if not used_B or not used_L:
        return None
    columns, lines = np.hstack([ports.B[k] for k in used_B]), np.vstack([ports.L[k] for k in used_L])
    modes = _Modes.of(structure)
    if modes is None:
        return None
    with np.errstate(divide="ignore", invalid="ignore"):
        sums = modes.receptance(lines @ modes.V, modes.V.T @ columns, s)
    if not _agrees(structure, modes, sums, lines, columns, s):
        return None
    p, m = len(ports.outputs), len(ports.inputs)
    Y = np.moveaxis(evaluate(ports.E, s), 0, 2)
    for a, power_L in enumerate(used_L):
        for b, power_B in enumerate(used_B):
            part = sums[a * p : (a + 1) * p, b * m : (b + 1) * m]
            Y = Y + (part * s ** (power_L + power_B) if power_L + power_B else part)
    if ports.plain:
        return Y
    after, before = ports.conditioning(s)
    return after.T[:, None, :] * Y * before.T[None, :, :]


@dataclass(frozen=True)
class _Modes:
    """Modes of unit stiffness, their modal masses, and the damping in them: ``beta I + u diag(gamma) u^T``.

    Modes of unit stiffness keep the digits that count: the modal masses of high modes are small, as is their part.
    """

    V: Array
    mass: Array
    beta: float
    u: Array
    gamma: Array

    @classmethod
    def of(cls, structure: Structure) -> "_Modes | None":
        """Return the modes; None for a floating structure, and where damping is not proportional but for a few."""
        known = None if structure.elastic is None else separated_damping(structure)
        try:
            mass, V = linalg.eigh(dense(structure.M), dense(structure.K), check_finite=False)
            if known is None:
                beta, u, gamma = _modal_damping(V, dense(structure.C))
            else:
                small = structure.projected(V)
                mass, mix = linalg.eigh(small.M, small.K, check_finite=False)
                V = V @ mix
                beta, u, gamma = known.beta, V.T @ known.U, known.gamma
        except linalg.LinAlgError:
            return None
        return cls(V, mass, beta, u, gamma) if len(gamma) <= _MOST_DAMPERS else None

    def receptance(self, lines: Array, columns: Array, s: Array) -> Array:
        """Return ``lines (s^2 M + s C + K)^-1 columns``, lines and columns in modes, (lines, columns, len(s))."""
        both = _pair(np.vstack([lines, self.u.T]), np.hstack([columns, self.u]), _inverse(self.mass, self.beta, s.imag))
        p, m = len(lines), columns.shape[1]
        sums = both[:p, :m]
        return sums - _update(both, p, m, self.gamma, s) if len(self.gamma) else sums


def _modal_damping(V: Array, C: Array) -> tuple[float, Array, Array]:
    """Return the damping among modes of unit stiffness as ``beta I + u diag(gamma) u^T``, found from the matrix."""
    damping = V.T @ C @ V
    size, u = np.linalg.eigh(0.5 * (damping + damping.T))
    beta = float(size[len(size) // 2])  # that of most modes
    gamma = size - beta
    apart = np.abs(gamma) > _SAME_DAMPING * np.abs(gamma).max(initial=0.0)
    return beta, u[:, apart], gamma[apart]


def _inverse(mass: Array, beta: float, omega: Array) -> Array:
    """Return ``1/(1 + i omega beta - omega^2 mass)``; divided in real numbers, which is faster than in complex ones."""
    elastic, damping = 1.0 - np.multiply.outer(mass, omega * omega), beta * omega
    size = elastic * elastic + damping * damping
    inverse = np.empty(elastic.shape, complex)
    np.divide(elastic, size, out=inverse.real)
    np.divide(-damping, size, out=inverse.imag)
    return inverse


def _pair(left: Array, right: Array, inverse: Array) -> Array:
    """Return ``left diag(inverse) right`` at each frequency."""
    products = (left[:, None, :] * right.T[None, :, :]).reshape(-1, len(inverse))
    return (products @ inverse.view(float)).view(complex).reshape(len(left), right.shape[1], -1)


def _update(both: Array, p: int, m: int, size: Array, s: Array) -> Array:
    """Return Woodbury's term of dampers of the given size.

    ``both`` pairs ``p`` lines, then the dampers, with ``m`` columns, then the dampers.
    """
    small = both[p:, m:].copy()
    for j, value in enumerate(size):
        small[j, j] += 1.0 / (value * s)
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


def _agrees(structure: Structure, modes: _Modes, sums: Array, lines: Array, columns: Array, s: Array) -> bool:
    """Return whether the forces that are left over move no output, at probe frequencies and where outputs are largest."""
    if not np.isfinite(sums).all():
        return False
    last = len(s) - 1
    peaks = np.argmax(np.abs(sums).reshape(-1, len(s)), axis=1)
    check = sorted({0, last // 2, last, *peaks.tolist()})
    at, found = s[check], sums[:, :, check]
    m = columns.shape[1]
    motion = modes.receptance(modes.V, modes.V.T @ columns, at).reshape(structure.n, -1)
    left_over = np.repeat(columns, len(at), axis=1) - structure.force(motion, np.tile(at, m))
    forces = np.moveaxis(left_over.reshape(structure.n, m, -1), 2, 0)
    missing = np.moveaxis(lines @ np.linalg.solve(structure.at(at), forces), 0, 2)
    floor = _FLOOR * np.abs(found).max(axis=1, keepdims=True)
    return bool((np.abs(missing) <= _AGREEMENT * np.maximum(np.abs(found), floor)).all())
