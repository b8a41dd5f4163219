"""Linear-quadratic-Gaussian controllers, loop transfer recovery, and what LQG and H2 synthesis share."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from boomctl.analysis.h2 import matrices_h2_norm
from boomctl.arrays import Array, blocks
from boomctl.checks import exactly, finite_array, nonnegative, positive, some_names, span, warn_user
from boomctl.exceptions import SynthesisError
from boomctl.lti.frequency import CURVE, highest_peak, resonance_grid, singular_values
from boomctl.lti.gramians import square_root
from boomctl.lti.modal import sides, transmission_zeros
from boomctl.lti.rounding import ALIKE
from boomctl.lti.system import Lti, lower_lft, rates_of, series
from boomctl.printing import count, listed, system
from boomctl.reduction.result import ReductionResult
from boomctl.synthesis.certificate import DesignCertificate, LoopDesign
from boomctl.synthesis.lq.kalman import filter_problem
from boomctl.synthesis.lq.lqr import regulator_problem
from boomctl.synthesis.lq.problem import Weight, plant_of, semidefinite, solved
from boomctl.synthesis.lq.riccati import MAX_COST_ERROR, RiccatiProblem, RiccatiSolution
from boomctl.synthesis.plants.full_plant import ReducedPlant, evaluate_on_full_plant, origin_of
from boomctl.synthesis.plants.partition import GeneralizedPlant
from boomctl.threads import one_blas_thread

if TYPE_CHECKING:
    import control

    from boomctl.structure.model import SecondOrderModel


@dataclass(frozen=True)
class LqgResult(LoopDesign):
    """Result of a linear-quadratic-Gaussian design.

    Attributes
    ----------
    controller : control.StateSpace
        ``u = K y``, labeled as the measurements and controls, in the units of the machine.
    scaled_controller : control.StateSpace
        The same in the scaled signals of the plant; equal to `controller` if the plant has no scales.
    closed_loop : control.StateSpace
        Closed loop from the inputs that are not controls (if there are none: from signals added to the controls, with their
        labels) to the outputs of the system.
    regulator_gain, filter_gain : ndarray
        ``F`` of ``u = -F z`` and ``L`` of ``z' = A z + B u + L (y - C z - D u)``; in discrete time ``z+`` for ``z'``.
    poles : complex ndarray
        Poles of the closed loop [rad/s]: those of the regulator, then those of the filter.
    cost : float
        Stationary expected value of ``x^T Q x + y^T W y + u^T R u``.
    certificate : DesignCertificate
        The H2 norm of the loop, the least one by the Riccati equations, and the errors of their solutions.
    """

    _called = "lqg"

    regulator_gain: Array = field(repr=False)
    filter_gain: Array = field(repr=False)
    poles: Array = field(repr=False)
    cost: float
    certificate: DesignCertificate

    @property
    def h2_norm(self) -> float:
        """H2 norm of the closed loop, the square root of ``cost``."""
        return self.certificate.norm_bounds.value

    def __repr__(self) -> str:
        c = self.certificate
        costs = f"cost {self.cost:.6g}, {c.norm_bounds.status}; optimal {c.lower_bound**2:.6g}{c._on_full_plant}"
        return f"LqgResult: controller of {system(self._controller)}\n  {costs}"


@one_blas_thread
def lqg(
    system: control.StateSpace | SecondOrderModel | ReductionResult,
    Q: Weight | None,
    R: Weight,
    process_noise: Weight,
    measurement_noise: Weight,
    measurements: str | Sequence[str] | None = None,
    controls: str | Sequence[str] | None = None,
    *,
    disturbances: str | Sequence[str] | None = None,
    output_weight: Weight | None = None,
    ltr_intensity: float = 0.0,
) -> LqgResult:
    """Design the controller that minimizes the expected ``x^T Q x + y^T W y + u^T R u`` in white noise.

    Parameters
    ----------
    system : control.StateSpace, SecondOrderModel or ReductionResult
        System with labeled signals. For a result of `reduce`, and a generalized plant of one, the loop is also evaluated on
        the full plant: ``certificate.full_plant``, whose norm is the root of the cost there. This cost is not defined if
        ``Q`` or ``process_noise`` is of states of the reduced plant. For a discrete system, the control at a sample depends
        on the measurements before it.
    Q, R, output_weight
        Weights of states, controls and outputs, see :func:`lqr`.
    process_noise, measurement_noise, disturbances
        Intensities of the noise, and the inputs that are noise, see :func:`kalman`.
    measurements, controls : sequence of str, optional
        Inputs and outputs of the controller. If None, all.
    ltr_intensity : float
        Intensity of fictitious noise added to each control (Doyle & Stein 1979). As it grows, the loop at the plant's input
        approaches that of the regulator, if the plant has no zeros in the right half-plane; see
        :func:`loop_transfer_recovery`. The cost includes this noise. Only in continuous time.

    Returns
    -------
    LqgResult
        The controller ``u = K y``, the closed loop, its poles and expected cost, and a certificate.

    Raises
    ------
    TypeError, ValueError
        See :func:`lqr` and :func:`kalman`.
    SynthesisError
        If an assumption fails, with the mode; if the closed loop is not stable, or its cost is not that of the Riccati
        equations.

    Warns
    -----
    BoomctlWarning
        If no controls are given, and only some of the inputs are noise.
    ReductionWarning
        If the loop with the full plant is not stable, not proved to be, or has a root of the cost larger by a tenth.

    Examples
    --------
    >>> import boomctl as bc
    >>> import control
    >>> mass = control.ss([[0.0, 1.0], [0.0, 0.0]], [[0.0], [1.0]], [[1.0, 0.0]], 0.0, inputs="force", outputs="place")
    >>> design = bc.lqg(mass, None, 1.0, {"force": 1.0}, 1.0, output_weight={"place": 1.0})
    >>> round(design.cost, 4), design.controller.nstates
    (8.4853, 2)
    """
    plant = plant_of(system.system if isinstance(system, ReductionResult) else system, sampled=True)
    driven = some_names("control", controls, plant.input_labels)
    noisy = [name for name in plant.input_labels if isinstance(process_noise, Mapping) and name in process_noise]
    if controls is None and noisy and len(noisy) < len(plant.input_labels):
        warn_user(
            f"The controller drives all inputs, also those with process noise, {', '.join(noisy)}. Pass"
            " `controls` to exclude them."
        )
    measured = some_names("measurement", measurements, plant.output_labels)
    if nonnegative("ltr_intensity", ltr_intensity) and plant.dt:
        raise ValueError(
            f"`ltr_intensity` must be 0 for a discrete system, whose loop is not recovered, got {exactly(ltr_intensity)}."
        )

    def parts(plant: Lti, Q: Weight | None) -> tuple[Lti, RiccatiProblem, RiccatiProblem, tuple[str, ...]]:
        """Return a plant from controls to measurements, the problems of regulator and filter, and the noisy inputs."""
        problem, G = regulator_problem(plant, driven, Q, R, output_weight), plant.select(driven, measured)
        dual, entering = filter_problem(plant, process_noise, measurement_noise, measured, disturbances)
        B, D, q = G.B, G.D, ltr_intensity
        dual = replace(dual, Q=dual.Q + q * B @ B.T, R=dual.R + q * D @ D.T, N=dual.N + q * B @ D.T)
        return G, problem, dual, entering

    G, problem, dual, entering = parts(plant, Q)
    regulator = solved(problem, "regulator", driven, plant.state_labels)
    estimator = solved(dual, "filter", measured, plant.state_labels)
    K = observer(G, regulator.gain, estimator.gain.T)
    P = GeneralizedPlant(_weighted(G, problem, dual), len(measured), len(driven))
    loop = lower_lft(P.system, K)
    effort = problem.R if plant.dt == 0.0 else problem.R + problem.B.T @ regulator.X @ problem.B
    least = least_cost(dual.Q, effort, regulator, estimator)
    origin = origin_of(system)
    by_states = not entering or (Q is not None and bool(semidefinite("Q", Q, plant.state_labels).any()))
    if origin is not None:
        around = origin.around

        def with_cost(full: Lti) -> Lti:
            full_plant = around(full).select(plant.input_labels, plant.output_labels)
            return _between_all(full_plant, driven, measured) if by_states else _weighted(*parts(full_plant, 0.0)[:3])

        origin = ReducedPlant(origin.reduction, with_cost)
    certificate = certify(loop, K, least, regulator, estimator, plant=P, origin=origin, by_states=by_states)
    return LqgResult(
        _controller=K,
        _closed_loop=lower_lft(_between_all(plant, driven, measured), K),
        regulator_gain=regulator.gain,
        filter_gain=estimator.gain.T,
        poles=np.concatenate([regulator.poles, estimator.poles]),
        cost=certificate.norm_bounds.value**2,
        certificate=certificate,
        _plant=G,
    )


def _weighted(G: Lti, problem: RiccatiProblem, dual: RiccatiProblem) -> Lti:
    """Return the generalized plant whose squared H2 norm is the cost."""
    n = len(G.A)
    weight, drive = (square_root(blocks([[p.Q, p.N], [p.N.T, p.R]])) for p in (problem, dual))
    B, C = np.hstack([drive[:n], G.B]), np.vstack([weight[:n].T, G.C])
    none = np.zeros((weight.shape[1], drive.shape[1]))
    return Lti(G.A, B, C, blocks([[none, weight[n:].T], [drive[n:], G.D]]), dt=G.dt)


def _between_all(plant: Lti, controls: Sequence[str], measured: Sequence[str]) -> Lti:
    """Return the generalized plant from the inputs that are not controls to all outputs; signals may be repeated."""
    entering = tuple(name for name in plant.input_labels if name not in controls) or tuple(controls)
    columns = [plant.input_labels.index(name) for name in (*entering, *controls)]
    return plant.between(columns, [plant.output_labels.index(name) for name in (*plant.output_labels, *measured)])


def observer(plant: Lti, F: Array, L: Array) -> Lti:
    """Return ``u = -F z`` with ``z' = A z + B u + L (y - C z - D u)``, from measurements to controls."""
    A, D = plant.A - plant.B @ F - L @ (plant.C - plant.D @ F), np.zeros((len(F), L.shape[1]))
    states = tuple(f"estimate.{name}" for name in plant.state_labels)
    return Lti(A, L, -F, D, plant.output_labels, plant.input_labels, states, plant.dt, plant.scales)


def least_cost(W: Array, R: Array, regulator: RiccatiSolution, estimator: RiccatiSolution) -> float:
    """Return the least cost, the sum of the costs of state feedback and of estimation.

    ``tr(X W) + tr(R F Y F^T)``; Kwakernaak & Sivan (1972), Theorem 5.4.  In discrete time ``R + B^T X B`` replaces ``R``.
    """
    F = regulator.gain
    return float(np.trace(regulator.X @ W) + np.trace(R @ F @ estimator.X @ F.T))


def certify(
    loop: Lti,
    K: Lti,
    least: float,
    regulator: RiccatiSolution,
    estimator: RiccatiSolution,
    *,
    plant: GeneralizedPlant,
    origin: ReducedPlant | None,
    by_states: bool = False,
) -> DesignCertificate:
    """Return a certificate of the H2 norm of a loop, and of the least one by the two Riccati equations.

    If ``origin`` is given, the loop with ``K`` is also evaluated on the full plant, without its norm if states of the
    reduced plant have weights or noise (``by_states``).

    Raises
    ------
    SynthesisError
        If the loop is not stable, or if its norm is not the least one.
    """
    poles = loop.poles
    slowest = float(rates_of(poles, loop.dt).real.max())
    if (sides(poles, loop.dt) >= 0).any():
        raise SynthesisError(f"The closed loop is not stable: a pole has the real part {slowest:.3g} rad/s.")
    norm, lower = matrices_h2_norm(loop), float(np.sqrt(max(least, 0.0)))
    if not abs(norm.value**2 - lower**2) <= MAX_COST_ERROR * max(norm.value, lower) ** 2:
        raise SynthesisError(
            f"The H2 norm of the closed loop is {norm.value:.8g} by {norm.method}, but {lower:.8g} by the Riccati equations."
            " The problem is too ill-conditioned; scale the signals."
        )
    return DesignCertificate(
        norm_bounds=norm,
        spectral_abscissa=slowest,
        fastest_pole=float(np.abs(K.poles).max(initial=0.0)),
        lower_bound=lower,
        lower_bound_source="both Riccati equations",
        stages=(*regulator.stages, *estimator.stages, norm.method),
        summary=f"H2 norm {norm.value:.6g}, {norm.status}; lower bound {lower:.6g} by the Riccati equations; "
        f"slowest pole {slowest:.4g} rad/s; Riccati residuals {regulator.residual:.1e} and {estimator.residual:.1e}",
        full_plant=evaluate_on_full_plant(origin, plant, K, None if by_states else norm),
        regulator_riccati=regulator,
        filter_riccati=estimator,
    )


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
        single = resonances[np.imag(resonances) >= 0.0]  # Computed conjugate zeros differ by rounding.
        errors.append(highest_peak(partial(error, K), resonance_grid(single, low, high))[0])
    zeros = transmission_zeros(inner)
    return RecoveryResult(intensities, np.array(errors), zeros[zeros.real > ALIKE * np.abs(zeros)], designs)
