"""A planned slew followed by a hub-beam with another tip mass, with and without feedback, side by side."""

from dataclasses import dataclass
from importlib import import_module
from typing import Any

import numpy as np

from boomctl.arrays import Array
from boomctl.checks import instance, nonnegative, positive
from boomctl.lti.time_series import TimeSeries
from boomctl.slew.result import SlewError, SlewResult
from boomctl.threads import one_blas_thread

_RTOL, _ATOL = 1e-7, 1e-9  # of the motions, in which errors of millimetres are looked for (a choice)


@dataclass(frozen=True, eq=False)
class TrackingResult(TimeSeries):
    """A slew followed by a plant that is not quite the planned one, without and with feedback.

    Attributes
    ----------
    tip_mass : float
        The true tip mass [kg].
    time : ndarray, k
        Instants, on beyond the end of the slew [s].
    gains : ndarray, m x n
        Gains of the feedback at the samples until the end: ``u = u_planned + K (x - x_planned)``, states in the plant's
        own order.
    reference_angle, reference_tip : ndarray, k
        Hub angle [rad] and tip displacement [m] as planned.
    torque, hub_angle, tip_displacement : ndarray, k
        With feedback: torque [N m], hub angle [rad], tip displacement [m].
    open_torque, open_hub_angle, open_tip_displacement : ndarray, k
        The same without feedback.
    final_angle_error, open_final_angle_error : float
        Absolute error of the hub angle at the last instant, with and without feedback [rad].
    tip_swing, open_tip_swing : float
        Largest tip displacement in the last slowest period, with and without feedback [m].
    """

    tip_mass: float
    time: Array
    gains: Array
    reference_angle: Array
    reference_tip: Array
    torque: Array
    hub_angle: Array
    tip_displacement: Array
    open_torque: Array
    open_hub_angle: Array
    open_tip_displacement: Array
    final_angle_error: float
    open_final_angle_error: float
    tip_swing: float
    open_tip_swing: float

    def __repr__(self) -> str:
        angle = f"final angle error {self.final_angle_error:.3g} rad, in open loop {self.open_final_angle_error:.3g}"
        swing = f"tip swing {self.tip_swing:.3g} m, in open loop {self.open_tip_swing:.3g}"
        return f"TrackingResult: tip mass {self.tip_mass:.4g} kg\n  {angle}\n  {swing}"

    def _outputs(self) -> dict[str, Array]:
        moved = {"hub_angle": self.hub_angle, "tip_displacement": self.tip_displacement}
        planned = {"reference_angle": self.reference_angle, "reference_tip": self.reference_tip}
        alone = {"open_hub_angle": self.open_hub_angle, "open_tip_displacement": self.open_tip_displacement}
        return {**moved, **planned, **alone}

    def _inputs(self) -> dict[str, Array]:
        return {"torque": self.torque, "open_torque": self.open_torque}

    def plot(self, ax: Any = None, **style: Any) -> Array:
        """Draw angle, tip and torque over time.

        Parameters
        ----------
        ax : sequence of matplotlib Axes, or a figure, optional
            Where to draw: hub angle, tip displacement and torque; by default a new figure of pyplot.
        **style
            Of the curves, as matplotlib's lines take it; a ``label`` stands before their names.

        Returns
        -------
        ndarray of matplotlib.axes.Axes
            Those drawn on, in the order in which ``ax`` names them.
        """
        return import_module("boomctl.plotting").plot_tracking(self, ax, **style)


@one_blas_thread
def track(
    result: SlewResult,
    tip_mass: float,
    *,
    sample_time: float = 0.005,
    settle: float | None = None,
    torque_margin: float = 1.5,
    error_weight: float = 1000.0,
) -> TrackingResult:
    """Follow a planned slew with feedback, by a hub-beam with another tip mass than the planned one.

    The feedback is that of `SlewResult.track`, all states known and without integral action; there one also finds
    sensors, noise, disturbances and many runs at once.

    Parameters
    ----------
    result : SlewResult
        A slew of a hub-beam.
    tip_mass : float
        The true tip mass [kg].
    sample_time : float
        The torque is held so long [s].
    settle : float or None
        Time simulated after the slew [s]; None: four of the slowest periods.
    torque_margin : float
        The limit of the torque with feedback over that of the planning; a time-optimal slew leaves none of its own.
    error_weight : float
        Weight of the deviations of hub angle, tip and their rates over their largest sizes, squared, beside that of the
        torque over its limit; larger follows more tightly.

    Returns
    -------
    TrackingResult
        Motions without and with feedback; ``.plot()`` draws them.

    Raises
    ------
    TypeError, ValueError
        An argument of another kind or out of its range; a slew of a linear system.
    SlewError
        If the motion with feedback overflows.

    Examples
    --------
    >>> import boomctl as bc
    >>> fast = bc.optimal_slew(bc.hub_beam(modes=1), angle=1.0, torque_limit=200.0)
    >>> found = bc.slew.track(fast, tip_mass=0.5)
    >>> round(found.open_tip_swing, 2), round(found.tip_swing, 2)  # m, without and with feedback
    (3.64, 0.01)
    """
    instance("result", result, SlewResult)
    mass = nonnegative("tip_mass", tip_mass)
    tracked = result.track(
        sample_time=sample_time,
        torque_limit=positive("torque_margin", torque_margin) * result.plan.problem.limits.torque,
        settle=settle,
        error_weight=error_weight,
        integral_time=None,
    )
    true = tracked.machine.with_tip_mass(mass)
    try:
        closed, free = (tracked.simulate(true, feedback=on, rtol=_RTOL, atol=_ATOL) for on in (True, False))
    except ValueError as error:
        raise SlewError(f"tip_mass = {mass:g}: {error}") from None
    late = tracked.time >= tracked.time[-1] - tracked.period
    planned, tip = (tracked.reference[name] for name in ("hub_angle", "tip_displacement"))
    return TrackingResult(
        tip_mass=mass,
        time=tracked.time,
        gains=tracked.gains[:-1],
        reference_angle=planned,
        reference_tip=tip,
        torque=closed.controls["torque"],
        hub_angle=closed["hub_angle"],
        tip_displacement=closed["tip_displacement"],
        open_torque=free.controls["torque"],
        open_hub_angle=free["hub_angle"],
        open_tip_displacement=free["tip_displacement"],
        final_angle_error=float(abs(closed["hub_angle"][-1] - planned[-1])),
        open_final_angle_error=float(abs(free["hub_angle"][-1] - planned[-1])),
        tip_swing=float(np.abs(closed["tip_displacement"][late]).max()),
        open_tip_swing=float(np.abs(free["tip_displacement"][late]).max()),
    )
