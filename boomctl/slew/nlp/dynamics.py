"""Equations of motion of a slew as CasADi functions, and one implicit step of them by collocation.

With d points: Gauss-Legendre, of order 2 d, or Radau IIA, of order 2 d - 1 and stiffly accurate. The torque is a straight
line on a step. The explicit steps, an independent scheme, are in `stepping`.
"""

from typing import TYPE_CHECKING

import numpy as np

from boomctl.arrays import Array
from boomctl.slew.plant import SlewPlant

if TYPE_CHECKING:
    import casadi


def rates(plant: SlewPlant) -> "casadi.Function":
    """``(z, u) -> z'`` of a plant, in SX."""
    import casadi as ca

    z, u = ca.SX.sym("z", plant.n), ca.SX.sym("u")
    if plant.machine is None:
        return ca.Function("rates", [z, u], [times(plant.A, z) + ca.SX(ca.DM(plant.B)) * u])
    state = times(plant.to_state, z)
    turned = plant.machine.casadi_function()(state, u)[0]
    return ca.Function("rates", [z, u], [times(plant.from_state, turned)])


def hub_jerk(plant: SlewPlant) -> "casadi.Function":
    """``(z, u, slope) -> rad/s^3``: how fast the hub's acceleration changes while the torque u changes by its slope."""
    import casadi as ca

    z, u, slope = ca.SX.sym("z", plant.n), ca.SX.sym("u"), ca.SX.sym("slope")
    turned = rates(plant)(z, u)
    acceleration = ca.dot(ca.DM(plant.rows["speed"]), turned)
    jerk = ca.jtimes(acceleration, z, turned) + ca.jacobian(acceleration, u) * slope
    return ca.Function("jerk", [z, u, slope], [jerk])


def collocation_coefficients(method: str, points: int) -> tuple[Array, Array, Array]:
    """Nodes c, matrix a and weights b on [0, 1] of the Gauss-Legendre ("collocation") or Radau IIA ("radau") scheme."""
    import casadi as ca

    c = np.array(ca.collocation_points(points, "radau" if method == "radau" else "legendre"))
    powers = np.arange(1, points + 1)
    inverse = np.linalg.inv(c[:, None] ** (powers - 1))
    return c, (c[:, None] ** powers / powers) @ inverse, (1.0 / powers) @ inverse


def collocation_defects(plant: SlewPlant, points: int, method: str = "collocation") -> "casadi.Function":
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


def times(matrix: Array, vector: "casadi.SX") -> "casadi.SX":
    """Product with a constant matrix whose zeros cost nothing."""
    import casadi as ca

    return ca.mtimes(ca.sparsify(ca.DM(np.where(np.abs(matrix) > 1e-15 * np.abs(matrix).max(), matrix, 0.0))), vector)
