"""The switching function of a bang-bang slew of a nonlinear plant, along the motion."""

from dataclasses import dataclass
from importlib import import_module
from typing import TYPE_CHECKING

import numpy as np

from boomctl.arrays import Array
from boomctl.printing import count
from boomctl.slew.least_time.arcs import course, stretches
from boomctl.slew.reference import guess_from, typical_sizes
from boomctl.slew.result import SlewResult

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_SAMPLES = 200
_STEPS = 1500


@dataclass(frozen=True, eq=False)
class SwitchingCurve:
    """Time that a unit of torque saves, over the largest it saves: Pontryagin's principle asks for the torque's sign.

    Attributes
    ----------
    time : ndarray, k
        s.
    values : ndarray, k
        Between -1 and 1.
    torque : ndarray, k
        N m.
    switches : ndarray
        Instants at which the torque changes its sign, s.
    torque_limit : float
        N m.
    """

    time: Array
    values: Array
    torque: Array
    switches: Array
    torque_limit: float

    def __repr__(self) -> str:
        agree = f"{self.agreement:.4%} of the time the torque has its sign"
        return f"SwitchingCurve: {count(len(self.switches), 'switch', 'switches')} in {self.time[-1]:.6g} s; {agree}"

    @property
    def agreement(self) -> float:
        """Share of the duration on which the torque has the sign of the switching function."""
        return float(np.mean(self.values * self.torque > 0.0))

    def plot(self) -> "Figure":
        """Draw the switching function above the torque; returns a matplotlib figure."""
        return import_module("boomctl.plotting").plot_switching(self)


def switching_curve(result: SlewResult) -> SwitchingCurve:
    """Carry the costate of a minimum-time slew back along its motion.

    The multipliers of the end conditions are those with which the duration of every stretch saves as much time as it takes.

    Parameters
    ----------
    result : SlewResult
        With a bang-bang torque.

    Raises
    ------
    ValueError
        The torque is not bang-bang.
    """
    history, problem = result.history, result.plan.problem
    if result.certificate.switches is None:
        raise ValueError(
            "result: expected a slew with a bang-bang torque; plan one of minimum time without other limits"
        )
    durations = np.diff(history.edges)
    way = course(problem, typical_sizes(guess_from(problem, history, _SAMPLES, False)))
    pace = max(way.pace, _STEPS / history.duration)
    u, h, moved = stretches(history.left, durations, np.maximum(2, np.ceil(durations * pace)).astype(int))
    reach = way.reach(u, h)
    values = -(reach.weights(moved) @ reach.by_torque) / h
    middle = np.cumsum(h) - 0.5 * h
    return SwitchingCurve(middle, values / np.abs(values).max(), u, history.switches, problem.torque_limit)
