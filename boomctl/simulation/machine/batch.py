"""Many loops around machines that differ in some of their inputs, stepped together: one call a step for all of them."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from boomctl.arrays import Array
from boomctl.progress import tell
from boomctl.simulation.machine.buffered import Buffered
from boomctl.simulation.machine.run import MachineLoop, StepSignals, inputs_of, loop_step, steps_for

_TOLD = 100  # samples after which it is told how far the runs are (a choice)
_DOUBLINGS = 8  # of the first number of steps: what is not exact by then will not be (a choice)


@dataclass(frozen=True, eq=False)
class Batch:
    """Runs of one loop that differ.

    Attributes
    ----------
    loop : MachineLoop
        Its ``W`` holds the disturbances that all have; inputs that differ are to be ones there.
    names : tuple of str
        The inputs that differ.
    values : (runs, inputs) ndarray
        What they are, constant in each run.
    noise : (runs, samples, measurements) ndarray or None
        Added to what is measured.
    read : tuple of str
        Outputs that are kept.
    """

    loop: MachineLoop
    names: tuple[str, ...]
    values: Array
    noise: Array | None
    read: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class BatchRun:
    """Outputs and the controls that act, by name, (runs, samples) each, and the largest error [m] of what is judged."""

    outputs: dict[str, Array]
    controls: dict[str, Array]
    error: float


def run_batch(batch: Batch, rtol: float, atol: float) -> BatchRun:
    """Run all, in steps so short that the judged displacements are exact to ``atol + rtol max |displacement|`` [m].

    The steps are halved until that holds for the runs with the least and the largest of each value; all then take them.

    Raises
    ------
    ValueError
        A loop diverges, a machine is deformed beyond its model, or the tolerance is not reached.
    """
    ends = np.unique(np.concatenate([batch.values.argmin(axis=0), batch.values.argmax(axis=0)]))
    some = replace(batch, values=batch.values[ends], noise=None if batch.noise is None else batch.noise[ends])
    counts = tuple(steps_for(batch.loop.machine, length) for length in batch.loop.segments)
    coarse, error = _run(some, counts), np.inf
    for _ in range(_DOUBLINGS):
        finer = tuple(2 * count for count in counts)
        fine = _run(some, finer)
        if coarse is not None and fine is not None:
            apart = np.abs(fine[1] - coarse[1]).max(axis=2)
            error = float(apart.max())
            if (apart <= atol + rtol * np.abs(fine[1]).max(axis=2)).all():
                found = _run(batch, counts)
                if found is None:
                    break
                outputs = dict(zip(batch.read, found[0], strict=True))
                return BatchRun(outputs, dict(zip(batch.loop.controller.outputs, found[2], strict=True)), error)
        coarse, counts = fine, finer
    if not np.isfinite(error) or coarse is None:
        raise ValueError("the loop diverges: its states grow beyond all numbers before the last of timepts")
    raise ValueError(
        f"rtol = {rtol:g}: the error stays at {error:.1e} m in the shortest steps taken; expected a larger one"
    )


def _run(batch: Batch, counts: tuple[int, ...]) -> tuple[Array, Array, Array] | None:
    """Outputs kept, displacements judged, controls: (signals, runs, samples) each; None where one overflows."""
    import casadi as ca

    p, c = batch.loop, batch.loop.controller
    if p.grid.per_sample > 1 or p.grid.per_point > 1:
        raise ValueError("timepts: expected the samples of the controller")
    beside, runs, nz, nu = StepSignals(p), len(batch.values), len(p.start), len(c.driven)
    places = [p.disturbed.tolist().index(p.machine.inputs.index(name)) for name in batch.names]
    wanted = [p.machine.outputs.index(name) for name in batch.read]
    unit = loop_step(p, counts)[0]
    s, w = ca.SX.sym("s", p.size), ca.SX.sym("w", beside.rows)
    d, n = ca.SX.sym("d", len(places)), ca.SX.sym("n", len(c.measured) if batch.noise is not None else 0)
    own = ca.SX(w)
    for rows in (beside.first, beside.last):
        for k, place in enumerate(places):
            own[rows.start + place] = d[k]
    if batch.noise is not None:
        own[beside.noise] = n
    after = unit(s, own)[0]
    acting = (s if p.switch else after)[nz : nz + nu]  # just after the sample
    outputs, margin = p.machine.read(s[:nz], inputs_of(p.machine, p.acts, acting, own[beside.first]))
    kept = ca.vertcat(outputs[wanted], p.machine.judged(s[:nz]), acting, margin)
    every = Buffered(ca.Function("every", [s, w, d, n], [after, kept]).map(runs))
    signals = np.hstack([beside.signals(), beside.signals(at_end=True)[:, None]])
    samples = p.grid.steps + 1
    state = np.repeat(np.concatenate([p.start, np.zeros(p.size - nz)])[:, None], runs, axis=1)
    own_values, found, none = batch.values.T, np.empty((samples, kept.numel(), runs)), np.zeros((0, runs))
    for k in range(samples):
        if k % _TOLD == 0:
            tell(f"{runs} runs in steps of {sum(counts)} a sample", k, samples)
        noise = none if batch.noise is None else batch.noise[:, k].T
        state, found[k] = every(state, np.broadcast_to(signals[:, k, None], (beside.rows, runs)), own_values, noise)
    found = np.ascontiguousarray(found.transpose(1, 2, 0))
    if not np.isfinite(found).all():  # which steps too long may cause as well as the loop
        return None
    if (found[-1] <= 0.0).any():
        raise ValueError("mass matrix margin: expected above zero; the deformation is outside the model")
    first, second = len(wanted), found.shape[0] - nu - 1
    return found[:first], found[first:second], found[second:-1]
