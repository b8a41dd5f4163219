"""Motion under a torque: consecutive windows, each solved by sweeps in two orders whose difference is the error.

The two orders, forces of degree 11 and 9 on each step, are both integrated from t = 0, so that their difference is the
global error of the lower order; the motion of the higher order is returned. A fast mode follows the slow modes without being
resolved. The effect of its free vibration on the slow modes is bounded, and if the bound is too large the steps are shortened
to resolve the mode.
"""

from bisect import bisect_left
from dataclasses import dataclass, field
from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.polynomial import legendre

from boomctl.arrays import Array
from boomctl.gauss import gauss_method
from boomctl.lti.rounding import ALIKE, COMPUTED, SUMMED
from boomctl.rotating_beam.jumps import even_times, polynomial_errors
from boomctl.rotating_beam.modal.equations import FreeHubForm
from boomctl.rotating_beam.motion.free_modes import FreeModes, free_modes
from boomctl.rotating_beam.motion.oscillators import FAST, Flow, coordinates, flow
from boomctl.rotating_beam.motion.simulation import Simulation
from boomctl.rotating_beam.motion.sweeps import Swept, settle, swept
from boomctl.rotating_beam.motion.trajectory import FreeTrajectory, WindowMotion

STEPS = 96  # Most steps of a window; with 80 a torque on SFOAM with five modes takes up to 1.2 times as long.
_FEWEST = 24  # Fewest steps of a window: less work saves no time, and shorter steps resolve more modes.
_MOST_STEPS = 256  # Most steps of a window with so many breakpoints: it takes half the time of four windows.
STAGES = 12  # Nodes of a step; with two fewer a motion takes up to twice as long.

# Phase of the lowest mode in a step of the first window at a tolerance of 1; the error determines the next steps.  It falls
# with the tolerance as the window lengths do.
_FIRST_PHASE = 6.0
_SETTLED = 0.2  # Fraction of the error allowed in a window, allotted to its sweeps.
_LOCAL = 0.3  # Fraction of the allowed error, allotted to all windows together.
_LEAST_LOCAL = 0.05  # Fraction of this, allotted to the shortest window.
_VIBRATION = 0.3  # Fraction of the allowed error, allotted to the vibrations of fast modes.
_ORDER = 12.0  # Order of the error in the window's length: below the 20 of smooth forces, to be conservative.
_CAUTION = 0.9  # Factor on the predicted length.
_GROWTH = 0.2, 2.0  # Bounds on the ratio of the lengths of consecutive windows.
_MANY_SWEEPS = 25  # Sweeps above which a window is not lengthened: two windows of half the length then take fewer.
_RELAXED = 8  # Windows after which steps that are short because of a fast mode are tested again.
_SMALLEST = 1e-6  # Shortest window relative to the full duration, for sweeps that do not converge.
_MOST_WINDOWS = 600  # Most windows of a motion: as many steps as plain collocation may take, which is then faster.
# Further windows for every window whose steps are a radian of the lowest mode, and for every breakpoint.
_MORE_WINDOWS = 4.0
_RESOLVED = 4.0  # Ratio of the windows that resolve a fast axial mode to the windows at which it counts as slow.
_RESOLVING = 0.75  # Phase of a mode in the steps that resolve it, over `FAST`: nearer to 1 its forces are not accurate.
_DECAYED = 300.0  # Largest decay rate times length of a window: its exponential and the inverse are finite.
_INSIDE = 1e-4  # Distance to the ends of a step, over the step, at which a torque is sampled in addition to the nodes.


class _Weights(NamedTuple):
    """Watched displacements as functions of modal states: of the free end, and hub angle times its radius.

    Attributes
    ----------
    rows : ndarray, r x (1 + n)
        Displacements over modal coordinates.
    hub : ndarray, 1 + n
        Hub angle times radius over modal coordinates.
    sizes : ndarray, 2 x (1 + n)
        Largest value of each for a state of modulus 1, m.
    speed : ndarray, 1 + n
        Change of hub angle times radius until the end over modal rates, s m.
    """

    rows: Array
    hub: Array
    sizes: Array
    speed: Array

    def peaks(self, z: Array) -> Array:
        """Return the largest value of each at the nodes, 2."""
        return np.array([np.abs(self.rows @ z).max(), np.abs(self.hub @ z).max()])


class _Window(NamedTuple):
    """Window solved in both orders.

    Attributes
    ----------
    motion : WindowMotion
    sweeps : int
    peaks : ndarray, 2
        Largest displacement and hub angle times radius, m.
    errors, added : ndarray, 3
        Difference of the orders in these and in the hub's mean speed, as hub angle times radius at the end, m; and the
        difference that arises in the window, without the part propagated from its start by the linear motion.
    between, vibration : ndarray, 2
        Error bounds for a user's torque between the nodes, and for the vibrations of fast modes, m.
    states : ndarray, 2 x 2 x (1 + n)
        At the window's end, as in `_Run`.
    """

    motion: WindowMotion
    sweeps: int
    peaks: Array
    errors: Array
    added: Array
    between: Array
    vibration: Array
    states: Array


@dataclass(eq=False)
class _Run:
    """Progress of a motion; states in coordinates (r, x), both orders, 2 x 2 x (1 + n): coordinates, then rates.

    Attributes
    ----------
    form : FreeHubForm
    simulation : Simulation
    corners : ndarray
        Times at which the torque is not smooth, s; ascending, > 0, the last is the end.
    states : ndarray
    h : float
        Length of the next steps, s, if no breakpoint comes before.
    time : float
    most : float
        Longest step that resolves the fast modes to be resolved, s.
    longest : float
        Longest window in which sweeps converge, s.
    peaks, errors, vibration : ndarray
        Largest values over the windows so far.
    windows : list of WindowMotion
    """

    form: FreeHubForm
    simulation: Simulation
    corners: Array
    states: Array
    h: float
    time: float = 0.0
    most: float = np.inf
    longest: float = np.inf
    peaks: Array = field(default_factory=lambda: np.zeros(2))
    errors: Array = field(default_factory=lambda: np.zeros(3))
    vibration: Array = field(default_factory=lambda: np.zeros(2))
    windows: list[WindowMotion] = field(default_factory=list)

    def go_on(self) -> bool:
        """Solve a window, and accept or repeat it; return False if the motion needs too many windows."""
        (length, steps), end = self._next_window(), self.simulation.end
        h, (window, needed) = length / steps, _swept(self, length, steps)
        most_windows = _MOST_WINDOWS + _MORE_WINDOWS * (end * np.sqrt(self.form.softest) / STEPS + self.corners.size)
        if needed < np.inf:
            self.most = needed
            return _RESOLVED * (end - self.time) <= most_windows * STEPS * needed
        if window is None or not np.isfinite(window.errors).all():
            self.longest = 0.5 * length
            return length >= _SMALLEST * end
        # an earlier difference also changes by nonlinear terms; it is no new error if the total has not grown
        grown = np.minimum(window.added, np.maximum(window.errors - self.errors, 0.0))
        grown = np.array([grown[0], grown[1:].max()]) + window.between
        excess = float((grown / self.addable(window.peaks, length)).max())
        factor = float(np.clip(_CAUTION * max(excess, np.finfo(float).tiny) ** (-1.0 / _ORDER), *_GROWTH))
        if excess > 1.0:
            self.h = min(factor, _CAUTION) * h
            return True
        self.h = max(h * factor, self.h) if h < _CAUTION * self.h else h * factor
        following = length * max(_MANY_SWEEPS / window.sweeps, 0.5)
        self.longest = max(following, self.longest) if length < _CAUTION * self.longest else following
        self.windows.append(window.motion)
        self.time, self.states = self.time + length, window.states
        left = self.corners - self.time
        nearest = int(np.argmin(np.abs(left)))
        reached = abs(left[nearest]) <= ALIKE * length
        if reached:
            self.time = float(self.corners[nearest])
        # after a breakpoint a fast mode may vibrate less: if many steps follow, longer ones are tested again
        if len(self.windows) % _RELAXED == 0 or (reached and (left[nearest + 1 :][:1] > STEPS * self.most).any()):
            self.most = np.inf
        self.peaks = np.maximum(self.peaks, window.peaks)
        self.errors = np.maximum(self.errors, window.errors)
        self.vibration = np.maximum(self.vibration, window.vibration)
        return len(self.windows) < most_windows

    def _next_window(self) -> tuple[float, int]:
        """Return the length of the next window, s, and its number of steps, which end at breakpoints in between."""
        left = self.corners - self.time
        left = left[left > SUMMED * self.simulation.end][:_MOST_STEPS]
        h = min(self.h, self.most)
        longest = min(self.longest, _DECAYED / self.form.decay if self.form.decay else np.inf)

        @cache
        def steps(count: int) -> int:
            """Least number of equal steps that end at the first breakpoints; 0 if there are too many."""
            end = left[count - 1]
            if end > longest:
                return 0
            number = np.arange(max(np.ceil(end / h * (1.0 - ALIKE)), _FEWEST), max(STEPS, count) + 1)
            for at in left[:1], left[:count]:  # the first breakpoint excludes most numbers
                position = np.multiply.outer(number, at / end)
                number = number[(np.abs(position - np.rint(position)) <= ALIKE).all(axis=1)]
            return int(number[0]) if number.size else 0

        count = bisect_left(range(1, left.size + 1), True, key=lambda k: not steps(k))
        if count:
            return float(left[count - 1]), steps(count)
        length = float(left[0] / np.ceil(left[0] / min(longest, STEPS * h) * (1.0 - ALIKE)))
        return length, max(int(np.ceil(length / h * (1.0 - ALIKE))), _FEWEST)

    def allowed(self, peaks: Array) -> Array:
        """Return the allowed errors for the largest values so far, m."""
        return self.simulation.atol + self.simulation.rtol * np.maximum(self.peaks, peaks) + np.finfo(float).tiny

    def addable(self, peaks: Array, length: float) -> Array:
        """Return the error that a window of a length [s] may add, m."""
        return _LOCAL * max(_LEAST_LOCAL, length / self.simulation.end) * self.allowed(peaks)


def free_motion(form: FreeHubForm, simulation: Simulation, corners: Array) -> tuple[FreeTrajectory, float] | None:
    """Return a motion and the error of its free end [m]; None if the tolerance is not reached.

    Parameters
    ----------
    form : FreeHubForm
    simulation : Simulation
    corners : ndarray
        Times at which the torque is not smooth, s; ascending, > 0, the last is the end.
    """
    states = np.array(simulation.start)
    states[:, 1:] = np.linalg.solve(form.to_q, states[:, 1:].T).T
    states[:, 0] = (states[:, 0] - states[:, 1:] @ form.lean) * np.sqrt(form.inertia)
    h = _FIRST_PHASE * max(simulation.rtol, COMPUTED) ** (1.0 / _ORDER) / np.sqrt(form.softest)
    run = _Run(form, simulation, corners, np.stack([states, states]), h)
    # relative to the full duration: a breakpoint this close counts as reached
    while simulation.end - run.time > SUMMED * simulation.end:
        if not run.go_on():
            return None
    allowed = run.allowed(run.peaks)
    errors = run.errors[:2] + run.vibration + np.where(run.peaks > 0.0, _SETTLED * _LOCAL * allowed, 0.0)
    return (FreeTrajectory(form, tuple(run.windows)), float(errors[0])) if (errors <= allowed).all() else None


def _weights(form: FreeHubForm, modes: FreeModes, run: _Run) -> _Weights:
    rows = run.simulation.tip_rows @ form.to_q @ modes.shapes
    rows = np.concatenate([np.zeros((len(rows), 1)), rows], axis=1)
    hub = run.simulation.radius * modes.push
    sizes = np.stack([np.abs(rows).max(axis=0), np.abs(hub)]) / modes.rates.imag
    return _Weights(rows, hub, sizes, hub * (run.simulation.end - run.time))


def _swept(run: _Run, length: float, steps: int) -> tuple[_Window | None, float]:
    """Return a window of a length [s], solved in both orders, or None, and the longest step that may be needed instead.

    The window is None if the sweeps do not converge, or fast modes vibrate too much unless such steps [s] resolve them.
    """
    h, form = length / steps, run.form
    torque = run.simulation.problem.drive(run.time + h * (np.arange(steps)[:, None] + gauss_method(STAGES).nodes))
    impulses = torque @ gauss_method(STAGES).weights * h
    speeds = run.states[0, 1, 0] / np.sqrt(form.inertia) + np.cumsum(impulses) / form.inertia  # of a rigid beam
    modes = free_modes(form, float(np.sqrt(np.mean(speeds**2))))
    weights, states = _weights(form, modes, run), run.states.copy()
    states[..., 1:] = states[..., 1:] @ modes.shapes
    start = (states[:, 1] - modes.rates.conj() * states[:, 0]).T
    moved = flow(modes.rates, h, steps, STAGES)
    motion = swept(moved, start, np.multiply.outer(modes.push, torque[None]))
    peaks = weights.peaks(motion.both[0])
    # linear motion shows which modes are excited at first, but for axial modes, which follow the hub's speed
    if not (run.windows or (form.has_axial and states.any())):
        _, needed = _vibration_errors(weights, modes, moved, motion, _VIBRATION * run.allowed(peaks))
        if needed < np.inf:
            return None, needed
    remaining = np.maximum(_SETTLED * run.addable(peaks, length), COMPUTED * peaks)
    watched = np.zeros((len(weights.rows) + 1, 2, weights.speed.size))
    watched[:-1, 0], watched[-1, 1] = weights.rows / remaining[0], weights.speed / remaining[1]
    settled = settle(modes, moved, start, motion, torque.ravel(), watched)
    if settled is None:
        return None, np.inf
    motion, sweeps = settled
    errors, added = _errors(weights, moved, motion.states)
    peaks = weights.peaks(motion.both[0])
    vibration, needed = _vibration_errors(weights, modes, moved, motion, _VIBRATION * run.allowed(peaks))
    ends = np.stack(coordinates(modes.rates, motion.states[..., -1]), axis=1).T.copy()
    ends[..., 1:] = ends[..., 1:] @ modes.shapes.T
    window = _Window(
        motion=WindowMotion(run.time, h, modes, moved.fast, motion.force[:, 0], motion.states[:, 0]),
        sweeps=sweeps,
        peaks=peaks,
        errors=errors,
        added=added,
        between=_torque_errors(weights, run, h, torque),
        vibration=vibration,
        states=ends,
    )
    return window, needed


def _torque_errors(weights: _Weights, run: _Run, h: float, nodes: Array) -> Array:
    """Return the effect of a user's torque less the polynomials through its nodes, from samples near the ends of steps; 2.

    Samples at equally spaced times are included: a pulse longer than their spacing is detected.
    """
    if not run.simulation.user_defined:
        return np.zeros(2)
    positions, times = np.array([_INSIDE, 1.0 - _INSIDE]), even_times(run.simulation.end)
    begin = run.time + h * np.arange(len(nodes))
    values = run.simulation.problem.drive(begin[:, None] + h * positions)
    near_ends = legendre.legvander(2.0 * positions - 1.0, STAGES - 1) @ gauss_method(STAGES).terms
    error = np.abs(values - nodes @ near_ends.T).max(axis=1)
    gap = times[1]
    times = times[(times >= begin[0]) & (times <= begin[-1] + h)]
    result = run.simulation.problem.drive(times)
    between, _ = polynomial_errors(nodes, begin, np.full(len(nodes), h), times, result)
    size = max(np.abs(values).max(), np.abs(result).max(initial=0.0))
    error[error <= COMPUTED * size] = 0.0
    between[between <= SUMMED * size] = 0.0
    push = weights.hub / run.simulation.radius
    moved = np.array([weights.sizes[0, 1:] @ np.abs(push[1:]), weights.speed[0] * push[0]])
    return max(h * error.sum(), gap * between.sum()) * moved


def _errors(weights: _Weights, moved: Flow, states: Array) -> tuple[Array, Array]:
    """Return the differences of the orders, in total and arising in the window: see `_Window`."""
    total: Array = states[:, 0] - states[:, 1]
    own = np.empty_like(total)
    own[1:] = total[1:] - moved.turns[:, 0] * total[1:, :1]
    own[0] = total[0] - total[0, 0] - 1j * moved.h * np.arange(total.shape[1]) * total[0, 0].real
    both: Array = np.stack([total, own])
    size = np.abs(both)
    size[:, 0] = np.abs(both[:, 0].imag)
    turning = weights.speed[0] * np.abs(both[:, 0].real.mean(axis=1))
    whole, new = np.column_stack([(weights.sizes @ size).max(axis=2), turning])
    return whole, new


def _vibration_errors(
    weights: _Weights, modes: FreeModes, moved: Flow, motion: Swept, allowed: Array
) -> tuple[Array, float]:
    """Bound the effect of fast modes' vibrations on the watched displacements, 2, and return the longest step for it, s.

    This step resolves the lowest modes, as many as it takes until the bound for the others is below the allowed one; it is
    infinite if the bound is below it.

    A vibration shifts its own phase by the nonlinear terms of its equation, and acts on the hub and the other modes by
    coupling terms; these forces oscillate with the vibration, so that their impulse stays bounded.
    """
    if not moved.fast.any():
        return np.zeros(2), np.inf
    (z, rates), omega = motion.both, modes.rates.imag[1:]
    x, v = z[1:], rates[1:]
    rate = np.abs(moved.vibrations(motion.force, motion.states)).max(axis=(1, 2))
    speed = float(np.abs(modes.push @ rates).max())
    square = max(speed**2 - modes.square, modes.square)
    pushed, mobility = np.abs(modes.push[1:]), modes.mobility
    bent = modes.slope @ x
    inertia = float(np.abs(np.sum(x * bent, axis=0)).max())
    varies = 2.0 * float(np.abs(np.sum(v * bent, axis=0)).max()) * pushed
    coupling = np.zeros_like(omega)
    if modes.form.has_axial:
        coupling = np.abs(modes.gyro @ x).max(axis=1)
        varies += np.abs(modes.gyro @ v).max(axis=1)
    slope, gyro = np.abs(modes.slope), np.abs(modes.gyro)
    own = square * np.diag(slope) + (omega * pushed) ** 2 * inertia + (omega * coupling) ** 2 * mobility
    own += 4.0 * speed**2 * np.sum(gyro * gyro, axis=1)
    shift = np.minimum(2.0, 0.5 * own / omega * (moved.h * motion.force.shape[2]))
    others = 2.0 * speed * gyro + square * slope / omega + np.abs(modes.damping)
    to_tip = weights.sizes[0, 1:] @ others + (weights.sizes[0, 1:] @ pushed) * varies
    to_hub = weights.speed[0] * modes.push[0] * varies
    both = (weights.sizes[:, 1:] * shift + np.stack([to_tip, to_hub]) / omega) * rate
    above = np.cumsum(both[:, ::-1], axis=1)[:, ::-1]  # from each mode on
    matters = np.flatnonzero((above > allowed[:, None]).any(axis=0))
    return above[:, 0], _RESOLVING * FAST / float(omega[matters[-1]]) if matters.size else np.inf
