"""CasADi functions that read NumPy arrays and write into them, without a copy entry by entry in Python."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from boomctl.arrays import Array

if TYPE_CHECKING:
    import casadi

# columns that are one call: 1000 take a third longer over a second, 30 a quarter longer over five (measured)
BLOCK = 250


class Buffered:
    """A function of dense matrices, evaluated in memory that NumPy shares with it.

    Parameters
    ----------
    function : casadi.Function
        Of dense matrices; what it returns with structural zeros is returned full.
    """

    def __init__(self, function: casadi.Function) -> None:
        places = range(function.n_in()), range(function.n_out())
        assert all(function.sparsity_in(i).is_dense() for i in places[0])
        # to be kept as long as this: what runs the function points to it.  Its stub knows of no memory that Python shares
        self._buffer: Any = None
        self._buffer, self._run = function.buffer()
        # matrices lie column by column: their transposes are what NumPy lays out row by row
        self._given = [np.empty(function.size_in(i)[::-1]) for i in places[0]]
        self._found = [np.empty(function.nnz_out(i)) for i in places[1]]
        self._shapes = [function.size_out(i) for i in places[1]]
        self._filled = [np.array(function.sparsity_out(i).find(), dtype=int) for i in places[1]]
        for i, array in enumerate(self._given):
            self._buffer.set_arg(i, array.reshape(-1).data)
        for i, array in enumerate(self._found):
            self._buffer.set_res(i, array.data)

    def __call__(self, *given: Array) -> list[Array]:
        """Return the matrices that the function returns, (rows, columns); vectors are taken as columns."""
        for here, each in zip(self._given, given, strict=True):
            here[...] = np.reshape(each, here.shape[::-1]).T
        self._run()
        results = []
        for array, (rows, columns), filled in zip(self._found, self._shapes, self._filled, strict=True):
            full = array.copy() if len(array) == rows * columns else np.zeros(rows * columns)
            if len(array) < len(full):
                full[filled] = array
            results.append(full.reshape(columns, rows).T)
        return results


def at_columns(function: casadi.Function, *given: Array) -> list[Array]:
    """Return what a function of vectors returns at all columns of matrices, (rows, columns) each."""
    count = given[0].shape[1]
    block = min(BLOCK, count)
    run = Buffered(function.map(block))
    parts = []
    for k in range(0, count, block):
        end = min(k + block, count)
        padded = [np.pad(each[:, k:end], ((0, 0), (0, block - end + k))) for each in given]
        parts.append([each[:, : end - k] for each in run(*padded)])
    return [np.hstack(each) for each in zip(*parts, strict=True)]
