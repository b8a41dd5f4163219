"""Linear-quadratic problems: plants, weights or intensities by signal, checked, and solutions under their assumptions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike
from scipy import linalg

from boomctl.arrays import Array
from boomctl.checks import FASTEST, finite_array, known, real, within
from boomctl.exceptions import SynthesisError
from boomctl.lti.gramians import square_root
from boomctl.lti.hidden_modes import unmoved
from boomctl.lti.rounding import ALIKE, SUMMED
from boomctl.lti.system import Lti, of
from boomctl.synthesis.assumptions import check_hidden_modes
from boomctl.synthesis.lq.riccati import RiccatiProblem, RiccatiSolution, solution_of

Weight: TypeAlias = ArrayLike | Mapping[str, float]
"""A number (the same for each signal), one number a signal, a symmetric matrix, or numbers by signal name."""


def plant_of(system: object, *, sampled: bool = False) -> Lti:
    """Return the matrices and labels of a plant, in discrete time too if ``sampled``.

    Raises
    ------
    TypeError, ValueError
        If it is not a system, or has another time, an entry that is not finite, or no states.
    """
    plant = of(system, sampled=sampled)
    if not len(plant.A):
        raise ValueError("`system` must have at least one state, got a static gain.")
    return plant


def semidefinite(what: str, value: Weight, signals: Sequence[str]) -> Array:
    """Return a weight as a positive semidefinite matrix over ``signals``; signals that a mapping omits have no weight.

    Raises
    ------
    TypeError, ValueError
        If the shape is wrong, if it is not symmetric or semidefinite, or if a name is unknown.
    """
    return _checked(what, value, signals, "semidefinite", -SUMMED * max(len(signals), 1))


def definite(what: str, value: Weight, signals: Sequence[str]) -> Array:
    """Return a weight as a positive definite matrix over ``signals``; a mapping must name all of them.

    Raises
    ------
    TypeError, ValueError
        If the shape is wrong, if it is not symmetric or definite, or if a name is unknown or missing.
    """
    named = value if isinstance(value, Mapping) else signals
    for name in signals:
        if name not in named:
            raise ValueError(f"`{what}` must have a weight for each of {', '.join(signals)}, got none for {name!r}.")
    return _checked(what, value, signals, "definite", SUMMED)


def _checked(what: str, value: Weight, signals: Sequence[str], kind: str, limit: float) -> Array:
    """Return a weight as a matrix whose lowest eigenvalue with unit diagonal, which is free of units, is above a limit."""
    matrix = _matrix(what, value, signals)
    size = np.sqrt(np.abs(np.diag(matrix)))
    coupled = np.abs(matrix).max(axis=1, initial=0.0) > 0.0
    safe = np.where(size > 0.0, size, np.where(coupled, np.sqrt(np.abs(matrix).max(initial=0.0)), 1.0))
    lowest = float(linalg.eigvalsh(matrix / np.outer(safe, safe)).min(initial=np.inf))
    if lowest < limit or (kind == "definite" and lowest == limit):
        raise ValueError(
            f"`{what}` must be positive {kind}, got an eigenvalue of {lowest:.4g}, scaled to a unit diagonal."
        )
    return matrix


def _matrix(what: str, value: Weight, signals: Sequence[str]) -> Array:
    n = len(signals)
    array = np.zeros(n) if isinstance(value, Mapping) else finite_array(what, value)
    for name, number in value.items() if isinstance(value, Mapping) else ():
        array[signals.index(known(f"signal in {what}", name, signals))] = real(f"{what}[{name!r}]", number)
    for entry in np.abs(array[array != 0.0]):
        within(f"modulus of an entry of {what}", float(entry), 1.0 / FASTEST, FASTEST)
    if array.ndim == 0:
        return float(array) * np.eye(n)
    if array.shape == (n,):
        return np.diag(array)
    if array.shape != (n, n):
        raise ValueError(f"`{what}` must be a number, {n} numbers or a {n} by {n} matrix, got shape {array.shape}.")
    asymmetry = np.abs(array - array.T)
    if asymmetry.max(initial=0.0) > ALIKE * np.abs(array).max(initial=0.0):
        i, j = (int(k) for k in np.unravel_index(np.argmax(asymmetry), array.shape))
        raise ValueError(
            f"`{what}` must be symmetric, got {array[i, j]:.6g} at ({i}, {j}) and {array[j, i]:.6g} at ({j}, {i})."
        )
    return 0.5 * (array + array.T)


def solved(problem: RiccatiProblem, kind: str, signals: Sequence[str], states: Sequence[str]) -> RiccatiSolution:
    """Return the solution of a "regulator" or of a "filter", with its gain transposed, after checks of its assumptions.

    Raises
    ------
    SynthesisError
        If a mode that is not stable is hidden from ``signals``, if an undamped one has no weight or no noise, or if the
        solution is not accurate enough.
    """
    of_regulator = kind == "regulator"
    check_hidden_modes("control" if of_regulator else "measurement", problem.A, problem.B, signals, states, problem.dt)
    shifted, _, weight = problem.shifted
    for mode in unmoved(shifted.T, square_root(weight), states, axis_only=True, dt=problem.dt):
        if of_regulator:
            lacking = "has no part in any weight. Weight a state or output in which it has"
        else:
            lacking = "not excited by any process noise. Add noise that excites it"
        raise SynthesisError(f"{mode} is undamped and {lacking}.")
    return solution_of(problem, f"the Riccati equation of the {kind}")
