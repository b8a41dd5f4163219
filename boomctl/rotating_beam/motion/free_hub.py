"""Motion under a torque: windows one after another, each swept in two orders whose difference is the error.

Both orders go their own way from t = 0, so that their difference is the error of the lower one with all that it causes
later; the motion of the higher one is returned. A fast mode follows the slow ones without being resolved; what its own
vibration would do to them is bounded, and where the bound is too large the steps become short enough for that mode.
"""

from dataclasses import dataclass, replace
from functools import lru_cache
from typing import final

import numpy as np
from numpy.polynomial import legendre

from boomctl.arrays import Array
from boomctl.gauss import gauss_method
from boomctl.lti.rounding import ALIKE, SUMMED
from boomctl.maneuvers import TorqueDriven
from boomctl.rotating_beam.drive import off_polynomials
from boomctl.rotating_beam.modal.equations import FreeHubForm
from boomctl.rotating_beam.motion.free_modes import FreeModes, free_modes
from boomctl.rotating_beam.motion.free_trajectory import FreeTrajectory, Piece
from boomctl.rotating_beam.motion.oscillators import FAST, flow
from boomctl.rotating_beam.motion.sweeps import Swept, Window, settle

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


@final
@dataclass(frozen=True, eq=False)
class FreeScene:
    """A torque-driven motion that is asked for.

    Attributes
    ----------
    maneuver : TorqueDriven
    start : pair of ndarray, N
        Coordinates and rates of hub and beam at t = 0.
    corners : ndarray
        Instants at which the torque is not smooth, s; ascending, > 0, the last is the end.
    rows : ndarray, r x (N - 1)
        Displacements of the free end over the beam's coordinates, with one common largest value.
    radius : float
        Distance of the free end from the axis, m.
    rtol, atol : float
        The error of the displacements, and that of the hub angle times the radius, is kept below
        ``atol + rtol max |displacement|`` [m].
    looked_at : ndarray or None
        Even instants, at which a user's function is looked at, which may be less smooth than it says; None of others, s.
    """

    maneuver: TorqueDriven
    start: tuple[Array, Array]
    corners: Array
    rows: Array
    radius: float
    rtol: float
    atol: float
    looked_at: Array | None

    @property
    def end(self) -> float:
        """The last instant, s."""
        return float(self.corners[-1])


@dataclass(frozen=True, eq=False)
class _Progress:
    """How far a scene has come; states in coordinates (r, x), both orders, 2 x 2 x (1 + n): coordinates, then rates.

    Attributes
    ----------
    scene : FreeScene
    share : float
        Of the allowed error, for all windows together.
    time : float
    states : ndarray
    length : float
        Of the next window, s, if no corner comes before.
    most : float
        Longest step at which the fast modes that have to be are resolved, s.
    longest : float
        Longest window, s.
    steps : int
        Of a window.
    most_windows : float
        Where the motion is given up.
    peaks, errors, unseen : ndarray, 2
        Of displacements and of hub angle times radius, m: the largest so far, its error, what fast modes would add.
    turning : float
        Largest mean difference of the orders in the hub's speed, as hub angle times radius at the end, m.
    pieces : tuple of Piece
    failed : bool
    """

    scene: FreeScene
    share: float
    time: float
    states: Array
    length: float
    most: float
    longest: float
    steps: int
    most_windows: float
    peaks: Array
    errors: Array
    unseen: Array
    turning: float = 0.0
    pieces: tuple[Piece, ...] = ()
    failed: bool = False

    @property
    def done(self) -> bool:
        """Whether there is nothing to do any more."""
        # of the whole time: a corner so near ahead is reached already
        return self.failed or self.scene.end - self.time <= SUMMED * self.scene.end

    def window(self) -> float:
        """Length of the next window, s: it ends at a corner, or its steps do at all corners within it."""
        length, left = min(self.length, self.longest, self.steps * self.most), self.scene.corners - self.time
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


def _even(corners: Array) -> int:
    """How many corners [s] follow 0 and each other at the same distance, but for rounding of their places."""
    apart = np.abs(corners - corners[0] * np.arange(1, corners.size + 1)) > ALIKE * corners[0]
    return int(np.argmax(apart)) if apart.any() else corners.size


def _steps(scene: FreeScene) -> int:
    """Steps of the windows: where corners are even, such that few windows end at some and steps at all."""
    corners = scene.corners.size if _even(scene.corners) == scene.corners.size else 1
    within, rest = divmod(corners, -(-corners // _MOST_STEPS))
    return STEPS if rest else within * max(1, STEPS // within)


def free_motion(form: FreeHubForm, scene: FreeScene) -> tuple[FreeTrajectory, float] | None:
    """Return a motion and the error of its free end [m]; None where the tolerance is not kept."""
    share, steps = _LOCAL, _steps(scene)
    for _ in range(_ATTEMPTS):
        run = _begin(form, scene, share, steps)
        while not run.done:
            length = run.window()
            run = _after(run, length, _tried(form, run, length))
        if run.failed:
            return None
        errors = run.errors + run.unseen + np.where(run.peaks > 0.0, _SETTLED * share * run.allowed(run.peaks), 0.0)
        if (errors <= run.allowed(run.peaks)).all():
            return FreeTrajectory(form, run.pieces), float(errors[0])
        share *= _TIGHTER
    return None


def _begin(form: FreeHubForm, scene: FreeScene, share: float, steps: int) -> _Progress:
    states = np.empty((2, form.lean.size + 1))
    for state, item in zip(states, scene.start, strict=True):
        state[1:] = np.linalg.solve(form.to_q, item[1:])
        state[0] = (item[0] - form.lean @ state[1:]) * np.sqrt(form.inertia)
    none = np.zeros(2)
    radian = steps / np.sqrt(form.softest)
    longest = _DECAYED / form.decay if form.decay else np.inf
    return _Progress(
        scene=scene,
        share=share,
        time=0.0,
        states=np.stack([states, states]),
        length=_FIRST_PHASE * max(scene.rtol, _ROUNDING) ** (1.0 / _ORDER) * radian,
        most=np.inf,
        longest=longest,
        steps=steps,
        most_windows=_MOST_WINDOWS + _MORE_WINDOWS * (scene.end / radian + scene.corners.size),
        peaks=none,
        errors=none,
        unseen=none,
    )


@dataclass(frozen=True, eq=False)
class _Weights:
    """What modal states mean for what is watched, b = 1 window.

    Attributes
    ----------
    rows : ndarray, b x r x (1 + n)
        Displacements of the free end over modal coordinates.
    tip, hub : ndarray, b x (1 + n)
        Largest displacement, and hub angle times radius, that goes with a state of size 1.
    speed : ndarray, b
        What a hub speed does to the hub angle times radius by the end, s m.
    radius : ndarray, b
        Of the free end, m.
    """

    rows: Array
    tip: Array
    hub: Array
    speed: Array
    radius: Array


def _weights(form: FreeHubForm, modes: FreeModes, run: _Progress) -> _Weights:
    radius = np.array([run.scene.radius])
    rows = run.scene.rows[None] @ form.to_q @ modes.shapes
    rows = np.concatenate([np.zeros((*rows.shape[:2], 1)), rows], axis=2)
    size = np.ones_like(modes.push)
    size[:, 1:] = 1.0 / modes.oscillators.omega
    hub = radius[:, None] * np.abs(modes.push) * size
    left = run.scene.end - run.time
    return _Weights(rows, np.abs(rows).max(axis=1) * size, hub, radius * left, radius)


@dataclass(frozen=True, eq=False)
class _Tried:
    """A window that was tried.

    Attributes
    ----------
    sweeps : int
    peaks, errors, unseen : ndarray, 2
        As in `_Progress`.
    added, hidden : ndarray, 2
        What the window has added to the difference of the orders as the linear motion carries it on, and what a user's
        torque may have hidden between the nodes.
    turning, turned : float
        Mean difference of the orders in the hub's speed, and what the window has added to it, both as hub angle times
        radius at the end, m.
    needed : float
        Length of a step at which the fast mode that would do most is resolved, s.
    states : ndarray, 2 x 2 x (1 + n)
        At the window's end, as in `_Progress`.
    piece : Piece
    """

    sweeps: int
    peaks: Array
    errors: Array
    added: Array
    hidden: Array
    turning: float
    turned: float
    unseen: Array
    needed: float
    states: Array
    piece: Piece


def _after(run: _Progress, length: float, tried: _Tried | None) -> _Progress:
    """A scene after a window that was tried; None: it did not settle."""
    if tried is None or not np.isfinite(tried.errors).all():
        return replace(run, length=0.5 * length, failed=length < _SMALLEST * run.scene.end)
    # a difference of old turns with what is not linear too: that is no new error where the difference has not grown
    grown = np.minimum(tried.added, np.maximum(tried.errors - run.errors, 0.0))
    grown[1] = max(grown[1], min(tried.turned, max(tried.turning - run.turning, 0.0)))
    excess = float(((grown + tried.hidden) / run.addable(tried.peaks, length)).max())
    factor = float(np.clip(_CAUTION * max(excess, np.finfo(float).tiny) ** (-1.0 / _ORDER), *_GROWTH))
    if excess > 1.0:
        return replace(run, length=min(factor, _CAUTION) * length)
    if (tried.unseen > _UNSEEN * run.allowed(tried.peaks)).any():
        hopeless = _RESOLVED * (run.scene.end - run.time) > run.most_windows * run.steps * tried.needed
        return replace(run, most=tried.needed, failed=hopeless)
    following = length * min(factor, max(_MANY_SWEEPS / tried.sweeps, 0.5))
    if length < _CAUTION * run.length:  # cut short by a corner, which says nothing of the windows behind it
        following = max(following, run.length)
    end, pieces = run.time + length, (*run.pieces, tried.piece)
    corner = float(run.scene.corners[int(np.argmin(np.abs(run.scene.corners - end)))])
    over = abs(corner - end) <= ALIKE * length  # what made a fast mode vibrate, perhaps: longer steps are tried anew
    return replace(
        run,
        time=corner if over else end,
        states=tried.states,
        length=following,
        most=np.inf if over else run.most if len(pieces) % _RELAXED else 2.0 * run.most,
        peaks=np.maximum(run.peaks, tried.peaks),
        errors=np.maximum(run.errors, tried.errors),
        unseen=np.maximum(run.unseen, tried.unseen),
        turning=max(run.turning, tried.turning),
        pieces=pieces,
        failed=len(pieces) >= run.most_windows,
    )


def _tried(form: FreeHubForm, run: _Progress, length: float) -> _Tried | None:
    """Return a window of a given length [s], swept in both orders; None where the sweeps do not settle."""
    low, high = STAGES
    steps, h = run.steps, np.array([length / run.steps])
    states = run.states[None].copy()
    torque = _torque(run, h[0], low)
    modes = free_modes(form, _typical_speed(form, states[:, 1, 1, 0], torque, h))
    weights = _weights(form, modes, run)
    states[..., 1:] = states[..., 1:] @ modes.shapes[:, None]
    starts = [modes.oscillators.states(states[:, order, 0], states[:, order, 1]) for order in (0, 1)]
    moved = flow(modes.oscillators, h, steps, low)
    force = (modes.push[..., None] * torque).reshape(*modes.push.shape, steps, low)
    peaks = _peaks(weights, modes, moved.at_nodes(force, moved.states(force, starts[0]))[0])
    left = np.maximum(_SETTLED * run.addable(peaks[0], length), _ROUNDING * peaks)
    rows, speed = weights.rows / left[:, :1, None], weights.speed / left[:, 1]
    coarse = settle(Window(modes, moved, starts[0], torque, rows, speed), force)
    if coarse is None:
        return None
    torque = _torque(run, h[0], high)
    moved = flow(modes.oscillators, h, steps, high)
    window = Window(modes, moved, starts[1], torque, rows, speed)
    fine = settle(window, coarse.force @ _places(low, tuple(gauss_method(high).nodes)).T)
    if fine is None:
        return None
    peaks = _peaks(weights, modes, fine.z)
    errors, added, turning = _errors(weights, coarse, fine, window)
    hidden = _overlooked(weights, run, window)
    unseen, worst = _unseen(weights, fine, window)
    ends = np.stack([np.stack(modes.oscillators.coordinates(item.states[..., -1]), 1) for item in (coarse, fine)], 1)
    ends[..., 1:] = ends[..., 1:] @ modes.shapes.swapaxes(1, 2)[:, None]
    return _Tried(
        sweeps=coarse.sweeps,
        peaks=peaks[0],
        errors=errors[0],
        added=added[0],
        hidden=hidden,
        turning=float(turning[0, 0]),
        turned=float(turning[0, 1]),
        unseen=unseen[0],
        needed=_CAUTION * FAST / float(modes.oscillators.omega[0, worst[0]]),
        states=ends[0],
        piece=Piece(run.time, float(h[0]), modes, moved.fast[0], fine.force[0], fine.states[0]),
    )


def _typical_speed(form: FreeHubForm, rate: Array, torque: Array, h: Array) -> Array:
    """Hub speeds whose squares are the mean ones of a rigid beam in the windows, rad/s, b: from the free mass's rates."""
    impulse = torque.reshape(*rate.shape, -1, STAGES[0]) @ gauss_method(STAGES[0]).weights * h[:, None]
    speed = rate[:, None] / np.sqrt(form.inertia) + np.cumsum(impulse, axis=1) / form.inertia
    return np.sqrt(np.mean(speed**2, axis=1))


def _torque(run: _Progress, h: float, stages: int) -> Array:
    """Torque at the nodes of the window, 1 x 1 x (m s)."""
    nodes = (np.arange(run.steps)[:, None] + gauss_method(stages).nodes).ravel()
    return run.scene.maneuver.torque(run.time + h * nodes)[None, None]


def _overlooked(weights: _Weights, run: _Progress, window: Window) -> Array:
    """What a user's torque does beside the polynomials through its nodes, by its values near the ends of steps; 2.

    Its values at even instants count too: what lasts longer than from one of these to the next is not passed over.
    """
    instants = run.scene.looked_at
    if instants is None:
        return np.zeros(2)
    push, h, places = window.modes.push[0], float(window.flow.h[0]), np.array([_INSIDE, 1.0 - _INSIDE])
    nodes, begin = window.torque.reshape(run.steps, -1), run.time + h * np.arange(run.steps)
    values = run.scene.maneuver.torque(begin[:, None] + h * places)
    apart = np.abs(values - nodes @ _places(nodes.shape[1], tuple(places)).T).max(axis=1)
    gap = instants[1]
    instants = instants[(instants >= begin[0]) & (instants <= begin[-1] + h)]
    result = run.scene.maneuver.torque(instants)
    between, _ = off_polynomials(nodes, begin, np.full(run.steps, h), instants, result)
    size = max(np.abs(values).max(), np.abs(result).max(initial=0.0))
    apart[apart <= _ROUNDING * size] = 0.0
    between[between <= _SEEN * size] = 0.0
    to_tip, to_hub = np.sum(weights.tip[0, 1:] * np.abs(push[1:])), weights.speed[0] * push[0] ** 2
    return max(h * apart.sum(), gap * between.sum()) * np.array([to_tip, to_hub])


@lru_cache(maxsize=4)
def _places(stages: int, places: tuple[float, ...]) -> Array:
    """From values at the nodes to those at other places of a step, of the same polynomial."""
    nodes, at = 2.0 * gauss_method(stages).nodes - 1.0, 2.0 * np.array(places) - 1.0
    return legendre.legvander(at, stages - 1) @ np.linalg.inv(legendre.legvander(nodes, stages - 1))


def _peaks(weights: _Weights, modes: FreeModes, z: Array) -> Array:
    """Largest displacement of the free end, and hub angle times radius, at the nodes; b x 2."""
    tip = np.abs(weights.rows @ z).max(axis=(1, 2))
    return np.stack([tip, weights.radius * np.abs(modes.push[:, None] @ z).max(axis=(1, 2))], axis=1)


def _errors(weights: _Weights, coarse: Swept, fine: Swept, window: Window) -> tuple[Array, Array, Array]:
    """Differences of the orders: in all, what the window has added, and both in the hub's mean speed; b x 2 each."""
    apart: Array = fine.states - coarse.states
    own = np.empty_like(apart)
    own[:, 1:] = apart[:, 1:] - window.flow.turns * apart[:, 1:, :1]
    elapsed = window.flow.h[:, None] * np.arange(apart.shape[2])
    own[:, 0] = apart[:, 0] - apart[:, 0, :1] - 1j * elapsed * np.real(apart[:, 0, :1])
    result = []
    for item in (apart, own):
        size = np.abs(item)
        size[:, 0] = np.abs(np.imag(item[:, 0]))
        tip, hub = ((weight[:, None] @ size)[:, 0].max(axis=1) for weight in (weights.tip, weights.hub))
        result.append(np.stack([tip, hub], axis=1))
    turning = np.stack([np.abs(np.real(item[:, 0]).mean(axis=1)) for item in (apart, own)], axis=1)
    return result[0], result[1], (weights.speed * window.modes.push[:, 0])[:, None] * turning


def _unseen(weights: _Weights, fine: Swept, window: Window) -> tuple[Array, Array]:
    """What the vibrations of fast modes would do to what is watched, b x 2, and which mode most of it.

    A vibration of amplitude a shifts its own phase, by what is not linear in its own equation, and pushes the hub and
    the other modes by what couples it to them; that force turns with the vibration, so that its impulse stays bounded.
    """
    modes, fast = window.modes, window.flow.fast
    if not window.flow.any_fast:
        return np.zeros((fast.shape[0], 2)), np.zeros(fast.shape[0], dtype=int)
    x, v, omega = fine.z[:, 1:], fine.rate[:, 1:], modes.oscillators.omega
    rate = np.abs(window.flow.vibrations(fine.force, fine.states)).max(axis=2)
    speed = np.abs(modes.hub_speed(fine.rate)).max(axis=(1, 2))[:, None]
    square = np.maximum(speed**2 - modes.square[:, None], modes.square[:, None])
    pushed, mobility = np.abs(modes.push[:, 1:]), np.sum(modes.push**2, axis=1)[:, None]
    bent = modes.slope @ x
    inertia = np.abs(np.einsum("bik,bik->bk", x, bent)).max(axis=1)[:, None]
    varies = 2.0 * np.abs(np.einsum("bik,bik->bk", v, bent)).max(axis=1)[:, None] * pushed
    coupling = np.zeros_like(omega)
    if modes.form.has_axial:
        coupling = np.abs(modes.gyro @ x).max(axis=2)
        varies += np.abs(modes.gyro @ v).max(axis=2)
    slope, gyro = np.abs(modes.slope), np.abs(modes.gyro)
    own = square * np.einsum("bii->bi", slope) + (omega * pushed) ** 2 * inertia + (omega * coupling) ** 2 * mobility
    own += 4.0 * speed**2 * np.einsum("bij,bij->bi", gyro, gyro)
    shift = np.minimum(2.0, 0.5 * own / omega * (window.flow.h * fine.force.shape[2])[:, None])
    others = 2.0 * speed[..., None] * gyro + square[..., None] * slope / omega[:, None] + np.abs(modes.damping)
    to_tip = (weights.tip[:, None, 1:] @ others)[:, 0] + np.sum(weights.tip[:, 1:] * pushed, axis=1)[:, None] * varies
    tip = (weights.tip[:, 1:] * shift + to_tip / omega) * rate
    hub = (weights.hub[:, 1:] * shift + (weights.speed * modes.push[:, 0] ** 2)[:, None] * varies / omega) * rate
    both = np.stack([tip, hub], axis=1)
    whole = both.sum(axis=2)
    return whole, np.argmax((both / (whole + np.finfo(float).tiny)[..., None]).sum(axis=1), axis=1)
