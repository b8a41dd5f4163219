"""Many steps of a linear recursion at once: blocks of the signals as columns of a matrix, products instead of steps."""

from dataclasses import dataclass

import numpy as np

from boomctl.arrays import Array

_BLOCK = 128


@dataclass(frozen=True)
class Lifted:
    """``x+ = Phi x + G u``, ``y = C x + D u`` over blocks of ``size`` steps.

    Attributes
    ----------
    seen : (size, outputs, n) ndarray
        Outputs within a block per state at its beginning.
    power : (n, n) ndarray
        State at the end of a block per state at its beginning.
    reached : (size, inputs, n) ndarray
        State at the end of a block per input within it.
    pulse : (outputs, inputs, size) ndarray
        Pulse responses.
    """

    size: int
    seen: Array
    power: Array
    reached: Array
    pulse: Array

    @classmethod
    def of(cls, Phi: Array, G: Array, C: Array, D: Array, size: int) -> "Lifted":
        """Return the blocks of a recursion."""
        seen, power = _observability(Phi, C, size)
        reached = _observability(Phi.T, G.T, size)[0][::-1]
        answers = np.moveaxis(seen[:-1] @ G, 0, 2)
        return cls(size, seen, power, reached, np.concatenate([D[:, :, None], answers], axis=2))

    def columns(self, U: Array) -> Array:
        """Return signals (inputs, count) as blocks (inputs, size, blocks), filled up with zeros."""
        blocks = -(-U.shape[1] // self.size)
        padded = np.zeros((len(U), blocks * self.size))
        padded[:, : U.shape[1]] = U
        return np.ascontiguousarray(padded.reshape(len(U), blocks, self.size).transpose(0, 2, 1))

    def pushed(self, columns: Array) -> Array:
        """Return what the inputs add to the state over each block, (blocks, n)."""
        inputs, size, blocks = columns.shape
        flat = columns.transpose(1, 0, 2).reshape(size * inputs, blocks)
        return np.ascontiguousarray((self.reached.reshape(size * inputs, self.reached.shape[2]).T @ flat).T)

    def forced(self, columns: Array, outputs: slice | None = None) -> Array:
        """Return outputs within each block from its inputs alone, (outputs, size, blocks)."""
        pulse = self.pulse if outputs is None else self.pulse[outputs]
        y = np.zeros((len(pulse), self.size, columns.shape[2]))
        for o in range(len(pulse)):
            for i in range(len(columns)):
                if pulse[o, i].any():
                    y[o] += _toeplitz(pulse[o, i]) @ columns[i]
        return y

    def free(self, starts: Array, outputs: slice | None = None) -> Array:
        """Return outputs within each block from the states (blocks, n) at its beginning, (outputs, size, blocks)."""
        seen = self.seen if outputs is None else self.seen[:, outputs]
        return np.moveaxis(seen @ starts.T, 0, 1)


def recursion_without_lead(Phi: Array, first: Array, last: Array, C: Array, D: Array) -> tuple[Array, Array]:
    """Return ``G`` and ``D`` of ``x = z - last u`` for ``z+ = Phi z + first u + last u+``, ``y = C z + D u``."""
    return first + Phi @ last, D + C @ last


def lifted_response(maps: tuple[Array, Array, Array], C: Array, D: Array, U: Array) -> Array:
    """Return ``y = C z + D u`` at each step, (outputs, steps + 1), for ``z+ = Phi z + first u + last u+``, ``z = 0``.

    Only the states at the beginnings of blocks are found one after the other.
    """
    Phi, first, last = maps
    G, through = recursion_without_lead(Phi, first, last, C, D)
    lifted = Lifted.of(Phi, G, C, through, min(_BLOCK, U.shape[1]))
    columns = lifted.columns(U)
    pushed = lifted.pushed(columns)
    starts = np.empty((columns.shape[2], len(Phi)))
    state = -last @ U[:, 0]
    for b in range(len(starts)):
        starts[b] = state
        state = lifted.power @ state + pushed[b]
    y = lifted.forced(columns) + lifted.free(starts)
    return y.transpose(0, 2, 1).reshape(len(C), -1)[:, : U.shape[1]]


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
