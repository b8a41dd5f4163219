"""The Riccati equation of discrete time, ``X = A^T X A + Q - (A^T X B + N)(R + B^T X B)^-1 (A^T X B + N)^T``.

Solved by structure-preserving doubling (Chu, Fan, Lin & Wang 2004) or, where that does not stabilize, by the generalized
Schur vectors of the extended pencil (Van Dooren 1981, SciPy), then by Newton's method (Hewer 1971). Residuals are summed
in extended precision.
"""

from collections.abc import Iterator
from dataclasses import replace
from functools import partial

import numpy as np
from scipy import linalg

from boomctl.arrays import Array, balance
from boomctl.lti.modal import sides
from boomctl.lti.rounding import EPS
from boomctl.lti.system import rates_of
from boomctl.synthesis.lq.riccati import (
    MAX_EXTENDED,
    RiccatiProblem,
    RiccatiSolution,
    assessed,
    best_solution,
    even,
    refined,
    solve_riccati,
)

_MAX_DOUBLINGS = 64  # A pole within one ulp of the unit circle has decayed after 57.


def solution_of(problem: RiccatiProblem, what: str) -> RiccatiSolution:
    """Return the stabilizing solution of a problem in continuous or discrete time.

    Stable states that are not connected to the weight by the zeros of the matrices cost nothing. They are omitted, and
    ``X`` is exactly zero there: rounding errors would have no cost to compare with.

    Raises
    ------
    SynthesisError
        If no solution is found, or if it is not accurate enough.
    """
    solve = solve_riccati if problem.dt == 0.0 else solve_discrete_riccati
    weighted = _weighted_states(problem)
    others = np.asarray(linalg.eigvals(problem.A[np.ix_(~weighted, ~weighted)]), dtype=complex)
    if weighted.all() or (sides(others, problem.dt) >= 0).any():
        return solve(problem, what)
    n, m = problem.B.shape
    X, F, poles, inside = np.zeros((n, n)), np.zeros((m, n)), others, np.ix_(weighted, weighted)
    result = RiccatiSolution(X, F, poles, residual=0.0, cost_error=0.0, abscissa=0.0, stages=("nothing weighed",))
    if weighted.any():
        part = replace(problem, A=problem.A[inside], B=problem.B[weighted], Q=problem.Q[inside], N=problem.N[weighted])
        result = solve(part, what)
        X[inside], F[:, weighted] = result.X, result.gain
        poles = np.concatenate([result.poles, others])
    return replace(result, X=X, gain=F, poles=poles, abscissa=float(rates_of(poles, problem.dt).real.max()))


def _weighted_states(problem: RiccatiProblem) -> Array:
    """Return which states are connected to the weight by nonzero entries of the matrices."""
    weighted = (problem.Q != 0.0).any(axis=1) | (problem.N != 0.0).any(axis=1)
    links = problem.A != 0.0
    while True:
        more = weighted | links[weighted].any(axis=0)
        if (more == weighted).all():
            return weighted
        weighted = more


def solve_discrete_riccati(problem: RiccatiProblem, what: str = "Riccati equation") -> RiccatiSolution:
    """Return the stabilizing solution of a problem in discrete time.

    Raises
    ------
    SynthesisError
        If no solution is found, or if it is not accurate enough.
    """
    return best_solution(_solutions(problem), what)


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
        yield name, refined(partial(_certified, problem), X) if np.isfinite(X).all() else None


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


def _certified(p: RiccatiProblem, X: Array, near: bool) -> tuple[RiccatiSolution, Array | None]:
    """Return a solution with its errors, and the Newton step from there; None if the loop is not stable.

    If ``X`` is ``near``, the step is computed with each state scaled by its own cost, as its norm is.
    """
    own = np.asarray(X, dtype=float)
    gain = linalg.solve(p.R + p.B.T @ own @ p.B, p.B.T @ own @ p.A + p.N.T, assume_a="sym")
    closed = p.A - p.B @ gain
    poles = np.asarray(linalg.eigvals(closed), dtype=complex)
    A, B, Q, R, N, F = (np.asarray(part, dtype=X.dtype) for part in (p.A, p.B, p.Q, p.R, p.N, gain))
    moved = A - B @ F  # Joseph's form, in which errors of the gain are of second order
    kept, spent, crossed = moved.T @ X @ moved, F.T @ R @ F, N @ F
    residual = np.asarray(kept - X + Q + spent - crossed - crossed.T, dtype=float)
    step = None
    if (sides(poles, p.dt) < 0).all():
        d = 1.0 / np.sqrt(np.where(np.diag(own) > 0.0, np.diag(own), 1.0)) if near else balance(closed)[1]
        step = even(_summed(closed * d / d[:, None], even(residual) * np.outer(d, d))) / np.outer(d, d)
    return assessed(X, gain, poles, residual, (kept, X, Q, spent, crossed), step, p.dt), step


def _summed(A: Array, R: Array) -> Array:
    """Return ``R + A^T R A + A^T^2 R A^2 + ...`` for stable ``A``, doubling the number of terms (Smith 1968)."""
    total, power = R, A
    for _ in range(_MAX_DOUBLINGS):
        more = power.T @ total @ power
        total, power = total + more, power @ power
        if np.abs(more).max() <= EPS * np.abs(total).max():
            break
    return total
