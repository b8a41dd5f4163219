"""Controllers of a mirror-symmetric machine: joined from those of its two subsystems, and split into them."""

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import slycot
from scipy import linalg

from boomctl.arrays import Array
from boomctl.checks import instance
from boomctl.lti.bilinear import continuous_image, discrete_image
from boomctl.lti.modal import block_diagonal, resolved
from boomctl.lti.rounding import ALIKE, LEVEL, ROOT, SOLVED
from boomctl.lti.system import Lti, append, check_scales, controller_of, of
from boomctl.structure.model import SecondOrderModel
from boomctl.structure.symmetry import Mirror
from boomctl.threads import one_blas_thread

if TYPE_CHECKING:
    import control

_CLUSTER_RTOL = 1e-3  # Poles whose moduli are closer than this are reduced together.
_GAP = 1e-3  # Relative distance of frequencies from undamped poles.


@one_blas_thread
def join_symmetric(
    model: SecondOrderModel, symmetric: "control.StateSpace", antisymmetric: "control.StateSpace"
) -> "control.StateSpace":
    """Join the controllers of the symmetric and the antisymmetric subsystem to one of the machine.

    Parameters
    ----------
    model : SecondOrderModel
        The machine, with the mirror symmetry of :func:`boomctl.split_symmetric`.
    symmetric, antisymmetric : control.StateSpace
        Controllers ``u = K y`` of the two subsystems, with their labels. A gain of unspecified time is accepted with
        continuous and discrete ones.

    Returns
    -------
    control.StateSpace
        With the labels of the machine; the states of the symmetric controller come first.

    Raises
    ------
    TypeError, ValueError
        If an argument has another type, if an entry is not finite, if the model has no mirror symmetry, if the sampling
        times differ, or if a label is not one of the subsystem.

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
    mirror, controllers = _mirror(model), {"symmetric": symmetric, "antisymmetric": antisymmetric}
    halves = [of(half, name, "StateSpace", any_time=True) for name, half in controllers.items()]
    for half in halves:
        check_scales(half)
    times = {half.dt for half, own in zip(halves, controllers.values(), strict=True) if own.dt is not None}
    if len(times) > 1:
        raise ValueError(f"`antisymmetric` must have the sampling time {symmetric.dt} s, got {antisymmetric.dt} s.")
    measured, read = _signals(mirror, [half.input_labels for half in halves], model.output_labels, "output")
    driven, drive = _signals(mirror, [half.output_labels for half in halves], model.input_labels, "input")
    both = append(*halves)
    B, C, D = both.B @ read.T, drive @ both.C, drive @ both.D @ read.T
    dt, scales = min(times, default=0.0), None if None in [half.scales for half in halves] else {}
    return Lti(both.A, B, C, D, tuple(measured), tuple(driven), dt=dt, scales=scales).statespace("controller")


@one_blas_thread
def split_controller(
    model: SecondOrderModel, controller: "control.StateSpace"
) -> "tuple[control.StateSpace, control.StateSpace, float]":
    """Split a controller of a symmetric machine into those of its two subsystems.

    Parameters
    ----------
    model : SecondOrderModel
        The machine, with mirror symmetry.
    controller : control.StateSpace
        Controller of the machine, ``u = K y``, with both signals of each pair.

    Returns
    -------
    symmetric, antisymmetric : control.StateSpace
        Controllers of the two subsystems, without the states of the other one.
    coupling : float
        Coupling of the subsystems by the controller: largest gain between them at and around the frequencies of its poles,
        relative to the largest gain within them, with measurements scaled to similar magnitudes. Rounding error for a
        symmetric controller.

    Raises
    ------
    TypeError, ValueError
        If an argument has another type, if the sampling time is unspecified, if there is a pole at ``z = -1``, if an entry is
        not finite, if the model has no mirror symmetry, or if a signal has no mirror image.

    Examples
    --------
    >>> import boomctl as bc
    >>> import control
    >>> names = {"inputs": ["stroke_left", "stroke_right"], "outputs": ["suspension_left", "suspension_right"]}
    >>> both_sides = control.ss([], [], [], [[-150.0, -50.0], [-50.0, -150.0]], **names)
    >>> jolt, yaw, coupling = bc.synthesis.split_controller(bc.spray_boom(), both_sides)
    >>> jolt.D.round(6), yaw.D.round(6), round(coupling, 9)
    (array([[-200.]]), array([[-100.]]), 0.0)
    """
    mirror, controller_lti = _mirror(model), controller_of(controller, sampled=True).balanced()
    check_scales(controller_lti)
    # A discrete controller is split as the continuous one whose Tustin discretization it is.
    K = continuous_image(controller_lti).balanced()
    grid, clusters, sides = _frequencies(K), _clusters(K), []
    response = K.response(grid, quiet=True).transpose(2, 0, 1)
    largest = np.abs(response).max(axis=(0, 1), initial=0.0)
    for parity in (1, -1):
        read, drive = mirror.signals(K.input_labels, parity), mirror.signals(K.output_labels, parity)
        if read is None or drive is None:
            raise ValueError("`controller` must have both signals of each pair, left and right.")
        sides.append((read[0], drive[0].T, read[1], drive[1]))
    units = [(read**2).T @ np.where(largest > 0.0, largest, 1.0) for read, *_ in sides]  # the same for both of a pair
    parts = {(i, j): sides[i][1] @ response @ sides[j][0] / units[j] for i in (0, 1) for j in (0, 1)}
    gains = {key: float(np.abs(part).max(initial=0.0)) for key, part in parts.items()}
    nearest = np.abs(1j * grid[:, None] - K.poles).min(axis=1, initial=np.inf)
    pole_error = SOLVED * float(np.linalg.norm(K.A)) / nearest
    result = []
    for k, (read, drive, inputs, outputs) in enumerate(sides):
        gain = np.maximum(np.abs(parts[k, k]).max(axis=(1, 2), initial=0.0), ROOT * max(gains.values()))
        blocks = [_minimal(cluster, read, drive) for cluster in clusters]
        A, B = linalg.block_diag(*(block.A for block in blocks)), np.vstack([block.B for block in blocks])
        half = Lti(A, B, np.hstack([block.C for block in blocks]), drive @ K.D @ read, inputs, outputs)
        error = half.response(grid, quiet=True).transpose(2, 0, 1) / units[k] - parts[k, k]
        change = np.abs(error).max(axis=(1, 2), initial=0.0) / np.where(gain > 0.0, gain, 1.0) - pole_error
        if not change.max() <= LEVEL:
            name, worst = ("symmetric", "antisymmetric")[k], int(np.argmax(change))
            raise ValueError(
                f"`controller` cannot be split: its {name} part would change by {100.0 * change[worst]:.2g} % at"
                f" {grid[worst]:.4g} rad/s, as rounding mixes its poles. Design one controller for each subsystem."
            )
        result.append(replace(discrete_image(half, controller_lti.dt), scales=controller_lti.scales))
    coupling = max(gains[0, 1], gains[1, 0]) / (max(gains[0, 0], gains[1, 1]) or 1.0)
    symmetric, antisymmetric = (half.statespace("controller") for half in result)
    return symmetric, antisymmetric, coupling


def _frequencies(K: Lti) -> Array:
    """Return frequencies around a controller's poles, and offset from them so that undamped poles have a finite response."""
    poles = K.poles[resolved(K.poles) & (K.poles != 0.0)]
    poles = poles if len(poles) else -np.ones(1)
    size = np.abs(poles)
    return np.union1d(np.geomspace(0.01 * size.min(), 10.0 * size.max(), 200), (1.0 + _GAP) * size)


def _clusters(K: Lti) -> list[Lti]:
    """Return the parts of a controller that belong to clusters of poles of nearly equal modulus."""
    if not len(K.A):
        return [K]
    A, columns, widths = block_diagonal(K.A)
    B, C = linalg.solve(columns, K.B), K.C @ columns
    blocks = np.split(np.arange(len(A)), np.cumsum(widths)[:-1])
    size = np.array([np.abs(linalg.eigvals(A[np.ix_(states, states)])).mean() for states in blocks])
    order, error = np.argsort(size), SOLVED * float(np.linalg.norm(A))
    cuts = np.flatnonzero(np.diff(size[order]) > _CLUSTER_RTOL * size[order][1:] + error) + 1
    groups = [np.concatenate([blocks[k] for k in group]) for group in np.split(order, cuts)]
    return [Lti(A[np.ix_(states, states)], B[states], C[:, states], K.D) for states in groups]


def _minimal(part: Lti, read: Array, drive: Array) -> Lti:
    """Return the reachable and observable states of a part between the signals of a subsystem."""
    inputs, outputs = np.linalg.norm(read, axis=0), np.linalg.norm(drive, axis=1)[:, None]
    sizes = [
        np.where(size > 0.0, size, 1.0) for size in (np.linalg.norm(part.B) * inputs, np.linalg.norm(part.C) * outputs)
    ]
    n, m, p = len(part.A), read.shape[1], len(drive)
    A, B, C, order = np.zeros((0, 0)), np.zeros((n, max(m, p))), np.zeros((max(m, p), n)), 0
    B[:, :m], C[:p] = part.B @ read / sizes[0], drive @ part.C / sizes[1]
    if n and m and p:
        A, B, C, order = slycot.tb01pd(n, m, p, part.A, B, C, "M", "N", ALIKE)
    return Lti(A[:order, :order], B[:order, :m] * sizes[0], C[:p, :order] * sizes[1], np.zeros((p, m)))


def _mirror(model: SecondOrderModel) -> Mirror:
    instance("model", model, SecondOrderModel)
    if model.structure.mirror is None:
        raise ValueError("`model` must have mirror symmetry, such as spray_boom with a symmetric mesh.")
    return model.structure.mirror


def _signals(
    mirror: Mirror, subsystems: list[tuple[str, ...]], available: tuple[str, ...], kind: str
) -> tuple[list[str], Array]:
    """Return the machine's signals of which those of two subsystems consist, and the matrix from these to them."""
    pairs = [[name for name in (pair.right, pair.left) if name is not None] for pair in mirror.pairs]
    complete = {name for pair in pairs if set(pair) <= set(available) for name in pair}
    machine, columns = [name for name in available if name in complete], []
    for side, parity, labels in zip(("symmetric", "antisymmetric"), (1, -1), subsystems, strict=True):
        matrix, stems = mirror.signals(machine, parity) or (np.zeros((len(machine), 0)), ())
        for label in labels:
            if label not in stems:
                raise ValueError(f"{label!r} of the {side} controller must be an {kind} of that subsystem of `model`.")
            columns.append(matrix[:, stems.index(label)])
    both = np.reshape(columns, (-1, len(machine))).T
    used = np.flatnonzero(both.any(axis=1))
    return [machine[k] for k in used], both[used]
