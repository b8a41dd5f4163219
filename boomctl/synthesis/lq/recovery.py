"""Loop transfer recovery: how near the loop of an LQG controller comes to that of its regulator."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from importlib import import_module
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike
from scipy import linalg

from boomctl.arrays import Array, blocks
from boomctl.checks import finite_array, frequencies, positive
from boomctl.lti.frequency import singular_values
from boomctl.lti.rounding import TINY
from boomctl.lti.system import Lti
from boomctl.printing import count, listed
from boomctl.synthesis.lq.lqg import LqgResult, lqg
from boomctl.synthesis.lq.problem import Weight, chosen, plant_of
from boomctl.threads import one_blas_thread

if TYPE_CHECKING:
    import control

    from boomctl.structure.model import SecondOrderModel

_SHARED = 1e-6  # relative distance of zeros of two random projections that are one: half of the digits, and some more
_RIGHT = 1e-9  # relative distance from the axis of a zero on the right: zeros of a pencil have fewer digits than poles
_INFINITE = 1e6  # multiple of the size of A beyond which a zero is an infinite one that rounding has moved
_POINTS = 400  # frequencies at which loops are compared, spread evenly in the logarithm (a choice)


@dataclass(frozen=True)
class RecoveryResult:
    """LQG controllers whose loops come nearer and nearer that of the regulator.

    Attributes
    ----------
    noise_intensities : (k,) ndarray
        Intensities of the fictitious noise at the controls.
    recovery_errors : (k,) ndarray
        Largest distance between a singular value of the loop at the plant's input and its counterpart of the
        regulator's loop ``F (s I - A)^-1 B`` in the band, relative to the latter.
    omega : (n,) ndarray
        Frequencies at which they were compared [rad/s].
    target, recovered : (m, n) ndarray
        Singular values of the regulator's loop and of the last controller's, descending.
    zeros : complex ndarray
        Transmission zeros in the right half-plane from controls to measurements; with any, recovery is incomplete.
    designs : tuple of LqgResult
        One for each strength.
    """

    noise_intensities: Array
    recovery_errors: Array
    omega: Array = field(repr=False)
    target: Array = field(repr=False)
    recovered: Array = field(repr=False)
    zeros: Array
    designs: tuple[LqgResult, ...] = field(repr=False)

    def __repr__(self) -> str:
        pairs = zip(self.noise_intensities, self.recovery_errors, strict=True)
        gaps = listed([f"{gap:.3g} at {strength:.3g}" for strength, gap in pairs])
        zeros = (
            f"\n  {count(len(self.zeros), 'zero')} in the right half-plane: it stays incomplete"
            if len(self.zeros)
            else ""
        )
        return f"RecoveryResult: relative gap to the regulator's loop, by strength of the noise\n  {gaps}{zeros}"

    def plot(self, ax: Any = None, *, frequency_unit: str | None = None, **style: Any) -> Array:
        """Draw the regulator's loop and the recovered one over frequency, and the gap over the strength.

        Parameters
        ----------
        ax : sequence of matplotlib Axes, or a figure, optional
            Where to draw: loops and gaps; by default a new figure of pyplot.
        frequency_unit : {"Hz", "rad/s"}, optional
            Of the frequency axis, by default Hz.
        **style
            Of the curves, as matplotlib's lines take it; a ``label`` stands before their names.

        Returns
        -------
        ndarray of matplotlib.axes.Axes
            Those drawn on, in the order in which ``ax`` names them.
        """
        return import_module("boomctl.plotting.design").plot_recovery(self, ax, frequency_unit=frequency_unit, **style)


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
    """Return LQG controllers for growing fictitious noise at the controls, and how far they are from the regulator's loop.

    Source: Doyle & Stein (1979).

    Parameters
    ----------
    system, Q, R, process_noise, measurement_noise, measurements, controls, disturbances, output_weight
        As for :func:`lqg`.
    noise_intensities : array_like
        Intensities of the fictitious noise, each above zero; one controller is designed for each.
    omega_range : (float, float)
        Frequencies between which the loops are compared [rad/s].

    Returns
    -------
    RecoveryResult
        One design for each strength, and the gap between its loop and the regulator's.

    Raises
    ------
    TypeError, ValueError
        Fewer measurements than controls: no recovery; no strengths; a band that does not ascend; weights of which the
        regulator does nothing; as :func:`lqg`.
    SynthesisError
        As :func:`lqg`.

    Examples
    --------
    >>> import boomctl as bc
    >>> import control
    >>> mass = control.ss([[0.0, 1.0], [0.0, 0.0]], [[0.0], [1.0]], [[1.0, 0.0]], 0.0, inputs="force", outputs="place")
    >>> setting = {"output_weight": {"place": 1.0}, "noise_intensities": [1.0, 1e2, 1e4], "omega_range": (0.1, 10.0)}
    >>> found = bc.synthesis.loop_transfer_recovery(mass, None, 1.0, {"force": 1.0}, 1.0, **setting)
    >>> found.recovery_errors.round(2)  # the more noise, the nearer
    array([0.97, 0.87, 0.3 ])
    """
    plant = plant_of(system)
    driven = chosen("controls", controls, plant.input_labels)
    measured = chosen("measurements", measurements, plant.output_labels)
    if len(measured) < len(driven):
        raise ValueError(
            f"measurements: expected at least as many as controls ({len(driven)}) to recover a loop, got {len(measured)}"
        )
    ends = frequencies("omega_range", omega_range)
    if ends.shape != (2,) or not 0.0 < ends[0] < ends[1]:
        raise ValueError(f"omega_range = {omega_range!r}: expected two frequencies above zero, ascending [rad/s]")
    omega = np.geomspace(ends[0], ends[1], _POINTS)
    given = np.atleast_1d(finite_array("noise_intensities", noise_intensities))
    if given.ndim != 1 or not given.size:
        raise ValueError(f"noise_intensities: expected one number or more, got shape {given.shape}")
    levels = [positive("noise_intensities", float(q)) for q in given]
    noise = (process_noise, measurement_noise, measured, driven)
    options = {"disturbances": disturbances, "output_weight": output_weight}
    designs = tuple(lqg(system, Q, R, *noise, **options, ltr_intensity=level) for level in levels)  # type: ignore[arg-type]
    inner, F = plant.select(driven, measured), designs[0].regulator_gain
    target = singular_values(Lti(plant.A, inner.B, F, np.zeros((len(F), len(F)))).response(omega))
    if not target.all():
        at = float(omega[np.flatnonzero((target == 0.0).any(axis=0))[0]])
        raise ValueError(
            f"Q, output_weight: expected a regulator with a loop to recover; at {at:.4g} rad/s a singular value of its "
            "loop is zero"
        )
    response = inner.response(omega)
    loops = [singular_values(_at_input(design, response, omega)) for design in designs]
    gaps = np.array([float((np.abs(loop - target) / target).max()) for loop in loops])
    return RecoveryResult(
        noise_intensities=np.array(levels),
        recovery_errors=gaps,
        omega=omega,
        target=target,
        recovered=loops[-1],
        zeros=right_zeros(inner),
        designs=designs,
    )


def _at_input(design: LqgResult, plant: Array, omega: Array) -> Array:
    """Return the loop broken at the plant's input, with the sign of the regulator's."""
    K = design._controller.balanced().response(omega)
    return np.moveaxis(-np.moveaxis(K, 2, 0) @ np.moveaxis(plant, 2, 0), 0, 2)


def right_zeros(system: Lti) -> Array:
    """Return the transmission zeros in the right half-plane of a system with at least as many outputs as inputs.

    With more outputs than inputs the pencil is compressed by two random projections; a zero is one that both share.
    """
    p, m = system.D.shape
    random = np.random.default_rng(0)
    result = [_square_zeros(system, np.eye(p) if p == m else random.standard_normal((m, p))) for _ in range(2)]
    first, second = result
    if p == m or not len(first):
        return first
    near = np.array([np.abs(second - z).min(initial=np.inf) <= _SHARED * abs(z) for z in first], dtype=bool)
    return first[near]


def _square_zeros(system: Lti, mix: Array) -> Array:
    n, m = system.B.shape
    s = system.balanced()
    A, B, C, D = s.A, s.B, mix @ s.C, mix @ s.D
    size = max(float(np.linalg.norm(A)), TINY)
    B, C = B * (size / max(float(np.linalg.norm(B)), TINY)), C / max(float(np.linalg.norm(C)), TINY)
    pencil = blocks([[A, B], [C, D]])
    mass = linalg.block_diag(np.eye(n), np.zeros((m, m)))
    with np.errstate(divide="ignore", invalid="ignore"):
        values = linalg.eigvals(pencil, mass)
    values = values[np.isfinite(values)]
    return values[(values.real > _RIGHT * np.abs(values)) & (np.abs(values) < _INFINITE * size)]
