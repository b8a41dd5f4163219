"""Switching function of a minimum-time slew."""

from dataclasses import dataclass
from importlib import import_module
from typing import Any

import numpy as np

from boomctl.arrays import Array
from boomctl.checks import instance
from boomctl.lti.time_series import TimeSeries
from boomctl.printing import count
from boomctl.slew.end_map import end_map
from boomctl.slew.result import SlewResult
from boomctl.threads import one_blas_thread

_CURVE = 1500  # steps of a switching function at least: resolution of its plot


@dataclass(frozen=True, eq=False)
class SwitchingFunction(TimeSeries):
    """Switching function of a slew: time saved per unit of torque, over its maximum. Its sign is the torque's.

    Attributes
    ----------
    time : ndarray, k
        Time points [s].
    values : ndarray, k
        The switching function, between -1 and 1.
    torque : ndarray, k
        The torque [N m].
    switching_times : ndarray
        Times at which the torque changes its sign [s].
    torque_limit : float
        Largest absolute torque [N m].
    """

    time: Array
    values: Array
    torque: Array
    switching_times: Array
    torque_limit: float

    def __repr__(self) -> str:
        agree = f"{self.sign_agreement:.4%} of the time the torque has its sign"
        return (
            f"SwitchingFunction: {count(len(self.switching_times), 'switch', 'switches')} in {self.time[-1]:.6g} s; "
            f"{agree}"
        )

    def _outputs(self) -> dict[str, Array]:
        return {"values": self.values}

    def _inputs(self) -> dict[str, Array]:
        return {"torque": self.torque}

    @property
    def sign_agreement(self) -> float:
        """Fraction of the duration on which the torque has the sign of the switching function."""
        return float(np.mean(self.values * self.torque > 0.0))

    def plot(self, ax: Any = None, **style: Any) -> Array:
        """Draw the switching function above the torque.

        Parameters
        ----------
        ax : sequence of matplotlib Axes, or a figure, optional
            Axes to draw on: switching function and torque. If None, a new figure is created.
        **style
            Line properties, passed to `matplotlib.axes.Axes.plot`; ``label`` is prefixed to the line labels.

        Returns
        -------
        ndarray of matplotlib.axes.Axes
            The axes, in the order of ``ax``.
        """
        return import_module("boomctl.plotting.slew").plot_switching(self, ax, **style)


@one_blas_thread
def switching_function(result: SlewResult) -> SwitchingFunction:
    """Return the switching function of a minimum-time slew.

    By Pontryagin's principle, the torque has the sign of this function.  It follows from the costate, propagated backward
    along the motion.

    Parameters
    ----------
    result : SlewResult
        Slew with a bang-bang torque.

    Returns
    -------
    SwitchingFunction
        Switching function and torque over time; ``.plot()`` draws both.

    Raises
    ------
    ValueError
        If the torque is not bang-bang.

    Examples
    --------
    >>> import boomctl as bc
    >>> fast = bc.optimal_slew(bc.hub_beam(modes=1), angle=1.0, torque_limit=200.0)
    >>> curve = bc.slew.switching_function(fast)
    >>> curve.switching_times.round(2), round(curve.sign_agreement, 2)  # s; fraction of the time with the right sign
    (array([0.82, 1.26, 1.69]), 1.0)
    """
    instance("result", result, SlewResult)
    history, problem = result.torque_profile, result.plan.problem
    if result.certificate.n_switches is None:
        raise ValueError(
            "result: expected a slew with a bang-bang torque; plan one of minimum time without other limits"
        )
    durations, ends = np.diff(history.edges), end_map(problem, history)
    frequency = max(ends.step_frequency, _CURVE / history.duration)
    counts = np.maximum(2, np.ceil(durations * frequency)).astype(int)
    steps = ends.steps(float(np.sign(history.start_values[0])), durations, counts)
    values = ends.sensitivity(steps).switching_function
    middle = np.cumsum(steps.h) - 0.5 * steps.h
    return SwitchingFunction(
        middle, values / np.abs(values).max(), steps.u, history.switching_times, problem.limits.torque
    )
