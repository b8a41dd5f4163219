"""Bounds of norms proved by matrix inequalities, whose signs are checked in ball arithmetic (python-flint).

A system is stable and its H-infinity norm is below a level where some ``P > 0`` satisfies the bounded real lemma,
``[A'P + PA + C'C, PB + C'D; ., D'D - level^2] < 0``; in discrete time ``M' diag(P, 1) M - diag(P, level^2) < 0`` with
``M = [A, B; C, D]``.  ``P`` is the solution of a Riccati equation in floats.  How it was found does not matter: the proof
is the sign of the inequality (Rump 2010, Acta Numerica 19).  Likewise a Gramian of controllability, with a little added and
taken off, bounds the H2 norm.
"""

from dataclasses import dataclass
from math import inf

import flint
import numpy as np
from flint import acb, acb_mat, arb, arb_mat, fmpq_mat
from scipy import linalg

from boomctl.arrays import Array, blocks
from boomctl.exact_roots import UndecidedError
from boomctl.lti.bilinear import continuous_image
from boomctl.lti.gramians import refined_gramian
from boomctl.lti.rounding import CERTIFIED
from boomctl.lti.system import Lti

PRECISION = 128  # Bits: sums of products of doubles keep twice the digits of a double.
_CONDITION = 1e10  # Of eigenvectors, beyond which Gramian coordinates take their place: P would have no digits.
_NEWTON_STEPS = 3  # Of a Riccati solution in floats, and in balls: each doubles its digits.
_ROOM = 0.2  # Share of the room between peak and level that the terms added to the modes may take.
_REGULARIZED = 1e-9  # Share of B B' added to all states so that a Gramian of all of them exists.
_MARGIN = 0.1 * CERTIFIED  # Share of a squared H2 norm by which its Gramian is moved to either side.


@dataclass(frozen=True)
class Inequality:
    """A system in coordinates ``x = T z``, in balls that hold its exact matrices, and these in floats.

    Attributes
    ----------
    A, B, C, D : arb_mat
        ``W A T``, ``W B``, ``C T`` and ``D`` with ``W`` the inverse of ``T`` but for rounding.
    unit : arb_mat
        ``W T``.
    near : Lti
        Their midpoints.
    widths : ndarray
        Decay rates of the states [rad/s], of the continuous image in discrete time.
    """

    A: arb_mat
    B: arb_mat
    C: arb_mat
    D: arb_mat
    unit: arb_mat
    near: Lti
    widths: Array

    @classmethod
    def of(cls, A: fmpq_mat, B: fmpq_mat, C: fmpq_mat, D: fmpq_mat, dt: float, peak: float) -> "Inequality":
        """Return a system of rational matrices, in coordinates for levels near ``peak``.

        Raises
        ------
        UndecidedError
            It is not stable in floats.
        """
        flint.ctx.prec = PRECISION
        exact = [arb_mat(M) for M in (A, B, C, D)]
        system = Lti(_middle(exact[0]), _middle(exact[1]), _middle(exact[2]), _middle(exact[3]), dt=dt)
        try:
            T, widths = _coordinates(continuous_image(system), peak)
            W = np.linalg.inv(T)
        except (ValueError, np.linalg.LinAlgError):
            raise UndecidedError from None
        if not (np.isfinite(T).all() and np.isfinite(W).all() and (widths > 0.0).all()):
            raise UndecidedError
        T_, W_ = _balls(T), _balls(W)
        A_, B_, C_, D_ = W_ * exact[0] * T_, W_ * exact[1], exact[2] * T_, exact[3]
        near = Lti(_middle(A_), _middle(B_), _middle(C_), system.D, dt=dt)
        return cls(A_, B_, C_, D_, W_ * T_, near, widths)

    def stays_below(self, level: float, peak: float) -> bool:
        """Return whether it is proved that the system is stable and its H-infinity norm is below a level.

        ``peak`` is a guess of the norm, below the level.
        """
        flint.ctx.prec = PRECISION
        P = self._storage(level, peak)
        if P is None:
            return False
        n, m = self.near.B.shape
        moved = P * self.A
        if self.near.dt == 0.0:
            held = self.unit.transpose() * moved
            corner, side = held + held.transpose(), self.unit.transpose() * (P * self.B)
            last = self.D.transpose() * self.D
        else:
            corner = self.A.transpose() * moved - self.unit.transpose() * P * self.unit
            side = self.A.transpose() * (P * self.B)
            last = self.D.transpose() * self.D + self.B.transpose() * (P * self.B)
        corner, side = (
            (corner + self.C.transpose() * self.C).tolist(),
            (side + self.C.transpose() * self.D).tolist(),
        )
        square, last = arb(level) * arb(level), last.tolist()
        rows = [[-x for x in corner[i]] + [-x for x in side[i]] for i in range(n)]
        rows += [
            [-side[i][j] for i in range(n)] + [(square if j == k else 0) - last[j][k] for k in range(m)]
            for j in range(m)
        ]
        return _positive(P) and _positive(arb_mat(rows))

    def _storage(self, level: float, peak: float) -> arb_mat | None:
        """Return a solution of the Riccati equation halfway between peak and level, with more to each mode; None without one.

        With ``eps_i`` added to ``C'C`` of a mode scaled to ``|b_i|^2 = s_i peak``, the square of the norm grows by at most
        ``sum_i eps_i |b_i|^2/s_i^2``.
        """
        image = continuous_image(self.near)
        A, B, C, D = image.A, image.B, image.C, image.D
        n, m = B.shape
        room = level / peak - 1.0
        added = np.diag(_ROOM * room * self.widths * peak / n)
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
            P = _balls(X)
            if self.near.dt == 0.0:  # With the digits that floats have lost.
                F_, G_, Q_ = map(_balls, (F, G, Q))
                for _ in range(_NEWTON_STEPS):
                    held = F_.transpose() * P
                    residual = _middle(held + held.transpose() + Q_ + P * G_ * P)
                    P = (P + _balls(_newton_step(F + G @ _middle(P), residual))).mid()
        except (np.linalg.LinAlgError, ValueError):
            return None
        return P

    def gain(self, omega: float) -> arb:
        """Return a gain in one direction at a frequency [rad/s], enclosed: the largest but for rounding, never above it."""
        flint.ctx.prec = PRECISION
        dt, D = self.near.dt, acb_mat(self.D)
        if omega < inf:
            s = acb(0, omega) if dt == 0.0 else acb(0, arb(omega) * arb(dt)).exp()
            pencil = s * acb_mat(self.unit) - acb_mat(self.A)
            try:
                G = acb_mat(self.C) * pencil.solve(acb_mat(self.B)) + D
            except ZeroDivisionError:
                return arb(0)
        else:
            G = D
        return enclosed_gain(G) if all(x.is_finite() for x in G.entries()) else arb(0)

    def is_stable(self) -> bool:
        """Return whether it is proved that all poles decay: by the Gramian of states that are excited by their decay."""
        flint.ctx.prec = PRECISION
        try:
            S = _balls(self._gramian(np.diag(np.sqrt(self.widths))))
        except (np.linalg.LinAlgError, ValueError):
            return False
        return _positive(S) and _positive(-1 * self._change(S))

    def _gramian(self, B: Array) -> Array:
        return refined_gramian(self.near.A, B, self.near.dt != 0.0).astype(float)

    def _change(self, P: arb_mat) -> arb_mat:
        """Return ``A P + P A'``, in discrete time ``A P A' - P``."""
        if self.near.dt != 0.0:
            return self.A * P * self.A.transpose() - self.unit * P * self.unit.transpose()
        held = self.A * P * self.unit.transpose()
        return held + held.transpose()

    def energy(self) -> tuple[float, float]:
        """Return two bounds of the H2 norm of a system without feedthrough in continuous time.

        Raises
        ------
        UndecidedError
            The inequalities do not hold.
        """
        flint.ctx.prec = PRECISION
        near = self.near
        try:
            P, S = self._gramian(near.B), self._gramian(np.diag(np.sqrt(self.widths)))
        except (np.linalg.LinAlgError, ValueError):
            raise UndecidedError from None
        square, share = float(np.sum((near.C @ P) * near.C)), float(np.sum((near.C @ S) * near.C))
        if not (0.0 < square < inf and 0.0 < share < inf):
            raise UndecidedError
        step = _MARGIN * square / share
        result = []
        for sign in (-1.0, 1.0):
            moved = _balls(P) + _balls(sign * step * S)
            change = self._change(moved) + self.B * self.B.transpose()
            if not _positive((-1 if sign > 0.0 else 1) * change) or (sign > 0.0 and not _positive(moved)):
                raise UndecidedError
            total = self.C * moved * self.C.transpose() + self.D * self.D.transpose()
            result.append(sum((total[i, i] for i in range(total.nrows())), arb(0)).sqrt())
        low, high = float(result[0].lower()), float(result[1].upper())
        return float(np.nextafter(low, 0.0)), float(np.nextafter(high, inf))  # Of conversions to floats.


def enclosed_gain(G: acb_mat) -> arb:
    """Return the gain of a matrix in one direction, enclosed: the largest but for rounding, never above it."""
    middle = np.array([complex(x) for x in G.entries()]).reshape(G.nrows(), G.ncols())
    v = acb_mat([[acb(x.real, x.imag)] for x in np.linalg.svd(middle)[2][0].conj().tolist()])
    moved, unit = (sum((abs(x) ** 2 for x in vector.entries()), arb(0)) for vector in (G * v, v))
    return (moved / unit).sqrt()


def _coordinates(system: Lti, peak: float) -> tuple[Array, Array]:
    """Return columns ``T`` of coordinates in which a continuous system's levels are proved, and the decay rates there.

    Modes, real and imaginary part of each pair, scaled to ``|b|^2 = s peak``; where eigenvectors are nearly dependent, those
    in which the Gramian of controllability is ``1/peak``.
    """
    poles, _, right = system.eigensystem
    first = poles.imag >= 0.0
    columns, widths = [], []
    for pole, vector in zip(poles[first], right.T[first], strict=True):
        parts = [vector.real, vector.imag] if pole.imag > 0.0 else [vector.real]
        columns += parts
        widths += [-pole.real] * len(parts)
    T, rates = np.array(columns).T, np.array(widths)
    if (rates > 0.0).all() and np.linalg.cond(T) < _CONDITION:
        acts, start = np.linalg.inv(T) @ system.B, 0
        for pole in poles[first]:
            rows = slice(start, start + (2 if pole.imag > 0.0 else 1))
            size = float(np.linalg.norm(acts[rows])) / np.sqrt(rows.stop - rows.start)
            T[:, rows] *= size / np.sqrt(rates[start] * peak) if size > 0.0 else 1.0
            start = rows.stop
        return T, rates
    size = float(np.linalg.norm(system.B)) ** 2
    n = len(system.A)
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


def _balls(M: Array) -> arb_mat:
    return arb_mat(M.shape[0], M.shape[1], M.ravel().tolist())


def _middle(M: arb_mat) -> Array:
    return np.array([float(x.mid()) for x in M.entries()]).reshape(M.nrows(), M.ncols())
