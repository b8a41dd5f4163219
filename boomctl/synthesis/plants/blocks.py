"""Named weights and the plumbing that joins them with a plant, in matrices."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy import linalg

from boomctl.arrays import Array
from boomctl.checks import finite_array, known, real
from boomctl.lti.system import Lti
from boomctl.structure.model import SecondOrderModel

if TYPE_CHECKING:
    import control

    Weight = float | control.StateSpace


@dataclass(frozen=True)
class Piece:
    """A weight at a signal: the signal of the plant, its name outside, the weight."""

    signal: str
    name: str
    system: Lti


def weighed(what: str, prefix: str, given: "Mapping[str, Weight]", choices: Sequence[str]) -> list[Piece]:
    """Return a piece for each signal in ``given``; signals unknown and weights that cannot serve are refused."""
    if not isinstance(given, Mapping):
        raise TypeError(f"{what}: expected a mapping from signal to weight, got {type(given).__name__}")
    return [
        Piece(known(what, name, choices), prefix + name, _weight(f"weight of {what} {name!r}", weight))
        for name, weight in given.items()
    ]


def _weight(what: str, weight: Any) -> Lti:
    from boomctl.lti.python_control import control

    if not isinstance(weight, control.StateSpace):
        if isinstance(weight, control.TransferFunction):
            raise TypeError(f"{what}: expected a number or a StateSpace, not a transfer function")
        return Lti(np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0)), np.array([[real(what, weight)]]))
    if (weight.noutputs, weight.ninputs) != (1, 1):
        shape = f"{weight.ninputs} input(s) and {weight.noutputs} output(s)"
        raise ValueError(f"{what}: expected a system with one input and one output, got {shape}")
    if not weight.isctime():
        raise ValueError(f"{what}: expected continuous time, got a sampling time of {weight.dt:g} s")
    A, B, C, D = (finite_array(f"{name} of the {what}", getattr(weight, name), 2) for name in "ABCD")
    if len(A):
        poles = linalg.eigvals(A)
        worst = poles[np.argmax(poles.real)]
        if worst.real >= -1e-12 * np.abs(poles).max():
            raise ValueError(f"{what}: expected a stable system, this one has a pole at {worst:.6g} rad/s")
    return Lti(A, B, C, D)


def statespace(plant: Any) -> "control.StateSpace":
    """Return a plant as a finite state-space system in continuous time."""
    from boomctl.lti.python_control import control

    system = plant.to_statespace() if isinstance(plant, SecondOrderModel) else plant
    if not isinstance(system, control.StateSpace):
        raise TypeError(f"plant: expected SecondOrderModel or StateSpace, got {type(plant).__name__}")
    if not system.isctime():
        raise ValueError(f"plant: expected continuous time, got a sampling time of {system.dt:g} s")
    for name in "ABCD":
        finite_array(f"{name} of the plant", getattr(system, name))
    return system


def through(count: int) -> Lti:
    """Return ``count`` signals that pass unchanged."""
    return Lti(np.zeros((0, 0)), np.zeros((0, count)), np.zeros((count, 0)), np.eye(count))


def diagonal(parts: Sequence[Lti]) -> Lti:
    """Return systems side by side."""
    joined = (linalg.block_diag(*(getattr(part, name) for part in parts)) for name in "ABCD")
    return Lti(*joined)


def series(first: Lti, between: Array, second: Lti) -> Lti:
    """Return ``second`` behind ``between`` behind ``first``."""
    C, D = between @ first.C, between @ first.D
    corner = np.zeros((len(first.A), len(second.A)))
    A = np.block([[first.A, corner], [second.B @ C, second.A]])
    return Lti(A, np.vstack([first.B, second.B @ D]), np.hstack([second.D @ C, second.C]), second.D @ D)


def rows_of(all_names: Sequence[str], chosen: Sequence[str]) -> Array:
    """Return the matrix that puts the chosen signals, its columns, in their places among all."""
    places = np.zeros((len(all_names), len(chosen)))
    for column, name in enumerate(chosen):
        places[all_names.index(name), column] = 1.0
    return places


def states_of(pieces: Sequence[Piece]) -> list[str]:
    """Return names for the states of weights."""
    return [f"{piece.name}[{k}]" for piece in pieces for k in range(len(piece.system.A))]


def named_system(
    matrices: Lti, inputs: list[str], outputs: list[str], states: list[str], dt: float | bool | None = 0
) -> "control.StateSpace":
    """Return a system with these names, by default in continuous time.

    Raises
    ------
    ValueError
        A name is taken twice.
    """
    from boomctl.lti.python_control import control

    for what, listed in (("input", inputs), ("output", outputs)):
        twice = [name for name in listed if listed.count(name) > 1]
        if twice:
            raise ValueError(f"{what} {twice[0]!r} would exist twice")
    A, B, C, D = matrices.A, matrices.B, matrices.C, matrices.D
    return control.ss(A, B, C, D, dt, inputs=inputs, outputs=outputs, states=states)
