"""Following a planned slew: its torque as feedforward, and a time-varying LQR about its trajectory.

The linearisation along the trajectory is sampled exactly as the torque is held; the Riccati recursion runs back from the
stationary solution at the end state, whose gain also serves after the end. All states are taken as known.
"""

from dataclasses import dataclass
from importlib import import_module
from typing import TYPE_CHECKING

import numpy as np

from boomctl.arrays import Array
from boomctl.checks import nonnegative, positive
from boomctl.slew.least_time.stepping import shooting_step
from boomctl.slew.plant import Plant, plant_of
from boomctl.slew.result import SlewError, SlewResult

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True, eq=False)
class TrackingResult:
    """A slew followed by a plant that is not quite the planned one, without and with feedback.

    Attributes
    ----------
    tip_mass : float
        The true one, kg.
    time : ndarray, k
        s; beyond the end of the slew.
    gains : ndarray, m x n
        Of the samples until the end: ``u = u_planned + K (x - x_planned)``, states in the plant's own order.
    reference_angle, reference_tip : ndarray, k
        As planned, rad and m.
    torque, hub_angle, tip_displacement : ndarray, k
        With feedback, N m, rad, m.
    open_torque, open_hub_angle, open_tip_displacement : ndarray, k
        Without.
    final_angle_error, open_final_angle_error : float
        At the last instant, rad, absolute.
    tip_swing, open_tip_swing : float
        Largest tip displacement in the last slowest period, m.
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

    def plot(self) -> "Figure":
        """Draw angle, tip and torque over time; returns a matplotlib figure."""
        return import_module("boomctl.plotting").plot_tracking(self)


def track(
    result: SlewResult,
    tip_mass: float,
    *,
    sample_time: float = 0.005,
    settle: float | None = None,
    torque_margin: float = 1.5,
    error_weight: float = 1000.0,
) -> TrackingResult:
    """Follow a slew of a hub-beam with another tip mass than the planned one.

    Parameters
    ----------
    result : SlewResult
        Of a hub-beam.
    tip_mass : float
        The true one, kg.
    sample_time : float
        The torque is held so long, s.
    settle : float or None
        Time after the slew, s; None: four of the slowest periods.
    torque_margin : float
        The limit of the torque with feedback over that of the planning; a time-optimal slew leaves none of its own.
    error_weight : float
        Weight of the deviations of hub angle, tip and their rates over their largest sizes, squared, beside that of the
        torque over its limit; larger follows more tightly.

    Returns
    -------
    TrackingResult

    Raises
    ------
    TypeError, ValueError
        Of a bad argument, or a slew of a linear system.
    SlewError
        If the motion with feedback overflows.
    """
    if not isinstance(result, SlewResult):
        raise TypeError(f"result = {type(result).__name__}: expected what optimal_slew returns")
    problem = result.plan.problem
    plant = problem.plants[0]
    if plant.machine is None:
        raise TypeError("result: expected a slew of a hub-beam")
    true = plant_of(plant.machine.with_tip_mass(nonnegative("tip_mass", tip_mass)))
    count = max(8, round(result.duration / positive("sample_time", sample_time)))
    step = result.duration / count
    places, torques = _reference(result, plant, count)
    rest = 8.0 * np.pi / float(plant.frequencies[1]) if settle is None else nonnegative("settle", settle)  # pyright: ignore
    after = int(np.ceil(rest / step))
    Q = positive("error_weight", error_weight) * _weights(plant, places)
    gains, last = _gains(plant, places, torques, step, Q, problem.torque_limit)
    ends = np.array([_turned(plant, places[-1], k * step, problem.final_speed) for k in range(1, after + 1)])
    places = np.vstack([places, ends]) if after else places
    torques = np.concatenate([torques, np.zeros(after)])
    every = np.concatenate([gains, np.repeat(last[None], after, axis=0)]) @ plant.from_state
    limit = positive("torque_margin", torque_margin) * problem.torque_limit
    states = places @ plant.to_state.T
    closed = _followed(true, states, torques, every, step, limit)
    free = _followed(true, states, torques, 0.0 * every, step, np.inf)
    return _result(tip_mass, step, plant, places, gains @ plant.from_state, closed, free)


def _reference(result: SlewResult, plant: Plant, count: int) -> tuple[Array, Array]:
    """Planned coordinates at the samples, and the mean torque between them."""
    step = result.duration / count
    edges = step * np.arange(count + 1)
    machine = plant.machine
    assert machine is not None
    fine = np.linspace(0.0, result.duration, 20 * count + 1)
    torques = result.history(0.5 * (fine[1:] + fine[:-1])).reshape(count, 20).mean(axis=1)
    start = result.states[0]
    r = machine.simulate_torque(result.history, edges, result.history.breakpoints, start)
    return r.states @ plant.from_state.T, torques


def _weights(plant: Plant, places: Array) -> Array:
    """Angle, tip, and their rates, each over its largest size on the way, squared."""
    half, total = plant.n // 2, np.zeros((plant.n, plant.n))
    for name in ("angle", "tip"):
        row = plant.rows[name]
        for each in (row, np.concatenate([np.zeros(half), row[:half]])):
            scaled = each / max(float(np.abs(places @ each).max()), 1e-12)
            total += np.outer(scaled, scaled)
    return total


def _gains(plant: Plant, places: Array, torques: Array, step: float, Q: Array, limit: float) -> tuple[Array, Array]:
    """Gains of all samples and of the time after, in the plant's coordinates."""
    import casadi as ca
    from scipy.linalg import solve_discrete_are

    z, u, h = ca.SX.sym("z", plant.n), ca.SX.sym("u"), ca.SX.sym("h")
    following = shooting_step(plant, 1)(z, u, u, h)
    slopes = ca.Function("slopes", [z, u, h], [ca.densify(ca.jacobian(following, ca.vertcat(z, u)))])
    count, n, R = torques.size, plant.n, 1.0 / limit**2
    every = np.array(slopes.map(count)(places[:-1].T, torques[None, :], np.full((1, count), step)))
    every = every.reshape(n, count, n + 1).transpose(1, 0, 2)
    rest = np.array(slopes(places[-1], 0.0, step))
    keep = plant.reach
    P = np.zeros((n, n))
    P[np.ix_(keep, keep)] = solve_discrete_are(
        rest[:, :n][np.ix_(keep, keep)], rest[keep, n:], step * Q[np.ix_(keep, keep)], np.array([[step * R]])
    )
    last = _gain(rest, P, step * R)
    gains = np.empty((count, n))
    for k in range(count - 1, -1, -1):
        gains[k] = _gain(every[k], P, step * R)
        closed = every[k][:, :n] + np.outer(every[k][:, n], gains[k])
        P = step * Q + closed.T @ P @ closed + step * R * np.outer(gains[k], gains[k])
        P = 0.5 * (P + P.T)
        P[~keep], P[:, ~keep] = 0.0, 0.0
    return gains, last


def _gain(slopes: Array, P: Array, R: float) -> Array:
    A, b = slopes[:, :-1], slopes[:, -1]
    return -(b @ P @ A) / (R + b @ P @ b)


def _turned(plant: Plant, place: Array, time: float, speed: float) -> Array:
    """Where steady rotation has come after a time."""
    return place + plant.rest(speed * time, 0.0)


def _followed(
    true: Plant, states: Array, torques: Array, gains: Array, step: float, limit: float
) -> tuple[Array, Array]:
    """Torque and states of the true plant."""
    import casadi as ca

    z, u, h = ca.SX.sym("z", true.n), ca.SX.sym("u"), ca.SX.sym("h")
    advance = ca.Function("advance", [z, u, h], [shooting_step(true, 2)(z, u, u, h)])
    place, used, seen = true.from_state @ states[0], [], [states[0]]
    for k in range(torques.size):
        torque = float(np.clip(torques[k] + gains[k] @ (seen[-1] - states[k]), -limit, limit))
        place = np.array(advance(place, torque, step)).ravel()
        if not np.isfinite(place).all():
            raise SlewError(f"tip_mass: the motion with feedback overflows at t = {k * step:.4g} s")
        used.append(torque)
        seen.append(true.to_state @ place)
    return np.append(used, used[-1]), np.array(seen)


def _result(
    tip_mass: float,
    step: float,
    plant: Plant,
    places: Array,
    gains: Array,
    closed: tuple[Array, Array],
    free: tuple[Array, Array],
) -> TrackingResult:
    rows = {name: row @ plant.from_state for name, row in plant.rows.items()}
    t = step * np.arange(places.shape[0])
    assert plant.frequencies is not None
    late = t >= t[-1] - 2.0 * np.pi / plant.frequencies[1]
    reference = places @ plant.rows["angle"]
    angle, tip = closed[1] @ rows["angle"], closed[1] @ rows["tip"]
    open_angle, open_tip = free[1] @ rows["angle"], free[1] @ rows["tip"]
    return TrackingResult(
        tip_mass, t, gains, reference, places @ plant.rows["tip"],
        closed[0], angle, tip, free[0], open_angle, open_tip,
        float(abs(angle[-1] - reference[-1])), float(abs(open_angle[-1] - reference[-1])),
        float(np.abs(tip[late]).max()), float(np.abs(open_tip[late]).max()),
    )  # fmt: skip
