"""State-space realization of a second-order model.

For a displacement input (``u = d``) the states are those of Anthonis & Ramon (2003), Eqs. (9) and (10):
``x1 = q - G d`` with ``G = M^-1 B2`` and ``x2 = x1' - H d`` with ``H = M^-1 (B1 - C G)``.  Where the velocity
(``u = d'``) or the acceleration (``u = d''``) is imposed, ``d`` and ``d'`` become states as well.
"""

from collections.abc import Callable

import numpy as np
from scipy import linalg
from scipy.linalg import lapack

from boomctl.arrays import Array
from boomctl.lti.rounding import SUMMED
from boomctl.lti.system import Lti
from boomctl.structure.matrices import Structure, is_symmetric
from boomctl.structure.ports import FILTER_DAMPING, Ports

_SINGULAR = 1e14  # condition of a scaled mass matrix from which on its inverse has no digit left: some 0.01/eps


def realize(structure: Structure, ports: Ports) -> Lti:
    """Return the state-space form of a structure with its signals, all named.

    Signals are matrices over the states and, behind them, the inputs.

    Raises
    ------
    ValueError
        The mass matrix is singular, or an output needs a derivative of an input that the realization does not have.
    """
    M, C, K = structure.matrices
    n, m, solve = len(M), len(ports.inputs), _solver(M)
    order = np.array(ports.integrators, dtype=int)
    size = 2 * n + int(order.sum())
    d = _input_signals(order, 2 * n, size + m)
    own, (_, B1, B2) = np.eye(2 * n, size + m), ports.B
    # q' lacks G d', and q'' lacks H d' + G2 d''.
    G = solve(B2 * (order == 0))
    resisted = C @ G
    H, G_velocity = solve((B1 - resisted) * (order == 0)), solve(B2 * (order == 1))
    if ports.L[1:].any() or ports.E[1:].any():
        once = ports.L[1] @ G + ports.L[2] @ H + ports.E[1] * (order < 1)
        twice = ports.L[2] @ (G + G_velocity) + ports.E[2] * (order < 2)
        if once.any() or twice.any():
            _check_proper(ports, once, twice, resisted, solve)
    q, rate = own[:n] + G @ d[0], own[n:] + H @ d[0] + G_velocity @ d[1]
    motion = np.array([q, rate, solve((ports.B @ d).sum(axis=0) - K @ q - C @ rate)])
    integrated = [d[k + 1, [i]] for i, count in enumerate(ports.integrators) for k in range(count)]
    rates = np.concatenate([*motion[1:], *integrated])
    y = (ports.L @ motion + ports.E @ d).sum(axis=0)
    states = [f"{name}.x{k}" for k in (1, 2) for name in structure.coordinates]
    for name, count in zip(ports.inputs, ports.integrators, strict=True):
        states += [f"{name}.displacement", f"{name}.velocity"][:count]
    if any(bandwidth is not None for bandwidth in ports.bandwidths):
        rates, y, filters = _filtered(
            ports, rates, y, [L @ q + E @ d[0] for L, E in zip(ports.L, ports.E, strict=True)]
        )
        states += filters
        size = len(rates)
    A, B, C, D = rates[:, :size], rates[:, size:], y[:, :size], y[:, size:]
    return Lti(A, B, C, D, ports.inputs, ports.outputs, tuple(states), scales={})


def _solver(mass: Array) -> Callable[[Array], Array]:
    """Return a solver of a mass matrix: by Cholesky's factor if it is positive definite, else by LU; nothing for zeros."""
    if (mass == np.eye(len(mass))).all():  # over modes
        return lambda rhs: rhs
    factor, failed = lapack.dpotrf(mass.T) if is_symmetric(mass) else (mass, True)
    if not failed:
        return lambda rhs: lapack.dpotrs(factor, rhs)[0] if rhs.any() else np.zeros_like(rhs)
    scale = np.sqrt(np.abs(np.diag(mass)))
    if (scale == 0).any() or np.linalg.cond(mass / np.outer(scale, scale)) > _SINGULAR:
        raise ValueError("the mass matrix is singular: a coordinate has no inertia, so there is no state-space form")
    factored = linalg.lu_factor(mass)
    return lambda rhs: linalg.lu_solve(factored, rhs) if rhs.any() else np.zeros_like(rhs)


def _input_signals(order: Array, first: int, columns: int) -> Array:
    """Return d, d', d'' as signals, zero where a derivative is not available; ``first`` is their first state."""
    parts = np.zeros((3, len(order), columns))
    for i, count in enumerate(order.tolist()):
        for derivative in range(count):
            parts[derivative, i, first] = 1.0
            first += 1
        parts[count, i, columns - len(order) + i] = 1.0
    return parts


def _check_proper(ports: Ports, once: Array, twice: Array, resisted: Array, solve: Callable[[Array], Array]) -> None:
    """Raise where an unfiltered output needs a derivative of an input that the realization does not have.

    ``once`` and ``twice`` are the coefficients of these derivatives, ``resisted`` the forces of dampers on ``G``.  They are
    compared with the sizes of rows and columns in terms of kinetic energy: what is far below these is rounding.
    """
    order = np.array(ports.integrators, dtype=int)

    def size(columns: Array) -> Array:
        return np.sqrt(np.abs(np.einsum("ij,ij->j", columns, solve(columns))))

    L1, L2 = (size(lines.T)[:, None] for lines in ports.L[1:])
    driven = size(ports.B[1] * (order == 0)) + size(resisted)
    size_once = L1 * size(ports.B[2] * (order == 0)) + L2 * driven + np.abs(ports.E[1] * (order < 1))
    size_twice = L2 * size(ports.B[2] * (order < 2)) + np.abs(ports.E[2] * (order < 2))
    moved, plain = np.array(ports.moved, dtype=bool), np.array([b is None for b in ports.bandwidths], dtype=bool)
    for value, scale, wanted in (
        (twice, size_twice, "acceleration"),
        (once, size_once, "velocity or acceleration"),
    ):
        for o, i in np.argwhere((np.abs(value) > SUMMED * scale) & moved & plain[:, None]).tolist():
            raise ValueError(
                f"output {ports.outputs[o]!r} needs a derivative of input {ports.inputs[i]!r}: impose its {wanted},"
                " give the output a bandwidth, or leave one of them out"
            )


def _filtered(ports: Ports, rates: Array, y: Array, parts: list[Array]) -> tuple[Array, Array, list[str]]:
    """Append the states of the low-pass filters of the outputs, in observer form, and return rates, outputs and names.

    ``parts`` are the outputs with no, one and two derivatives still to be taken by a filter.
    """
    bandwidths = [(o, b) for o, b in enumerate(ports.bandwidths) if b is not None]
    size, names, gaps = len(rates), [], np.zeros(2 * len(bandwidths), int)
    rates, y, position, once, twice = (np.insert(x, size + gaps, 0.0, axis=1) for x in (rates, y, *parts))
    rates = np.vstack([rates, np.zeros((len(gaps), rates.shape[1]))])
    for j, (o, b) in enumerate(bandwidths):
        z1, z2 = size + 2 * j, size + 2 * j + 1
        y[o] = b**2 * twice[o]
        y[o, z2] += 1.0
        rates[z1] = b**2 * (position[o] - y[o])
        rates[z2] = b**2 * once[o] - 2 * FILTER_DAMPING * b * y[o]
        rates[z2, z1] += 1.0
        names += [f"{ports.outputs[o]}.filter1", f"{ports.outputs[o]}.filter2"]
    return rates, y, names
