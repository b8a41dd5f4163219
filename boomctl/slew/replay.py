"""The plan is played back by integrators that planning does not use, and judged."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from boomctl.arrays import Array
from boomctl.checks import warn_user
from boomctl.slew.dynamics import path_peak
from boomctl.slew.objectives import OBJECTIVES
from boomctl.slew.plant import SlewPlant, is_machine
from boomctl.slew.problem import AT_LIMIT, SlewProblem
from boomctl.slew.result import Replay
from boomctl.slew.torque import APART, TorqueProfile, lines_between

_SAMPLES = 1001  # instants of a replay at least: pictures are drawn from them
# times in a period of the fastest vibration, where motion is limited; `path_peak` interpolates between them
_IN_PERIOD = 40
_MOST_SAMPLES = 200_000  # instants of a replay at most: some seconds (a choice)
_AT_ONCE = 20_000  # steps of a linear motion that are mapped at once: 60 MB with eight modes (a choice)
_AFTER = 96  # instants in one and a half of the slowest periods after the end; a choice
_TAYLOR, _TURN = 30, 0.5  # terms of a linear motion, and |A h| of a part of a step: 0.5^30 / 30! is 4e-42
_SMALL = 1e-12  # least |A| [1/s]: keeps a logarithm finite
_EXACT_MODES = 6  # of the geometrically exact beam; a choice
_ACCURATE = {"rtol": 1e-10, "atol": 1e-13}  # of a replay that judges a plan to 1e-9
_COARSE = {"rtol": 1e-5, "atol": 1e-7}  # of other models, which differ by more


@dataclass(frozen=True, eq=False)
class Motion:
    """What a plant does under a torque.

    Attributes
    ----------
    time : ndarray, k
        s; up to the end of the torque.
    states : ndarray, k x n
        In the plant's own order.
    coordinates : ndarray, k x n
        Those of the planning.
    residual_energy : float or None
        J.
    small_deformation_until : float
        Instant at which a beam's tip first exceeds a tenth of its length, s; inf if it never does.
    """

    time: Array
    states: Array
    coordinates: Array
    residual_energy: float | None
    small_deformation_until: float = np.inf


def played(problem: SlewProblem, history: TorqueProfile, samples: int = _SAMPLES) -> tuple[Motion, ...]:
    """Play a torque back on all plants of a problem; where their motion is limited, every vibration is seen."""
    if OBJECTIVES[problem.objective].bounds_tip or set(problem.limits.beside_torque) - {"torque_rate"}:
        turns = problem.fastest_vibration * history.duration / (2.0 * np.pi)
        if _IN_PERIOD * turns > _MOST_SAMPLES:
            warn_user(
                f"limits of the motion are judged at {_MOST_SAMPLES / turns:.2g} instants in a period of the fastest"
                " vibration: between them it may exceed them; fewer modes or a shorter slew are judged closely"
            )
        samples = max(samples, min(int(_IN_PERIOD * turns), _MOST_SAMPLES))
    t = np.unique(np.concatenate([np.linspace(0.0, history.duration, samples), history.edges]))
    t = t[np.diff(t, prepend=-1.0) > APART * history.duration]
    t[-1] = history.duration
    motions = []
    for plant, own in problem.parts:
        start = problem.start[own]
        if plant.machine is None:
            states = _linear_motion(plant, history, start, t)
            motions.append(Motion(t, states, states @ plant.from_state.T, None))
            continue
        r = plant.machine.simulate(history, t, plant.to_state @ start, **_ACCURATE)
        energy = plant.machine.residual_energy(r.states[-1], problem.final_speed)
        motions.append(Motion(t, r.states, r.states @ plant.from_state.T, energy, r.small_deformation_until))
    return tuple(motions)


def _linear_motion(plant: SlewPlant, history: TorqueProfile, start: Array, times: Array) -> Array:
    """Linear motion by its Taylor series, in steps between all instants and edges."""
    knots = np.unique(np.concatenate([times, history.edges]))
    widths = np.diff(knots)
    torques, _, slopes = lines_between(history, knots)
    n, states = plant.n, [start[None]]
    for first in range(0, widths.size, _AT_ONCE):
        part = slice(first, first + _AT_ONCE)
        maps = _taylor_maps(plant, widths[part])
        pushes = maps[:, :n, n] * torques[part, None] + maps[:, :n, n + 1] * slopes[part, None]
        states.append(_one_after_another(maps[:, :n, :n], pushes, states[-1][-1])[1:])
    return np.concatenate(states)[np.searchsorted(knots, times)] @ plant.to_state.T


def _taylor_maps(plant: SlewPlant, steps: Array) -> Array:
    """What states, a torque and its slope become in each step h [s], K x (n + 2) x (n + 2).

    By Taylor's series of a part of the step, in which ``A h`` is below one half, squared until it is the whole.
    """
    longest, size = steps.max(), max(np.abs(np.linalg.eigvals(plant.A)).max(), _SMALL)
    doublings = max(0, int(np.ceil(np.log2(size * longest / _TURN))))
    generator = np.zeros((plant.n + 2, plant.n + 2))
    generator[: plant.n, : plant.n], generator[: plant.n, plant.n], generator[-2, -1] = plant.A, plant.B, 1.0
    generator *= longest / 2**doublings
    term, terms = np.eye(plant.n + 2), []
    for order in range(_TAYLOR):
        term = term if order == 0 else generator @ term / order
        terms.append(term.ravel())
    shares = (steps / longest)[:, None] ** np.arange(_TAYLOR)
    maps: Array = (shares @ np.array(terms)).reshape(-1, plant.n + 2, plant.n + 2)
    for _ in range(doublings):
        maps = maps @ maps
    return maps


def _one_after_another(maps: Array, pushes: Array, start: Array) -> Array:
    """States ``z_k+1 = maps_k z_k + pushes_k`` from a first one, (K + 1) x n.

    In blocks side by side: what each does to any state, then where each begins, then the states within.
    """
    count, n = pushes.shape
    width = math.isqrt(count) + 1
    blocks = -(-count // width)
    every = np.broadcast_to(np.eye(n), (blocks * width, n, n)).copy()
    every[:count], push = maps, np.zeros((blocks * width, n))
    push[:count] = pushes
    every, push = every.reshape(blocks, width, n, n), push.reshape(blocks, width, n, 1)
    gain, shift = np.broadcast_to(np.eye(n), (blocks, n, n)), np.zeros((blocks, n, 1))
    for j in range(width):
        gain, shift = every[:, j] @ gain, every[:, j] @ shift + push[:, j]
    z = np.empty((blocks, n, 1))
    z[0, :, 0] = start
    for i in range(blocks - 1):
        z[i + 1] = gain[i] @ z[i] + shift[i]
    states = np.empty((blocks, width, n))
    for j in range(width):
        z = every[:, j] @ z + push[:, j]
        states[:, j] = z[..., 0]
    return np.concatenate([start[None], states.reshape(-1, n)[:count]])


def prescribed_error(problem: SlewProblem, motions: tuple[Motion, ...]) -> float:
    """Largest miss of the prescribed end, each condition over its largest size on the way."""
    end, sizes = _ends(problem, motions)
    miss = np.abs(problem.ends @ (end - problem.target))
    scale = np.abs(problem.ends) @ sizes
    return float((miss / np.where(scale > 0.0, scale, 1.0)).max())


def free_errors(problem: SlewProblem, motions: tuple[Motion, ...]) -> dict[str, float]:
    """What is left of the motion in coordinates that planning does not prescribe, for the linear torque does not move them.

    By the names of the plants' coordinates: those of a beam are its modes in the order of their frequencies, the rigid one
    0. Each deviation from the target over its coordinate's largest size on the way, and of mode and rate the larger one.
    """
    end, sizes = _ends(problem, motions)
    left = np.abs(end - problem.target) / np.where(sizes > 0.0, sizes, 1.0)
    result = {}
    for k, (plant, own) in enumerate(problem.parts):
        half = plant.n // 2
        payload = f" with payload {k}" if k else ""
        for mode in np.flatnonzero(~plant.controllable[:half]):
            result[f"mode {mode}{payload}"] = float(max(left[own][mode], left[own][mode + half]))
    return result


def _ends(problem: SlewProblem, motions: tuple[Motion, ...]) -> tuple[Array, Array]:
    """Coordinates of all plants at the end, and their largest sizes on the way."""
    end = np.concatenate([motion.coordinates[-1] for motion in motions])
    sizes = np.concatenate([np.abs(motion.coordinates).max(axis=0) for motion in motions])
    return end, np.maximum(sizes, np.abs(problem.target))


def _followed(
    problem: SlewProblem, history: TorqueProfile, motions: tuple[Motion, ...]
) -> dict[str, tuple[float, Array, Array]]:
    """Limit, instants and absolute values of all that is limited; the largest of all plants."""
    peaks = np.maximum(np.abs(history.start_values), np.abs(history.end_values))
    values = {"torque": (problem.limits.torque, history.edges[:-1], peaks)}
    for kind, limit in problem.limits.beside_torque.items():
        if kind == "torque_rate":
            slopes = np.abs((history.end_values - history.start_values) / np.diff(history.edges))
            values[kind] = (limit, history.edges[:-1], slopes)
            continue
        sizes = [
            np.abs(motion.coordinates @ plant.rows[kind]) for motion, plant in zip(motions, problem.plants, strict=True)
        ]
        worst = max(range(len(sizes)), key=lambda i: sizes[i].max())
        values[kind] = (limit, motions[worst].time, sizes[worst])
    return values


def violation(problem: SlewProblem, history: TorqueProfile, motions: tuple[Motion, ...]) -> dict[str, float]:
    """Return the relative excess over each limit in the replay, between its times too; 0 where the limit holds."""
    result = {}
    for kind, (limit, _, size) in _followed(problem, history, motions).items():
        peak = float(size.max())
        if kind in problem.plants[0].rows:
            peak = max(
                path_peak(plant, kind, history, motion.time, motion.coordinates, limit)
                for plant, motion in zip(problem.plants, motions, strict=True)
            )
        result[kind] = max(0.0, peak / limit - 1.0)
    return result


def binding(problem: SlewProblem, history: TorqueProfile, motions: tuple[Motion, ...]) -> dict[str, float]:
    """Limits that are met within 0.1 %, and the first instant of it, s."""
    result = {}
    for kind, (limit, t, size) in _followed(problem, history, motions).items():
        met = np.flatnonzero(size >= AT_LIMIT * limit)
        if met.size:
            result[f"{kind}_limit"] = float(t[met[0]])
    return result


def other_models(problem: SlewProblem, history: TorqueProfile) -> tuple[Replay, ...]:
    """Play a torque back with the other payloads, on FOAM and on the geometrically exact beam; only from rest at 0."""
    machine = problem.plants[0].machine
    if machine is None or np.any(problem.start):
        return ()
    after = history.duration + np.linspace(0.0, 1.5 * problem.plants[0].period, _AFTER + 1)

    def replay(other: Any, name: str, tip_mass: float | None) -> Replay:
        """What is left at the end."""
        r = other.simulate(history, after, **_COARSE)
        angle = 0.0 if problem.angle is None else float(r.hub_angle[0]) - problem.angle
        energy = other.residual_energy(r.states[0], problem.final_speed) if is_machine(other) else None
        if energy is None and problem.final_speed == 0.0:
            energy = float(r.energy[0])
        swing = float(np.abs(r.tip_displacement).max())
        return Replay(
            model=name,
            tip_mass=tip_mass,
            angle_error=angle,
            speed_error=float(r.hub_speed[0]) - problem.final_speed,
            residual_vibration=swing,
            residual_energy=energy,
        )

    payloads = [replay(machine.with_tip_mass(mass), machine.model, mass) for mass in problem.tip_masses]
    names = [name for name in ("foam", "geometrically-exact") if name != machine.model]
    others = [replay(machine.with_model(name, _EXACT_MODES if name != "foam" else None), name, None) for name in names]
    return (*payloads, *others)
