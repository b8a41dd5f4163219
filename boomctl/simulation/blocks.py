"""The loop in blocks: while no limit is active it is linear, and many samples are one matrix product.

Each block is first evaluated without limits.  Only the limited signals are checked; a block in which one reaches its limit
is stepped sample by sample from its start instead.  The signals within the other blocks are computed at the end, for all
blocks together.  With quantized measurements each step is one product, too.  A loop with end stops is run without them first,
with its strokes checked at the steps that stops use.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from boomctl.arrays import Array
from boomctl.lti.hold import Lifted, recursion_without_lead
from boomctl.simulation.stepping import STORED, ControlLog, LinearLoop, LoopProblem, limited, run_smooth

_BLOCK = 32  # Samples of a block: longer blocks are interrupted by limits, shorter ones cost calls.
LONGEST_QUEUE = 16  # Samples of delay above which a loop is stepped: each is a state of every control.
_MOST_STATES = 400  # States above which powers of the loop's matrix cost more than they save.


def run_fast(p: LoopProblem, log: ControlLog) -> Array:
    """Run a loop without contacts, in blocks where :func:`in_blocks`; see ``run_smooth``."""
    if not _one_product(p):
        return run_smooth(p, log)
    return _run_quantized(p, log) if p.limits.coarse else _run_blocks(p, log)


def in_blocks(p: LoopProblem) -> bool:
    """Return whether a loop without contacts is linear between its limits, sampled at each step, and not too large."""
    return _one_product(p) and not p.limits.coarse


def _one_product(p: LoopProblem) -> bool:
    """Return whether a step of a loop without contacts is one product, apart from limits and quantization."""
    states = len(p.plant.A) + (p.lag + 1) * len(p.controller.driven) + len(p.controller.A)
    plain = p.grid.per_sample == 1 and p.lag < LONGEST_QUEUE and not p.added.any
    plain = plain and p.controller.laws is None
    return plain and states <= _MOST_STATES and p.grid.steps >= 2 * _BLOCK


def _run_blocks(p: LoopProblem, log: ControlLog) -> Array:
    """Return ``C`` times the states at each step; fill the log."""
    loop, outputs, nu = p.linear, len(p.plant.C), len(p.controller.driven)
    used = p.disturbed
    first, last, W = loop.first[:, used], loop.last[:, used], _one_more(p.W[used])
    G, D = recursion_without_lead(loop.Phi, first, last, loop.C, loop.D[:, used])
    lifted = Lifted.of(loop.Phi, G, loop.C, D, _BLOCK)
    blocks = lifted.blocks(W)
    starts, clean, stepped = _blocks(p, log, loop, lifted, blocks, last)
    shown = slice(0, outputs + nu)
    y = lifted.forced(blocks, shown) + lifted.free(starts, shown)
    result = y.reshape(outputs + nu, -1)[:, : p.grid.steps + 1]
    for k, rows in stepped:
        result[:outputs, k : k + len(rows)] = p.plant.C @ rows.T
    samples = np.flatnonzero(np.repeat(clean, _BLOCK)[: p.samples])
    log.commanded[samples] = log.applied[samples] = result[outputs:, samples].T
    return result[:outputs]


def _run_quantized(p: LoopProblem, log: ControlLog) -> Array:
    """Return the same of a loop with quantized measurements, which is stepped throughout."""
    walk, n, result = _walk(p, p.linear, log), len(p.plant.A), np.empty((len(p.plant.C), p.samples))
    state = np.zeros(len(p.linear.Phi))
    state[:n] = p.start
    for begin in range(0, p.samples, STORED):
        end = min(begin + STORED, p.samples)
        states = walk(begin, end, state)
        result[:, begin:end], state = p.plant.C @ states[:-1, :n].T, states[-1]
    return result


def _one_more(W: Array) -> Array:
    """Return signals with the last column repeated: one further step, for the sample at the last time."""
    return np.hstack([W, W[:, -1:]])


def _blocks(
    p: LoopProblem, log: ControlLog, loop: LinearLoop, lifted: Lifted, blocks: Array, last: Array
) -> tuple[Array, Array, list[tuple[int, Array]]]:
    """Return states (without lead) at the start of each block, a mask of blocks without limits, other plant states."""
    n, outputs, samples = len(p.plant.A), len(p.plant.C), p.samples
    bound = np.concatenate([p.limits.force, p.limits.rate])
    watched = outputs + np.flatnonzero(np.isfinite(bound))
    rows = np.ascontiguousarray(lifted.observed[:, watched].transpose(1, 0, 2)).reshape(-1, lifted.observed.shape[2])
    limit = np.repeat(bound[watched - outputs], lifted.size)
    chosen = Lifted(lifted.size, lifted.observed, lifted.power, lifted.reached, lifted.pulse[watched])
    alone = np.ascontiguousarray(chosen.forced(blocks).transpose(1, 0, 2).reshape(blocks.shape[1], -1))
    pushed, lead = lifted.pushed(blocks), (last @ blocks[:, :, 0]).T
    count = blocks.shape[1]
    starts, clean = np.zeros((count, len(loop.Phi))), np.ones(count, dtype=bool)
    state = -lead[0]
    state[:n] += p.start
    walk, stepped = _walk(p, loop, log), []
    for b in range(count):
        starts[b] = state
        k = b * lifted.size
        if len(watched) and k < samples and (np.abs(rows @ state + alone[b]) > limit).any():
            clean[b], end = False, min(k + lifted.size, samples)
            states = walk(k, end, state + lead[b])
            stepped.append((k, states[: end - k, :n]))
            if b + 1 < count:
                state = states[-1] - lead[b + 1]
        else:
            state = lifted.power @ state + pushed[b]
    return starts, clean, stepped


def _walk(p: LoopProblem, loop: LinearLoop, log: ControlLog) -> Callable[[int, int, Array], Array]:
    """Return a function that steps the loop sample by sample: one product a step, corrected if a limit is active.

    From step ``begin`` to ``end`` and the initial state ``z`` it returns the states at each step, (steps + 1, states).
    """
    outputs, nu, n, used = len(p.plant.C), len(p.controller.driven), len(loop.Phi), p.disturbed
    commands, coarse = slice(outputs, outputs + nu), np.flatnonzero(np.isfinite(p.limits.quantum))
    quantum, errors = p.limits.quantum[coarse, None], slice(nu + n, nu + n + len(coarse))
    reads, feedthrough = loop.reads[coarse] / quantum, p.plant.D[p.controller.measured[coarse]][:, used] / quantum

    # a row: commands, state, and of the measurements at the next sample, in units of their quanta, rounding errors and values
    def with_measurements(rows: Array, more: Array | float = 0.0) -> Array:
        """Return the effect on a row from that on commands and state; rounding errors are computed at each step."""
        return np.vstack([rows, np.zeros((len(coarse), rows.shape[1])), reads @ rows[nu:] + more])

    product = np.hstack([np.vstack([loop.C[commands], loop.Phi]), loop.errors[:, coarse] * quantum.T])
    step = np.ascontiguousarray(with_measurements(product))  # of state and rounding errors
    # effect of signals at the start and the end of a step
    first = with_measurements(np.vstack([loop.D[commands], loop.first])[:, used])
    last = with_measurements(np.pad(loop.last[:, used], ((nu, 0), (0, 0))), feedthrough)
    excess = with_measurements(np.pad(loop.excess, ((nu, 0), (0, 0))))
    W, force, rate = _one_more(p.W[used]), p.limits.force.tolist(), p.limits.rate.tolist()

    def through(begin: int, end: int, z: Array) -> Array:
        here = W[:, begin : end + 1].T
        forcing = here[:-1] @ first.T + here[1:] @ last.T
        rows, allowed = np.empty((len(here), len(step))), z[loop.latest].tolist()
        states, error, measured = rows[:, nu : nu + n], rows[:, errors], rows[:, errors.stop :]
        known, states[0], measured[0] = rows[:, nu : errors.stop], z, reads @ z + feedthrough @ here[0]
        np.subtract(np.rint(measured[0]), measured[0], out=error[0])
        for k, forced in enumerate(forcing):
            row = rows[k + 1]
            np.dot(step, known[k], out=row)
            row += forced
            commanded = row[:nu].tolist()
            if limited(commanded, begin + k, force, rate, allowed, log):
                row += excess @ np.subtract(allowed, commanded)
            if len(coarse):
                np.subtract(np.rint(measured[k + 1]), measured[k + 1], out=error[k + 1])
            log.commanded[begin + k] = commanded
            log.applied[begin + k] = allowed
        return states

    return through


def run_without_contact(p: LoopProblem, fine: LoopProblem) -> tuple[Array, ControlLog] | None:
    """Return the result of ``run_fast``, or ``None`` if a stop is reached.

    Parameters
    ----------
    p : LoopProblem
        Loop without contacts.
    fine : LoopProblem
        The same loop with stops; a step of ``p`` is a whole number of its steps.
    """
    assert fine.contacts is not None
    stops, per_step, outputs = fine.contacts.stops, fine.grid.steps // p.grid.steps, len(p.plant.C)
    positions = np.vstack([stop.position for stop in stops])
    maps = [p.plant.hold(j * fine.grid.h, [])[0] for j in range(per_step)]
    C = np.vstack([p.plant.C, *(positions @ Phi for Phi in maps)])
    D = np.vstack([p.plant.D, np.zeros((len(C) - outputs, p.plant.D.shape[1]))])
    extended, log = replace(p, plant=replace(p.plant, C=C, D=D)), p.new_log()
    with np.errstate(all="ignore"):
        result = run_fast(extended, log)
        strokes = result[outputs:].reshape(per_step, len(stops), -1)[:, :, :-1].copy()
        for j in range(1, per_step):
            strokes[j] += _pushed(positions, p, fine, log, j)
        offsets = np.array([stop.offsets(fine.W, fine.grid.h, fine.grid.per_point)[0] for stop in stops])
        strokes += offsets[:, :-1].reshape(len(stops), -1, per_step).transpose(2, 0, 1)
        last = result[outputs : outputs + len(stops), -1] + offsets[:, -1]
        limits = fine.contacts.limits
        free = (np.abs(strokes) <= limits[:, None]).all() and (np.abs(last) <= limits).all()
    return (result[:outputs], log) if free else None


def _pushed(C: Array, p: LoopProblem, fine: LoopProblem, log: ControlLog, j: int) -> Array:
    """Return ``C`` times the effect of disturbances and controls on the states in ``j`` fine steps of each step."""
    duration, driven, per_step = j * fine.grid.h, p.controller.driven, fine.grid.steps // p.grid.steps
    moving, used = p.plant.step(duration, p.switch), p.disturbed
    moved = C @ moving.first[:, used] @ p.W[used, :-1] + C @ moving.last[:, used] @ fine.W[used, j::per_step]
    acting = log.acting(np.arange(p.grid.steps), p.lag, p.grid.per_sample)
    earlier = np.vstack([np.zeros((1, len(driven))), acting[:-1]])
    return moved + C @ moving.before[:, driven] @ earlier.T + C @ moving.after[:, driven] @ acting.T
