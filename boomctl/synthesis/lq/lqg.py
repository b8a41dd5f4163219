"""Linear-quadratic-Gaussian controllers: a regulator fed by a Kalman filter."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from boomctl.analysis.prove import Claim
from boomctl.arrays import Array, blocks
from boomctl.checks import exactly, nonnegative, warn_user
from boomctl.lti.gramians import square_root
from boomctl.lti.system import Lti, lower_lft
from boomctl.printing import system
from boomctl.reduction.result import ReductionResult
from boomctl.synthesis.certificate import Design, DesignCertificate
from boomctl.synthesis.lq.kalman import solved_filter
from boomctl.synthesis.lq.lqr import regulator_problem, solved_regulator
from boomctl.synthesis.lq.output_feedback import certify, least_cost, observer
from boomctl.synthesis.lq.problem import Noise, Weight, chosen, noise_of, plant_of, semidefinite
from boomctl.synthesis.lq.riccati import RiccatiProblem
from boomctl.synthesis.plants.full_plant import ReducedPlant, origin_of
from boomctl.synthesis.plants.partition import GeneralizedPlant
from boomctl.threads import one_blas_thread

if TYPE_CHECKING:
    import control

    from boomctl.structure.model import SecondOrderModel


@dataclass(frozen=True)
class LqgResult(Design):
    """A linear-quadratic-Gaussian controller.

    Attributes
    ----------
    controller : control.StateSpace
        ``u = K y``, from the measurements to the controls, by their labels, in the units of the machine.
    scaled_controller : control.StateSpace
        The same in the scaled signals of the plant; equal to `controller` if the plant has no scales.
    closed_loop : control.StateSpace
        The loop, from the inputs that are no controls (if there are none: from signals added to the controls, of their
        names) to the outputs of the system.
    regulator_gain, filter_gain : ndarray
        ``F`` of ``u = -F z`` and ``L`` of ``z' = A z + B u + L (y - C z - D u)``; in discrete time ``z+`` for ``z'``.
    poles : complex ndarray
        Poles of the closed loop [rad/s]: those of the regulator, then those of the filter.
    cost : float
        Expected value of ``x^T Q x + y^T W y + u^T R u`` at rest in the noise.
    certificate : DesignCertificate
        The H2 norm of the loop, the least one by the Riccati equations, and how well these are solved.
    """

    _called = "lqg"

    _controller: Lti = field(repr=False)
    _closed_loop: Lti = field(repr=False)
    regulator_gain: Array = field(repr=False)
    filter_gain: Array = field(repr=False)
    poles: Array = field(repr=False)
    cost: float
    certificate: DesignCertificate
    _plant: Lti | None = field(default=None, repr=False, compare=False)

    def __claims__(self) -> Iterator[Claim]:
        """Yield what can be proved: of the loop of the plant that was handed in."""
        if self._plant is not None:
            yield Claim("the closed loop", self._plant, self._controller, stable=True)

    @property
    def h2_norm(self) -> float:
        """The H2 norm of the loop, the root of ``cost``: every result that has a norm has it under this name."""
        return self.certificate.norm_bounds.value

    def __repr__(self) -> str:
        least = f"least possible {self.certificate.lower_bound**2:.6g}"
        verified = "verified" if self.certificate.norm_bounds.certified else "not certified"
        told = f"cost {self.cost:.6g}, {verified}; {least}{self.certificate._on_full_plant}"
        return f"LqgResult: controller of {system(self._controller)}\n  {told}"


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
    """Return the controller of least expected ``x^T Q x + y^T W y + u^T R u`` in white noise.

    Parameters
    ----------
    system : control.StateSpace, SecondOrderModel or ReductionResult
        The system, signals named.  Of what `reduce` returned, and of a generalized plant around one, the loop is judged
        on the full plant too: ``certificate.full_plant``, whose norm is the root of the cost there.  The full plant has no
        such cost where ``Q`` or ``process_noise`` is over states of the reduced one.  Of a discrete one the controller is the
        best of all whose control at a sample rests on the measurements before it.
    Q, R, output_weight
        Weights of states, controls and outputs, as for :func:`lqr`.
    process_noise, measurement_noise, disturbances
        Intensities of the noises, and the inputs that are noise, as for :func:`kalman`.
    measurements, controls : sequence of str, optional
        Outputs the controller reads and inputs it drives; by default all.
    ltr_intensity : float
        Intensity of fictitious noise added to each control (Doyle & Stein 1979).  As it grows, the loop at the plant's
        input comes near that of the regulator where the plant has no zeros in the right half-plane; see
        :func:`loop_transfer_recovery`.  The cost counts this noise as well.  Only in continuous time.

    Returns
    -------
    LqgResult
        The controller ``u = K y``, the closed loop, its poles and expected cost, and a certificate.

    Raises
    ------
    TypeError, ValueError
        As :func:`lqr` and :func:`kalman`.
    SynthesisError
        A mode in the way, named by frequency and damping; a closed loop that is not stable or whose cost is not what
        the Riccati equations say.

    Warns
    -----
    BoomctlWarning
        No controls are named, and only some of the inputs are noise.
    ReductionWarning
        On the full plant the loop is not stable, or not proved to be, or the root of its cost is more than a tenth larger.

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
    driven = chosen("controls", controls, plant.input_labels)
    noisy = [name for name in plant.input_labels if isinstance(process_noise, Mapping) and name in process_noise]
    if controls is None and noisy and len(noisy) < len(plant.input_labels):
        warn_user(
            f"controls: none named, so that the controller drives all inputs, {', '.join(noisy)} among them, which"
            " process_noise calls noise; name the inputs it drives"
        )
    measured = chosen("measurements", measurements, plant.output_labels)
    problem = regulator_problem(plant, driven, Q, R, output_weight)
    noise = noise_of(plant, process_noise, measurement_noise, measurements=measured, disturbances=disturbances)
    way = plant.select(driven, measured)
    if nonnegative("ltr_intensity", ltr_intensity) and plant.dt:
        raise ValueError(
            f"ltr_intensity = {exactly(ltr_intensity)}: expected 0 for a discrete system, whose loop it does not recover"
        )
    noise = _with_recovery(noise, way, ltr_intensity)
    regulator = solved_regulator(problem, driven, plant.state_labels)
    estimator = solved_filter(plant, noise, measured)
    K = observer(way, regulator.gain, estimator.gain.T)
    P = GeneralizedPlant(_weighted(way, problem, noise), len(measured), len(driven))
    loop = lower_lft(P.system, K)
    effort = problem.R if plant.dt == 0.0 else problem.R + problem.B.T @ regulator.X @ problem.B
    least = least_cost(noise.W, effort, regulator, estimator)
    origin = origin_of(system)
    by_states = not noise.inputs or (Q is not None and bool(semidefinite("Q", Q, plant.state_labels).any()))
    if origin is not None:
        around = origin.around

        def with_cost(full: Lti) -> Lti:
            given = around(full).select(plant.input_labels, plant.output_labels)
            if by_states:
                return _between_all(given, driven, measured)
            task = regulator_problem(given, driven, 0.0, R, output_weight)
            noise = noise_of(given, process_noise, measurement_noise, measurements=measured, disturbances=disturbances)
            way = given.select(driven, measured)
            return _weighted(way, task, _with_recovery(noise, way, ltr_intensity))

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
        _plant=way,
    )


def _with_recovery(noise: Noise, way: Lti, q: float) -> Noise:
    """Return the noise with fictitious noise of intensity ``q`` at each control."""
    if q == 0.0:
        return noise
    B, D = way.B, way.D
    return Noise(noise.W + q * B @ B.T, noise.V + q * D @ D.T, noise.S + q * B @ D.T, noise.inputs)


def _weighted(way: Lti, problem: RiccatiProblem, noise: Noise) -> Lti:
    """Return the generalized plant whose H2 norm squared is the cost: unit noise in, weighted states and controls out."""
    n = len(way.A)
    weight = square_root(blocks([[problem.Q, problem.N], [problem.N.T, problem.R]])).T
    drive = square_root(blocks([[noise.W, noise.S], [noise.S.T, noise.V]]))
    B, C = np.hstack([drive[:n], way.B]), np.vstack([weight[:, :n], way.C])
    return Lti(
        way.A, B, C, blocks([[np.zeros((len(weight), drive.shape[1])), weight[:, n:]], [drive[n:], way.D]]), dt=way.dt
    )


def _between_all(plant: Lti, controls: Sequence[str], measured: Sequence[str]) -> Lti:
    """Return the generalized plant from the inputs that are no controls to all outputs; a signal may stand on both sides."""
    entering = tuple(name for name in plant.input_labels if name not in controls) or tuple(controls)
    columns = [plant.input_labels.index(name) for name in (*entering, *controls)]
    return plant.between(columns, [plant.output_labels.index(name) for name in (*plant.output_labels, *measured)])
