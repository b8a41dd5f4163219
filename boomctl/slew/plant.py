"""Plants of the planning: a linear system, or a hub-beam in modal coordinates."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING, TypeGuard

import numpy as np

from boomctl.arrays import Array, balance, blocks
from boomctl.lti import system as lti
from boomctl.lti.hidden_modes import unmoved
from boomctl.lti.rounding import ALIKE, SUMMED

if TYPE_CHECKING:
    from boomctl.rotating_beam.assumed_modes import AssumedModesBeam

_SPLIT = 1e-6  # fraction of |A| below which an eigenvalue is zero: rounding splits a double zero by about 1e-8
_BEAMS = 32  # cached plants of beams: slews with other angles and limits reuse them


def is_machine(h: object) -> TypeGuard[AssumedModesBeam]:
    """Return True for a hub-beam with equations of motion for CasADi; evaluates no properties."""
    return hasattr(type(h), "_casadi_equations")


LABELS = {
    "torque": ("torque", "N m"),
    "torque_rate": ("torque rate", "N m/s"),
    "angle": ("hub angle", "rad"),
    "speed": ("hub speed", "rad/s"),
    "tip": ("tip displacement", "m"),
    "moment": ("root moment", "N m"),
}
"""Names and units of the quantities of a hub-beam's slew, by kind."""


@dataclass(frozen=True, eq=False)
class SlewPlant:
    """Plant of a slew, in coordinates z with states ``x = to_state z``.

    Attributes
    ----------
    A, B : ndarray, n x n and n
        Linear part ``z' = A z + B u``, about rest.
    to_state, from_state : ndarray, n x n
        Change of coordinates; axial states of a beam are excluded.
    rows : dict of str to ndarray
        "angle", "speed", and if available "tip" [m] and "moment" [N m]: rows over z.
    frequencies : ndarray or None
        For a second-order plant in modal coordinates (m positions, rigid one first, then their rates): undamped
        frequencies, rad/s. None for other coordinates.
    machine : AssumedModesBeam or None
        The nonlinear beam; None for a linear system.
    labels : mapping from kind to (str, str)
        Names and units, as `LABELS`; for a linear system its signal names, with empty units.
    """

    A: Array
    B: Array
    to_state: Array
    from_state: Array
    rows: dict[str, Array]
    frequencies: Array | None
    machine: AssumedModesBeam | None
    labels: Mapping[str, tuple[str, str]] = field(default_factory=lambda: LABELS)

    def with_unit(self, kind: str, number: str) -> str:
        """Return a number with the unit of its kind, if known."""
        return f"{number} {self.labels[kind][1]}".rstrip()

    @property
    def planned_machine(self) -> AssumedModesBeam:
        """Beam of the planning, without axial modes."""
        assert self.machine is not None
        return self.machine._without_axial_modes()

    @cached_property
    def axial(self) -> Array:
        """Indices of the axial coordinates among the states of the beam, which are simulated but not planned."""
        if self.machine is None:
            return np.zeros(0, dtype=int)
        planned = self.planned_machine.state_labels
        return np.flatnonzero([name not in planned for name in self.machine.state_labels])

    def coordinates(self, states: Array) -> Array:
        """Return z for k states."""
        return np.delete(states, self.axial, axis=1) @ self.from_state.T

    @property
    def vibration(self) -> tuple[float, float]:
        """Undamped frequency [rad/s] and damping ratio of a beam's first mode, its hub free to turn."""
        assert self.frequencies is not None
        half, frequency = self.n // 2, float(self.frequencies[1])
        return frequency, float(-0.5 * self.A[half + 1, half + 1] / frequency)

    @property
    def n(self) -> int:
        """Number of coordinates."""
        return self.A.shape[0]

    @cached_property
    def inertia(self) -> float | None:
        """Rigid inertia: torque over the absolute mean angular acceleration, kg m^2; None without one."""
        left = np.linalg.svd(self.A.T)[2][-1]
        try:
            turning = float(left @ self.rest(0.0, 1.0))
        except ValueError:
            return None
        # rounding error relative to a norm
        if abs(turning) <= SUMMED:  # the torque drives the acceleration itself
            return None
        return abs(turning / float(left @ self.B))  # regardless of the sign of the angle

    @property
    def period(self) -> float:
        """Period of a beam's slowest vibration, s."""
        assert self.frequencies is not None
        return 2.0 * np.pi / float(self.frequencies[1])

    @cached_property
    def poles(self) -> Array:
        """Eigenvalues of the linear part, 1/s."""
        return np.linalg.eigvals(self.A)

    @property
    def slowest(self) -> float:
        """Smallest modulus of the nonzero eigenvalues, 1/s; infinite if there are none."""
        sizes = np.abs(self.poles)
        return float(np.min(sizes, where=sizes > _SPLIT * np.abs(self.A).max(), initial=np.inf))

    def still(self, z: Array) -> bool:
        """Return True if z is an equilibrium without torque."""
        # rounding error relative to |A| |z|
        return bool(np.abs(self.A @ z).max() <= ALIKE * max(1.0, np.abs(self.A).max() * np.abs(z).max()))

    def rest(self, angle: float, speed: float) -> Array:
        """Coordinates z at an angle [rad] in steady rotation at a speed [rad/s].

        Raises
        ------
        ValueError
            If a linear plant has no such state, with ``A x`` the rest direction times the speed.
        """
        if self.machine is not None:
            x = np.array(self.planned_machine.steady_state(speed), dtype=float)
            x[0] += angle
            return self.from_state @ x
        unit = _solved(np.vstack([self.A, self.rows["angle"]]), np.append(np.zeros(self.n), 1.0))
        if unit is None:
            raise ValueError(
                "system: expected a system that can rest at any angle (A x = 0 with its first output not zero)"
            )
        if speed == 0.0:
            return angle * unit
        turn = _solved(np.vstack([self.A, self.rows["angle"]]), np.append(unit, 0.0))
        if turn is None:
            raise ValueError("final_speed: expected 0, for the system cannot turn steadily (A x = rest direction)")
        return angle * unit + speed * turn


def plant_of(h: object) -> SlewPlant:
    """Return the plant of a hub-beam or a linear system.

    Parameters
    ----------
    h : AssumedModesBeam or control.StateSpace
        A linear system's first input is the torque, its first output the angle; an output "tip_displacement" and one
        "root_moment" are identified by name.

    Raises
    ------
    TypeError
        If `h` is neither.
    ValueError
        If the system is discrete, has direct feedthrough from torque to angle or speed, or is not finite.
    """
    if is_machine(h):
        plant = _beam(h)
        # equal beams may differ in fields that comparison ignores
        return plant if plant.machine is h else replace(plant, machine=h)
    return _linear(lti.of(h, "system", "a hub-beam with an equation of motion, or a control.StateSpace"))


@lru_cache(maxsize=_BEAMS)
def _beam(h: AssumedModesBeam) -> SlewPlant:
    """Return the beam in modal coordinates of its linear part about rest, without axial modes."""
    planned = h._without_axial_modes()
    at_rest = planned._linear(0.0)
    A, B, C = at_rest.A, at_rest.B, at_rest.C
    size = A.shape[0] // 2
    values, vectors = np.linalg.eig(-A[size:, :size])
    squares, shapes = np.real(values), np.real(vectors)
    order = np.argsort(squares)
    shapes, squares = shapes[:, order], squares[order]
    shapes[:, 0], squares[0] = np.eye(size)[0], 0.0
    push = np.linalg.solve(shapes, B[size:, 0])
    shapes, push = shapes * (push / push[0]), np.full(size, push[0])
    to_state, from_state = (np.kron(np.eye(2), item) for item in (shapes, np.linalg.inv(shapes)))
    modal = from_state @ A @ to_state
    modal[:size, :size], modal[:size, size:] = 0.0, np.eye(size)
    modal[size:, :size] = -np.diag(squares)
    rows = {"angle": C[0], "speed": C[1], "tip": C[2], "moment": np.asarray(planned._root_moment_row)}
    plant = SlewPlant(
        A=modal,
        B=np.concatenate([np.zeros(size), push]),
        to_state=to_state,
        from_state=from_state,
        rows={name: row @ to_state for name, row in rows.items()},
        frequencies=np.sqrt(np.abs(squares)),
        machine=h,
    )
    for item in (*vars(plant).values(), *plant.rows.values()):
        if isinstance(item, np.ndarray):
            item.setflags(write=False)  # shared by the cache
    return plant


def _linear(system: lti.Lti) -> SlewPlant:
    """Return the linear system from its first input to its outputs, in balanced state units."""
    A, b, C = system.A, system.B[:, 0], system.C
    if not b.size or system.D[0, 0] != 0.0 or abs(C[0] @ b) > 0.0:
        raise ValueError("system: expected an angle that follows the torque with two integrations (C B = 0 and D = 0)")
    # scale the states by powers of two, so that results do not depend on their units
    whole = blocks([[A, b[:, None]], [C[:1], np.zeros((1, 1))]])
    scale = balance(whole)[1]
    unit = scale[:-1] / scale[-1]
    A, b, C = A * unit / unit[:, None], b / unit, C * unit
    hidden = unmoved(A, b[:, None], system.state_labels, stable=True)
    if hidden:
        raise ValueError(f"system: the torque does not move {hidden[0]}; expected a controllable system")
    rows = {"angle": C[0], "speed": C[0] @ A}
    for name, output in (("tip", "tip_displacement"), ("moment", "root_moment")):
        if output in system.output_labels:
            rows[name] = C[system.output_labels.index(output)]
    return SlewPlant(
        A=A,
        B=b,
        to_state=np.diag(unit),
        from_state=np.diag(1.0 / unit),
        rows=rows,
        frequencies=None,
        machine=None,
        labels=_labels(system.input_labels[0], system.output_labels[0]),
    )


def _labels(torque: str, angle: str) -> Mapping[str, tuple[str, str]]:
    """Return names and units of a linear system's quantities; units are known for the names of a hub-beam."""
    if (torque, angle) == ("torque", "hub_angle"):
        return LABELS
    # python-control calls signals without names u[0] and y[0]
    torque, angle = "torque" if torque == "u[0]" else torque, "angle" if angle == "y[0]" else angle
    own = {"torque": torque, "torque_rate": f"rate of {torque}", "angle": angle, "speed": f"rate of {angle}"}
    return {kind: (own.get(kind, name), "") for kind, (name, _) in LABELS.items()}


def _solved(matrix: Array, right: Array) -> Array | None:
    x = np.linalg.lstsq(matrix, right, rcond=None)[0]
    scale = max(np.abs(right).max(), np.abs(matrix).max() * np.abs(x).max())
    # relative residual at rounding level
    return x if np.abs(matrix @ x - right).max() <= ALIKE * scale else None
