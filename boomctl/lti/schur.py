"""Frequency responses at many frequencies from one Schur form, a unitary change of coordinates: as stable as solving."""

from dataclasses import dataclass

import numpy as np
from scipy import linalg

from boomctl.arrays import Array
from boomctl.lti.system import Lti

_COLUMNS = 256


@dataclass(frozen=True)
class Triangular:
    """A system with an upper triangular state matrix ``T``: ``C (s - T)^-1 B + D``.

    No frequency asked for may be that of a pole on the imaginary axis.
    """

    T: Array
    B: Array
    C: Array
    D: Array

    def response(self, omega: Array) -> Array:
        """Return the frequency response, shape (outputs, inputs, frequencies), by substitution from the last state."""
        p, m = self.D.shape
        if not (len(self.T) and m and p):
            return np.repeat(self.D[:, :, None].astype(complex), len(omega), axis=2)
        step = max(1, _COLUMNS // m)
        parts = [self._part(1j * omega[i : i + step]) for i in range(0, len(omega), step)]
        return np.concatenate(parts, axis=2) if parts else np.zeros((p, m, 0), complex)

    def _part(self, s: Array) -> Array:
        n, m = self.B.shape
        x, shares = np.empty((n, m, len(s)), complex), 1.0 / (s - np.diagonal(self.T)[:, None])
        flat = x.reshape(n, -1)
        for i in range(n - 1, -1, -1):
            known = (self.T[i, i + 1 :] @ flat[i + 1 :]).reshape(m, len(s))
            x[i] = (self.B[i][:, None] + known) * shares[i]
        return (self.C @ flat).reshape(len(self.C), m, len(s)) + self.D[:, :, None]

    def only(self, chosen: list[int]) -> "Triangular":
        """Return the system from some inputs to the outputs of the same numbers."""
        return Triangular(self.T, self.B[:, chosen], self.C[chosen], self.D[np.ix_(chosen, chosen)])


def triangular(system: Lti) -> Triangular:
    """Return a system in the coordinates of its Schur form."""
    if not len(system.A):
        return Triangular(system.A.astype(complex), system.B.astype(complex), system.C.astype(complex), system.D)
    T, Q = linalg.schur(system.A, output="complex")
    return Triangular(T, Q.conj().T @ system.B, system.C @ Q, system.D)
