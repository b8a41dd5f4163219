"""Balanced truncation and singular perturbation by square roots of the Gramians.

Sources: Moore (1981); Tombs & Postlethwaite (1987); Liu & Anderson (1989), whose bounds are twice the sum of the
Hankel singular values that go (Enns 1984, Glover 1984).
"""

from dataclasses import dataclass

import numpy as np
from scipy import linalg

from boomctl.arrays import Array
from boomctl.lti.gramians import factors
from boomctl.lti.modal import ModalSystem
from boomctl.lti.system import Lti

_MINIMAL = 1e-11


@dataclass(frozen=True)
class Balanced:
    """A stable system whose Gramians are both ``diag(values)``, minimal; ``lost`` bounds what was not minimal."""

    system: Lti
    values: Array
    lost: float


def balance(system: Lti, modal: ModalSystem | None) -> Balanced:
    """Return the balanced minimal form of a stable system; ``modal`` as in :func:`factors`."""
    if not len(system.A):
        return Balanced(system, np.zeros(0), 0.0)
    F, H = factors(system, modal)
    U, values, Vt = linalg.svd(H.T @ F, full_matrices=False)
    count = int((values > _MINIMAL * values.max(initial=0.0)).sum())
    root = np.sqrt(values[:count])
    right, left = F @ Vt[:count].T / root, H @ U[:, :count] / root
    form = Lti(left.T @ system.A @ right, left.T @ system.B, system.C @ right, system.D)
    return Balanced(form, values[:count], 2.0 * float(values[count:].sum()))


def truncated(balanced: Balanced, order: int) -> tuple[Lti, float]:
    """Return the leading states of a balanced system, and the bound of the error."""
    A, B, C, D = balanced.system.A, balanced.system.B, balanced.system.C, balanced.system.D
    bound = 2.0 * float(balanced.values[order:].sum()) + balanced.lost
    return Lti(A[:order, :order], B[:order], C[:, :order], D), bound


def perturbed(balanced: Balanced, order: int) -> tuple[Lti, float]:
    """Return the balanced system with its weak states at rest (exact at zero frequency), and the bound of the error."""
    A, B, C, D = balanced.system.A, balanced.system.B, balanced.system.C, balanced.system.D
    bound = 2.0 * float(balanced.values[order:].sum()) + balanced.lost
    r = order
    if r >= len(A):
        return balanced.system, bound
    rest = -np.linalg.solve(A[r:, r:], np.hstack([A[r:, :r], B[r:]]))
    X, U = rest[:, :r], rest[:, r:]
    return Lti(A[:r, :r] + A[:r, r:] @ X, B[:r] + A[:r, r:] @ U, C[:, :r] + C[:, r:] @ X, D + C[:, r:] @ U), bound
