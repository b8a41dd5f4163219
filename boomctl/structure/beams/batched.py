"""Small symmetric systems at many frequencies at once.

Elimination runs over whole frequency axes, entry by entry, and skips what is zero by structure.  Every solution is
checked against a weighted sum of the equations that elimination has not seen; the few frequencies at which elimination
without pivoting lost digits are solved by LAPACK.
"""

from collections.abc import Mapping

import numpy as np

from boomctl.arrays import Array

Entries = Mapping[tuple[int, int], Array]

_RESIDUAL = 1e-11


def solve_symmetric(n: int, D: Entries, B: list[Array], check: Array, check_B: Array) -> list[Array]:
    """Solve ``D(f) X(f) = B(f)`` for each frequency ``f``.

    Parameters
    ----------
    n : int
        Number of equations.
    D : mapping from (i, j), i >= j, to (N,) arrays
        Lower triangle of a complex symmetric matrix at ``N`` frequencies; entries not there are zero.
    B : list of (m, N) arrays
        Right-hand sides, one item an equation.
    check : (n, N) array
    check_B : (m, N) array
        A weighted sum of all equations, left and right side.
    """
    X = _eliminate(n, D, B)
    bad = ~(_residual(X, check, check_B) <= _RESIDUAL)
    if bad.any():
        _by_lapack(n, D, X, B, bad)
    return X


def _eliminate(n: int, D: Entries, B: list[Array]) -> list[Array]:
    A, rhs = dict(D), list(B)
    inverse: list[Array] = []
    factors: list[list[tuple[int, Array]]] = []
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        for k in range(n):
            inverse.append(1.0 / A[k, k])
            later = [i for i in range(k + 1, n) if (i, k) in A]
            factors.append([(i, A[i, k] * inverse[k]) for i in later])
            for place, (i, factor) in enumerate(factors[k]):
                for j in later[: place + 1]:
                    update = factor * A[j, k]
                    A[i, j] = A[i, j] - update if (i, j) in A else -update
                rhs[i] = rhs[i] - factor * rhs[k]
        for k in reversed(range(n)):
            value = rhs[k] * inverse[k]
            for i, factor in factors[k]:
                value -= factor * rhs[i]
            rhs[k] = value
    return rhs


def _residual(X: list[Array], check: Array, check_B: Array) -> Array:
    """Return, for each frequency, by how much the weighted sum of equations is missed, relative to its terms."""
    with np.errstate(invalid="ignore", over="ignore"):
        terms = np.array(X)
        terms *= check[:, None, :]
        size = _size(check_B) + _size(terms).sum(axis=0) + np.finfo(float).tiny
        gap = terms.sum(axis=0)
        gap -= check_B
        return (_size(gap) / size).max(axis=0)


def _size(value: Array) -> Array:
    """Return ``|Re| + |Im|``, cheaper than the modulus."""
    parts = np.abs(value.view(float))
    return parts[..., ::2] + parts[..., 1::2]


def _by_lapack(n: int, D: Entries, X: list[Array], B: list[Array], bad: Array) -> None:
    full = np.zeros((int(bad.sum()), n, n), dtype=complex)
    for (i, j), value in D.items():
        full[:, i, j] = full[:, j, i] = value[bad]
    rhs = np.array([b[:, bad] for b in B])
    solved = np.linalg.solve(full, np.moveaxis(rhs, 2, 0))
    for i in range(n):
        X[i][:, bad] = solved[:, i].T
