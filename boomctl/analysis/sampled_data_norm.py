"""The largest gain of a sampled loop in continuous time, between samples included: its L2-induced norm.

Signals of continuous time are taken one sample at a time (lifting; Bamieh & Pearson 1992, IEEE Transactions on Automatic
Control 37).  A level is above the norm exactly if a discrete system that depends on the level has an H-infinity norm below
one.  That system is the solution over a sample of ``x' = A x + B w``, ``p' = -A^T p - C^T z`` under the worst ``w``, kept as
``x(h) = Phi x(0) + W p(h)``, ``p(0) = Phi^T p(h) + X x(0)``: of a step so short that nothing can go wrong, then doubled,
where ``W X`` stays below one exactly if the level is above what can be gained within the step.  Nothing grows in it, however
fast the poles are.

So levels on either side of the norm bound it.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import reduce
from math import inf
from typing import TYPE_CHECKING

import numpy as np
from scipy import linalg

from boomctl.analysis.norm import NormBounds, agree, matrices_norm
from boomctl.arrays import Array, blocks
from boomctl.checks import names
from boomctl.lti.gramians import square_root
from boomctl.lti.modal import sides
from boomctl.lti.rounding import TINY
from boomctl.lti.sampled import Held, time_of_loop, whole_samples
from boomctl.lti.system import Lti, controller_of, lower_lft, of, signal_scales
from boomctl.threads import one_blas_thread

if TYPE_CHECKING:
    import control

    from boomctl.structure.model import SecondOrderModel

LIFTED = "levels of the lifted loop, one that is reached and one that is not"  # how both bounds are found
NOT_TOLD = "rounding keeps levels beside the norm from being told"
NOT_STABLE = "a pole on or outside the unit circle"  # infinite
_SMALL = 0.5  # size of a first step times its Hamiltonian matrix (a choice)
_SHORT = 0.25  # of a level, that can be gained at most within the first step: far from any limit (a choice)
_DOUBLINGS = 60  # of the first step at most: more is a mistake of unit (a choice)
_APART = 3e-6  # of a level: how far from where the norm is expected levels on both sides are tried, of CERTIFIED
_FARTHER = 5.0  # times as far, where rounding hides the level (a choice)
_FAR = 100.0  # times a level that is reached, before one is known that is not (a choice)
_LEVELS = 60  # tried at most: some six do, and one more for two decades between the unit and the norm


@one_blas_thread
def sampled_data_norm(
    plant: "SecondOrderModel | control.StateSpace | control.TransferFunction",
    controller: "control.StateSpace | control.TransferFunction",
    inputs: str | Sequence[str] | None = None,
    outputs: str | Sequence[str] | None = None,
    *,
    delay: float = 0.0,
) -> NormBounds:
    """Return the L2-induced norm of a sampled loop ``u = K y``: its largest gain, between samples included.

    The energy of the outputs, as functions of time, is at most the square of this norm times that of the disturbances,
    whatever these do between samples.  ``hinf_norm(feedback_loop(...))`` knows only disturbances that are held from sample to
    sample, and outputs at the samples.

    Parameters
    ----------
    plant : SecondOrderModel, control.StateSpace or control.TransferFunction
        The plant in continuous time, signals named; a generalized plant too.
    controller : control.StateSpace or control.TransferFunction
        In discrete time: its inputs are outputs of the plant, its outputs inputs of the plant.
    inputs : str or sequence of str, optional
        Disturbances; by default all inputs of the plant that the controller does not drive.
    outputs : str or sequence of str, optional
        Outputs of the plant, or controls as the plant feels them; by default all outputs of the plant.
    delay : float, optional
        Time between a sample and the moment its control acts [s].

    Returns
    -------
    NormBounds
        A level that is reached, one that is not, and the frequency of the former up to whole sampling rates [rad/s].
        Infinite if the loop is not stable.

    Raises
    ------
    TypeError, ValueError
        Other kinds of system; a plant in discrete time, a controller in continuous time; names that do not meet; a delay
        that the loop cannot have; a disturbance that acts on a measurement directly, without a filter.

    Examples
    --------
    >>> import boomctl as bc
    >>> import control
    >>> signals = {"inputs": ["load", "force"], "outputs": "place"}
    >>> mass = control.ss([[0.0, 1.0], [0.0, 0.0]], [[0.0, 0.0], [1.0, 1.0]], [[1.0, 0.0]], 0.0, **signals)
    >>> lead = control.ss([[-20.0]], [[1.0]], [[360.0]], -20.0, inputs="place", outputs="force")
    >>> norm = bc.analysis.sampled_data_norm(mass, bc.discretize(lead, 0.05), delay=0.03)
    >>> round(norm.lower_bound, 3), bool(norm.verified)
    (0.904, True)
    """
    from boomctl.analysis.loops import signals_of

    P = of(plant, "plant")
    K = controller_of(controller, discrete=True, sampled=True, scales=P.scales)
    if K.dt == 0.0:
        raise ValueError("controller: expected a sampling time, got continuous time; boomctl.discretize samples it")
    acting, measured = signals_of(K, P.input_labels, P.output_labels, P.state_labels, P.scales)
    dt, late = time_of_loop(P, K, delay)
    free = [name for name in P.input_labels if name not in K.output_labels]
    driven = [P.input_labels.index(name) for name in names("disturbance", inputs, free)]
    shown = names("output", outputs, (*P.output_labels, *K.output_labels)) if outputs is not None else P.output_labels
    if not (driven and shown):
        raise ValueError("inputs, outputs: expected at least one disturbance and one output")
    direct = P.D[np.ix_(measured, driven)]
    if direct.any():
        o, i = (int(k[0]) for k in np.nonzero(direct))
        name, corner = P.input_labels[driven[i]], np.pi / dt  # half the sampling rate
        others = [item for item in P.input_labels if item != name]
        raise ValueError(
            f"disturbance {name!r} acts on measurement {P.output_labels[measured[o]]!r} directly: samples of it have no"
            f" bound without a filter before it: W = boomctl.low_pass(1.0, {corner:.4g});"
            f" W.input_labels, W.output_labels = ['filtered'], [{name!r}]; P = control.interconnect([P, W],"
            f" inputs={['filtered', *others]}, outputs={list(P.output_labels)})"
        )
    zero, one = np.zeros((len(acting), len(P.A))), np.eye(len(P.input_labels))[acting]  # the controls, as outputs
    every = replace(
        P, C=np.vstack([P.C, zero]), D=np.vstack([P.D, one]), output_labels=(*P.output_labels, *K.output_labels)
    )
    rows = [every.output_labels.index(name) for name in shown]
    loop = SampledLoop.of(every.between([*driven, *acting], [*rows, *measured]).balanced(), K, late)
    if (sides(loop.at_samples.poles, dt) >= 0).any():
        return NormBounds(inf, inf, float("nan"), NOT_STABLE)
    return loop.norm()


@dataclass(frozen=True)
class _Step:
    """What a plant does in a while at a level: ``x(h) = Phi x + W p(h)``, ``p = Phi^T p(h) + X x``."""

    Phi: Array
    W: Array
    X: Array

    def then(self, other: "_Step") -> "_Step":
        """Return this step and another after it.

        Raises
        ------
        LinAlgError
            The level can be reached within the two.
        """
        values, vectors = linalg.eigh(self.W)
        L = vectors * np.sqrt(np.maximum(values, 0.0))
        inner = np.eye(L.shape[1]) - L.T @ other.X @ L
        factor = linalg.cho_factor(0.5 * (inner + inner.T))
        # x1 = (I - W1 X2)^-1 (Phi1 x + W1 Phi2^T p), with (I - W1 X2)^-1 = I + L inner^-1 L^T X2
        spread = L @ linalg.cho_solve(factor, L.T)
        reach = self.Phi + spread @ (other.X @ self.Phi)
        W = other.W + other.Phi @ spread @ other.Phi.T
        X = self.X + self.Phi.T @ (other.X + other.X @ spread @ other.X) @ self.Phi
        return _Step(other.Phi @ reach, 0.5 * (W + W.T), 0.5 * (X + X.T))


def _step(system: Lti, duration: float, level: float) -> _Step:
    """Return what a system does in a while at a level.

    Raises
    ------
    LinAlgError
        The level can be reached within that time.
    """
    A, B, C, D, n = system.A, system.B, system.C, system.D, len(system.A)
    direct = float(np.linalg.norm(D, 2))
    if direct >= level:
        raise linalg.LinAlgError("the level is reached at once")
    inverse = linalg.inv(np.eye(B.shape[1]) - D.T @ D / level**2)
    moved = A + B @ inverse @ D.T @ C / level**2
    weighed = C + D @ (inverse @ (D.T @ C)) / level**2
    H = blocks([[moved, B @ inverse @ B.T / level], [-C.T @ weighed / level, -moved.T]])
    size = float(np.linalg.norm(H, 2)) * duration
    gain = float(np.linalg.norm(B, 2) * np.linalg.norm(C, 2)) * duration * np.exp(_SMALL)
    shares = size / _SMALL, gain / (_SHORT * (level - direct))
    count = max(0, *(int(np.ceil(np.log2(max(share, 1.0)))) for share in shares))
    if count > _DOUBLINGS:
        raise ValueError(
            f"plant: expected poles below {2.0**_DOUBLINGS:.0e} times the sampling rate; choose other units"
        )
    E = linalg.expm(np.ldexp(H * duration, -count))
    back = linalg.inv(E[n:, n:])
    W, X = E[:n, n:] @ back, -back @ E[n:, :n]
    result = _Step(back.T, 0.5 * (W + W.T), 0.5 * (X + X.T))
    for _ in range(count):
        result = result.then(result)
    return result


@dataclass(frozen=True)
class SampledLoop:
    """A sampled loop: the plant between its samples, its queue of controls, the controller.

    Attributes
    ----------
    controller : Lti
    parts : tuple of (float, Lti)
        The one or two parts of a sample between changes of the controls: how long each is [s], and the plant in it, from
        disturbances to what is shown.  Its states are the plant's, and the controls before and after they change, of which
        one acts.
    queue : Lti
        The plant and its queue of controls from sample to sample, from the controls to what is read.
    from_states, from_given : ndarray
        The plant's state at a sample, its controls before and after they change: of all states, and of what is given.
    """

    controller: Lti
    parts: tuple[tuple[float, Lti], ...]
    queue: Lti
    from_states: Array
    from_given: Array

    @classmethod
    def of(cls, P: Lti, K: Lti, delay: float) -> "SampledLoop":
        dt, n, m, scale = K.dt, len(P.A), len(K.C), signal_scales(P.A, P.B, P.C)
        P = replace(P, A=P.A / scale[:, None] * scale, B=P.B / scale[:, None], C=P.C * scale)
        late, nw, nz = whole_samples(delay, dt), P.B.shape[1] - m, len(P.C) - K.B.shape[1]
        acting = range(nw, nw + m)
        held = Held.of(P, acting, [late] * m)
        queue = held.sampled(dt)
        given = np.vstack([np.zeros((n + m, m)), held.direct[nw:, nw:]])
        states = np.vstack([np.eye(n, len(queue.A)), held.before[nw:], held.after[nw:]])
        parts = []
        for duration, at in ((late[1], slice(n, n + m)), (dt - late[1], slice(n + m, n + 2 * m))):
            if duration > 0.0:
                A, C = np.zeros((n + 2 * m, n + 2 * m)), np.zeros((nz, n + 2 * m))
                A[:n, :n], A[:n, at], C[:, :n], C[:, at] = P.A, P.B[:, nw:], P.C[:nz], P.D[:nz, nw:]
                B = np.vstack([P.B[:, :nw], np.zeros((2 * m, nw))])
                parts.append((duration, Lti(A, B, C, P.D[:nz, :nw])))
        return cls(replace(K, state_labels=()), tuple(parts), queue.between(acting, range(nz, len(P.C))), states, given)

    @property
    def at_samples(self) -> Lti:
        """The closed loop from sample to sample."""
        return lower_lft(self.queue, self.controller)

    def of_level(self, level: float) -> NormBounds:
        """Return the norm of the loop of a level, which is below one exactly if the level is above that of this loop.

        Its states are those of ``at_samples``.  Signals are in units in which the level is one.  Where the level can be
        gained within a sample there is no such loop; below the norm it need not be stable.
        """
        unstable = NormBounds(inf, inf, 0.0, NOT_STABLE, verified=True)
        try:
            total = reduce(_Step.then, [_step(part, duration, level) for duration, part in self.parts])
        except linalg.LinAlgError:  # reached within a sample
            return unstable
        moving, read = square_root(total.W), square_root(total.X).T
        n, inputs, Phi = len(self.from_given) - 2 * len(self.controller.C), moving.shape[1], total.Phi
        A, B, C = self.queue.A.copy(), self.queue.B.copy(), np.vstack([read @ self.from_states, self.queue.C])
        A[:n], B[:n] = Phi[:n] @ self.from_states, Phi[:n] @ self.from_given
        B = np.hstack([np.pad(moving[:n], ((0, len(A) - n), (0, 0))), B])
        D = np.pad(np.vstack([read @ self.from_given, self.queue.D]), ((0, 0), (inputs, 0)))
        loop = lower_lft(Lti(A, B, C, D, dt=self.queue.dt), self.controller).balanced()
        _ = loop.eigensystem  # of which the norm asks, too
        return matrices_norm(loop) if (sides(loop.poles, loop.dt) < 0).all() else unstable

    def norm(self) -> NormBounds:
        """Return the norm between two levels, of which the loop of one reaches one and that of the other does not.

        The inverse of the norm of a level's loop is nearly proportional to the level: secants find where it is one.
        """
        low, high, omega, apart = 0.0, inf, 0.0, _APART
        before, level = (0.0, 0.0), 1.0
        for _ in range(_LEVELS):
            found = self.of_level(level)
            if found.upper_bound == 0.0:
                return NormBounds(0.0, 0.0, 0.0, "no disturbance shows", verified=True)
            if found.upper_bound < 1.0:
                high = level
            elif found.lower_bound >= 1.0:
                low, omega = level, found.peak_omega
            elif before[1] > 0.0:  # rounding keeps levels beside the norm from being told
                apart *= _FARTHER
            if high <= low * (1.0 + 3.0 * apart):
                return NormBounds(low, high, omega, LIFTED, verified=agree(low, high))
            (last, below), inverse = before, 1.0 / max(found.lower_bound, TINY)
            root = level + (1.0 - inverse) * (level - last) / (inverse - below) if inverse != below else _FAR * level
            before = (level, inverse)
            if not low < root < high:
                root = (low * high) ** 0.5 if 0.0 < low < high < inf else _FAR * low or high / _FAR
            across = 1.0 - apart if high - root < root - low else 1.0 + apart
            level = min(max(root * across, low * (1.0 + apart)), high * (1.0 - apart))
        return NormBounds(low, high, omega, NOT_TOLD)
