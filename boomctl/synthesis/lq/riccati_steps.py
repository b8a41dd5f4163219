"""The Riccati equation of discrete time, ``X = A^T X A + Q - (A^T X B + N)(R + B^T X B)^-1 (A^T X B + N)^T``.

Solved by the generalised Schur vectors of the extended pencil (Van Dooren 1981, SciPy), which inverts neither ``A`` nor
``R``, then by Newton's method (Hewer 1971); certified apart from both, by the residual in extended precision, by one more
Newton step and by the poles of the closed loop.
"""

import numpy as np
from scipy import linalg

from boomctl.arrays import Array
from boomctl.lti.modal import sides
from boomctl.lti.system import rates_of
from boomctl.synthesis.assumptions import SynthesisError
from boomctl.synthesis.lq.riccati import (
    LARGEST_COST_ERROR,
    LARGEST_RESIDUAL,
    RiccatiCertificate,
    RiccatiProblem,
    RiccatiSolution,
    scaled_size,
    solve_riccati,
)

_STEPS = 12  # Newton steps at most: the digits double, four make all of them from one
_GOAL = 1e-13  # change of the solution, each state scaled by its own cost, at which these stop
_EXTENDED = 300  # states up to which residuals are computed in long numbers, which take seconds beyond
_TINY = float(np.finfo(float).tiny)


def solution_of(problem: RiccatiProblem, what: str) -> RiccatiSolution:
    """Return the stabilising solution of a problem in either time; see :func:`solve_riccati` and :func:`solve_steps`."""
    return solve_riccati(problem, what) if problem.dt == 0.0 else solve_steps(problem, what)


def solve_steps(problem: RiccatiProblem, what: str) -> RiccatiSolution:
    """Return the stabilising solution of a problem in discrete time.

    Raises
    ------
    SynthesisError
        None was found, or the one found fails its certificate.
    """
    p = problem
    if not (p.Q.any() or p.N.any()) and (sides(linalg.eigvals(p.A), p.dt) < 0).all():
        X = np.zeros_like(p.Q)  # nothing is weighed, and everything decays
    else:
        try:
            X = linalg.solve_discrete_are(p.A, p.B, p.Q, p.R, s=p.N)
        except (linalg.LinAlgError, ValueError):
            raise SynthesisError(
                f"{what}: no stabilising solution was found; eigenvalues lie too close to the unit circle"
            ) from None
    best, step = _certified(p, _even(X))
    for _ in range(_STEPS):
        if step is None or best.certificate.cost_error <= _GOAL:
            break
        found, following = _certified(p, _even(best.X + step))
        if not found.certificate.cost_error < best.certificate.cost_error:
            break
        best, step = found, following
    c = best.certificate
    if not (
        c.cost_error <= LARGEST_COST_ERROR and c.residual <= LARGEST_RESIDUAL and (sides(best.poles, p.dt) < 0).all()
    ):
        raise SynthesisError(
            f"{what}: the solution found is not exact enough to vouch for (relative residual {c.residual:.1e}, cost in "
            f"doubt by {c.cost_error:.1e}, largest pole {np.abs(best.poles).max():.9g})"
        )
    return best


def _certified(p: RiccatiProblem, X: Array) -> tuple[RiccatiSolution, Array | None]:
    """Return a solution with its certificate, and the Newton step from there; None where it does not stabilise."""
    gain = linalg.solve(p.R + p.B.T @ X @ p.B, p.B.T @ X @ p.A + p.N.T, assume_a="sym")
    closed = p.A - p.B @ gain
    poles = np.asarray(linalg.eigvals(closed), dtype=complex)
    kind = np.longdouble if len(X) <= _EXTENDED else float
    A, B, Q, R, N, x, F = (np.asarray(part, dtype=kind) for part in (p.A, p.B, p.Q, p.R, p.N, X, gain))
    moved = A - B @ F  # the form in which what the gain is off counts in second order alone (Joseph's)
    kept, spent, crossed = moved.T @ x @ moved, F.T @ R @ F, N @ F
    residual = np.asarray(kept - x + Q + spent - crossed - crossed.T, dtype=float)
    terms = max(float(np.linalg.norm(np.asarray(term, dtype=float))) for term in (kept, x, Q, spent, crossed))
    sums = [
        np.einsum("ji,jk,ki->i", np.abs(moved), np.abs(x), np.abs(moved)),
        np.abs(np.diag(x)),
        np.diag(Q),
        np.diag(spent),
    ]
    entry = np.asarray(np.sum(sums, axis=0), dtype=float)
    step = None
    if (sides(poles, p.dt) < 0).all():
        d = np.asarray(linalg.matrix_balance(closed, permute=False, separate=True)[1][0])
        scaled = closed * d / d[:, None]
        step = _even(linalg.solve_discrete_lyapunov(scaled.T, _even(residual) * np.outer(d, d))) / np.outer(d, d)
    certificate = RiccatiCertificate(
        residual=float(np.linalg.norm(residual)) / max(terms, _TINY),
        backward_error=float((np.abs(residual) / np.maximum(np.sqrt(np.outer(entry, entry)), _TINY)).max(initial=0.0)),
        cost_error=float("inf") if step is None else scaled_size(step, X),
        abscissa=float(rates_of(poles, p.dt).real.max()),
        path=("as given: SciPy, extended pencil",),
    )
    return RiccatiSolution(X, gain, poles, certificate), step


def _even(matrix: Array) -> Array:
    return 0.5 * (matrix + matrix.T)
