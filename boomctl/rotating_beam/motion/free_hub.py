"""Motion under a torque: consecutive windows, each solved by sweeps in two orders whose difference is the error.

The two orders are integrated separately from t = 0, so that their difference is the global error of the lower order; the
motion of the higher order is returned. A fast mode follows the slow modes without being resolved. The effect of its free
vibration on the slow modes is bounded, and if the bound is too large the steps are shortened to resolve the mode.
"""

from dataclasses import dataclass, field
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.polynomial import legendre

from boomctl.arrays import Array
from boomctl.gauss import gauss_method
from boomctl.lti.rounding import ALIKE, COMPUTED, SUMMED
from boomctl.rotating_beam.drive import even_times, polynomial_errors
from boomctl.rotating_beam.modal.equations import FreeHubForm
from boomctl.rotating_beam.motion.free_modes import FreeModes, free_modes
from boomctl.rotating_beam.motion.oscillators import FAST, coordinates, flow
from boomctl.rotating_beam.motion.scene import Scene
from boomctl.rotating_beam.motion.sweeps import Swept, settle
from boomctl.rotating_beam.motion.trajectory import FreeTrajectory, WindowMotion

STEPS = 64  # Steps of a window; with 48 a torque on SFOAM with five modes takes up to twice as long.
_MOST_STEPS = 256  # Most steps of a window if breakpoints are equally spaced: it takes half the time of four windows.
STAGES = 10, 12  # Nodes of a step in the two orders, 20 and 24; 8 and 10 take up to twice as long.

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
_RELAXED = 8  # Windows after which steps that are short because of a fast mode may become longer again.
_SMALLEST = 1e-6  # Shortest window relative to the full duration, for sweeps that do not converge.
_MOST_WINDOWS = 600  # Most windows of a motion: as many steps as plain collocation may take, which is then faster.
# Further windows for every window whose steps are a radian of the lowest mode, and for every breakpoint.
_MORE_WINDOWS = 4.0
_RESOLVED = 4.0  # Ratio of the windows that resolve a fast axial mode to the windows at which it counts as slow.
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
    needed : float
        Length of a step at which the fast mode of the largest effect is resolved, s.
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
    needed: float
    states: Array


@dataclass(eq=False)
class _Run:
    """Progress of a motion; states in coordinates (r, x), both orders, 2 x 2 x (1 + n): coordinates, then rates.

    Attributes
    ----------
    form : FreeHubForm
    scene : Scene
    corners : ndarray
        Times at which the torque is not smooth, s; ascending, > 0, the last is the end.
    steps : int
        Number of steps of a window.
    states : ndarray
    length : float
        Length of the next window, s, if no breakpoint comes before.
    time : float
    most : float
        Longest step that resolves the fast modes to be resolved, s.
    peaks, errors, vibration : ndarray
        Largest values over the windows so far.
    windows : list of WindowMotion
    """

    form: FreeHubForm
    scene: Scene
    corners: Array
    steps: int
    states: Array
    length: float
    time: float = 0.0
    most: float = np.inf
    peaks: Array = field(default_factory=lambda: np.zeros(2))
    errors: Array = field(default_factory=lambda: np.zeros(3))
    vibration: Array = field(default_factory=lambda: np.zeros(2))
    windows: list[WindowMotion] = field(default_factory=list)

    def go_on(self) -> bool:
        """Solve a window, and accept or shorten it; return False if the motion needs too many windows."""
        length, end = self._next_length(), self.scene.end
        window = _swept(self, length)
        if window is None or not np.isfinite(window.errors).all():
            self.length = 0.5 * length
            return length >= _SMALLEST * end
        # an earlier difference also changes by nonlinear terms; it is no new error if the total has not grown
        grown = np.minimum(window.added, np.maximum(window.errors - self.errors, 0.0))
        grown = np.array([grown[0], grown[1:].max()]) + window.between
        excess = float((grown / self.addable(window.peaks, length)).max())
        factor = float(np.clip(_CAUTION * max(excess, np.finfo(float).tiny) ** (-1.0 / _ORDER), *_GROWTH))
        if excess > 1.0:
            self.length = min(factor, _CAUTION) * length
            return True
        most_windows = _MOST_WINDOWS + _MORE_WINDOWS * (
            end * np.sqrt(self.form.softest) / self.steps + self.corners.size
        )
        if (window.vibration > _VIBRATION * self.allowed(window.peaks)).any():
            self.most = window.needed
            return _RESOLVED * (end - self.time) <= most_windows * self.steps * window.needed
        cut = length < _CAUTION * self.length  # by a breakpoint, which does not affect the windows after it
        following = length * min(factor, max(_MANY_SWEEPS / window.sweeps, 0.5))
        self.length = max(following, self.length) if cut else following
        self.windows.append(window.motion)
        self.time, self.states = self.time + length, window.states
        corner = float(self.corners[int(np.argmin(np.abs(self.corners - self.time)))])
        if (
            abs(corner - self.time) <= ALIKE * length
        ):  # a breakpoint may have excited a fast mode: longer steps are tested again
            self.time, self.most = corner, np.inf
        elif len(self.windows) % _RELAXED == 0:
            self.most *= 2.0
        self.peaks = np.maximum(self.peaks, window.peaks)
        self.errors = np.maximum(self.errors, window.errors)
        self.vibration = np.maximum(self.vibration, window.vibration)
        return len(self.windows) < most_windows

    def _next_length(self) -> float:
        """Return the length of the next window, s: it ends at a breakpoint, or has steps that end at all breakpoints."""
        longest = _DECAYED / self.form.decay if self.form.decay else np.inf
        length, left = min(self.length, longest, self.steps * self.most), self.corners - self.time
        left = left[left > SUMMED * self.scene.end]
        gap = left[0]
        if length < 2.0 * gap:
            # relative difference below which intervals between breakpoints count as equal: rounding of their ends
            return float(gap / np.ceil(gap / length * (1.0 - ALIKE)))
        count = min(_even(left[: self.steps]), int(length / gap * (1.0 + ALIKE)))
        return float(left[next(item for item in range(count, 0, -1) if self.steps % item == 0) - 1])

    def allowed(self, peaks: Array) -> Array:
        """Return the allowed errors for the largest values so far, m."""
        return self.scene.atol + self.scene.rtol * np.maximum(self.peaks, peaks) + np.finfo(float).tiny

    def addable(self, peaks: Array, length: float) -> Array:
        """Return the error that a window of a length [s] may add, m."""
        return _LOCAL * max(_LEAST_LOCAL, length / self.scene.end) * self.allowed(peaks)

    def torque(self, h: float, stages: int) -> Array:
        """Return the torque at the nodes of the next window with steps of a length [s], m s."""
        nodes = (np.arange(self.steps)[:, None] + gauss_method(stages).nodes).ravel()
        return self.scene.problem.drive(self.time + h * nodes)


def free_motion(form: FreeHubForm, scene: Scene, corners: Array) -> tuple[FreeTrajectory, float] | None:
    """Return a motion and the error of its free end [m]; None if the tolerance is not reached.

    Parameters
    ----------
    form : FreeHubForm
    scene : Scene
    corners : ndarray
        Times at which the torque is not smooth, s; ascending, > 0, the last is the end.
    """
    states = np.empty((2, form.lean.size + 1))
    for state, item in zip(states, scene.start, strict=True):
        state[1:] = np.linalg.solve(form.to_q, item[1:])
        state[0] = (item[0] - form.lean @ state[1:]) * np.sqrt(form.inertia)
    # if breakpoints are equally spaced, long windows whose steps end at all of them
    count = corners.size if _even(corners) == corners.size else 1
    within, rest = divmod(count, -(-count // _MOST_STEPS))
    steps = STEPS if rest else within * max(1, STEPS // within)
    length = _FIRST_PHASE * max(scene.rtol, COMPUTED) ** (1.0 / _ORDER) * steps / np.sqrt(form.softest)
    run = _Run(form, scene, corners, steps, np.stack([states, states]), length)
    # relative to the full duration: a breakpoint this close counts as reached
    while scene.end - run.time > SUMMED * scene.end:
        if not run.go_on():
            return None
    allowed = run.allowed(run.peaks)
    errors = run.errors[:2] + run.vibration + np.where(run.peaks > 0.0, _SETTLED * _LOCAL * allowed, 0.0)
    return (FreeTrajectory(form, tuple(run.windows)), float(errors[0])) if (errors <= allowed).all() else None


def _even(corners: Array) -> int:
    """Return the number of breakpoints [s] that are equally spaced from 0 on, to rounding error."""
    uneven = np.abs(corners - corners[0] * np.arange(1, corners.size + 1)) > ALIKE * corners[0]
    return int(np.argmax(uneven)) if uneven.any() else corners.size


def _weights(form: FreeHubForm, modes: FreeModes, run: _Run) -> _Weights:
    rows = run.scene.tip_rows @ form.to_q @ modes.shapes
    rows = np.concatenate([np.zeros((len(rows), 1)), rows], axis=1)
    hub = run.scene.radius * modes.push
    sizes = np.stack([np.abs(rows).max(axis=0), np.abs(hub)]) / modes.rates.imag
    return _Weights(rows, hub, sizes, hub * (run.scene.end - run.time))


def _swept(run: _Run, length: float) -> _Window | None:
    """Return a window of a length [s], solved in both orders; None if the sweeps do not converge."""
    (low, high), h, form = STAGES, length / run.steps, run.form
    torque = run.torque(h, low)
    impulses = torque.reshape(-1, low) @ gauss_method(low).weights * h
    speeds = run.states[1, 1, 0] / np.sqrt(form.inertia) + np.cumsum(impulses) / form.inertia  # of a rigid beam
    modes = free_modes(form, float(np.sqrt(np.mean(speeds**2))))
    weights, states = _weights(form, modes, run), run.states.copy()
    states[..., 1:] = states[..., 1:] @ modes.shapes
    starts = [rate - modes.rates.conj() * z for z, rate in states]
    moved = flow(modes.rates, h, run.steps, low)
    force = (modes.push[:, None] * torque).reshape(modes.push.size, run.steps, low)
    peaks = weights.peaks(moved.at_nodes(force, moved.states(force, starts[0]))[0])
    remaining = np.maximum(_SETTLED * run.addable(peaks, length), COMPUTED * peaks)
    watched = weights.rows / remaining[0], weights.speed[None] / remaining[1]
    coarse = settle(modes, moved, starts[0], torque, watched, force)
    if coarse is None:
        return None
    moved = flow(modes.rates, h, run.steps, high)
    force = coarse.force @ _interpolation(low, tuple(gauss_method(high).nodes)).T
    fine = settle(modes, moved, starts[1], run.torque(h, high), watched, force)
    if fine is None:
        return None
    errors, added = _errors(weights, coarse, fine)
    vibration, worst = _vibration_errors(weights, modes, fine)
    ends = np.stack([np.stack(coordinates(modes.rates, item.states[:, -1])) for item in (coarse, fine)])
    ends[..., 1:] = ends[..., 1:] @ modes.shapes.T
    return _Window(
        motion=WindowMotion(run.time, h, modes, moved.fast, fine.force, fine.states),
        sweeps=coarse.sweeps,
        peaks=weights.peaks(fine.z),
        errors=errors,
        added=added,
        between=_torque_errors(weights, run, fine),
        vibration=vibration,
        needed=_CAUTION * FAST / float(modes.rates.imag[1 + worst]),
        states=ends,
    )


def _torque_errors(weights: _Weights, run: _Run, fine: Swept) -> Array:
    """Return the effect of a user's torque less the polynomials through its nodes, from samples near the ends of steps; 2.

    Samples at equally spaced times are included: a pulse longer than their spacing is detected.
    """
    if not run.scene.user_defined:
        return np.zeros(2)
    h, positions, times = fine.flow.h, np.array([_INSIDE, 1.0 - _INSIDE]), even_times(run.scene.end)
    nodes, begin = fine.torque.reshape(run.steps, -1), run.time + h * np.arange(run.steps)
    values = run.scene.problem.drive(begin[:, None] + h * positions)
    error = np.abs(values - nodes @ _interpolation(nodes.shape[1], tuple(positions)).T).max(axis=1)
    gap = times[1]
    times = times[(times >= begin[0]) & (times <= begin[-1] + h)]
    result = run.scene.problem.drive(times)
    between, _ = polynomial_errors(nodes, begin, np.full(run.steps, h), times, result)
    size = max(np.abs(values).max(), np.abs(result).max(initial=0.0))
    error[error <= COMPUTED * size] = 0.0
    between[between <= SUMMED * size] = 0.0
    push = weights.hub / run.scene.radius
    moved = np.array([weights.sizes[0, 1:] @ np.abs(push[1:]), weights.speed[0] * push[0]])
    return max(h * error.sum(), gap * between.sum()) * moved


@lru_cache(maxsize=4)
def _interpolation(stages: int, positions: tuple[float, ...]) -> Array:
    """Return the matrix from values at the nodes to values of their polynomial at other positions of a step."""
    return legendre.legvander(2.0 * np.array(positions) - 1.0, stages - 1) @ gauss_method(stages).terms


def _errors(weights: _Weights, coarse: Swept, fine: Swept) -> tuple[Array, Array]:
    """Return the differences of the orders, in total and arising in the window: see `_Window`."""
    total: Array = fine.states - coarse.states
    own = np.empty_like(total)
    own[1:] = total[1:] - fine.flow.turns * total[1:, :1]
    own[0] = total[0] - total[0, 0] - 1j * fine.flow.h * np.arange(total.shape[1]) * total[0, 0].real
    result = []
    for item in (total, own):
        size = np.abs(item)
        size[0] = np.abs(item[0].imag)
        turning = weights.speed[0] * np.abs(item[0].real.mean())
        result.append(np.append((weights.sizes @ size).max(axis=1), turning))
    return result[0], result[1]


def _vibration_errors(weights: _Weights, modes: FreeModes, fine: Swept) -> tuple[Array, int]:
    """Bound the effect of fast modes' vibrations on the watched displacements, 2, and find the mode of largest effect.

    A vibration shifts its own phase by the nonlinear terms of its equation, and acts on the hub and the other modes by
    coupling terms; these forces oscillate with the vibration, so that their impulse stays bounded.
    """
    if not fine.flow.fast.any():
        return np.zeros(2), 0
    x, v, omega = fine.z[1:], fine.rate[1:], modes.rates.imag[1:]
    rate = np.abs(fine.flow.vibrations(fine.force, fine.states)).max(axis=1)
    speed = float(np.abs(modes.push @ fine.rate).max())
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
    shift = np.minimum(2.0, 0.5 * own / omega * (fine.flow.h * fine.force.shape[1]))
    others = 2.0 * speed * gyro + square * slope / omega + np.abs(modes.damping)
    to_tip = weights.sizes[0, 1:] @ others + (weights.sizes[0, 1:] @ pushed) * varies
    to_hub = weights.speed[0] * modes.push[0] * varies
    both = (weights.sizes[:, 1:] * shift + np.stack([to_tip, to_hub]) / omega) * rate
    whole = both.sum(axis=1)
    return whole, int(np.argmax((both / (whole + np.finfo(float).tiny)[:, None]).sum(axis=0)))
