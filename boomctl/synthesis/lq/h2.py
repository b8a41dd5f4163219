"""H2-optimal controllers of generalised plants: two Riccati equations, the norm verified on the closed loop.

Doyle, Glover, Khargonekar & Francis (1989), IEEE Transactions on Automatic Control 34.
"""

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from boomctl.arrays import Array
from boomctl.lti.system import Lti
from boomctl.printing import system
from boomctl.synthesis.errors import SynthesisError
from boomctl.synthesis.hinf.assumptions import check_modes, check_ranks, check_zeros
from boomctl.synthesis.lq.output_feedback import FeedbackCertificate, certify, least_cost, observer
from boomctl.synthesis.plants.closed_loop import closed, with_feedthrough
from boomctl.synthesis.plants.named import named_statespace
from boomctl.synthesis.plants.partition import Plant, normalised, partition
from boomctl.synthesis.riccati import RiccatiProblem, RiccatiSolution, solve_riccati

if TYPE_CHECKING:
    import control

_FEEDTHROUGH = 1e-10


@dataclass(frozen=True)
class H2Result:
    """An H2-optimal controller.

    Attributes
    ----------
    controller : control.StateSpace
        ``u = K y``, its signals named as the measurements and controls of the generalised plant.
    closed_loop : control.StateSpace
        From the disturbances to the performance outputs, named as in the generalised plant.
    norm : float
        H2 norm of the closed loop, by Gramians of the loop itself.
    optimum : float
        The least H2 norm of any controller, from the Riccati solutions alone.
    poles : complex ndarray
        Of the closed loop [rad/s]: those of the regulator, then those of the filter.
    certificate : FeedbackCertificate
    """

    controller: "control.StateSpace" = field(repr=False)
    closed_loop: "control.StateSpace" = field(repr=False)
    norm: float
    optimum: float
    poles: Array = field(repr=False)
    certificate: FeedbackCertificate

    def __repr__(self) -> str:
        norms = f"H2 norm of the closed loop {self.norm:.6g}, verified; least possible {self.optimum:.6g}"
        return f"H2Result: controller of {system(self.controller)}\n  {norms}"


def h2(P: "control.StateSpace", nmeas: int, ncon: int) -> H2Result:
    """Return the controller of least H2 norm.

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

    Raises
    ------
    TypeError, ValueError
        Another kind of system, discrete time, not finite; numbers of signals that the plant does not have.
    SynthesisError
        A control that no performance output weighs, a measurement without noise, a direct way from a disturbance to a
        performance output that no controller can cancel, a mode in the way: each named.  A loop whose norms disagree.

    Examples
    --------
    >>> import control
    >>> P = control.ss(
    ...     [[0.0]], [[1.0, 0.0, 1.0]], [[1.0], [0.0], [1.0]], [[0, 0, 0], [0, 0, 1], [0, 1, 0]],
    ...     inputs=["load", "noise", "u"], outputs=["place", "effort", "y"],
    ... )
    >>> round(h2(P, 1, 1).norm ** 2, 6)
    2.0
    """
    parts = partition(P, nmeas, ncon)
    if not parts.states:
        raise ValueError("P: expected at least one state, got a static gain")
    check_ranks(parts)
    direct = _cancelling(parts)
    shifted = _with_direct(parts, direct)
    ready = normalised(shifted)
    check_modes(shifted, ready)
    check_zeros(shifted, ready)
    regulator, estimator = _solve(shifted)
    K = _completed(shifted, regulator, estimator, direct, parts)
    loop = _without_rounding(closed(parts, K), parts)
    R, W = shifted.D12.T @ shifted.D12, shifted.B1 @ shifted.B1.T
    certificate = certify(loop, least_cost(W, R, regulator, estimator), regulator, estimator)
    states = [f"estimate.{s}" for s in parts.states]
    return H2Result(
        controller=named_statespace((K.A, K.B, K.C, K.D), parts.measurements, parts.controls, "h2", states),
        closed_loop=named_statespace(
            (loop.A, loop.B, loop.C, loop.D),
            parts.disturbances,
            parts.performance,
            "closed_loop",
            [*parts.states, *states],
        ),
        norm=certificate.norm.value,
        optimum=certificate.least_norm,
        poles=np.concatenate([regulator.poles, estimator.poles]),
        certificate=certificate,
    )


def _cancelling(parts: Plant) -> Array:
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


def _with_direct(parts: Plant, direct: Array) -> Plant:
    """Return the generalised plant with ``u = direct y + v``, ``v`` in place of ``u``, and without its ``D22``."""
    return replace(
        parts,
        A=parts.A + parts.B2 @ direct @ parts.C2,
        B1=parts.B1 + parts.B2 @ direct @ parts.D21,
        C1=parts.C1 + parts.D12 @ direct @ parts.C2,
        D11=np.zeros_like(parts.D11),
        D22=np.zeros_like(parts.D22),
    )


def _solve(shifted: Plant) -> tuple[RiccatiSolution, RiccatiSolution]:
    """Return regulator and filter; the filter is the regulator of the transposed plant."""
    p = shifted
    regulator = RiccatiProblem(p.A, p.B2, p.C1.T @ p.C1, p.D12.T @ p.D12, p.C1.T @ p.D12)
    estimator = RiccatiProblem(p.A.T, p.C2.T, p.B1 @ p.B1.T, p.D21 @ p.D21.T, p.B1 @ p.D21.T)
    return (
        solve_riccati(regulator, "the Riccati equation of the H2 regulator"),
        solve_riccati(estimator, "the Riccati equation of the H2 filter"),
    )


def _completed(
    shifted: Plant, regulator: RiccatiSolution, estimator: RiccatiSolution, direct: Array, parts: Plant
) -> Lti:
    """Return the controller of the plant given, from the regulator and the filter of the shifted one."""
    inner = Lti(shifted.A, shifted.B2, shifted.C2, shifted.D22)
    K = observer(inner, regulator.gain, estimator.gain.T)
    try:
        return with_feedthrough(replace(K, D=K.D + direct), parts.D22)
    except ValueError as error:
        raise SynthesisError(f"feedthrough from controls to measurements: {error}") from None


def _without_rounding(loop: Lti, parts: Plant) -> Lti:
    """Return the loop without what rounding leaves of the direct way that the controller cancels."""
    scale = float(np.abs(parts.D11).max(initial=0.0))
    small = np.abs(loop.D).max(initial=0.0) <= 10.0 * _FEEDTHROUGH * scale
    return replace(loop, D=np.zeros_like(loop.D)) if small else loop
