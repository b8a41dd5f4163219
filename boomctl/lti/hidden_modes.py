"""Uncontrollable modes and, by duality, unobservable modes.

The eigenvector test of Popov, Belevitch and Hautus (PBH), on left eigenvectors of each cluster of poles in balanced
coordinates.  Rounding splits a multiple pole, such as that of a rigid body, into several poles with separate eigenvectors: a
direction between these is a separate mode only if it is not coupled to another one.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import linalg

from boomctl.arrays import Array, balance
from boomctl.lti.modal import side_of_axis, sides
from boomctl.lti.rounding import ALIKE, DIGIT, EPS, SUMMED, TINY
from boomctl.lti.system import SLOWEST, rates_of

_FARTHEST = 1e-6  # Limit on the error bound of a pole, relative to the norm of the matrix, for ill-conditioned poles.
# Fraction of the largest singular value below which eigenvectors of a cluster add no direction.
_PARALLEL = 1e-6
# Coupling within a cluster up to this multiple of the error bound of its poles counts as rounding error.
_PASSED = 10.0


@dataclass(frozen=True)
class HiddenMode:
    """An uncontrollable (or, by duality, unobservable) mode.

    Attributes
    ----------
    pole : complex
        Pole [rad/s] with nonnegative imaginary part; in discrete time the rate ``log(z)/dt``.
    state : str
        State with the largest participation, in balanced coordinates.
    """

    pole: complex
    state: str

    @property
    def omega(self) -> float:
        """Natural frequency [rad/s]."""
        return abs(self.pole)

    def __str__(self) -> str:
        size = self.omega
        if size <= SLOWEST:
            return f"the mode at 0 rad/s (integrating or rigid-body, mostly in state {self.state!r})"
        side = int(side_of_axis(np.array([self.pole]))[0])
        damping = -self.pole.real / size if side else 0.0
        kind = "unstable, " if side > 0 else ""
        return f"the mode at {size:.4g} rad/s ({kind}damping {100.0 * damping:.3g} %, mostly in state {self.state!r})"


def unmoved(
    A: Array, B: Array, states: Sequence[str], *, axis_only: bool = False, stable: bool = False, dt: float = 0.0
) -> tuple[HiddenMode, ...]:
    """Return the modes that are uncontrollable from ``B``, one of each conjugate pair.

    Parameters
    ----------
    A, B : (n, n) and (n, m) ndarray
        For observability the transposes.
    states : sequence of str
        Names of the states.
    axis_only : bool
        Only undamped modes, instead of all modes that are not stable.
    stable : bool
        Include stable modes.
    dt : float
        Sampling time [s]; 0 in continuous time.
    """
    balanced, scale = balance(A)
    acting = B / scale[:, None]
    lengths = np.linalg.norm(acting, axis=0)
    acting = acting / np.where(lengths > 0.0, lengths, 1.0)
    poles, left, right = linalg.eig(balanced, left=True, right=True)  # type: ignore[misc]
    # The rounding error of a pole grows as the cosine between its left and right eigenvectors decreases.
    size, cosine = float(np.linalg.norm(balanced, 2)), np.abs(np.einsum("ij,ij->j", left.conj(), right))
    error_bound = np.minimum(DIGIT * size / np.maximum(cosine, TINY), _FARTHEST * size)
    side = sides(poles, dt, error_bound)
    chosen = (poles.imag >= 0.0) & (stable | ((side == 0) if axis_only else (side >= 0)))
    result = []
    for cluster in _clusters(poles, error_bound, chosen):
        U, values, _ = linalg.svd(left[:, cluster], full_matrices=False)
        basis = U[:, values > _PARALLEL * values[0]]
        pole = complex(poles[cluster].mean())
        # Coupling within the cluster, as of a velocity to a position.
        passed = basis.conj().T @ balanced @ basis - pole * np.eye(basis.shape[1])
        rounding = _PASSED * (2.0 * error_bound[cluster].max() + SUMMED * abs(pole))
        passed *= ALIKE / max(rounding, TINY)
        directions, cosines, _ = linalg.svd(np.hstack([basis.conj().T @ acting, passed]))
        for k in np.flatnonzero(cosines <= ALIKE):
            shape = basis @ directions[:, k]
            if dt != 0.0:
                pole = complex(rates_of(np.array([pole if abs(pole) > EPS else EPS]), dt)[0])
            result.append(HiddenMode(pole, str(states[int(np.argmax(np.abs(shape)))])))
    return tuple(result)


def _clusters(poles: Array, error_bound: Array, chosen: Array) -> list[Array]:
    """Return clusters of poles that coincide to within rounding and contain a chosen pole."""
    left, groups = np.flatnonzero(chosen), []
    while len(left):
        seed = left[0]
        groups.append(
            np.flatnonzero(np.abs(poles - poles[seed]) <= error_bound + error_bound[seed] + SUMMED * np.abs(poles))
        )
        left = np.setdiff1d(left, groups[-1])
    return groups
