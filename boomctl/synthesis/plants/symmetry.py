"""Controllers of a symmetric machine: one of each half joined into one, and one split into those of the halves."""

from typing import TYPE_CHECKING

import numpy as np
from scipy import linalg

from boomctl.arrays import Array
from boomctl.lti.block_diagonal import block_diagonal
from boomctl.lti.modal import spectral_parts
from boomctl.lti.system import Lti, append, of
from boomctl.reduction.reduce import reduce
from boomctl.structure.model import SecondOrderModel
from boomctl.structure.symmetry import Mirror

if TYPE_CHECKING:
    import control

# Share of a half's gain that its reduction may drop, of a state's size that is rounding: half of all digits
_SPLIT = 1e-7
_BESIDE = 1e-3  # relative distance kept from undamped poles, where a response has no end (a choice)
# Relative distance of eigenvalues that belong together: a double one is split by rounding to its root, 1e-8
_SAME = 1e-6


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
    mirror = _mirror(model)
    halves = [
        (of(symmetric, "symmetric", "StateSpace", any_time=True), 1),
        (of(antisymmetric, "antisymmetric", "StateSpace", any_time=True), -1),
    ]
    if symmetric.dt != antisymmetric.dt:
        raise ValueError(f"sampling times {symmetric.dt} and {antisymmetric.dt} s: expected the same in both halves")
    measured = _whole(mirror, [(half.inputs, parity) for half, parity in halves], model.outputs, "output")
    driven = _whole(mirror, [(half.outputs, parity) for half, parity in halves], model.inputs, "input")
    read = np.hstack([_matrix(mirror, measured, half.inputs, parity) for half, parity in halves])
    drive = np.hstack([_matrix(mirror, driven, half.outputs, parity) for half, parity in halves])
    both = append(*(half for half, _ in halves))
    B, C, D = both.B @ read.T, drive @ both.C, drive @ both.D @ read.T
    return Lti(both.A, B, C, D, tuple(measured), tuple(driven), dt=both.dt).statespace("controller")


def split_controller(
    model: SecondOrderModel, controller: "control.StateSpace"
) -> "tuple[control.StateSpace, control.StateSpace, float]":
    """Return the controllers of the halves that a controller of a symmetric machine amounts to, and what they miss.

    Parameters
    ----------
    model : SecondOrderModel
        The machine, with mirror symmetry.
    controller : control.StateSpace
        Of the machine, ``u = K y``, in continuous time; both signals of each pair.

    Returns
    -------
    symmetric, antisymmetric : control.StateSpace
        Without the states that only serve the other half.
    missed : float
        Share of the controller that leads from one half to the other: the largest gain of those channels at the
        frequencies of its poles and decades around, over the largest gain of the others, each in units in which the
        machine's measurements are alike.  Rounding of a symmetric controller; anything else is a controller that mixes
        the halves.

    Raises
    ------
    TypeError, ValueError
        Another kind of model or controller, discrete time, not finite; the model has no mirror symmetry; a signal
        without its mirror image.
    """
    mirror, K = _mirror(model), of(controller, "controller", "StateSpace").balanced()
    grid = _around(K)
    halves, entries, leaves = [], [], []
    for parity in (1, -1):
        read, drive = mirror.signals(K.inputs, parity), mirror.signals(K.outputs, parity)
        if read is None or drive is None:
            raise ValueError("controller: expected both signals of each pair, left and right")
        entries.append(read[0])
        leaves.append(drive[0])
        halves.append(_half(K, grid, read, drive))
    response = np.moveaxis(K.response(grid, quiet=True), 2, 0)
    unit = np.abs(response).max(axis=(0, 1))
    response = response / np.where(unit > 0.0, unit, 1.0)
    gains = {(i, j): np.abs(leaves[i].T @ response @ entries[j]).max(initial=0.0) for i in (0, 1) for j in (0, 1)}
    kept = max(gains[0, 0], gains[1, 1])
    return halves[0], halves[1], float(max(gains[0, 1], gains[1, 0]) / kept) if kept else 0.0


def _mirror(model: SecondOrderModel) -> Mirror:
    if not isinstance(model, SecondOrderModel):
        raise TypeError(f"model: expected SecondOrderModel, got {type(model).__name__}")
    if model.mirror is None:
        raise ValueError("model: expected one with mirror symmetry, such as spray_boom with a symmetric mesh")
    return model.mirror


def _around(K: Lti) -> Array:
    """Return frequencies at a controller's poles and around, beside those that are undamped."""
    poles = K.poles if len(K.A) else -np.ones(1)
    size = np.abs(poles)
    poles, size = poles[size > 0.0], size[size > 0.0]
    low, high = (float(size.min()), float(size.max())) if len(size) else (1.0, 1.0)
    grid = np.union1d(np.geomspace(0.01 * low, 10.0 * high, 200), size)
    for omega in size[np.abs(poles.real) <= _BESIDE * size]:
        grid = np.where(np.abs(grid - omega) <= _BESIDE * omega, omega * (1.0 + _BESIDE), grid)
    return grid


def _half(
    K: Lti, grid: Array, read: tuple[Array, tuple[str, ...]], drive: tuple[Array, tuple[str, ...]]
) -> "control.StateSpace":
    """Return the channels between signals of one half, reduced to the states that they reach and see."""
    rest, lasting = spectral_parts(K)
    (entry, inputs), (leave, outputs) = read, drive
    lasting = _lasting(lasting, entry, leave)
    states = len(rest.A) + len(lasting.A)
    half = Lti(
        linalg.block_diag(rest.A, lasting.A).reshape(states, states),
        np.vstack([rest.B @ entry, lasting.B]),
        np.hstack([leave.T @ rest.C, lasting.C]),
        leave.T @ rest.D @ entry,
        inputs,
        outputs,
    )
    size = float(np.abs(half.response(grid, quiet=True)).max(initial=0.0))
    named = half.statespace("controller")
    return named if not states or size == 0.0 else reduce(named, error=_SPLIT * size).system


def _lasting(part: Lti, read: Array, drive: Array) -> Lti:
    """Return, of unstable and undamped states, those that one half reaches and sees; no reduction takes the others."""
    found = [
        _minimal(Lti(rows @ part.A @ columns, rows @ part.B, part.C @ columns, part.D), read, drive)
        for columns, rows in _clusters(part.A)
    ]
    count = sum(len(one.A) for one in found)
    return Lti(
        linalg.block_diag(*(one.A for one in found)).reshape(count, count),
        np.vstack([np.zeros((0, read.shape[1])), *(one.B for one in found)]),
        np.hstack([np.zeros((drive.shape[1], 0)), *(one.C for one in found)]),
        np.zeros((drive.shape[1], read.shape[1])),
    )


def _clusters(A: Array) -> list[tuple[Array, Array]]:
    """Return the columns, and the rows of their inverse, that split a matrix by its eigenvalues, equal ones together."""
    if not len(A):
        return []
    blocks, columns, widths = block_diagonal(A)
    rows, ends = linalg.inv(columns), np.cumsum(widths)
    squares = [blocks[e - w : e, e - w : e] for w, e in zip(widths, ends, strict=True)]
    means = np.array([np.trace(square) / len(square) for square in squares])
    sizes = np.array([abs(linalg.det(square)) ** (1.0 / len(square)) for square in squares])
    left, found = list(range(len(widths))), []
    while left:
        seed = left[0]
        scale = _SAME * (sizes[seed] + _SAME * sizes.max())
        near = [k for k in left if abs(means[k] - means[seed]) <= scale and abs(sizes[k] - sizes[seed]) <= scale]
        chosen = np.concatenate([np.arange(ends[k] - widths[k], ends[k]) for k in near])
        found.append((columns[:, chosen], rows[chosen]))
        left = [k for k in left if k not in near]
    return found


def _minimal(part: Lti, read: Array, drive: Array) -> Lti:
    """Return the states that one half reaches and sees, of those with about the same eigenvalue."""
    entry, leave = part.B @ read, drive.T @ part.C
    sizes = np.sqrt((np.linalg.norm(part.B, axis=0) ** 2) @ read**2), np.sqrt(drive.T**2 @ (part.C**2).sum(axis=1))
    V = _spanned(part.A, entry / np.where(sizes[0] > 0.0, sizes[0], 1.0))
    A, entry, leave = V.T @ part.A @ V, V.T @ entry, leave @ V
    W = _spanned(A.T, (leave / np.where(sizes[1] > 0.0, sizes[1], 1.0)[:, None]).T)
    return Lti(W.T @ A @ W, W.T @ entry, leave @ W, np.zeros((len(leave), entry.shape[1])))


def _spanned(A: Array, start: Array) -> Array:
    """Return orthonormal columns that span what ``A`` makes of those given, rounding left out."""
    basis, size = np.zeros((len(A), 0)), max(float(np.linalg.norm(A)), float(np.finfo(float).tiny))
    while start.shape[1]:
        left, strength, _ = linalg.svd(start - basis @ (basis.T @ start), full_matrices=False)
        new = left[:, strength > _SPLIT]
        basis, onward = np.hstack([basis, new]), A @ new
        # a column that A nearly annihilates is rounding, and stays small
        start = onward / np.maximum(np.linalg.norm(onward, axis=0), _SAME * size)
    return basis


def _whole(
    mirror: Mirror, halves: list[tuple[tuple[str, ...], int]], available: tuple[str, ...], what: str
) -> list[str]:
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


def _matrix(mirror: Mirror, names: list[str], labels: tuple[str, ...], parity: int) -> Array:
    """Return the columns that make the machine's signals of a half's."""
    found = mirror.signals(names, parity)
    if found is None:
        raise ValueError(f"signals {', '.join(names)}: expected both of each pair")
    matrix, stems = found
    return matrix[:, [stems.index(label) for label in labels]]
