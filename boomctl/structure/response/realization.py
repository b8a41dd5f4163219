"""State-space realization of a second-order model.

For a displacement input (``u = d``) the states are those of Anthonis & Ramon (2003), Eqs. (9) and (10):
``x1 = q - G d`` with ``G = M^-1 B2`` and ``x2 = x1' - H d`` with ``H = M^-1 (B1 - C G)``.  Where the velocity
(``u = d'``) or the acceleration (``u = d''``) is imposed, ``d`` and ``d'`` become states as well.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
from scipy import linalg

from boomctl.arrays import Array
from boomctl.lti.rounding import SUMMED
from boomctl.lti.system import Lti
from boomctl.structure.matrices import Structure, is_symmetric
from boomctl.structure.ports import FILTER_DAMPING, Ports

_SINGULAR = 1e14  # condition of a scaled mass matrix from which on its inverse has no digit left: some 0.01/eps


@dataclass(frozen=True)
class _Dynamics:
    """State equation, coordinates and inputs with derivatives, and the coefficients of the derivatives not there.

    A signal is a matrix: what it is of the states and, behind them, of the inputs; ``rates`` is so of the states' own.
    ``missing`` is ``(G, H, G2)``: q' lacks ``G d'``; q'' lacks ``H d' + G2 d''``.
    ``felt`` tells how much of ``d'`` and ``d''`` each output could feel (outputs, inputs), by the size of its row and of the
    input's columns in terms of kinetic energy: what is far below it is rounding.
    """

    rates: Array
    q: tuple[Array, Array, Array]
    d: tuple[Array, Array, Array]
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
    outputs = _outputs(ports, dynamics.q, dynamics.d)
    rates, y, filter_states = _filtered(ports, dynamics.rates, *outputs)
    size = len(rates)
    states = [f"{name}.x1" for name in structure.coordinates] + [f"{name}.x2" for name in structure.coordinates]
    for name, count in zip(ports.inputs, ports.integrators, strict=True):
        states += [f"{name}.displacement", f"{name}.velocity"][:count]
    A, B, C, D = rates[:, :size], rates[:, size:], y[:, :size], y[:, size:]
    return Lti(A, B, C, D, ports.inputs, ports.outputs, (*states, *filter_states), scales={})


def _solver(mass: Array) -> Callable[[Array], Array]:
    """Return a solver of a mass matrix: by Cholesky's factor if it is positive definite, else by LU; nothing for zeros."""
    try:
        if not is_symmetric(mass):
            raise linalg.LinAlgError
        factored = partial(linalg.cho_solve, linalg.cho_factor(mass.T, check_finite=False), check_finite=False)
    except linalg.LinAlgError:
        scale = np.sqrt(np.abs(np.diag(mass)))
        if (scale == 0).any() or np.linalg.cond(mass / np.outer(scale, scale)) > _SINGULAR:
            raise ValueError(
                "the mass matrix is singular: a coordinate has no inertia, so there is no state-space form"
            ) from None
        factored = partial(linalg.lu_solve, linalg.lu_factor(mass))
    return lambda rhs: factored(rhs) if rhs.any() else np.zeros_like(rhs)


def _dynamics(structure: Structure, ports: Ports) -> _Dynamics:
    """Return the rates, the signals q, q', q'' and d, d', d'', and what of them is not there."""
    n, m, solve = structure.n, len(ports.inputs), _solver(structure.M)
    order = np.array(ports.integrators, dtype=int)
    columns = 2 * n + int(order.sum()) + m
    d = _input_signals(order, 2 * n, columns)
    own = np.eye(2 * n, columns)
    B0, B1, B2 = ports.B
    K, C = structure.K, structure.C
    G = solve(B2 * (order == 0))
    resisted = C @ G
    H, G_velocity = solve((B1 - resisted) * (order == 0)), np.zeros_like(G)
    q, rate, force = own[:n] + G @ d[0], own[n:] + H @ d[0], B0 @ d[0]
    if order.any():
        G_velocity = solve(B2 * (order == 1))
        rate += G_velocity @ d[1]
        force += (B1 * (order > 0)) @ d[1] + (B2 * (order > 1)) @ d[2]
    force -= K @ q + C @ rate
    acceleration = solve(force)
    integrated = [d[k + 1][i] for i, count in enumerate(ports.integrators) for k in range(count)]
    rates = np.vstack([rate, acceleration, *integrated])
    return _Dynamics(rates, (q, rate, acceleration), d, (G, H, G + G_velocity), partial(_felt, ports, resisted, solve))


def _felt(ports: Ports, resisted: Array, solve: Callable[[Array], Array]) -> tuple[Array, Array]:
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


def _input_signals(order: Array, first: int, columns: int) -> tuple[Array, Array, Array]:
    """Return d, d', d'' as signals, zero where a derivative is not there; ``first`` is their first state."""
    parts = np.zeros((3, len(order), columns))
    for i, count in enumerate(order.tolist()):
        for derivative in range(count):
            parts[derivative, i, first] = 1.0
            first += 1
        parts[count, i, columns - len(order) + i] = 1.0
    return parts[0], parts[1], parts[2]


def _outputs(
    ports: Ports, q: tuple[Array, Array, Array], d: tuple[Array, Array, Array]
) -> tuple[Array, Array | None, Array | None]:
    """Return the parts of the outputs with no, one and two derivatives still to be taken by a filter, if there is one."""
    parts = [ports.L[k] @ q[k] + ports.E[k] @ d[k] for k in range(3)]
    if all(bandwidth is None for bandwidth in ports.bandwidths):
        return parts[0] + parts[1] + parts[2], None, None
    plain = np.array([b is None for b in ports.bandwidths], dtype=bool)[:, None]
    later = [ports.L[k] @ q[0] + ports.E[k] @ d[0] for k in range(3)]
    return np.where(plain, parts[0] + parts[1] + parts[2], later[0]), later[1], later[2]


def _check_proper(ports: Ports, missing: tuple[Array, Array, Array], felt: Callable[[], tuple[Array, Array]]) -> None:
    """Raise where an unfiltered output needs a derivative of an input that the realization does not have."""
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
    ports: Ports, rates: Array, y: Array, once: Array | None, twice: Array | None
) -> tuple[Array, Array, list[str]]:
    """Append the states of the low-pass filters of the outputs, in observer form, and return rates, outputs and names."""
    if once is None or twice is None:
        return rates, y, []
    bandwidths = [(o, b) for o, b in enumerate(ports.bandwidths) if b is not None]
    size, names, room = len(rates), [], np.zeros(2 * len(bandwidths), int)
    rates, y, once, twice = (np.insert(signal, size + room, 0.0, axis=1) for signal in (rates, y, once, twice))
    rates = np.vstack([rates, np.zeros((len(room), rates.shape[1]))])
    for j, (o, b) in enumerate(bandwidths):
        z1, z2 = size + 2 * j, size + 2 * j + 1
        position, y[o] = y[o].copy(), b**2 * twice[o]
        y[o, z2] += 1.0
        rates[z1] = b**2 * (position - y[o])
        rates[z2] = b**2 * once[o] - 2 * FILTER_DAMPING * b * y[o]
        rates[z2, z1] += 1.0
        names += [f"{ports.outputs[o]}.filter1", f"{ports.outputs[o]}.filter2"]
    return rates, y, names
