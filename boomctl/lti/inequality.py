"""Bounds of norms proved by matrix inequalities, whose signs are checked in ball arithmetic (python-flint).

A system is stable and its H-infinity norm is below a level where some ``P > 0`` satisfies the bounded real lemma,
``[A'P + PA + C'C, PB + C'D; ., D'D - level^2] < 0``; of a discrete system its image by the bilinear map does.  ``P`` is the
solution of a Riccati equation in floats.  The proof does not depend on its accuracy, only on the sign of the inequality (Rump
2010, Acta Numerica 19).  A controllability Gramian, shifted by a small multiple in both directions, bounds the H2 norm.
"""

from dataclasses import dataclass
from math import inf

import flint
import numpy as np
from flint import acb, acb_mat, arb, arb_mat, fmpq_mat
from scipy import linalg

from boomctl.arrays import Array, blocks
from boomctl.exact_roots import UndecidedError
from boomctl.lti.bilinear import image_of_omega
from boomctl.lti.gramians import refined_gramian
from boomctl.lti.modal import partial_fractions
from boomctl.lti.rounding import CERTIFIED
from boomctl.lti.system import Lti

PRECISION = 128  # Bits: sums of products of doubles need twice the precision of a double.
_REGULARIZED = 1e-9  # Fraction of |B|^2 added to all states so that the Gramian is positive definite.
_CONDITION = 1e10  # Eigenvector condition above which Gramian coordinates are used: P would have no accuracy.
_NEWTON_STEPS = 3  # Newton steps of a Riccati solution, in floats and in balls; each doubles the accuracy.
_GAP_FRACTION = 0.2  # Largest fraction of the gap between peak and level for the terms added to the modes.
_MARGIN = 0.1 * CERTIFIED  # Fraction of a squared H2 norm by which its Gramian is shifted to either side.

Matrices = tuple[arb_mat, arb_mat, arb_mat, arb_mat]


@dataclass(frozen=True)
class Inequality:
    """A system in continuous time, or the image of a discrete one, in coordinates ``x = T z``, in balls.

    Attributes
    ----------
    A, B, C, D : arb_mat
        Inverse of ``T`` times ``A T`` and ``B``, ``C T`` and ``D``.
    read, through : arb_mat
        ``C T`` and ``D`` of the system itself.
    near : Lti
        Midpoints of the first four.
    widths : ndarray
        Decay rates of the states [rad/s].
    dt : float
        Sampling time of the system itself [s]; 0 in continuous time.
    """

    A: arb_mat
    B: arb_mat
    C: arb_mat
    D: arb_mat
    read: arb_mat
    through: arb_mat
    near: Lti
    widths: Array
    dt: float

    @classmethod
    def of(cls, A: fmpq_mat, B: fmpq_mat, C: fmpq_mat, D: fmpq_mat, dt: float, peak: float) -> "Inequality | None":
        """Return a system of rational matrices, for levels near ``peak``; None without stable poles in floats."""
        flint.ctx.prec = PRECISION
        matrices = exact = arb_mat(A), arb_mat(B), arb_mat(C), arb_mat(D)
        try:
            if dt != 0.0:
                exact = _image(*matrices, dt)
            T, widths = _coordinates(_middles(exact), peak)
            T_ = _balls(T)
            W = T_.inv()
        except (ValueError, ZeroDivisionError, np.linalg.LinAlgError):
            return None
        if not (all(x.is_finite() for x in W.entries()) and (widths > 0.0).all()):
            return None
        A_, B_, C_, D_ = W * exact[0] * T_, W * exact[1], exact[2] * T_, exact[3]
        near = _middles((A_, B_, C_, D_))
        return cls(A_, B_, C_, D_, matrices[2] * T_, matrices[3], near, widths, dt)

    def stays_below(self, level: float, peak: float) -> bool:
        """Return whether it is proved that the system is stable and its H-infinity norm is below a level.

        ``peak`` is a guess of the norm, below the level.
        """
        flint.ctx.prec = PRECISION
        P = self._storage(level, peak)
        if P is None:
            return False
        n, m = self.near.B.shape
        moved, read = _hstack(self.A, self.B), _hstack(self.C, self.D)
        held = _hstack(arb_mat(n, n, 1), arb_mat(n, m)).transpose() * (P * moved)
        S = -1 * (held + held.transpose() + read.transpose() * read)
        for k in range(n, n + m):
            S[k, k] += arb(level) * arb(level)
        return _positive(P) and _positive(S)

    def _storage(self, level: float, peak: float) -> arb_mat | None:
        """Return a solution of the Riccati equation midway between peak and level, with regularized modes; None without one.

        With ``eps_i`` added to ``C'C`` of a mode scaled to ``|b_i|^2 = s_i peak``, the square of the norm grows by at most
        ``sum_i eps_i |b_i|^2/s_i^2``.
        """
        A, B, C, D = self.near.A, self.near.B, self.near.C, self.near.D
        n, m = B.shape
        added = np.diag(_GAP_FRACTION * (level / peak - 1.0) * self.widths * peak / n)
        gap = (peak + 0.5 * (level - peak)) ** 2 * np.eye(m) - D.T @ D
        try:
            inverse = np.linalg.inv(gap)
            F, G = A + B @ inverse @ D.T @ C, B @ inverse @ B.T
            Q = C.T @ C + added + C.T @ D @ inverse @ D.T @ C
            _, Z, count = linalg.schur(blocks([[F, G], [-Q, -F.T]]), sort="lhp")
            if count != n:
                return None
            X = np.linalg.solve(Z[:n, :n].T, Z[n:, :n].T).T
            X = 0.5 * (X + X.T)
            for _ in range(_NEWTON_STEPS):
                X = X + _newton_step(F + G @ X, F.T @ X + X @ F + Q + X @ G @ X)
            P, (F_, G_, Q_) = _balls(X), map(_balls, (F, G, Q))
            for _ in range(_NEWTON_STEPS):
                held = F_.transpose() * P
                residual = _middle(held + held.transpose() + Q_ + P * G_ * P)
                P = (P + _balls(_newton_step(F + G @ _middle(P), residual))).mid()
        except (np.linalg.LinAlgError, ValueError):
            return None
        return P

    def gain(self, omega: float) -> arb:
        """Return a gain in one direction near a frequency [rad/s], enclosed: the largest but for rounding, not above it."""
        flint.ctx.prec = PRECISION
        n, G, s = self.A.nrows(), acb_mat(self.D), acb(0, float(image_of_omega(omega, self.dt)))
        if s.is_finite():
            try:
                G += acb_mat(self.C) * (acb_mat(n, n, s) - acb_mat(self.A)).solve(acb_mat(self.B))
            except ZeroDivisionError:
                return arb(0)
        return enclosed_gain(G) if all(x.is_finite() for x in G.entries()) else arb(0)

    def is_stable(self) -> bool:
        """Return whether stability is proved, by the Gramian of states that are excited by their decay rates."""
        flint.ctx.prec = PRECISION
        try:
            S = _balls(self._gramian(np.diag(np.sqrt(self.widths))))
        except (np.linalg.LinAlgError, ValueError):
            return False
        return _positive(S) and _positive(-1 * self._change(S))

    def _gramian(self, B: Array) -> Array:
        return refined_gramian(self.near.A, B).astype(float)

    def _change(self, P: arb_mat) -> arb_mat:
        """Return ``A P + P A'``."""
        held = self.A * P
        return held + held.transpose()

    def energy(self) -> tuple[float, float]:
        """Return lower and upper bound of the H2 norm of a system without feedthrough in continuous time.

        Raises
        ------
        UndecidedError
            If the inequalities do not hold.
        """
        flint.ctx.prec = PRECISION
        read = _middle(self.read)
        try:
            P, S = self._gramian(self.near.B), self._gramian(np.diag(np.sqrt(self.widths)))
        except (np.linalg.LinAlgError, ValueError):
            raise UndecidedError from None
        square, shift = float(np.sum((read @ P) * read)), float(np.sum((read @ S) * read))
        if not (0.0 < square < inf and 0.0 < shift < inf):
            raise UndecidedError
        result = []
        for sign in (-1, 1):
            moved = _balls(P) + _balls(sign * _MARGIN * square / shift * S)
            left = self._change(moved) + self.B * self.B.transpose()
            if not _positive(-sign * left) or (sign > 0 and not _positive(moved)):
                raise UndecidedError
            total = self.read * moved * self.read.transpose() + self.through * self.through.transpose()
            result.append(sum((total[i, i] for i in range(total.nrows())), arb(0)).sqrt())
        low, high = float(result[0].lower()), float(result[1].upper())
        return float(np.nextafter(low, 0.0)), float(np.nextafter(high, inf))  # Of conversions to floats.


def enclosed_gain(G: acb_mat) -> arb:
    """Return the gain of a matrix in one direction, enclosed: the largest to within rounding, never above it."""
    middle = np.array([complex(x) for x in G.entries()]).reshape(G.nrows(), G.ncols())
    v = acb_mat([[acb(x.real, x.imag)] for x in np.linalg.svd(middle)[2][0].conj().tolist()])
    moved, unit = (sum((abs(x) ** 2 for x in vector.entries()), arb(0)) for vector in (G * v, v))
    return (moved / unit).sqrt()


def _image(A: arb_mat, B: arb_mat, C: arb_mat, D: arb_mat, dt: float) -> Matrices:
    """Return the image of a discrete system by the bilinear map, with the same Gramians."""
    eye, g = arb_mat(A.nrows(), A.nrows(), 1), arb(2) / arb(dt)
    side, inverse = (2 * g).sqrt(), (A + eye).inv()
    return inverse * (A - eye) * g, inverse * B * side, C * inverse * side, D - C * inverse * B


def _coordinates(system: Lti, peak: float) -> tuple[Array, Array]:
    """Return columns ``T`` of coordinates in which a continuous system's levels are proved, and the decay rates there.

    Modes, real and imaginary part of each pair, scaled to ``|b|^2 = s peak``; where eigenvectors are nearly dependent, those
    in which the Gramian of controllability is ``1/peak``.
    """
    modes = partial_fractions(system)
    rates, sizes = -modes.poles.real, np.linalg.norm(modes.B, axis=1)
    T = np.real(system.eigensystem[2] @ modes.mixing.conj().T)
    if (rates > 0.0).all() and np.linalg.cond(T) < _CONDITION:
        return T * np.where(sizes > 0.0, sizes / np.sqrt(rates * peak), 1.0), rates
    n, size = len(system.A), float(np.linalg.norm(system.B)) ** 2
    P = linalg.solve_continuous_lyapunov(system.A, -system.B @ system.B.T - _REGULARIZED * size * np.eye(n))
    L = np.linalg.cholesky(0.5 * (P + P.T))
    return L / np.sqrt(peak), np.full(n, 1e-3 * size / float(np.linalg.norm(P, 2)))


def _newton_step(closed: Array, residual: Array) -> Array:
    step = linalg.solve_continuous_lyapunov(closed.T, -0.5 * (residual + residual.T))
    return 0.5 * (step + step.T)


def _positive(S: arb_mat) -> bool:
    """Return whether it is proved that a symmetric matrix is positive definite: ``X S X'`` is close to one."""
    middle = _middle(S)
    middle, diagonal = 0.5 * (middle + middle.T), np.diag(middle)
    if not (np.isfinite(middle).all() and (diagonal > 0.0).all()):
        return False
    scale = 1.0 / np.sqrt(diagonal)
    try:
        L = np.linalg.cholesky(scale[:, None] * middle * scale)
    except np.linalg.LinAlgError:
        return False
    X = _balls(linalg.solve_triangular(L, np.diag(scale), lower=True))
    product = X * S * X.transpose()
    for i in range(product.nrows()):
        product[i, i] -= 1
    return all(sum((abs(x) for x in row), arb(0)) < 1 for row in product.tolist())


def _hstack(left: arb_mat, right: arb_mat) -> arb_mat:
    return arb_mat([one + other for one, other in zip(left.tolist(), right.tolist(), strict=True)])


def _balls(M: Array) -> arb_mat:
    return arb_mat(M.shape[0], M.shape[1], M.ravel().tolist())


def _middle(M: arb_mat) -> Array:
    return np.array([float(x.mid()) for x in M.entries()]).reshape(M.nrows(), M.ncols())


def _middles(matrices: Matrices) -> Lti:
    A, B, C, D = map(_middle, matrices)
    return Lti(A, B, C, D)
