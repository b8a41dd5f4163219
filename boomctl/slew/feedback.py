"""Feedback along a plan: time-varying linearization, regulator (backward recursion) and observer (forward recursion).

States are deviations from the plan in the machine's modes at rest, without modes that the torque cannot excite.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import LinAlgError, solve_discrete_are

from boomctl.arrays import Array
from boomctl.lti.rounding import SUMMED
from boomctl.lti.sampled import sampled_plant
from boomctl.lti.system import Lti, lower_lft
from boomctl.simulation.machine.exponential_step import exponential_step
from boomctl.simulation.machine.run import moved_by, steps_for
from boomctl.simulation.time_varying import TimeVaryingController

if TYPE_CHECKING:
    from boomctl.lti.machine_modes import MachineModes


@dataclass(frozen=True, eq=False)
class Along:
    """A machine linearized along a plan: deviations ``z+ = A z + b u``, ``y = C z + D u``, u acting before the sample.

    Attributes
    ----------
    A, b : ndarray, (k + 1) x n x n and (k + 1) x n
        Transition from each sample to the next under a held torque; the last is for the rest at the end.
    C, D : ndarray, (k + 1) x p x n and (k + 1) x p
        Output matrices of the measurements.
    moved : ndarray of bool, 2 m
        Mask of the machine's modal coordinates and rates that z contains.
    """

    A: Array
    b: Array
    C: Array
    D: Array
    moved: Array


def linearized_along(modes: MachineModes, measured: list[int], states: Array, torques: Array, step: float) -> Along:
    """Linearize a machine along a plan.

    Parameters
    ----------
    modes : MachineModes
        The machine; its first input is the torque.
    measured : list of int
        Indices of the measured outputs.
    states : ndarray, (k + 1) x 2 m
        Modal coordinates and rates at the samples.
    torques : ndarray, k
        Torque held from each sample to the next [N m].
    step : float
        Time between samples [s].
    """
    import casadi as ca

    z, u, others = ca.SX.sym("z", states.shape[1]), ca.SX.sym("u"), len(modes.input_labels) - 1
    inputs = ca.vertcat(u, ca.SX.zeros(others))
    now, count = z, steps_for(modes, step)
    for _ in range(count):
        now = exponential_step(modes.rest, modes.omega, step / count, now, inputs, inputs)
    moved = np.tile(moved_by(modes.push[:, 0]), 2)
    selected = np.flatnonzero(moved).tolist()
    both = ca.vertcat(z[selected], u)
    read = modes.read(z, inputs)[0][measured]
    flow = ca.Function("flow", [z, u], [ca.densify(ca.jacobian(now[selected], both))])
    measurement = ca.Function("measurement", [z, u], [ca.densify(ca.jacobian(read, both))])
    held, before = np.append(torques, 0.0), np.append(0.0, torques)
    AB = _stacked(flow.map(len(held))(states.T, held[None]), len(held))
    CD = _stacked(measurement.map(len(held))(states.T, before[None]), len(held))
    return Along(AB[..., :-1], AB[..., -1], CD[..., :-1], CD[..., -1], moved)


def _stacked(matrices: object, count: int) -> Array:
    wide = np.array(matrices)
    return wide.reshape(len(wide), count, -1).swapaxes(0, 1)


def weights(along: Along, rows: Array, states: Array) -> Array:
    """Return the weight of hub angle, tip (rows) and their rates, each divided by its squared span in the plan."""
    half, total = states.shape[1] // 2, np.zeros((along.moved.sum(),) * 2)
    for row in rows:
        for item in (row, np.concatenate([np.zeros(half), row[:half]])):
            size = max(float(np.ptp(states @ item)), SUMMED)
            total += np.outer(item[along.moved], item[along.moved]) / size**2
    return total


def regulator(along: Along, Q: Array, limit: float, step: float) -> Array:
    """Return the gains K of ``u = K z`` at all samples, (k + 1) x n, by Riccati's recursion from the rest at the end.

    Q weighs deviations, the torque counts over its limit [N m].
    """
    R, n = step / limit**2, along.b.shape[1]
    W = step * Q
    P = _stationary(along.A[-1], along.b[-1][:, None], W, np.array([[R]]))
    gains = np.empty((len(along.A), n))
    for k in range(len(gains) - 1, -1, -1):
        A, b = along.A[k], along.b[k]
        gains[k] = -(b @ P @ A) / (R + b @ P @ b)
        closed = A + np.outer(b, gains[k])
        P = W + closed.T @ P @ closed + R * np.outer(gains[k], gains[k])
        P = 0.5 * (P + P.T)
    return gains


def observer(
    modes: MachineModes,
    along: Along,
    states: Array,
    noise: Array | None,
    disturbance: float,
    integral_time: float | None,
    stiffness_uncertainty: float,
    step: float,
) -> Array:
    """Return the gains F from innovations to deviations and disturbance torque, (k + 1) x (n + 1) x p.

    Measured states, without noise, are taken as exact; the torque is then estimated from the innovation of the rigid
    rotation, which does not depend on the stiffness. For other measurements both are estimated by a Kalman filter.
    """
    count, n = along.b.shape
    slow = 0.0 if integral_time is None else 1.0 / integral_time
    if noise is None:
        gains = np.zeros((count, n + 1, along.C.shape[1]))
        gains[:, :n] = np.linalg.pinv(along.C)
        # the rigid rotation is the first mode: its rate follows the coordinates
        gains[:, n] = -np.expm1(-step * slow) * gains[:, n // 2] / along.b[:, n // 2, None]
        return gains
    half = n // 2
    omega = modes.omega[along.moved[: len(modes.omega)]]
    largest = np.abs(states[:, : len(modes.omega)]).max(axis=0)[along.moved[: len(modes.omega)]]
    wrong = stiffness_uncertainty * omega**2 * largest  # acceleration errors due to the stiffness error
    model = np.zeros((n + 1, n + 1))
    turning = np.arange(half + 1, n)
    model[turning, turning] = step * wrong[1:] ** 2 / omega[1:]
    drift = (disturbance * step * slow) ** 2
    R = np.diag(noise**2)

    def whole(k: int) -> tuple[Array, Array, Array]:
        A, C = np.eye(n + 1), np.column_stack([along.C[k], along.D[k]])
        A[:n, :n], A[:n, n] = along.A[k], along.b[k]
        Q = model + disturbance**2 * np.outer(np.append(along.b[k], 0.0), np.append(along.b[k], 0.0))
        Q[n, n] = drift
        return A, C, Q

    used = slice(0, n + 1 if slow else n)
    A, C, Q = (item[..., used] for item in whole(-1))
    P = np.zeros((n + 1, n + 1))
    P[used, used] = _stationary(A[used].T, C.T, Q[used], R, "measurements: they do not show all that the torque moves")
    gains = np.empty((count, n + 1, along.C.shape[1]))
    for k in range(count):
        A, C, Q = whole(k)
        gains[k] = np.linalg.solve(C @ P @ C.T + R, C @ P).T
        rest = np.eye(n + 1) - gains[k] @ C
        P = A @ (rest @ P @ rest.T + gains[k] @ R @ gains[k].T) @ A.T + Q
        if not slow:
            P[n], P[:, n] = 0.0, 0.0
        P = 0.5 * (P + P.T)
    return gains


def _stationary(A: Array, B: Array, Q: Array, R: Array, message: str = "") -> Array:
    try:
        return solve_discrete_are(A, B, Q, R)
    except (LinAlgError, ValueError) as error:
        raise ValueError(f"{message or 'tracking_weight'}: {error}") from None


def controller_along(
    along: Along, K: Array, F: Array, inputs: tuple[str, ...], output: str, step: float
) -> TimeVaryingController:
    """Return regulator and observer as one controller of deviations from the plan.

    Its states are the predicted deviations at the sample, the disturbance torque, and the last feedback torque, on which
    measured accelerations still depend.
    """
    count, n = along.b.shape
    size, p = n + 2, len(inputs)
    outputs = np.concatenate([along.C, along.D[..., None], along.D[..., None]], axis=2)
    correct = np.concatenate([F, np.zeros((count, 1, p))], axis=1)
    rest = np.eye(size) - correct @ outputs
    G = np.concatenate([K, -np.ones((count, 1)), np.zeros((count, 1))], axis=1)[:, None, :]
    moving, arriving = np.zeros((count, size, size)), np.zeros((count, size, 1))
    moving[:, :n, :n], moving[:, :n, n], moving[:, n, n] = along.A, along.b, 1.0
    arriving[:, :n, 0], arriving[:, n + 1, 0] = along.b, 1.0
    following = moving + arriving @ G
    return TimeVaryingController(
        A=following @ rest, B=following @ correct, C=G @ rest, D=G @ correct, input_labels=inputs, output_labels=(output,),
        dt=step, anti_windup_gain=arriving,
    )  # fmt: skip


def slowest_pole(
    modes: MachineModes, along: Along, controller: TimeVaryingController, linear: Lti, integral: bool
) -> float:
    """Return the time constant of the slowest pole of the sampled loop at the end [s], by the machine's linear model.

    That model is discretized by a matrix exponential: it shares only the measurement matrices with the computation of the
    gains.

    Parameters
    ----------
    modes : MachineModes
    along : Along
    controller : TimeVaryingController
        Its last matrices are used.
    linear : Lti
        The machine linearized about its terminal motion, in its own states; its first input is the torque.
    integral : bool
        True if a constant disturbance torque is estimated; otherwise that controller state is constant.

    Raises
    ------
    ValueError
        If the loop is not stable.
    """
    step, selected = controller.dt, along.moved
    into, back = modes.from_state[selected], modes.to_state[:, selected]
    machine = Lti(
        into @ linear.A @ back,
        into @ linear.B[:, :1],
        along.C[-1],
        along.D[-1][:, None],
        tuple(controller.output_labels),
    )
    sampled = sampled_plant(machine, [0], step, [0.0])
    loop = lower_lft(sampled, Lti(*(getattr(controller, letter)[-1] for letter in "ABCD"))).A
    # the controller's states begin with the deviations, followed by the estimated torque
    stays = [] if integral else [len(sampled.A) + len(machine.A)]
    loop = np.delete(np.delete(loop, stays, axis=0), stays, axis=1)
    largest = float(np.abs(np.linalg.eigvals(loop)).max())
    if not largest < 1.0:
        raise ValueError(
            "tracking_weight, noise, stiffness_uncertainty: the loop at the end has a pole of modulus"
            f" {largest:.6g}; expected weights with which it is stable"
        )
    return -step / float(np.log(largest))
