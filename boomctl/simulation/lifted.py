"""Many steps of a linear recursion at once: blocks of the signals as columns of a matrix, products instead of steps."""

import numpy as np

from boomctl.arrays import Array
from boomctl.simulation.plant import StepMaps

__all__ = ["lifted_response"]

_BLOCK = 128


def lifted_response(maps: StepMaps, C: Array, D: Array, U: Array) -> Array:
    """Return ``y = C z + D u`` at each step, (outputs, steps + 1), at rest at first, ``u`` straight in between.

    With ``x = z - last u`` the recursion is ``x+ = Phi x + G u``, ``y = C x + (D + C last) u``.  Within a block the
    outputs are a Toeplitz matrix times the inputs and the observability matrix times the first state; only the first
    states are found one after the other.
    """
    n, outputs, inputs, count = len(maps.Phi), len(C), len(U), U.shape[1]
    size = min(_BLOCK, count)
    blocks = -(-count // size)
    G, through = maps.first + maps.Phi @ maps.last, D + C @ maps.last
    padded = np.zeros((inputs, blocks * size))
    padded[:, :count] = U
    columns = np.ascontiguousarray(padded.reshape(inputs, blocks, size).transpose(0, 2, 1))
    seen, power = _observability(maps.Phi, C, size)
    reached = _observability(maps.Phi.T, G.T, size)[0][::-1]
    pushed = np.tensordot(reached, columns, axes=((0, 1), (1, 0))) if n else np.zeros((0, blocks))
    starts = np.empty((blocks, n))
    state = -maps.last @ U[:, 0]
    pushed = np.ascontiguousarray(pushed.T)
    for b in range(blocks):
        starts[b] = state
        state = power @ state + pushed[b]
    answers = np.einsum("kon,ni->oik", seen, G)
    first = starts.T
    y = np.empty((outputs, blocks, size))
    for o in range(outputs):
        total = seen[:, o] @ first
        for i in range(inputs):
            total += _toeplitz(np.concatenate([through[o, i : i + 1], answers[o, i, :-1]])) @ columns[i]
        y[o] = total.T
    return y.reshape(outputs, -1)[:, :count]


def _observability(Phi: Array, C: Array, size: int) -> tuple[Array, Array]:
    """Return ``C Phi^k`` for k below ``size``, (size, outputs, n), and ``Phi^size``, by doubling."""
    rows, power = C[None], Phi
    while len(rows) < size:
        rows = np.concatenate([rows, rows @ power])
        power = power @ power
    return rows[:size], np.linalg.matrix_power(Phi, size)


def _toeplitz(column: Array) -> Array:
    """Return the lower triangular Toeplitz matrix of a column."""
    n = len(column)
    line = np.concatenate([np.zeros(n - 1), column])
    return np.lib.stride_tricks.sliding_window_view(line, n)[:, ::-1].copy()
