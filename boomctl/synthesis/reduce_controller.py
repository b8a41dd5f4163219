"""Reduction of controllers, with verification of the closed loop."""

from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from scipy import linalg

from boomctl.analysis.norm import NormBounds
from boomctl.arrays import Array
from boomctl.checks import nonnegative, positive, whole
from boomctl.exceptions import SynthesisError
from boomctl.lti.gramians import gramian, square_root
from boomctl.lti.modal import residualised, split
from boomctl.lti.rounding import SUMMED
from boomctl.lti.system import Lti, lower_lft
from boomctl.printing import system
from boomctl.synthesis.certificate import LoopDesign, largest_pole, verified_candidate
from boomctl.synthesis.plants.partition import GeneralizedPlant, matched
from boomctl.threads import one_blas_thread

if TYPE_CHECKING:
    import control

    from boomctl.lti.system import Controller


@dataclass(frozen=True)
class ReducedController(LoopDesign):
    """Result of a controller reduction.

    Attributes
    ----------
    controller, closed_loop : control.StateSpace
        Labeled as in the generalized plant; the controller is in the units of the machine.
    scaled_controller : control.StateSpace
        The same in the scaled signals of the plant; equal to `controller` if the plant has no scales.
    order : int
        Number of states of the controller.
    gamma, gamma_full : float
        The closed loop's H-infinity norm, verified, with this controller and with the one it was made from.
    norm_bounds : NormBounds
        The closed loop's norm with this controller, between two bounds.
    fastest_pole : float
        Largest magnitude of the controller's poles [rad/s]; in discrete time without a unit.
    method : str
        Treatment of the truncated states.
    singular_values : ndarray
        Hankel-like singular values of the controller's states within the closed loop, descending.
    """

    order: int
    gamma: float
    gamma_full: float
    norm_bounds: NormBounds
    fastest_pole: float
    method: str
    singular_values: Array

    def __repr__(self) -> str:
        norms = f"norm of the closed loop {self.gamma:.6g}, verified; {self.gamma_full:.6g} with the full controller"
        return f"ReducedController: controller of {system(self._controller)}, {self.method}\n  {norms}"


@one_blas_thread
def reduce_controller(
    P: "control.StateSpace",
    controller: "Controller",
    *,
    order: int | None = None,
    max_degradation: float = 0.05,
    fastest_pole: float | None = None,
) -> ReducedController:
    """Reduce the order of a controller, within a limit on the norm of its closed loop.

    The controller's states are balanced within the closed loop, by the controller's blocks of its Gramians, so that the
    controller may be unstable.

    Parameters
    ----------
    P : control.StateSpace
        Generalized plant, in continuous or discrete time, of the controller's signals as last outputs and inputs.
    controller : control.StateSpace, or a design, which holds one
        ``u = K y``, of the sampling time of ``P`` if it has one; it stabilizes ``P``. For a scaled ``P`` in its scaled
        signals.
    order : int, optional
        Number of states; fewer if the controller has states that are not minimal within the loop. If None, the lowest
        number whose loop stays within ``max_degradation``, at most that of the controller.
    max_degradation : float
        Allowed relative increase of the norm of the closed loop.
    fastest_pole : float, optional
        Largest magnitude of the controller's poles [rad/s]; faster ones are replaced by their static gain. Not for a
        discrete controller.

    Returns
    -------
    ReducedController
        The reduced controller, its verified closed loop, and the norms with it and with the full controller.

    Raises
    ------
    TypeError, ValueError
        If `P` or `controller` is not a system, if sampling times or scales do not match, or if a number is out of range.
    SynthesisError
        If the controller does not stabilize ``P``, or if no controller of the order, or without faster poles, stays within
        the limit.

    Examples
    --------
    >>> import boomctl as bc
    >>> import control
    >>> lag = control.ss([[-1.0]], [[1.0]], [[1.0]], 0.0, inputs="u", outputs="y")
    >>> P = bc.mixed_sensitivity(lag, W1=bc.shelf(100.0, 0.5, corner=1.0), W2=0.1)
    >>> design = bc.h_infinity(P, nmeas=1, ncon=1)
    >>> smaller = bc.reduce_controller(P, design.controller, max_degradation=0.05)
    >>> smaller.order <= design.controller.nstates, bool(smaller.gamma <= 1.05 * smaller.gamma_full)
    (True, True)
    """
    plant, K = matched(P, controller, sampled=True)
    if K.dt != 0.0 and fastest_pole is not None:
        raise ValueError("`fastest_pole` must be None for a discrete controller, which runs once a sample.")
    degradation = nonnegative("max_degradation", max_degradation)
    limit = np.inf if fastest_pole is None else positive("fastest_pole", fastest_pole)
    if order is not None and whole("order", order, 0) > len(K.A):
        raise ValueError(f"`order` must be at most {len(K.A)}, that of the controller, got {order}.")
    what = "The controller"
    try:
        full = verified_candidate(plant, K, np.inf)
        if largest_pole(K) > limit:  # The controller must stabilize: nothing can be balanced otherwise.
            what = f"The controller without its poles above {limit:.3g} rad/s"
            K = verified_candidate(plant, without_fast_poles(K, limit), np.inf).K
    except ValueError as error:
        raise SynthesisError(f"{what} cannot be reduced: {error}.") from None
    balanced, values = _balanced_in_loop(plant, K)
    most = len(balanced.A)
    orders = range(most + 1) if order is None else [min(order, most)]
    runs = [(method, partial(reduced, balanced, count)) for count in orders for method, reduced in _METHODS.items()]
    if order is None or order >= len(K.A):
        runs.append(("not reduced", partial(replace, K)))  # Balancing may cause the allowed degradation.
    allowed, rejected = full.norm.upper_bound * (1.0 + degradation), ""
    for method, reduced in runs:
        try:
            result = verified_candidate(plant, reduced(), allowed, limit)
        except ValueError as error:  # Also `numpy.linalg.LinAlgError`.
            rejected = str(error)
            continue
        return ReducedController(
            _controller=replace(result.K, scales=plant.system.scales),
            _closed_loop=result.loop,
            _plant=plant.system,
            order=len(result.K.A),
            gamma=result.norm.lower_bound,
            gamma_full=full.norm.lower_bound,
            norm_bounds=result.norm,
            fastest_pole=largest_pole(result.K),
            method=method,
            singular_values=values,
        )
    which = "any order" if order is None else f"order {order}"
    raise SynthesisError(f"No controller of {which} has a closed loop with a norm below {allowed:.6g}: {rejected}.")


def without_fast_poles(K: Lti, fastest: float) -> Lti:
    """Return a controller with the poles above a magnitude [rad/s] replaced by their static gain.

    Raises
    ------
    ValueError
        If these poles cannot be separated.
    """
    parts = split(K, np.abs(K.poles) > fastest)
    fast, slow = parts.retained, parts.rest
    D = slow.D - fast.C @ np.linalg.solve(fast.A, fast.B)
    if not all(np.isfinite(part).all() for part in (slow.B, slow.C, D)):
        raise ValueError("fast poles cannot be separated")
    return replace(K, A=slow.A, B=slow.B, C=slow.C, D=D, state_labels=())


def _balanced_in_loop(plant: GeneralizedPlant, K: Lti) -> tuple[Lti, Array]:
    """Return a controller with states balanced within the closed loop, and their singular values, descending."""
    if not len(K.A):
        return K, np.zeros(0)
    K, n = K.balanced(), len(plant.A)
    loop = lower_lft(plant.system.balanced(), K)
    P, Q = gramian(loop.A, loop.B, K.dt != 0.0), gramian(loop.A.T, loop.C.T, K.dt != 0.0)
    driven, observed = square_root(P[n:, n:]), square_root(Q[n:, n:])
    left, values, right = linalg.svd(observed.T @ driven, full_matrices=False)
    # States below this fraction of the largest singular value are rounding error.
    retained = values > SUMMED * values[0]
    into = (left[:, retained] / np.sqrt(values[retained])).T @ observed.T
    out = driven @ (right[retained].T / np.sqrt(values[retained]))
    return replace(K, A=into @ K.A @ out, B=into @ K.B, C=K.C @ out, state_labels=()), values


def _truncated(K: Lti, order: int) -> Lti:
    """Return the first states of a controller, without the others."""
    return replace(K, A=K.A[:order, :order], B=K.B[:order], C=K.C[:, :order])


_METHODS = {"truncated": _truncated, "residualized": residualised}
