"""Stabilizing solutions of Riccati equations, refined by Newton's method and certified in the coordinates given.

``A^T X + X A + Q - (X B + N) R^-1 (X B + N)^T = 0``, solved by the Schur vectors of the Hamiltonian matrix (Laub 1979;
SLICOT SB02MD) in modal coordinates scaled so that each mode is as easy to move as to see, then by Newton's method
(Kleinman 1968), which doubles the digits that are right with every step.  On a fine mesh the nodal coordinates lose
them all: the certificate is computed there nevertheless, apart from the solver.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
import slycot
from scipy import linalg
from slycot.exceptions import SlycotError

from boomctl.arrays import Array, balance
from boomctl.exceptions import SynthesisError
from boomctl.lti.rounding import TINY
from boomctl.printing import compact

_CONDITION = 1e10  # of the eigenvectors, from which on modal coordinates keep too few digits to start from (a choice)
_FLOOR = 1e-24  # share of the best driven or seen mode that one which is not counts as, so that scales stay within 1e6
_STEPS = 12  # Newton steps in the coordinates of the solver: the digits double, four make all of them from one
_GOAL = 1e-12  # change of the solution, each state scaled by its own cost, at which these stop: rounding of 50 states
_POLISHING = 4  # Newton steps in the coordinates of the problem, from a solution that is nearly right
_POLISHED = 1e-8  # share of what a certificate allows at which these stop: a cost in doubt by 1e-12
_GOOD = 1e-2  # share of what a certificate allows at which no other coordinates are tried
LARGEST_RESIDUAL = 1e-6  # of a solution that is vouched for, relative to the terms of the equation (a choice)
LARGEST_COST_ERROR = 1e-4  # and share of the cost that may be in doubt (a choice)
EXTENDED = 300  # states up to which residuals are computed in long numbers, which take seconds beyond


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

    @property
    def shifted(self) -> tuple[Array, Array, Array]:
        """``A - B R^-1 N^T``, ``B R^-1/2`` and ``Q - N R^-1 N^T``: the problem without its cross term."""
        L = linalg.cholesky(self.R, lower=True)
        acting = linalg.solve_triangular(L, self.B.T, lower=True).T
        crossed = linalg.solve_triangular(L, self.N.T, lower=True)
        return self.A - acting @ crossed, acting, even(self.Q - crossed.T @ crossed)

    def gain(self, X: Array) -> Array:
        """Return ``F = R^-1 (B^T X + N^T)``, for ``u = -F x``."""
        return linalg.solve(self.R, self.B.T @ X + self.N.T, assume_a="pos")

    def terms(self, X: Array) -> tuple[Array, Array]:
        """Return ``A^T X`` and ``(X B + N) R^-1 (X B + N)^T``, what control takes off the cost."""
        half = linalg.solve_triangular(linalg.cholesky(self.R, lower=True), self.B.T @ X + self.N.T, lower=True)
        return self.A.T @ X, half.T @ half

    def residual(self, X: Array, extended: bool = False) -> Array:
        """Return the residual of ``X``; if ``extended``, with products in the longest floating-point numbers at hand."""
        if not extended:
            half, drop = self.terms(X)
            return half + half.T + self.Q - drop
        A, B, Q, R, N, x = (
            np.asarray(part, dtype=np.longdouble) for part in (self.A, self.B, self.Q, self.R, self.N, X)
        )
        inverse = np.asarray(linalg.inv(self.R), dtype=np.longdouble)
        for _ in range(2):
            inverse = inverse @ (2.0 * np.eye(len(R)) - R @ inverse)
        half, side = A.T @ x, x @ B + N
        return np.asarray(half + half.T + Q - side @ inverse @ side.T, dtype=float)


@dataclass(frozen=True)
class RiccatiSolution:
    """A stabilizing solution, and what was found about it in the coordinates of the problem and apart from the solver.

    Attributes
    ----------
    X : (n, n) ndarray
        The solution.
    gain : (m, n) ndarray
        ``F`` of ``u = -F x``.
    poles : (n,) complex ndarray
        Poles of the loop that it closes.
    residual : float
        Residual of the equation, relative to the largest of its terms (Frobenius norms).
    cost_error : float
        Size of one more Newton step, each state scaled by its own cost: how much of the cost is in doubt.  Above 1e-4,
        or with a residual above 1e-6, no solution is returned.
    abscissa : float
        Largest real part of the closed-loop poles [rad/s]; in discrete time of their rates ``log(z)/dt``.
    stages : tuple of str
        Coordinates and solvers tried, in that order; the most exact of their solutions is the one.
    """

    X: Array = field(repr=False)
    gain: Array = field(repr=False)
    poles: Array = field(repr=False)
    residual: float
    cost_error: float
    abscissa: float
    stages: tuple[str, ...] = ()

    __repr__ = compact


Change = tuple[Array, Array]
"""A change of coordinates ``x = T z`` and its inverse."""


def _modal(A: Array, acting: Array, Q: Array) -> Change | None:
    """Return a real basis of eigenvectors, two columns a complex pair, or None where they are nearly dependent."""
    poles, V = linalg.eig(A)
    first, second = poles.imag > 0.0, poles.imag < 0.0
    T = np.real(V)
    T[:, first] *= np.sqrt(2.0)
    T[:, second] = -np.sqrt(2.0) * V[:, second].imag
    if np.linalg.cond(T) >= _CONDITION:
        return None
    inverse = np.linalg.inv(T)
    d = _mode_scales(inverse @ acting, T.T @ Q @ T, mode=np.cumsum(~second) - 1)
    return T * d, inverse / d[:, None]


def _balanced(A: Array, acting: Array, Q: Array) -> Change:
    scale = balance(A)[1]
    one = np.zeros(len(A), dtype=int)
    d = scale * _mode_scales(acting / scale[:, None], Q * np.outer(scale, scale), mode=one)
    return np.diag(d), np.diag(1.0 / d)


def _as_given(A: Array, acting: Array, Q: Array) -> Change:
    return np.eye(len(A)), np.eye(len(A))


def _mode_scales(acting: Array, Q: Array, mode: Array) -> Array:
    """Return scales, one a mode, under which controls and weight act on it alike."""
    count = int(mode.max(initial=-1)) + 1
    g, q = np.zeros(count), np.zeros(count)
    np.add.at(g, mode, (acting**2).sum(axis=1))
    np.add.at(q, mode, np.maximum(np.diag(Q), 0.0))
    if g.max(initial=0.0) <= 0.0 or q.max(initial=0.0) <= 0.0:
        return np.ones(len(mode))
    return ((np.maximum(g, _FLOOR * g.max()) / np.maximum(q, _FLOOR * q.max())) ** 0.25)[mode]


# Coordinates in the order tried.  Modal ones keep the digits of light damping and fine meshes; double poles have none, and
# are solved in scaled states; those of the problem are left for what neither solves.
_COORDINATES: dict[str, Callable[[Array, Array, Array], Change | None]] = {
    "modal": _modal,
    "balanced": _balanced,
    "given": _as_given,
}


def solve_riccati(problem: RiccatiProblem, what: str = "Riccati equation") -> RiccatiSolution:
    """Return the most exact stabilizing solution of those found in one set of coordinates after the other.

    Raises
    ------
    SynthesisError
        None was found, or the best one found is not exact enough.
    """
    best: RiccatiSolution | None = None
    stages: list[str] = []
    A, acting, Q = problem.shifted
    for name, coordinates in _COORDINATES.items():
        change = coordinates(A, acting, Q)
        if change is None:
            stages.append(f"{name} coordinates: none")
            continue
        T, inverse = change
        own = RiccatiProblem(
            inverse @ A @ T, inverse @ acting, even(T.T @ Q @ T), np.eye(acting.shape[1]), np.zeros_like(acting)
        )
        solver, Z = _start(own)
        stages.append(f"{name} coordinates: {solver}")
        Z = None if Z is None else _refined(own, Z)
        if Z is None:
            continue
        result = _polished(problem, even(inverse.T @ Z @ inverse))
        if best is None or _rank(result) < _rank(best):
            best = result
        if _rank(best) <= _GOOD:
            break
    if best is None:
        raise SynthesisError(f"{what}: no stabilizing solution was found; eigenvalues lie too close to the axis")
    if not _rank(best) <= 1.0:
        raise SynthesisError(
            f"{what}: the best solution found is not exact enough to vouch for (relative residual {best.residual:.1e}, "
            f"cost in doubt by {best.cost_error:.1e}, largest real part of the poles {best.abscissa:.3g} rad/s)"
        )
    return replace(best, stages=tuple(stages))


def _rank(c: RiccatiSolution) -> float:
    """Return what is in doubt of a solution as a share of what may be; ``inf`` where it does not stabilize."""
    return max(c.cost_error / LARGEST_COST_ERROR, c.residual / LARGEST_RESIDUAL) if c.abscissa < 0.0 else np.inf


def _start(own: RiccatiProblem) -> tuple[str, Array | None]:
    """Return the solver that answered, and its solution: Schur vectors by SLICOT or, where that refuses, by SciPy."""
    scaling = "G" if own.Q.any() and own.B.any() else "N"
    solver = "SLICOT SB02MD"
    try:
        X = slycot.sb02md(len(own.A), own.A.copy(), own.B @ own.B.T, own.Q.copy(), "C", scal=scaling)[0]
    except SlycotError:
        solver = "SLICOT SB02MD refused, SciPy"
        try:
            X = linalg.solve_continuous_are(own.A, own.B, own.Q, own.R)
        except (linalg.LinAlgError, ValueError):
            return f"{solver} refused", None
    return (solver, even(np.asarray(X))) if np.isfinite(X).all() else (f"{solver}: not finite", None)


def _refined(own: RiccatiProblem, X: Array) -> Array | None:
    """Return a solution after Newton steps, as many as make it better; None if it does not stabilize."""
    last = np.inf
    for _ in range(_STEPS):
        step, _ = newton_step(own, X, own.residual(X))
        if step is None:
            return None if not np.isfinite(last) else X
        size = scaled_size(step, X + step)
        if size >= 0.5 * last:
            return X
        X, last = even(X + step), size
        if size <= _GOAL:
            return X
    return X


def newton_step(problem: RiccatiProblem, X: Array, residual: Array) -> tuple[Array | None, Array]:
    """Return the change of ``X`` that Newton's method makes (None where ``X`` does not stabilize) and the poles."""
    closed, d = balance(problem.A - problem.B @ problem.gain(X))
    T, Z = linalg.schur(closed, output="complex")
    poles = np.asarray(np.diag(T), dtype=complex)
    if _abscissa(poles) >= 0.0:
        return None, poles
    solve = linalg.get_lapack_funcs("trsyl", (T,))
    scaled = even(residual) * np.outer(d, d)
    Y, scale, _ = solve(T, T, -(Z.conj().T @ scaled @ Z), trana="C")
    return even(np.real(Z @ (Y / scale) @ Z.conj().T)) / np.outer(d, d), poles


def _polished(problem: RiccatiProblem, X: Array) -> RiccatiSolution:
    """Return a solution after Newton steps in the coordinates of the problem, as long as they help."""
    best, step = _certified(problem, X)
    for _ in range(_POLISHING):
        if step is None or _rank(best) <= _POLISHED:
            break
        result, step = _certified(problem, even(best.X + step))
        if _rank(result) >= _rank(best):
            break
        best = result
    poles = np.asarray(linalg.eigvals(problem.A - problem.B @ best.gain))
    return replace(best, poles=poles, abscissa=_abscissa(poles))


def _certified(problem: RiccatiProblem, X: Array) -> tuple[RiccatiSolution, Array | None]:
    """Return what is found about a solution, and the Newton step from there."""
    residual = problem.residual(X, extended=len(X) <= EXTENDED)
    terms = max(float(np.linalg.norm(term)) for term in (*problem.terms(X), problem.Q))
    step, poles = newton_step(problem, X, residual)
    result = RiccatiSolution(
        X,
        problem.gain(X),
        poles,
        residual=float(np.linalg.norm(residual)) / max(terms, TINY),
        cost_error=np.inf if step is None else scaled_size(step, X),
        abscissa=_abscissa(poles),
    )
    return result, step


def scaled_size(step: Array, X: Array) -> float:
    """Return the size of a change of ``X``, each state scaled by its own cost."""
    size = np.sqrt(np.maximum(np.diag(X), 0.0))
    inverse = np.where(size > 0.0, 1.0 / np.where(size > 0.0, size, 1.0), 0.0)
    return float(np.linalg.norm(step * np.outer(inverse, inverse), 2)) if len(X) else 0.0


def _abscissa(poles: Array) -> float:
    return float(np.max(np.real(poles)))


def even(matrix: Array) -> Array:
    """Return the symmetric part of a matrix."""
    return 0.5 * (matrix + matrix.T)
