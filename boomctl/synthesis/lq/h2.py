"""H2-optimal controllers of generalised plants: two Riccati equations, the norm verified on the closed loop.

Doyle, Glover, Khargonekar & Francis (1989), IEEE Transactions on Automatic Control 34.
"""

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from boomctl.arrays import Array
from boomctl.lti.system import Lti, lower_lft
from boomctl.printing import system
from boomctl.synthesis.assumptions import SynthesisError, check_modes, check_ranks, check_zeros
from boomctl.synthesis.hinf.normal_form import normalised
from boomctl.synthesis.lq.output_feedback import FeedbackCertificate, certify, least_cost, observer
from boomctl.synthesis.lq.riccati import RiccatiProblem, RiccatiSolution, solve_riccati
from boomctl.synthesis.plants.partition import GeneralizedPlant, partition, with_feedthrough

if TYPE_CHECKING:
    import control

_FEEDTHROUGH = 1e-10  # share of D11 that rounding may leave of a direct way that the controller cancels


@dataclass(frozen=True)
class H2Result:
    """An H2-optimal controller.

    Attributes
    ----------
    controller : control.StateSpace
        ``u = K y``, its signals named as the measurements and controls of the generalised plant.
    closed_loop : control.StateSpace
        The loop from the disturbances to the performance outputs, named as in the generalised plant.
    norm : float
        H2 norm of the closed loop, by Gramians of the loop itself.
    optimum : float
        The least H2 norm of any controller, from the Riccati solutions alone.
    poles : complex ndarray
        Poles of the closed loop [rad/s]: those of the regulator, then those of the filter.
    certificate : FeedbackCertificate
        How well both Riccati equations are solved, and the norm found in other ways.
    """

    _controller: Lti = field(repr=False)
    _closed_loop: Lti = field(repr=False)
    norm: float
    optimum: float
    poles: Array = field(repr=False)
    certificate: FeedbackCertificate

    @cached_property
    def controller(self) -> "control.StateSpace":
        """As a system of python-control; it is made when it is first read."""
        return self._controller.statespace("h2")

    @cached_property
    def closed_loop(self) -> "control.StateSpace":
        """As a system of python-control; it is made when it is first read."""
        return self._closed_loop.statespace("closed_loop")

    def __repr__(self) -> str:
        norms = f"H2 norm of the closed loop {self.norm:.6g}, verified; least possible {self.optimum:.6g}"
        return f"H2Result: controller of {system(self._controller)}\n  {norms}"


def h2(P: "control.StateSpace", nmeas: int, ncon: int) -> H2Result:
    """Return the controller that makes the H2 norm of the closed loop as small as can be.

    Parameters
    ----------
    P : control.StateSpace
        Generalised plant in continuous time: its last ``ncon`` inputs are controls, its last ``nmeas`` outputs are
        measurements; the others are disturbances (unit white noise) and performance outputs.
    nmeas, ncon : int
        Numbers of measurements and controls.

    Returns
    -------
    H2Result
        The controller ``u = K y``, the closed loop, its norm, and a certificate.

    Raises
    ------
    TypeError, ValueError
        Another kind of system, discrete time, not finite; numbers of signals that the plant does not have.
    SynthesisError
        A control that no performance output weighs, a measurement without noise, a direct way from a disturbance to a
        performance output that no controller can cancel, a mode in the way: each named.  A loop whose norms disagree.

    Examples
    --------
    >>> import boomctl as bc
    >>> import control
    >>> P = control.ss(
    ...     [[0.0]], [[1.0, 0.0, 1.0]], [[1.0], [0.0], [1.0]], [[0, 0, 0], [0, 0, 1], [0, 1, 0]],
    ...     inputs=["load", "noise", "u"], outputs=["place", "effort", "y"],
    ... )
    >>> round(bc.h2(P, 1, 1).norm ** 2, 6)
    2.0
    """
    plant = partition(P, nmeas, ncon)
    if not len(plant.A):
        raise ValueError("P: expected at least one state, got a static gain")
    check_ranks(plant)
    direct = _cancelling(plant)
    shifted = _with_direct(plant, direct)
    ready = normalised(shifted)
    check_modes(shifted, ready)
    check_zeros(shifted, ready)
    regulator = _solved(shifted, "the Riccati equation of the H2 regulator")
    estimator = _solved(shifted.dual, "the Riccati equation of the H2 filter")
    way = Lti(shifted.A, shifted.B2, shifted.C2, shifted.D22, plant.controls, plant.measurements, plant.system.states)
    K = observer(way, regulator.gain, estimator.gain.T)
    try:
        K = with_feedthrough(replace(K, D=K.D + direct), plant.D22)
    except ValueError as error:
        raise SynthesisError(f"feedthrough from controls to measurements: {error}") from None
    loop = lower_lft(plant.system, K)
    if np.abs(loop.D).max(initial=0.0) <= 10.0 * _FEEDTHROUGH * np.abs(plant.D11).max(initial=0.0):
        loop = replace(loop, D=np.zeros_like(loop.D))  # what rounding leaves of the direct way that is cancelled
    R, W = shifted.D12.T @ shifted.D12, shifted.B1 @ shifted.B1.T
    certificate = certify(loop, least_cost(W, R, regulator, estimator), regulator, estimator)
    return H2Result(
        _controller=K,
        _closed_loop=loop,
        norm=certificate.norm.value,
        optimum=certificate.least_norm,
        poles=np.concatenate([regulator.poles, estimator.poles]),
        certificate=certificate,
    )


def _cancelling(parts: GeneralizedPlant) -> Array:
    """Return the direct gain from measurements to controls that cancels the direct way to the performance signals."""
    D11 = parts.D11
    if not D11.any():
        return np.zeros((len(parts.controls), len(parts.measurements)))
    direct = -np.linalg.pinv(parts.D12) @ D11 @ np.linalg.pinv(parts.D21)
    left = D11 + parts.D12 @ direct @ parts.D21
    if np.abs(left).max() > _FEEDTHROUGH * np.abs(D11).max():
        i, j = (int(k) for k in np.unravel_index(np.argmax(np.abs(left)), left.shape))
        raise SynthesisError(
            f"disturbance {parts.disturbances[j]!r} acts on performance signal {parts.performance[i]!r} directly (gain "
            f"{D11[i, j]:.4g}), which no controller can cancel: the H2 norm is infinite; filter one of them (D11 = 0)"
        )
    return direct


def _with_direct(parts: GeneralizedPlant, direct: Array) -> GeneralizedPlant:
    """Return the generalised plant with ``u = direct y + v``, ``v`` in place of ``u``, and without its ``D22``."""
    p = parts
    B = np.hstack([p.B1 + p.B2 @ direct @ p.D21, p.B2])
    C = np.vstack([p.C1 + p.D12 @ direct @ p.C2, p.C2])
    D = np.block([[np.zeros_like(p.D11), p.D12], [p.D21, np.zeros_like(p.D22)]])
    return replace(p, system=replace(p.system, A=p.A + p.B2 @ direct @ p.C2, B=B, C=C, D=D))


def _solved(p: GeneralizedPlant, what: str) -> RiccatiSolution:
    """Return the regulator of a plant; the filter is the regulator of the dual one."""
    return solve_riccati(RiccatiProblem(p.A, p.B2, p.C1.T @ p.C1, p.D12.T @ p.D12, p.C1.T @ p.D12), what)
