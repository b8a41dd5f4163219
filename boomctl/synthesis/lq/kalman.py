"""Stationary Kalman filters, the duals of regulators."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from boomctl.arrays import Array
from boomctl.checks import finite_array, some_names
from boomctl.lti.system import Lti
from boomctl.printing import system
from boomctl.synthesis.lq.problem import Weight, definite, plant_of, semidefinite, solved
from boomctl.synthesis.lq.riccati import RiccatiProblem, RiccatiSolution, even
from boomctl.threads import one_blas_thread

if TYPE_CHECKING:
    import control

    from boomctl.structure.model import SecondOrderModel


@dataclass(frozen=True)
class KalmanResult:
    """A stationary Kalman filter, ``z' = A z + B u + L (y - C z - D u)``; in discrete time a predictor, ``z+`` for ``z'``.

    Attributes
    ----------
    gain : (n, p) ndarray
        Gain ``L`` of the filter.
    covariance : (n, n) ndarray
        Covariance of the estimation error.
    estimator : control.StateSpace
        From the measurements and the known inputs to the estimated states, labeled like these, with dots replaced by ``_``.
    poles : (n,) complex ndarray
        Poles of the estimator [rad/s].
    certificate : RiccatiSolution
        Errors of the Riccati solution.
    """

    gain: Array
    covariance: Array = field(repr=False)
    _estimator: Lti = field(repr=False)
    poles: Array = field(repr=False)
    certificate: RiccatiSolution

    @cached_property
    def estimator(self) -> control.StateSpace:
        """The filter as a system, converted on first access."""
        return self._estimator.statespace("estimator")

    def __repr__(self) -> str:
        rate = self.certificate.abscissa if self._estimator.dt else self.poles.real.max(initial=-np.inf)
        errors = f"slowest pole of the estimator {rate:.4g} rad/s; Riccati residual {self.certificate.residual:.1e}"
        return f"KalmanResult: estimator of {system(self._estimator)}\n  {errors}"


@one_blas_thread
def kalman(
    system: control.StateSpace | SecondOrderModel,
    process_noise: Weight,
    measurement_noise: Weight,
    *,
    measurements: str | Sequence[str] | None = None,
    disturbances: str | Sequence[str] | None = None,
) -> KalmanResult:
    """Design the stationary Kalman filter of a system driven by white noise.

    Parameters
    ----------
    system : control.StateSpace or SecondOrderModel
        System with named signals.  In discrete time the estimate at a sample uses the measurements before it, and the
        noise is white at the samples.
    process_noise : number, vector, matrix or mapping from input name to number
        Intensity of the noise, in discrete time its variance, positive semidefinite: over the inputs named in
        ``disturbances``; without these, a mapping is over the inputs it names, a number, vector or matrix over the
        states (noise on ``x'``).  Feedthrough from a disturbance to a measurement adds measurement noise that is
        correlated with the process noise; both are included.
    measurement_noise : number, vector, matrix or mapping from output name to number
        Intensity of the noise on the measurements, positive definite.
    measurements : sequence of str, optional
        Measured outputs; by default all.
    disturbances : sequence of str, optional
        Inputs that are white noise; the others are known to the estimator.

    Returns
    -------
    KalmanResult
        The gain ``L``, the estimator as a system, the covariance of the error of its estimate, and a certificate.

    Raises
    ------
    TypeError, ValueError
        If `system` is not a system, if a label is unknown, if a shape is wrong, or if an intensity is indefinite.
    SynthesisError
        If an unstable or undamped mode is unobservable, if an undamped one is not excited by noise (with its frequency and
        damping), or if the solution is not accurate enough.

    Examples
    --------
    >>> import boomctl as bc
    >>> import control
    >>> mass = control.ss([[0.0, 1.0], [0.0, 0.0]], [[0.0], [1.0]], [[1.0, 0.0]], 0.0, inputs="force", outputs="place")
    >>> bc.kalman(mass, {"force": 4.0}, 1.0).gain.round(4).T
    array([[2., 2.]])
    """
    plant = plant_of(system, sampled=True)
    measured = some_names("measurement", measurements, plant.output_labels)
    problem, noisy = filter_problem(plant, process_noise, measurement_noise, measured, disturbances)
    solution = solved(problem, "filter", measured, plant.state_labels)
    L, n, states = solution.gain.T, len(plant.A), plant.state_labels
    known = tuple(name for name in plant.input_labels if name not in noisy)
    G = plant.select(known, measured)
    B = np.hstack([L, G.B - L @ G.D])
    A, C, D, inputs = plant.A - L @ G.C, np.eye(n), np.zeros(B.shape), (*measured, *known)
    estimator = Lti(A, B, C, D, inputs, states, states, plant.dt, plant.scales)
    return KalmanResult(
        gain=L,
        covariance=solution.X,
        _estimator=estimator.without_dots(),
        poles=solution.poles,
        certificate=solution,
    )


def filter_problem(
    plant: Lti,
    process_noise: Weight,
    measurement_noise: Weight,
    measurements: Sequence[str],
    disturbances: str | Sequence[str] | None,
) -> tuple[RiccatiProblem, tuple[str, ...]]:
    """Return the Riccati problem of a filter with checked noise, and the inputs by which this enters.

    Its weights are the intensities of the noise on ``x'`` and on the measurements, and their cross intensity.
    ``process_noise`` is over the inputs named in ``disturbances``; without these, a mapping is over the inputs that
    it names, and a number, vector or matrix over the states.
    """
    if isinstance(process_noise, Mapping) and disturbances is None:
        disturbances = tuple(process_noise)
    V = definite("measurement_noise", measurement_noise, measurements)
    if disturbances is None:
        array = finite_array("process_noise", process_noise)  # type: ignore[arg-type]
        W, entering = semidefinite("process_noise", array, plant.state_labels), ()
        C, S = plant.select(outputs=measurements).C, np.zeros((len(W), len(V)))
    else:
        entering = some_names("disturbance", disturbances, plant.input_labels)
        intensity, G = semidefinite("process_noise", process_noise, entering), plant.select(entering, measurements)
        C, D, S = G.C, G.D, G.B @ intensity @ G.D.T
        W, V = even(G.B @ intensity @ G.B.T), even(V + D @ intensity @ D.T)
    return RiccatiProblem(plant.A.T, C.T, W, V, S, plant.dt), entering
