"""The loop with contacts, step by step."""

from dataclasses import dataclass

import numpy as np

from boomctl.arrays import Array
from boomctl.simulation.contact.contacts import Contacts
from boomctl.simulation.contact.friction import CoulombFriction, FrictionStep
from boomctl.simulation.contact.step import ContactRows, SlipState, contact_rows, contact_step
from boomctl.simulation.stepping import ControlLog, LoopProblem, sampler

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

    @classmethod
    def of(cls, steps: int) -> "ContactLog":
        """Return a log to be filled."""
        return cls(np.zeros(steps), np.zeros(steps), np.zeros(steps), [])


def run_contact(p: LoopProblem, log: ControlLog, contacts: Contacts) -> tuple[Array, ContactLog]:
    """Step a loop with contacts; return ``C`` times the modal states at the given times, and what contacts did."""
    n, nu, per_sample, per_point = len(p.plant.A), len(p.controller.driven), p.grid.per_sample, p.grid.per_point
    rows = contact_rows(contacts, p.W, p.grid.h, per_point, np.asarray(p.controller.driven, dtype=int))
    stepper, forcing = _row_maps(p, rows)
    sample, kept = sampler(p, log), ContactLog.of(p.grid.steps)
    X = np.zeros((len(p.grid.time), n))
    X[0] = p.start
    full = np.zeros(n + 2 * nu)
    states, before, after, heard = full[:n], full[n : n + nu], full[n + nu :], full[: n + nu]
    states[:] = p.start
    old = np.concatenate([p.start, rows.reads @ p.start + rows.offsets[0]])
    slip = _at_start(p, rows)
    reach = np.zeros(0) if contacts.stop_maps is None else contacts.stop_maps.limits
    strokes = slice(n + 2, n + 2 + rows.stops)
    for k in range(p.grid.steps):
        if k % per_sample == 0:
            sample(k // per_sample, heard)
        if k >= p.lag:
            after[:] = log.given[(k - p.lag) // per_sample]
        row = stepper @ full
        row += forcing[k]
        if rows.law is not None or (np.abs(row[strokes]) > reach).any():
            row, step, stops = contact_step(rows, row, slip)
            if step is not None and rows.law is not None:
                _write_friction(kept, k, rows.law, p.grid.h, (slip, step), float(row[n + 1] - old[n + 1]))
                slip = slip.after(step)
            if stops is not None:
                speeds = old[n + 2 + rows.stops :].tolist()
                for i, (side, impulse) in enumerate(zip(stops.sides.tolist(), stops.impulses.tolist(), strict=True)):
                    if side:
                        kept.touched.append((i, int(side), k, impulse, speeds[i]))
        old = row
        states[:] = row[:n]
        before[:] = after
        if (k + 1) % per_point == 0:
            X[(k + 1) // per_point] = states
    if p.grid.steps % per_sample == 0:
        sample(p.grid.steps // per_sample, heard)
    return p.plant.C @ X.T, kept


def _row_maps(p: LoopProblem, rows: ContactRows) -> tuple[Array, Array]:
    """Return the map of states and controls to the row a step later, and what disturbances add to it (steps, row)."""
    stepper, forcing, n = p.stepper, p.forcing, len(p.plant.A)
    read = rows.reads @ stepper
    if rows.jumps.shape[1]:
        read[:, n + rows.jumps.shape[1] :] += rows.jumps
    seen = forcing @ rows.reads.T + rows.offsets[1:]
    return np.ascontiguousarray(np.vstack([stepper, read])), np.hstack([forcing, seen])


def _at_start(p: LoopProblem, rows: ContactRows) -> SlipState:
    if rows.law is None:
        return SlipState(0.0, True, None)
    speed = float(rows.reads[0] @ p.start + rows.offsets[0, 0])
    size = float(np.abs(rows.reads[0]) @ np.abs(p.start)) + float(np.abs(rows.offsets[:, 0]).max())
    return SlipState(speed, abs(speed) <= _REST * size, None)


def _write_friction(
    kept: ContactLog, k: int, law: CoulombFriction, h: float, slips: tuple[SlipState, FrictionStep], way: float
) -> None:
    """Write down what friction did in step ``k``, over which the slip changed by ``way``."""
    slip, step = slips
    kept.friction[k] = step.force
    kept.stuck[k] = 1.0 - step.sliding if step.stuck else 0.0
    if slip.stuck:
        kept.dissipated[k] = 0.0 if step.stuck else law.force * abs(way)
    elif step.sliding == 1.0:
        kept.dissipated[k] = law.force * abs(way)
    else:
        coming = 0.5 * slip.velocity * step.sliding * h
        going = 0.0 if step.stuck else 0.5 * step.velocity * (1.0 - step.sliding) * h
        kept.dissipated[k] = law.force * (abs(coming) + abs(going))
