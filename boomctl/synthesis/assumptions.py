"""Assumptions of the syntheses; errors name the mode and the signals for which one fails."""

from collections.abc import Sequence

import numpy as np
from scipy import linalg

from boomctl.arrays import Array
from boomctl.exceptions import SynthesisError
from boomctl.lti.hidden_modes import unmoved
from boomctl.lti.rounding import DEPENDENT, SOLVED
from boomctl.synthesis.plants.partition import GeneralizedPlant, NormalizedPlant, normalized

_NAMED_FRACTION = 1e-3  # Least part in a dependent combination for which a signal is named.


def check_hidden_modes(
    kind: str, A: Array, B: Array, signals: Sequence[str], states: Sequence[str], dt: float = 0.0
) -> None:
    """Raise :class:`SynthesisError` for an unstable or undamped mode that is hidden from the signals of a kind.

    ``kind`` is "control" or, with the transposes of ``A`` and ``C``, "measurement".
    """
    able, hidden = {"control": ("stabiliz", "uncontroll"), "measurement": ("detect", "unobserv")}[kind]
    for mode in unmoved(A, B, states, dt=dt):
        raise SynthesisError(f"The plant is not {able}able: {mode} is {hidden}able from {', '.join(signals)}.")


def check_ranks(plant: GeneralizedPlant) -> None:
    """Check that every control has a weight and every measurement has noise.

    Raises
    ------
    SynthesisError
        If ``D12`` lacks full column rank or ``D21`` full row rank, with the signals.
    """
    continuous = plant.system.dt == 0.0
    where = " at high frequency" if continuous else " at the sample at which it acts"
    for signals in _dependent(plant.D12, plant.controls, "control"):
        raise SynthesisError(
            f"D12 must have full column rank: {signals} has no weight in the performance outputs{where}, so that its gain"
            " is unbounded. Add an effort weight."
        )
    for signals in _dependent(plant.D21.T, plant.measurements, "measurement"):
        raise SynthesisError(
            f"D21 must have full row rank: {signals} carries no noise of its own{' at high frequency' * continuous}, so that"
            " its gain is unbounded. Add a noise level."
        )


def _dependent(columns: Array, names: tuple[str, ...], what: str) -> list[str]:
    """Return the name of a column that vanishes or, failing that, of a combination of columns that does."""
    sizes = np.linalg.norm(columns, axis=0)
    zero = [f"{what} {name!r}" for name, size in zip(names, sizes, strict=True) if size <= SOLVED * sizes.max()]
    if zero:
        return zero[:1]
    _, values, right = linalg.svd(columns / sizes)
    if len(columns) >= len(names) and values[-1] > DEPENDENT:
        return []
    weight = np.abs(right[-1])
    parts = [repr(name) for name, part in zip(names, weight, strict=True) if part > _NAMED_FRACTION * weight.max()]
    return [f"a combination of the {what}s {', '.join(parts)}"]


def checked(plant: GeneralizedPlant) -> NormalizedPlant:
    """Return a generalized plant in normalized form, after checks of the assumptions of H2 and H-infinity synthesis.

    Raises
    ------
    SynthesisError
        If a control has no weight or a measurement no noise; if the plant is not stabilizable or not detectable, with the
        mode and its state; if there is a zero on the axis, from controls to performance outputs or from disturbances to
        measurements, with its frequency and its state.
    """
    check_ranks(plant)
    ready = normalized(plant)
    states, dt = ready.system.state_labels, ready.system.dt
    check_hidden_modes("control", ready.A, ready.B2, plant.controls, states, dt)
    check_hidden_modes("measurement", ready.A.T, ready.C2.T, plant.measurements, states, dt)
    for location in _zeros_on_axis(ready):
        raise SynthesisError(
            f"From the controls ({', '.join(plant.controls)}) to the performance outputs there is a zero {location}. Weight"
            " a signal in which that motion has a part, or damp it."
        )
    for location in _zeros_on_axis(ready.dual):
        raise SynthesisError(
            f"From the disturbances ({', '.join(plant.disturbances)}) to the measurements"
            f" ({', '.join(plant.measurements)}) there is a zero {location}. Add a disturbance or a noise that excites that"
            " motion."
        )
    return ready


def _zeros_on_axis(ready: GeneralizedPlant) -> list[str]:
    """Describe the zeros on the axis from controls to performance outputs: modes that control can make unobservable."""
    free, dt = ready.nz - ready.ncon, ready.system.dt
    rows = ready.C1[:free]
    rows = rows[np.linalg.norm(rows, axis=1) > SOLVED * np.linalg.norm(ready.C1)]  # without rounding of a rotation
    shifted, locations = ready.A - ready.B2 @ ready.C1[free:], []
    for zero in unmoved(shifted.T, rows.T, ready.system.state_labels, axis_only=True, dt=dt):
        omega = abs(zero.pole.imag) or zero.omega
        axis = "unit circle" if dt else "imaginary axis"
        locations.append(
            f"on the {axis} at {omega:.6g} rad/s ({omega / (2.0 * np.pi):.4g} Hz, mostly in state {zero.state!r})"
        )
    return locations
