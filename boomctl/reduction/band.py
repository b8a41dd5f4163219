"""Frequency-limited reduction with a bound.

The Gramians of a band belong to loads ``X = S B B^T + B B^T S^T`` that may be indefinite.  Their absolute value,
``|X| = B_1 B_1^T``, gives a system ``(A, B_1, C_1)`` whose reduction is stable and bounded as any, and of which the
given one is a part: ``B = B_1 T``, ``C = R C_1``.

Sources: Gawronski & Juang (1990), the modified scheme; Gugercin & Antoulas (2004) for the bound.
"""

from dataclasses import dataclass

import numpy as np
from scipy import linalg

from boomctl.arrays import Array
from boomctl.lti.gramians import band_integral
from boomctl.lti.modal import ModalSystem
from boomctl.lti.system import Lti

_RANK = 1e-12
_RESIDUAL = 1e-6


@dataclass(frozen=True)
class Weighted:
    """A system seen through a band: ``G = D + R G_1 T``; an error of ``G_1`` counts ``factor`` times at most."""

    system: Lti
    modal: ModalSystem | None
    R: Array
    T: Array
    D: Array
    factor: float

    def restored(self, reduced: Lti) -> Lti:
        """Return the reduced system between the signals of the given one."""
        return Lti(reduced.A, reduced.B @ self.T, self.R @ reduced.C, self.D + self.R @ reduced.D @ self.T)


def weighted(system: Lti, modal: ModalSystem | None, band: tuple[float, float]) -> Weighted:
    """Return a stable system as its band sees it.

    Raises
    ------
    ValueError
        The band is so far from all poles that it does not show the system.
    """
    S = band_integral(system, modal, band)
    B = _absolute(S @ system.B @ system.B.T)
    C = _absolute(S.T @ system.C.T @ system.C).T
    T, R = np.linalg.lstsq(B, system.B, rcond=None)[0], np.linalg.lstsq(C.T, system.C.T, rcond=None)[0].T
    lost = np.abs(B @ T - system.B).max(initial=0.0), np.abs(R @ C - system.C).max(initial=0.0)
    if lost[0] > _RESIDUAL * np.abs(system.B).max() or lost[1] > _RESIDUAL * np.abs(system.C).max():
        raise ValueError(f"band = {band}: too far from the poles of the system to see all of its inputs and outputs")
    zero = np.zeros((C.shape[0], B.shape[1]))
    own = None
    if modal is not None:
        J = modal.mixing
        own = ModalSystem(modal.poles, J.conj().T @ B, C @ J, zero)
    factor = float(np.linalg.norm(R, 2) * np.linalg.norm(T, 2))
    return Weighted(Lti(system.A, B, C, zero), own, R, T, system.D, factor)


def _absolute(half: Array) -> Array:
    """Return a factor of the absolute value of ``half + half^T``."""
    values, U = linalg.eigh(half + half.T)
    size = np.abs(values)
    good = size > _RANK * size.max(initial=0.0)
    return U[:, good] * np.sqrt(size[good])
