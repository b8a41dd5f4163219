"""The Riccati equation of discrete time, ``X = A^T X A + Q - (A^T X B + N)(R + B^T X B)^-1 (A^T X B + N)^T``.

Solved by structure-preserving doubling (Chu, Fan, Lin & Wang 2004) or, where that does not stabilize, by the generalized
Schur vectors of the extended pencil (Van Dooren 1981, SciPy), then by Newton's method (Hewer 1971). Residuals are summed
in extended precision.
"""

from collections.abc import Iterator

import numpy as np
from scipy import linalg

from boomctl.arrays import Array, balance
from boomctl.lti.rounding import EPS
from boomctl.synthesis.lq.riccati import (
    MAX_EXTENDED,
    RiccatiProblem,
    RiccatiSolution,
    best_solution,
    continuous_solutions,
    even,
    refined,
)

_MAX_DOUBLINGS = 64  # A pole within one ulp of the unit circle has decayed after 57.


def solution_of(problem: RiccatiProblem, what: str = "Riccati equation") -> RiccatiSolution:
    """Return the stabilizing solution of a problem in continuous or discrete time.

    Raises
    ------
    SynthesisError
        If no solution is found, or if it is not accurate enough.
    """
    return best_solution((continuous_solutions if problem.dt == 0.0 else _solutions)(problem), what)


def _solutions(problem: RiccatiProblem) -> Iterator[tuple[str, RiccatiSolution | None]]:
    for name, solver in (
        ("structure-preserving doubling", _by_doubling),
        ("SciPy, extended pencil", _by_schur_vectors),
    ):
        try:
            with np.errstate(over="ignore", invalid="ignore"):  # of what is not stabilized
                X = even(solver(problem)).astype(np.longdouble if len(problem.A) <= MAX_EXTENDED else float)
        except ValueError:  # Also `numpy.linalg.LinAlgError`.
            X = np.full(problem.A.shape, np.nan)
        yield name, refined(problem, X, _newton_step) if np.isfinite(X).all() else None


def _by_doubling(p: RiccatiProblem) -> Array:
    """Return the cost of two, four, eight and more steps; modes without weight are not stabilized."""
    A, acting, H = p.shifted
    G, one = acting @ acting.T, np.eye(len(A))
    for _ in range(_MAX_DOUBLINGS):
        solved = np.linalg.solve(one + G @ H, np.hstack([A, G]))
        onward, spread = solved[:, : len(A)], solved[:, len(A) :]
        more = A.T @ H @ onward
        G, H, A = even(G + A @ spread @ A.T), even(H + more), A @ onward
        if not np.abs(more).max() > EPS * np.abs(H).max():
            break
    return H


def _by_schur_vectors(p: RiccatiProblem) -> Array:
    return np.asarray(linalg.solve_discrete_are(p.A, p.B, p.Q, p.R, s=p.N))


def _newton_step(closed: Array, residual: Array, cost: Array | None) -> Array:
    """Return the solution of the equation of a loop, with each state scaled by its own cost if these are given."""
    d = balance(closed)[1] if cost is None else 1.0 / np.sqrt(np.where(cost > 0.0, cost, 1.0))
    return even(_summed(closed * d / d[:, None], even(residual) * np.outer(d, d))) / np.outer(d, d)


def _summed(A: Array, R: Array) -> Array:
    """Return ``R + A^T R A + A^T^2 R A^2 + ...`` for stable ``A``, doubling the number of terms (Smith 1968)."""
    total, power = R, A
    for _ in range(_MAX_DOUBLINGS):
        more = power.T @ total @ power
        total, power = total + more, power @ power
        if np.abs(more).max() <= EPS * np.abs(total).max():
            break
    return total
