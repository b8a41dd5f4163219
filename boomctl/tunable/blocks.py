"""State-space matrices of controller blocks as CasADi expressions, their interconnections and derivatives."""

from typing import NamedTuple

import casadi as ca
import numpy as np

from boomctl.arrays import Array


class Block(NamedTuple):
    """A linear system whose matrices are CasADi expressions."""

    A: ca.SX
    B: ca.SX
    C: ca.SX
    D: ca.SX

    @property
    def matrix(self) -> ca.SX:
        """``[[A, B], [C, D]]``."""
        return ca.blockcat([[self.A, self.B], [self.C, self.D]])

    def between(self, rows: list[int], columns: list[int], shape: tuple[int, int]) -> "Block":
        """Return the block embedded in more outputs and inputs; ``shape`` is the shape of the larger feedthrough."""
        outputs, inputs = ca.SX.eye(shape[0])[:, rows], ca.SX.eye(shape[1])[columns, :]
        return Block(self.A, self.B @ inputs, outputs @ self.C, outputs @ self.D @ inputs)


def static(D: ca.SX) -> Block:
    """Return a gain matrix as a block without states."""
    return Block(ca.SX(0, 0), ca.SX(0, D.columns()), ca.SX(D.rows(), 0), D)


def filtered(gains: ca.SX, A: ca.SX, B: ca.SX, C: ca.SX, D: float | ca.SX) -> Block:
    """Return a gain matrix in series with a filter ``C (s - A)^-1 B + D`` on each input."""
    unit = ca.SX.eye(gains.columns())
    return Block(ca.kron(unit, A), ca.kron(unit, B), ca.kron(gains, C), gains * D)


def parallel(*blocks: Block) -> Block:
    """Return the sum of blocks between the same signals."""
    A, B, C, D = zip(*blocks, strict=True)
    return Block(ca.diagcat(*A), ca.vertcat(*B), ca.horzcat(*C), sum(D[1:], start=D[0]))  # type: ignore[arg-type]


def series(last: Block, first: Block) -> Block:
    """Return ``last`` driven by the outputs of ``first``."""
    A = ca.blockcat([[last.A, last.B @ first.C], [ca.SX(first.A.rows(), last.A.columns()), first.A]])
    B, C = ca.vertcat(last.B @ first.D, first.B), ca.horzcat(last.C, last.D @ first.C)
    return Block(A, B, C, last.D @ first.D)


class Differentiated:
    """Matrix of expressions of a parameter vector, with its first and second derivatives."""

    def __init__(self, x: ca.SX, matrix: ca.SX) -> None:
        entries, weights, self.shape = ca.vec(matrix.T), ca.SX.sym("weights", matrix.numel()), matrix.shape
        hessian = ca.hessian(ca.dot(weights, entries), x)[0]
        self._value = ca.Function("value", [x], [matrix])
        self._jacobian = ca.Function("jacobian", [x], [ca.jacobian(entries, x).T])
        self._hessian = ca.Function("hessian", [x, weights], [hessian])
        self._line = None if hessian.nnz() else (self._value(0.0).full(), self._jacobian(0.0).full())

    def value(self, x: Array) -> Array:
        """Return the matrix."""
        if self._line is None:
            return self._value(x).full()
        start, jacobian = self._line  # constant: no function call
        return start + (x @ jacobian).reshape(start.shape)

    def jacobian(self, x: Array) -> Array:
        """Return the derivatives of its entries, row by row, by every parameter: (k, entries)."""
        return self._jacobian(x).full() if self._line is None else self._line[1]

    def hessian(self, x: Array, weights: Array) -> Array:
        """Return the second derivatives of the sum of its entries times weights: (k, k)."""
        if self._line is not None:
            return np.zeros((len(x), len(x)))
        return self._hessian(x, weights.ravel()).full()
