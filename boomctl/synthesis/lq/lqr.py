"""Linear-quadratic regulators with integral action and output weights."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from math import inf
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike
from scipy import linalg

from boomctl.analysis.norm import NormBounds
from boomctl.arrays import Array, blocks
from boomctl.checks import finite_array, names, some_names
from boomctl.exceptions import SynthesisError
from boomctl.lti.bilinear import continuous_image, omega_of_image
from boomctl.lti.frequency import largest_gain
from boomctl.lti.hidden_modes import HiddenMode, unmoved
from boomctl.lti.modal import partial_fractions
from boomctl.lti.system import Lti, series
from boomctl.printing import between, count
from boomctl.synthesis.certificate import DesignCertificate, LoopDesign
from boomctl.synthesis.lq.problem import Weight, definite, plant_of, semidefinite, solved
from boomctl.synthesis.lq.riccati import RiccatiProblem, RiccatiSolution, even
from boomctl.threads import one_blas_thread

if TYPE_CHECKING:
    import control

    from boomctl.structure.model import SecondOrderModel

_RETURN_DIFFERENCE_ATOL = 1e-2  # Of the bound 1 of the return difference, by rounding on fine meshes.


@dataclass(frozen=True)
class LqrResult(LoopDesign):
    """Result of a linear-quadratic regulator design.

    Attributes
    ----------
    gain : (m, n) ndarray
        ``F`` of ``u = -F x``, the sign of ``control.lqr``; with integral action the integrals are the last states.
    riccati_solution : (n, n) ndarray
        ``X``: from the state ``x`` the cost is ``x^T X x``.
    controller : control.StateSpace
        ``u = K x`` with ``K = -F``: inputs labeled as the states, with dots replaced by ``_``, followed by the integrated
        outputs; outputs labeled as the controls. Static unless it integrates. In the units of the machine.
    scaled_controller : control.StateSpace
        The same in the scaled signals of the plant; equal to `controller` if the plant has no scales.
    closed_loop : control.StateSpace
        Closed loop from the inputs that are not controls (if there are none: from signals added to the controls, with
        their labels) to the outputs of the system.
    control_loop : control.StateSpace
        Closed loop from the same inputs to the controls.
    poles : (n,) complex ndarray
        Poles of the closed loop [rad/s].
    uncontrollable_modes : tuple of HiddenMode
        Stable modes that are uncontrollable.
    certificate : DesignCertificate
        Errors of the Riccati solution, and the return difference of the loop.
    """

    _called = "regulator"

    gain: Array
    riccati_solution: Array = field(repr=False)
    poles: Array = field(repr=False)
    uncontrollable_modes: tuple[HiddenMode, ...]
    certificate: DesignCertificate

    def __iter__(self) -> Iterator[Array]:
        """Yield gain, cost and poles: ``K, S, E = lqr(...)``, as python-control's ``lqr`` returns them."""
        return iter((self.gain, self.riccati_solution, self.poles))

    @cached_property
    def control_loop(self) -> control.StateSpace:
        """Closed loop to the controls, converted on first access."""
        loop, driven = self._closed_loop, self._controller.output_labels
        effort = replace(loop, C=-self.gain, D=np.zeros((len(driven), loop.D.shape[1])), output_labels=driven)
        return effort.statespace("effort")

    def __repr__(self) -> str:
        left = f", {count(len(self.uncontrollable_modes), 'mode')} uncontrollable" if self.uncontrollable_modes else ""
        labels = between(self._controller.input_labels, self._controller.output_labels)
        return f"LqrResult: state feedback, {labels}{left}\n  {self.certificate.summary}"


@one_blas_thread
def lqr(
    system: control.StateSpace | SecondOrderModel,
    Q: Weight | None,
    R: Weight,
    *,
    output_weight: Weight | None = None,
    controls: str | Sequence[str] | None = None,
    integral_action: Sequence[str] | Mapping[str, float] = (),
    N: ArrayLike | None = None,
) -> LqrResult:
    """Return the state feedback ``u = -F x`` that minimizes the integral of ``x^T Q x + y^T W y + u^T R u + 2 x^T N u``.

    Parameters
    ----------
    system : control.StateSpace or SecondOrderModel
        The system ``x' = A x + B u``, with named signals.  For a discrete-time system, ``x+ = A x + B u``, the sum over the
        samples is minimized.
    Q : number, vector, matrix, mapping from state name to number, or None
        Weight of the states, positive semidefinite; None is zero.
    R : number, vector, matrix or mapping from control name to number
        Weight of the controls, positive definite.
    output_weight : number, vector, matrix or mapping from output name to number, optional
        ``W``, positive semidefinite; outputs include the feedthrough of the controls.
    controls : sequence of str, optional
        Inputs used by the regulator; by default all.
    integral_action : sequence of str, or mapping from output name to number, optional
        Outputs whose integrals are appended as states ``integral.NAME``, so that a constant disturbance leaves
        no error in them, and the weights of these integrals (1 if only names are given).  In discrete time, sums of
        the outputs times the sampling time.
    N : (n, m) array_like, optional
        Cross weight of the states (the integrals not included) and the controls.

    Returns
    -------
    LqrResult
        The gain ``F``, the controller ``u = -F x``, the closed loop and its poles, and a certificate.

    Raises
    ------
    TypeError, ValueError
        If `system` is not a system, if a label is unknown, if a shape is wrong, or if a weight is indefinite.
    SynthesisError
        If an unstable or undamped mode is uncontrollable, if an undamped one has no weight (with its frequency and
        damping), or if the solution is not accurate enough.

    Examples
    --------
    >>> import boomctl as bc
    >>> import control
    >>> mass = control.ss([[0.0, 1.0], [0.0, 0.0]], [[0.0], [1.0]], [[1.0, 0.0]], 0.0, inputs="force", outputs="place")
    >>> bc.lqr(mass, None, 1.0, output_weight={"place": 1.0}).gain.round(4)
    array([[1.    , 1.4142]])
    """
    plant = plant_of(system, sampled=True)
    driven = some_names("control", controls, plant.input_labels)
    listed = tuple(integral_action) if isinstance(integral_action, Mapping) else integral_action
    integrated = names("integral_action", listed, plant.output_labels)
    integrals = integral_action if isinstance(integral_action, Mapping) else dict.fromkeys(integrated, 1.0)
    problem = regulator_problem(plant, driven, Q, R, output_weight, N=N)
    G, n, k, m = plant.select(driven, integrated), len(plant.A), len(integrated), len(driven)
    pole, gain = (1.0, plant.dt) if plant.dt else (0.0, 1.0)  # in discrete time sums of the outputs times ``dt``
    one, sums = np.eye(k), tuple(f"integral.{name}" for name in integrated)
    bank = Lti(pole * one, gain * one, one, 0.0 * one, integrated, (), sums, plant.dt)
    chain, C = series(plant.select(outputs=integrated), bank), np.hstack([plant.C, np.zeros((len(plant.C), k))])
    whole = replace(plant, A=chain.A, B=chain.B, C=C, state_labels=plant.state_labels + bank.state_labels)
    acting = whole.select(driven)
    weights = linalg.block_diag(problem.Q, semidefinite("integral_action", integrals, integrated))
    problem = replace(problem, A=whole.A, B=acting.B, Q=weights, N=np.vstack([problem.N, np.zeros((k, m))]))
    solution = solved(problem, "regulator", driven, whole.state_labels)
    F = solution.gain
    B, D = np.hstack([np.zeros((k, n)), bank.B]), np.hstack([-F[:, :n], np.zeros((m, k))])
    inputs, states = plant.state_labels + integrated, bank.state_labels
    others = tuple(name for name in plant.input_labels if name not in driven) or driven
    return LqrResult(
        _controller=Lti(bank.A, B, -F[:, n:], D, inputs, driven, states, plant.dt, plant.scales).without_dots(),
        _closed_loop=replace(whole.select(others), A=whole.A - acting.B @ F, C=C - acting.D @ F),
        _plant=Lti(plant.A, G.B, np.vstack([np.eye(n), G.C]), np.vstack([np.zeros((n, m)), G.D]), dt=plant.dt),
        gain=F,
        riccati_solution=solution.X,
        poles=solution.poles,
        uncontrollable_modes=unmoved(whole.A, acting.B, whole.state_labels, stable=True, dt=plant.dt),
        certificate=_certify(problem, solution),
    )


def regulator_problem(
    plant: Lti,
    controls: Sequence[str],
    Q: Weight | None,
    R: Weight,
    output_weight: Weight | None,
    *,
    N: ArrayLike | None = None,
) -> RiccatiProblem:
    """Return the Riccati problem of a regulator with checked weights."""
    driven = plant.select(controls)
    B, C, D = driven.B, driven.C, driven.D
    n, m = B.shape
    if Q is None and output_weight is None:
        raise ValueError("`Q` or `output_weight` must be given, got None for both.")
    states = np.zeros((n, n)) if Q is None else semidefinite("Q", Q, plant.state_labels)
    efforts = definite("R", R, controls)
    cross = np.zeros((n, m)) if N is None else finite_array("N", N)
    if cross.shape != (n, m):
        raise ValueError(f"`N` must have the shape {(n, m)}, states by controls, got {cross.shape}.")
    if cross.any():
        semidefinite("[Q, N; N^T, R]", blocks([[states, cross], [cross.T, efforts]]), (*plant.state_labels, *controls))
    if output_weight is not None:
        W = semidefinite("output_weight", output_weight, plant.output_labels)
        states, efforts, cross = states + C.T @ W @ C, efforts + D.T @ W @ D, cross + C.T @ W @ D
    return RiccatiProblem(plant.A, B, even(states), even(efforts), cross, plant.dt)


def _certify(problem: RiccatiProblem, solution: RiccatiSolution) -> DesignCertificate:
    """Return a certificate of the smallest singular value of the return difference, the inverse of its inverse's peak.

    The inverse ``I - F (s I - A + B F)^-1 B`` is stable, even if the loop itself has integrators. Its weight is one on both
    sides; in discrete time ``R + B' X B`` on the left.

    Raises
    ------
    SynthesisError
        If it is below one, which it cannot be for an optimal regulator.
    """
    B, L = problem.B, linalg.cholesky(problem.R, lower=True)
    wide = L if problem.dt == 0.0 else linalg.cholesky(problem.R + B.T @ solution.X @ B, lower=True)
    acting, direct = (linalg.solve_triangular(wide, item, lower=True).T for item in (B.T, L))
    inverse = Lti(problem.A - B @ solution.gain, acting, -L.T @ solution.gain, direct, dt=problem.dt).balanced()
    image = continuous_image(inverse)
    peak, omega = largest_gain(partial_fractions(image), partial(image.response, quiet=True))
    peak, omega = (peak, float(omega_of_image(omega, problem.dt))) if peak > 1.0 else (1.0, inf)
    least = 1.0 / peak
    if not problem.N.any() and least < 1.0 - _RETURN_DIFFERENCE_ATOL:
        raise SynthesisError(
            f"LQR verification failed: the return difference is {least:.6g}, but at least 1 for an optimal regulator."
            " The Riccati equation is too ill-conditioned; scale the signals."
        )
    return DesignCertificate(
        norm_bounds=NormBounds(peak, inf, omega, "largest value found of the inverse return difference"),
        spectral_abscissa=solution.abscissa,
        fastest_pole=0.0,
        lower_bound=0.0,
        lower_bound_source="none: the cost is minimal",
        stages=solution.stages,
        summary=f"slowest pole {solution.abscissa:.4g} rad/s; Riccati residual {solution.residual:.1e}; "
        f"return difference at least {least:.6g}",
        regulator_riccati=solution,
        min_return_difference=least,
    )
