"""Optimal and classical slews under the same limit, side by side."""

from dataclasses import dataclass
from importlib import import_module
from typing import Any

import numpy as np

from boomctl.arrays import Array
from boomctl.checks import positive, real
from boomctl.slew.plant import Plant, SlewMachine, plant_of
from boomctl.slew.result import SlewResult
from boomctl.slew.shapers import classical_torque, shaper
from boomctl.slew.torque import TorqueHistory

__all__ = ["SlewComparison", "SlewLine", "compare_slews"]

CLASSICAL = (
    ("bang-bang", "none"),
    ("smoothed", "none"),
    ("versine", "none"),
    ("bang-bang", "ZV"),
    ("bang-bang", "ZVD"),
    ("bang-bang", "EI"),
    ("versine", "ZV"),
)
_CHANGES = (0.9, 1.1)


@dataclass(frozen=True, eq=False)
class SlewLine:
    """One way to slew.

    Attributes
    ----------
    name : str
    duration : float
        s.
    vibration : float
        Largest tip displacement after the end, m.
    angle_error : float
        Of the hub, its mean after the end, rad.
    peak_moment : float
        Largest bending moment at the clamp on the way, N m.
    effort : float
        N^2 m^2 s.
    vibration_low, vibration_high : float
        The vibration with the beam's frequencies 10 % below and above, m.
    history : TorqueHistory
    time, tip_displacement : ndarray, k
        On the way and afterwards, s and m.
    """

    name: str
    duration: float
    vibration: float
    angle_error: float
    peak_moment: float
    effort: float
    vibration_low: float
    vibration_high: float
    history: TorqueHistory
    time: Array
    tip_displacement: Array


@dataclass(frozen=True, eq=False)
class SlewComparison:
    """Slews of one beam through one angle, under one torque limit."""

    angle: float
    torque_limit: float
    lines: tuple[SlewLine, ...]

    def plot(self) -> Any:
        """Draw torques and tip displacements; returns a matplotlib figure."""
        return import_module("boomctl.plotting").plot_slew_comparison(self)


def compare_slews(
    h: SlewMachine, angle: float, torque_limit: float, optimal: dict[str, SlewResult] | None = None
) -> SlewComparison:
    """Play classical slews, and optimal ones planned before, on a hub-beam, and measure what matters.

    The shapers are tuned to the first mode with the hub free. The frequencies are changed by 10 % through the beam's
    bending stiffness.

    Parameters
    ----------
    h : SlewMachine
        The hub-beam.
    angle : float
        rad.
    torque_limit : float
        N m.
    optimal : dict of str to SlewResult, optional
        By the name they are to have.

    Returns
    -------
    SlewComparison

    Raises
    ------
    TypeError, ValueError
        Of a bad argument.
    """
    plant = plant_of(h)
    if plant.frequencies is None or plant.inertia is None or plant.machine is None:
        raise TypeError(f"h = {type(h).__name__}: expected a hub-beam")
    limit, turn = positive("torque_limit", torque_limit), real("angle", angle)
    if not all(isinstance(each, SlewResult) for each in _listed(optimal)):
        raise TypeError("optimal: expected a dict of what optimal_slew returns")
    torques = {name: result.history for name, result in (optimal or {}).items()}
    for shape, name in CLASSICAL:
        train = shaper(name, float(plant.frequencies[1]), _damping(plant))
        body = "smoothed bang-bang" if shape == "smoothed" else shape
        label = body if name == "none" else f"{body}, {name}"
        torques[label] = classical_torque(shape, train, turn, plant.inertia, limit)
    others = tuple(plant.machine.with_stiffness(factor**2) for factor in _CHANGES)
    lines = tuple(_line(name, history, plant, others, turn) for name, history in torques.items())
    return SlewComparison(turn, limit, lines)


def _listed(optimal: object) -> list[object]:
    if optimal is not None and not isinstance(optimal, dict):
        raise TypeError(f"optimal = {optimal!r}: expected a dict of what optimal_slew returns")
    return list((optimal or {}).values())


def _damping(plant: Plant) -> float:
    """Damping ratio of the first flexible mode."""
    assert plant.frequencies is not None
    half = plant.n // 2
    return float(-0.5 * plant.A[half + 1, half + 1] / plant.frequencies[1])


def _line(name: str, history: TorqueHistory, plant: Plant, others: tuple[Any, ...], angle: float) -> SlewLine:
    assert plant.machine is not None
    assert plant.frequencies is not None
    during = np.linspace(0.0, history.duration, 401)
    after = history.duration + np.linspace(0.0, 3.0 * np.pi / plant.frequencies[1], 121)
    t = np.concatenate([during[:-1], after])
    r = plant.machine.simulate_torque(history, t, history.breakpoints)
    late = t >= after[0]
    left = [
        float(np.abs(each.simulate_torque(history, after, history.breakpoints).tip_displacement).max())
        for each in others
    ]
    moment = np.abs(r.states @ plant.machine.root_moment_row)
    angles = r.hub_angle[late]
    return SlewLine(
        name=name,
        duration=history.duration,
        vibration=float(np.abs(r.tip_displacement[late]).max()),
        angle_error=float(0.5 * (angles.max() + angles.min()) - angle),
        peak_moment=float(moment.max()),
        effort=history.effort,
        vibration_low=left[0],
        vibration_high=left[1],
        history=history,
        time=t,
        tip_displacement=r.tip_displacement,
    )
