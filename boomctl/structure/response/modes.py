"""Response at many frequencies from undamped modes, with the dampers as an update of low rank.

In undamped modes the dynamic stiffness is diagonal but for the damping, which is mostly proportional to stiffness but for
a few dampers.  These are added one after the other, as updates of rank one.  Where strain rows are known, modes are refined
through these rows, which keep digits that the stiffness matrix of a fine mesh has lost.
The result is verified at both ends of the frequencies and at the peaks by its residual forces.
"""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import lapack

from boomctl.arrays import Array
from boomctl.lti.rounding import EPS, SOLVED
from boomctl.structure.damping import uneven_damping
from boomctl.structure.layout import weigh
from boomctl.structure.matrices import Structure
from boomctl.structure.ports import Ports

_RESIDUAL_RTOL = 1e-10  # Largest change of an output by the residual forces, relative.
_EQUAL_MASS_RTOL = 1e-8  # Relative distance of modal masses up to which modes have one frequency: root of rounding.
_MAX_DAMPERS = 6  # An update of higher rank costs about as much as dense solutions.
_FLOOR = 1e-6  # Of the largest value of a row: smaller values are compared with it.


def respond_by_modes(structure: Structure, ports: Ports, omega: Array) -> Array | None:
    """Return the response (outputs, inputs, frequencies); None where modes are not accurate enough."""
    p, m, n = len(ports.outputs), len(ports.inputs), structure.n
    acting, read = (np.flatnonzero(terms.any(axis=(1, 2))).tolist() for terms in (ports.B, ports.L))
    if not acting or not read or (ports.tensions is not None and ports.tensions.any()):
        return None  # Reactions need strains.
    columns, lines = ports.B[acting].transpose(1, 0, 2).reshape(n, -1), ports.L[read].reshape(-1, n)
    with np.errstate(divide="ignore", invalid="ignore"):
        try:
            modes = _Modes.of(structure)
            if modes is None:
                return None
            sums = modes.receptance(lines @ modes.V, modes.V.T @ columns, omega)
            if not np.isfinite(sums).all() or not _is_accurate(structure, modes, sums, lines, columns, omega):
                return None
        except np.linalg.LinAlgError:  # A floating structure, or an undamped resonance at one of the frequencies.
            return None
    s = 1j * omega
    Y = np.zeros((p, m, len(s)), dtype=complex)
    for k, E in enumerate(ports.E):
        if E.any():
            Y += E[:, :, None] * s**k
    for a, power_L in enumerate(read):
        for b, power_B in enumerate(acting):
            part = sums[a * p : (a + 1) * p, b * m : (b + 1) * m]
            Y += part * s ** (power_L + power_B) if power_L + power_B else part
    return ports.conditioned(s, Y)


@dataclass(frozen=True)
class _Modes:
    """Modes of unit stiffness, their modal masses, and the damping in them: ``beta I + u diag(gamma) u^T``.

    Modes of unit stiffness keep significant digits: the modal masses of high modes are small, as is their contribution.
    """

    V: Array
    mass: Array
    beta: float
    u: Array
    gamma: Array

    @classmethod
    def of(cls, structure: Structure) -> "_Modes | None":
        """Return the modes; None if dampers are many.  A floating structure is a ``LinAlgError``."""
        R, weights = structure.layout.R, structure.weights
        _, V, failed = lapack.dsygvd(structure.M, structure.K)
        if failed:
            raise np.linalg.LinAlgError("a stiffness matrix is not positive definite")
        strain = R @ V
        mass, V = _refined(V, structure.M, strain.T @ weigh(weights.k, strain))
        beta, excess = uneven_damping(structure)
        dampers = np.flatnonzero(excess.any(axis=tuple(range(1, excess.ndim))))
        excess = excess[np.ix_(*[dampers] * excess.ndim)]
        rows = (R[dampers] @ V).T
        square, mix, _ = lapack.dsyev(rows.T @ rows)  # rows alike, as of mirror images, are one damper
        size = np.sqrt(np.maximum(square, EPS * square.max(initial=0.0)))
        gamma, u, _ = lapack.dsyev(size[:, None] * (mix.T @ weigh(excess, mix)) * size)
        uneven = np.abs(gamma) > SOLVED * np.abs(gamma).max(initial=0.0)
        u = rows @ (mix / size) @ u[:, uneven]
        return cls(V, mass, beta, u, gamma[uneven]) if uneven.sum() <= _MAX_DAMPERS else None

    def receptance(self, lines: Array, columns: Array, omega: Array) -> Array:
        """Return the receptance between lines and columns in modes, (lines, columns, frequencies), by Woodbury's formula."""
        p, m = len(lines), columns.shape[1]
        left, right = np.concatenate([lines, self.u.T]), np.concatenate([columns.T, self.u.T])
        products = (left[:, None] * right).reshape(len(left) * len(right), -1)
        damping, elastic = self.beta * omega, 1.0 - self.mass[:, None] * (omega * omega)
        size = 1.0 / (elastic * elastic + damping * damping)
        both = np.empty((len(products), len(omega)), complex)
        both.real, both.imag = products @ (elastic * size), products @ (-damping * size)
        both = both.reshape(len(left), len(right), -1)
        for j, gamma in enumerate(self.gamma):  # one damper after the other
            row, pivot = both[p + j], both[p + j, m + j].copy()
            pivot.imag -= 1.0 / (gamma * omega)
            both -= both[:, m + j, None] * (row / pivot)
        return both[:p, :m]


def _refined(V: Array, M: Array, stiffness: Array) -> tuple[Array, Array]:
    """Return the masses of modes of unit stiffness and the modes, from nearly right ones and the stiffness between these.

    The coupling of two modes is removed to first order (Ogita & Aishima 2018); that of two of one frequency is their
    stiffness alone.
    """
    between = V.T @ M @ V
    mass = between.diagonal() / stiffness.diagonal()
    gap = mass - mass[:, None]
    excess = np.eye(len(mass)) - stiffness
    far = np.abs(gap) > _EQUAL_MASS_RTOL * np.maximum(mass, mass[:, None])
    change = np.where(far, (between + mass * excess) / np.where(far, gap, 1.0), 0.5 * excess)
    return mass, V + V @ change


def _is_accurate(structure: Structure, modes: _Modes, sums: Array, lines: Array, columns: Array, omega: Array) -> bool:
    """Return whether residual forces change no output, at both ends of the frequencies and where outputs are largest."""
    peaks = np.abs(sums).max(axis=1).argmax(axis=1)
    check = sorted({0, len(omega) - 1, *peaks.ravel().tolist()})
    s, (n, m) = 1j * omega[check], columns.shape
    X = modes.receptance(modes.V, modes.V.T @ columns, omega[check]).reshape(n, -1)
    strain, powers = structure.layout.R @ X, np.tile(s, m)
    elastic = weigh(structure.weights.k, strain) + powers * weigh(structure.weights.c, strain)
    forces = powers**2 * (structure.M @ X) + structure.layout.R.T @ elastic
    residual = columns[:, :, None] - forces.reshape(n, m, -1)
    change = np.abs(lines @ np.linalg.solve(structure.at(s), residual.transpose(2, 0, 1)))
    size = np.abs(sums[:, :, check].transpose(2, 0, 1))
    size = np.maximum(size, _FLOOR * size.max(axis=2, keepdims=True))
    return bool((change <= _RESIDUAL_RTOL * size).all())
