"""The largest gain of a sampled loop in continuous time, between samples included: its L2-induced norm.

Signals of continuous time are taken one sample at a time (lifting; Bamieh & Pearson 1992, IEEE Transactions on Automatic
Control 37).  A level is above the norm exactly if a discrete system that depends on the level has an H-infinity norm below
one.  That system is the solution over a sample of ``x' = A x + B w``, ``p' = -A^T p - C^T z`` under the worst ``w``, kept as
``x(h) = Phi x(0) + W p(h)``, ``p(0) = Phi^T p(h) + X x(0)``: of a step so short that nothing can go wrong, then doubled,
where ``W X`` stays below one exactly if the level is above what can be gained within the step.  Nothing grows in it, however
fast the poles are.

The lower bound is found apart from that: disturbances that run along straight lines in parts of a sample, and turn by an
angle from sample to sample, leave outputs whose energy is a Gramian.  Whatever the number of parts, the gain is reached.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial, reduce
from math import inf
from typing import TYPE_CHECKING

import numpy as np
from scipy import linalg

from boomctl.analysis.norm import NormBounds, agree, matrices_norm
from boomctl.arrays import Array, blocks
from boomctl.checks import names
from boomctl.lti.frequency import BEYOND, SEARCHED, highest_peak, resonance_grid
from boomctl.lti.modal import sides
from boomctl.lti.sampled import Held, time_of_loop, whole_samples
from boomctl.lti.system import Lti, controller_of, lower_lft, of
from boomctl.threads import one_blas_thread

if TYPE_CHECKING:
    import control

    from boomctl.structure.model import SecondOrderModel

LIFTED = "levels of the lifted loop, and disturbances straight in parts of a sample"  # how both bounds are found
NOT_TOLD = "no level above the gain reached could be proved"  # no upper bound
NOT_STABLE = "a pole on or outside the unit circle"  # infinite
_SMALL = 0.5  # size of a first step times its Hamiltonian matrix, whose series then has all digits after 14 terms
_TERMS = 14  # of that series: 0.5^15/15! is below rounding
_SHORT = 0.25  # of a level, that can be gained at most within the first step: far from any limit (a choice)
_DOUBLINGS = 60  # of the first step at most: more is a mistake of unit (a choice)
_SLOWEST = 1e-9  # Share of the sampling rate below which a pole is at rest (a choice).
_LOWEST = 0.1  # Likewise, below which the search begins at least (a choice).
_ABOVE = 4e-6  # Above the gain reached, at which a level is proved: norms are certified to 1e-5.
_FAR_ABOVE = (3e-5, 1e-4, 1e-3)  # Likewise, where more parts of a sample would be needed than are taken.
_MOVES = 4  # To frequencies at which the loop of a level is higher; one or two do.
_WANTED = 1e-6  # Share by which more parts raise the gain at most where no more are taken (a choice).
# Of a sample, in the order tried: what is lost falls with their fourth power, and vibrations that are faster show in more.
_PARTS = (4, 16, 64, 192)


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
        A gain that sinusoids reach, a level that is proved, and the frequency of the former up to whole sampling rates
        [rad/s].  Infinite if the loop is not stable.

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
        L = _root(self.W)
        inner = np.eye(L.shape[1]) - L.T @ other.X @ L
        factor = linalg.cho_factor(0.5 * (inner + inner.T))
        # x1 = (I - W1 X2)^-1 (Phi1 x + W1 Phi2^T p), with (I - W1 X2)^-1 = I + L inner^-1 L^T X2
        spread = L @ linalg.cho_solve(factor, L.T)
        reach = self.Phi + spread @ (other.X @ self.Phi)
        W = other.W + other.Phi @ spread @ other.Phi.T
        X = self.X + self.Phi.T @ (other.X + other.X @ spread @ other.X) @ self.Phi
        return _Step(other.Phi @ reach, 0.5 * (W + W.T), 0.5 * (X + X.T))


def _root(matrix: Array) -> Array:
    """Return ``L`` with ``L L^T`` the positive semidefinite matrix given."""
    values, vectors = linalg.eigh(matrix)
    return vectors * np.sqrt(np.maximum(values, 0.0))


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
    short = np.ldexp(H * duration, -count)
    term = E = np.eye(2 * n)
    for k in range(1, _TERMS + 1):
        term = term @ short / k
        E = E + term
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
    plant : Lti
        The plant in continuous time, balanced: its last inputs are the controls, its last outputs are read.
    controller : Lti
    parts : tuple of (float, Lti)
        The one or two parts of a sample between changes of the controls: how long each is [s], and the plant in it, from
        disturbances to what is shown.  Its states are the plant's, and the controls before and after they change, of which
        one acts.
    queue : Lti
        The plant from sample to sample.
    from_states, from_given : ndarray
        The plant's state at a sample, its controls before and after they change: of all states, and of what is given.
    at_samples : Lti
        The closed loop from sample to sample.
    """

    plant: Lti
    controller: Lti
    parts: tuple[tuple[float, Lti], ...]
    queue: Lti
    from_states: Array
    from_given: Array
    at_samples: Lti

    @classmethod
    def of(cls, P: Lti, K: Lti, delay: float) -> "SampledLoop":
        dt, n, m = K.dt, len(P.A), len(K.C)
        late, nw, nz = whole_samples(delay, dt), P.B.shape[1] - m, len(P.C) - K.B.shape[1]
        acting = range(nw, nw + m)
        held = Held.of(P, acting, [late] * m)
        queue = held.sampled(dt)
        given = np.vstack([np.zeros((n + m, m)), held.direct[nw:, nw:]])
        states = np.vstack([np.eye(n, len(queue.A)), held.before[nw:], held.after[nw:]])
        closed = lower_lft(queue.between(acting, range(nz, len(P.C))), K)
        parts = []
        for duration, at in ((late[1], slice(n, n + m)), (dt - late[1], slice(n + m, n + 2 * m))):
            if duration > 0.0:
                A, C = np.zeros((n + 2 * m, n + 2 * m)), np.zeros((nz, n + 2 * m))
                A[:n, :n], A[:n, at], C[:, :n], C[:, at] = P.A, P.B[:, nw:], P.C[:nz], P.D[:nz, nw:]
                B = np.vstack([P.B[:, :nw], np.zeros((2 * m, nw))])
                parts.append((duration, Lti(A, B, C, P.D[:nz, :nw])))
        return cls(P, K, tuple(parts), queue, states, given, closed)

    def _closed(self, A: Array, B: Array, entering: Array, leaving: Array) -> Lti:
        """Return the loop from sample to sample, with other matrices of the queue, and other signals.

        ``entering`` are the columns by which they move the plant's state, ``leaving`` the rows by which they are read off it
        and off its controls before and after these change.
        """
        K, (n, inputs) = self.controller, entering.shape
        read = slice(-K.B.shape[1], None)
        driving = np.vstack([entering, np.zeros((len(A) - n, inputs))])
        C = np.vstack([leaving @ self.from_states, self.queue.C[read]])
        given = np.vstack([leaving @ self.from_given, self.queue.D[read, -len(K.C) :]])
        D = np.hstack([np.zeros((len(C), inputs)), given])
        return lower_lft(Lti(A, np.hstack([driving, B]), C, D, dt=K.dt), replace(K, state_labels=()))

    def of_level(self, level: float) -> NormBounds:
        """Return the norm of the loop of a level, which is below one exactly if the level is above that of this loop.

        Its states are those of ``at_samples``.  Signals are in units in which the level is one.  Where the level can be
        gained within a sample there is no such loop; below the norm it need not be stable.
        """
        n, unstable = len(self.plant.A), NormBounds(inf, inf, 0.0, NOT_STABLE, verified=True)
        try:
            total = reduce(_Step.then, [_step(part, duration, level) for duration, part in self.parts])
        except linalg.LinAlgError:  # reached within a sample
            return unstable
        A, B = self.queue.A.copy(), self.queue.B[:, -len(self.controller.C) :].copy()
        A[:n], B[:n] = total.Phi[:n] @ self.from_states, total.Phi[:n] @ self.from_given
        result = self._closed(A, B, _root(total.W)[:n], _root(total.X).T)
        is_stable = (sides(result.poles, self.controller.dt) < 0).all()
        return matrices_norm(result.balanced()) if is_stable else unstable

    def norm(self) -> NormBounds:
        """Return the norm between two bounds: the largest gain that is reached, and a level just above it that is not."""
        rates, top = self.at_samples.rates, self.at_samples.nyquist
        rates = rates[(np.abs(rates) <= top) & (np.abs(rates) > _SLOWEST * top)]
        low = min(np.abs(rates).min(initial=top), _LOWEST * top) / BEYOND
        grid = resonance_grid(rates[rates.imag > 0.0], low, top, points=SEARCHED, also=[0.0])
        lower, omega, lifted = 0.0, 0.0, cache(self.lifted)
        for parts in _PARTS[:2]:
            _, at = highest_peak(partial(_gain, *lifted(parts)), grid)
            for _ in range(_MOVES):
                lower, omega = max((lower, omega), (_reached(lifted, at), at))
                if lower == 0.0:
                    return NormBounds(0.0, 0.0, 0.0, "no disturbance shows", verified=True)
                result, upper = self.of_level(lower * (1.0 + _ABOVE)), lower * (1.0 + _ABOVE)
                if result.upper_bound < 1.0:
                    return NormBounds(lower, upper, omega, LIFTED, verified=result.verified and agree(lower, upper))
                if not np.isfinite(result.lower_bound):
                    break
                at = result.peak_omega
        for above in _FAR_ABOVE:
            if self.of_level(lower * (1.0 + above)).upper_bound < 1.0:
                return NormBounds(lower, lower * (1.0 + above), omega, LIFTED)
        return NormBounds(lower, inf, omega, NOT_TOLD)

    def lifted(self, parts: int) -> tuple[Lti, Array]:
        """Return the loop for disturbances that are straight in each part of a sample, and the energy of its outputs.

        In a part the disturbances are ``c + sqrt(3) s d``, ``s`` from -1 to 1, of the energy ``|c|^2 + |d|^2`` times its
        length.  The loop leads from all ``c`` and ``d`` to what there is at the sample; the energy is a form in both.
        """
        m, n, (ends, nw) = len(self.controller.C), len(self.plant.A), self.parts[0][1].B.shape
        counts = [int(np.ceil(parts * duration / self.controller.dt)) for duration, _ in self.parts]
        size, own = ends + 2 * nw * sum(counts), ends
        # of what there is at the sample, and all parts' c, d
        reach, energy = np.eye(ends, size), np.zeros((size, size))
        none, unit = np.zeros((nw, ends)), np.eye(nw)
        for (duration, part), count in zip(self.parts, counts, strict=True):
            h = duration / count
            # the states of the part, the disturbance, and its slope; these at the beginning, of c and d
            F = blocks([[part.A, part.B, none.T], [none, 0.0 * unit, unit / h], [none, 0.0 * unit, 0.0 * unit]])
            moved, gramian = _moved_and_energy(F, np.hstack([part.C, part.D, 0.0 * part.D]), h)
            begun = linalg.block_diag(np.eye(ends), np.kron([[1.0, -(3.0**0.5)], [0.0, 2.0 * 3.0**0.5]], unit) / h**0.5)
            moved, gramian = moved[:ends] @ begun, begun.T @ gramian @ begun
            for _ in range(count):
                here = np.vstack([reach, np.eye(2 * nw, size, own)])
                energy += here.T @ gramian @ here
                reach, own = moved @ here, own + 2 * nw
        closed = self._closed(self.queue.A, self.queue.B[:, -m:], reach[:n, ends:], np.eye(ends))
        return closed.balanced(), energy


def _gain(lifted: Lti, energy: Array, omega: Array) -> Array:
    """Return the largest gains of disturbances that turn by ``omega dt`` from sample to sample."""
    start, size = lifted.response(omega, quiet=True).transpose(2, 0, 1), lifted.B.shape[1]
    whole = np.concatenate([start, np.broadcast_to(np.eye(size), (len(omega), size, size))], axis=1)
    values = np.linalg.eigvalsh(whole.conj().swapaxes(1, 2) @ energy @ whole)[:, -1]
    return np.sqrt(np.maximum(values, 0.0))


def _reached(lifted: Callable[[int], tuple[Lti, Array]], omega: float) -> float:
    """Return the largest gain that is reached at a frequency."""
    best = 0.0
    for parts in _PARTS:
        before, best = best, max(best, float(_gain(*lifted(parts), np.array([omega]))[0]))
        if best <= before * (1.0 + _WANTED):
            break
    return best


def _moved_and_energy(F: Array, C: Array, duration: float) -> tuple[Array, Array]:
    """Return ``exp(F h)`` and the integral of ``exp(F^T t) C^T C exp(F t)`` over ``h``: of a short step, then doubled."""
    n = len(F)
    count = max(0, int(np.ceil(np.log2(max(float(np.linalg.norm(F, 2)) * duration / _SMALL, 1.0)))))
    upper = linalg.expm(np.ldexp(blocks([[-F.T, C.T @ C], [np.zeros((n, n)), F]]) * duration, -count))
    moved = upper[n:, n:]
    energy = moved.T @ upper[:n, n:]
    for _ in range(count):
        energy, moved = energy + moved.T @ energy @ moved, moved @ moved
    return moved, 0.5 * (energy + energy.T)
