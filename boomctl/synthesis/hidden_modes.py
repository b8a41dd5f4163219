"""Which modes no control can move and no measurement or weight can see, told by frequency and damping.

The eigenvector test of Popov, Belevitch and Hautus, on left eigenvectors of each cluster of poles in balanced
coordinates.  Stable modes may stay as they are; unstable and undamped ones may not.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import linalg

from boomctl.arrays import Array
from boomctl.synthesis.errors import SynthesisError

_WEAK = 1e-9
_AXIS = 1e-9
_ROUNDING = 4.0 * float(np.finfo(float).eps)
_CLUSTER = 1e-6


@dataclass(frozen=True)
class HiddenMode:
    """A mode that a set of columns does not reach.

    Attributes
    ----------
    pole : complex
        Its pole [rad/s], of non-negative imaginary part.
    state : str
        The state that takes the largest part in it, in balanced coordinates.
    """

    pole: complex
    state: str

    @property
    def omega(self) -> float:
        """Natural frequency [rad/s]."""
        return abs(self.pole)

    def __str__(self) -> str:
        size = self.omega
        if size <= 1e-12:
            return f"the mode at 0 rad/s (integrating or rigid-body, mostly in state {self.state!r})"
        damping = -self.pole.real / size if abs(self.pole.real) > _AXIS * size else 0.0
        kind = "unstable, " if damping < -_AXIS else ""
        return f"the mode at {size:.4g} rad/s ({kind}damping {100.0 * damping:.3g} %, mostly in state {self.state!r})"


def check_stabilizable(A: Array, B: Array, controls: Sequence[str], states: Sequence[str]) -> None:
    """Raise :class:`SynthesisError` naming an unstable or undamped mode that the controls cannot move."""
    for mode in unmoved(A, B, states):
        raise SynthesisError(f"{mode} cannot be moved by {_listed(controls)}, and it does not decay by itself")


def check_detectable(A: Array, C: Array, measurements: Sequence[str], states: Sequence[str]) -> None:
    """Raise :class:`SynthesisError` naming an unstable or undamped mode that no measurement sees."""
    for mode in unmoved(A.T, C.T, states):
        raise SynthesisError(f"{mode} is not seen by {_listed(measurements)}, and it does not decay by itself")


def check_weighted(A: Array, root: Array, what: str, states: Sequence[str]) -> None:
    """Raise :class:`SynthesisError` naming a mode on the imaginary axis that the weight ``root root^T`` does not see."""
    for mode in unmoved(A.T, root, states, axis_only=True):
        raise SynthesisError(f"{mode} is undamped and not seen by {what}: weigh a state or output in which it shows")


def check_excited(A: Array, root: Array, what: str, states: Sequence[str]) -> None:
    """Raise :class:`SynthesisError` naming a mode on the imaginary axis that the noise ``root root^T`` does not reach."""
    for mode in unmoved(A, root, states, axis_only=True):
        raise SynthesisError(
            f"{mode} is undamped and not reached by {what}: the estimator would trust its model of it for ever"
        )


def unmoved(
    A: Array, B: Array, states: Sequence[str], *, axis_only: bool = False, stable: bool = False
) -> tuple[HiddenMode, ...]:
    """Return the modes that no column of ``B`` reaches, of conjugate pairs one.

    Parameters
    ----------
    A, B : (n, n) and (n, m) ndarray
        For observability the transposes.
    states : sequence of str
        Names of the states.
    axis_only : bool
        Only modes on the imaginary axis, to rounding, instead of all that do not decay.
    stable : bool
        The modes that do decay as well.
    """
    balanced, (scale, _) = linalg.matrix_balance(A, permute=False, separate=True)
    acting = B / np.asarray(scale)[:, None]
    acting = acting if acting.shape[1] else np.zeros((len(A), 1))
    lengths = np.linalg.norm(acting, axis=0)
    acting = acting / np.where(lengths > 0.0, lengths, 1.0)
    poles, left, right = linalg.eig(balanced, left=True, right=True)  # type: ignore[misc]
    doubt = _doubt(balanced, left, right)
    chosen = _chosen(poles, doubt, axis_only, stable) & (poles.imag >= 0.0)
    found = []
    for cluster in _clusters(poles, doubt, chosen):
        U, values, _ = linalg.svd(left[:, cluster], full_matrices=False)
        basis = U[:, values > _CLUSTER * values[0]]
        directions, reach, _ = linalg.svd(basis.conj().T @ acting)
        reach = np.concatenate([reach, np.zeros(basis.shape[1] - len(reach))])
        for k in np.flatnonzero(reach <= _WEAK):
            shape = basis @ directions[:, k]
            pole = complex(poles[cluster].mean())
            found.append(HiddenMode(pole, str(states[int(np.argmax(np.abs(shape)))])))
    return tuple(found)


def _doubt(A: Array, left: Array, right: Array) -> Array:
    """Return how far rounding may have moved each pole, at most a millionth of the size of the matrix."""
    size = float(np.linalg.norm(A, 2))
    cosine = np.abs(np.einsum("ij,ij->j", left.conj(), right))
    return np.minimum(_ROUNDING * size / np.maximum(cosine, 1e-300), 1e-6 * size)


def _chosen(poles: Array, doubt: Array, axis_only: bool, stable: bool) -> Array:
    if stable:
        return np.ones(len(poles), dtype=bool)
    margin = np.maximum(_AXIS * np.abs(poles), doubt)
    return np.abs(poles.real) <= margin if axis_only else poles.real >= -margin


def _clusters(poles: Array, doubt: Array, chosen: Array) -> list[list[int]]:
    """Return groups of poles that rounding cannot tell apart, each with at least one of those chosen."""
    left = [int(i) for i in np.flatnonzero(chosen)]
    groups = []
    while left:
        seed = left[0]
        near = np.abs(poles - poles[seed]) <= doubt + doubt[seed] + 1e-12 * np.abs(poles)
        group = [int(i) for i in np.flatnonzero(near)]
        groups.append([seed, *(i for i in group if i != seed)])
        left = [i for i in left if i not in group and i != seed]
    return groups


def _listed(signals: Sequence[str]) -> str:
    return ", ".join(signals) if signals else "any control"
