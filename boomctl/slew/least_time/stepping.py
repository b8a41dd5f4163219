"""One explicit step of a slew's equations of motion: the linear part by its exact flow, the rest by a Runge-Kutta scheme.

Lawson's scheme (1967) takes the rest into the frame that moves with the linear flow; it costs least where a step follows
every mode. Krogstad's (2005) integrates a parabola through the rest's values against the flow; it serves where modes that
the torque does not move, the axial ones, turn many times in a step. Both are of fourth order.
"""

import math
from typing import TYPE_CHECKING

from boomctl.slew.nlp.dynamics import rates, times
from boomctl.slew.plant import SlewPlant

if TYPE_CHECKING:
    import casadi

_SERIES = 14
_TERMS = 9


def shooting_step(plant: SlewPlant, substeps: int) -> "casadi.Function":
    """``(z, u0, u1, h) -> z`` after a step h [s] on which the torque goes straight from u0 to u1, in `substeps` parts."""
    import casadi as ca

    z, u0, u1, h = ca.SX.sym("z", plant.n), ca.SX.sym("u0"), ca.SX.sym("u1"), ca.SX.sym("h")
    slope, part, now = (u1 - u0) / h, h / substeps, z
    beyond = None if plant.linear else _beyond(plant)
    scheme = _lawson if plant.controllable.all() else _krogstad
    for k in range(substeps):
        u = u0 + slope * (k * part)
        now = _flow(plant, now, u, slope, part) if beyond is None else scheme(plant, beyond, now, u, slope, part)
    return ca.Function("step", [z, u0, u1, h], [now])


def _beyond(plant: SlewPlant) -> "casadi.Function":
    """``(z, u)`` -> what the undamped linear vibration under the torque leaves out of the accelerations."""
    import casadi as ca

    z, u = ca.SX.sym("z", plant.n), ca.SX.sym("u")
    half, frequencies = plant.n // 2, plant.frequencies
    assert frequencies is not None
    oscillation = -ca.DM(frequencies**2) * z[:half] + ca.SX(ca.DM(plant.B[half:])) * u
    return ca.Function("beyond", [z, u], [rates(plant)(z, u)[half:] - oscillation])


def _lawson(
    plant: SlewPlant, beyond: "casadi.Function", z: "casadi.SX", u: "casadi.SX", slope: "casadi.SX", h: "casadi.SX"
) -> "casadi.SX":
    """One step; carried along the linear flow the rest is integrated as if it were all."""
    import casadi as ca

    def rest(place: "casadi.SX", torque: "casadi.SX") -> "casadi.SX":
        return ca.vertcat(ca.SX.zeros(plant.n // 2), beyond(place, torque))

    def carried(vector: "casadi.SX") -> "casadi.SX":
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


def _krogstad(
    plant: SlewPlant, beyond: "casadi.Function", z: "casadi.SX", u: "casadi.SX", slope: "casadi.SX", h: "casadi.SX"
) -> "casadi.SX":
    """One step; the rest's answers to powers of time are exact."""
    middle, last = u + 0.5 * h * slope, u + h * slope
    half, whole = _Answers(plant, 0.5 * h), _Answers(plant, h)
    n1 = beyond(z, u)
    place = _flow(plant, z, u, slope, 0.5 * h) + half.held(n1)
    n2 = beyond(place, middle)
    n3 = beyond(place + 2.0 * half.ramp(n2 - n1), middle)
    end = _flow(plant, z, u, slope, h) + whole.held(n1)
    n4 = beyond(end + 2.0 * whole.ramp(n3 - n1), last)
    both = n2 + n3
    return end + whole.ramp(2.0 * both - 3.0 * n1 - n4) + whole.square(2.0 * (n1 + n4 - both))


class _Answers:
    """Motion from rest after a time h under accelerations ``g (t/h)^k``, k = 0, 1, 2, of undamped oscillators."""

    def __init__(self, plant: SlewPlant, h: "casadi.SX") -> None:
        import casadi as ca

        assert plant.frequencies is not None
        each = [stumpff((w * h) ** 2) if w > 0.0 else [ca.SX(1.0 / math.factorial(k)) for k in (1, 2, 3, 4)]
                for w in plant.frequencies]  # fmt: skip
        self._h = h
        self._c1, self._c2, self._c3, self._c4 = (ca.vertcat(*row) for row in zip(*each, strict=True))

    def held(self, g: "casadi.SX") -> "casadi.SX":
        import casadi as ca

        return ca.vertcat(self._h**2 * self._c2 * g, self._h * self._c1 * g)

    def ramp(self, g: "casadi.SX") -> "casadi.SX":
        import casadi as ca

        return ca.vertcat(self._h**2 * self._c3 * g, self._h * self._c2 * g)

    def square(self, g: "casadi.SX") -> "casadi.SX":
        import casadi as ca

        return ca.vertcat(2.0 * self._h**2 * self._c4 * g, 2.0 * self._h * self._c3 * g)


def stumpff(y: "casadi.SX") -> list["casadi.SX"]:
    """Stumpff's functions ``c_k(y) = sum_j (-y)^j / (2 j + k)!``, k = 1 to 4, y > 0; closed forms lose digits near 0."""
    import casadi as ca

    near = y < 1.0
    x = ca.sqrt(ca.if_else(near, 1.0, y))
    c1 = ca.sin(x) / x
    c2 = 2.0 * (ca.sin(0.5 * x) / x) ** 2
    closed = [c1, c2, (1.0 - c1) / x**2, (0.5 - c2) / x**2]
    return [ca.if_else(near, _series_of(y, k + 1), closed[k]) for k in range(4)]


def _series_of(y: "casadi.SX", k: int) -> "casadi.SX":
    total = 0.0 * y
    for j in range(_TERMS - 1, -1, -1):
        total = 1.0 / math.factorial(2 * j + k) - y * total
    return total


def _flow(
    plant: SlewPlant, z: "casadi.SX", u: "casadi.SX | None", slope: "casadi.SX | None", h: "casadi.SX"
) -> "casadi.SX":
    """Linear motion for a time h under ``u + slope t``, or none."""
    if plant.frequencies is None:
        return _series(plant, z, u, slope, h)
    return _modal_flow(plant, z, u, slope, h)


def _modal_flow(
    plant: SlewPlant, z: "casadi.SX", u: "casadi.SX | None", slope: "casadi.SX | None", h: "casadi.SX"
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
    plant: SlewPlant, z: "casadi.SX", u: "casadi.SX | None", slope: "casadi.SX | None", h: "casadi.SX"
) -> "casadi.SX":
    """Taylor series of the linear motion; for steps on which A h stays about 1 it is exact to rounding."""
    import casadi as ca

    b = ca.SX(ca.DM(plant.B))
    term, total = z, z
    for k in range(1, _SERIES + 1):
        term = times(plant.A, term)
        if u is not None and slope is not None and k <= 2:
            term += b * (u if k == 1 else slope * h)
        term = term * (h / k)
        total = total + term
    return total
