"""Gramians as factors, ``P = F F^T``: in closed form in modal coordinates, otherwise from Lyapunov equations."""

import numpy as np
from scipy import linalg

from boomctl.arrays import Array
from boomctl.lti.modal import ModalSystem
from boomctl.lti.rounding import DIGIT
from boomctl.lti.system import Lti

EXTENDED = 400  # Number of states up to which residuals are summed in extended precision; beyond, that takes seconds.
_SOLVED = 4  # Solutions of a refined Gramian: the first, and corrections that gain about ten digits each.


def factors(system: Lti, modal: ModalSystem | None) -> tuple[Array, Array]:
    """Return factors of the Gramians of controllability and observability, ``P = F F^T`` and ``Q = H H^T``.

    In modal coordinates ``P_ij = -b_i b_j^*/(p_i + p_j^*)``.  ``modal`` is the same system in modal coordinates, the
    real form of which is ``system``, or None.
    """
    if modal is None:
        P, Q = refined_gramian(system.A, system.B), refined_gramian(system.A.T, system.C.T)
        return square_root(P.astype(float)), square_root(Q.astype(float))
    J = modal.mixing
    P, Q = _closed_form(modal.poles, modal.B), _closed_form(modal.poles.conj(), modal.C.conj().T)
    return square_root(np.real(J @ P @ J.conj().T)), square_root(np.real(J @ Q @ J.conj().T))


def _closed_form(poles: Array, B: Array) -> Array:
    return -(B @ B.conj().T) / (poles[:, None] + poles.conj()[None, :])


def square_root(P: Array) -> Array:
    """Return a factor ``F`` of a positive semidefinite matrix ``P = F F^T``, with as many columns as its rank.

    The matrix is first scaled to a unit diagonal, which keeps weak entries accurate.
    """
    size = np.sqrt(np.maximum(np.diag(P), 0.0))
    safe = np.where(size > 0.0, size, 1.0)
    scaled = P / np.outer(safe, safe)
    values, U = linalg.eigh(0.5 * (scaled + scaled.T))
    good = values > DIGIT * len(P) * max(float(values.max(initial=0.0)), 0.0)
    return size[:, None] * (U[:, good] * np.sqrt(values[good]))


def gramian(A: Array, B: Array, steps: bool = False) -> Array:
    """Return the solution of ``A P + P A^T + B B^T = 0``, of ``steps`` ``A P A^T - P + B B^T = 0``."""
    return _lyapunov(A, B @ B.T, steps)


def refined_gramian(A: Array, B: Array, steps: bool = False) -> Array:
    """Return the solution of ``A P + P A^T + B B^T = 0``, of ``steps`` ``A P A^T - P + B B^T = 0``, in extended precision."""
    wide = np.longdouble if len(A) <= EXTENDED else np.float64
    A_, B_ = A.astype(wide), B.astype(wide)
    P, BB = np.zeros(A.shape, dtype=wide), B_ @ B_.T
    left = BB
    for _ in range(_SOLVED):
        P = P + _lyapunov(A, left.astype(float), steps)
        P = wide(0.5) * (P + P.T)
        AP = A_ @ P
        left = (AP @ A_.T - P if steps else AP + AP.T) + BB
    return P


def _lyapunov(A: Array, Q: Array, steps: bool) -> Array:
    """Return the solution of ``A P + P A^T + Q = 0``, of ``steps`` ``A P A^T - P + Q = 0``."""
    return linalg.solve_discrete_lyapunov(A, Q, "bilinear") if steps else linalg.solve_continuous_lyapunov(A, -Q)


def band_integral(system: Lti, modal: ModalSystem | None, band: tuple[float, float]) -> Array:
    """Return ``1/(2 pi)`` times the integral of ``(i w - A)^-1`` over ``w1 <= |w| <= w2``, real.

    Source: Gawronski & Juang (1990), Int. J. Systems Science 21.
    """
    low, high = band
    if modal is not None:
        weights = _modal_integral(modal.poles, high) - _modal_integral(modal.poles, low)
        J = modal.mixing
        return np.real((J * weights) @ J.conj().T)
    eye = np.eye(len(system.A))

    def until(w: float) -> Array:
        return -0.5j / np.pi * (linalg.logm(1j * w * eye - system.A) - linalg.logm(-1j * w * eye - system.A))

    return np.real(until(high) - until(low))


def _modal_integral(poles: Array, w: float) -> Array:
    return -0.5j / np.pi * (np.log(1j * w - poles) - np.log(-1j * w - poles))
