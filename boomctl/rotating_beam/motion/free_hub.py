"""Motion under a torque: windows one after another, each swept in two orders whose difference is the error.

Both orders go their own way from t = 0, so that their difference is the error of the lower one with all that it causes
later; the motion of the higher one is returned. A fast mode follows the slow ones without being resolved; what its own
vibration would do to them is bounded, and where the bound is too large the steps become short enough for that mode.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.polynomial import legendre

from boomctl.arrays import Array
from boomctl.gauss import gauss_method
from boomctl.lti.rounding import ALIKE, SUMMED
from boomctl.rotating_beam.drive import even_instants, off_polynomials
from boomctl.rotating_beam.modal.equations import FreeHubForm
from boomctl.rotating_beam.motion.free_modes import FreeModes, free_modes
from boomctl.rotating_beam.motion.oscillators import FAST, coordinates, flow
from boomctl.rotating_beam.motion.scene import Scene
from boomctl.rotating_beam.motion.sweeps import Swept, settle
from boomctl.rotating_beam.motion.trajectory import FreeTrajectory, Piece

STEPS = 64  # of a window: a choice; 48 take up to twice as long with five modes (measured, a torque on SFOAM)
_MOST_STEPS = 256  # of a window where corners are even: a choice, for one of so many takes half of the time of four
STAGES = 10, 12  # nodes of a step in the two orders, 20 and 24: a choice; 8 and 10 take up to twice as long (measured)

# Of the lowest mode in a step of the first window at a tolerance of one: a choice, the error tells for the others.  It falls
# with the tolerance as lengths do; with 1 at every tolerance loose ones take up to twice as long (measured).
_FIRST_PHASE = 6.0
_SETTLED = 0.2  # of the error that a window may add, for what its sweeps leave
_ROUNDING = 1e-14  # of the largest displacement or torque: less is rounding
_LOCAL = 0.3  # of the allowed error that all windows together may add
_LEAST_LOCAL = 0.05  # part of this that the shortest window may add
_UNSEEN = 0.3  # of the allowed error for what the vibrations of fast modes would do
_ORDER = 12.0  # power of the window's length with which its error goes: less than the 20 of smooth forces, to be safe
_CAUTION = 0.9  # of the length that this promises
_GROWTH = 0.2, 2.0  # bounds of a window's length over that of the one before
_MANY_SWEEPS = 25  # for which a window is long enough: more, and two windows of half the length take fewer (measured)
_RELAXED = 8  # windows after which steps that are short for the sake of a fast mode may become longer again
_SMALLEST = 1e-6  # of the whole time: where the sweeps of shorter windows do not settle either, they are given up
_MOST_WINDOWS = 600  # where a motion is given up: as many steps as plain collocation may take, which then does better
_MORE_WINDOWS = (
    4.0  # more of them for every window whose steps are a radian of the lowest mode, and for every corner: a choice
)
_RESOLVED = 4.0  # times as many windows as it takes to see a fast mode at all, to follow it: measured, axial modes
_DECAYED = 300.0  # decay rate times length of a window at most: its exponential and its inverse are then finite
_SEEN = 1e-12  # of the largest torque: less, at an even instant, is rounding of a polynomial
_INSIDE = 1e-4  # of a step: so near to its ends a torque is looked at for what the nodes have not seen
_TIGHTER = 0.1  # factor of the error allowed in a window when all together have missed the tolerance
_ATTEMPTS = 3  # with ever tighter windows


class _Weights(NamedTuple):
    """What modal states mean for what is watched: displacements of the free end, and hub angle times its radius.

    Attributes
    ----------
    rows : ndarray, r x (1 + n)
        Displacements over modal coordinates.
    hub : ndarray, 1 + n
        Hub angle times radius over modal coordinates.
    sizes : ndarray, 2 x (1 + n)
        Largest value of each that goes with a state of size 1, m.
    speed : ndarray, 1 + n
        What modal rates do to the hub angle times radius by the end, s m.
    """

    rows: Array
    hub: Array
    sizes: Array
    speed: Array

    def peaks(self, z: Array) -> Array:
        """Largest value of each at the nodes, 2."""
        return np.array([np.abs(self.rows @ z).max(), np.abs(self.hub @ z).max()])


class _Window(NamedTuple):
    """A window that was swept in both orders.

    Attributes
    ----------
    piece : Piece
    sweeps : int
    peaks : ndarray, 2
        Of displacements and of hub angle times radius, m.
    errors, added : ndarray, 3
        Difference of the orders in these and in the hub's mean speed, as hub angle times radius at the end, m; and what
        the window has added to it, as the linear motion carries it on.
    hidden, unseen : ndarray, 2
        What a user's torque may have hidden between the nodes, and what fast modes would add, m.
    needed : float
        Length of a step at which the fast mode that would do most is resolved, s.
    states : ndarray, 2 x 2 x (1 + n)
        At the window's end, as in `_Run`.
    """

    piece: Piece
    sweeps: int
    peaks: Array
    errors: Array
    added: Array
    hidden: Array
    unseen: Array
    needed: float
    states: Array


@dataclass(eq=False)
class _Run:
    """How far a motion has come; states in coordinates (r, x), both orders, 2 x 2 x (1 + n): coordinates, then rates.

    Attributes
    ----------
    form : FreeHubForm
    scene : Scene
    corners : ndarray
        Instants at which the torque is not smooth, s; ascending, > 0, the last is the end.
    share : float
        Of the allowed error, for all windows together.
    steps : int
        Of a window.
    states : ndarray
    length : float
        Of the next window, s, if no corner comes before.
    time : float
    most : float
        Longest step at which the fast modes that have to be are resolved, s.
    peaks, errors, unseen : ndarray
        Largest so far of those of the windows.
    pieces : list of Piece
    """

    form: FreeHubForm
    scene: Scene
    corners: Array
    share: float
    steps: int
    states: Array
    length: float
    time: float = 0.0
    most: float = np.inf
    peaks: Array = field(default_factory=lambda: np.zeros(2))
    errors: Array = field(default_factory=lambda: np.zeros(3))
    unseen: Array = field(default_factory=lambda: np.zeros(2))
    pieces: list[Piece] = field(default_factory=list)

    @property
    def done(self) -> bool:
        """Whether the end is reached."""
        # of the whole time: a corner so near ahead is reached already
        return self.scene.end - self.time <= SUMMED * self.scene.end

    def go_on(self) -> bool:
        """Try a window, and take it or make it shorter; False where the motion is to be given up."""
        length, end = self._next_length(), self.scene.end
        window = _swept(self, length)
        if window is None or not np.isfinite(window.errors).all():
            self.length = 0.5 * length
            return length >= _SMALLEST * end
        # a difference of old turns with what is not linear too: that is no new error where the difference has not grown
        grown = np.minimum(window.added, np.maximum(window.errors - self.errors, 0.0))
        grown = np.array([grown[0], grown[1:].max()]) + window.hidden
        excess = float((grown / self.addable(window.peaks, length)).max())
        factor = float(np.clip(_CAUTION * max(excess, np.finfo(float).tiny) ** (-1.0 / _ORDER), *_GROWTH))
        if excess > 1.0:
            self.length = min(factor, _CAUTION) * length
            return True
        most_windows = _MOST_WINDOWS + _MORE_WINDOWS * (
            end * np.sqrt(self.form.softest) / self.steps + self.corners.size
        )
        if (window.unseen > _UNSEEN * self.allowed(window.peaks)).any():
            self.most = window.needed
            return _RESOLVED * (end - self.time) <= most_windows * self.steps * window.needed
        cut = length < _CAUTION * self.length  # by a corner, which says nothing of the windows behind it
        following = length * min(factor, max(_MANY_SWEEPS / window.sweeps, 0.5))
        self.length = max(following, self.length) if cut else following
        self.pieces.append(window.piece)
        self.time, self.states = self.time + length, window.states
        corner = float(self.corners[int(np.argmin(np.abs(self.corners - self.time)))])
        if (
            abs(corner - self.time) <= ALIKE * length
        ):  # what made a fast mode vibrate, perhaps: longer steps are tried anew
            self.time, self.most = corner, np.inf
        elif len(self.pieces) % _RELAXED == 0:
            self.most *= 2.0
        self.peaks = np.maximum(self.peaks, window.peaks)
        self.errors = np.maximum(self.errors, window.errors)
        self.unseen = np.maximum(self.unseen, window.unseen)
        return len(self.pieces) < most_windows

    def _next_length(self) -> float:
        """Length of the next window, s: it ends at a corner, or its steps do at all corners within it."""
        longest = _DECAYED / self.form.decay if self.form.decay else np.inf
        length, left = min(self.length, longest, self.steps * self.most), self.corners - self.time
        left = left[left > SUMMED * self.scene.end]
        gap = left[0]
        if length < 2.0 * gap:
            # relative difference below which intervals between corners count as equal: rounding of their ends
            return float(gap / np.ceil(gap / length * (1.0 - ALIKE)))
        count = min(_even(left[: self.steps]), int(length / gap * (1.0 + ALIKE)))
        return float(left[next(item for item in range(count, 0, -1) if self.steps % item == 0) - 1])

    def allowed(self, peaks: Array) -> Array:
        """Allowed errors at given largest values, m."""
        return self.scene.atol + self.scene.rtol * np.maximum(self.peaks, peaks) + np.finfo(float).tiny

    def addable(self, peaks: Array, length: float) -> Array:
        """What a window of a length [s] may add to the errors, m."""
        return self.share * max(_LEAST_LOCAL, length / self.scene.end) * self.allowed(peaks)

    def torque(self, h: float, stages: int) -> Array:
        """Torque at the nodes of the next window with steps of a length [s], m s."""
        nodes = (np.arange(self.steps)[:, None] + gauss_method(stages).nodes).ravel()
        return self.drive(self.time + h * nodes)

    @property
    def drive(self) -> Callable[[Array], Array]:
        """Torque [N m] of an array of instants [s]."""
        return self.scene.problem.drive


def free_motion(form: FreeHubForm, scene: Scene, corners: Array) -> tuple[FreeTrajectory, float] | None:
    """Return a motion and the error of its free end [m]; None where the tolerance is not kept.

    Parameters
    ----------
    form : FreeHubForm
    scene : Scene
    corners : ndarray
        Instants at which the torque is not smooth, s; ascending, > 0, the last is the end.
    """
    states = np.empty((2, form.lean.size + 1))
    for state, item in zip(states, scene.start, strict=True):
        state[1:] = np.linalg.solve(form.to_q, item[1:])
        state[0] = (item[0] - form.lean @ state[1:]) * np.sqrt(form.inertia)
    steps = _steps(corners)
    length = _FIRST_PHASE * max(scene.rtol, _ROUNDING) ** (1.0 / _ORDER) * steps / np.sqrt(form.softest)
    for attempt in range(_ATTEMPTS):
        run = _Run(form, scene, corners, _LOCAL * _TIGHTER**attempt, steps, np.stack([states, states]), length)
        while not run.done:
            if not run.go_on():
                return None
        allowed = run.allowed(run.peaks)
        errors = run.errors[:2] + run.unseen + np.where(run.peaks > 0.0, _SETTLED * run.share * allowed, 0.0)
        if (errors <= allowed).all():
            return FreeTrajectory(form, tuple(run.pieces)), float(errors[0])
    return None


def _even(corners: Array) -> int:
    """How many corners [s] follow 0 and each other at the same distance, but for rounding of their places."""
    apart = np.abs(corners - corners[0] * np.arange(1, corners.size + 1)) > ALIKE * corners[0]
    return int(np.argmax(apart)) if apart.any() else corners.size


def _steps(corners: Array) -> int:
    """Steps of the windows: where corners are even, such that few windows end at some and steps at all."""
    count = corners.size if _even(corners) == corners.size else 1
    within, rest = divmod(count, -(-count // _MOST_STEPS))
    return STEPS if rest else within * max(1, STEPS // within)


def _weights(form: FreeHubForm, modes: FreeModes, run: _Run) -> _Weights:
    rows = run.scene.tip_rows @ form.to_q @ modes.shapes
    rows = np.concatenate([np.zeros((len(rows), 1)), rows], axis=1)
    hub = run.scene.radius * modes.push
    sizes = np.stack([np.abs(rows).max(axis=0), np.abs(hub)]) / modes.rates.imag
    return _Weights(rows, hub, sizes, hub * (run.scene.end - run.time))


def _swept(run: _Run, length: float) -> _Window | None:
    """Return a window of a given length [s], swept in both orders; None where the sweeps do not settle."""
    (low, high), h, form = STAGES, length / run.steps, run.form
    torque = run.torque(h, low)
    modes = free_modes(form, _typical_speed(form, run.states[1, 1, 0], torque, h))
    weights, states = _weights(form, modes, run), run.states.copy()
    states[..., 1:] = states[..., 1:] @ modes.shapes
    starts = [rate - modes.rates.conj() * z for z, rate in states]
    moved = flow(modes.rates, h, run.steps, low)
    force = (modes.push[:, None] * torque).reshape(modes.push.size, run.steps, low)
    peaks = weights.peaks(moved.at_nodes(force, moved.states(force, starts[0]))[0])
    left = np.maximum(_SETTLED * run.addable(peaks, length), _ROUNDING * peaks)
    watched = weights.rows / left[0], weights.speed[None] / left[1]
    coarse = settle(modes, moved, starts[0], torque, watched, force)
    if coarse is None:
        return None
    moved = flow(modes.rates, h, run.steps, high)
    force = coarse.force @ _places(low, tuple(gauss_method(high).nodes)).T
    fine = settle(modes, moved, starts[1], run.torque(h, high), watched, force)
    if fine is None:
        return None
    errors, added = _errors(weights, coarse, fine)
    unseen, worst = _unseen(weights, modes, fine)
    ends = np.stack([np.stack(coordinates(modes.rates, item.states[:, -1])) for item in (coarse, fine)])
    ends[..., 1:] = ends[..., 1:] @ modes.shapes.T
    return _Window(
        piece=Piece(run.time, h, modes, moved.fast, fine.force, fine.states),
        sweeps=coarse.sweeps,
        peaks=weights.peaks(fine.z),
        errors=errors,
        added=added,
        hidden=_overlooked(weights, run, fine),
        unseen=unseen,
        needed=_CAUTION * FAST / float(modes.rates.imag[1 + worst]),
        states=ends,
    )


def _typical_speed(form: FreeHubForm, rate: float, torque: Array, h: float) -> float:
    """Hub speed whose square is the mean one of a rigid beam in a window, rad/s: from the free mass's rate."""
    impulse = torque.reshape(-1, STAGES[0]) @ gauss_method(STAGES[0]).weights * h
    speed = rate / np.sqrt(form.inertia) + np.cumsum(impulse) / form.inertia
    return float(np.sqrt(np.mean(speed**2)))


def _overlooked(weights: _Weights, run: _Run, fine: Swept) -> Array:
    """What a user's torque does beside the polynomials through its nodes, by its values near the ends of steps; 2.

    Its values at even instants count too: what lasts longer than from one of these to the next is not passed over.
    """
    if not run.scene.given:
        return np.zeros(2)
    h, places, instants = fine.flow.h, np.array([_INSIDE, 1.0 - _INSIDE]), even_instants(run.scene.end)
    nodes, begin = fine.torque.reshape(run.steps, -1), run.time + h * np.arange(run.steps)
    values = run.drive(begin[:, None] + h * places)
    apart = np.abs(values - nodes @ _places(nodes.shape[1], tuple(places)).T).max(axis=1)
    gap = instants[1]
    instants = instants[(instants >= begin[0]) & (instants <= begin[-1] + h)]
    result = run.drive(instants)
    between, _ = off_polynomials(nodes, begin, np.full(run.steps, h), instants, result)
    size = max(np.abs(values).max(), np.abs(result).max(initial=0.0))
    apart[apart <= _ROUNDING * size] = 0.0
    between[between <= _SEEN * size] = 0.0
    push = weights.hub / run.scene.radius
    moved = np.array([weights.sizes[0, 1:] @ np.abs(push[1:]), weights.speed[0] * push[0]])
    return max(h * apart.sum(), gap * between.sum()) * moved


@lru_cache(maxsize=4)
def _places(stages: int, places: tuple[float, ...]) -> Array:
    """From values at the nodes to those at other places of a step, of the same polynomial."""
    return legendre.legvander(2.0 * np.array(places) - 1.0, stages - 1) @ gauss_method(stages).terms


def _errors(weights: _Weights, coarse: Swept, fine: Swept) -> tuple[Array, Array]:
    """Differences of the orders, in all and what the window has added: see `_Window`."""
    apart: Array = fine.states - coarse.states
    own = np.empty_like(apart)
    own[1:] = apart[1:] - fine.flow.turns * apart[1:, :1]
    own[0] = apart[0] - apart[0, 0] - 1j * fine.flow.h * np.arange(apart.shape[1]) * apart[0, 0].real
    result = []
    for item in (apart, own):
        size = np.abs(item)
        size[0] = np.abs(item[0].imag)
        turning = weights.speed[0] * np.abs(item[0].real.mean())
        result.append(np.append((weights.sizes @ size).max(axis=1), turning))
    return result[0], result[1]


def _unseen(weights: _Weights, modes: FreeModes, fine: Swept) -> tuple[Array, int]:
    """What the vibrations of fast modes would do to what is watched, 2, and which mode most of it.

    A vibration of amplitude a shifts its own phase, by what is not linear in its own equation, and pushes the hub and
    the other modes by what couples it to them; that force turns with the vibration, so that its impulse stays bounded.
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
