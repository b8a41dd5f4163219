"""Equations of motion of a slew as CasADi functions, and one step of them by two independent schemes.

Shooting: the linear part by its exact flow, the rest by the classical Runge-Kutta scheme in the frame that moves with the
linear flow (Lawson 1967). Collocation with d points: Gauss-Legendre, of order 2 d, or Radau IIA, of order 2 d - 1
and stiffly accurate. The torque is a straight line on a step.
"""

from typing import TYPE_CHECKING

import numpy as np

from boomctl.arrays import Array
from boomctl.slew.plant import Plant

if TYPE_CHECKING:
    import casadi

__all__ = ["collocation_coefficients", "collocation_defects", "rates", "shooting_step"]

_SERIES = 14


def rates(plant: Plant) -> "casadi.Function":
    """``(z, u) -> z'`` of a plant, in SX."""
    import casadi as ca

    z, u = ca.SX.sym("z", plant.n), ca.SX.sym("u")
    if plant.machine is None:
        return ca.Function("rates", [z, u], [_times(plant.A, z) + ca.SX(ca.DM(plant.B)) * u])
    state = _times(plant.to_state, z)
    turned = plant.machine.casadi_function()(state, u)[0]
    return ca.Function("rates", [z, u], [_times(plant.from_state, turned)])


def excess(plant: Plant, share: float = 1.0) -> "casadi.Function | None":
    """``(z, u)`` -> what the undamped linear vibration under the torque leaves out of z'; None of a linear plant."""
    import casadi as ca

    if plant.linear:
        return None
    z, u = ca.SX.sym("z", plant.n), ca.SX.sym("u")
    half, frequencies = plant.n // 2, plant.frequencies
    assert frequencies is not None
    oscillation = ca.vertcat(z[half:], -ca.DM(frequencies**2) * z[:half])
    beyond = rates(plant)(z, u) - oscillation - ca.SX(ca.DM(plant.B)) * u
    return ca.Function("excess", [z, u], [ca.vertcat(ca.SX.zeros(half), share * beyond[half:])])


def shooting_step(plant: Plant, substeps: int, share: float = 1.0) -> "casadi.Function":
    """``(z, u0, u1, h) -> z`` after a step h [s] on which the torque goes straight from u0 to u1, in `substeps` parts.

    With a `share` below one only that share of what is not linear vibration acts: a way from the linear plant to the whole.
    """
    import casadi as ca

    z, u0, u1, h = ca.SX.sym("z", plant.n), ca.SX.sym("u0"), ca.SX.sym("u1"), ca.SX.sym("h")
    beyond = None if share == 0.0 else excess(plant, share)
    slope, part, now = (u1 - u0) / h, h / substeps, z
    for k in range(substeps):
        u = u0 + slope * (k * part)
        now = _lawson(plant, beyond, now, u, slope, part) if beyond is not None else _flow(plant, now, u, slope, part)
    return ca.Function("step", [z, u0, u1, h], [now])


def _lawson(
    plant: Plant, beyond: "casadi.Function", z: "casadi.SX", u: "casadi.SX", slope: "casadi.SX", h: "casadi.SX"
) -> "casadi.SX":
    """One step; carried along the linear flow the rest is integrated as if it were all."""

    def carried(vector: "casadi.SX") -> "casadi.SX":
        return _flow(plant, vector, None, None, 0.5 * h)

    middle = u + 0.5 * h * slope
    k1 = beyond(z, u)
    drifted = _flow(plant, z, u, slope, 0.5 * h)
    pushed = carried(k1)
    k2 = beyond(drifted + 0.5 * h * pushed, middle)
    k3 = beyond(drifted + 0.5 * h * k2, middle)
    end = _flow(plant, drifted, middle, slope, 0.5 * h)
    k4 = beyond(end + h * carried(k3), u + h * slope)
    return end + h / 6.0 * (carried(pushed + 2.0 * (k2 + k3)) + k4)


def _flow(
    plant: Plant, z: "casadi.SX", u: "casadi.SX | None", slope: "casadi.SX | None", h: "casadi.SX"
) -> "casadi.SX":
    """Linear motion for a time h under ``u + slope t``, or none."""
    if plant.frequencies is None:
        return _series(plant, z, u, slope, h)
    return _modal_flow(plant, z, u, slope, h)


def _modal_flow(
    plant: Plant, z: "casadi.SX", u: "casadi.SX | None", slope: "casadi.SX | None", h: "casadi.SX"
) -> "casadi.SX":
    import casadi as ca

    assert plant.frequencies is not None
    half = plant.n // 2
    places, speeds = [], []
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
        places.append(p)
        speeds.append(v)
    return ca.vertcat(*places, *speeds)


def _series(
    plant: Plant, z: "casadi.SX", u: "casadi.SX | None", slope: "casadi.SX | None", h: "casadi.SX"
) -> "casadi.SX":
    """Taylor series of the linear motion; for steps on which A h stays about 1 it is exact to rounding."""
    import casadi as ca

    b = ca.SX(ca.DM(plant.B))
    term, total = z, z
    for k in range(1, _SERIES + 1):
        term = _times(plant.A, term)
        if u is not None and slope is not None and k <= 2:
            term += b * (u if k == 1 else slope * h)
        term = term * (h / k)
        total = total + term
    return total


def collocation_coefficients(method: str, points: int) -> tuple[Array, Array, Array]:
    """Nodes c, matrix a and weights b on [0, 1] of the Gauss-Legendre ("collocation") or Radau IIA ("radau") scheme."""
    import casadi as ca

    c = np.array(ca.collocation_points(points, "radau" if method == "radau" else "legendre"))
    powers = np.arange(1, points + 1)
    inverse = np.linalg.inv(c[:, None] ** (powers - 1))
    return c, (c[:, None] ** powers / powers) @ inverse, (1.0 / powers) @ inverse


def collocation_defects(plant: Plant, points: int, method: str = "collocation") -> "casadi.Function":
    """``(z, k, u0, u1, h, z1) -> defects`` of a collocation scheme; k (n x points) are the rates at its points."""
    import casadi as ca

    c, a, b = collocation_coefficients(method, points)
    z, z1 = ca.SX.sym("z", plant.n), ca.SX.sym("z1", plant.n)
    k = ca.SX.sym("k", plant.n, points)
    u0, u1, h = ca.SX.sym("u0"), ca.SX.sym("u1"), ca.SX.sym("h")
    f, defects = rates(plant), []
    for i in range(points):
        place = z + h * ca.mtimes(k, ca.DM(a[i]))
        defects.append(f(place, u0 + c[i] * (u1 - u0)) - k[:, i])
    defects.append(z + h * ca.mtimes(k, ca.DM(b)) - z1)
    return ca.Function("defects", [z, ca.vec(k), u0, u1, h, z1], [ca.vertcat(*defects)])


def _times(matrix: Array, vector: "casadi.SX") -> "casadi.SX":
    """Product with a constant matrix whose zeros cost nothing."""
    import casadi as ca

    return ca.mtimes(ca.sparsify(ca.DM(np.where(np.abs(matrix) > 1e-15 * np.abs(matrix).max(), matrix, 0.0))), vector)
