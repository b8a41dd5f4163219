"""The switching function of a slew of least time, beside the torque that follows its sign."""

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

_CURVE = 1500  # steps at least of a switching curve: it is drawn


@dataclass(frozen=True, eq=False)
class SwitchingFunction(TimeSeries):
    """Time that a unit of torque saves, over the largest it saves: Pontryagin's principle asks for the torque's sign.

    Attributes
    ----------
    time : ndarray, k
        Instants [s].
    values : ndarray, k
        The switching function, between -1 and 1.
    torque : ndarray, k
        The torque [N m].
    switching_times : ndarray
        Instants at which the torque changes its sign [s].
    torque_limit : float
        Largest torque either way [N m].
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
        """Share of the duration on which the torque has the sign of the switching function."""
        return float(np.mean(self.values * self.torque > 0.0))

    def plot(self, ax: Any = None, **style: Any) -> Array:
        """Draw the switching function above the torque.

        Parameters
        ----------
        ax : sequence of matplotlib Axes, or a figure, optional
            Where to draw: switching function and torque; by default a new figure of pyplot.
        **style
            Of the curves, as matplotlib's lines take it; a ``label`` stands before their names.

        Returns
        -------
        ndarray of matplotlib.axes.Axes
            Those drawn on, in the order in which ``ax`` names them.
        """
        return import_module("boomctl.plotting.slew").plot_switching(self, ax, **style)


@one_blas_thread
def switching_function(result: SlewResult) -> SwitchingFunction:
    """Return the switching function of a minimum-time slew.

    Pontryagin's principle: the torque has the sign of this function.  It is found by carrying the costate back along the
    motion.

    Parameters
    ----------
    result : SlewResult
        With a bang-bang torque.

    Returns
    -------
    SwitchingFunction
        The function over time, beside the torque; ``.plot()`` draws both.

    Raises
    ------
    ValueError
        The torque is not bang-bang.

    Examples
    --------
    >>> import boomctl as bc
    >>> fast = bc.optimal_slew(bc.hub_beam(modes=1), angle=1.0, torque_limit=200.0)
    >>> curve = bc.slew.switching_function(fast)
    >>> curve.switching_times.round(2), round(curve.sign_agreement, 2)  # s; share of the time with the right sign
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
