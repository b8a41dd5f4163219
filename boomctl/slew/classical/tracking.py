"""Following a planned slew: its torque as feedforward, and a time-varying LQR about its trajectory.

The linearisation along the trajectory is sampled exactly as the torque is held; the Riccati recursion runs back from the
stationary solution at the end state, whose gain also serves after the end. All states are taken as known.
"""

from dataclasses import dataclass
from importlib import import_module
from typing import Any

import casadi as ca
import numpy as np
from scipy.linalg import solve_discrete_are

from boomctl.arrays import Array
from boomctl.checks import nonnegative, positive
from boomctl.slew.dynamics import explicit_step
from boomctl.slew.plant import SlewPlant, plant_of
from boomctl.slew.result import SlewError, SlewResult

_FEWEST = 8  # samples of a slew at least: fewer would not follow it
_SETTLE = 4.0  # slowest periods for which the plant is followed after the end
_FINE = 20  # instants of a sample whose mean is the torque that is held
_SUBSTEPS = 2  # of the plant that follows; one is what the feedback was designed with


@dataclass(frozen=True, eq=False)
class TrackingResult:
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
    (3.64, 0.02)
    """
    if not isinstance(result, SlewResult):
        raise TypeError(f"result = {type(result).__name__}: expected what optimal_slew returns")
    problem = result.plan.problem
    plant = problem.plants[0]
    if plant.machine is None:
        raise TypeError("result: expected a slew of a hub-beam")
    true = plant_of(plant.machine.with_tip_mass(nonnegative("tip_mass", tip_mass)))
    count = max(_FEWEST, round(result.duration / positive("sample_time", sample_time)))
    step = result.duration / count
    rest = _SETTLE * plant.period if settle is None else nonnegative("settle", settle)
    after = int(np.ceil(rest / step))
    fine = np.linspace(0.0, result.duration, _FINE * count + 1)
    torques = result.history(0.5 * (fine[1:] + fine[:-1])).reshape(count, _FINE).mean(axis=1)
    edges = step * np.arange(count + 1)
    planned = plant.machine.simulate_torque(result.history, edges, result.history.breakpoints, result.states[0])
    z = planned.states @ plant.from_state.T
    Q = positive("error_weight", error_weight) * _weights(plant, z)
    gains, last = _gains(plant, z, torques, step, Q, problem.limits.torque)
    gains, last = gains @ plant.from_state, last @ plant.from_state
    # after the end the plant is to turn on steadily, without torque
    z = np.vstack([z, *(z[-1] + plant.rest(problem.final_speed * k * step, 0.0) for k in range(1, after + 1))])
    torques = np.concatenate([torques, np.zeros(after)])
    every = np.concatenate([gains, np.repeat(last[None], after, axis=0)])
    limit = positive("torque_margin", torque_margin) * problem.limits.torque
    states = z @ plant.to_state.T
    torque, closed = _followed(true, states, torques, every, step, limit)
    open_torque, free = _followed(true, states, torques, 0.0 * every, step, np.inf)
    rows = {name: row @ plant.from_state for name, row in plant.rows.items()}
    t, reference = step * np.arange(len(z)), z @ plant.rows["angle"]
    late = t >= t[-1] - plant.period
    angle, tip = closed @ rows["angle"], closed @ rows["tip"]
    open_angle, open_tip = free @ rows["angle"], free @ rows["tip"]
    return TrackingResult(
        tip_mass=tip_mass,
        time=t,
        gains=gains,
        reference_angle=reference,
        reference_tip=z @ plant.rows["tip"],
        torque=torque,
        hub_angle=angle,
        tip_displacement=tip,
        open_torque=open_torque,
        open_hub_angle=open_angle,
        open_tip_displacement=open_tip,
        final_angle_error=float(abs(angle[-1] - reference[-1])),
        open_final_angle_error=float(abs(open_angle[-1] - reference[-1])),
        tip_swing=float(np.abs(tip[late]).max()),
        open_tip_swing=float(np.abs(open_tip[late]).max()),
    )


def _weights(plant: SlewPlant, planned: Array) -> Array:
    """Angle, tip, and their rates, each over its largest size on the way, squared."""
    half, total = plant.n // 2, np.zeros((plant.n, plant.n))
    for name in ("angle", "tip"):
        row = plant.rows[name]
        for each in (row, np.concatenate([np.zeros(half), row[:half]])):
            scaled = each / max(float(np.abs(planned @ each).max()), 1e-12)
            total += np.outer(scaled, scaled)
    return total


def _gains(
    plant: SlewPlant, planned: Array, torques: Array, step: float, Q: Array, limit: float
) -> tuple[Array, Array]:
    """Gains of all samples and of the time after, in the plant's coordinates."""
    z, u, h = ca.SX.sym("z", plant.n), ca.SX.sym("u"), ca.SX.sym("h")
    jacobian = ca.densify(ca.jacobian(explicit_step(plant, 1)(z, u, u, h), ca.vertcat(z, u)))
    sampled = ca.Function("sampled", [z, u, h], [jacobian])
    count, n, R = torques.size, plant.n, step / limit**2
    every = np.array(sampled.map(count)(planned[:-1].T, torques[None, :], np.full((1, count), step)))
    every = every.reshape(n, count, n + 1).transpose(1, 0, 2)
    rest, keep = np.array(sampled(planned[-1], 0.0, step)), plant.controllable
    inner, P = np.ix_(keep, keep), np.zeros((n, n))
    P[inner] = solve_discrete_are(rest[:, :n][inner], rest[keep, n:], step * Q[inner], np.array([[R]]))

    def gain(AB: Array) -> Array:
        A, b = AB[:, :n], AB[:, n]
        return -(b @ P @ A) / (R + b @ P @ b)

    last, gains = gain(rest), np.empty((count, n))
    for k in range(count - 1, -1, -1):
        gains[k] = gain(every[k])
        closed = every[k][:, :n] + np.outer(every[k][:, n], gains[k])
        P = step * Q + closed.T @ P @ closed + R * np.outer(gains[k], gains[k])
        P = 0.5 * (P + P.T)
        P[~keep], P[:, ~keep] = 0.0, 0.0
    return gains, last


def _followed(
    true: SlewPlant, states: Array, torques: Array, gains: Array, step: float, limit: float
) -> tuple[Array, Array]:
    """Torque and states of the true plant."""
    z, u, h = ca.SX.sym("z", true.n), ca.SX.sym("u"), ca.SX.sym("h")
    advance = ca.Function("advance", [z, u, h], [explicit_step(true, _SUBSTEPS)(z, u, u, h)])
    now, used, seen = true.from_state @ states[0], [], [states[0]]
    for k in range(torques.size):
        torque = float(np.clip(torques[k] + gains[k] @ (seen[-1] - states[k]), -limit, limit))
        now = np.array(advance(now, torque, step)).ravel()
        if not np.isfinite(now).all():
            raise SlewError(f"tip_mass: the motion with feedback overflows at t = {k * step:.4g} s")
        used.append(torque)
        seen.append(true.to_state @ now)
    return np.append(used, used[-1]), np.array(seen)
