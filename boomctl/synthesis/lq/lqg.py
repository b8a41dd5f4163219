"""Linear-quadratic-Gaussian controllers: a regulator fed by a Kalman filter."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from boomctl.arrays import Array
from boomctl.checks import nonnegative
from boomctl.lti.system import Lti
from boomctl.printing import system
from boomctl.synthesis.lq.kalman import solved_filter
from boomctl.synthesis.lq.lqr import regulator_problem, solved_regulator
from boomctl.synthesis.lq.noise import Noise, noise_of
from boomctl.synthesis.lq.output_feedback import FeedbackCertificate, certify, least_cost, observer
from boomctl.synthesis.lq.quadratic import Weight, square_root
from boomctl.synthesis.plants.closed_loop import closed
from boomctl.synthesis.plants.named import NamedMatrices, named_matrices, named_statespace
from boomctl.synthesis.plants.partition import Plant
from boomctl.synthesis.riccati import RiccatiProblem

if TYPE_CHECKING:
    import control

    from boomctl.structure.model import SecondOrderModel


@dataclass(frozen=True)
class LqgResult:
    """A linear-quadratic-Gaussian controller.

    Attributes
    ----------
    controller : control.StateSpace
        ``u = K y``, from the measurements to the controls, by their names.
    closed_loop : control.StateSpace
        From the inputs that are no controls (if there are none: from signals added to the controls, of their names)
        to the outputs of the system.
    regulator_gain, filter_gain : ndarray
        ``F`` of ``u = -F z`` and ``L`` of ``z' = A z + B u + L (y - C z - D u)``.
    poles : complex ndarray
        Of the closed loop [rad/s]: those of the regulator, then those of the filter.
    cost : float
        Expected value of ``x^T Q x + y^T W y + u^T R u`` at rest in the noise.
    certificate : FeedbackCertificate
    """

    controller: "control.StateSpace" = field(repr=False)
    closed_loop: "control.StateSpace" = field(repr=False)
    regulator_gain: Array = field(repr=False)
    filter_gain: Array = field(repr=False)
    poles: Array = field(repr=False)
    cost: float
    certificate: FeedbackCertificate

    def __repr__(self) -> str:
        norms = (
            f"cost {self.cost:.6g}, two Gramians and the Riccati equations agree to {self.certificate.disagreement:.0e}"
        )
        return f"LqgResult: controller of {system(self.controller)}\n  {norms}"


def lqg(
    system: "control.StateSpace | SecondOrderModel",
    Q: Weight | None,
    R: Weight,
    process_noise: Weight,
    measurement_noise: Weight,
    measurements: str | Sequence[str] | None = None,
    controls: str | Sequence[str] | None = None,
    *,
    disturbances: str | Sequence[str] | None = None,
    output_weight: Weight | None = None,
    ltr: float = 0.0,
) -> LqgResult:
    """Return the controller of least expected ``x^T Q x + y^T W y + u^T R u`` in white noise.

    Parameters
    ----------
    system : control.StateSpace or SecondOrderModel
        In continuous time.
    Q, R, output_weight
        Weights, as of :func:`lqr`.
    process_noise, measurement_noise, disturbances
        Intensities and the inputs they are of, as of :func:`kalman`.
    measurements, controls : sequence of str, optional
        Outputs the controller reads and inputs it drives; by default all.
    ltr : float
        Intensity of fictitious noise added to each control (Doyle & Stein 1979).  As it grows, the loop at the plant's
        input comes near that of the regulator where the plant has no zeros in the right half-plane; see
        :func:`loop_transfer_recovery`.  The cost counts this noise as well.

    Returns
    -------
    LqgResult

    Raises
    ------
    TypeError, ValueError
        As :func:`lqr` and :func:`kalman`.
    SynthesisError
        A mode in the way, named by frequency and damping; a closed loop that is not stable or whose cost differs
        between the two Gramians and the Riccati equations.

    Examples
    --------
    >>> import control
    >>> mass = control.ss([[0.0, 1.0], [0.0, 0.0]], [[0.0], [1.0]], [[1.0, 0.0]], 0.0, inputs="force", outputs="place")
    >>> design = lqg(mass, None, 1.0, {"force": 1.0}, 1.0, output_weight={"place": 1.0})
    >>> round(design.cost, 4)
    8.4853
    """
    plant = named_matrices(system)
    driven = plant.chosen_inputs("controls", controls)
    measured = plant.chosen_outputs("measurements", measurements)
    problem = regulator_problem(plant, driven, Q, R, output_weight)
    noise = noise_of(plant, process_noise, measurement_noise, measured, disturbances)
    noise = _with_recovery(noise, plant, driven, measured, nonnegative("ltr", ltr))
    regulator = solved_regulator(problem, driven, plant.states)
    estimator = solved_filter(plant, noise, measured)
    K = observer(plant.block(measured, driven), regulator.gain, estimator.gain.T)
    loop = closed(_weighted(plant, problem, noise, driven, measured), K)
    certificate = certify(loop, least_cost(noise.W, problem.R, regulator, estimator), regulator, estimator)
    return LqgResult(
        controller=named_statespace(
            (K.A, K.B, K.C, K.D), measured, driven, "lqg", [f"estimate.{s}" for s in plant.states]
        ),
        closed_loop=_closed_loop(plant, K, driven, measured),
        regulator_gain=regulator.gain,
        filter_gain=estimator.gain.T,
        poles=np.concatenate([regulator.poles, estimator.poles]),
        cost=certificate.norm.value**2,
        certificate=certificate,
    )


def _with_recovery(
    noise: Noise, plant: NamedMatrices, controls: Sequence[str], measured: Sequence[str], q: float
) -> Noise:
    if q == 0.0:
        return noise
    way = plant.block(measured, controls)
    B, D = way.B, way.D
    return Noise(noise.W + q * B @ B.T, noise.V + q * D @ D.T, noise.S + q * B @ D.T, noise.inputs)


def _weighted(
    plant: NamedMatrices, problem: RiccatiProblem, noise: Noise, controls: Sequence[str], measured: Sequence[str]
) -> Plant:
    """Return the generalised plant whose H2 norm squared is the cost: unit noise in, weighted states and controls out."""
    way, n = plant.block(measured, controls), len(plant.A)
    weight = square_root(np.block([[problem.Q, problem.N], [problem.N.T, problem.R]])).T
    drive = square_root(np.block([[noise.W, noise.S], [noise.S.T, noise.V]]))
    return Plant(
        A=plant.A,
        B1=drive[:n],
        B2=way.B,
        C1=weight[:, :n],
        C2=way.C,
        D11=np.zeros((len(weight), drive.shape[1])),
        D12=weight[:, n:],
        D21=drive[n:],
        D22=way.D,
        disturbances=tuple(f"noise{i}" for i in range(drive.shape[1])),
        controls=tuple(controls),
        performance=tuple(f"weighted{i}" for i in range(len(weight))),
        measurements=tuple(measured),
        states=plant.states,
    )


def _closed_loop(
    plant: NamedMatrices, K: Lti, controls: Sequence[str], measured: Sequence[str]
) -> "control.StateSpace":
    entering = plant.other_inputs(controls) or tuple(controls)
    loop = closed(plant.partitioned(entering, controls, plant.outputs, measured), K)
    states = (*plant.states, *(f"estimate.{s}" for s in plant.states))
    return named_statespace((loop.A, loop.B, loop.C, loop.D), entering, plant.outputs, "closed_loop", states)
