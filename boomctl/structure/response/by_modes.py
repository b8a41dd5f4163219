"""Response at many frequencies from undamped modes, with the dampers as an update of low rank.

In undamped modes the dynamic stiffness is diagonal but for the damping, which is mostly proportional to stiffness but for
a few dampers.  These are added one after the other, as updates of rank one.
"""

import numpy as np
from scipy.linalg import lapack

from boomctl.arrays import Array
from boomctl.lti.rounding import DEPENDENT, EPS, LEVEL, SOLVED, TINY
from boomctl.structure.layout import weigh
from boomctl.structure.matrices import Structure, is_symmetric
from boomctl.structure.ports import Ports
from boomctl.structure.response.modes import undamped_modes

_MAX_DAMPERS = 6  # An update of higher rank costs about as much as dense solutions.


def respond_by_modes(structure: Structure, ports: Ports, omega: Array) -> Array | None:
    """Return the response (outputs, inputs, frequencies); None without real modes, with many dampers, or if it cancels."""
    form = structure.strain_form
    if form is None and not (_is_symmetric(structure.M) and _is_symmetric(structure.K)):
        return None
    try:
        frequencies, V = undamped_modes(structure) if form is None else form.modes()
    except ValueError:
        return None
    beta, excess = structure.weights.uneven_damping()
    if excess.ndim == 2 and not is_symmetric(excess):
        return None
    dampers = np.flatnonzero(excess.any(axis=tuple(range(1, excess.ndim))))
    rows = (structure.layout.R[dampers] @ V).T
    square, mix, _ = lapack.dsyev(rows.T @ rows)  # Rows alike, as of mirror images, are one damper.
    size = np.sqrt(np.maximum(square, max(EPS * square.max(initial=0.0), TINY)))
    core = mix.T @ weigh(excess[np.ix_(*[dampers] * excess.ndim)], mix)
    gamma, turn, _ = lapack.dsyev(size[:, None] * core * size)
    uneven = np.abs(gamma) > SOLVED * np.abs(gamma).max(initial=0.0)
    if uneven.sum() > _MAX_DAMPERS:
        return None
    u = rows @ (mix / size) @ turn[:, uneven]
    B, L = (V.T @ ports.B, ports.L @ V) if form is None else form.in_modes(ports)
    (p, m), n, s = (len(ports.outputs), len(ports.inputs)), len(frequencies), 1j * omega
    acting, read = (np.flatnonzero(terms.any(axis=(1, 2))).tolist() for terms in (B, L))
    columns, lines = B[acting].transpose(1, 0, 2).reshape(n, -1), L[read].reshape(-1, n)
    sums = _receptance(frequencies**2, beta, gamma[uneven], u, lines, columns, omega)
    if sums is None:
        return None
    Y = np.zeros((p, m, len(s)), dtype=complex)
    for k, E in enumerate(ports.E):
        if E.any():
            Y += E[:, :, None] * s**k
    for a, power_L in enumerate(read):
        for b, power_B in enumerate(acting):
            part = sums[a * p : (a + 1) * p, b * m : (b + 1) * m]
            Y += part * s ** (power_L + power_B) if power_L + power_B else part
    return ports.conditioned(s, Y)


def _is_symmetric(matrix: Array) -> bool:
    """Return whether a matrix is symmetric relative to its diagonal, in any units of its coordinates."""
    diagonal = np.abs(matrix.diagonal())
    size = np.sqrt(np.maximum(diagonal, EPS * diagonal.max()))
    return bool((np.abs(matrix - matrix.T) <= SOLVED * size[:, None] * size).all())


def _receptance(
    stiffness: Array, beta: float, gamma: Array, u: Array, lines: Array, columns: Array, omega: Array
) -> Array | None:
    """Return the receptance between lines and columns in modes, (lines, columns, frequencies), by Woodbury's formula.

    Modal masses are one, damping is ``beta diag(stiffness) + u diag(gamma) u^T``.  None if digits cancel, as where
    dampers alone keep a mode finite at its own frequency.
    """
    p, m = len(lines), columns.shape[1]
    left, right = np.concatenate([lines, u.T]), np.concatenate([columns.T, u.T])
    products = (left[:, None] * right).reshape(len(left) * len(right), -1)
    damping, elastic = beta * stiffness[:, None] * omega, stiffness[:, None] - omega * omega
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        size = 1.0 / (elastic * elastic + damping * damping)
        both = np.empty((len(products), len(omega)), complex)
        both.real, both.imag = products @ (elastic * size), products @ (-damping * size)
        both = both.reshape(len(left), len(right), -1)
        before = np.abs(both[:p, :m])
        for j, factor in enumerate(gamma):  # one damper after the other
            row, pivot = both[p + j], both[p + j, m + j].copy()
            pivot.imag -= 1.0 / (factor * omega)
            both -= both[:, m + j, None] * (row / pivot)
    result = both[:p, :m]
    after = np.abs(result)
    limit = DEPENDENT * np.maximum(after, LEVEL * after.max(axis=1, keepdims=True, initial=0.0))
    return result if (EPS * before <= limit).all() else None
