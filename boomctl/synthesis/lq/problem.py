"""What a linear-quadratic design is given, checked: a plant, weights by signal, intensities of noise."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike
from scipy import linalg

from boomctl.arrays import Array
from boomctl.checks import finite_array, known, names, real
from boomctl.lti.system import Lti, of

Weight: TypeAlias = ArrayLike | Mapping[str, float]
"""A number (the same for each signal), one number a signal, a symmetric matrix, or numbers by signal name."""

# Eigenvalue of a weight with unit diagonal, by row, that rounding may have made; a choice, far above eps
_ROUNDING = 1e-12
# sizes of weights and intensities: products of a few of them are numbers still (a choice)
_LEAST, _MOST = 1e-60, 1e60
_ASYMMETRY = 1e-10  # share of the largest entry by which a symmetric matrix may be off: products computed by the user


def plant_of(system: object, *, sampled: bool = False) -> Lti:
    """Return the matrices and names of a plant; in discrete time too if ``sampled``.

    Raises
    ------
    TypeError, ValueError
        Another kind of system, in discrete time, not finite, or without states.
    """
    plant = of(system, sampled=sampled)
    if not len(plant.A):
        raise ValueError("system: expected at least one state, got a static gain")
    return plant


def chosen(what: str, wanted: str | Sequence[str] | None, choices: Sequence[str]) -> tuple[str, ...]:
    """Return names of signals, each known, none twice, at least one; all if ``wanted`` is None."""
    result = names(what, wanted, choices)
    if not result:
        raise ValueError(f"{what}: expected at least one name, got none")
    return result


def semidefinite(what: str, value: Weight, signals: Sequence[str]) -> Array:
    """Return a weight as a positive semidefinite matrix over ``signals``; names a mapping leaves out weigh nothing.

    Raises
    ------
    TypeError, ValueError
        Of the wrong shape, not symmetric, an unknown name, or a negative eigenvalue, which is named.
    """
    matrix = _matrix(what, value, signals)
    lowest = _scaled_lowest(matrix)
    if lowest < -_ROUNDING * max(len(matrix), 1):
        raise ValueError(
            f"{what}: expected a positive semidefinite weight, got an eigenvalue of {_lowest(matrix, lowest):.4g}"
        )
    return matrix


def definite(what: str, value: Weight, signals: Sequence[str]) -> Array:
    """Return a weight as a positive definite matrix over ``signals``, each of which has to weigh something.

    Raises
    ------
    TypeError, ValueError
        Of the wrong shape, not symmetric, an unknown or missing name, or an eigenvalue not above zero, which is named.
    """
    if isinstance(value, Mapping):
        for name in signals:
            if name not in value:
                raise ValueError(f"{what}: expected a weight for each of {', '.join(signals)}; {name!r} has none")
    matrix = _matrix(what, value, signals)
    lowest = _scaled_lowest(matrix)
    if lowest <= _ROUNDING:
        raise ValueError(
            f"{what}: expected a positive definite weight, got an eigenvalue of {_lowest(matrix, lowest):.4g}"
        )
    return matrix


def _matrix(what: str, value: Weight, signals: Sequence[str]) -> Array:
    n = len(signals)
    diagonal = np.zeros(n)
    if isinstance(value, Mapping):
        for name, number in value.items():
            diagonal[signals.index(known(f"signal in {what}", name, signals))] = real(f"{what}[{name!r}]", number)
    array = diagonal if isinstance(value, Mapping) else finite_array(what, value)
    size = np.abs(array[array != 0.0])
    if size.size and not (size.min() >= _LEAST and size.max() <= _MOST):
        wrong = size.min() if size.min() < _LEAST else size.max()
        raise ValueError(f"{what}: expected zeros and numbers from {_LEAST:g} to {_MOST:g} in size, got {wrong:g}")
    if array.ndim == 0:
        return float(array) * np.eye(n)
    if array.shape == (n,):
        return np.diag(array)
    if array.shape != (n, n):
        raise ValueError(f"{what}: expected a number, {n} numbers or a {n} by {n} matrix, got shape {array.shape}")
    if np.abs(array - array.T).max(initial=0.0) > _ASYMMETRY * np.abs(array).max(initial=0.0):
        i, j = (int(k) for k in np.unravel_index(np.argmax(np.abs(array - array.T)), array.shape))
        raise ValueError(
            f"{what}: expected a symmetric matrix, got {array[i, j]:.6g} at ({i}, {j}) and {array[j, i]:.6g} at ({j}, {i})"
        )
    return 0.5 * (array + array.T)


def _scaled_lowest(matrix: Array) -> float:
    """Return the lowest eigenvalue of the matrix scaled to a unit diagonal, so that units do not matter."""
    if not matrix.size:
        return np.inf
    size = np.sqrt(np.abs(np.diag(matrix)))
    bare = np.abs(matrix).max(axis=1) > 0.0
    safe = np.where(size > 0.0, size, np.where(bare, np.sqrt(np.abs(matrix).max()), 1.0))
    return float(linalg.eigvalsh(matrix / np.outer(safe, safe))[0])


def _lowest(matrix: Array, scaled: float) -> float:
    plain = float(linalg.eigvalsh(matrix)[0])
    return plain if (plain < 0.0) == (scaled < 0.0) else scaled


@dataclass(frozen=True)
class Noise:
    """Noise as intensities (two-sided spectral densities); in discrete time as variances at each sample.

    ``W`` is that on ``x'``, ``V`` that on the measurements, ``S`` between the two; ``inputs`` are those it enters by.
    """

    W: Array
    V: Array
    S: Array
    inputs: tuple[str, ...] = ()


def noise_of(
    plant: Lti,
    process_noise: Weight,
    measurement_noise: Weight,
    *,
    measurements: Sequence[str],
    disturbances: str | Sequence[str] | None,
) -> Noise:
    """Return the noise of a plant, checked.

    ``process_noise`` is over the inputs named in ``disturbances``; without these, a mapping is over the inputs that
    it names, and a number, vector or matrix over the states.
    """
    if isinstance(process_noise, Mapping) and disturbances is None:
        disturbances = chosen("process_noise", tuple(process_noise), plant.input_labels)
    V = definite("measurement_noise", measurement_noise, measurements)
    if disturbances is None:
        array = finite_array("process_noise", process_noise)  # type: ignore[arg-type]
        W = semidefinite("process_noise", array, plant.state_labels)
        return Noise(W, V, W[:, :0] @ V[:0])
    entering = chosen("disturbances", disturbances, plant.input_labels)
    intensity = semidefinite("process_noise", process_noise, entering)
    way = plant.select(entering, measurements)
    W, V = way.B @ intensity @ way.B.T, V + way.D @ intensity @ way.D.T
    return Noise(0.5 * (W + W.T), 0.5 * (V + V.T), way.B @ intensity @ way.D.T, entering)
