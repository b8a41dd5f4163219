"""Equations of motion of a slew as CasADi functions, and one explicit step of them.

A step takes the linear part by its exact flow, the rest by a Runge-Kutta scheme. Lawson's (1967) takes the rest into the
frame that moves with the linear flow; it costs least where a step follows every mode. Krogstad's (2005) integrates a
parabola through the rest's values against the flow; it serves where modes that the torque does not move, the axial ones,
turn many times in a step. Both are of fourth order. The implicit steps, by collocation, are in `nlp.transcription`.
"""

import casadi as ca
import numpy as np

from boomctl.arrays import Array
from boomctl.simulation.machine.exponential_step import krogstad, pushing, stumpff
from boomctl.slew.plant import SlewPlant

_TAYLOR = 14  # terms of a linear motion: 1 / 15! = 8e-13 is left out where |A h| is 1, below what a replay resolves
_ZERO = 1e-15  # entry of a constant matrix, over its largest, that is a rounded zero


def times(matrix: Array, vector: ca.SX) -> ca.SX:
    """Product with a constant matrix whose zeros cost nothing."""
    return ca.mtimes(ca.sparsify(ca.DM(np.where(np.abs(matrix) > _ZERO * np.abs(matrix).max(), matrix, 0.0))), vector)


def rates(plant: SlewPlant) -> ca.Function:
    """``(z, u) -> z'`` of a plant, in SX."""
    z, u = ca.SX.sym("z", plant.n), ca.SX.sym("u")
    if plant.machine is None:
        return ca.Function("rates", [z, u], [times(plant.A, z) + ca.SX(ca.DM(plant.B)) * u])
    turned = plant.machine.casadi_function()(times(plant.to_state, z), u)[0]
    return ca.Function("rates", [z, u], [times(plant.from_state, turned)])


def hub_jerk(plant: SlewPlant) -> ca.Function:
    """``(z, u, slope) -> rad/s^3``: how fast the hub's acceleration changes while the torque u changes by its slope."""
    z, u, slope = ca.SX.sym("z", plant.n), ca.SX.sym("u"), ca.SX.sym("slope")
    turned = rates(plant)(z, u)
    acceleration = ca.dot(ca.DM(plant.rows["speed"]), turned)
    jerk = ca.jtimes(acceleration, z, turned) + ca.jacobian(acceleration, u) * slope
    return ca.Function("jerk", [z, u, slope], [jerk])


def explicit_step(plant: SlewPlant, substeps: int) -> ca.Function:
    """``(z, u0, u1, h) -> z`` after a step h [s] on which the torque goes straight from u0 to u1, in `substeps` parts."""
    z, u0, u1, h = ca.SX.sym("z", plant.n), ca.SX.sym("u0"), ca.SX.sym("u1"), ca.SX.sym("h")
    slope, part, now = (u1 - u0) / h, h / substeps, z
    scheme = _lawson if plant.controllable.all() else _krogstad
    nonlinear = None if plant.linear else _nonlinear(plant)
    for k in range(substeps):
        u = u0 + slope * (k * part)
        now = _flow(plant, now, u, slope, part) if nonlinear is None else scheme(plant, nonlinear, now, u, slope, part)
    return ca.Function("step", [z, u0, u1, h], [now])


def _nonlinear(plant: SlewPlant) -> ca.Function:
    """``(z, u)`` -> what the undamped linear vibration under the torque leaves out of the accelerations."""
    z, u = ca.SX.sym("z", plant.n), ca.SX.sym("u")
    half, frequencies = plant.n // 2, plant.frequencies
    assert frequencies is not None
    oscillation = -ca.DM(frequencies**2) * z[:half] + ca.SX(ca.DM(plant.B[half:])) * u
    return ca.Function("nonlinear", [z, u], [rates(plant)(z, u)[half:] - oscillation])


def _lawson(plant: SlewPlant, nonlinear: ca.Function, z: ca.SX, u: ca.SX, slope: ca.SX, h: ca.SX) -> ca.SX:
    """One step; carried along the linear flow the rest is integrated as if it were all."""

    def rest(at: ca.SX, torque: ca.SX) -> ca.SX:
        return ca.vertcat(ca.SX.zeros(plant.n // 2), nonlinear(at, torque))

    def carried(vector: ca.SX) -> ca.SX:
        return _flow(plant, vector, None, None, 0.5 * h)

    middle = u + 0.5 * h * slope
    k1 = rest(z, u)
    drifted = _flow(plant, z, u, slope, 0.5 * h)
    pushed = carried(k1)
    k2 = rest(drifted + 0.5 * h * pushed, middle)
    k3 = rest(drifted + 0.5 * h * k2, middle)
    end = _flow(plant, drifted, middle, slope, 0.5 * h)
    k4 = rest(end + h * carried(k3), u + h * slope)
    return end + h / 6.0 * (carried(pushed + 2.0 * (k2 + k3)) + k4)


def _krogstad(plant: SlewPlant, nonlinear: ca.Function, z: ca.SX, u: ca.SX, slope: ca.SX, h: ca.SX) -> ca.SX:
    """One step; the oscillators' motion under a rest that is a power of time is exact."""
    assert plant.frequencies is not None
    torques = u, u + 0.5 * h * slope, u + h * slope
    half, whole = (
        (_flow(plant, z, u, slope, part), pushing(stumpff((ca.DM(plant.frequencies) * part) ** 2), part))
        for part in (0.5 * h, h)
    )
    return krogstad(lambda at, stage: nonlinear(at, torques[stage]), z, half, whole)


def _flow(plant: SlewPlant, z: ca.SX, u: ca.SX | None, slope: ca.SX | None, h: ca.SX) -> ca.SX:
    """Linear motion for a time h under ``u + slope t``, or none: modes in closed form, other plants by Taylor's series."""
    if plant.frequencies is None:
        b, term, total = ca.SX(ca.DM(plant.B)), z, z
        for k in range(1, _TAYLOR + 1):
            term = times(plant.A, term)
            if u is not None and slope is not None and k <= 2:
                term += b * (u if k == 1 else slope * h)
            term = term * (h / k)
            total = total + term
        return total
    half = plant.n // 2
    positions, speeds = [], []
    for k, w in enumerate(plant.frequencies):
        p, v, b = z[k], z[half + k], float(plant.B[half + k])
        if w == 0.0:
            p, v = p + h * v, v
            held, ramp = (0.5 * h**2, h), (h**3 / 6.0, 0.5 * h**2)
        else:
            c, s = ca.cos(w * h), ca.sin(w * h)
            p, v = p * c + v * (s / w), v * c - p * (w * s)
            held, ramp = ((1.0 - c) / w**2, s / w), ((h - s / w) / w**2, (1.0 - c) / w**2)
        if u is not None and slope is not None and b != 0.0:
            p, v = p + b * (held[0] * u + ramp[0] * slope), v + b * (held[1] * u + ramp[1] * slope)
        positions.append(p)
        speeds.append(v)
    return ca.vertcat(*positions, *speeds)
