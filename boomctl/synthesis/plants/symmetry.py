"""Controllers of a symmetric machine: one of each half joined into one, and one split into those of the halves."""

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from scipy import linalg

from boomctl.arrays import Array
from boomctl.checks import instance
from boomctl.lti.bilinear import continuous_image, discrete_image
from boomctl.lti.modal import block_diagonal, resolved
from boomctl.lti.rounding import EPS, ROOT, TINY
from boomctl.lti.system import Lti, append, check_scales, controller_of, of
from boomctl.structure.model import SecondOrderModel
from boomctl.structure.symmetry import Mirror
from boomctl.threads import one_blas_thread

if TYPE_CHECKING:
    import control

_FAINT = 1e-7, 1e-9, 1e-11  # shares of a state's size that are rounding, tried in turn until nothing is lost (choices)
_LOST = 1e-6  # share of a half's gain, at any frequency looked at, that it may differ by from the controller (a choice)
_FELT = 100.0  # units of rounding of the norm of A by which its poles may be off, with room (a choice)
_UNITS = 1e3  # of rounding of a product, below which an entry tells nothing (a choice)
_BESIDE = 1e-3  # relative distance kept from undamped poles, where a response has no end (a choice)
_SAME = 1e-6  # share of its size below which what A makes of a column is rounding (a choice)


@one_blas_thread
def join_symmetric(
    model: SecondOrderModel, symmetric: "control.StateSpace", antisymmetric: "control.StateSpace"
) -> "control.StateSpace":
    """Return the controller of the whole machine whose halves are controlled apart.

    Parameters
    ----------
    model : SecondOrderModel
        The whole machine, with the mirror symmetry by which :func:`boomctl.split_symmetric` splits it.
    symmetric, antisymmetric : control.StateSpace
        Controllers of the two halves, ``u = K y``; inputs named as outputs of the half, outputs as its inputs. A gain
        without a time of its own goes with continuous and with discrete ones.

    Returns
    -------
    control.StateSpace
        Inputs named as outputs of the machine, outputs as its inputs; the halves' states one after the other.

    Raises
    ------
    TypeError, ValueError
        Another kind of model or controller, one with entries that are not finite; the model has no mirror symmetry; the
        halves' controllers differ in sampling time; a signal that is no half of a pair of the machine's.

    Examples
    --------
    >>> import boomctl as bc
    >>> import control
    >>> jolt = control.ss([], [], [], [[-200.0]], inputs="stroke_sym", outputs="suspension_sym")
    >>> yaw = control.ss([], [], [], [[-100.0]], inputs="stroke_anti", outputs="suspension_anti")
    >>> whole = bc.join_symmetric(bc.spray_boom(), jolt, yaw)
    >>> whole.input_labels
    ['stroke_left', 'stroke_right']
    >>> whole.D.round(6)
    array([[-150.,  -50.],
           [ -50., -150.]])
    """
    mirror = _mirror(model)
    halves = [
        (of(symmetric, "symmetric", "StateSpace", any_time=True), 1),
        (of(antisymmetric, "antisymmetric", "StateSpace", any_time=True), -1),
    ]
    for half, _ in halves:
        check_scales(half)
    given = (symmetric.dt, antisymmetric.dt)
    times = {half.dt for (half, _), dt in zip(halves, given, strict=True) if dt is not None}
    if len(times) > 1:
        raise ValueError(f"sampling times {symmetric.dt} and {antisymmetric.dt} s: expected the same in both halves")
    measured = _whole(mirror, [(half.input_labels, parity) for half, parity in halves], model.output_labels, "output")
    driven = _whole(mirror, [(half.output_labels, parity) for half, parity in halves], model.input_labels, "input")
    read = np.hstack([_matrix(mirror, measured, half.input_labels, parity) for half, parity in halves])
    drive = np.hstack([_matrix(mirror, driven, half.output_labels, parity) for half, parity in halves])
    both = append(*(half for half, _ in halves))
    B, C, D = both.B @ read.T, drive @ both.C, drive @ both.D @ read.T
    dt, scales = min(times, default=0.0), None if None in [half.scales for half, _ in halves] else {}
    return Lti(both.A, B, C, D, tuple(measured), tuple(driven), dt=dt, scales=scales).statespace("controller")


@one_blas_thread
def split_controller(
    model: SecondOrderModel, controller: "control.StateSpace"
) -> "tuple[control.StateSpace, control.StateSpace, float]":
    """Return the controllers of the halves that a controller of a symmetric machine amounts to, and what they miss.

    Parameters
    ----------
    model : SecondOrderModel
        The machine, with mirror symmetry.
    controller : control.StateSpace
        Controller of the machine, ``u = K y``, with both signals of each pair.

    Returns
    -------
    symmetric, antisymmetric : control.StateSpace
        Controllers of the two halves, without the states that only serve the other half.
    missed : float
        Share of the controller that leads from one half to the other: the largest gain of those channels at the
        frequencies of its poles and decades around, over the largest gain of the others, each in units in which the
        machine's measurements are alike.  Rounding of a symmetric controller; anything else is a controller that mixes
        the halves.

    Raises
    ------
    TypeError, ValueError
        Another kind of model or controller, discrete time that does not say its sampling time or with a pole at
        ``z = -1``, not finite; the model has no mirror symmetry; a signal
        without its mirror image.

    Examples
    --------
    >>> import boomctl as bc
    >>> import control
    >>> names = {"inputs": ["stroke_left", "stroke_right"], "outputs": ["suspension_left", "suspension_right"]}
    >>> whole = control.ss([], [], [], [[-150.0, -50.0], [-50.0, -150.0]], **names)
    >>> jolt, yaw, missed = bc.synthesis.split_controller(bc.spray_boom(), whole)
    >>> jolt.D.round(6), yaw.D.round(6), round(missed, 9)
    (array([[-200.]]), array([[-100.]]), 0.0)
    """
    mirror, given = _mirror(model), controller_of(controller, sampled=True).balanced()
    check_scales(given)
    # a discrete one is told apart as the continuous controller whose Tustin discretisation it is
    K, sides = continuous_image(given).balanced(), []
    for parity in (1, -1):
        read, drive = mirror.signals(K.input_labels, parity), mirror.signals(K.output_labels, parity)
        if read is None or drive is None:
            raise ValueError("controller: expected both signals of each pair, left and right")
        sides.append(_Side(read[0], drive[0], read[1], drive[1]))
    grid = _around(K)
    response = K.response(grid, quiet=True).transpose(2, 0, 1)
    largest = np.abs(response).max(axis=(0, 1), initial=0.0)
    units = [(side.entry**2).T @ np.where(largest > 0.0, largest, 1.0) for side in sides]  # the same for both of a pair
    parts = {(i, j): sides[i].leave.T @ response @ sides[j].entry / units[j] for i in (0, 1) for j in (0, 1)}
    size = max(float(np.abs(part).max(initial=0.0)) for part in parts.values())
    nearest = np.abs(1j * grid[:, None] - K.poles).min(axis=1, initial=np.inf)
    moved = _FELT * EPS * float(np.linalg.norm(K.A)) / nearest  # share of a gain that is rounding of the poles
    halves, lost = [], np.full((2, len(grid)), np.inf)
    for faint in _FAINT:
        halves = _controllers_of_halves(K, sides, faint)
        for k, half in enumerate(halves):
            result, whole = half.response(grid, quiet=True).transpose(2, 0, 1) / units[k], parts[k, k]
            # share of the largest gain that is none: half of all digits
            gain = np.maximum(np.abs(whole).max(axis=(1, 2), initial=0.0), ROOT * size)
            share = np.abs(result - whole).max(axis=(1, 2), initial=0.0) / np.where(gain > 0.0, gain, 1.0)
            lost[k] = np.maximum(share - moved, 0.0)
        if lost.max() <= _LOST:
            break
    else:
        k = int(np.argmax(lost.max(axis=1)))
        raise ValueError(
            f"controller: its {('symmetric', 'antisymmetric')[k]} half would differ from it by"
            f" {100.0 * lost[k].max():.2g} % at {grid[int(np.argmax(lost[k]))]:.4g} rad/s; expected poles that rounding"
            " does not mix so much between the halves"
        )
    gains = {key: np.abs(part).max(initial=0.0) for key, part in parts.items()}
    kept = max(gains[0, 0], gains[1, 1])
    missed = float(max(gains[0, 1], gains[1, 0]) / kept) if kept else 0.0
    symmetric, antisymmetric = (
        replace(discrete_image(half, given.dt), scales=given.scales).statespace("controller") for half in halves
    )
    return symmetric, antisymmetric, missed


@dataclass(frozen=True)
class _Side:
    """What the controller of a half reads and drives: columns over the machine's signals, and names."""

    entry: Array
    leave: Array
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]


def _mirror(model: SecondOrderModel) -> Mirror:
    instance("model", model, SecondOrderModel)
    if model._mirror is None:
        raise ValueError("model: expected one with mirror symmetry, such as spray_boom with a symmetric mesh")
    return model._mirror


def _around(K: Lti) -> Array:
    """Return frequencies at a controller's poles and around, beside those that are undamped."""
    poles = K.poles if len(K.A) else -np.ones(1)
    size = np.abs(poles)
    seen = resolved(poles) & (size > 0.0)
    poles, size = poles[seen], size[seen]
    low, high = (float(size.min()), float(size.max())) if len(size) else (1.0, 1.0)
    grid = np.union1d(np.geomspace(0.01 * low, 10.0 * high, 200), size)
    for omega in size[np.abs(poles.real) <= _BESIDE * size]:
        grid = np.where(np.abs(grid - omega) <= _BESIDE * omega, omega * (1.0 + _BESIDE), grid)
    return grid


def _controllers_of_halves(K: Lti, sides: list[_Side], faint: float) -> list[Lti]:
    """Return the controllers of the halves: of each group of poles, the states that a half reaches and sees.

    Poles apart are groups of their own.  A group that both halves use, with more states than it has, holds poles that
    rounding has mixed, such as equal ones of the two halves: it is joined with the nearest.
    """
    waiting, done = _blocks(K), []
    while waiting:
        block = waiting.pop()
        parts = [_minimal(block, side, faint) for side in sides]
        if not waiting or sum(len(part.A) for part in parts) <= len(block.A):
            done.append(parts)
            continue
        distance = [_apart(block, other) for other in waiting]
        other = waiting.pop(int(np.argmin(distance)))
        waiting.append(_joined(block, other))
    halves = []
    for k, side in enumerate(sides):
        D = side.leave.T @ K.D @ side.entry
        empty = Lti(np.zeros((0, 0)), np.zeros((0, D.shape[1])), np.zeros((len(D), 0)), D)
        result = [parts[k] for parts in done if len(parts[k].A)]
        A = linalg.block_diag(*(part.A for part in result)) if result else empty.A
        B, C = np.vstack([empty.B, *(part.B for part in result)]), np.hstack([empty.C, *(part.C for part in result)])
        halves.append(Lti(A, B, C, D, side.inputs, side.outputs))
    return halves


@dataclass(frozen=True)
class _Block:
    """Some poles of a controller, with what of ``B`` and ``C`` is theirs, and how far rounding may have moved that."""

    A: Array
    B: Array
    C: Array
    input_noise: Array
    output_noise: Array


def _blocks(K: Lti) -> list[_Block]:
    blocks, columns, widths = block_diagonal(K.A)
    rows = linalg.inv(columns) if len(K.A) else K.A
    B, C = rows @ K.B, K.C @ columns
    input_noise, output_noise = (
        _UNITS * EPS * (np.abs(rows) @ np.abs(K.B)),
        _UNITS * EPS * (np.abs(K.C) @ np.abs(columns)),
    )
    ends = np.cumsum(widths).astype(int)
    result = []
    for end, width in zip(ends, widths, strict=True):
        own = slice(end - width, end)
        result.append(_Block(blocks[own, own], B[own], C[:, own], input_noise[own], output_noise[:, own]))
    return result


def _joined(one: _Block, other: _Block) -> _Block:
    return _Block(
        linalg.block_diag(one.A, other.A),
        np.vstack([one.B, other.B]),
        np.hstack([one.C, other.C]),
        np.vstack([one.input_noise, other.input_noise]),
        np.hstack([one.output_noise, other.output_noise]),
    )


def _apart(one: _Block, other: _Block) -> float:
    """Return the least distance of the poles of two blocks."""
    poles, others = linalg.eigvals(one.A), linalg.eigvals(other.A)
    return float(np.abs(poles[:, None] - others).min())


def _minimal(block: _Block, side: _Side, faint: float) -> Lti:
    """Return the states that one half reaches and sees, of those of a block."""
    entry, leave = block.B @ side.entry, side.leave.T @ block.C
    unsure = block.input_noise @ np.abs(side.entry), np.abs(side.leave.T) @ block.output_noise
    sizes = (
        np.linalg.norm(block.B) * np.linalg.norm(side.entry, axis=0),
        np.linalg.norm(block.C) * np.linalg.norm(side.leave.T, axis=1),
    )
    entry, leave = np.where(np.abs(entry) > unsure[0], entry, 0.0), np.where(np.abs(leave) > unsure[1], leave, 0.0)
    V = columns_spanned(block.A, entry / np.where(sizes[0] > 0.0, sizes[0], 1.0), faint)
    A, entry, leave = V.T @ block.A @ V, V.T @ entry, leave @ V
    W = columns_spanned(A.T, (leave / np.where(sizes[1] > 0.0, sizes[1], 1.0)[:, None]).T, faint)
    return Lti(W.T @ A @ W, W.T @ entry, leave @ W, np.zeros((len(leave), entry.shape[1])))


def columns_spanned(A: Array, start: Array, faint: float) -> Array:
    """Return orthonormal columns that span what ``A`` makes of those given, without what is fainter than a share of them."""
    basis, size = np.zeros((len(A), 0)), max(float(np.linalg.norm(A)), TINY)
    while start.shape[1]:
        left, strength, _ = linalg.svd(start - basis @ (basis.T @ start), full_matrices=False)
        new = left[:, strength > faint]
        new = linalg.qr(new - basis @ (basis.T @ new), mode="economic")[
            0
        ]  # what a faint column lost of its right angle
        basis, onward = np.hstack([basis, new]), A @ new
        # a column that A nearly annihilates is rounding, and stays small
        start = onward / np.maximum(np.linalg.norm(onward, axis=0), _SAME * size)
    return basis


def _whole(
    mirror: Mirror, halves: list[tuple[tuple[str, ...], int]], available: tuple[str, ...], what: str
) -> list[str]:
    """Return the machine's signals that make up those of the halves, in the machine's order."""
    result = set()
    for labels, parity in halves:
        for label in labels:
            names = _sources(mirror, label, parity)
            if names is None or not names <= set(available):
                side = "symmetric" if parity > 0 else "antisymmetric"
                raise ValueError(f"{label!r} of the {side} controller belongs to no {what} of the machine's half")
            result |= names
    return [name for name in available if name in result]


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
    result = mirror.signals(names, parity)
    if result is None:
        raise ValueError(f"signals {', '.join(names)}: expected both of each pair")
    matrix, stems = result
    return matrix[:, [stems.index(label) for label in labels]]
