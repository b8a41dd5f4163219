"""Replay of a plan by integrators that planning does not use, and its evaluation."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from boomctl.arrays import Array
from boomctl.checks import warn_user
from boomctl.lti.hold import linear_hold, recursion
from boomctl.lti.rounding import SUMMED
from boomctl.progress import computing
from boomctl.slew.dynamics import path_peak
from boomctl.slew.objectives import OBJECTIVES
from boomctl.slew.plant import SlewPlant
from boomctl.slew.problem import AT_LIMIT, SlewProblem
from boomctl.slew.torque import TorqueProfile, lines_between

_SAMPLES = 1000  # samples of a replay at least: resolution of the plots
# samples in a period of the fastest vibration if motion is limited; `path_peak` interpolates between them
_IN_PERIOD = 40
_MOST_SAMPLES = 200_000  # samples of a replay at most: limits its run time to some seconds
_DIGITS = 12  # decimals of steps over the duration beyond which they differ by rounding error only
_ACCURATE = {"rtol": 1e-10, "atol": 1e-13}  # solver tolerances of a replay, to evaluate a plan to 1e-9


@dataclass(frozen=True, eq=False)
class Motion:
    """Motion of a plant under a torque.

    Attributes
    ----------
    time : ndarray, k
        Time points up to the end of the torque, s.
    states : ndarray, k x n
        States of the plant.
    coordinates : ndarray, k x n
        Coordinates of the planning.
    residual_energy : float or None
        Energy of the deviation from steady rotation at the end, J.
    small_deformation_until : float
        Time at which a beam's tip first exceeds a tenth of its length, s; inf if it never does.
    """

    time: Array
    states: Array
    coordinates: Array
    residual_energy: float | None
    small_deformation_until: float = np.inf


@dataclass(frozen=True, eq=False)
class Candidate:
    """A torque before certification, with its optimality and the method that computed it.

    Attributes
    ----------
    profile : TorqueProfile
    method : str
    gap : float
        Relative optimality gap; infinite if unknown.
    optimality : str
    program, solution : object or None
        Nonlinear program and its solution, if one was solved.
    motions : tuple of Motion or None
        Replay of all plants; None before it.
    stages : tuple of str
        Methods used, as text.
    """

    profile: TorqueProfile
    method: str
    gap: float
    optimality: str
    program: Any = None
    solution: Any = None
    motions: tuple[Motion, ...] | None = None
    stages: tuple[str, ...] = ()


def replayed(problem: SlewProblem, profile: TorqueProfile) -> tuple[Motion, ...]:
    """Simulate all plants of a problem under a torque; limited motion is sampled at the rate of the fastest vibration."""
    samples, widths = _SAMPLES, np.diff(profile.edges)
    if OBJECTIVES[problem.objective].bounds_tip or set(problem.limits.without_torque) - {"torque_rate"}:
        turns = problem.fastest_vibration * profile.duration / (2.0 * np.pi)
        if _IN_PERIOD * turns > _MOST_SAMPLES:
            warn_user(
                f"limits of the motion are checked at {_MOST_SAMPLES / turns:.2g} times in a period of the fastest"
                " vibration: between them it may exceed the limits; use fewer modes or a shorter slew"
            )
        samples = max(samples, min(int(_IN_PERIOD * turns), _MOST_SAMPLES))
    counts = np.ceil(samples * widths / profile.duration * (1.0 - SUMMED)).astype(int)  # less rounding error
    within = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
    t = np.append(np.repeat(profile.edges[:-1], counts) + within * np.repeat(widths / counts, counts), profile.duration)
    motions = []
    for plant, own in problem.parts:
        if plant.machine is None:
            states = _linear_motion(plant, profile, problem.start[own], t)
            motions.append(Motion(t, states, plant.coordinates(states), None))
            continue
        with computing("replay", lambda told: problem.deadline.check("replay")):
            r = plant.machine.simulate(profile, t, **_ACCURATE)
        energy = plant.machine.residual_energy(r.states[-1], problem.final_speed)
        motions.append(Motion(t, r.states, plant.coordinates(r.states), energy, r.small_deformation_until))
    return tuple(motions)


def _linear_motion(plant: SlewPlant, profile: TorqueProfile, start: Array, times: Array) -> Array:
    """Return the states of a linear plant, to rounding error, at times that include the edges of the torque."""
    first, last, _ = lines_between(profile, times)
    widths, states = np.diff(times), [start[None]]
    # steps that differ by rounding error are replaced by their mean
    _, kind = np.unique(np.round(widths / times[-1], _DIGITS), return_inverse=True)
    means = np.bincount(kind, widths) / np.bincount(kind)
    for run in np.split(np.arange(kind.size), np.flatnonzero(np.diff(kind)) + 1):
        Phi, G, H = linear_hold(plant.A, plant.B[:, None], float(means[kind[run[0]]]))
        states.append(recursion(Phi, G * first[run] + H * (last - first)[run], states[-1][-1]).T[1:])
    return np.concatenate(states) @ plant.to_state.T


def prescribed_error(problem: SlewProblem, motions: tuple[Motion, ...]) -> float:
    """Return the largest residual of the end conditions, each relative to its largest value along the motion."""
    end = np.concatenate([motion.coordinates[-1] for motion in motions])
    sizes = np.concatenate([np.abs(motion.coordinates).max(axis=0) for motion in motions])
    scale = np.abs(problem.ends) @ np.maximum(sizes, np.abs(problem.target))
    miss = np.abs(problem.ends @ (end - problem.target))
    return float((miss / np.where(scale > 0.0, scale, 1.0)).max())


def free_errors(problem: SlewProblem, motions: tuple[Motion, ...]) -> dict[str, float]:
    """Return the residual axial motion of beams, which planning does not prescribe, by state.

    It is the deviation from steady rotation, relative to the largest value of the state along the motion.
    """
    result = {}
    for k, (plant, motion) in enumerate(zip(problem.plants, motions, strict=True)):
        payload = f" with payload {k}" if k else ""
        for i in plant.axial:
            assert plant.machine is not None
            steady = plant.machine.steady_state(problem.final_speed)[i]
            size = max(np.abs(motion.states[:, i]).max(), abs(steady)) or 1.0
            result[f"{plant.machine.state_labels[i]}{payload}"] = float(abs(motion.states[-1, i] - steady) / size)
    return result


def violation(problem: SlewProblem, profile: TorqueProfile, motions: tuple[Motion, ...]) -> dict[str, float]:
    """Return the relative excess over each limit in the replay, between its times too; 0 where the limit holds."""
    peaks = {"torque": profile.peak, "torque_rate": profile.max_rate}
    for kind in set(problem.limits.by_kind) - set(peaks):
        peaks[kind] = max(
            path_peak(plant, kind, profile, motion.time, motion.coordinates, problem.limits.most(kind))
            for plant, motion in zip(problem.plants, motions, strict=True)
        )
    return {kind: max(0.0, peaks[kind] / limit - 1.0) for kind, limit in problem.limits.by_kind.items()}


def binding(problem: SlewProblem, profile: TorqueProfile, motions: tuple[Motion, ...]) -> dict[str, float]:
    """Return limits that are reached within 0.1 %, and the first time of it, s."""
    rates = (profile.end_values - profile.start_values) / np.diff(profile.edges)
    own = {"torque": [profile.start_values, profile.end_values], "torque_rate": [rates]}
    result = {}
    for kind, limit in problem.limits.by_kind.items():
        paths = [(profile.edges, values) for values in own.get(kind, ())] or [
            (motion.time, motion.coordinates @ plant.rows[kind])
            for motion, plant in zip(motions, problem.plants, strict=True)
        ]
        met = [float(t[k]) for t, values in paths for k in np.flatnonzero(np.abs(values) >= AT_LIMIT * limit)[:1]]
        if met:
            result[f"{kind}_limit"] = min(met)
    return result
