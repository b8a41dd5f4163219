"""Gramians as solutions of Lyapunov equations, their factors ``P = F F^T``, and those of a range of frequencies."""

import numpy as np
from scipy import linalg

from boomctl.arrays import Array
from boomctl.lti.modal import ModalSystem
from boomctl.lti.rounding import DIGIT
from boomctl.lti.system import Lti

_EXTENDED = 400  # Number of states up to which residuals are summed in extended precision; beyond, that takes seconds.
_SOLVED = 4  # Solutions of a refined Gramian: the first, and corrections that gain about ten digits each.


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
    wide = np.longdouble if len(A) <= _EXTENDED else np.float64
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
    A, eye, log = (system.A, np.eye(len(system.A)), linalg.logm) if modal is None else (modal.poles, 1.0, np.log)

    def until(w: float) -> Array:
        return -0.5j / np.pi * (log(1j * w * eye - A) - log(-1j * w * eye - A))

    inside = until(band[1]) - until(band[0])
    return np.real(inside) if modal is None else modal.real_form(np.diag(inside))
