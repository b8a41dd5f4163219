"""Linear systems ``x' = A x + B u``, ``y = C x + D u``: one record for all that is done with them."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy import linalg

from boomctl.arrays import Array

if TYPE_CHECKING:
    import control

_BATCH = 2**16  # entries of the pencils that are solved at once: what stays in the cache


@dataclass(frozen=True)
class Lti:
    """``A, B, C, D`` of a continuous-time system."""

    A: Array
    B: Array
    C: Array
    D: Array

    def response(self, omega: Array) -> Array:
        """Return the frequency response, shape (outputs, inputs, frequencies)."""
        try:
            resolvent = self._resolvent(omega)
        except np.linalg.LinAlgError:
            # exactly on a pole of a mode that may not show: look beside it
            resolvent = self._resolvent(omega * (1.0 + 1e-9) + 1e-12)
        return np.moveaxis(self.C @ resolvent + self.D, 0, 2)

    def _resolvent(self, omega: Array) -> Array:
        n, B = len(self.A), self.B.astype(complex)
        found = np.empty((len(omega), *B.shape), complex)
        step, places = max(1, _BATCH // max(n, 1) ** 2), np.arange(n)
        for i in range(0, len(omega), step):
            s = 1j * omega[i : i + step]
            pencil = np.tile(-self.A.astype(complex), (len(s), 1, 1))
            pencil[:, places, places] += s[:, None]
            found[i : i + step] = np.linalg.solve(pencil, B)
        return found


def state_matrices(system: "control.StateSpace") -> Lti:
    """Return the matrices of a continuous-time system, states balanced.

    Raises
    ------
    ValueError
        Discrete time, or not finite.
    """
    if not system.isctime():
        raise ValueError("sigma and H-infinity norms are of continuous-time systems; this one has a sampling time")
    for name in ("A", "B", "C", "D"):
        if not np.isfinite(getattr(system, name)).all():
            raise ValueError(f"{name} of the state-space system: expected finite numbers")
    if system.nstates == 0:
        return Lti(np.zeros((0, 0)), np.zeros((0, system.ninputs)), np.zeros((system.noutputs, 0)), system.D)
    A, (scale, order) = linalg.matrix_balance(system.A, permute=False, separate=True)
    del order
    return Lti(A, system.B / scale[:, None], system.C * scale[None, :], np.asarray(system.D))
