"""State-space realisation of a second-order model.

For a displacement input (``u = d``) the states are those of Anthonis & Ramon (2003), Eqs. (9) and (10):
``x1 = q - G d`` with ``G = M^-1 B2`` and ``x2 = x1' - H d`` with ``H = M^-1 (B1 - C G)``.  Where the velocity
(``u = d'``) or the acceleration (``u = d''``) is imposed, ``d`` and ``d'`` become states as well.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
from scipy import linalg

from boomctl.arrays import Array, blocks
from boomctl.lti.rounding import SUMMED
from boomctl.lti.system import Lti
from boomctl.structure.matrices import Structure, dense, is_symmetric
from boomctl.structure.ports import FILTER_DAMPING, Ports
from boomctl.structure.response.pencil import Solve, factorized_dense

_SINGULAR = 1e14  # condition of a scaled mass matrix from which on its inverse has no digit left: some 0.01/eps


@dataclass(frozen=True)
class _Signal:
    """A vector signal as a combination of states and inputs, ``X x + U u``."""

    X: Array
    U: Array

    def __add__(self, other: "_Signal") -> "_Signal":
        return _Signal(self.X + other.X, self.U + other.U)

    def through(self, matrix: Array) -> "_Signal":
        return _Signal(matrix @ self.X, matrix @ self.U)


@dataclass(frozen=True)
class _Dynamics:
    """State equation, coordinates and inputs with derivatives, and the coefficients of the derivatives not there.

    ``missing`` is ``(G, H, G2)``: q' lacks ``G d'``; q'' lacks ``H d' + G2 d''``.
    ``felt`` tells how much of ``d'`` and ``d''`` each output could feel (outputs, inputs), by the size of its row and of the
    input's columns in terms of kinetic energy: what is far below it is rounding.
    """

    A: Array
    B: Array
    q: tuple[_Signal, _Signal, _Signal]
    d: tuple[_Signal, _Signal, _Signal]
    missing: tuple[Array, Array, Array]
    felt: Callable[[], tuple[Array, Array]]


def realize(structure: Structure, ports: Ports) -> Lti:
    """Return the state-space form of a structure with its signals, all named.

    Raises
    ------
    ValueError
        The mass matrix is singular, or an output needs a derivative of an input that is not there.
    """
    dynamics = _dynamics(structure, ports)
    _check_proper(ports, dynamics.missing, dynamics.felt)
    A, B, y, filter_states = _filtered(ports, dynamics.A, dynamics.B, _outputs(ports, dynamics.q, dynamics.d))
    states = [f"{name}.x1" for name in structure.coordinates] + [f"{name}.x2" for name in structure.coordinates]
    for name, count in zip(ports.inputs, ports.integrators, strict=True):
        states += [f"{name}.displacement", f"{name}.velocity"][:count]
    return Lti(A, B, y.X, y.U, ports.inputs, ports.outputs, (*states, *filter_states))


def _solver(mass: Array) -> Solve:
    """Return a solver of a mass matrix: by Cholesky's factor if it is positive definite, else by LU; nothing for zeros."""
    try:
        if not is_symmetric(mass):
            raise linalg.LinAlgError
        factored = factorized_dense(mass.copy())
    except linalg.LinAlgError:
        scale = np.sqrt(np.abs(np.diag(mass)))
        if (scale == 0).any() or np.linalg.cond(mass / np.outer(scale, scale)) > _SINGULAR:
            raise ValueError(
                "the mass matrix is singular: a coordinate has no inertia, so there is no state-space form"
            ) from None
        factored = partial(linalg.lu_solve, linalg.lu_factor(mass))
    return lambda rhs: factored(rhs) if rhs.any() else np.zeros_like(rhs)


def _dynamics(structure: Structure, ports: Ports) -> _Dynamics:
    """Return A, B, the signals q, q', q'' and d, d', d'', and what of them is not there."""
    n, m, solve = structure.n, len(ports.inputs), _solver(dense(structure.M))
    order = np.array(ports.integrators, dtype=int)
    size = 2 * n + int(order.sum())
    d = _input_signals(order, n, size)
    x1, x2 = np.zeros((n, size)), np.zeros((n, size))
    x1[:, :n], x2[:, n : 2 * n] = np.eye(n), np.eye(n)
    B0, B1, B2 = ports.B
    K, C = dense(structure.K), dense(structure.C)
    G = solve(B2 * (order == 0))
    resisted = C @ G
    H = solve((B1 - resisted) * (order == 0))
    G_velocity = solve(B2 * (order == 1))
    q = _Signal(x1, np.zeros((n, m))) + d[0].through(G)
    rate = _Signal(x2, np.zeros((n, m))) + d[0].through(H) + d[1].through(G_velocity)
    force = q.through(-K) + rate.through(-C) + d[0].through(B0)
    force = force + d[1].through(B1 * (order > 0)) + d[2].through(B2 * (order > 1))
    acceleration = _Signal(solve(force.X), solve(force.U))
    A, B = np.zeros((size, size)), np.zeros((size, m))
    A[:n], B[:n] = rate.X, rate.U
    A[n : 2 * n], B[n : 2 * n] = acceleration.X, acceleration.U
    _integrators(A, B, order, 2 * n)
    return _Dynamics(A, B, (q, rate, acceleration), d, (G, H, G + G_velocity), partial(_felt, ports, resisted, solve))


def _felt(ports: Ports, resisted: Array, solve: Solve) -> tuple[Array, Array]:
    """Return how much of ``d'`` and ``d''`` outputs could feel; ``resisted`` are the dampers' forces on ``G``."""
    order = np.array(ports.integrators, dtype=int)
    E1, E2 = np.abs(ports.E[1] * (order < 1)), np.abs(ports.E[2] * (order < 2))
    if not ports.L[1:].any():
        return E1, E2

    def size(columns: Array) -> Array:
        return np.sqrt(np.abs(np.einsum("ij,ij->j", columns, solve(columns))))

    L1, L2 = (size(lines.T)[:, None] for lines in ports.L[1:])
    driven = size(ports.B[1] * (order == 0)) + size(resisted)
    return L1 * size(ports.B[2] * (order == 0)) + L2 * driven + E1, L2 * size(ports.B[2] * (order < 2)) + E2


def _input_signals(order: Array, n: int, size: int) -> tuple[_Signal, _Signal, _Signal]:
    """Return d, d', d'' as signals, zero where a derivative is not there."""
    m = len(order)
    parts = [_Signal(np.zeros((m, size)), np.zeros((m, m))) for _ in range(3)]
    state = 2 * n
    for i, count in enumerate(order):
        for derivative in range(int(count)):
            parts[derivative].X[i, state] = 1.0
            state += 1
        parts[int(count)].U[i, i] = 1.0
    return parts[0], parts[1], parts[2]


def _integrators(A: Array, B: Array, order: Array, first: int) -> None:
    state = first
    for i, count in enumerate(order):
        for derivative in range(int(count)):
            if derivative + 1 < count:
                A[state, state + 1] = 1.0
            else:
                B[state, i] = 1.0
            state += 1


def _outputs(
    ports: Ports, q: tuple[_Signal, _Signal, _Signal], d: tuple[_Signal, _Signal, _Signal]
) -> tuple[_Signal, _Signal, _Signal]:
    """Return the parts of the outputs with no, one and two derivatives still to be taken (by a filter)."""
    plain = np.array([b is None for b in ports.bandwidths], dtype=bool)[:, None]
    L, E = ports.L, ports.E
    if plain.all():
        now, *further = (q[k].through(L[k]) + d[k].through(E[k]) for k in range(3) if L[k].any() or E[k].any() or not k)
        none = _Signal(np.zeros_like(now.X), np.zeros_like(now.U))
        return sum(further, now), none, none
    now = q[0].through(L[0] * plain) + d[0].through(E[0] * plain)
    for k in (1, 2):
        now = now + q[k].through(L[k] * plain) + d[k].through(E[k] * plain)
    later = [q[0].through(L[k] * ~plain) + d[0].through(E[k] * ~plain) for k in range(3)]
    return now + later[0], later[1], later[2]


def _check_proper(ports: Ports, missing: tuple[Array, Array, Array], felt: Callable[[], tuple[Array, Array]]) -> None:
    """Raise where an unfiltered output needs a derivative of an input that the realisation does not have."""
    G, H, G2 = missing
    order = np.array(ports.integrators, dtype=int)
    L1, L2, E1, E2 = ports.L[1], ports.L[2], ports.E[1] * (order < 1), ports.E[2] * (order < 2)
    moved = np.array(ports.moved, dtype=bool)
    once, twice = L1 @ G + L2 @ H + E1, L2 @ G2 + E2
    if not (once.any() or twice.any()):
        return
    size_once, size_twice = felt()
    for o, output in enumerate(ports.outputs):
        if ports.bandwidths[o] is not None:
            continue
        for value, size, wanted in ((twice, size_twice, "acceleration"), (once, size_once, "velocity or acceleration")):
            needed = np.flatnonzero((np.abs(value[o]) > SUMMED * size[o]) & moved)
            if len(needed):
                raise ValueError(
                    f"output {output!r} needs a derivative of input {ports.inputs[needed[0]]!r}: impose its {wanted},"
                    " give the output a bandwidth, or leave one of them out"
                )


def _filtered(
    ports: Ports, A: Array, B: Array, parts: tuple[_Signal, _Signal, _Signal]
) -> tuple[Array, Array, _Signal, list[str]]:
    """Append the low-pass filters of the outputs, in observer form, and return the outputs."""
    y, once, twice = parts
    bandwidths = [(o, b) for o, b in enumerate(ports.bandwidths) if b is not None]
    if not bandwidths:
        return A, B, y, []
    size, names = A.shape[0], []
    A = blocks(
        [[A, np.zeros((size, 2 * len(bandwidths)))], [np.zeros((2 * len(bandwidths), size + 2 * len(bandwidths)))]]
    )
    B = np.vstack([B, np.zeros((2 * len(bandwidths), B.shape[1]))])
    X, U = np.hstack([y.X, np.zeros((y.X.shape[0], 2 * len(bandwidths)))]), y.U.copy()
    for j, (o, b) in enumerate(bandwidths):
        z1, z2 = size + 2 * j, size + 2 * j + 1
        position_X, position_U = y.X[o], y.U[o]
        X[o], U[o] = 0.0, b**2 * twice.U[o]
        X[o, :size], X[o, z2] = b**2 * twice.X[o], 1.0
        A[z1], B[z1] = -(b**2) * X[o], b**2 * position_U - b**2 * U[o]
        A[z1, :size] += b**2 * position_X
        A[z2], B[z2] = -2 * FILTER_DAMPING * b * X[o], b**2 * once.U[o] - 2 * FILTER_DAMPING * b * U[o]
        A[z2, :size] += b**2 * once.X[o]
        A[z2, z1] += 1.0
        names += [f"{ports.outputs[o]}.filter1", f"{ports.outputs[o]}.filter2"]
    return A, B, _Signal(X, U), names
