"""Controllers of lower order and without fast poles, accepted only after their loop was verified."""

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from itertools import chain
from typing import TYPE_CHECKING

import numpy as np
from scipy import linalg

from boomctl.analysis.norm import NormBounds
from boomctl.arrays import Array, balance
from boomctl.checks import nonnegative, positive, whole
from boomctl.exceptions import SynthesisError
from boomctl.lti.modal import residualised
from boomctl.lti.rounding import SUMMED
from boomctl.lti.system import Lti, lower_lft
from boomctl.printing import system
from boomctl.synthesis.certificate import Design
from boomctl.synthesis.hinf.candidates import Candidate, largest_pole, verified_candidate, without_fast_poles
from boomctl.synthesis.plants.partition import GeneralizedPlant, matched
from boomctl.threads import one_blas_thread

if TYPE_CHECKING:
    import control

    from boomctl.lti.system import Controller

_SINGULAR = 1e12  # condition above which states left out have no rest to be put at: four digits would be left


@dataclass(frozen=True)
class ReducedController(Design):
    """A smaller controller and the loop it was verified in.

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
        What was done to the states left out.
    singular_values : ndarray
        Hankel-like singular values of the controller's states within the loop, descending.
    """

    _controller: Lti = field(repr=False)
    _closed_loop: Lti = field(repr=False)
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
    """Return a controller of lower order whose closed loop has nearly the norm of before.

    The controller's states are balanced by what they do within the loop (the controller's parts of the closed loop's
    gramians), so that unstable controllers need no care of their own.

    Parameters
    ----------
    P : control.StateSpace
        Generalized plant, in continuous or discrete time; the controller fits its last outputs and inputs.
    controller : control.StateSpace, or a design, which holds one
        ``u = K y``, of the sampling time of ``P`` if it has one; it stabilizes ``P``. For a scaled ``P`` in its scaled
        signals.
    order : int, optional
        Number of states wanted; fewer where the controller has states that do nothing within the loop.  By default the
        lowest whose loop stays within ``max_degradation``, which at the latest is the controller itself.
    max_degradation : float
        By how much the closed loop's norm may grow, relative to it.
    fastest_pole : float, optional
        No pole of the controller may have a larger magnitude [rad/s]; faster ones are replaced by their static gain.
        Not for a discrete controller, which runs once a sample.

    Returns
    -------
    ReducedController
        The smaller controller, the closed loop it was verified in, and the norms with it and without the reduction.

    Raises
    ------
    TypeError, ValueError
        Other kinds of system; sampling times or scales that differ; numbers out of range; an order above the
        controller's.
    SynthesisError
        The controller does not stabilize ``P``; no one of the order, or without faster poles, stays within the tolerance.

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
        raise ValueError("fastest_pole: expected none for a discrete controller, which runs once a sample")
    share = nonnegative("max_degradation", max_degradation)
    limit = np.inf if fastest_pole is None else positive("fastest_pole", fastest_pole)
    if order is not None and whole("order", order, 0) > len(K.A):
        raise ValueError(f"order = {order}: the controller has only {len(K.A)} states")
    full = verified_candidate(plant, K, np.inf)
    if isinstance(full, str):
        raise SynthesisError(f"the controller cannot be reduced: {full}")
    if largest_pole(K) > limit:
        slower = without_fast_poles(K, limit)
        result = "they cannot be split off" if slower is None else verified_candidate(plant, slower, np.inf)
        if slower is None or isinstance(result, str):  # it must stabilize, or nothing can be balanced
            raise SynthesisError(f"the controller does not work without its poles above {limit:.3g} rad/s: {result}")
        K = slower
    balanced, values = _balanced_in_loop(plant, K)
    most = len(balanced.A)
    orders = range(most + 1) if order is None else [min(order, most)]
    last = [("not reduced", K)] if order is None or order >= len(K.A) else []  # balancing may cost what is allowed
    allowed, rejected = full.norm.upper_bound * (1.0 + share), ""
    for method, smaller in chain((result for count in orders for result in _smaller(balanced, count)), last):
        if largest_pole(smaller) > limit:
            rejected = f"a pole at {largest_pole(smaller):.3g} rad/s where {limit:.3g} are allowed"
            continue
        result = verified_candidate(plant, smaller, allowed)
        if isinstance(result, Candidate):
            return ReducedController(
                _controller=replace(result.K, scales=plant.system.scales),
                _closed_loop=result.loop,
                order=len(result.K.A),
                gamma=result.norm.lower_bound,
                gamma_full=full.norm.lower_bound,
                norm_bounds=result.norm,
                fastest_pole=largest_pole(result.K),
                method=method,
                singular_values=values,
            )
        rejected = result
    which = f"order {order}" if order is not None else "any order"
    raise SynthesisError(f"no controller of {which} keeps the norm of the loop below {allowed:.6g}: {rejected}")


def _balanced_in_loop(plant: GeneralizedPlant, K: Lti) -> tuple[Lti, Array]:
    """Return a controller in coordinates in which its states are as much driven as seen within the loop, descending."""
    if not len(K.A):
        return K, np.zeros(0)
    loop, n = lower_lft(plant.system, K), len(plant.A)
    A, scale = balance(loop.A)
    B, C = loop.B / scale[:, None], loop.C * scale[None, :]
    if K.dt == 0.0:
        P, Q = linalg.solve_continuous_lyapunov(A, -B @ B.T), linalg.solve_continuous_lyapunov(A.T, -C.T @ C)
    else:
        P, Q = linalg.solve_discrete_lyapunov(A, B @ B.T), linalg.solve_discrete_lyapunov(A.T, C.T @ C)
    driven, seen = _root(P[n:, n:]), _root(Q[n:, n:])
    left, values, right = linalg.svd(seen.T @ driven)
    # share of the largest singular value below which a state does nothing but rounding
    kept = values > SUMMED * values[0]
    into = (left[:, kept] / np.sqrt(values[kept])).T @ seen.T / scale[n:]
    out = scale[n:, None] * (driven @ (right[kept].T / np.sqrt(values[kept])))
    return replace(K, A=into @ K.A @ out, B=into @ K.B, C=K.C @ out, state_labels=()), values


def _root(gramian: Array) -> Array:
    values, vectors = linalg.eigh(0.5 * (gramian + gramian.T))
    return vectors * np.sqrt(np.maximum(values, 0.0))


def _smaller(K: Lti, order: int) -> Iterator[tuple[str, Lti]]:
    """Yield controllers of an order: the states left out, and these at rest."""
    yield "truncated", replace(K, A=K.A[:order, :order], B=K.B[:order], C=K.C[:, :order])
    rest = K.A[order:, order:] - (0.0 if K.dt == 0.0 else 1.0) * np.eye(len(K.A) - order)  # of x' = 0, or of x+ = x
    if len(rest) and np.linalg.cond(rest) < _SINGULAR:
        yield "residualised", residualised(K, order)
