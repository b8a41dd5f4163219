"""What must hold before a controller is looked for; what fails is named by mode and signal."""

from collections.abc import Sequence

import numpy as np
from scipy import linalg

from boomctl.arrays import Array
from boomctl.exceptions import SynthesisError
from boomctl.lti.hidden_modes import HiddenMode, unmoved
from boomctl.lti.rounding import SOLVED
from boomctl.synthesis.hinf.normal_form import NormalizedPlant
from boomctl.synthesis.plants.partition import GeneralizedPlant

# Least singular value of D12 or D21 with unit columns: the inverse of a smaller one has six digits or fewer
_RANK = 1e-10
_ZERO = 1e-14  # share of the largest column below which a column is nothing but rounding
_SHARE = 1e-3  # least part in a dependent combination that a signal is named for (a choice)


def check_stabilizable(A: Array, B: Array, controls: Sequence[str], states: Sequence[str], dt: float = 0.0) -> None:
    """Raise :class:`SynthesisError` naming an unstable or undamped mode that the controls cannot move."""
    for mode in unmoved(A, B, states, dt=dt):
        raise SynthesisError(
            f"not stabilisable: {mode} cannot be moved by {_listed(controls)}, and it does not decay by itself"
        )


def check_detectable(A: Array, C: Array, measurements: Sequence[str], states: Sequence[str], dt: float = 0.0) -> None:
    """Raise :class:`SynthesisError` naming an unstable or undamped mode that no measurement sees."""
    for mode in unmoved(A.T, C.T, states, dt=dt):
        raise SynthesisError(
            f"not detectable: {mode} is not seen by {_listed(measurements)}, and it does not decay by itself"
        )


def check_weighted(A: Array, root: Array, what: str, states: Sequence[str], dt: float = 0.0) -> None:
    """Raise :class:`SynthesisError` naming a mode on the imaginary axis that the weight ``root root^T`` does not see."""
    for mode in unmoved(A.T, root, states, axis_only=True, dt=dt):
        raise SynthesisError(f"{mode} is undamped and not seen by {what}: weigh a state or output in which it shows")


def check_excited(A: Array, root: Array, what: str, states: Sequence[str], dt: float = 0.0) -> None:
    """Raise :class:`SynthesisError` naming a mode on the imaginary axis that the noise ``root root^T`` does not reach."""
    for mode in unmoved(A, root, states, axis_only=True, dt=dt):
        raise SynthesisError(
            f"{mode} is undamped and not reached by {what}: the estimator would trust its model of it for ever"
        )


def _listed(signals: Sequence[str]) -> str:
    return ", ".join(signals) if signals else "any control"


def check_ranks(plant: GeneralizedPlant) -> None:
    """Refuse a control that costs nothing and a measurement without noise.

    Raises
    ------
    SynthesisError
        ``D12`` lacks full column rank or ``D21`` full row rank; the signals are named.
    """
    continuous = plant.system.dt == 0.0
    lazy = _dependent(plant.D12, plant.controls)
    if lazy:
        where = " at high frequency" if continuous else " at the sample at which it acts"
        raise SynthesisError(
            f"D12 has not full column rank: the performance signals do not weigh {_combined('control', lazy)}{where}, "
            "so that the best controller would use it without limit; give it an effort weight"
        )
    exact = _dependent(plant.D21.T, plant.measurements)
    if exact:
        where = " at high frequency" if continuous else ""
        raise SynthesisError(
            f"D21 has not full row rank: {_combined('measurement', exact)} carries no noise of its own{where}, "
            "so that the best controller would differentiate it without limit; give it a noise level"
        )


def _combined(what: str, names: list[str]) -> str:
    quoted = ", ".join(repr(name) for name in names)
    return f"{what} {quoted}" if len(names) == 1 else f"a combination of the {what}s {quoted}"


def _dependent(columns: Array, names: tuple[str, ...]) -> list[str]:
    """Return the names of columns that vanish or, failing that, of a combination of columns that does."""
    sizes = np.linalg.norm(columns, axis=0)
    zero = [name for name, size in zip(names, sizes, strict=True) if size <= _ZERO * sizes.max()]
    if zero:
        return zero[:1]
    right = linalg.svd(columns / sizes)
    values = np.concatenate([right[1], np.zeros(max(0, len(names) - len(columns)))])
    if values[-1] > _RANK:
        return []
    share = np.abs(right[2][-1])
    return [name for name, part in zip(names, share, strict=True) if part > _SHARE * share.max()]


def check_modes(plant: GeneralizedPlant, ready: NormalizedPlant) -> None:
    """Refuse unstable and undamped modes of a generalized plant that no control moves or no measurement sees.

    Raises
    ------
    SynthesisError
        The plant is not stabilisable or not detectable; the mode and its state are named.
    """
    check_stabilizable(ready.A, ready.B2, plant.controls, ready.system.state_labels, ready.system.dt)
    check_detectable(ready.A, ready.C2, plant.measurements, ready.system.state_labels, ready.system.dt)


def check_zeros(plant: GeneralizedPlant, ready: NormalizedPlant) -> None:
    """Refuse zeros on the imaginary axis, from controls to performance signals and from disturbances to measurements.

    Raises
    ------
    SynthesisError
        There is one; its frequency and its state are named.
    """
    for zero in _zeros_on_axis(ready):
        raise SynthesisError(
            f"from the controls ({', '.join(plant.controls)}) to the performance signals nothing passes "
            f"{_place(zero, plant.system.dt)}: "
            "weigh a signal in which that motion shows, or damp it"
        )
    for zero in _zeros_on_axis(ready.dual):
        raise SynthesisError(
            f"from the disturbances ({', '.join(plant.disturbances)}) to the measurements "
            f"({', '.join(plant.measurements)}) nothing passes {_place(zero, plant.system.dt)}: add a disturbance or a "
            "measurement noise that excites that motion"
        )


def _zeros_on_axis(ready: GeneralizedPlant) -> tuple[HiddenMode, ...]:
    """Return zeros from controls to performance signals on the axis: modes that control can hide from these signals."""
    free = ready.nz - ready.ncon
    rows = ready.C1[:free]
    # share of all performance rows below which one of them is what rounding leaves of a rotation
    rows = rows[np.linalg.norm(rows, axis=1) > SOLVED * np.linalg.norm(ready.C1)]
    shifted, dt = ready.A - ready.B2 @ ready.C1[free:], ready.system.dt
    return unmoved(shifted.T, rows.T, ready.system.state_labels, axis_only=True, dt=dt)


def _place(zero: HiddenMode, dt: float) -> str:
    omega = abs(zero.pole.imag) or zero.omega
    at = f"at {omega:.6g} rad/s ({omega / (2.0 * np.pi):.4g} Hz)"
    return f"{at}, a zero on the {'unit circle' if dt else 'imaginary axis'} (mostly in state {zero.state!r})"
