"""A hub-beam under forces on hub and tip, in the modes of its linear part with the hub free, as CasADi functions.

With mass-normalized modes ``(theta, q) = V z`` the equations are ``z'' + Omega^2 z = r(z, z', u)``; the right-hand side
contains all terms except the linear undamped vibration about rest.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from boomctl.arrays import Array, blocks
from boomctl.lti.machine_modes import MachineModes
from boomctl.lti.rounding import COMPUTED
from boomctl.rotating_beam.modal.energy import Lagrangian, accelerations
from boomctl.rotating_beam.modal.first_order import FirstOrderEquations
from boomctl.rotating_beam.modal.shapes import axial_modes, transverse_modes
from boomctl.rotating_beam.parameters import HubBeamParameters
from boomctl.rotating_beam.sensors import LOOP_INPUTS, LOOP_OUTPUTS, LOOP_UNITS, QUANTITIES, BeamSensor

if TYPE_CHECKING:
    import casadi

    from boomctl.lti.system import Lti


class Point(NamedTuple):
    """A point of the deformed beam, of CasADi coordinates q.

    Attributes
    ----------
    along, across : casadi.SX
        Position in the frame of the hub, from its axis, m.
    slope : casadi.SX
        Angle of the beam, rad.
    curvature : casadi.SX
        1/m.
    stretch : casadi.SX
        Strain of the axis.
    """

    along: casadi.SX
    across: casadi.SX
    slope: casadi.SX
    curvature: casadi.SX
    stretch: casadi.SX


PointMap = Callable[["casadi.SX", float], Point]
"""From coordinates of the beam and a distance from the clamp [m] to the point there."""


class Moved(NamedTuple):
    """Accelerations under forces.

    Attributes
    ----------
    hub : casadi.SX
        Hub acceleration, rad/s^2.
    beam : casadi.SX
        Of the beam's coordinates.
    rest : casadi.SX
        Modal accelerations without the linear vibration.
    margin : casadi.SX
        Positive where the mass matrix is positive definite.
    """

    hub: casadi.SX
    beam: casadi.SX
    rest: casadi.SX
    margin: casadi.SX


Law = Callable[["RestModes", "casadi.SX", "casadi.SX", "casadi.SX", "casadi.SX", Point], Moved]
"""From modes at rest, modal coordinates and rates, a torque [N m] and a force [N] across the free end, and that end to the
accelerations."""


@dataclass(frozen=True, eq=False)
class RestModes:
    """Modes of hub and beam at rest: ``theta = r / sqrt(inertia) + lean x``, ``q = shapes x``, ``z = (r, x)``.

    ``decay`` is the largest eigenvalue of the modal damping matrix, 1/s.
    """

    inertia: float
    lean: Array
    shapes: Array
    squares: Array
    decay: float

    @property
    def V(self) -> Array:
        """Modes over the coordinates, hub angle first."""
        n = self.lean.size
        return blocks([[np.full((1, 1), self.inertia**-0.5), self.lean[None]], [np.zeros((n, 1)), self.shapes]])


def rest_modes(mass: Array, damping: Array, stiffness: Array) -> RestModes:
    """Return the modes of small motion about rest, the hub angle the first coordinate.

    Raises
    ------
    ValueError
        If the mass matrix of the straight beam is not positive definite.
    """
    from scipy.linalg import LinAlgError, eigh

    inertia, coupling = float(mass[0, 0]), mass[0, 1:]
    try:
        squares, shapes = eigh(stiffness[1:, 1:], mass[1:, 1:] - np.outer(coupling, coupling) / inertia)
    except LinAlgError:
        raise ValueError(
            "plant: the mass matrix of the straight beam is not positive definite; expected a hub inertia above zero "
            "or fewer modes"
        ) from None
    decay = float(np.linalg.eigvalsh(shapes.T @ damping[1:, 1:] @ shapes)[-1])
    return RestModes(inertia, -(coupling @ shapes) / inertia, shapes, squares, max(decay, 0.0))


def forced_modes(
    small: tuple[Array, Array, Array, Array],
    law: Law,
    point_at: PointMap,
    parameters: HubBeamParameters,
    states: tuple[str, ...],
    sensors: Sequence[BeamSensor],
) -> MachineModes:
    """Return a beam in its modes at rest.

    Parameters
    ----------
    small : tuple of ndarray
        Mass, damping, stiffness of small motion about rest, as a beam's ``_small_motion(0.0)`` returns them.
    law : Law
    point_at : PointMap
    parameters : HubBeamParameters
    states : tuple of str
        Names.
    sensors : sequence of BeamSensor
        Further outputs.
    """
    import casadi as ca

    modes = rest_modes(*small[:3])
    p, size = parameters, modes.lean.size + 1
    state, u = ca.SX.sym("z", 2 * size), ca.SX.sym("u", len(LOOP_INPUTS))
    z, rate = state[:size], state[size:]
    q, q_rate = _times(modes.shapes, z[1:]), _times(modes.shapes, rate[1:])
    coordinates = ca.SX.sym("q", size - 1)
    moved = law(modes, z, rate, u[0] + u[1], u[2], _at(point_at(coordinates, p.length), coordinates, q))
    angle, speed = _row(modes.V[0], z), _row(modes.V[0], rate)

    def acceleration(x: float) -> casadi.SX:
        """Absolute, across the beam: of the point ``along + i across`` in the frame that turns."""
        here = point_at(coordinates, x)
        both, rates, second = (
            ca.vertcat(here.along, here.across),
            ca.SX.sym("rates", size - 1),
            ca.SX.sym("second", size - 1),
        )
        velocity = ca.jtimes(both, coordinates, rates)
        bent = ca.jtimes(velocity, coordinates, rates) + ca.jtimes(both, coordinates, second)
        result = moved.hub * here.along + bent[1] + 2.0 * speed * velocity[0] - speed**2 * here.across
        return ca.substitute(result, ca.vertcat(coordinates, rates, second), ca.vertcat(q, q_rate, moved.beam))

    def reading(sensor: BeamSensor) -> casadi.SX:
        if sensor.quantity == "acceleration":
            return acceleration(sensor.position)
        here = _at(point_at(coordinates, sensor.position), coordinates, q)
        if sensor.quantity == "strain":
            return here.stretch - (sensor.height or 0.0) * here.curvature
        if sensor.quantity == "moment":
            return p.bending_stiffness * here.curvature
        return here.across if sensor.quantity == "displacement" else here.slope

    tip, root = (BeamSensor("tip_displacement", "displacement", p.length), BeamSensor("root_moment", "moment", 0.0))
    standard = (angle, speed, reading(tip), reading(root), acceleration(p.length))
    outputs = ca.vertcat(*standard, *(reading(sensor) for sensor in sensors))
    row = np.array(
        ca.DM(ca.substitute(ca.jacobian(point_at(coordinates, p.length).across, coordinates), coordinates, 0.0))
    )
    reach, V, M = p.hub_radius + p.length, modes.V, np.linalg.inv(modes.V)
    on_tip = np.concatenate([[reach], row.ravel()])
    return MachineModes(
        input_labels=LOOP_INPUTS,
        output_labels=(*LOOP_OUTPUTS, *(sensor.name for sensor in sensors)),
        state_labels=states,
        omega=np.sqrt(np.concatenate([[0.0], modes.squares])),
        decay=modes.decay,
        push=np.stack([V[0], V[0], on_tip @ V], axis=1),
        to_state=np.kron(np.eye(2), V),
        from_state=np.kron(np.eye(2), M),
        rest=ca.Function("rest", [state, u], [moved.rest]),
        read=ca.Function("read", [state, u], [outputs, moved.margin]),
        displacements=ca.Function("displacements", [state], [ca.vertcat(reach * angle, outputs[2])]),
        units={**LOOP_UNITS, **{sensor.name: QUANTITIES[sensor.quantity] for sensor in sensors}},
    )


def linearized(modes: MachineModes, state: Array) -> Lti:
    """Return the linear model about a state of steady rotation, without forces."""
    import casadi as ca

    from boomctl.lti.system import Lti  # brings scipy.linalg

    m = modes.omega.size
    z, u = ca.SX.sym("z", 2 * m), ca.SX.sym("u", len(modes.input_labels))
    moved = ca.vertcat(z[m:], modes.rest(z, u) - ca.DM(modes.omega**2) * z[:m])
    both = ca.vertcat(moved, modes.read(z, u)[0])
    jacobians = ca.Function("jacobians", [z, u], [ca.densify(ca.jacobian(both, z)), ca.densify(ca.jacobian(both, u))])
    by_state, by_input = (
        np.array(item) for item in jacobians(modes.from_state @ state, np.zeros(len(modes.input_labels)))
    )
    T, S = modes.to_state, modes.from_state
    A, B, C, D = T @ by_state[: 2 * m] @ S, T @ by_input[: 2 * m], by_state[2 * m :] @ S, by_input[2 * m :]
    return Lti(
        A, B, C, D, input_labels=modes.input_labels, output_labels=modes.output_labels, state_labels=modes.state_labels
    )


def shape_points(parameters: HubBeamParameters, count: int, *, axial: bool, shortening: bool) -> PointMap:
    """Return the point map of a beam of assumed modes, over axial coordinates, if any, then transverse coordinates."""
    import casadi as ca

    p = parameters
    along, across = axial_modes(count, p.length), transverse_modes(count, p.length)

    def point(q: casadi.SX, x: float) -> Point:
        q2 = q[-count:]
        position, stretch = ca.SX(p.hub_radius + x), ca.SX(0.0)
        if shortening:
            position -= 0.5 * ca.bilin(ca.DM(across.shortening(np.array([x]))[0]), q2, q2)
        if axial:
            position += _row(along(x), q[:count])
            stretch = _row(along(x, 1), q[:count])
        deflection, slope, curvature = (_row(across(x, k), q2) for k in range(3))
        return Point(position, deflection, slope, curvature, stretch)

    return point


def first_order_law(equations: FirstOrderEquations) -> Law:
    """Return TLAM, SFOAM or FOAM in modal coordinates, the accelerations in closed form.

    With ``j = 2 V x + x^T N x`` and ``c = -B x`` in modes, h the hub's right side and g the beam's, hub acceleration a and
    ``s = c x''`` obey two linear equations, as in `motion.free_modes`, with forces on the tip.
    """

    def law(modes: RestModes, z: casadi.SX, rate: casadi.SX, torque: casadi.SX, force: casadi.SX, tip: Point) -> Moved:
        import casadi as ca

        P, lean, e = modes.shapes, modes.lean, equations
        N, V = P.T @ e.N @ P, e.V @ P
        x, v = z[1:], rate[1:]
        w = _row(modes.V[0], rate)
        square, bent = w * w, _times(N, x)
        back = ca.DM(modes.squares) * x
        # the beam's right-hand side without the linear vibration
        g = square * bent + force * ca.DM(P.T @ e.tip.transverse)
        hub = torque + force * tip.along
        if np.any(e.C):
            g -= _times(P.T @ e.C @ P, v)
        more = ca.dot(bent, x)
        if e.keeps_inertia_torque:
            hub -= 2.0 * w * ca.dot(bent, v)
        mobility = 1.0 / modes.inertia + float(lean @ lean)
        if not e.has_axial:
            margin = 1.0 + mobility * more
            turning = (mobility * hub + _row(lean, g - back)) / margin
            left = hub - more * turning
        else:
            B = P.T @ e.B @ P
            more += 2.0 * _row(V, x)
            g += 2.0 * w * _times(B, v) + square * ca.DM(V)
            if e.keeps_inertia_torque:
                hub -= 2.0 * w * _row(V, v)
            c = -_times(B, x)
            linear, crossed = g - back, _row(lean, c)
            right = mobility * hub + _row(lean, linear), crossed * hub + ca.dot(c, linear)
            first, last, low = 1.0 + crossed + mobility * more, 1.0 + crossed, crossed * more + ca.dot(c, c)
            margin = first * last - mobility * low
            turning = (right[0] * last - mobility * right[1]) / margin
            g -= c * turning
            left = hub - more * turning - (first * right[1] - low * right[0]) / margin
        g += ca.DM(lean) * left
        rest = ca.vertcat(left / np.sqrt(modes.inertia), g)
        return Moved(turning, _times(P, g - back), rest, margin)

    return law


def lagrangian_law(lagrangian: Lagrangian, point_at: PointMap, length: float) -> Law:
    """Return any model in modal coordinates, its accelerations derived from its energies."""

    def law(modes: RestModes, z: casadi.SX, rate: casadi.SX, torque: casadi.SX, force: casadi.SX, tip: Point) -> Moved:
        import casadi as ca

        size = modes.lean.size + 1
        y, y_rate, forces, result, margin = accelerations(lagrangian)
        across = point_at(y[1:], length).across
        on_beam = force * ca.gradient(across, y[1:])
        acting = ca.substitute(ca.vertcat(torque + force * tip.along, on_beam), y, _times(modes.V, z))
        symbols, wanted = ca.vertcat(y, y_rate, forces), ca.vertcat(_times(modes.V, z), _times(modes.V, rate), acting)
        second, margin = ca.substitute([result, margin], [symbols], [wanted])
        rest = _times(np.linalg.inv(modes.V), second) + ca.vertcat(0.0, ca.DM(modes.squares) * z[1:])
        return Moved(second[0], second[1:size], rest, margin)

    return law


def _at(point: Point, coordinates: casadi.SX, q: casadi.SX) -> Point:
    """Return a point at other coordinates."""
    import casadi as ca

    return Point(*(ca.substitute(item, coordinates, q) for item in point))


def _times(matrix: Array, vector: casadi.SX) -> casadi.SX:
    """Product with a constant matrix whose zeros cost nothing."""
    import casadi as ca

    largest = np.abs(matrix).max(initial=0.0)
    return ca.mtimes(ca.sparsify(ca.DM(np.where(np.abs(matrix) > COMPUTED * largest, matrix, 0.0))), vector)


def _row(row: Array, vector: casadi.SX) -> casadi.SX:
    """Product of a constant row."""
    return _times(row[None], vector)
