"""Structures with the transfer function of a modal model: coordinates of mass one, inputs that are forces.

A pair of poles ``p`` with the residue ``c b^T`` is one coordinate: ``b`` is real up to a factor, which ``c`` includes:

    c b^T/(s - p) + conj = (L0 + L1 s) b^T/(s^2 + C s + K),  K = |p|^2,  C = -2 Re p,  L1 = 2 Re c,  L0 = -2 Re(c conj(p)).

A complex ``b`` needs a second coordinate with the same poles.  Two real poles with one direction of the inputs, such as those
of a mass with friction, are one coordinate.  A single real pole is a coordinate whose second pole is a stable zero of its
outputs.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from boomctl.arrays import Array
from boomctl.lti.rounding import SOLVED
from boomctl.structure.matrices import Structure
from boomctl.structure.model import SecondOrderModel
from boomctl.structure.ports import Ports

_COMPANION = 2.0  # Rate of the second pole of a single real pole, in rates of that pole.

Dyad = tuple[int, float, Array, Array]
"""Number from 1 and rate [rad/s] of a real pole, direction of the inputs (m,), row of the outputs (p,)."""


@dataclass(frozen=True)
class _Coordinate:
    """A coordinate of mass one: its name, stiffness, damping, force of each input, rows of position and velocity (2, p)."""

    name: str
    K: float
    C: float
    force: Array
    rows: Array


def modal_structure(
    poles: Array,
    b: Array,
    c: Array,
    D: Array,
    inputs: Sequence[str],
    outputs: Sequence[str],
    *,
    derivatives: Sequence[int] = (),
    modes: int | None = None,
    real_poles: Sequence[float] | Array = (),
    real_residues: Array | None = None,
    double_residue: Array | None = None,
) -> SecondOrderModel:
    """Return the structure with the transfer function of a modal model.

    The transfer function, outputs by inputs, is the sum of ``c b^T/(s - p)`` over complex poles and their conjugates, of
    ``R^T/(s - p)`` over real poles, of ``R^T/s^2`` of a rigid body, and of ``D``.

    Parameters
    ----------
    poles : (k,) complex ndarray
        Poles above the real axis [rad/s].
    b, c : (k, m), (k, p) complex ndarray
        Residues.
    D : (p, m) ndarray
        Feedthrough.
    inputs, outputs : sequence of str
        Names of the forces and of the outputs.
    derivatives : sequence of int
        Order of the derivative of a displacement of each output, by default 0.  The transfer function does not depend on
        it.  An acceleration (2) is read from that of the coordinates, so that a change of a frequency preserves the shape of
        the mode instead of its residue.
    modes : int, optional
        Number of poles that are modes, by default all; the others are named "outside".
    real_poles : (r,) array_like
        Real poles [rad/s], zero or below.
    real_residues : (r, m, p) ndarray
        Their residues, of any rank.
    double_residue : (m, p) ndarray, optional
        Of a rigid body, ``1/s^2``.

    Returns
    -------
    SecondOrderModel
        Coordinates ``mode_1``, ..., ``outside_1``, ..., ``rigid_body_1``, ..., and of real poles ``real_pole_1``, or
        ``real_pole_1_2`` of a pair of them; further coordinates of the same poles end in ``.2``, ``.3``, ...
    """
    m, p = len(inputs), len(outputs)
    count = len(poles) if modes is None else modes
    names = [f"mode_{k + 1}" if k < count else f"outside_{k + 1 - count}" for k in range(len(poles))]
    pairs = zip(names, poles, b, c, strict=True)
    coordinates = [item for pair in pairs for item in _of_pair(*pair)]
    own = sum(item.name.startswith("mode_") for item in coordinates)
    typical = float(np.abs(poles).min()) if len(poles) else 1.0
    residues = np.zeros((0, m, p)) if real_residues is None else np.asarray(real_residues, float)
    coordinates += _of_real_poles(np.asarray(real_poles, float), residues, double_residue, typical)
    n = len(coordinates)
    K, C = (np.array([getattr(item, letter) for item in coordinates]) for letter in "KC")
    forces = np.array([item.force for item in coordinates]).reshape(n, m)
    L, E = np.zeros((3, p, n)), np.zeros((3, p, m))
    L[:2] = np.array([item.rows for item in coordinates]).reshape(n, 2, p).transpose(1, 2, 0)
    E[0] = D
    for o, order in enumerate(derivatives):
        if order == 2:  # L0 q = L2 (q'' + C q' - B u) of the coordinates of modes, with L2 = -L0/K
            L[2, o, :own] = -L[0, o, :own] / K[:own]
            L[0, o, :own] = 0.0
            L[1, o, :own] += C[:own] * L[2, o, :own]
            E[0, o] -= L[2, o, :own] @ forces[:own]
    structure = Structure.of(np.eye(n), np.diag(C), np.diag(K), tuple(item.name for item in coordinates))
    return SecondOrderModel.of(structure, replace(Ports.of_forces(tuple(inputs), forces, tuple(outputs), L), E=E))


def _of_pair(name: str, pole: complex, b: Array, c: Array) -> list[_Coordinate]:
    """Return the coordinate of a pair of poles; two if ``b`` is not real up to a factor."""
    turn = np.exp(-0.5j * np.angle(np.square(b).sum()))  # the real and the imaginary part are then orthogonal
    b, c = b * turn, c / turn
    result = []
    for force, row in ((b.real, c), (b.imag, 1j * c)):
        if np.linalg.norm(force) > SOLVED * np.linalg.norm(b):
            rows = np.array([-2.0 * (row * np.conj(pole)).real, 2.0 * row.real])
            label = name if not result else f"{name}.{len(result) + 1}"
            result.append(_Coordinate(label, abs(pole) ** 2, -2.0 * pole.real, force, rows))
    return result


def _of_real_poles(poles: Array, residues: Array, double: Array | None, typical: float) -> list[_Coordinate]:
    """Return the coordinates of real poles and of a rigid body; ``typical`` is the rate of the companion of an integrator."""
    result: list[_Coordinate] = []
    dyads: list[Dyad] = []
    integrators = np.flatnonzero(poles == 0.0)
    rest = np.array(residues)
    if double is not None:
        for number, (force, row) in enumerate(_dyads(np.asarray(double, float)), start=1):
            speed = np.zeros_like(row)
            for i in integrators:
                speed = speed + force @ rest[i]
                rest[i] = rest[i] - np.outer(force, force @ rest[i])
            result.append(_Coordinate(f"rigid_body_{number}", 0.0, 0.0, force, np.array([row, speed])))
        for i in integrators:
            rest[i] *= np.abs(rest[i]) > SOLVED * np.linalg.norm(residues[i])
    for i in np.argsort(-poles, kind="stable"):
        dyads += [(int(i) + 1, -float(poles[i]), *dyad) for dyad in _dyads(rest[i])]
    while dyads:
        first, *dyads = dyads
        partner = next((k for k, other in enumerate(dyads) if _parallel(first, other)), None)
        second = None if partner is None else dyads.pop(partner)
        result.append(_of_dyads(first, second, typical))
    return _numbered(result)


def _of_dyads(first: Dyad, second: Dyad | None, typical: float) -> _Coordinate:
    """Return the coordinate of two real poles with one direction of the inputs, or of one and a second that no output has."""
    number, rate, force, row = first
    if second is None:
        name, other, offset = f"real_pole_{number}", _COMPANION * rate or typical, np.zeros_like(row)
    else:
        name, other = f"real_pole_{number}_{second[0]}", second[1]
        offset = second[3] * (force @ second[2])
    return _Coordinate(name, rate * other, rate + other, force, np.array([row * other + offset * rate, row + offset]))


def _dyads(residue: Array) -> list[tuple[Array, Array]]:
    """Return directions of inputs, of length one, and rows of outputs whose products add up to a residue (m, p)."""
    U, sizes, rows = np.linalg.svd(residue, full_matrices=False)
    return [
        (u, size * row) for u, size, row in zip(U.T, sizes, rows, strict=True) if size > SOLVED * sizes.max(initial=0.0)
    ]


def _parallel(first: Dyad, second: Dyad) -> bool:
    """Return whether two real poles differ and have one direction of the inputs up to rounding."""
    along = first[2] @ second[2]
    return first[1] != second[1] and bool(np.linalg.norm(second[2] - along * first[2]) <= SOLVED)


def _numbered(coordinates: list[_Coordinate]) -> list[_Coordinate]:
    """Return the coordinates with different names."""
    result: list[_Coordinate] = []
    for item in coordinates:
        before = sum(other.name.partition(".")[0] == item.name for other in result)
        result.append(replace(item, name=f"{item.name}.{before + 1}") if before else item)
    return result
