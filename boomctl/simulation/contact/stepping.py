"""The loop with contacts, step by step: friction force and stop forces, solved together.

A *row* holds the values at the end of a step: the states, then the contacts' readings of them, ``[slip velocity, slip,
strokes, stroke velocities]``.  A row is linear in the contact forces.  While the slip sticks, the friction force is a
reaction: it is eliminated, and the stops are solved with the slip at rest.  While it slides the force is known.  If the slip
reverses or breaks away within the step, the force depends on the stops nonlinearly; it is then the root of a decreasing
function.
"""

from dataclasses import dataclass

import numpy as np

from boomctl.arrays import Array
from boomctl.lti.rounding import ALIKE, SOLVED, SUMMED
from boomctl.simulation.contact.contacts import Contacts
from boomctl.simulation.contact.friction import CoulombFriction, FrictionStep, Slip, friction_step
from boomctl.simulation.contact.stops import StopMaps, StopStep, stop_step
from boomctl.simulation.plant import Step
from boomctl.simulation.stepping import ControlLog, LoopProblem, run_steps

Outcome = tuple[Array, FrictionStep | None, StopStep | None]


@dataclass(frozen=True)
class ContactRows:
    """Readings of contacts and effects of their forces, as rows.

    Attributes
    ----------
    reads : (2 + 2 stops, n) ndarray
        Contacts' readings of the states.
    offsets : (steps + 1, 2 + 2 stops) ndarray
        Direct effect of the disturbances on the readings at each step.
    jumps : (2 + 2 stops, controls) ndarray
        Direct effect of the controls on the readings.
    law : CoulombFriction or None
    held : (n + 2 + 2 stops,) ndarray
        Effect of a unit friction force over a full step on a row; ``gain`` is its slip velocity.
    gain : float
    sliding, sticking : StopMaps
        Effect of stops on a row, at a known friction force, or with the slip at rest.
    """

    reads: Array
    offsets: Array
    jumps: Array
    law: CoulombFriction | None
    held: Array
    gain: float
    sliding: StopMaps
    sticking: StopMaps

    @property
    def stops(self) -> int:
        """Number of stops."""
        return (len(self.reads) - 2) // 2


def contact_rows(contacts: Contacts, maps: Step, W: Array, per_point: int, driven: Array) -> ContactRows:
    """Return the rows of contacts for the disturbances ``W`` (inputs, steps + 1) and the driven controls."""
    n, none, h = len(maps.Phi), np.zeros(W.shape[1]), maps.h
    slip, stops = contacts.slip, contacts.stops
    moved = [stop.offsets(W, h, per_point) for stop in stops]
    slipped = (none, none) if slip is None else slip.offsets(W, h, per_point)
    jumping = [slip, None, *(None for _ in stops), *stops]
    reads = np.vstack(
        [
            *([np.zeros((2, n))] if slip is None else [slip.velocity, slip.position]),
            *(stop.position for stop in stops),
            *(stop.velocity for stop in stops),
        ]
    )
    jumps = np.array([np.zeros(len(driven)) if item is None else item.through[1, driven] for item in jumping])
    whole = np.vstack([np.eye(n), reads])
    held, gain = (np.zeros(len(whole)), 1.0) if slip is None else (whole @ slip.held, slip.gain)
    offsets = np.column_stack([slipped[1], slipped[0], *(pair[0] for pair in moved), *(pair[1] for pair in moved)])
    moved_by = [*(maps.Phi @ stop.column for stop in stops), *(stop.held / h for stop in stops)]
    pushed = whole @ np.array(moved_by).reshape(-1, n).T
    return ContactRows(
        reads=reads,
        offsets=offsets,
        jumps=jumps,
        law=contacts.law,
        held=held,
        gain=gain,
        sliding=_maps(pushed, n, contacts.limits),
        sticking=_maps(pushed - np.outer(held, pushed[n]) / gain, n, contacts.limits),
    )


def _maps(rows: Array, n: int, limits: Array) -> StopMaps:
    first, count = n + 2, len(limits)
    return StopMaps(rows[first : first + count], rows[first + count :], rows, limits)


def contact_step(rows: ContactRows, row: Array, slip: Slip) -> Outcome:
    """Return the row with contact forces, from the row without them, and the friction and stop steps.

    Raises
    ------
    ArithmeticError
        If no set of stops is consistent.
    """
    step, end = None, row
    if rows.law is not None:
        step = _friction(rows, float(row[-len(rows.reads)]), slip)
        end = row + step.force * rows.held
    if not rows.stops or not (np.abs(_strokes(rows, end)) > rows.sliding.limits).any():
        return end, step, None
    if step is None:
        end, stops = _stopped(rows, rows.sliding, row)
        return end, None, stops
    return _together(rows, row, slip, step)


def _strokes(rows: ContactRows, row: Array) -> Array:
    first = len(row) - 2 * rows.stops
    return row[first : first + rows.stops]


def _stopped(rows: ContactRows, maps: StopMaps, row: Array) -> tuple[Array, StopStep | None]:
    """Return a row with the effect of the stops, and the stop step."""
    stops = stop_step(maps, _strokes(rows, row), row[len(row) - rows.stops :])
    return (row, None) if stops is None else (row + maps.states @ stops.amounts, stops)


def _friction(rows: ContactRows, free: float, slip: Slip) -> FrictionStep:
    assert rows.law is not None
    return friction_step(slip, free, rows.gain, rows.law)


def _together(rows: ContactRows, row: Array, slip: Slip, alone: FrictionStep) -> Outcome:
    """Return a step in which stops are touched: sticking or sliding throughout if either agrees with the law."""
    force = 0.0 if rows.law is None else rows.law.sliding_force
    sliding = (force, -force) if slip.stuck else (-force if slip.velocity > 0.0 else force,)
    for held in (True, False) if slip.stuck or alone.stuck else (False, True):
        if held:
            result = _holding(rows, row, slip)
            if result is not None:
                return result
            continue
        for trial in sliding:
            end, step, stops = _under(rows, row, slip, trial)
            # relative to the sliding force: two forces that differ by less are equal
            if abs(step.force - trial) <= ALIKE * force:
                return end, step, stops
    return _reversing(rows, row, slip)


def _holding(rows: ContactRows, row: Array, slip: Slip) -> Outcome | None:
    """Return the step with the slip at rest at its end, ``None`` if friction does not bring it there."""
    at = len(row) - len(rows.reads)
    try:
        end, stops = _stopped(rows, rows.sticking, row - row[at] / rows.gain * rows.held)
    except ArithmeticError:
        return None
    free = float(row[at])
    if stops is not None:
        free += float(rows.sliding.states[at] @ stops.amounts)
    step = _friction(rows, free, slip)
    return (end, step, stops) if step.stuck else None


def _under(rows: ContactRows, row: Array, slip: Slip, force: float) -> tuple[Array, FrictionStep, StopStep | None]:
    """Return the row under a friction force, the friction step by the law with these stops, and the stop step."""
    at = len(row) - len(rows.reads)
    end, stops = _stopped(rows, rows.sliding, row + force * rows.held)
    return end, _friction(rows, float(end[at]) - rows.gain * force, slip), stops


def _reversing(rows: ContactRows, row: Array, slip: Slip) -> Outcome:
    """Return the step whose friction force is a fixed point of the law, by bisection; the law's force grows slower.

    If the stops change between two forces there may be no fixed point (an impact decides whether the slip breaks away): the
    law is then violated in this step, the stops are satisfied, and the slip continues with its velocity.
    """
    assert rows.law is not None
    size = rows.law._breakaway_force
    low, high, force = -size, size, 0.0
    end, step, stops = _under(rows, row, slip, force)
    while True:  # a step reduces the bracket by a tenth at least
        off = step.force - force
        if abs(off) <= ALIKE * size:
            return end, step, stops
        low, high = (force, high) if off > 0.0 else (low, force)
        if high - low <= SOLVED * size:  # relative to the largest friction force: rounding error of the bisection
            break
        force = step.force if low + 0.1 * (high - low) < step.force < high - 0.1 * (high - low) else 0.5 * (low + high)
        end, step, stops = _under(rows, row, slip, force)
    speed = float(end[len(row) - len(rows.reads)])
    return end, FrictionStep(force, speed, False, step.sliding), stops


@dataclass(frozen=True)
class ContactLog:
    """Record of contacts.

    Attributes
    ----------
    friction : (steps,) ndarray
        Mean friction force in each step [N].
    stuck : (steps,) ndarray
        Fraction of each step spent sticking.
    dissipated : (steps,) ndarray
        Energy dissipated by friction in each step [J].
    touched : list
        ``(stop, side, step, impulse, speed)`` of each stop touched in each step.
    """

    friction: Array
    stuck: Array
    dissipated: Array
    touched: list[tuple[int, int, int, float, float]]

    @classmethod
    def of(cls, steps: int) -> "ContactLog":
        """Return an empty log."""
        return cls(np.zeros(steps), np.zeros(steps), np.zeros(steps), [])

    def write_friction(self, k: int, slip: Slip, step: FrictionStep, *, force: float, h: float, moved: float) -> None:
        """Log friction in step ``k`` of ``h`` [s], with sliding force ``force`` and a change of slip by ``moved``."""
        self.friction[k] = step.force
        self.stuck[k] = 1.0 - step.sliding if step.stuck else 0.0
        if slip.stuck:
            self.dissipated[k] = 0.0 if step.stuck else force * abs(moved)
        elif step.sliding == 1.0:
            self.dissipated[k] = force * abs(moved)
        else:
            coming = 0.5 * slip.velocity * step.sliding * h
            going = 0.0 if step.stuck else 0.5 * step.velocity * (1.0 - step.sliding) * h
            self.dissipated[k] = force * (abs(coming) + abs(going))


def run_contact(p: LoopProblem, log: ControlLog, contacts: Contacts) -> tuple[Array, ContactLog]:
    """Step a loop with contacts; return ``C`` times the modal states at the requested times, and the contact log."""
    n, per_point = len(p.plant.A), p.grid.per_point
    rows = contact_rows(contacts, p.maps, p.W, per_point, np.asarray(p.controller.driven, dtype=int))
    contact_log = ContactLog.of(p.grid.steps)
    old, slip = np.concatenate([p.start, rows.reads @ p.start + rows.offsets[0]]), _at_start(p, rows)
    reach, strokes = contacts.limits, slice(n + 2, n + 2 + rows.stops)

    def touched(k: int, row: Array) -> Array:
        nonlocal old, slip
        if rows.law is not None or (np.abs(row[strokes]) > reach).any():
            row, step, stops = contact_step(rows, row, slip)
            if step is not None and rows.law is not None:
                moved = float(row[n + 1] - old[n + 1])
                contact_log.write_friction(k, slip, step, force=rows.law.sliding_force, h=p.grid.h, moved=moved)
                slip = slip.after(step)
            if stops is not None:
                speeds = old[n + 2 + rows.stops :].tolist()
                for i, (side, impulse) in enumerate(zip(stops.sides.tolist(), stops.impulses.tolist(), strict=True)):
                    if side:
                        contact_log.touched.append((i, int(side), k, impulse, speeds[i]))
        old = row
        return row

    def forcing(begin: int, end: int) -> Array:
        """Return the effect of disturbances on the rows in some steps."""
        pushed = p.forcing(begin, end)
        return np.hstack([pushed, pushed @ rows.reads.T + rows.offsets[begin + 1 : end + 1]])

    read = rows.reads @ p.stepper
    if rows.jumps.shape[1]:
        read[:, n + rows.jumps.shape[1] :] += rows.jumps
    stepper = np.ascontiguousarray(np.vstack([p.stepper, read]))
    return run_steps(p, log, stepper, forcing, touched, per_point), contact_log


def _at_start(p: LoopProblem, rows: ContactRows) -> Slip:
    speed = float(rows.reads[0] @ p.start + rows.offsets[0, 0])
    size = float(np.abs(rows.reads[0]) @ np.abs(p.start)) + float(np.abs(rows.offsets[:, 0]).max())
    # relative to the largest slip velocity: an initial velocity below is a rounding error, the slip is at rest
    return Slip(speed, abs(speed) <= SUMMED * size, None)
