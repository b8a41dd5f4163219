"""A loop whose end stops may never be reached: run without them first, strokes looked at as finely as with them."""

from dataclasses import replace

import numpy as np

from boomctl.arrays import Array
from boomctl.simulation.blocks import run_fast
from boomctl.simulation.stepping import ControlLog, LoopProblem, control_log


def run_untouched(p: LoopProblem, fine: LoopProblem, switch: float) -> tuple[Array, ControlLog] | None:
    """Return what ``run_fast`` does, ``None`` if a stop is reached.

    Parameters
    ----------
    p : LoopProblem
        Without contacts.
    fine : LoopProblem
        The same with stops, and whole steps for each of its own.
    switch : float
        When the controls change within a step of ``p`` [s].
    """
    assert fine.contacts is not None
    assert fine.contacts.stop_maps is not None
    stops, per_step, outputs = fine.contacts.stops, fine.grid.steps // p.grid.steps, len(p.plant.C)
    positions = np.vstack([stop.position for stop in stops])
    maps = [p.plant.motion(j * fine.grid.h)[0] for j in range(per_step)]
    C = np.vstack([p.plant.C, *(positions @ Phi for Phi in maps)])
    D = np.vstack([p.plant.D, np.zeros((len(C) - outputs, p.plant.D.shape[1]))])
    seen, log = replace(p, plant=replace(p.plant, C=C, D=D)), control_log(p)
    with np.errstate(all="ignore"):
        found = run_fast(seen, log)
        strokes = found[outputs:].reshape(per_step, len(stops), -1)[:, :, :-1].copy()
        for j in range(1, per_step):
            strokes[j] += positions @ _pushed(p, fine, log, switch, j)
        offsets = np.array([stop.offsets(fine.W, fine.grid.h, fine.grid.per_point)[0] for stop in stops])
        strokes += np.moveaxis(offsets[:, :-1].reshape(len(stops), -1, per_step), 2, 0)
        last = found[outputs : outputs + len(stops), -1] + offsets[:, -1]
        limits = fine.contacts.stop_maps.limits
        free = (np.abs(strokes) <= limits[:, None]).all() and (np.abs(last) <= limits).all()
    return (found[:outputs], log) if free else None


def _pushed(p: LoopProblem, fine: LoopProblem, log: ControlLog, switch: float, j: int) -> Array:
    """Return what disturbances and controls add to the states in the first ``j`` fine steps of each step, (n, steps)."""
    duration, driven, per_step = j * fine.grid.h, p.controller.driven, fine.grid.steps // p.grid.steps
    whole = p.plant.step(duration)
    used = np.flatnonzero(p.W.any(axis=1))
    moved = whole.first[:, used] @ p.W[used, :-1] + whole.last[:, used] @ fine.W[used, j::per_step]
    if not len(driven):
        return moved
    before, after = (whole.after, np.zeros_like(whole.after)) if switch >= duration else (whole.before, whole.after)
    if 0.0 < switch < duration:
        changed = p.plant.step(duration, switch)
        before, after = changed.before, changed.after
    step = np.arange(p.grid.steps)
    acting = np.where((step >= p.lag)[:, None], log.given[np.maximum(step - p.lag, 0) // p.grid.per_sample], 0.0)
    earlier = np.vstack([np.zeros((1, len(driven))), acting[:-1]])
    return moved + before[:, driven] @ earlier.T + after[:, driven] @ acting.T
