"""Smaller problems with the same slew, or nearly: its first half, and beams without modes that no torque moves."""

from dataclasses import replace

import numpy as np

from boomctl.arrays import Array
from boomctl.lti.rounding import ALIKE, SUMMED
from boomctl.slew.dynamics import rates
from boomctl.slew.plant import SlewPlant, plant_of
from boomctl.slew.problem import SlewProblem, end_conditions
from boomctl.slew.torque import TorqueHistory, held

_WITHOUT_AXIAL = "sfoam-consistent"  # the model in which axial motion follows the transverse at once
_PROBES = 3  # random states at which the equations are mirrored: one would do but for chance


def halved(problem: SlewProblem) -> SlewProblem | None:
    """The way to the middle of a slew whose second half is the mirror image of its first; None where there is none.

    Without damping, and with the same rates at start and target, ``u(t) = -u(T - t)`` and positions turned about the middle
    lead back in time as they lead on. The way to T/2 must then end with the positions in the middle, the rates are free.
    """
    prescribed = sum(plant.n - (2 if k else 0) for k, plant in enumerate(problem.plants))
    if problem.angle is None or problem.ends.shape[0] != prescribed:
        return None
    rows, target = [], 0.5 * (problem.start + problem.target)
    for k, (plant, own) in enumerate(problem.parts):
        half = plant.n // 2
        start, end = problem.start[own], problem.target[own]
        if not plant.controllable.all() or np.any(start[half:] != end[half:]) or not _reversible(plant, start + end):
            return None
        rows.append(np.eye(target.size)[own.start + np.arange(1 if k else 0, half)])
    return replace(problem, ends=np.vstack(rows), target=target)


def without_axial_modes(problem: SlewProblem) -> SlewProblem | None:
    """The same slew from rest of beams whose axial motion follows at once; None where there are none, or given states."""
    machines = [plant.machine for plant in problem.plants]
    if None in machines or np.any(problem.start) or all(plant.controllable.all() for plant in problem.plants):
        return None
    asked = problem.plants[0].rest(problem.angle or 0.0, problem.final_speed)
    if np.any(asked != problem.target[: asked.size]):
        return None
    plants = tuple(plant_of(machine.in_model(_WITHOUT_AXIAL)) for machine in machines if machine is not None)
    start, target, ends, waits = end_conditions(plants, problem.angle, problem.final_speed)
    return replace(problem, plants=plants, start=start, target=target, ends=ends, waits=waits)


def _reversible(plant: SlewPlant, twice: Array) -> bool:
    """Whether ``z -> (twice - positions, rates)`` with time and torque reversed leaves the equations of motion alone."""
    f, random, half = rates(plant), np.random.default_rng(0), plant.n // 2
    shift, turn = np.where(np.arange(plant.n) < half, twice, 0.0), np.repeat([-1.0, 1.0], half)
    for _ in range(_PROBES):
        z, u = 0.1 * random.standard_normal(plant.n), float(random.standard_normal()) / np.abs(plant.B).max()
        here = np.array(f(z, u)).ravel()
        there = np.array(f(turn * z + shift, -u)).ravel()
        # of the mirrored equations, relative: far above rounding, far below any damping that matters
        if np.abs(there + turn * here).max() > ALIKE * np.abs(here).max():
            return False
    return True


def first_half(history: TorqueHistory) -> TorqueHistory:
    """A torque up to the middle of its duration."""
    middle = 0.5 * history.duration
    # share of a duration by which an edge has to lie before its middle: rounding
    inner = history.edges[history.edges < middle * (1.0 - SUMMED)]
    edges = np.append(inner, middle)
    return held(edges, history.left[: inner.size])


def doubled(history: TorqueHistory) -> TorqueHistory:
    """A torque that is held on arcs, followed by its negative mirror image."""
    widths = np.diff(history.edges)
    edges = np.concatenate([[0.0], np.cumsum(np.concatenate([widths, widths[::-1]]))])
    return held(edges, np.concatenate([history.left, -history.left[::-1]]))
