"""One step with contacts: the friction force and what the stops do, found together.

A *row* is what a step ends in: the states, then what the contacts read of them, ``[slip velocity, slip, strokes, stroke
velocities]``.  All of it is linear in the contact forces.  While the slip is held, the friction force is what the stops
leave to be held: it is eliminated, and the stops are solved for with the slip at rest.  While it slides the force is
known.  Only where the slip reverses or breaks away within the step the force depends on what the stops do in another
way; it is then the root of a function that falls.
"""

from dataclasses import dataclass

import numpy as np

from boomctl.arrays import Array
from boomctl.simulation.contact.contacts import Contacts
from boomctl.simulation.contact.friction import CoulombFriction, FrictionStep, friction_step
from boomctl.simulation.contact.stops import StopMaps, StopStep, stop_step

_AGREED = 1e-9
_NARROW = 1e-13
_ROUNDS = 80

Outcome = tuple[Array, FrictionStep | None, StopStep | None]


@dataclass(frozen=True)
class SlipState:
    """Slip velocity, whether it is at rest, and the force that held it over the whole step before (or ``None``)."""

    velocity: float
    stuck: bool
    held: float | None

    def after(self, step: FrictionStep) -> "SlipState":
        """Return the state at the end of a step."""
        return SlipState(step.velocity, step.stuck, step.force if step.stuck and step.sliding == 0.0 else None)


@dataclass(frozen=True)
class ContactRows:
    """What contacts read and what their forces do, in rows.

    Attributes
    ----------
    reads : (2 + 2 stops, n) ndarray
        What contacts read of the states.
    offsets : (steps + 1, 2 + 2 stops) ndarray
        What the disturbances add to that at each step.
    jumps : (2 + 2 stops, controls) ndarray
        What the controls add to it at once.
    law : CoulombFriction or None
    held : (n + 2 + 2 stops,) ndarray
        What a unit friction force over a whole step adds to a row; ``gain`` is its slip velocity.
    gain : float
    sliding, sticking : StopMaps or None
        What stops do to a row, the friction force given or the slip held.
    """

    reads: Array
    offsets: Array
    jumps: Array
    law: CoulombFriction | None
    held: Array
    gain: float
    sliding: StopMaps | None
    sticking: StopMaps | None

    @property
    def stops(self) -> int:
        """Number of stops."""
        return (len(self.reads) - 2) // 2


def contact_rows(contacts: Contacts, W: Array, h: float, per_point: int, driven: Array) -> ContactRows:
    """Return the rows of some contacts for the disturbances ``W`` (inputs, steps + 1) and the controls driven."""
    n, none = len((contacts.slip or contacts.stops[0]).position), np.zeros(W.shape[1])
    slip, stops = contacts.slip, contacts.stops
    moved = [stop.offsets(W, h, per_point) for stop in stops]
    slipped = (none, none) if slip is None else slip.offsets(W, h, per_point)
    places = [slip, None, *(None for _ in stops), *stops]
    reads = np.vstack(
        [
            *([np.zeros((2, n))] if slip is None else [slip.velocity, slip.position]),
            *(stop.position for stop in stops),
            *(stop.velocity for stop in stops),
        ]
    )
    jumps = np.array([np.zeros(len(driven)) if place is None else place.through[1, driven] for place in places])
    whole = np.vstack([np.eye(n), reads])
    held, gain = (np.zeros(len(whole)), 1.0) if slip is None else (whole @ slip.held, slip.gain)
    offsets = np.column_stack([slipped[1], slipped[0], *(pair[0] for pair in moved), *(pair[1] for pair in moved)])
    sliding = sticking = None
    if contacts.stop_maps is not None:
        pushed = whole @ contacts.stop_maps.states
        sliding = _maps(pushed, n, contacts.stop_maps.limits)
        sticking = _maps(pushed - np.outer(held, pushed[n]) / gain, n, contacts.stop_maps.limits)
    return ContactRows(reads, offsets, jumps, contacts.law, held, gain, sliding, sticking)


def _maps(rows: Array, n: int, limits: Array) -> StopMaps:
    first, count = n + 2, len(limits)
    return StopMaps(rows[first : first + count], rows[first + count :], rows, limits)


def contact_step(rows: ContactRows, row: Array, slip: SlipState) -> Outcome:
    """Return the row with contact forces, from that without them, and what friction and stops did.

    Raises
    ------
    ArithmeticError
        No set of stops is consistent.
    """
    step, end = None, row
    if rows.law is not None:
        step = _friction(rows, float(row[-len(rows.reads)]), slip)
        end = row + step.force * rows.held
    if rows.sliding is None or not (np.abs(_strokes(rows, end)) > rows.sliding.limits).any():
        return end, step, None
    if step is None:
        end, stops = _stopped(rows, rows.sliding, row)
        return end, None, stops
    return _together(rows, row, slip, step)


def _strokes(rows: ContactRows, row: Array) -> Array:
    first = len(row) - 2 * rows.stops
    return row[first : first + rows.stops]


def _stopped(rows: ContactRows, maps: StopMaps | None, row: Array) -> tuple[Array, StopStep | None]:
    """Return a row with what the stops do, and that."""
    assert maps is not None
    stops = stop_step(maps, _strokes(rows, row), row[len(row) - rows.stops :])
    return (row, None) if stops is None else (row + maps.states @ stops.amounts, stops)


def _friction(rows: ContactRows, free: float, slip: SlipState) -> FrictionStep:
    assert rows.law is not None
    return friction_step(slip.velocity, slip.stuck, free, rows.gain, rows.law, slip.held)


def _together(rows: ContactRows, row: Array, slip: SlipState, alone: FrictionStep) -> Outcome:
    """Return a step in which stops are touched: held or sliding throughout if either agrees with the law."""
    force = 0.0 if rows.law is None else rows.law.force
    sliding = (force, -force) if slip.stuck else (-force if slip.velocity > 0.0 else force,)
    for held in (True, False) if slip.stuck or alone.stuck else (False, True):
        if held:
            found = _holding(rows, row, slip)
            if found is not None:
                return found
            continue
        for trial in sliding:
            end, step, stops = _under(rows, row, slip, trial)
            if abs(step.force - trial) <= _AGREED * force:
                return end, step, stops
    return _reversing(rows, row, slip)


def _holding(rows: ContactRows, row: Array, slip: SlipState) -> Outcome | None:
    """Return the step with the slip at rest at its end, ``None`` if friction does not bring it there."""
    at = len(row) - len(rows.reads)
    try:
        end, stops = _stopped(rows, rows.sticking, row - row[at] / rows.gain * rows.held)
    except ArithmeticError:
        return None
    free = float(row[at])
    if stops is not None and rows.sliding is not None:
        free += float(rows.sliding.states[at] @ stops.amounts)
    step = _friction(rows, free, slip)
    return (end, step, stops) if step.stuck else None


def _under(rows: ContactRows, row: Array, slip: SlipState, force: float) -> tuple[Array, FrictionStep, StopStep | None]:
    """Return the row under a friction force, the step that the law answers to what the stops then do, and that."""
    at = len(row) - len(rows.reads)
    end, stops = _stopped(rows, rows.sliding, row + force * rows.held)
    return end, _friction(rows, float(end[at]) - rows.gain * force, slip), stops


def _reversing(rows: ContactRows, row: Array, slip: SlipState) -> Outcome:
    """Return the step whose friction force is the law's own answer, by bisection: the answer grows slower than the force.

    Where the stops change between two forces there may be none (an impact decides whether the slip breaks away): the
    law then fails within this one step, the stops hold, and the slip goes on with the velocity that it has.
    """
    assert rows.law is not None
    size = rows.law.breakaway
    low, high, force = -size, size, 0.0
    end, step, stops = _under(rows, row, slip, force)
    for _ in range(_ROUNDS):
        off = step.force - force
        if abs(off) <= _AGREED * size:
            return end, step, stops
        low, high = (force, high) if off > 0.0 else (low, force)
        if high - low <= _NARROW * size:
            break
        force = step.force if low + 0.1 * (high - low) < step.force < high - 0.1 * (high - low) else 0.5 * (low + high)
        end, step, stops = _under(rows, row, slip, force)
    speed = float(end[len(row) - len(rows.reads)])
    return end, FrictionStep(force, speed, False, step.sliding, step.first), stops
