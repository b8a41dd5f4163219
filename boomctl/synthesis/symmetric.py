"""Two controllers, one of each half of a symmetric machine, as one controller of the machine."""

from typing import TYPE_CHECKING

import numpy as np
from scipy import linalg

from boomctl.arrays import Array
from boomctl.checks import finite_array
from boomctl.structure.second_order import SecondOrderModel
from boomctl.structure.symmetry import Mirror

if TYPE_CHECKING:
    import control

__all__ = ["join_symmetric"]


def join_symmetric(
    model: SecondOrderModel, symmetric: "control.StateSpace", antisymmetric: "control.StateSpace"
) -> "control.StateSpace":
    """Return the controller of the whole machine whose halves are controlled apart.

    Parameters
    ----------
    model : SecondOrderModel
        The machine, with the mirror symmetry by which :func:`boomctl.split_symmetric` splits it.
    symmetric, antisymmetric : control.StateSpace
        Controllers of the halves, ``u = K y``; inputs named as outputs of the half, outputs as its inputs.

    Returns
    -------
    control.StateSpace
        Inputs named as outputs of the machine, outputs as its inputs; the halves' states one after the other.

    Raises
    ------
    TypeError, ValueError
        Another kind of model or controller, one with entries that are not finite; the model has no mirror symmetry; the
        halves' controllers differ in sampling time; a signal that is no half of a pair of the machine's.
    """
    import control

    if not isinstance(model, SecondOrderModel):
        raise TypeError(f"model: expected SecondOrderModel, got {type(model).__name__}")
    for what, half in (("symmetric", symmetric), ("antisymmetric", antisymmetric)):
        if not isinstance(half, control.StateSpace):
            raise TypeError(f"{what}: expected control.StateSpace, got {type(half).__name__}")
        for name in "ABCD":
            finite_array(f"{name} of the {what} controller", getattr(half, name))
    mirror = model.mirror
    if mirror is None:
        raise ValueError("model: expected one with mirror symmetry, such as spray_boom with a symmetric mesh")
    if symmetric.dt != antisymmetric.dt:
        raise ValueError(f"sampling times {symmetric.dt} and {antisymmetric.dt} s: expected the same in both halves")
    halves = ((symmetric, 1), (antisymmetric, -1))
    measured = _whole(mirror, [(half.input_labels, parity) for half, parity in halves], model.outputs, "output")
    driven = _whole(mirror, [(half.output_labels, parity) for half, parity in halves], model.inputs, "input")
    reads = [_matrix(mirror, measured, half.input_labels, parity) for half, parity in halves]
    drives = [_matrix(mirror, driven, half.output_labels, parity) for half, parity in halves]
    return control.ss(
        linalg.block_diag(symmetric.A, antisymmetric.A),
        np.vstack([half.B @ W.T for (half, _), W in zip(halves, reads, strict=True)]),
        np.hstack([W @ half.C for (half, _), W in zip(halves, drives, strict=True)]),
        sum(W @ half.D @ V.T for (half, _), W, V in zip(halves, drives, reads, strict=True)),
        symmetric.dt,
        inputs=list(measured),
        outputs=list(driven),
        name="controller",
    )


def _whole(mirror: Mirror, halves: list[tuple[list[str], int]], available: tuple[str, ...], what: str) -> list[str]:
    """Return the machine's signals that make up those of the halves, in the machine's order."""
    found = set()
    for labels, parity in halves:
        for label in labels:
            names = _sources(mirror, label, parity)
            if names is None or not names <= set(available):
                side = "symmetric" if parity > 0 else "antisymmetric"
                raise ValueError(f"{label!r} of the {side} controller belongs to no {what} of the machine's half")
            found |= names
    return [name for name in available if name in found]


def _sources(mirror: Mirror, label: str, parity: int) -> set[str] | None:
    for pair in mirror.pairs:
        if pair.left is None:
            if label == pair.stem and pair.parity == parity:
                return {pair.right}
        elif label == f"{pair.stem}_{'sym' if parity > 0 else 'anti'}":
            return {pair.right, pair.left}
    return None


def _matrix(mirror: Mirror, names: list[str], labels: list[str], parity: int) -> Array:
    """Return the columns that make the machine's signals of a half's."""
    found = mirror.signals(names, parity)
    if found is None:
        raise ValueError(f"signals {', '.join(names)}: expected both of each pair")
    matrix, stems = found
    return matrix[:, [stems.index(label) for label in labels]]
