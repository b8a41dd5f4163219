"""The loop, step by step: exact motion of the plant, the controller at its samples, contacts if any."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from boomctl.arrays import Array, blocks
from boomctl.lti.sampled import Held, whole_samples
from boomctl.lti.system import Lti, closed
from boomctl.simulation.contact.contacts import Contacts
from boomctl.simulation.controller import SampledController
from boomctl.simulation.plant import ModalPlant, Step
from boomctl.simulation.signals import MOST_STEPS, TimeGrid

STORED = 4096  # Steps whose states are stored at once; larger blocks need more memory and save no time.


@dataclass(frozen=True)
class Limits:
    """Limits of a controller's hardware; ``inf`` for none.

    Attributes
    ----------
    force, rate : (controls,) ndarray
        Largest control, and largest change from one sample to the next.
    quantum : (measurements,) ndarray
        Steps of the measurements.
    """

    force: Array
    rate: Array
    quantum: Array

    @property
    def coarse(self) -> bool:
        """True if a measurement is quantized."""
        return bool(np.isfinite(self.quantum).any())


@dataclass(frozen=True)
class Added:
    """Signals added to those of a controller at each sample; None for none.

    Attributes
    ----------
    noise, reference : (samples, measurements) ndarray or None
        Noise added to the measurements; reference subtracted from the measurements, after rounding.
    feedforward : (samples, controls) ndarray or None
        Added to the controller's commands.
    """

    noise: Array | None = None
    reference: Array | None = None
    feedforward: Array | None = None

    @property
    def any(self) -> bool:
        """True if a signal is added."""
        return self.noise is not None or self.reference is not None or self.feedforward is not None


@dataclass(frozen=True)
class ControlLog:
    """Commanded and applied controls at each sample, and masks of active force and rate limits."""

    commanded: Array
    applied: Array
    saturated: Array
    slewed: Array

    def acting(self, steps: Array, late: int, per_sample: int) -> Array:
        """Return the controls that act at steps of the grid, (steps, controls), applied ``late`` steps before."""
        sample = (steps - late) // per_sample
        return np.where((sample >= 0)[:, None], self.applied[np.clip(sample, 0, len(self.applied) - 1)], 0.0)


def whole_steps(delay: float, h: float) -> tuple[int, float]:
    """Return a delay as whole steps and a remainder [s]."""
    if delay / h > MOST_STEPS:
        raise ValueError(f"delay = {delay:g}: expected at most {MOST_STEPS:g} steps of {h:g} s")
    return whole_samples(delay, h)


@dataclass(frozen=True, eq=False, kw_only=True)
class SampledRun:
    """Checked data of a run of a sampled loop around any plant.

    Attributes
    ----------
    W : (inputs, steps + 1) ndarray
        Disturbances on the grid.
    delay : float
        Time from a sample until its control acts [s].
    start : (n,) ndarray
        States of the plant at the first time; for a machine, modal coordinates and rates.
    """

    controller: SampledController
    grid: TimeGrid
    W: Array
    delay: float
    limits: Limits
    start: Array
    added: Added = Added()

    @cached_property
    def lag(self) -> int:
        """Delay of the controls in whole steps."""
        return whole_steps(self.delay, self.grid.h)[0]

    @cached_property
    def switch(self) -> float:
        """Remainder of the delay [s]: time within a step at which the controls change."""
        return whole_steps(self.delay, self.grid.h)[1]

    @property
    def samples(self) -> int:
        """Number of samples of the controller, including the last time if a sample falls on it."""
        return self.grid.steps // self.grid.per_sample + 1

    @cached_property
    def disturbed(self) -> Array:
        """Indices of the disturbed inputs."""
        return np.flatnonzero(self.W.any(axis=1))

    def new_log(self) -> ControlLog:
        """Return a log to be filled."""
        shape = self.samples, len(self.controller.driven)
        return ControlLog(np.zeros(shape), np.zeros(shape), np.zeros(shape, dtype=bool), np.zeros(shape, dtype=bool))

    def at_points(self, log: ControlLog) -> tuple[Array, Array]:
        """Return the controls that act just after each time, and the latest commands, (controls, points)."""
        step = np.arange(len(self.grid.time)) * self.grid.per_point
        late = self.lag + (1 if self.switch else 0)  # steps after a sample from which its control acts throughout
        latest = np.minimum(step // self.grid.per_sample, len(log.commanded) - 1)
        return log.acting(step, late, self.grid.per_sample).T, log.commanded[latest].T


@dataclass(frozen=True)
class LinearLoop:
    """The loop without limits: states of the plant, applied controls, and states of the controller.

    ``z+ = Phi z + first d + last d+``; outputs are ``C x`` of the plant, the commanded controls, and their changes.
    ``excess`` is the effect of applied less commanded controls on ``z+``, ``latest`` the indices of the latest applied
    controls in ``z``.  Measurements are ``reads z`` plus the feedthrough of the disturbances; ``errors`` is the effect of
    errors of the measurements on the commanded controls and on ``z+``.
    """

    Phi: Array
    first: Array
    last: Array
    C: Array
    D: Array
    excess: Array
    latest: Array
    reads: Array
    errors: Array


@dataclass(frozen=True, eq=False, kw_only=True)
class LoopProblem(SampledRun):
    """Data of a run around a linear plant: the plant, its motion over a step, and its contacts."""

    plant: ModalPlant
    maps: Step
    contacts: Contacts | None

    def forcing(self, begin: int, end: int) -> Array:
        """Return the effect of the disturbances on the states in some steps, (steps, n)."""
        used, W = self.disturbed, self.W[self.disturbed, begin : end + 1]
        return W[:, :-1].T @ self.maps.first[:, used].T + W[:, 1:].T @ self.maps.last[:, used].T

    @cached_property
    def linear(self) -> LinearLoop:
        """The loop while no limit is active, in the steps of its grid."""
        return linear_loop(self, self.maps, (self.lag, self.switch))

    @property
    def stepper(self) -> Array:
        """Map of states, control before and control after the switch to the states a step later."""
        d = self.controller.driven
        return np.hstack([self.maps.Phi, self.maps.before[:, d], self.maps.after[:, d]])


def linear_loop(p: LoopProblem, maps: Step, late: tuple[int, float]) -> LinearLoop:
    """Return the loop while no limit is active, in steps of ``maps``, with a delay of whole steps and a remainder [s]."""
    plant, c, nu = p.plant, p.controller, len(p.controller.driven)
    held = Held.of(plant, c.driven.tolist(), [late] * nu, remembered=True)
    A, B = held.matrices(maps.Phi, maps.before, maps.after)
    m, size, acting, latest = maps.first.shape[1], len(A), B[:, c.driven], held.starts[c.driven]
    moving, commanded = _grown(plant.C, len(plant.C), size), np.zeros((nu, size))
    reads = held.answers(0.0)[0][c.measured]  # measurements from the states of plant and controls
    C = np.vstack([moving, commanded, commanded - np.eye(size)[latest], reads])
    D, read = np.zeros((len(C), m + nu)), len(moving) + 2 * nu
    D[len(moving) : len(moving) + nu, m:] = D[len(moving) + nu : read, m:] = np.eye(nu)
    D[read:, :m] = plant.D[c.measured]
    first = _grown(maps.first, size, m)
    # outputs do not depend on a control before it acts: the loop is well-posed
    loop = closed(Lti(A, np.hstack([first, acting]), C, D), Lti(c.A, c.B, c.C, c.D), np.eye(nu))
    last = _grown(maps.last, len(loop.A), m)
    return LinearLoop(
        loop.A,
        loop.B,
        last,
        loop.C,
        loop.D,
        excess=np.vstack([acting, c.L]),
        latest=latest,
        reads=_grown(reads, len(reads), len(loop.A)),
        errors=np.vstack([c.D, acting @ c.D, c.B]),
    )


def _grown(matrix: Array, rows: int, columns: int) -> Array:
    """Return a matrix padded with zero rows and columns."""
    return np.pad(matrix, ((0, rows - len(matrix)), (0, columns - matrix.shape[1])))


def sampler(p: LoopProblem, log: ControlLog) -> Callable[[int, Array], None]:
    """Return the function that evaluates sample ``k`` of the controller from ``[states, control]`` and logs it."""
    c, plant = p.controller, p.plant
    ny, nu = len(c.measured), len(c.driven)
    reads = np.hstack([plant.C[c.measured], plant.D[np.ix_(c.measured, c.driven)]])
    heard = np.ascontiguousarray((plant.D[c.measured] @ p.W[:, :: p.grid.per_sample]).T)
    if p.added.noise is not None:
        heard += p.added.noise
    wanted, forward = p.added.reference, p.added.feedforward
    law = blocks([[c.D, c.C], [c.B, c.A]])
    known, result = np.zeros(ny + len(c.A)), np.zeros(nu + len(c.A))
    y, state, u, following = known[:ny], known[ny:], result[:nu], result[nu:]
    coarse = np.isfinite(p.limits.quantum)
    grain = np.where(coarse, p.limits.quantum, 1.0) if p.limits.coarse else None
    bounded = bool(np.isfinite(p.limits.force).any() or np.isfinite(p.limits.rate).any())
    force, rate, last = p.limits.force.tolist(), p.limits.rate.tolist(), [0.0] * nu
    commanded, applied, correction, laws = log.commanded, log.applied, c.L, c.laws
    correct = correction.any() if laws is None else laws.correction.any()

    def sample(k: int, at: Array) -> None:
        nonlocal law, correction
        np.dot(reads, at, out=y)
        y.__iadd__(heard[k])
        if grain is not None:
            y[coarse] = (grain * np.rint(y / grain))[coarse]
        if laws is not None:
            law, correction = laws.at(k, y)
        if wanted is not None:
            y.__isub__(wanted[k])
        np.dot(law, known, out=result)
        if forward is not None:
            u.__iadd__(forward[k])
        commanded[k] = u
        if bounded and limited(u.tolist(), k, force, rate, last, log):
            applied[k] = last
            if correct:
                following.__iadd__(correction @ (applied[k] - commanded[k]))
        else:
            applied[k] = u
        state[:] = following

    return sample


def limited(u: list[float], k: int, force: list[float], rate: list[float], last: list[float], log: ControlLog) -> bool:
    """Limit the commands ``u``, store the applied controls in ``last``, log active limits; return True if one is active."""
    met = False
    for i, value in enumerate(u):
        allowed = value
        if abs(allowed) > force[i]:
            allowed = force[i] if value > 0.0 else -force[i]
            log.saturated[k, i] = met = True
        if abs(allowed - last[i]) > rate[i]:
            allowed = last[i] + (rate[i] if allowed > last[i] else -rate[i])
            log.slewed[k, i] = met = True
        last[i] = allowed
    return met


def run_smooth(p: LoopProblem, log: ControlLog) -> Array:
    """Step a loop without contacts and return ``C`` times the modal states at each step, (outputs, steps + 1)."""
    return run_steps(p, log, p.stepper, p.forcing)


def run_steps(
    p: LoopProblem,
    log: ControlLog,
    stepper: Array,
    forcing: Callable[[int, int], Array],
    touched: Callable[[int, Array], Array] | None = None,
    every: int = 1,
) -> Array:
    """Step a loop and return ``C`` times the modal states at every so many steps, (outputs, steps / every + 1).

    Parameters
    ----------
    p : LoopProblem
    log : ControlLog
        Log, which is filled.
    stepper : ndarray
        Effect of states and controls on the row a step later: states first.
    forcing : callable
        Returns the effect of disturbances on these rows (steps, row), of the first step and the one after the last.
    touched : callable, optional
        Returns the row with contact forces, of a step and the row without them.
    every : int
        Steps between two columns of the result; a divisor of their number.
    """
    n, nu, per_sample, lag, steps = len(p.plant.A), len(p.controller.driven), p.grid.per_sample, p.lag, p.grid.steps
    sample, applied = sampler(p, log), log.applied
    block = every * max(1, STORED // every)
    X, result = np.zeros((min(block, steps), n)), np.empty((len(p.plant.C), steps // every + 1))
    result[:, 0] = p.plant.C @ p.start
    full = np.zeros(n + 2 * nu)
    states, before, after, heard = full[:n], full[n : n + nu], full[n + nu :], full[: n + nu]
    states[:] = p.start
    for begin in range(0, steps, block):
        end = min(begin + block, steps)
        for k, pushed in enumerate(forcing(begin, end), begin):
            if k % per_sample == 0:
                sample(k // per_sample, heard)
            if k >= lag:
                after[:] = applied[(k - lag) // per_sample]
            row = stepper @ full
            row += pushed
            if touched is not None:
                row = touched(k, row)
            states[:] = X[k - begin] = row[:n]
            before[:] = after
        result[:, begin // every + 1 : end // every + 1] = p.plant.C @ X[every - 1 : end - begin : every].T
    if steps % per_sample == 0:
        sample(steps // per_sample, heard)
    return result
