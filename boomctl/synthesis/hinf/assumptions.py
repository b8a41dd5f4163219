"""What a generalised plant must allow before a controller is looked for; what fails is named by mode and signal."""

import numpy as np
from scipy import linalg

from boomctl.arrays import Array
from boomctl.lti.modal import side_of_axis
from boomctl.synthesis.errors import SynthesisError
from boomctl.synthesis.hinf.normal_form import NormalizedPlant
from boomctl.synthesis.plants.partition import GeneralizedPlant

_RANK = 1e-10
_HIDDEN = 1e-9
_ROUNDING = 1e-13  # share of the fastest eigenvalue by which rounding may have moved another off the axis (a choice)
_SAME = 1e-7
_PARALLEL = 1e-5


def check_ranks(plant: GeneralizedPlant) -> None:
    """Refuse a control that costs nothing and a measurement without noise.

    Raises
    ------
    SynthesisError
        ``D12`` lacks full column rank or ``D21`` full row rank; the signals are named.
    """
    lazy = _dependent(plant.D12, plant.controls)
    if lazy:
        raise SynthesisError(
            f"D12 has not full column rank: the performance signals do not weigh {_listed('control', lazy)} at high "
            "frequency, so that the best controller would use it without limit; give it an effort weight"
        )
    exact = _dependent(plant.D21.T, plant.measurements)
    if exact:
        raise SynthesisError(
            f"D21 has not full row rank: {_listed('measurement', exact)} carries no noise of its own at high frequency, "
            "so that the best controller would differentiate it without limit; give it a noise level"
        )


def _listed(what: str, names: list[str]) -> str:
    quoted = ", ".join(repr(name) for name in names)
    return f"{what} {quoted}" if len(names) == 1 else f"a combination of the {what}s {quoted}"


def _dependent(columns: Array, names: tuple[str, ...]) -> list[str]:
    """Return the names of columns that vanish or, failing that, of a combination of columns that does."""
    sizes = np.linalg.norm(columns, axis=0)
    zero = [name for name, size in zip(names, sizes, strict=True) if size <= 1e-14 * sizes.max()]
    if zero:
        return zero[:1]
    right = linalg.svd(columns / sizes)
    values = np.concatenate([right[1], np.zeros(max(0, len(names) - len(columns)))])
    if values[-1] > _RANK:
        return []
    share = np.abs(right[2][-1])
    return [name for name, part in zip(names, share, strict=True) if part > 1e-3 * share.max()]


def check_modes(plant: GeneralizedPlant, ready: NormalizedPlant) -> None:
    """Refuse modes on or right of the imaginary axis that no control moves or no measurement sees.

    Raises
    ------
    SynthesisError
        The plant is not stabilisable or not detectable; the mode, its frequency and its states are named.
    """
    found = _hidden(ready.A.T, ready.B2.T, right_half=True)
    if found is not None:
        raise SynthesisError(
            f"not stabilisable: no control ({', '.join(plant.controls)}) moves the {_mode(*found, plant, ready)}"
        )
    found = _hidden(ready.A, ready.C2, right_half=True)
    if found is not None:
        raise SynthesisError(
            f"not detectable: no measurement ({', '.join(plant.measurements)}) sees the {_mode(*found, plant, ready)}"
        )


def check_zeros(plant: GeneralizedPlant, ready: NormalizedPlant) -> None:
    """Refuse zeros on the imaginary axis, from controls to performance signals and from disturbances to measurements.

    Raises
    ------
    SynthesisError
        There is one; its frequency and the states involved are named.
    """
    free = ready.nz - ready.ncon
    found = _hidden(ready.A - ready.B2 @ ready.C1[free:], ready.C1[:free])
    if found is not None:
        raise SynthesisError(
            f"from the controls ({', '.join(plant.controls)}) to the performance signals nothing passes at "
            f"{_place(found[0])}, a zero on the imaginary axis ({_states(found[1], plant, ready)}): weigh a signal in "
            "which that motion shows, or damp it"
        )
    free = ready.nw - ready.nmeas
    found = _hidden((ready.A - ready.B1[:, free:] @ ready.C2).T, ready.B1[:, :free].T)
    if found is not None:
        raise SynthesisError(
            f"from the disturbances ({', '.join(plant.disturbances)}) to the measurements "
            f"({', '.join(plant.measurements)}) nothing passes at {_place(found[0])}, a zero on the imaginary axis "
            f"({_states(found[1], plant, ready)}): add a disturbance or a measurement noise that excites that motion"
        )


def _hidden(A: Array, C: Array, right_half: bool = False) -> tuple[complex, Array] | None:
    """Return an eigenvalue on the axis (or right of it) and an eigenvector that ``C`` does not see, if there is one."""
    if not len(A):
        return None
    values, vectors = linalg.eig(A)
    side = side_of_axis(values, _ROUNDING * np.abs(values).max())
    critical = (side >= 0) if right_half else (side == 0)
    size = max(float(np.linalg.norm(C)), np.finfo(float).tiny)
    for value in values[critical & (values.imag >= 0.0)]:
        near = np.abs(values - value) <= _SAME * max(abs(value), 1e-6 * np.abs(values).max())
        left, strength, _ = linalg.svd(vectors[:, near], full_matrices=False)
        space = left[:, strength > _PARALLEL * strength[0]]
        seen = linalg.svd(C @ space / size) if len(C) else (None, np.zeros(0), np.eye(space.shape[1]))
        if len(seen[1]) < space.shape[1] or seen[1][-1] <= _HIDDEN:
            return complex(value), space @ np.conj(seen[2][-1])
    return None


def _mode(value: complex, vector: Array, plant: GeneralizedPlant, ready: NormalizedPlant) -> str:
    damping = "unstable" if side_of_axis(np.array([value]))[0] > 0 else "undamped"
    kind = "integrating mode" if abs(value) < 1e-12 else f"{damping} mode at {_place(value)}"
    return f"{kind} ({_states(vector, plant, ready)})"


def _place(value: complex) -> str:
    omega = abs(value.imag) if value.imag else abs(value)
    return f"{omega:.6g} rad/s ({omega / (2.0 * np.pi):.4g} Hz)"


def _states(vector: Array, plant: GeneralizedPlant, ready: NormalizedPlant) -> str:
    """Name the states that take the largest part in a mode; left and right vectors mark the same ones."""
    share = np.abs(ready.modes @ vector)
    order = np.argsort(-share)
    main = [plant.system.states[i] for i in order[:3] if share[i] > 0.3 * share[order[0]]]
    return "mostly in " + ", ".join(repr(name) for name in main)
