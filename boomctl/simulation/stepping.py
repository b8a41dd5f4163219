"""The loop, step by step: the plant exactly, the controller at its samples, contacts where there are any."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from boomctl.arrays import Array
from boomctl.lti.hold import Step
from boomctl.simulation.contact.contacts import Contacts
from boomctl.simulation.controller import SampledController
from boomctl.simulation.plant import ModalPlant
from boomctl.simulation.signals import TimeGrid


@dataclass(frozen=True)
class Limits:
    """What a controller's hardware allows; ``inf`` for none.

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
        """Whether a measurement is quantised."""
        return bool(np.isfinite(self.quantum).any())


@dataclass(frozen=True)
class Added:
    """What is added to a controller's signals at each sample, where there is any.

    Attributes
    ----------
    noise, reference : (samples, measurements) ndarray or None
        Added to what is measured; taken from what the controller reads, after rounding.
    feedforward : (samples, controls) ndarray or None
        Added to what the controller asks for.
    """

    noise: Array | None = None
    reference: Array | None = None
    feedforward: Array | None = None

    @property
    def any(self) -> bool:
        """Whether anything is."""
        return self.noise is not None or self.reference is not None or self.feedforward is not None


NOTHING_ADDED = Added()


@dataclass(frozen=True)
class LoopProblem:
    """Everything that a run needs, checked.

    Attributes
    ----------
    W : (inputs, steps + 1) ndarray
        Disturbances on the grid.
    lag : int
        Whole steps by which the controls come late; ``maps`` knows the rest.
    start : (n,) ndarray
        Modal states at the first time.
    """

    plant: ModalPlant
    maps: Step
    controller: SampledController
    grid: TimeGrid
    W: Array
    lag: int
    limits: Limits
    start: Array
    contacts: Contacts | None
    added: Added = NOTHING_ADDED

    @property
    def forcing(self) -> Array:
        """What the disturbances add to the states at each step, (steps, n)."""
        used = np.flatnonzero(self.W.any(axis=1))
        W = self.W[used]
        return W[:, :-1].T @ self.maps.first[:, used].T + W[:, 1:].T @ self.maps.last[:, used].T

    @property
    def stepper(self) -> Array:
        """The map of states, control before and control after the switch to the states a step later."""
        d = self.controller.driven
        return np.hstack([self.maps.Phi, self.maps.before[:, d], self.maps.after[:, d]])

    @property
    def samples(self) -> int:
        """How often the controller is sampled, at the last time included if a sample falls on it."""
        return self.grid.steps // self.grid.per_sample + 1


@dataclass(frozen=True)
class ControlLog:
    """What the controller asked for at each sample, what it was given, and where which limit was met."""

    asked: Array
    given: Array
    saturated: Array
    slewed: Array

    def acting(self, steps: Array, late: int, per_sample: int) -> Array:
        """Return the controls that act at steps of the grid, (steps, controls): those given so many steps before."""
        sample = (steps - late) // per_sample
        return np.where((sample >= 0)[:, None], self.given[np.clip(sample, 0, len(self.given) - 1)], 0.0)


def control_log(p: LoopProblem) -> ControlLog:
    """Return a log to be filled."""
    shape = (p.samples, len(p.controller.driven))
    return ControlLog(np.zeros(shape), np.zeros(shape), np.zeros(shape, dtype=bool), np.zeros(shape, dtype=bool))


def sampler(p: LoopProblem, log: ControlLog) -> Callable[[int, Array], None]:
    """Return the function that takes sample ``k`` of the controller from ``[states, control]`` and writes it down."""
    c, plant = p.controller, p.plant
    ny, nu = len(c.measured), len(c.driven)
    reads = np.hstack([plant.C[c.measured], plant.D[np.ix_(c.measured, c.driven)]])
    heard = np.ascontiguousarray((plant.D[c.measured] @ p.W[:, :: p.grid.per_sample]).T)
    if p.added.noise is not None:
        heard += p.added.noise
    wanted, forward = p.added.reference, p.added.feedforward
    law = np.block([[c.D, c.C], [c.B, c.A]])
    known, found = np.zeros(ny + len(c.A)), np.zeros(nu + len(c.A))
    y, state, u, following = known[:ny], known[ny:], found[:nu], found[nu:]
    grain = (
        np.where(np.isfinite(p.limits.quantum), p.limits.quantum, 1.0) if np.isfinite(p.limits.quantum).any() else None
    )
    coarse = np.isfinite(p.limits.quantum)
    bounded = bool(np.isfinite(p.limits.force).any() or np.isfinite(p.limits.rate).any())
    force, rate, last = p.limits.force.tolist(), p.limits.rate.tolist(), [0.0] * nu
    asked, given, correction, laws = log.asked, log.given, c.L, c.laws
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
        np.dot(law, known, out=found)
        if forward is not None:
            u.__iadd__(forward[k])
        asked[k] = u
        if bounded and limited(u.tolist(), k, force, rate, last, log):
            given[k] = last
            if correct:
                following.__iadd__(correction @ (given[k] - asked[k]))
        else:
            given[k] = u
        state[:] = following

    return sample


def limited(u: list[float], k: int, force: list[float], rate: list[float], last: list[float], log: ControlLog) -> bool:
    """Put the controls given for those asked into ``last``, mark the limits that they meet, return whether one is met."""
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
    n, nu, per_sample, lag = len(p.plant.A), len(p.controller.driven), p.grid.per_sample, p.lag
    stepper, forcing, sample, given = p.stepper, p.forcing, sampler(p, log), log.given
    X = np.zeros((p.grid.steps + 1, n))
    X[0] = p.start
    full = np.zeros(n + 2 * nu)
    states, before, after, heard = full[:n], full[n : n + nu], full[n + nu :], full[: n + nu]
    states[:] = p.start
    for k in range(p.grid.steps):
        if k % per_sample == 0:
            sample(k // per_sample, heard)
        if k >= lag:
            after[:] = given[(k - lag) // per_sample]
        row = X[k + 1]
        np.dot(stepper, full, out=row)
        row += forcing[k]
        states[:] = row
        before[:] = after
    if p.grid.steps % per_sample == 0:
        sample(p.grid.steps // per_sample, heard)
    return p.plant.C @ X.T
