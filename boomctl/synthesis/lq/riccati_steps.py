"""The Riccati equation of discrete time, ``X = A^T X A + Q - (A^T X B + N)(R + B^T X B)^-1 (A^T X B + N)^T``.

Solved by structure-preserving doubling (Chu, Fan, Lin & Wang 2004) or, where that does not stabilize, by the generalized
Schur vectors of the extended pencil (Van Dooren 1981, SciPy), then by Newton's method (Hewer 1971); certified apart from
these, by the residual in extended precision, by one more Newton step and by the poles of the closed loop.
"""

from dataclasses import replace

import numpy as np
from scipy import linalg

from boomctl.arrays import Array, balance
from boomctl.exceptions import SynthesisError
from boomctl.lti.modal import sides
from boomctl.lti.rounding import EPS, TINY
from boomctl.lti.system import rates_of
from boomctl.synthesis.lq.riccati import (
    EXTENDED,
    LARGEST_COST_ERROR,
    LARGEST_RESIDUAL,
    RiccatiProblem,
    RiccatiSolution,
    even,
    scaled_size,
    solve_riccati,
)

# Newton steps at most: four make all digits from one; before, each takes three quarters of what the cost is too high
_STEPS = 40
_NEAR = 0.5  # change of the solution, each state scaled by its own cost, below which these are right but for a factor
_GOAL = 1e-13  # change of the solution, each state scaled by its own cost, at which these stop
_DOUBLINGS = (
    64  # of the number of steps: a pole that lies one unit of rounding within the unit circle has decayed after 57
)


def solution_of(problem: RiccatiProblem, what: str) -> RiccatiSolution:
    """Return the stabilizing solution of a problem in either time.

    States that decay and from which no path leads to the weight cost nothing: they are left out, and ``X`` is zero there.
    A solver would leave rounding, which beside a cost of zero is any doubt.

    Raises
    ------
    SynthesisError
        None was found, or the best one found is not exact enough.
    """
    solve = solve_riccati if problem.dt == 0.0 else solve_steps
    kept = _weighted_states(problem)
    others = np.asarray(linalg.eigvals(problem.A[np.ix_(~kept, ~kept)]), dtype=complex)
    if kept.all() or (sides(others, problem.dt) >= 0).any():
        return solve(problem, what)
    n, m = problem.B.shape
    X, F, poles, inside = np.zeros((n, n)), np.zeros((m, n)), others, np.ix_(kept, kept)
    result = RiccatiSolution(X, F, others, 0.0, 0.0, -np.inf, ("zero: nothing is weighed",))
    if kept.any():
        part = replace(problem, A=problem.A[inside], B=problem.B[kept], Q=problem.Q[inside], N=problem.N[kept])
        result = solve(part, what)
        X[inside], F[:, kept] = result.X, result.gain
        poles = np.concatenate([result.poles, others])
    abscissa = float(rates_of(poles, problem.dt).real.max())
    return replace(result, X=X, gain=F, poles=poles, abscissa=abscissa)


def _weighted_states(problem: RiccatiProblem) -> Array:
    """Return which states have a path to the weight, judged by the zeros of the matrices."""
    weighed = (problem.Q != 0.0).any(axis=1) | (problem.N != 0.0).any(axis=1)
    links = problem.A != 0.0
    while True:
        more = weighed | links[weighed].any(axis=0)
        if (more == weighed).all():
            return weighed
        weighed = more


def solve_steps(problem: RiccatiProblem, what: str) -> RiccatiSolution:
    """Return the stabilizing solution of a problem in discrete time.

    Raises
    ------
    SynthesisError
        None was found, or the one found is not exact enough.
    """
    p = problem
    best: RiccatiSolution | None = None
    stages: list[str] = []
    for name, start in _STARTS.items():
        stages.append(name)
        try:
            with np.errstate(over="ignore", invalid="ignore"):  # of what it does not stabilize
                X = start(p)
        except (linalg.LinAlgError, ValueError):
            continue
        if np.isfinite(X).all():
            result = _refined(p, X)
            if best is None or _rank(result, p.dt) < _rank(best, p.dt):
                best = result
            if _rank(best, p.dt) <= 1.0:
                break
    if best is None or _rank(best, p.dt) == np.inf:
        raise SynthesisError(f"{what}: no stabilizing solution was found; eigenvalues lie too close to the unit circle")
    if _rank(best, p.dt) > 1.0:
        raise SynthesisError(
            f"{what}: the solution found is not exact enough to vouch for (relative residual {best.residual:.1e}, cost in "
            f"doubt by {best.cost_error:.1e}, largest pole {np.abs(best.poles).max():.9g})"
        )
    return replace(best, stages=tuple(stages))


def _rank(found: RiccatiSolution, dt: float) -> float:
    """Return what is in doubt of a solution as a share of what may be; ``inf`` of a loop that does not decay."""
    sound = bool((sides(found.poles, dt) < 0).all())
    return max(found.cost_error / LARGEST_COST_ERROR, found.residual / LARGEST_RESIDUAL) if sound else np.inf


def _doubled(p: RiccatiProblem) -> Array:
    """Return the cost of two, four, eight and more steps; what is not weighed is not stabilized."""
    A, acting, H = p.shifted
    G, one = acting @ acting.T, np.eye(len(A))
    for _ in range(_DOUBLINGS):
        solved = np.linalg.solve(one + G @ H, np.hstack([A, G]))
        onward, spread = solved[:, : len(A)], solved[:, len(A) :]
        more = A.T @ H @ onward
        G, H, A = even(G + A @ spread @ A.T), even(H + more), A @ onward
        if not np.abs(more).max() > EPS * np.abs(H).max():
            break
    return H


def _by_schur_vectors(p: RiccatiProblem) -> Array:
    return np.asarray(linalg.solve_discrete_are(p.A, p.B, p.Q, p.R, s=p.N))


# Solvers in the order tried.
_STARTS = {"structure-preserving doubling": _doubled, "SciPy, extended pencil": _by_schur_vectors}


def _refined(p: RiccatiProblem, X: Array) -> RiccatiSolution:
    """Return a solution after Newton steps, as many as make it better."""
    # summed in long numbers: what rounding a solution to double precision leaves of a residual is no doubt of it
    best, step = _certified(p, even(X).astype(np.longdouble if len(X) <= EXTENDED else float), near=False)
    X = best.X
    for _ in range(_STEPS):
        if step is None or best.cost_error <= _GOAL:
            break
        X = even(X + step)
        near = best.cost_error < _NEAR
        result, step = _certified(p, X, near)
        if result.cost_error < best.cost_error or not near:
            best = result
        else:
            break
    return replace(best, X=np.asarray(best.X, dtype=float))


def _certified(p: RiccatiProblem, X: Array, near: bool) -> tuple[RiccatiSolution, Array | None]:
    """Return what is found about a solution, and the Newton step from there; None where it does not stabilize.

    Where ``X`` is ``near``, the step is solved for with each state scaled by its own cost, the scale in which it is judged:
    in any other the rounding of the states that cost most hides those that cost least.
    """
    own = np.asarray(X, dtype=float)
    gain = linalg.solve(p.R + p.B.T @ own @ p.B, p.B.T @ own @ p.A + p.N.T, assume_a="sym")
    closed = p.A - p.B @ gain
    poles = np.asarray(linalg.eigvals(closed), dtype=complex)
    A, B, Q, R, N, F = (np.asarray(part, dtype=X.dtype) for part in (p.A, p.B, p.Q, p.R, p.N, gain))
    moved = A - B @ F  # the form in which what the gain is off counts in second order alone (Joseph's)
    kept, spent, crossed = moved.T @ X @ moved, F.T @ R @ F, N @ F
    residual = np.asarray(kept - X + Q + spent - crossed - crossed.T, dtype=float)
    terms = max(float(np.linalg.norm(np.asarray(term, dtype=float))) for term in (kept, X, Q, spent, crossed))
    step = None
    if (sides(poles, p.dt) < 0).all():
        d = 1.0 / np.sqrt(np.where(np.diag(own) > 0.0, np.diag(own), 1.0)) if near else balance(closed)[1]
        scaled = closed * d / d[:, None]
        step = even(_summed(scaled, even(residual) * np.outer(d, d))) / np.outer(d, d)
    result = RiccatiSolution(
        X,
        gain,
        poles,
        residual=float(np.linalg.norm(residual)) / max(terms, TINY),
        cost_error=float("inf") if step is None else scaled_size(step, own),
        abscissa=float(rates_of(poles, p.dt).real.max()),
    )
    return result, step


def _summed(A: Array, R: Array) -> Array:
    """Return ``R + A^T R A + A^T^2 R A^2 + ...``, twice as many terms at a time (Smith 1968); ``A`` decays."""
    total, power = R, A
    for _ in range(_DOUBLINGS):
        more = power.T @ total @ power
        total, power = total + more, power @ power
        if np.abs(more).max() <= EPS * np.abs(total).max():
            break
    return total
