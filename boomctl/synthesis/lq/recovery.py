"""Loop transfer recovery: distance of the loops of LQG controllers from that of the regulator."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from boomctl.arrays import Array
from boomctl.checks import finite_array, positive, some_names, span
from boomctl.lti.frequency import CURVE, highest_peak, resonance_grid, singular_values
from boomctl.lti.modal import transmission_zeros
from boomctl.lti.system import Lti, series
from boomctl.printing import count, listed
from boomctl.synthesis.lq.lqg import LqgResult, lqg
from boomctl.synthesis.lq.problem import Weight, plant_of
from boomctl.threads import one_blas_thread

if TYPE_CHECKING:
    import control

    from boomctl.structure.model import SecondOrderModel

_RIGHT_RTOL = 1e-9  # Real part of a zero in the right half-plane, relative to its modulus.


@dataclass(frozen=True)
class RecoveryResult:
    """LQG controllers for increasing noise at the controls, compared with the regulator.

    Attributes
    ----------
    noise_intensities : (k,) ndarray
        Intensities of the fictitious noise at the controls.
    recovery_errors : (k,) ndarray
        Largest singular value of ``(L - M) M^-1`` in the range of frequencies, of the loop ``L = -K G`` at the plant's input
        and that of the regulator, ``M = F (s I - A)^-1 B``: their relative difference, in magnitude and phase.
    zeros : complex ndarray
        Transmission zeros in the right half-plane from controls to measurements. If there are any, recovery is incomplete.
    designs : tuple of LqgResult
        One for each intensity.
    """

    noise_intensities: Array
    recovery_errors: Array
    zeros: Array
    designs: tuple[LqgResult, ...] = field(repr=False)

    def __repr__(self) -> str:
        pairs = zip(self.noise_intensities, self.recovery_errors, strict=True)
        errors = listed([f"{error:.3g} at {intensity:.3g}" for intensity, error in pairs])
        zeros = count(len(self.zeros), "zero")
        text = f"\n  {zeros} in the right half-plane: recovery is incomplete" if len(self.zeros) else ""
        return f"RecoveryResult: relative error of the recovered loop, by noise intensity\n  {errors}{text}"


@one_blas_thread
def loop_transfer_recovery(
    system: control.StateSpace | SecondOrderModel,
    Q: Weight | None,
    R: Weight,
    process_noise: Weight,
    measurement_noise: Weight,
    measurements: str | Sequence[str] | None = None,
    controls: str | Sequence[str] | None = None,
    *,
    noise_intensities: ArrayLike,
    omega_range: tuple[float, float],
    disturbances: str | Sequence[str] | None = None,
    output_weight: Weight | None = None,
) -> RecoveryResult:
    """Design LQG controllers for increasing fictitious noise at the controls, and compare their loops with the regulator's.

    Source: Doyle & Stein (1979).

    Parameters
    ----------
    system, Q, R, process_noise, measurement_noise, measurements, controls, disturbances, output_weight
        See :func:`lqg`.
    noise_intensities : array_like
        Intensities of the fictitious noise, positive; one controller is designed for each.
    omega_range : (float, float)
        Frequencies between which the loops are compared [rad/s].

    Returns
    -------
    RecoveryResult
        One design for each intensity, and the error of its loop.

    Raises
    ------
    TypeError, ValueError
        If there are fewer measurements than controls, if there are no intensities, if the range does not ascend, if the
        gain of the regulator is zero, or as for :func:`lqg`.
    SynthesisError
        See :func:`lqg`.

    Examples
    --------
    >>> import boomctl as bc
    >>> import control
    >>> mass = control.ss([[0.0, 1.0], [0.0, 0.0]], [[0.0], [1.0]], [[1.0, 0.0]], 0.0, inputs="force", outputs="place")
    >>> setting = {"output_weight": {"place": 1.0}, "noise_intensities": [1e4, 1e6, 1e8], "omega_range": (0.1, 10.0)}
    >>> found = bc.synthesis.loop_transfer_recovery(mass, None, 1.0, {"force": 1.0}, 1.0, **setting)
    >>> found.recovery_errors.round(2)  # decreases with the noise
    array([1.14, 0.43, 0.14])
    """
    plant = plant_of(system)
    driven = some_names("control", controls, plant.input_labels)
    measured = some_names("measurement", measurements, plant.output_labels)
    if len(measured) < len(driven):
        raise ValueError(
            f"`measurements` must be at least as many as the controls ({len(driven)}), got {len(measured)}."
        )
    low, high = span("omega_range", omega_range)
    intensities = np.atleast_1d(finite_array("noise_intensities", noise_intensities))
    if intensities.ndim != 1 or not intensities.size:
        raise ValueError(f"`noise_intensities` must be one number or more, got shape {intensities.shape}.")
    arguments = (system, Q, R, process_noise, measurement_noise, measured, driven)
    options: dict[str, Any] = {"disturbances": disturbances, "output_weight": output_weight}
    designs = tuple(
        lqg(*arguments, **options, ltr_intensity=positive("noise_intensities", float(q))) for q in intensities
    )
    inner, F = plant.select(driven, measured), designs[0].regulator_gain
    target = Lti(plant.A, inner.B, F, np.zeros((len(F), len(F)))).balanced()
    inner, grid = inner.balanced(), np.geomspace(positive("omega_range", low), high, CURVE)
    if not (gains := singular_values(target.response(grid))).all():
        at = float(grid[np.flatnonzero((gains == 0.0).any(axis=0))[0]])
        raise ValueError(
            f"`Q` and `output_weight` must yield a regulator with a loop to recover, got a zero gain at {at:.4g} rad/s."
        )

    def error(K: Lti, omega: Array) -> Array:
        recovered, wanted = (loop.response(omega).transpose(2, 1, 0) for loop in (series(inner, K), target))
        return np.linalg.norm(np.eye(len(F)) + np.linalg.solve(wanted, recovered), 2, axis=(1, 2))

    errors = []
    for design in designs:
        K = design._controller.balanced()
        resonances = np.concatenate([K.poles, transmission_zeros(target)])  # of the relative difference of the loops
        errors.append(highest_peak(partial(error, K), resonance_grid(resonances, low, high))[0])
    zeros = transmission_zeros(inner)
    return RecoveryResult(intensities, np.array(errors), zeros[zeros.real > _RIGHT_RTOL * np.abs(zeros)], designs)
