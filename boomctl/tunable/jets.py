"""Matrices and linear systems together with their derivatives by a vector of free numbers."""

from dataclasses import dataclass

import numpy as np
from scipy import linalg

from boomctl.arrays import Array


@dataclass(frozen=True)
class Jet:
    """A matrix and its derivatives.

    Attributes
    ----------
    value : (r, c) ndarray
    slopes : (k, r, c) ndarray
        Derivatives by ``k`` free numbers.
    """

    value: Array
    slopes: Array

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns."""
        return self.value.shape[0], self.value.shape[1]

    def __add__(self, other: "Jet") -> "Jet":
        return Jet(self.value + other.value, self.slopes + other.slopes)

    def __matmul__(self, other: "Jet") -> "Jet":
        return Jet(self.value @ other.value, self.slopes @ other.value + self.value @ other.slopes)

    def times(self, left: Array, right: Array) -> "Jet":
        """Return the jet with rows scaled by ``left`` and columns by ``right``."""
        return Jet(left[:, None] * self.value * right, left[:, None] * self.slopes * right)

    def moved(self, start: int, count: int) -> "Jet":
        """Return the jet by ``count`` free numbers, its own being those from ``start`` on."""
        slopes = np.zeros((count, *self.value.shape))
        slopes[start : start + len(self.slopes)] = self.slopes
        return Jet(self.value, slopes)


def fixed(value: Array, count: int) -> Jet:
    """Return a matrix that does not depend on the free numbers."""
    return Jet(value, np.zeros((count, *value.shape)))


def entries(x: Array, rows: int, columns: int, start: int = 0, count: int | None = None) -> Jet:
    """Return the matrix whose entries are the free numbers from ``start`` on, row by row."""
    size = rows * columns
    slopes = np.zeros((len(x) if count is None else count, size))
    slopes[np.arange(start, start + size), np.arange(size)] = 1.0
    return Jet(x[start : start + size].reshape(rows, columns), slopes.reshape(-1, rows, columns))


def blocks(rows: list[list[Jet]]) -> Jet:
    """Return jets put together to one, as ``numpy.block`` does."""
    value = np.concatenate([np.concatenate([jet.value for jet in row], axis=1) for row in rows], axis=0)
    slopes = np.concatenate([np.concatenate([jet.slopes for jet in row], axis=2) for row in rows], axis=1)
    return Jet(value, slopes)


@dataclass(frozen=True)
class SystemJet:
    """A linear system whose matrices are jets of the same free numbers."""

    A: Jet
    B: Jet
    C: Jet
    D: Jet

    @property
    def count(self) -> int:
        """Number of free numbers."""
        return len(self.D.slopes)

    def moved(self, start: int, count: int) -> "SystemJet":
        """Return the system by ``count`` free numbers, its own being those from ``start`` on."""
        return SystemJet(*(jet.moved(start, count) for jet in (self.A, self.B, self.C, self.D)))

    def matrix(self) -> Jet:
        """Return ``[[A, B], [C, D]]``."""
        return blocks([[self.A, self.B], [self.C, self.D]])

    def beside(self, other: "SystemJet") -> "SystemJet":
        """Return the sum of two systems: the same inputs, outputs added."""
        k, a, b = self.count, self.A.shape[0], other.A.shape[0]
        A = blocks([[self.A, fixed(np.zeros((a, b)), k)], [fixed(np.zeros((b, a)), k), other.A]])
        return SystemJet(A, blocks([[self.B], [other.B]]), blocks([[self.C, other.C]]), self.D + other.D)

    def after(self, first: "SystemJet") -> "SystemJet":
        """Return this system driven by the outputs of another one."""
        k, a, b = self.count, self.A.shape[0], first.A.shape[0]
        A = blocks([[self.A, self.B @ first.C], [fixed(np.zeros((b, a)), k), first.A]])
        return SystemJet(
            A, blocks([[self.B @ first.D], [first.B]]), blocks([[self.C, self.D @ first.C]]), self.D @ first.D
        )

    def placed(self, rows: list[int], columns: list[int], shape: tuple[int, int]) -> "SystemJet":
        """Return the system between some of more inputs and outputs: ``shape`` is that of the larger feedthrough."""
        inputs, outputs = np.eye(shape[1])[columns], np.eye(shape[0])[:, rows]
        B = Jet(self.B.value @ inputs, self.B.slopes @ inputs)
        C = Jet(outputs @ self.C.value, outputs @ self.C.slopes)
        D = Jet(outputs @ self.D.value @ inputs, outputs @ self.D.slopes @ inputs)
        return SystemJet(self.A, B, C, D)


def static(D: Jet) -> SystemJet:
    """Return a gain as a system without states."""
    (rows, columns), k = D.shape, len(D.slopes)
    return SystemJet(fixed(np.zeros((0, 0)), k), fixed(np.zeros((0, columns)), k), fixed(np.zeros((rows, 0)), k), D)


def repeated(system: SystemJet, times: int) -> SystemJet:
    """Return copies of a system side by side, each with inputs and outputs of its own."""

    def along(jet: Jet) -> Jet:
        slopes = [linalg.block_diag(*[slope] * times) for slope in jet.slopes]
        value = linalg.block_diag(*[jet.value] * times)
        shape = (jet.shape[0] * times, jet.shape[1] * times)
        return Jet(value.reshape(shape), np.reshape(slopes, (len(jet.slopes), *shape)))

    return SystemJet(along(system.A), along(system.B), along(system.C), along(system.D))
