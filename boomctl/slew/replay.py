"""The plan is played back by integrators that planning does not use, and judged."""

import itertools
from dataclasses import dataclass
from typing import Any

import numpy as np

from boomctl.arrays import Array
from boomctl.slew.plant import SlewMachine, SlewPlant
from boomctl.slew.problem import LIMITS, SlewProblem
from boomctl.slew.result import Replay
from boomctl.slew.torque import TorqueHistory

_SERIES = 30
_EXACT_MODES = 6


@dataclass(frozen=True, eq=False)
class Motion:
    """What a plant does under a torque.

    Attributes
    ----------
    time : ndarray, k
        s; up to the end of the torque.
    states : ndarray, k x n
        In the plant's own order.
    places : ndarray, k x n
        In the coordinates of the planning.
    swing : float
        Largest tip displacement afterwards, m; 0 of a plant without tip.
    residual_energy : float or None
        J.
    """

    time: Array
    states: Array
    places: Array
    swing: float
    residual_energy: float | None


def played(problem: SlewProblem, history: TorqueHistory, samples: int = 1001) -> tuple[Motion, ...]:
    """Play a torque back on all plants of a problem."""
    motions, first = [], 0
    for plant in problem.plants:
        motions.append(_played(plant, history, problem.start[first : first + plant.n], problem.final_speed, samples))
        first += plant.n
    return tuple(motions)


def _played(plant: SlewPlant, history: TorqueHistory, start: Array, final_speed: float, samples: int) -> Motion:
    during = np.unique(np.concatenate([np.linspace(0.0, history.duration, samples), history.edges]))
    during = during[np.diff(during, prepend=-1.0) > 1e-12 * history.duration]
    during[-1] = history.duration
    if plant.machine is None:
        states = _series(plant, history, start, during)
        return Motion(during, states, states @ plant.from_state.T, 0.0, None)
    after = history.duration + _ring_down(plant)
    r = plant.machine.simulate_torque(
        history, np.concatenate([during, after]), history.breakpoints, plant.to_state @ start, rtol=1e-10, atol=1e-13
    )
    states, rest = r.states[: during.size], r.tip_displacement[during.size :]
    energy = plant.machine.residual_energy(states[-1], final_speed)
    return Motion(during, states, states @ plant.from_state.T, float(np.abs(rest).max()), energy)


def _ring_down(plant: SlewPlant) -> Array:
    """Instants after the end: one and a half of the slowest period."""
    assert plant.frequencies is not None
    return np.linspace(0.0, 3.0 * np.pi / plant.frequencies[1], 97)[1:]


def _series(plant: SlewPlant, history: TorqueHistory, start: Array, times: Array) -> Array:
    """Linear motion by its Taylor series, in steps on which ``A h`` is below one half."""
    knots = np.unique(np.concatenate([times, history.edges]))
    size = max(np.abs(np.linalg.eigvals(plant.A)).max(), 1e-12)
    states, z, kept = [], start.astype(float), {float(t): i for i, t in enumerate(times)}
    if float(knots[0]) in kept:
        states.append(z)
    for a, b in itertools.pairwise(knots):
        k = min(int(np.searchsorted(history.edges, 0.5 * (a + b)) - 1), history.left.size - 1)
        width = history.edges[k + 1] - history.edges[k]
        slope = (history.right[k] - history.left[k]) / width
        count = max(1, int(np.ceil(2.0 * size * (b - a))))
        h = (b - a) / count
        for j in range(count):
            u = history.left[k] + slope * (a + j * h - history.edges[k])
            term, total = z, z
            for order in range(1, _SERIES):
                term = plant.A @ term
                if order == 1:
                    term = term + plant.B * u
                elif order == 2:
                    term = term + plant.B * slope * h
                term = term * (h / order)
                total = total + term
            z = total
        if float(b) in kept:
            states.append(z)
    return np.array(states) @ plant.to_state.T


def end_error(problem: SlewProblem, motions: tuple[Motion, ...]) -> float:
    """Largest miss of the prescribed end, each condition over its largest size on the way."""
    places = np.concatenate([motion.places[-1] for motion in motions])
    sizes = np.concatenate([np.abs(motion.places).max(axis=0) for motion in motions])
    sizes = np.maximum(sizes, np.abs(problem.target))
    miss = np.abs(problem.ends @ (places - problem.target))
    scale = np.abs(problem.ends) @ sizes
    return float((miss / np.where(scale > 0.0, scale, 1.0)).max())


def _followed(
    problem: SlewProblem, history: TorqueHistory, motions: tuple[Motion, ...]
) -> dict[str, tuple[float, Array, Array]]:
    """Limit, instants and absolute values of all that is limited; the largest of all plants."""
    peaks = np.maximum(np.abs(history.left), np.abs(history.right))
    values = {"torque": (problem.torque_limit, history.edges[:-1], peaks)}
    for kind, limit in problem.limits.items():
        if kind == "rate":
            slopes = np.abs((history.right - history.left) / np.diff(history.edges))
            values[kind] = (limit, history.edges[:-1], slopes)
            continue
        sizes = [
            np.abs(motion.places @ plant.rows[kind]) for motion, plant in zip(motions, problem.plants, strict=True)
        ]
        worst = max(range(len(sizes)), key=lambda i: sizes[i].max())
        values[kind] = (limit, motions[worst].time, sizes[worst])
    return values


def violation(problem: SlewProblem, history: TorqueHistory, motions: tuple[Motion, ...]) -> dict[str, float]:
    """Excess over each limit in the replay, relative; 0 where it is kept."""
    followed = _followed(problem, history, motions)
    return {kind: max(0.0, float(size.max() / limit) - 1.0) for kind, (limit, _, size) in followed.items()}


def binding(problem: SlewProblem, history: TorqueHistory, motions: tuple[Motion, ...]) -> dict[str, float]:
    """Limits that are met within 0.1 %, and the first instant of it, s."""
    named = {"torque": "torque_limit", **LIMITS}
    found = {}
    for kind, (limit, t, size) in _followed(problem, history, motions).items():
        met = np.flatnonzero(size >= 0.999 * limit)
        if met.size:
            found[named[kind]] = float(t[met[0]])
    return found


def replay_of(problem: SlewProblem, machine: Any, name: str, history: TorqueHistory, tip_mass: float | None) -> Replay:
    """Play a torque back on another model or with another payload, from rest, and measure what is left at the end."""
    plant = problem.plants[0]
    assert plant.frequencies is not None
    after = np.concatenate([[history.duration], history.duration + _ring_down(plant)])
    r = machine.simulate_torque(history, after, history.breakpoints, rtol=1e-5, atol=1e-7)
    angle = 0.0 if problem.angle is None else float(r.hub_angle[0]) - problem.angle
    energy = machine.residual_energy(r.states[0], problem.final_speed) if isinstance(machine, SlewMachine) else None
    if energy is None and problem.final_speed == 0.0:
        energy = float(r.energy[0])
    swing = float(np.abs(r.tip_displacement).max())
    return Replay(name, tip_mass, angle, float(r.hub_speed[0]) - problem.final_speed, swing, energy)


def other_models(problem: SlewProblem, history: TorqueHistory) -> tuple[Replay, ...]:
    """Play a torque back with the other payloads, on FOAM and on the geometrically exact beam; only from rest at 0."""
    machine = problem.plants[0].machine
    if machine is None or np.any(problem.start):
        return ()
    payloads = [
        replay_of(problem, machine.with_tip_mass(mass), machine.model, history, mass) for mass in problem.tip_masses
    ]
    names = [name for name in ("foam", "geometrically-exact") if name != machine.model]
    others = [
        replay_of(problem, machine.in_model(name, _EXACT_MODES if name != "foam" else None), name, history, None)
        for name in names
    ]
    return (*payloads, *others)
