"""Many frequencies of small structures at once: undamped modes, and dampers as an update of low rank.

In undamped modes the dynamic stiffness is diagonal but for the damping, and damping is mostly proportional to
stiffness but for a few dampers.  Woodbury's formula then leaves a system of as many equations as there are dampers.
Where strain rows are known, modes are refined through these rows: on a fine mesh they have lost digits that the rows
still have.
The result is verified at both ends of the frequencies and at the peaks: forces that are left over there move no output.

Structures of one size, as the halves of a symmetric one mostly are, are computed together: the first index of every array
is that of the structure.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import lapack

from boomctl.arrays import Array
from boomctl.lti.rounding import SOLVED
from boomctl.structure.damping import separated_damping
from boomctl.structure.matrices import ElasticRows, Structure
from boomctl.structure.ports import Ports, evaluate

_AGREEMENT = 1e-10  # what outputs may miss, relative, at the frequencies checked: rounding, with room (a choice)
_ONE_FREQUENCY = 1e-8  # relative distance of modal masses up to which modes have one frequency: root of rounding
_MOST_DAMPERS = 6  # an update by more costs about as much as dense solutions (a choice)
_FLOOR = 1e-6  # of a row's largest value; smaller values are compared with it, since they matter to nobody (a choice)

Part = tuple[Structure, Ports]


def respond_by_modes(parts: Sequence[Part], omega: Array) -> list[Array | None]:
    """Return the response (outputs, inputs, frequencies) of each structure; None where this way is not accurate."""
    result: list[Array | None] = [None] * len(parts)
    alike: dict[object, list[tuple[int, Part, _Driven]]] = {}
    for i, part in enumerate(parts):
        driven = _Driven.of(*part)
        if driven is not None:
            alike.setdefault(driven.shape, []).append((i, part, driven))
    for group in alike.values():
        sums, good = _receptances([driven for _, _, driven in group], omega)
        for (i, (_, ports), driven), values, holds in zip(group, sums, good, strict=True):
            result[i] = _response(ports, driven, values, 1j * omega) if holds else None
    return result


def _response(ports: Ports, driven: "_Driven", sums: Array, s: Array) -> Array:
    """Return the response, summed over the derivatives that inputs act through and outputs read."""
    p, m = len(ports.outputs), len(ports.inputs)
    Y = evaluate(ports.E, s).transpose(1, 2, 0) if ports.E.any() else np.zeros((p, m, len(s)), dtype=complex)
    for a, power_L in enumerate(driven.read):
        for b, power_B in enumerate(driven.acting):
            part = sums[a * p : (a + 1) * p, b * m : (b + 1) * m]
            Y += part * s ** (power_L + power_B) if power_L + power_B else part
    if ports.plain:
        return Y
    after, before = ports.conditioning(s)
    return after.T[:, None, :] * Y * before.T[None, :, :]


@dataclass(frozen=True)
class _Driven:
    """A structure with the derivatives through which it is driven and read, and its dampers if rows tell them."""

    structure: Structure
    acting: list[int]
    read: list[int]
    columns: Array
    lines: Array
    beta: float | None
    U: Array
    gamma: Array

    @classmethod
    def of(cls, structure: Structure, ports: Ports) -> "_Driven | None":
        """Return it; None where nothing is driven or read, dampers are many, or reactions are read, which need strains."""
        if ports.tensions is not None and ports.tensions.any():
            return None
        acting, read = ports.acting, ports.read
        if not acting or not read:
            return None
        columns = ports.B[acting].transpose(1, 0, 2).reshape(structure.n, -1)
        lines = ports.L[read].reshape(-1, structure.n)
        if structure.elastic is None:
            return cls(structure, acting, read, columns, lines, None, np.zeros((structure.n, 0)), np.zeros(0))
        damping = separated_damping(structure)
        if damping is None or len(damping.gamma) > _MOST_DAMPERS:
            return None
        return cls(structure, acting, read, columns, lines, damping.beta, damping.U, damping.gamma)

    @property
    def shape(self) -> tuple[object, ...]:
        """What structures computed together have in common; one without rows is computed alone."""
        sizes = self.columns.shape, self.lines.shape, self.U.shape, tuple(self.acting), tuple(self.read)
        rows = self.structure.elastic
        return (id(self), *sizes) if rows is None else (rows.R.shape, *sizes)


def _receptances(group: list[_Driven], omega: Array) -> tuple[Array, Array]:
    """Return ``lines (s^2 M + s C + K)^-1 columns`` of each, (lines, columns, len(s)), and whether it holds."""
    M, C, K = (np.array([getattr(item.structure, name) for item in group]) for name in "MCK")
    columns, lines = np.array([item.columns for item in group]), np.array([item.lines for item in group])
    first, rows = group[0], None
    if first.structure.elastic is not None:
        weights = [item.structure.elastic for item in group]
        rows = ElasticRows(*(np.array([getattr(item, name) for item in weights]) for name in ("R", "k", "c")))
    doubtful = np.zeros(len(group)), np.zeros(len(group), dtype=bool)
    try:
        modes = _Modes.of(M, C, K, rows, group)
        if modes.gamma.shape[1] > _MOST_DAMPERS:
            return doubtful
        with np.errstate(divide="ignore", invalid="ignore"):
            sums = modes.receptance(lines @ modes.V, modes.Vt @ columns, omega)
            return (
                (sums, _hold(M, C, K, rows, modes, sums, lines, columns, omega))
                if np.isfinite(sums).all()
                else doubtful
            )
    except np.linalg.LinAlgError:  # a floating structure, or an undamped resonance at one of the frequencies
        return doubtful


@dataclass(frozen=True)
class _Modes:
    """Modes of unit stiffness, their modal masses, and the damping in them: ``beta I + u diag(gamma) u^T``.

    Modes of unit stiffness keep the digits that count: the modal masses of high modes are small, as is their part.
    """

    V: Array
    mass: Array
    beta: Array
    u: Array
    gamma: Array

    @classmethod
    def of(cls, M: Array, C: Array, K: Array, rows: ElasticRows | None, group: list[_Driven]) -> "_Modes":
        """Return the modes; a floating structure is a ``LinAlgError``."""
        mass, V = _eigen(M, K)
        if rows is None:
            mass, V = _refined(V, M, V.transpose(0, 2, 1) @ K @ V)
            beta, u, gamma = _modal_damping(V[0], C[0])
            return cls(V, mass, np.array([beta]), u[None], gamma[None])
        strain = rows.R @ V
        mass, V = _refined(V, M, strain.transpose(0, 2, 1) @ (rows.k[:, :, None] * strain))
        u = V.transpose(0, 2, 1) @ np.array([item.U for item in group])
        return cls(V, mass, np.array([item.beta for item in group]), u, np.array([item.gamma for item in group]))

    @property
    def Vt(self) -> Array:
        """The modes as rows."""
        return self.V.transpose(0, 2, 1)

    def receptance(self, lines: Array, columns: Array, omega: Array) -> Array:
        """Return the receptance between lines and columns in modes, (structures, lines, columns, frequencies).

        Frequencies are the same for all structures, (N,), or not, (structures, N).
        """
        left = np.concatenate([lines, self.u.transpose(0, 2, 1)], axis=1)
        right = np.concatenate([columns, self.u], axis=2).transpose(0, 2, 1)
        products = left[:, :, None, :] * right[:, None, :, :]
        count, p, m, n = products.shape
        products, both = products.reshape(count, p * m, n), np.empty((count, p * m, omega.shape[-1]), complex)
        real, imaginary = self.inverse(omega)
        both.real, both.imag = products @ real, products @ imaginary
        both = both.reshape(count, p, m, -1)
        p, m = lines.shape[1], columns.shape[2]
        sums = both[:, :p, :m]
        return sums - self._update(both, p, m, omega) if self.gamma.shape[1] else sums

    def inverse(self, omega: Array) -> tuple[Array, Array]:
        """Return real and imaginary part of ``1/(1 + i omega beta - omega^2 mass)``, in place: half of the time here."""
        damping = self.beta[:, None, None] * omega[..., None, :]
        real = self.mass[:, :, None] * (-omega * omega)[..., None, :]
        real += 1.0
        size = real * real
        size += damping * damping
        np.reciprocal(size, out=size)
        real *= size
        size *= -damping
        return real, size

    def _update(self, both: Array, p: int, m: int, omega: Array) -> Array:
        """Return Woodbury's term of the dampers.

        ``both`` pairs ``p`` lines, then the dampers, with ``m`` columns, then the dampers.
        """
        into, out, small = both[:, p:, :m], both[:, :p, m:], both[:, p:, m:].copy()
        for j in range(self.gamma.shape[1]):
            small[:, j, j] -= 1j / (self.gamma[:, j, None] * omega)
        if small.shape[1] == 1:
            return out * (into / small)
        if small.shape[1] == 2:
            a, b, d = small[:, 0, 0, None], small[:, 0, 1, None], small[:, 1, 1, None]
            determinant = a * d - b * b
            first = (d * out[:, :, 0] - b * out[:, :, 1]) / determinant
            second = (a * out[:, :, 1] - b * out[:, :, 0]) / determinant
            return first[:, :, None] * into[:, None, 0] + second[:, :, None] * into[:, None, 1]
        if not np.isfinite(small).all():
            return np.full(both[:, :p, :m].shape, np.nan, dtype=complex)
        solved = np.linalg.solve(np.moveaxis(small, 3, 1), np.moveaxis(into, 3, 1))
        return np.moveaxis(np.moveaxis(out, 3, 1) @ solved, 1, 3)


def _eigen(M: Array, K: Array) -> tuple[Array, Array]:
    """Return the eigenvalues and vectors of ``M v = mass K v``, vectors of unit stiffness, of each structure."""
    result = [lapack.dsygvd(mass, stiffness) for mass, stiffness in zip(M, K, strict=True)]
    if any(failed for _, _, failed in result):
        raise np.linalg.LinAlgError("a stiffness matrix is not positive definite")
    return np.array([mass for mass, _, _ in result]), np.array([V for _, V, _ in result])


def _refined(V: Array, M: Array, stiffness: Array) -> tuple[Array, Array]:
    """Return the masses of modes of unit stiffness and the modes, from nearly right ones and the stiffness between these.

    What is left between two modes is taken out to first order (Ogita & Aishima 2018); between two of one frequency there
    is nothing to take out but their stiffness.
    """
    between = V.transpose(0, 2, 1) @ M @ V
    own, n = np.arange(V.shape[2]), V.shape[2]
    mass = between[:, own, own] / stiffness[:, own, own]
    gap = mass[:, None, :] - mass[:, :, None]
    excess = np.eye(n) - stiffness
    far = np.abs(gap) > _ONE_FREQUENCY * np.maximum(mass[:, None, :], mass[:, :, None])
    change = np.where(far, (between + mass[:, None, :] * excess) / np.where(far, gap, 1.0), 0.5 * excess)
    return mass, V + V @ change


def _modal_damping(V: Array, C: Array) -> tuple[float, Array, Array]:
    """Return the damping among modes of unit stiffness as ``beta I + u diag(gamma) u^T``, found from the matrix."""
    damping = V.T @ C @ V
    size, u = np.linalg.eigh(0.5 * (damping + damping.T))
    beta = float(size[len(size) // 2])  # that of most modes
    gamma = size - beta
    apart = np.abs(gamma) > SOLVED * np.abs(gamma).max(initial=0.0)
    return beta, u[:, apart], gamma[apart]


def _hold(
    M: Array,
    C: Array,
    K: Array,
    rows: ElasticRows | None,
    modes: _Modes,
    sums: Array,
    lines: Array,
    columns: Array,
    omega: Array,
) -> Array:
    """Return whether forces left over move no output, at both ends of the frequencies and where outputs are largest."""
    last = len(omega) - 1
    size = np.abs(sums).max(axis=2)  # of each line, over its columns
    chosen = [sorted({0, last, *peaks}) for peaks in size.argmax(axis=2).tolist()]
    most = max(len(places) for places in chosen)
    check = np.array([places + places[-1:] * (most - len(places)) for places in chosen])
    result = np.array([values[:, :, places] for values, places in zip(sums, check, strict=True)])
    s = 1j * omega[check][:, None, None, :]
    X = modes.receptance(modes.V, modes.Vt @ columns, omega[check])
    force = s**2 * _times(M, X)
    if rows is None:
        force += s * _times(C, X) + _times(K, X)
    else:
        tension = (rows.k[:, :, None, None] + rows.c[:, :, None, None] * s) * _times(rows.R, X)
        force += _times(rows.R.transpose(0, 2, 1), tension)
    at = s.reshape(len(sums), -1, 1, 1)
    D = at**2 * M[:, None] + at * C[:, None] + K[:, None]
    missing = lines[:, None] @ np.linalg.solve(D, (columns[:, :, :, None] - force).transpose(0, 3, 1, 2))
    floor = _FLOOR * np.abs(result).max(axis=2, keepdims=True)
    within = np.abs(missing.transpose(0, 2, 3, 1)) <= _AGREEMENT * np.maximum(np.abs(result), floor)
    return within.all(axis=(1, 2, 3))


def _times(matrix: Array, motion: Array) -> Array:
    """Return a real matrix times complex motions, (structures, n, columns, frequencies), multiplied in real numbers."""
    count, n, m, points = motion.shape
    return (
        (matrix @ np.ascontiguousarray(motion).reshape(count, n, m * points).view(float))
        .view(complex)
        .reshape(count, -1, m, points)
    )
