"""Eigenvalues of matrices and roots of polynomials in exact and ball arithmetic (python-flint), within a limit of work."""

from dataclasses import dataclass
from functools import lru_cache
from math import isqrt

import numpy as np
from flint import acb, fmpq, fmpq_mat, fmpq_poly

from boomctl.arrays import Array

OPERATIONS = 4e8  # Limit of a proof that another result uses: one or two seconds.
BITS = 64  # Precision with which roots and solutions are first enclosed; it is doubled until it suffices.
_CUBED = 30.0  # Operations per state^3 and entry of a response.
_FOURTH = 2.0  # Operations per state^4 and entry of a response, with the isolation of its roots.


class UndecidedError(Exception):
    """A proof would take more operations than the limit."""


@dataclass
class Work:
    """Operations left to a proof, estimated from sizes of matrices, polynomials and numbers: some 5 ns each."""

    left: float
    spent: float = 0.0

    def check(self, operations: float = 0.0) -> None:
        """Raise `UndecidedError` if fewer operations are left."""
        if operations > self.left:
            raise UndecidedError

    def check_entries(self, n: int, entries: int) -> None:
        """Raise `UndecidedError` if arithmetic on entries of a response of ``n`` states, with roots, exceeds what is left."""
        self.check(_FOURTH * n**4 * entries)

    def charge_entries(self, n: int, entries: int) -> None:
        """Check and count arithmetic on entries of a response of ``n`` states."""
        self.check_entries(n, entries)
        self.charge(_CUBED * n**3 * entries)

    def charge(self, operations: float) -> None:
        """Count operations."""
        self.left -= operations
        self.spent += operations


def rational_matrix(M: Array) -> fmpq_mat:
    """Return a matrix of rational numbers equal to the entries."""
    entries = (x if isinstance(x, fmpq) else fmpq(*x.as_integer_ratio()) for x in M.ravel().tolist())
    return fmpq_mat(M.shape[0], M.shape[1], [*entries])


@lru_cache(maxsize=1)  # The responses of a loop at all its signals have one matrix.
def characteristic_polynomial(entries: tuple[fmpq, ...]) -> fmpq_poly:
    """Return ``det(s - A)`` of a square matrix, given by its entries."""
    n = isqrt(len(entries))
    return fmpq_mat(n, n, entries).charpoly()


def isolated_roots(p: fmpq_poly, work: Work) -> list[tuple[acb, int]]:
    """Return the roots of a polynomial and their multiplicities; real ones have the imaginary part zero.

    The operations are known afterwards, from the digits that it took to separate them.
    """
    work.check()
    roots: list[tuple[acb, int]] = p.numer().complex_roots()  # type: ignore[assignment]
    parts = [part for root, _ in roots for part in (root.real, root.imag) if not part.is_exact()]
    digits = max((int(part.rel_accuracy_bits()) for part in parts), default=BITS)
    work.charge(float(p.degree()) ** 2 * max(float(digits), BITS) ** 1.5)
    return roots


def eigenvalues(A: fmpq_mat, work: Work) -> Array:
    """Return the eigenvalues of a matrix of rational numbers, rounded."""
    work.charge_entries(A.nrows(), 1)
    roots = isolated_roots(characteristic_polynomial(tuple(A.entries())), work)
    return np.array([complex(root) for root, count in roots for _ in range(count)])
