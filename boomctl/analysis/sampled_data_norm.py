"""L2-induced norm of a sampled-data loop, intersample behavior included.

Continuous-time signals are lifted to sequences of functions over one sample (Bamieh & Pearson 1992, IEEE Transactions on
Automatic Control 37).  A level is above the norm if and only if a discrete system that depends on the level has an H-infinity
norm below one.  This system is the solution over a sample of ``x' = A x + B w``, ``p' = -A^T p - C^T z`` under the worst
``w``, stored as ``x(h) = Phi x(0) + W p(h)``, ``p(0) = Phi^T p(h) + X x(0)``.  It is computed for a very short step, which is
then doubled; ``W X`` stays below one if and only if the level is above the gain within the step.  The terms remain bounded
for any fast poles.

The lower bound is computed separately: for disturbances that are linear in each part of a sample and rotate by an angle from
sample to sample, the energy of the outputs is a Gramian.  This gain is reached for any number of parts.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial, reduce
from math import inf
from typing import TYPE_CHECKING

import numpy as np
from scipy import linalg

from boomctl.analysis.loops import signals_of
from boomctl.analysis.norm import NormBounds, matrices_norm
from boomctl.arrays import Array, blocks
from boomctl.checks import names
from boomctl.lti.frequency import BEYOND, SEARCHED, highest_peak, resonance_grid
from boomctl.lti.gramians import square_root
from boomctl.lti.modal import sides
from boomctl.lti.rounding import ALIKE, LEVEL
from boomctl.lti.sampled import Held, time_of_loop, whole_samples
from boomctl.lti.system import Lti, controller_of, lower_lft, of, signal_scales
from boomctl.threads import one_blas_thread

if TYPE_CHECKING:
    import control

    from boomctl.structure.model import SecondOrderModel

# Methods of the upper and the lower bound.
LIFTED = "bounds by lifting and by piecewise linear disturbances"
NOT_PROVED = "no level above the gain reached is proved"  # No upper bound.
NOT_STABLE = "a pole on or outside the unit circle"  # Infinite.
_SMALL = 0.5  # Norm of the Hamiltonian matrix times the first step.
_SHORT = 0.25  # Largest gain within the first step, relative to the level.
_DOUBLINGS = 60  # Largest number of doublings of the first step; more indicate an error of units.
_LOWEST = 0.1  # The search begins at this fraction of half the sampling rate, or below if a pole is slower.
_ABOVE = 4e-6  # Relative distance of the level from the gain reached: below CERTIFIED.
# Further distances if the gain is reached only with more parts; such bounds are not verified.
_FAR_ABOVE = (3e-5, 1e-4, 1e-3)
_MOVES = 4  # Largest number of frequencies at which a peak of the level's loop is followed.
_PARTS = (4, 16, 64, 192)  # Numbers of parts of a sample: the error falls with their fourth power.


@one_blas_thread
def sampled_data_norm(
    plant: "SecondOrderModel | control.StateSpace | control.TransferFunction",
    controller: "control.StateSpace | control.TransferFunction",
    inputs: str | Sequence[str] | None = None,
    outputs: str | Sequence[str] | None = None,
    *,
    delay: float = 0.0,
) -> NormBounds:
    """Compute the L2-induced norm of a sampled loop ``u = K y``, intersample behavior included.

    The L2 norm of the outputs, as functions of time, is at most this norm times the L2 norm of the disturbances, for any
    continuous-time disturbances.  ``hinf_norm(feedback_loop(...))`` is the norm for disturbances that are held between
    samples and outputs at the samples.

    Parameters
    ----------
    plant : SecondOrderModel, control.StateSpace or control.TransferFunction
        Plant in continuous time with named signals, or a generalized plant.
    controller : control.StateSpace or control.TransferFunction
        Discrete-time controller with ``u = K y``. Signals are matched by name.
    inputs : str or sequence of str, optional
        Disturbances. If None, all inputs of the plant that the controller does not drive.
    outputs : str or sequence of str, optional
        Outputs of the plant, or control inputs of the plant. If None, all outputs of the plant.
    delay : float, optional
        Computation delay [s].

    Returns
    -------
    NormBounds
        Lower and upper bound, and the frequency of the lower bound modulo the sampling rate [rad/s].  Infinite if the loop is
        not stable.

    Raises
    ------
    TypeError, ValueError
        If a system has an unsupported type, the plant is discrete or the controller continuous, signal names do not match,
        the loop cannot have this delay, or a disturbance acts on a measurement directly, without a filter.

    Examples
    --------
    >>> import boomctl as bc
    >>> import control
    >>> signals = {"inputs": ["load", "force"], "outputs": "position"}
    >>> mass = control.ss([[0.0, 1.0], [0.0, 0.0]], [[0.0, 0.0], [1.0, 1.0]], [[1.0, 0.0]], 0.0, **signals)
    >>> lead = control.ss([[-20.0]], [[1.0]], [[360.0]], -20.0, inputs="position", outputs="force")
    >>> norm = bc.analysis.sampled_data_norm(mass, bc.discretize(lead, 0.05), delay=0.03)
    >>> round(norm.lower_bound, 3), bool(norm.verified)
    (0.904, True)
    """
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
    """Transition of a plant over a step at a level: ``x(h) = Phi x + W p(h)``, ``p = Phi^T p(h) + X x``."""

    Phi: Array
    W: Array
    X: Array

    def then(self, other: "_Step") -> "_Step":
        """Return this step followed by another one.

        Raises
        ------
        LinAlgError
            If the level can be reached within the two steps.
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
    """Return the transition of a system over a duration at a level.

    Raises
    ------
    LinAlgError
        If the level can be reached within the duration.
    """
    A, B, C, D, n = system.A, system.B, system.C, system.D, len(system.A)
    direct = float(np.linalg.norm(D, 2))
    if direct >= level:
        raise linalg.LinAlgError("the feedthrough reaches the level")
    inverse = linalg.inv(np.eye(B.shape[1]) - D.T @ D / level**2)
    moved = A + B @ inverse @ D.T @ C / level**2
    weighed = C + D @ (inverse @ (D.T @ C)) / level**2
    H = blocks([[moved, B @ inverse @ B.T / level], [-C.T @ weighed / level, -moved.T]])
    size = float(np.linalg.norm(H, 2)) * duration
    gain = float(np.linalg.norm(B, 2) * np.linalg.norm(C, 2)) * duration * np.exp(_SMALL)
    ratios = size / _SMALL, gain / (_SHORT * (level - direct))
    count = max(0, *(int(np.ceil(np.log2(max(ratio, 1.0)))) for ratio in ratios))
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
    """Sampled loop: plant between samples, queue of delayed controls, and controller.

    Attributes
    ----------
    controller : Lti
        Discrete-time controller.
    parts : tuple of (float, Lti)
        The one or two intervals of a sample between changes of the controls: duration [s], and plant from the disturbances to
        the outputs of the norm.  The states are those of the plant, and the controls before and after their change, of which
        one set is active.
    queue : Lti
        Plant and queue of controls from sample to sample, from the controls to the measurements.
    from_states, from_controls : ndarray
        Plant state at a sample, and controls before and after their change, as functions of all states and of new controls.
    """

    controller: Lti
    parts: tuple[tuple[float, Lti], ...]
    queue: Lti
    from_states: Array
    from_controls: Array

    @classmethod
    def of(cls, P: Lti, K: Lti, delay: float) -> "SampledLoop":
        dt, n, m, scale = K.dt, len(P.A), len(K.C), signal_scales(P.A, P.B, P.C)
        P = replace(P, A=P.A / scale[:, None] * scale, B=P.B / scale[:, None], C=P.C * scale)
        late, nw, nz = whole_samples(delay, dt), P.B.shape[1] - m, len(P.C) - K.B.shape[1]
        acting = range(nw, nw + m)
        held = Held.of(P, acting, [late] * m)
        queue = held.sampled(dt)
        sent = np.vstack([np.zeros((n + m, m)), held.direct[nw:, nw:]])
        states = np.vstack([np.eye(n, len(queue.A)), held.before[nw:], held.after[nw:]])
        parts = []
        for duration, at in ((late[1], slice(n, n + m)), (dt - late[1], slice(n + m, n + 2 * m))):
            if duration > 0.0:
                A, C = np.zeros((n + 2 * m, n + 2 * m)), np.zeros((nz, n + 2 * m))
                A[:n, :n], A[:n, at], C[:, :n], C[:, at] = P.A, P.B[:, nw:], P.C[:nz], P.D[:nz, nw:]
                B = np.vstack([P.B[:, :nw], np.zeros((2 * m, nw))])
                parts.append((duration, Lti(A, B, C, P.D[:nz, :nw])))
        return cls(replace(K, state_labels=()), tuple(parts), queue.between(acting, range(nz, len(P.C))), states, sent)

    @property
    def at_samples(self) -> Lti:
        """Closed loop from sample to sample."""
        return lower_lft(self.queue, self.controller)

    def of_level(self, level: float) -> NormBounds:
        """Return the norm of the loop of a level, which is below one if and only if the level is above the norm of this loop.

        Its states are those of ``at_samples``.  Signals are in units in which the level is one.  If the level can be reached
        within a sample this loop does not exist; for a level below the norm it may be unstable.
        """
        unstable = NormBounds(inf, inf, 0.0, NOT_STABLE, verified=True)
        try:
            total = reduce(_Step.then, [_step(part, duration, level) for duration, part in self.parts])
        except linalg.LinAlgError:  # reached within a sample
            return unstable
        n, A, B = len(self.from_controls) - 2 * len(self.controller.C), self.queue.A.copy(), self.queue.B.copy()
        A[:n], B[:n] = total.Phi[:n] @ self.from_states, total.Phi[:n] @ self.from_controls
        loop = self._closed(A, B, square_root(total.W), square_root(total.X).T).balanced()
        _ = loop.eigensystem  # also used by the norm
        return matrices_norm(loop) if (sides(loop.poles, loop.dt) < 0).all() else unstable

    def _closed(self, A: Array, B: Array, entering: Array, leaving: Array) -> Lti:
        """Return the loop from sample to sample with other matrices of the queue.

        ``entering`` are columns that change the states of `parts`, ``leaving`` rows that read them at the sample.
        """
        n, inputs = len(self.from_controls) - 2 * len(self.controller.C), entering.shape[1]
        C = np.vstack([leaving @ self.from_states, self.queue.C])
        B = np.hstack([np.pad(entering[:n], ((0, len(A) - n), (0, 0))), B])
        D = np.pad(np.vstack([leaving @ self.from_controls, self.queue.D]), ((0, 0), (inputs, 0)))
        return lower_lft(Lti(A, B, C, D, dt=self.queue.dt), self.controller)

    def norm(self) -> NormBounds:
        """Return the norm between the largest gain that is reached and a level just above it that is not."""
        loop = self.at_samples
        rates, top = loop.rates, loop.nyquist
        rates = rates[(np.abs(rates) <= top) & (np.abs(rates) > ALIKE * top)]
        low = min(np.abs(rates).min(initial=top), _LOWEST * top) / BEYOND
        grid = resonance_grid(rates[rates.imag > 0.0], low, top, points=SEARCHED, also=[0.0])
        lower, omega, lifted = 0.0, 0.0, cache(self.lifted)
        _, at = highest_peak(partial(_gain, *lifted(_PARTS[0])), grid)
        for _ in range(_MOVES):
            lower, omega = max((lower, omega), (_reached(lifted, at), at))
            if lower == 0.0:
                return NormBounds(0.0, 0.0, 0.0, "zero response", verified=True)
            level = lower * (1.0 + _ABOVE)
            norm = self.of_level(level)
            if norm.upper_bound < 1.0:
                return NormBounds(lower, level, omega, LIFTED, verified=norm.verified)
            if not np.isfinite(norm.lower_bound):
                break
            at = norm.peak_omega
        for above in _FAR_ABOVE:
            if self.of_level(lower * (1.0 + above)).upper_bound < 1.0:
                return NormBounds(lower, lower * (1.0 + above), omega, LIFTED)
        return NormBounds(lower, inf, omega, NOT_PROVED)

    def lifted(self, parts: int) -> tuple[Lti, Array]:
        """Return the loop for disturbances that are linear in each part of a sample, and the energy of its outputs.

        In a part the disturbances are ``c + sqrt(3) s d``, ``s`` from -1 to 1, with energy ``|c|^2 + |d|^2`` times its
        duration.  The loop leads from all ``c`` and ``d`` to the states of `parts` at the sample; the energy is a quadratic
        form in both.
        """
        counts = [int(np.ceil(parts * duration / self.controller.dt)) for duration, _ in self.parts]
        ends, nw = self.parts[0][1].B.shape
        size, known = ends + 2 * nw * sum(counts), ends
        # Columns: states at the sample, then c, d of each part.
        reach, energy = np.eye(ends, size), np.zeros((size, size))
        none, unit = np.zeros((nw, ends)), np.eye(nw)
        for (duration, part), count in zip(self.parts, counts, strict=True):
            h = duration / count
            # States of the plant, disturbance and its slope, of which c and d are the start.
            F = blocks([[part.A, part.B, none.T], [none, 0.0 * unit, unit / h], [none, 0.0 * unit, 0.0 * unit]])
            moved, gramian = _transition_and_energy(F, np.hstack([part.C, part.D, 0.0 * part.D]), h)
            start = linalg.block_diag(np.eye(ends), np.kron([[1.0, -(3.0**0.5)], [0.0, 2.0 * 3.0**0.5]], unit) / h**0.5)
            moved, gramian = moved[:ends] @ start, start.T @ gramian @ start
            for _ in range(count):
                here = np.vstack([reach, np.eye(2 * nw, size, known)])
                energy += here.T @ gramian @ here
                reach, known = moved @ here, known + 2 * nw
        return self._closed(self.queue.A, self.queue.B, reach[:, ends:], np.eye(ends)).balanced(), energy


def _gain(lifted: Lti, energy: Array, omega: Array) -> Array:
    """Return the largest gains of disturbances that rotate by ``omega dt`` from sample to sample."""
    start, size = lifted.response(omega, quiet=True).transpose(2, 0, 1), lifted.B.shape[1]
    whole = np.concatenate([start, np.broadcast_to(np.eye(size), (len(omega), size, size))], axis=1)
    values = np.linalg.eigvalsh(whole.conj().swapaxes(1, 2) @ energy @ whole)[:, -1]
    return np.sqrt(np.maximum(values, 0.0))


def _reached(lifted: Callable[[int], tuple[Lti, Array]], omega: float) -> float:
    """Return the largest gain that is reached at a frequency."""
    gain = 0.0
    for parts in _PARTS:
        before, gain = gain, max(gain, float(_gain(*lifted(parts), np.array([omega]))[0]))
        if gain <= before * (1.0 + LEVEL):
            break
    return gain


def _transition_and_energy(F: Array, C: Array, duration: float) -> tuple[Array, Array]:
    """Return ``exp(F h)`` and the integral of ``exp(F^T t) C^T C exp(F t)`` over ``h``, by doubling of a short step."""
    n = len(F)
    count = max(0, int(np.ceil(np.log2(max(float(np.linalg.norm(F, 2)) * duration / _SMALL, 1.0)))))
    upper = linalg.expm(np.ldexp(blocks([[-F.T, C.T @ C], [np.zeros((n, n)), F]]) * duration, -count))
    moved = upper[n:, n:]
    energy = moved.T @ upper[:n, n:]
    for _ in range(count):
        energy, moved = energy + moved.T @ energy @ moved, moved @ moved
    return moved, 0.5 * (energy + energy.T)
