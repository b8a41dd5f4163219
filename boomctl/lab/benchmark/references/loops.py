"""Linear maps from sample to sample in extended precision."""

import numpy as np

from boomctl.arrays import Array

_TERMS = 22  # of the series of exp(X) with |X| <= 1/8: what follows is below 1e-40


def extended_maps(A: Array, B: Array, h: float) -> tuple[Array, Array, Array]:
    """Return ``exp(A h)``, ``int exp(A s) ds B`` and ``int exp(A (h - s)) s ds B / h`` in extended precision."""
    n, m = B.shape
    big = np.zeros((n + 2 * m, n + 2 * m), dtype=np.longdouble)
    big[:n, :n], big[:n, n : n + m] = A * np.longdouble(h), B * np.longdouble(h)
    big[n : n + m, n + m :] = np.eye(m)
    halvings = max(0, int(np.ceil(np.log2(float(np.abs(big).sum(axis=1).max())))) + 3)
    small = big / np.longdouble(2.0) ** halvings
    total = np.eye(len(big), dtype=np.longdouble)
    term = total.copy()
    for k in range(1, _TERMS):
        term = term @ small / np.longdouble(k)
        total = total + term
    for _ in range(halvings):
        total = total @ total
    return total[:n, :n], total[:n, n : n + m], total[:n, n + m :]
