"""H2-optimal controllers of generalised plants: two Riccati equations, the norm verified on the closed loop.

Doyle, Glover, Khargonekar & Francis (1989), IEEE Transactions on Automatic Control 34.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from scipy import linalg

from boomctl.analysis.norm import StateMatrices
from boomctl.arrays import Array, Complex
from boomctl.checks import whole
from boomctl.synthesis.errors import SynthesisError
from boomctl.synthesis.modes import check_detectable, check_excited, check_stabilizable, check_weighted
from boomctl.synthesis.output_feedback import FeedbackCertificate, certify, closed, least_cost, observer
from boomctl.synthesis.plant import Plant, named_system, plant_of
from boomctl.synthesis.quadratic import square_root
from boomctl.synthesis.riccati import RiccatiProblem, RiccatiSolution, solve_riccati

if TYPE_CHECKING:
    import control

__all__ = ["H2Result", "h2"]

_RANK = 1e-10
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
    poles: Complex = field(repr=False)
    certificate: FeedbackCertificate


@dataclass(frozen=True)
class _Partition:
    """A generalised plant in its parts; ``w`` disturbances, ``z`` performance, ``u`` controls, ``y`` measurements."""

    plant: Plant
    w: tuple[str, ...]
    u: tuple[str, ...]
    z: tuple[str, ...]
    y: tuple[str, ...]

    def block(self, outputs: Sequence[str], inputs: Sequence[str]) -> StateMatrices:
        """Return the plant from some inputs to some outputs."""
        rows = [self.plant.outputs.index(name) for name in outputs]
        columns = [self.plant.inputs.index(name) for name in inputs]
        D = self.plant.D[np.ix_(rows, columns)]
        return StateMatrices(self.plant.A, self.plant.B[:, columns], self.plant.C[rows], D)


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
    parts = _partition(P, nmeas, ncon)
    _check_ranks(parts)
    direct = _cancelling(parts)
    shifted = _with_direct(parts, direct)
    regulator, estimator, problem, W = _solve(shifted, parts)
    inner = StateMatrices(
        shifted.A, shifted.B[:, len(parts.w) :], shifted.C[len(parts.z) :], shifted.D[len(parts.z) :, len(parts.w) :]
    )
    K = _complete(observer(inner, regulator.gain, estimator.gain.T), direct, parts.block(parts.y, parts.u).D)
    loop = closed(parts.block((*parts.z, *parts.y), (*parts.w, *parts.u)), K)
    loop = StateMatrices(loop.A, loop.B, loop.C, _negligible(loop.D, parts))
    certificate = certify(loop, least_cost(W, problem.R, regulator, estimator), regulator, estimator)
    states = [f"estimate.{s}" for s in parts.plant.states]
    return H2Result(
        controller=named_system((K.A, K.B, K.C, K.D), parts.y, parts.u, "h2", states),
        closed_loop=named_system(
            (loop.A, loop.B, loop.C, loop.D), parts.w, parts.z, "closed_loop", [*parts.plant.states, *states]
        ),
        norm=certificate.norm.value,
        optimum=certificate.least_norm,
        poles=np.concatenate([regulator.poles, estimator.poles]),
        certificate=certificate,
    )


def _partition(P: "control.StateSpace", nmeas: int, ncon: int) -> _Partition:
    plant = plant_of(P)
    p, m = whole("nmeas", nmeas), whole("ncon", ncon)
    if p >= len(plant.outputs):
        raise ValueError(f"nmeas = {p}: expected fewer than the {len(plant.outputs)} outputs of the generalised plant")
    if m >= len(plant.inputs):
        raise ValueError(f"ncon = {m}: expected fewer than the {len(plant.inputs)} inputs of the generalised plant")
    for what, signals in (("input", plant.inputs), ("output", plant.outputs)):
        if len(set(signals)) != len(signals):
            raise ValueError(f"generalised plant: an {what} name occurs twice among {', '.join(signals)}")
    return _Partition(plant, plant.inputs[:-m], plant.inputs[-m:], plant.outputs[:-p], plant.outputs[-p:])


def _check_ranks(parts: _Partition) -> None:
    """Raise :class:`SynthesisError` naming controls nothing weighs and measurements without noise."""
    D12, D21 = parts.block(parts.z, parts.u).D, parts.block(parts.y, parts.w).D
    for D, signals, lack in (
        (
            D12,
            parts.u,
            "no performance output weighs {}: give each control a weight of its own (D12 of full column rank)",
        ),
        (D21.T, parts.y, "no disturbance enters {} directly: give each measurement noise (D21 of full row rank)"),
    ):
        lengths = np.linalg.norm(D, axis=0)
        scaled = D / np.where(lengths > 0.0, lengths, 1.0)
        _, values, V = linalg.svd(scaled)
        values = np.concatenate([values, np.zeros(len(signals) - len(values))])
        if values[-1] <= _RANK:
            shares = np.abs(V[-1])
            together = [name for name, share in zip(signals, shares, strict=True) if share > 1e-6]
            one = together[0] if len(together) == 1 else f"the combination of {', '.join(together)}"
            raise SynthesisError(lack.format(one))


def _cancelling(parts: _Partition) -> Array:
    """Return the direct gain from measurements to controls that cancels the direct way to the performance outputs."""
    D11, D12, D21 = (parts.block(a, b).D for a, b in ((parts.z, parts.w), (parts.z, parts.u), (parts.y, parts.w)))
    if not D11.any():
        return np.zeros((len(parts.u), len(parts.y)))
    direct = -np.linalg.pinv(D12) @ D11 @ np.linalg.pinv(D21)
    left = D11 + D12 @ direct @ D21
    if np.abs(left).max() > _FEEDTHROUGH * np.abs(D11).max():
        i, j = (int(k) for k in np.unravel_index(np.argmax(np.abs(left)), left.shape))
        raise SynthesisError(
            f"disturbance {parts.w[j]} acts on performance output {parts.z[i]} directly (gain {D11[i, j]:.4g}), which no "
            "controller can cancel: the H2 norm is infinite; filter one of them (D11 = 0)"
        )
    return direct


def _negligible(D: Array, parts: _Partition) -> Array:
    """Return zero for a cancelled direct way; what is left is rounding of its parts, checked before."""
    scale = max(float(np.abs(parts.block(parts.z, parts.w).D).max(initial=0.0)), float(np.finfo(float).tiny))
    return np.zeros_like(D) if np.abs(D).max(initial=0.0) <= 10.0 * _FEEDTHROUGH * scale else D


def _with_direct(parts: _Partition, direct: Array) -> StateMatrices:
    """Return the generalised plant with ``u = direct y + v``, ``v`` in place of ``u``, and without its ``D22``."""
    P = parts.block((*parts.z, *parts.y), (*parts.w, *parts.u))
    q, k = len(parts.z), len(parts.w)
    B2, C2, D12, D21 = P.B[:, k:], P.C[q:], P.D[:q, k:], P.D[q:, :k]
    B = np.hstack([P.B[:, :k] + B2 @ direct @ D21, B2])
    D = np.block([[np.zeros((q, k)), D12], [D21, np.zeros((len(C2), B2.shape[1]))]])
    return StateMatrices(P.A + B2 @ direct @ C2, B, np.vstack([P.C[:q] + D12 @ direct @ C2, C2]), D)


def _solve(shifted: StateMatrices, parts: _Partition) -> tuple[RiccatiSolution, RiccatiSolution, RiccatiProblem, Array]:
    """Return regulator and filter, the regulator's problem and the intensity of the noise on the states."""
    q, k, states = len(parts.z), len(parts.w), parts.plant.states
    A, B1, B2, C1, C2 = shifted.A, shifted.B[:, :k], shifted.B[:, k:], shifted.C[:q], shifted.C[q:]
    D12, D21 = shifted.D[:q, k:], shifted.D[q:, :k]
    problem = RiccatiProblem(A, B2, C1.T @ C1, D12.T @ D12, C1.T @ D12)
    dual = RiccatiProblem(A.T, C2.T, B1 @ B1.T, D21 @ D21.T, B1 @ D21.T)
    check_stabilizable(A, B2, parts.u, states)
    check_detectable(A, C2, parts.y, states)
    free, _, Q = problem.shifted
    check_weighted(free, square_root(Q), ", ".join(parts.z), states)
    free, _, W = dual.shifted
    check_excited(free.T, square_root(W), ", ".join(parts.w), states)
    regulator = solve_riccati(problem, "the Riccati equation of the H2 regulator")
    return regulator, solve_riccati(dual, "the Riccati equation of the H2 filter"), problem, B1 @ B1.T


def _complete(K: StateMatrices, direct: Array, D22: Array) -> StateMatrices:
    """Return the controller with the direct gain added, and made for a plant with ``D22``: ``K (I + D22 K)^-1``."""
    D = K.D + direct
    if not D22.any():
        return StateMatrices(K.A, K.B, K.C, D)
    gap = np.eye(len(D22)) + D22 @ D
    if np.linalg.cond(gap) > 1e12:
        raise SynthesisError("the direct way from controls to measurements makes the loop of the direct gains singular")
    back = np.linalg.inv(gap)
    return StateMatrices(K.A - K.B @ back @ D22 @ K.C, K.B @ back, K.C - D @ back @ D22 @ K.C, D @ back)
