"""The response of a plant with Coulomb friction to sines, in time: stepped frequencies, each until it is steady.

All frequencies are stepped together, each with a step of its own, from the state that the describing function expects;
what is kept is the fundamental of the last period.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from boomctl.arrays import Array
from boomctl.checks import instance, known, positive, some_names, whole
from boomctl.lti.frequency import singular_values
from boomctl.progress import computing, tell
from boomctl.simulation.contact.contacts import Contact, contact_at
from boomctl.simulation.contact.friction import CoulombFriction, Slip, friction_step
from boomctl.simulation.plant import ModalPlant, modal_plant
from boomctl.simulation.sines.describing_function import (
    SineResponse,
    balanced_friction,
    describing_function,
    finite_response,
    positive_grid,
    sine_pattern,
)
from boomctl.structure.model import SecondOrderModel
from boomctl.threads import one_blas_thread

if TYPE_CHECKING:
    import control

_LEAST_PERIODS = 3  # periods before the response may count as steady: one to settle, two to compare
# share of a force's velocity that must be left at the end of a step: steps follow the motion at the contact
_FINE = 0.8
_MOST = 10_000  # steps a period, and periods, that can be asked for: a choice of patience
_DOUBLINGS = 6  # of the steps a period, at most: 64 times the number asked for


@one_blas_thread
def swept_sine(
    plant: SecondOrderModel | control.StateSpace,
    friction: CoulombFriction,
    omega: ArrayLike,
    excitation: str | dict[str, complex],
    amplitude: float,
    outputs: str | Sequence[str] | None = None,
    steps: int = 200,
    periods: int = 256,
    tolerance: float = 1e-4,
) -> SineResponse:
    """Return the fundamental of the steady response to a stepped sine, simulated with true stick-slip.

    Parameters
    ----------
    plant, friction, omega, excitation, amplitude, outputs
        As for :func:`describing_function`; break-away at ``static_force`` is simulated.
    steps : int
        Steps of the computation in a period, 16 to 10,000; more are taken at frequencies so low that a step would be long
        for the plant.
    periods : int
        Largest number of periods simulated at each frequency, at most 10,000.
    tolerance : float
        Change of the response from one window of periods to the next, relative to its size, at which it counts as
        steady.

    Returns
    -------
    SineResponse
        Fundamentals of the outputs per unit excitation, the slip, and where the contact sticks; ``settled`` says how steady
        each frequency was at the end.

    Raises
    ------
    TypeError, ValueError
        Unknown signals; amplitude, frequencies or tolerance not above zero; too few steps or periods.

    Examples
    --------
    >>> import boomctl as bc
    >>> dry = bc.CoulombFriction(3.0)
    >>> found = bc.simulation.swept_sine(bc.spray_boom(), dry, [9.0], "actuator_left", 0.01, steps=50)
    >>> found.gain.round(2), bool(found.stuck[0])
    (array([1.42]), False)
    """
    grid, size, law = (
        positive_grid(omega),
        positive("amplitude", amplitude),
        instance("friction", friction, CoulombFriction),
    )
    count, most = whole("steps", steps, 16, _MOST), whole("periods", periods, _LEAST_PERIODS, _MOST)
    modal = modal_plant(plant)
    excited, shape = sine_pattern(modal.inputs, excitation)
    read = some_names("output", outputs, modal.outputs)
    known("input of the friction", law.input, modal.inputs)
    drive = np.zeros(len(modal.inputs), dtype=complex)
    drive[[modal.inputs.index(name) for name in excited]] = size * shape
    rows = [modal.outputs.index(name) for name in read]
    slip_row = modal.outputs.index(known("output of a contact", law.output, modal.outputs))
    shaken = _Shaken(modal, law, drive)
    counts = np.array([_steps_needed(shaken, w, count) for w in grid])
    found = np.zeros((len(modal.outputs), len(grid)), dtype=complex)
    stuck, settled = np.zeros(len(grid), dtype=bool), np.zeros(len(grid))
    with computing("swept sine"):
        for steps_taken in np.unique(counts):
            here = np.flatnonzero(counts == steps_taken)
            sweep = _prepared(shaken, grid[here], int(steps_taken))
            states, stuck[here], settled[here] = _run(sweep, law, most, positive("tolerance", tolerance), modal.C[rows])
            found[:, here] = modal.C @ states.T + (modal.D @ drive)[:, None]
    if stuck.any():
        found[:, stuck] = _held(shaken, grid[stuck])
    slip = np.where(stuck, 0.0, np.abs(found[slip_row]))
    return SineResponse(
        omega=grid,
        response=finite_response(found[rows] / size, grid),
        slip=slip,
        stuck=stuck,
        amplitude=size,
        inputs=excited,
        outputs=read,
        settled=settled,
    )


@dataclass(frozen=True)
class _Shaken:
    """A plant with friction, and the complex amplitudes of the sines on its inputs."""

    plant: ModalPlant
    law: CoulombFriction
    drive: Array

    @property
    def slip(self) -> int:
        """Which output is the slip."""
        return self.plant.outputs.index(self.law.output)

    @property
    def acts(self) -> int:
        """Through which input friction acts."""
        return self.plant.inputs.index(self.law.input)


def _steps_needed(shaken: _Shaken, omega: float, steps: int) -> int:
    """Return how many steps a period takes: more than wanted where a step would be long for the motion at the contact."""
    plant = shaken.plant
    velocity, column = plant.C[shaken.slip] @ plant.A, plant.B[:, [shaken.acts]]
    for count in steps * 2 ** np.arange(_DOUBLINGS):
        h = 2.0 * np.pi / (omega * count)
        if velocity @ plant.hold(h, [shaken.acts])[1] >= _FINE * h * (velocity @ column):
            return int(count)
    return steps * 2**_DOUBLINGS


def _held(shaken: _Shaken, grid: Array) -> Array:
    """Return all outputs with the slip held at zero, (outputs, frequencies): no step by step about it."""
    plant, row, solved = shaken.plant, shaken.slip, _responses(shaken, grid)
    moved, per_force = (plant.C @ solved[:, :, k].T for k in (0, 1))
    moved = moved + (plant.D @ shaken.drive)[:, None]
    per_force = per_force + plant.D[:, [shaken.acts]]
    return moved - per_force * (moved[row] / per_force[row])


def _responses(shaken: _Shaken, grid: Array) -> Array:
    """Return the states' responses to the excitation and to a unit friction force, (frequencies, n, 2)."""
    plant = shaken.plant
    load = np.column_stack([plant.B @ shaken.drive, plant.B[:, shaken.acts].astype(complex)])
    with np.errstate(all="ignore"):
        try:
            solved = np.linalg.solve(1j * grid[:, None, None] * np.eye(len(plant.A)) - plant.A, load[None])
        except np.linalg.LinAlgError:
            raise ValueError("omega: expected no frequency at an undamped resonance of the plant") from None
        return np.moveaxis(finite_response(np.moveaxis(solved, 0, -1), grid), -1, 0)


@dataclass(frozen=True)
class _Sweep:
    """Maps of all frequencies (first axis) over a step, forcing at each step of a period, and contact rows."""

    Phi: Array
    forcing: Array
    velocity: Array
    held: Array
    gain: Array
    offset: Array
    start: Array


def _prepared(shaken: _Shaken, grid: Array, count: int) -> _Sweep:
    plant, law, drive = shaken.plant, shaken.law, shaken.drive
    turns = np.exp(2j * np.pi * np.arange(count + 1) / count)
    waves = np.real(drive[:, None] * turns)
    maps = [plant.step(2.0 * np.pi / (w * count)) for w in grid]
    places: list[Contact] = [contact_at(plant, step, law.output, law.input) for step in maps]
    forcing = np.array([step.first @ waves[:, :-1] + step.last @ waves[:, 1:] for step in maps])
    rates = np.real(1j * grid[:, None, None] * drive[:, None] * turns)
    through = (place.through for place in places)
    offset = np.array([at_once[1] @ waves + at_once[0] @ rate for at_once, rate in zip(through, rates, strict=True)])
    return _Sweep(
        Phi=np.array([step.Phi for step in maps]),
        forcing=np.ascontiguousarray(forcing.transpose(2, 0, 1)),
        velocity=places[0].velocity,
        held=np.array([place.held for place in places]),
        gain=np.array([place.gain for place in places]),
        offset=offset,
        start=_balanced_start(shaken, grid),
    )


def _balanced_start(shaken: _Shaken, grid: Array) -> Array:
    """Return the states that the harmonic balance expects at the beginning of a period, (frequencies, n)."""
    plant, row, solved = shaken.plant, shaken.slip, _responses(shaken, grid)
    slips = np.einsum("n,fnk->fk", plant.C[row], solved)
    force, _ = balanced_friction(slips[:, 0] + plant.D[row] @ shaken.drive, slips[:, 1], shaken.law.force)
    return np.real(solved[:, :, 0] + solved[:, :, 1] * force[:, None])


def _run(
    sweep: _Sweep, law: CoulombFriction, periods: int, tolerance: float, rows: Array
) -> tuple[Array, Array, Array]:
    """Step all frequencies until they are steady; return fundamentals of the states, who stuck, and how steady.

    Fundamentals are averaged over windows, each twice as long as the one before: what is not in step with the
    excitation (a lightly damped mode that still rings) averages out.
    """
    X = sweep.start.copy()
    speed = X @ sweep.velocity + sweep.offset[:, 0]
    slipping = [Slip(float(value), False, None) for value in speed]
    old, window, done = np.zeros(X.shape, dtype=complex), 1, 0
    while True:
        tell("periods", done, periods)
        found, at_rest = np.zeros(X.shape, dtype=complex), np.ones(len(X), dtype=bool)
        for _ in range(window):
            X, slipping, fundamental, rested = _period(sweep, law, X, slipping)
            found += fundamental / window
            at_rest &= rested
        done += window
        size = np.maximum(np.linalg.norm(found @ rows.T, axis=1), np.finfo(float).tiny)
        settled = np.linalg.norm((found - old) @ rows.T, axis=1) / size
        if (done >= _LEAST_PERIODS and settled.max() <= tolerance) or done + 2 * window > periods:
            return found, at_rest, settled
        old, window = found, 2 * window


def _period(
    sweep: _Sweep, law: CoulombFriction, X: Array, slipping: list[Slip]
) -> tuple[Array, list[Slip], Array, Array]:
    """Step one period; return states and slips at its end, the fundamental of the states, and who stuck throughout."""
    count = len(sweep.forcing)
    turns, gains = np.exp(-2j * np.pi * np.arange(count) / count) * (2.0 / count), sweep.gain.tolist()
    found, at_rest = np.zeros(X.shape, dtype=complex), np.ones(len(X), dtype=bool)
    for k in range(count):
        found += turns[k] * X
        X = (sweep.Phi @ X[:, :, None])[:, :, 0] + sweep.forcing[k]
        free = (X @ sweep.velocity + sweep.offset[:, k + 1]).tolist()
        steps = [friction_step(now, end, gain, law) for now, end, gain in zip(slipping, free, gains, strict=True)]
        X = X + sweep.held * np.array([step.force for step in steps])[:, None]
        slipping = [now.after(step) for now, step in zip(slipping, steps, strict=True)]
        at_rest &= [now.stuck for now in slipping]
    return X, slipping, found, at_rest


@one_blas_thread
def sine_sigma(
    plant: SecondOrderModel | control.StateSpace,
    friction: CoulombFriction,
    omega: ArrayLike,
    patterns: Sequence[dict[str, complex]],
    amplitude: float,
    outputs: str | Sequence[str] | None = None,
    method: str = "swept",
) -> Array:
    """Return the singular values of a plant with friction as they are measured: from independent patterns of sines.

    Each pattern is applied on its own; the response matrix is what takes the patterns to the responses.

    Parameters
    ----------
    plant, friction, omega, amplitude, outputs
        As for :func:`describing_function`.
    patterns : sequence of mapping from input to complex
        As many independent patterns as there are inputs excited.
    method : "swept" or "balance"
        How the responses are found: by :func:`swept_sine` or by :func:`describing_function`.

    Returns
    -------
    (k, n) ndarray
        Singular values at each of the ``n`` frequencies, descending.

    Raises
    ------
    TypeError, ValueError
        Patterns that depend on each other or are not as many as inputs; what the methods raise.

    Examples
    --------
    >>> import boomctl as bc
    >>> both = [{"actuator_left": 1.0, "actuator_right": 1.0}, {"actuator_left": -1.0, "actuator_right": 1.0}]
    >>> dry = bc.CoulombFriction(3.0)
    >>> boom, tips = bc.spray_boom(), ["tip_left", "tip_right"]
    >>> bc.simulation.sine_sigma(boom, dry, [9.0], both, 0.01, tips, method="balance").round(3)
    array([[0.679],
           [0.444]])
    """
    known("method", method, ("swept", "balance"))
    if not isinstance(patterns, Sequence) or not all(isinstance(pattern, Mapping) for pattern in patterns):
        raise TypeError(f"patterns = {patterns!r}: expected a sequence of mappings from inputs to amplitudes")
    inputs = tuple(dict.fromkeys(name for pattern in patterns for name in pattern))
    if len(patterns) != len(inputs):
        raise ValueError(f"patterns: {len(patterns)} for the inputs {', '.join(inputs)}; expected one an input")
    shapes = np.zeros((len(inputs), len(patterns)), dtype=complex)
    for k, pattern in enumerate(patterns):
        used, share = sine_pattern(inputs, pattern)
        shapes[[inputs.index(name) for name in used], k] = share
    if not len(inputs) or np.linalg.cond(shapes) > 1e6:
        raise ValueError("patterns: expected independent ones")
    respond = swept_sine if method == "swept" else describing_function
    found = [respond(plant, friction, omega, dict(pattern), amplitude, outputs).response for pattern in patterns]
    measured = np.moveaxis(np.array(found), 0, 1)
    matrix = np.einsum("opn,pi->oin", measured, np.linalg.inv(shapes))
    return singular_values(matrix)
