"""Generalized plants: their partition into disturbances and controls, performance outputs and measurements; normal form."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from scipy import linalg

from boomctl.arrays import Array
from boomctl.checks import exactly, whole
from boomctl.lti.modal import block_diagonal
from boomctl.lti.rounding import ALIKE
from boomctl.lti.sampled import same_time
from boomctl.lti.system import (
    Lti,
    check_scales,
    controller_of,
    is_statespace,
    is_transfer_function,
    lower_lft,
    of,
    rescale,
    signal_scales,
    well_posed_inverse,
)
from boomctl.printing import compact, listed
from boomctl.threads import one_blas_thread

if TYPE_CHECKING:
    import control

    from boomctl.lti.system import Controller

OUTPUT_PREFIXES = ("z_",)  # Of performance outputs.
INPUT_PREFIXES = ("w_", "n_", "r_")  # Of disturbances, noise and references.
_MAX_CONDITION = 1e5  # Of the modal basis; modes with nearly dependent eigenvectors share a block.


@dataclass(eq=False)
class GeneralizedPlant:
    """``x' = A x + B1 w + B2 u``, ``z = C1 x + D11 w + D12 u``, ``y = C2 x + D21 w + D22 u``.

    Attributes
    ----------
    system : Lti
        Its last inputs are the controls ``u``, its last outputs the measurements ``y``.
    nmeas, ncon : int
        Numbers of measurements and controls.
    nw, nz : int
        Numbers of disturbances and performance outputs.
    A, B1, B2, C1, C2, D11, D12, D21, D22 : ndarray
        Parts of the matrices of ``system``.
    disturbances, controls, performance, measurements : tuple of str
        Labels of the signals.
    """

    system: Lti
    nmeas: int
    ncon: int

    __repr__ = compact

    def __post_init__(self) -> None:
        s = self.system
        self.nz, self.nw = nz, nw = len(s.D) - self.nmeas, s.D.shape[1] - self.ncon
        self.A, self.B1, self.B2, self.C1, self.C2 = s.A, s.B[:, :nw], s.B[:, nw:], s.C[:nz], s.C[nz:]
        self.D11, self.D12, self.D21, self.D22 = s.D[:nz, :nw], s.D[:nz, nw:], s.D[nz:, :nw], s.D[nz:, nw:]
        self.disturbances, self.controls = s.input_labels[:nw], s.input_labels[nw:]
        self.performance, self.measurements = s.output_labels[:nz], s.output_labels[nz:]

    @cached_property
    def dual(self) -> "GeneralizedPlant":
        """Transposed plant, in which controls and measurements, and the other signals, are exchanged."""
        s = self.system
        transposed = Lti(s.A.T, s.C.T, s.B.T, s.D.T, s.output_labels, s.input_labels, s.state_labels, s.dt)
        return GeneralizedPlant(transposed, self.ncon, self.nmeas)


def partition(
    P: "control.StateSpace", nmeas: int | None, ncon: int | None, *, sampled: bool = False
) -> GeneralizedPlant:
    """Return a generalized plant whose last outputs are measured and whose last inputs are controls.

    In discrete time too if ``sampled``.  If a count is None, it is determined from the labels that
    `generalized_plant` and `mixed_sensitivity` give.

    Raises
    ------
    TypeError
        If `P` is not a system.
    ValueError
        If the time or an entry is not allowed, or if a count leaves no disturbance or performance output, counts one
        of these, or is None where the labels do not determine it.
    """
    if not (isinstance(P, Lti) or is_statespace(P) or is_transfer_function(P)):
        raise TypeError(
            f"`P` must be a generalized plant, a StateSpace, got {type(P).__name__}. Build one of a structure or a"
            " system by boomctl.generalized_plant."
        )
    system = of(P, "P", "StateSpace", sampled=sampled)
    nmeas = _count("nmeas", nmeas, system.output_labels, len(system.D), OUTPUT_PREFIXES, "performance output")
    ncon = _count("ncon", ncon, system.input_labels, system.D.shape[1], INPUT_PREFIXES, "disturbance")
    return GeneralizedPlant(system, nmeas, ncon)


def _count(
    what: str, count: int | None, labels: Sequence[str], total: int, prefixes: tuple[str, ...], other: str
) -> int:
    """Return the number of measurements or controls, checked against the labels, or determined from these if None."""
    first = next((i for i, label in enumerate(labels) if not label.startswith(prefixes)), len(labels))
    known = first > 0 and not any(label.startswith(prefixes) for label in labels[first:])
    if count is None:
        if not known:
            raise ValueError(
                f"`{what}` must be given unless the labels of P begin with {' or '.join(prefixes)} for every {other}"
                f" and only for these, got None with {listed(labels)}."
            )
        return len(labels) - first
    if whole(what, count) >= total:
        raise ValueError(f"`{what}` must be less than {total}, so that P has at least one {other}, got {count}.")
    if known and count > len(labels) - first:
        raise ValueError(
            f"`{what}` must be at most {len(labels) - first}, since {labels[first - 1]!r} of P is a {other}, got {count}."
        )
    return count


def matched(
    P: "control.StateSpace", controller: "Controller", *, sampled: bool = False, convert: bool = False
) -> tuple[GeneralizedPlant, Lti]:
    """Return a plant partitioned to fit a controller, and the controller with the plant's signals, in their order.

    In discrete time too if ``sampled``. If ``convert``, a controller in the units of the machine is scaled as the plant.

    Raises
    ------
    TypeError, ValueError
        If `P` or the controller is not such a system, if the controller has too many signals, or if sampling times,
        scales or labels do not match.
    """
    scales = getattr(P, "scales", None)
    K = controller_of(controller, sampled=sampled, scales=scales)
    if convert and scales and K.scales == {}:
        K = rescale(K, scales)
    check_scales(K, scales)
    plant = partition(P, K.B.shape[1], len(K.C), sampled=sampled)
    if not same_time(K.dt, plant.system.dt):
        needed, actual = (
            f"a sampling time of {exactly(dt)} s" if dt else "continuous time" for dt in (plant.system.dt, K.dt)
        )
        raise ValueError(f"`controller` must have {needed}, as P has, got {actual}.")
    columns = _order("output", plant.measurements, K.input_labels, plant.system.output_labels)
    rows = _order("input", plant.controls, K.output_labels, plant.system.input_labels)
    labels = {"input_labels": plant.measurements, "output_labels": plant.controls, "state_labels": ()}
    return plant, replace(K.between(columns, rows), **labels)


def _order(kind: str, labels: Sequence[str], own: Sequence[str], of_plant: Sequence[str]) -> list[int]:
    """Return the positions of a controller's signals in the order of the plant; unchanged if it has none of its labels."""
    if set(own) == set(labels):
        return [list(own).index(label) for label in labels]
    for label in own:
        if label in of_plant:
            raise ValueError(
                f"`controller` must have the last {kind}s of P, {', '.join(labels)}, or none of its labels, got"
                f" {', '.join(own)}: {label!r} is an {kind} of P."
            )
    return list(range(len(own)))


@one_blas_thread
def lft(P: "control.StateSpace", controller: "Controller") -> "control.StateSpace":
    """Return the lower linear fractional transformation of a generalized plant and a controller.

    The inputs of the controller are the last outputs of ``P`` and its outputs the last inputs: matched by name, or in
    this order if the controller has none of the labels of ``P``.

    Parameters
    ----------
    P : control.StateSpace
        Generalized plant: its last inputs are controls, its last outputs measurements.
    controller : control.StateSpace, control.TransferFunction, or a design
        Controller ``u = K y``, with the sampling time of `P`. For a scaled `P` in its scaled signals or, if designed by
        boomctl, in the units of the machine.

    Returns
    -------
    control.StateSpace
        From the disturbances to the performance outputs, labeled as in `P`.

    Raises
    ------
    TypeError
        If `P` or `controller` is not a system.
    ValueError
        If sampling times, scales or labels do not match, or if the loop is not well-posed.

    Examples
    --------
    >>> import boomctl as bc
    >>> import control
    >>> lag = control.ss([[-1.0]], [[1.0]], [[1.0]], 0.0, inputs="u", outputs="y")
    >>> P = bc.mixed_sensitivity(lag, W1=1.0)
    >>> gain = control.ss([], [], [], [[9.0]], inputs="error_y", outputs="u")
    >>> loop = bc.lft(P, gain)
    >>> loop.output_labels, round(float(loop.dcgain()), 3)  # the control error: 1/(1 + 9)
    (['z_error_y'], 0.1)
    """
    plant, K = matched(P, controller, sampled=True, convert=True)
    return lower_lft(plant.system, K).statespace("closed_loop")


def with_feedthrough(K: Lti, D22: Array) -> Lti:
    """Return the controller for a plant with the feedthrough ``D22`` from one without: ``K`` of ``y - D22 u``.

    Raises
    ------
    ValueError
        If that loop is not well-posed.
    """
    if not D22.any():
        return K
    read = D22 @ well_posed_inverse(np.eye(len(K.D)) + K.D @ D22)
    direct = np.eye(len(D22)) - read @ K.D
    return replace(K, A=K.A - K.B @ read @ K.C, B=K.B @ direct, C=K.C - K.D @ read @ K.C, D=K.D @ direct)


def cancelled(loop: Lti, D11: Array) -> Lti:
    """Return a continuous-time loop without the rounding residue of a feedthrough that the controller cancels."""
    residue = np.abs(loop.D).max(initial=0.0)
    if loop.dt == 0.0 and residue <= ALIKE * np.abs(D11).max(initial=0.0):
        return replace(loop, D=np.zeros_like(loop.D))
    return loop


@dataclass(eq=False)
class NormalizedPlant(GeneralizedPlant):
    """Plant with ``D12 = [0; I]``, ``D21 = [0, I]``, ``D22 = 0`` and scaled modal states.

    The controller of the original plant is ``from_controls @ K @ from_measurements``, except for the effect of ``D22``.
    Disturbances and performance outputs are only rotated, which preserves norms. Each state is named after the original
    state with the largest participation.
    """

    from_controls: Array
    from_measurements: Array


def normalized(plant: GeneralizedPlant) -> NormalizedPlant:
    """Return the plant in normalized signals and real modal coordinates, scaled with its inputs and outputs.

    ``D12`` must have full column rank and ``D21`` full row rank.
    """
    ncon, nmeas = plant.ncon, plant.nmeas
    left, columns, right = linalg.svd(plant.D12)
    rotate_z = np.hstack([left[:, ncon:], left[:, :ncon]]).T
    from_controls = right.T / columns
    left, rows, right = linalg.svd(plant.D21)
    rotate_w = np.vstack([right[nmeas:], right[:nmeas]]).T
    from_measurements = left.T / rows[:, None]
    B = np.hstack([plant.B1 @ rotate_w, plant.B2 @ from_controls])
    C = np.vstack([rotate_z @ plant.C1, from_measurements @ plant.C2])
    D = np.zeros((len(C), B.shape[1]))
    D[: plant.nz, : plant.nw] = rotate_z @ plant.D11 @ rotate_w
    D[plant.nz - ncon : plant.nz, plant.nw :] = np.eye(ncon)
    D[plant.nz :, plant.nw - nmeas : plant.nw] = np.eye(nmeas)
    d = signal_scales(plant.A, B, C)
    A, columns, _ = block_diagonal(plant.A / d[:, None] * d, _MAX_CONDITION)
    basis, inverse = d[:, None] * columns, (np.linalg.inv(columns) if len(A) else columns) / d
    d = signal_scales(A, inverse @ B, C @ basis)
    names = tuple(plant.system.state_labels[k] for k in np.abs(basis).argmax(axis=0)) if len(A) else ()
    A, B, C = A / d[:, None] * d, inverse @ B / d[:, None], C @ basis * d
    system = Lti(A, B, C, D, state_labels=names, dt=plant.system.dt)
    return NormalizedPlant(system, nmeas, ncon, from_controls, from_measurements)
