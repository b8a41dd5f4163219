"""H2-optimal controllers of generalized plants, with the verified norm of the closed loop.

Doyle, Glover, Khargonekar & Francis (1989), IEEE Transactions on Automatic Control 34; in discrete time Chen & Francis
(1995), Optimal Sampled-Data Control Systems, chapter 6: the control at a sample may use the measurement at that sample.
"""

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np
from scipy import linalg

from boomctl.arrays import Array, blocks
from boomctl.exceptions import SynthesisError
from boomctl.lti.rounding import ALIKE
from boomctl.lti.system import Lti, lower_lft
from boomctl.printing import system
from boomctl.synthesis.assumptions import check_ranks, checked
from boomctl.synthesis.certificate import DesignCertificate, LoopDesign
from boomctl.synthesis.lq.lqg import certify, least_cost, observer
from boomctl.synthesis.lq.riccati import RiccatiProblem, RiccatiSolution, solution_of
from boomctl.synthesis.plants.full_plant import origin_of
from boomctl.synthesis.plants.partition import (
    GeneralizedPlant,
    cancelled,
    partition,
    with_feedthrough,
)
from boomctl.threads import one_blas_thread

if TYPE_CHECKING:
    import control


@dataclass(frozen=True)
class H2Result(LoopDesign):
    """Result of an H2 synthesis.

    Attributes
    ----------
    controller : control.StateSpace
        ``u = K y``, labeled as the measurements and controls of the generalized plant, in the units of the machine.
    scaled_controller : control.StateSpace
        The same in the scaled signals of the plant; equal to `controller` if the plant has no scales.
    closed_loop : control.StateSpace
        Closed loop from the disturbances to the performance outputs, labeled as in the generalized plant.
    norm : float
        H2 norm of the closed loop.
    optimal_norm : float
        The least H2 norm of any controller, by the Riccati equations.
    poles : complex ndarray
        Poles of the closed loop [rad/s]: those of the regulator, then those of the filter.
    certificate : DesignCertificate
        The norm, the least one by the Riccati equations, and the errors of their solutions.
    """

    _called = "h2"

    norm: float
    optimal_norm: float
    poles: Array = field(repr=False)
    certificate: DesignCertificate

    def __repr__(self) -> str:
        c = self.certificate
        norms = f"H2 norm of the closed loop {self.norm:.6g}, {c.norm_bounds.status}; optimal {self.optimal_norm:.6g}"
        return f"H2Result: controller of {system(self._controller)}\n  {norms}{c._on_full_plant}"


@one_blas_thread
def h2(P: "control.StateSpace", nmeas: int | None = None, ncon: int | None = None) -> H2Result:
    """Design the controller that minimizes the H2 norm of the closed loop.

    Parameters
    ----------
    P : control.StateSpace
        Generalized plant: its last ``ncon`` inputs are controls, its last ``nmeas`` outputs are measurements; the others
        are disturbances (unit white noise) and performance outputs. For a discrete plant the control at a sample depends on
        the measurements up to that sample; with :func:`boomctl.lqg`, on those before it. If the plant passed to
        `generalized_plant` is a result of `reduce`, the loop is also evaluated on the full plant:
        ``certificate.full_plant``.
    nmeas, ncon : int, optional
        Numbers of measurements and controls. If None, they are determined from the labels that `generalized_plant` and
        `mixed_sensitivity` give.

    Returns
    -------
    H2Result
        The controller ``u = K y``, the closed loop, its norm, and a certificate.

    Raises
    ------
    TypeError, ValueError
        If `P` is not a system, if its sampling time is unspecified, if an entry is not finite, or if a count is out of range.
    SynthesisError
        If a control has no weight or a measurement no noise, if a feedthrough from a disturbance to a performance output
        cannot be canceled (in continuous time), if an assumption fails for a mode, or if the norm of the loop is not that of
        the Riccati equations.

    Warns
    -----
    ReductionWarning
        If the loop with the full plant is not stable, not proved to be, or has a norm larger by more than a tenth.

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
    plant = partition(P, nmeas, ncon, sampled=True)
    if not len(plant.A):
        raise ValueError("`P` must have at least one state, got a static gain.")
    check_ranks(plant)
    shifted, direct = _without_feedthrough(plant)
    checked(shifted)
    regulator = _solved(shifted, "the Riccati equation of the H2 regulator")
    estimator = _solved(shifted.dual, "the Riccati equation of the H2 filter")
    K, least = _controller(shifted, regulator, estimator)
    try:
        K = with_feedthrough(replace(K, D=K.D + direct), plant.D22)
    except ValueError as error:
        raise SynthesisError(f"The feedthrough from controls to measurements is not allowed: {error}.") from None
    loop = cancelled(lower_lft(plant.system, K), plant.D11)
    certificate = certify(loop, K, least, regulator, estimator, plant=plant, origin=origin_of(P))
    return H2Result(
        _controller=K,
        _closed_loop=loop,
        norm=certificate.norm_bounds.value,
        optimal_norm=certificate.lower_bound,
        poles=np.concatenate([regulator.poles, estimator.poles]),
        certificate=certificate,
        _plant=plant.system,
    )


def _controller(p: GeneralizedPlant, regulator: RiccatiSolution, estimator: RiccatiSolution) -> tuple[Lti, float]:
    """Return the controller of a plant without ``D22``, and the least square of the norm.

    In discrete time the regulator would set ``u = -F x - G w``.  The controller sets it for the best estimates of both, which
    take what the measurement at the sample brings that was not expected: ``M`` times it.
    """
    F, L, s = regulator.gain, estimator.gain.T, p.system
    loop_plant = Lti(p.A, p.B2, p.C2, p.D22, p.controls, p.measurements, s.state_labels, s.dt, s.scales)
    K = observer(loop_plant, F, L)
    if s.dt == 0.0:
        return K, least_cost(p.B1 @ p.B1.T, p.D12.T @ p.D12, regulator, estimator)
    X, Y = regulator.X, estimator.X
    effort, read = p.D12.T @ p.D12 + p.B2.T @ X @ p.B2, p.D21 @ p.D21.T + p.C2 @ Y @ p.C2.T
    G = linalg.solve(effort, p.B2.T @ X @ p.B1 + p.D12.T @ p.D11, assume_a="pos")
    M = linalg.solve(read, (F @ Y @ p.C2.T + G @ p.D21.T).T, assume_a="pos").T
    K = replace(K, A=K.A + p.B2 @ M @ p.C2, B=K.B - p.B2 @ M, C=K.C + M @ p.C2, D=-M)
    known = np.trace(p.B1.T @ X @ p.B1) + np.trace(p.D11.T @ p.D11)
    return K, float(known + np.trace(effort @ (F @ Y @ F.T - M @ read @ M.T)))


def _without_feedthrough(p: GeneralizedPlant) -> tuple[GeneralizedPlant, Array]:
    """Return the plant with ``u = direct y + v``, ``v`` in place of ``u``, and without its ``D22``; and ``direct``.

    In continuous time ``direct`` cancels the feedthrough ``D11`` to the performance outputs; in discrete time it is zero.
    """
    D11, direct = p.D11, np.zeros((p.ncon, p.nmeas))
    if p.system.dt == 0.0 and D11.any():
        direct = -np.linalg.pinv(p.D12) @ D11 @ np.linalg.pinv(p.D21)
        left = D11 + p.D12 @ direct @ p.D21
        i, j = np.unravel_index(np.argmax(np.abs(left)), left.shape)
        if abs(left[i, j]) > ALIKE * np.abs(D11).max():
            raise SynthesisError(
                f"The H2 norm is infinite: disturbance {p.disturbances[j]!r} has a feedthrough {D11[i, j]:.4g} to performance"
                f" output {p.performance[i]!r}, which no controller cancels. Filter one of them."
            )
        D11 = np.zeros_like(D11)
    B = np.hstack([p.B1 + p.B2 @ direct @ p.D21, p.B2])
    C = np.vstack([p.C1 + p.D12 @ direct @ p.C2, p.C2])
    D = blocks([[D11, p.D12], [p.D21, np.zeros_like(p.D22)]])
    return replace(p, system=replace(p.system, A=p.A + p.B2 @ direct @ p.C2, B=B, C=C, D=D)), direct


def _solved(p: GeneralizedPlant, what: str) -> RiccatiSolution:
    """Return the regulator of a plant; the filter is the regulator of the dual one."""
    problem = RiccatiProblem(p.A, p.B2, p.C1.T @ p.C1, p.D12.T @ p.D12, p.C1.T @ p.D12, p.system.dt)
    return solution_of(problem, what)
