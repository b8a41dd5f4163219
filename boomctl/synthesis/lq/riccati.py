"""Stabilizing solutions of Riccati equations, refined by Newton's method and certified.

In continuous time ``A^T X + X A + Q - (X B + N) R^-1 (X B + N)^T = 0`` is solved by the Schur vectors of the Hamiltonian
matrix (Laub 1979; SLICOT SB02MD) in scaled modal coordinates. In discrete time ``X = A^T X A + Q - (A^T X B + N)(R + B^T X
B)^-1 (A^T X B + N)^T`` is solved by structure-preserving doubling (Chu, Fan, Lin & Wang 2004) or, where that does not
stabilize, by the generalized Schur vectors of the extended pencil (Van Dooren 1981, SciPy). Newton's method (Kleinman 1968,
Hewer 1971) follows, with residuals in the coordinates of the problem and in extended precision, as iterative refinement of
linear equations.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from functools import cached_property, partial

import numpy as np
import slycot
from scipy import linalg
from slycot.exceptions import SlycotError

from boomctl.arrays import Array, balance
from boomctl.exceptions import SynthesisError
from boomctl.lti.gramians import square_root
from boomctl.lti.modal import sides
from boomctl.lti.rounding import EPS, LEVEL, SUMMED, TINY
from boomctl.lti.system import rates_of, signal_scales
from boomctl.printing import compact

_MAX_CONDITION = 1e10  # Of the eigenvectors; modal coordinates of worse ones leave too few digits for Newton's method.
_LEAST_COUPLING = 1e-24  # Of a mode, relative to the largest one, so that scales are within 1e6.
# Newton steps. Four yield all digits from one; before that, each reduces the excess of the cost by three quarters.
_MAX_STEPS = 40
_NEAR = 0.5  # Cost error below which Newton's method converges quadratically.
_SOLVED = 1e-8  # Newton's method ends at this fraction of the largest errors of a certificate.
MAX_COST_ERROR = 1e-4  # Of a certified solution, relative to the cost.
_MAX_EXTENDED = 300  # States up to which residuals are computed in extended precision, which takes seconds beyond.
_MAX_DOUBLINGS = 64  # A pole within one ulp of the unit circle has decayed after 57.


@dataclass(frozen=True)
class RiccatiProblem:
    """``A, B`` and the weights of ``x^T Q x + 2 x^T N u + u^T R u``; ``dt`` is 0 in continuous time."""

    A: Array
    B: Array
    Q: Array
    R: Array
    N: Array
    dt: float = 0.0

    __repr__ = compact

    @cached_property
    def shifted(self) -> tuple[Array, Array, Array]:
        """``A - B R^-1 N^T``, ``B R^-1/2`` and ``Q - N R^-1 N^T``: the problem without its cross term."""
        L = linalg.cholesky(self.R, lower=True)
        acting = linalg.solve_triangular(L, self.B.T, lower=True).T
        crossed = linalg.solve_triangular(L, self.N.T, lower=True)
        return self.A - acting @ crossed, acting, even(self.Q - crossed.T @ crossed)

    @cached_property
    def costly(self) -> Array:
        """Which states have a cost: not stable ones that no entries of the shifted problem connect to the weight."""
        (A, _, Q), size = self.shifted, np.sqrt(np.maximum(np.diag(self.Q), 0.0))
        costly, links = (np.abs(Q) > SUMMED * np.outer(size, size)).any(axis=1), A != 0.0
        while (more := costly | links[costly].any(axis=0)).sum() > costly.sum():
            costly = more
        others = np.asarray(linalg.eigvals(A[np.ix_(~costly, ~costly)]), dtype=complex)
        return np.asarray(costly | (sides(others, self.dt) >= 0).any())

    def gain(self, X: Array) -> Array:
        """Return ``F`` of ``u = -F x``."""
        moved, effort = (X, self.R) if self.dt == 0.0 else (X @ self.A, self.R + self.B.T @ X @ self.B)
        return linalg.solve(effort, self.B.T @ moved + self.N.T, assume_a="sym")

    def residual(self, X: Array, gain: Array) -> tuple[Array, float]:
        """Return the residual of ``X``, and its norm relative to that of its largest term.

        Products are in extended precision up to 300 states.
        """
        dtype = np.longdouble if len(X) <= _MAX_EXTENDED else float
        parts = (self.A, self.B, self.Q, self.R, self.N, gain, X)
        A, B, Q, R, N, F, x = (np.asarray(part, dtype=dtype) for part in parts)
        if self.dt == 0.0:
            inverse = np.asarray(linalg.inv(self.R), dtype=dtype)
            for _ in range(2):
                inverse = inverse @ (2.0 * np.eye(len(R)) - R @ inverse)
            half, side = A.T @ x, x @ B + N
            terms = half, half.T, Q, -side @ inverse @ side.T
        else:
            moved, crossed = A - B @ F, N @ F  # Joseph's form, in which errors of the gain are of second order
            terms = moved.T @ x @ moved, -x, Q, F.T @ R @ F, -crossed, -crossed.T
        result = np.asarray(sum(terms), dtype=float)
        largest = max(float(np.linalg.norm(np.asarray(term, dtype=float))) for term in terms)
        return result, float(np.linalg.norm(result)) / max(largest, TINY)


@dataclass(frozen=True)
class RiccatiSolution:
    """A stabilizing solution and its errors in the coordinates of the problem, computed independently of the solver.

    Attributes
    ----------
    X : (n, n) ndarray
        The solution.
    gain : (m, n) ndarray
        ``F`` of ``u = -F x``.
    poles : (n,) complex ndarray
        Poles of the closed loop.
    residual : float
        Residual of the equation, relative to the largest of its terms (Frobenius norms). At most 1e-6.
    cost_error : float
        Norm of one more Newton step, each state scaled by its own cost: the relative error of the cost. At most 1e-4.
    abscissa : float
        Largest real part of the closed-loop poles [rad/s]; in discrete time of their rates ``log(z)/dt``.
    stages : tuple of str
        Coordinates and solvers, in the order they were used; the solution is the most accurate of them.
    """

    X: Array = field(repr=False)
    gain: Array = field(repr=False)
    poles: Array = field(repr=False)
    residual: float
    cost_error: float
    abscissa: float
    stages: tuple[str, ...] = ()

    __repr__ = compact

    @property
    def relative_error(self) -> float:
        """The larger of the errors, relative to the largest that are certified; ``inf`` if the loop is not stable."""
        errors = self.cost_error / MAX_COST_ERROR, self.residual / LEVEL
        return max(errors) if self.abscissa < 0.0 else float("inf")


Newton = Callable[[Array, Array], Array]
"""Return the Newton step by the matrix of the loop and the residual."""

Change = tuple[Array, Array]
"""A change of coordinates ``x = T z`` and its inverse."""

Start = tuple[str, Array | None, Newton | None]
"""Coordinates and solver, a solution for Newton's method to begin with and that method's step, or None."""


def solution_of(problem: RiccatiProblem, what: str = "Riccati equation") -> RiccatiSolution:
    """Return the first solution that is accurate enough.

    Raises
    ------
    SynthesisError
        If there is none, or if it is not accurate enough.
    """
    results, stages = [], []
    for stage, X, newton in (_continuous_starts if problem.dt == 0.0 else _discrete_starts)(problem):
        stages.append(stage)
        if X is None or newton is None:
            continue
        results.append(_refined(problem, X, newton))
        if results[-1].relative_error <= 1.0:
            break
    best = min(results, key=lambda result: result.relative_error, default=None)
    if best is None or best.relative_error == np.inf:
        raise SynthesisError(
            f"No stabilizing solution of {what} was found: eigenvalues are too close to the stability boundary."
        )
    if not best.relative_error <= 1.0:
        raise SynthesisError(
            f"The solution of {what} is not accurate enough: relative residual {best.residual:.1e}, cost error"
            f" {best.cost_error:.1e}, abscissa {best.abscissa:.3g} rad/s. Scale the signals, or weight all modes."
        )
    return replace(best, X=np.asarray(best.X, dtype=float), stages=tuple(stages))


def _continuous_starts(problem: RiccatiProblem) -> Iterator[Start]:
    """Yield solutions in modal coordinates, accurate for light damping and fine meshes, and in scaled ones."""
    for name, coordinates in (("modal", _modal), ("scaled", _scaled)):
        change = coordinates(*problem.shifted)
        if change is None:
            yield f"{name} coordinates: none", None, None
            continue
        (A, acting, Q), (T, inverse) = problem.shifted, change
        B = inverse @ acting
        X = schur_solution(inverse @ A @ T, B @ B.T, even(T.T @ Q @ T))
        if X is not None:
            X = even(inverse.T @ X @ inverse)
        yield f"{name} coordinates: SLICOT SB02MD{' failed' if X is None else ''}", X, partial(_continuous_step, change)


def _modal(A: Array, acting: Array, Q: Array) -> Change | None:
    """Return real eigenvectors, scaled so that each mode is coupled equally to controls and weight.

    None if they are nearly dependent.
    """
    poles, V = linalg.eig(A)
    first, second = poles.imag > 0.0, poles.imag < 0.0
    T = np.real(V)
    T[:, first] *= np.sqrt(2.0)
    T[:, second] = -np.sqrt(2.0) * V[:, second].imag
    if np.linalg.cond(T) >= _MAX_CONDITION:
        return None
    inverse = np.linalg.inv(T)
    mode = np.cumsum(~second) - 1
    driven = np.bincount(mode, ((inverse @ acting) ** 2).sum(axis=1))
    weighted = np.bincount(mode, np.maximum(((Q @ T) * T).sum(axis=0), 0.0))
    if not (driven.any() and weighted.any()):
        return T, inverse
    least = _LEAST_COUPLING * driven.max(), _LEAST_COUPLING * weighted.max()
    d = ((np.maximum(driven, least[0]) / np.maximum(weighted, least[1])) ** 0.25)[mode]
    return T * d, inverse / d[:, None]


def _scaled(A: Array, acting: Array, Q: Array) -> Change:
    """Return scaled states, with which the rows and columns of ``[A, acting; Q^1/2, 0]`` have similar norms."""
    d = signal_scales(A, acting, square_root(Q).T)
    return np.diag(d), np.diag(1.0 / d)


def schur_solution(A: Array, G: Array, Q: Array) -> Array | None:
    """Return the stabilizing solution of ``A^T X + X A - X G X + Q = 0`` by Schur vectors; None if that fails."""
    if not len(A):
        return Q
    sizes = np.sqrt([np.linalg.norm(G), np.linalg.norm(Q)])
    scale = float(sizes[1] / sizes[0]) if sizes.all() else 1.0  # SLICOT scales only Q that is larger than G
    try:
        X = scale * slycot.sb02md(len(A), A, G * scale, Q / scale, "C")[0]
    except SlycotError:
        return None
    return X if np.isfinite(X).all() else None


def _refined(problem: RiccatiProblem, X: Array, newton: Newton) -> RiccatiSolution:
    """Return a solution after as many Newton steps as improve it; it is exactly zero for states without a cost."""
    costly = np.outer(problem.costly, problem.costly)
    best, step = _assessed(problem, X * costly, newton)
    for _ in range(_MAX_STEPS):
        if step is None or best.relative_error <= _SOLVED:
            break
        result, step = _assessed(problem, even(best.X + step) * costly, newton)
        if best.cost_error < _NEAR and result.relative_error >= best.relative_error:
            break
        best = result
    return best


def _assessed(problem: RiccatiProblem, X: Array, newton: Newton) -> tuple[RiccatiSolution, Array | None]:
    """Return a solution with its errors, and the Newton step from there; None if the loop is not stable."""
    own = np.asarray(X, dtype=float)
    gain, cost = problem.gain(own), np.maximum(np.diag(own), 0.0)
    closed = problem.A - problem.B @ gain
    poles = np.asarray(linalg.eigvals(closed), dtype=complex)
    abscissa, (residual, error) = float(rates_of(poles, problem.dt).real.max()), problem.residual(X, gain)
    step = newton(closed, residual) if abscissa < 0.0 else None
    cost_error = np.inf if step is None else _scaled_norm(step, cost)
    return RiccatiSolution(X, gain, poles, error, cost_error, abscissa), step


def _continuous_step(change: Change, closed: Array, residual: Array) -> Array:
    """Return the solution of the Lyapunov equation of a loop, solved in other coordinates."""
    T, inverse = change
    balanced, d = balance(inverse @ closed @ T)
    Y = linalg.solve_continuous_lyapunov(balanced.T, -even(T.T @ residual @ T) * np.outer(d, d))
    return even(inverse.T @ (Y / np.outer(d, d)) @ inverse)


def _scaled_norm(step: Array, cost: Array) -> float:
    """Return the norm of a change of a solution, each state scaled by its own cost."""
    inverse = 1.0 / np.sqrt(np.where(cost > 0.0, cost, np.inf))
    return float(np.linalg.norm(step * np.outer(inverse, inverse), 2)) if len(step) else 0.0


def _discrete_starts(problem: RiccatiProblem) -> Iterator[Start]:
    """Yield solutions by doubling, and by Schur vectors for modes without weight that must be stabilized."""
    p = problem
    for name, solver in (
        ("structure-preserving doubling", lambda: _by_doubling(p)),
        ("SciPy, extended pencil", lambda: linalg.solve_discrete_are(p.A, p.B, p.Q, p.R, s=p.N)),
    ):
        try:
            with np.errstate(over="ignore", invalid="ignore"):  # of what is not stabilized
                X = even(solver()).astype(np.longdouble if len(p.A) <= _MAX_EXTENDED else float)
        except ValueError:  # Also `numpy.linalg.LinAlgError`.
            X = None
        yield name, X if X is not None and np.isfinite(X).all() else None, _discrete_step


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


def _discrete_step(closed: Array, residual: Array) -> Array:
    """Return the solution of the equation of a loop, with balanced states."""
    balanced, d = balance(closed)
    return even(_summed(balanced, even(residual) * np.outer(d, d))) / np.outer(d, d)


def _summed(A: Array, R: Array) -> Array:
    """Return ``R + A^T R A + A^T^2 R A^2 + ...`` for stable ``A``, doubling the number of terms (Smith 1968)."""
    total, power = R, A
    for _ in range(_MAX_DOUBLINGS):
        more = power.T @ total @ power
        total, power = total + more, power @ power
        if np.abs(more).max() <= EPS * np.abs(total).max():
            break
    return total


def even(matrix: Array) -> Array:
    """Return the symmetric part of a matrix."""
    return 0.5 * (matrix + matrix.T)
