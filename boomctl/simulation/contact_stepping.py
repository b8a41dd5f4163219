"""The loop with contacts: friction and end stops found together in each step."""

from dataclasses import dataclass

import numpy as np

from boomctl.arrays import Array
from boomctl.simulation.contacts import Contacts
from boomctl.simulation.friction import CoulombFriction, FrictionStep, friction_step
from boomctl.simulation.stepping import ControlLog, LoopProblem, sampler
from boomctl.simulation.stops import StopStep, stop_step

__all__ = ["ContactLog", "run_contact"]

_ROUNDS = 30
_AGREED = 1e-12
_REST = 1e-12


@dataclass(frozen=True)
class ContactLog:
    """What contacts did.

    Attributes
    ----------
    friction : (steps,) ndarray
        Mean friction force in each step [N].
    stuck : (steps,) ndarray
        Share of each step spent at rest.
    dissipated : (steps,) ndarray
        Energy that friction took in each step [J].
    touched : list
        ``(stop, side, step, impulse, speed)`` of each stop touched in each step.
    """

    friction: Array
    stuck: Array
    dissipated: Array
    touched: list[tuple[int, int, int, float, float]]


@dataclass(frozen=True)
class _Motion:
    """Slip and strokes that the disturbances alone bring, at each step."""

    slip: tuple[Array, Array]
    strokes: tuple[Array, Array]


def _motion(p: LoopProblem, contacts: Contacts) -> _Motion:
    none = np.zeros(p.grid.steps + 1)
    slip = (none, none) if contacts.slip is None else contacts.slip.offsets(p.W, p.grid.h, p.grid.per_point)
    found = [stop.offsets(p.W, p.grid.h, p.grid.per_point) for stop in contacts.stops]
    strokes = tuple(np.column_stack([pair[kind] for pair in found]) if found else none[:, None] for kind in (0, 1))
    return _Motion(slip, (strokes[0], strokes[1]))


def run_contact(p: LoopProblem, log: ControlLog, contacts: Contacts) -> tuple[Array, ContactLog]:
    """Step a loop with contacts; return ``C`` times the modal states at the given times, and what contacts did."""
    n, nu, per_sample, per_point = len(p.plant.A), len(p.controller.driven), p.grid.per_sample, p.grid.per_point
    stepper, forcing, sample, motion = p.stepper, p.forcing, sampler(p, log), _motion(p, contacts)
    kept = ContactLog(np.zeros(p.grid.steps), np.zeros(p.grid.steps), np.zeros(p.grid.steps), [])
    X = np.zeros((len(p.grid.time), n))
    X[0] = p.start
    full = np.zeros(n + 2 * nu)
    states, before, after, heard = full[:n], full[n : n + nu], full[n + nu :], full[: n + nu]
    states[:] = p.start
    jumps = _control_offsets(p, contacts)
    slip = _SlipState.at(p, contacts, motion)
    for k in range(p.grid.steps):
        if k % per_sample == 0:
            sample(k // per_sample, heard)
        if k >= p.lag:
            after[:] = log.given[(k - p.lag) // per_sample]
        free = stepper @ full
        free += forcing[k]
        slip = _settle(
            p, contacts, motion, k, states, free, after @ jumps if nu else np.zeros(len(jumps.T)), slip, kept
        )
        states[:] = free
        before[:] = after
        if (k + 1) % per_point == 0:
            X[(k + 1) // per_point] = free
    if p.grid.steps % per_sample == 0:
        sample(p.grid.steps // per_sample, heard)
    return p.plant.C @ X.T, kept


def _control_offsets(p: LoopProblem, contacts: Contacts) -> Array:
    """Return what each control adds to the velocities at the contacts at once, (controls, 1 + stops)."""
    places = [contacts.slip, *contacts.stops]
    columns = [
        np.zeros(len(p.controller.driven)) if place is None else place.through[1, p.controller.driven]
        for place in places
    ]
    return np.column_stack(columns)


@dataclass(frozen=True)
class _SlipState:
    """Slip velocity, whether it is at rest, and the force that held it."""

    velocity: float
    stuck: bool
    held: float | None

    @classmethod
    def at(cls, p: LoopProblem, contacts: Contacts, motion: _Motion) -> "_SlipState":
        if contacts.slip is None:
            return cls(0.0, True, None)
        speed = float(contacts.slip.velocity @ p.start + motion.slip[1][0])
        size = float(np.abs(contacts.slip.velocity) @ np.abs(p.start)) + float(np.abs(motion.slip[1]).max())
        return cls(speed, abs(speed) <= _REST * size, None)


def _settle(
    p: LoopProblem,
    contacts: Contacts,
    motion: _Motion,
    k: int,
    start: Array,
    free: Array,
    jumps: Array,
    slip: _SlipState,
    kept: ContactLog,
) -> _SlipState:
    """Add to ``free``, the states at the end of step ``k`` without contact forces, what these do; write them down."""
    law, place, maps = contacts.law, contacts.slip, contacts.stop_maps
    step: FrictionStep | None = None
    stops: StopStep | None = None
    states = free
    for _ in range(_ROUNDS):
        old = stops
        states = free if stops is None or maps is None else free + maps.states @ stops.amounts
        if law is not None and place is not None:
            end = float(place.velocity @ states) + float(motion.slip[1][k + 1]) + float(jumps[0])
            step = friction_step(slip.velocity, slip.stuck, end, place.gain, law, slip.held)
            states = states + place.held * step.force
        if maps is None:
            break
        unstopped = states if stops is None else states - maps.states @ stops.amounts
        stops = _stopped(contacts, motion, k, unstopped, jumps)
        states = unstopped if stops is None else unstopped + maps.states @ stops.amounts
        if step is None or _agree(old, stops):
            break
    else:
        step = _as_it_is(contacts, motion, k, states, jumps, step)
    if step is not None and place is not None and law is not None:
        _write_friction(p, contacts, motion, k, (start, states), slip, step, kept)
        slip = _SlipState(step.velocity, step.stuck, step.force if step.stuck and step.sliding == 0.0 else None)
    if stops is not None:
        _write_stops(contacts, motion, k, start, stops, kept)
    free[:] = states
    return slip


def _as_it_is(
    contacts: Contacts, motion: _Motion, k: int, states: Array, jumps: Array, step: FrictionStep | None
) -> FrictionStep | None:
    """Return a step whose friction force is taken as found while an impact changes whether the slip sticks.

    The law then fails within this one step, the stops hold; the slip goes on with the velocity that it has.
    """
    if step is None or contacts.slip is None:
        return step
    speed = float(contacts.slip.velocity @ states) + float(motion.slip[1][k + 1]) + float(jumps[0])
    return FrictionStep(step.force, speed, False, step.sliding, step.first)


def _stopped(contacts: Contacts, motion: _Motion, k: int, states: Array, jumps: Array) -> StopStep | None:
    assert contacts.stop_maps is not None
    position = np.array([stop.position @ states for stop in contacts.stops]) + motion.strokes[0][k + 1]
    if not (np.abs(position) > contacts.stop_maps.limits).any():
        return None
    velocity = np.array([stop.velocity @ states for stop in contacts.stops]) + motion.strokes[1][k + 1] + jumps[1:]
    return stop_step(contacts.stop_maps, position, velocity)


def _agree(old: StopStep | None, new: StopStep | None) -> bool:
    if old is None or new is None:
        return old is new
    return bool(np.abs(new.amounts - old.amounts).max() <= _AGREED * np.abs(new.amounts).max())


def _write_friction(
    p: LoopProblem,
    contacts: Contacts,
    motion: _Motion,
    k: int,
    ends: tuple[Array, Array],
    slip: _SlipState,
    step: FrictionStep,
    kept: ContactLog,
) -> None:
    place, law = contacts.slip, contacts.law
    assert place is not None
    assert isinstance(law, CoulombFriction)
    kept.friction[k] = step.force
    kept.stuck[k] = 1.0 - step.sliding if step.stuck else 0.0
    way = float(place.position @ (ends[1] - ends[0])) + float(motion.slip[0][k + 1] - motion.slip[0][k])
    if slip.stuck:
        kept.dissipated[k] = 0.0 if step.stuck else law.force * abs(way)
    elif step.sliding == 1.0:
        kept.dissipated[k] = law.force * abs(way)
    else:
        coming = 0.5 * slip.velocity * step.sliding * p.grid.h
        going = 0.0 if step.stuck else 0.5 * step.velocity * (1.0 - step.sliding) * p.grid.h
        kept.dissipated[k] = law.force * (abs(coming) + abs(going))


def _write_stops(contacts: Contacts, motion: _Motion, k: int, start: Array, stops: StopStep, kept: ContactLog) -> None:
    for i in np.flatnonzero(stops.sides):
        speed = float(contacts.stops[i].velocity @ start + motion.strokes[1][k, i])
        kept.touched.append((int(i), int(stops.sides[i]), k, float(stops.impulses[i]), speed))
