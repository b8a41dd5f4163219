"""What is slewed, as the planning sees it: a linear system, or a hub-beam in coordinates of its vibrations."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike

from boomctl.arrays import Array

if TYPE_CHECKING:
    import casadi
    import control

_NOTHING = 1e-12
_SPLIT = 1e-6


@runtime_checkable
class SlewMachine(Protocol):
    """A flexible beam on a hub that a torque turns, as `boomctl.rotating_beam` offers it.

    States are coordinates, hub angle first, then their rates.
    """

    @property
    def model(self) -> str:
        """Name of the model."""
        ...

    @property
    def root_moment_row(self) -> Array:
        """Row that reads the bending moment at the clamp off a state, N m."""
        ...

    def casadi_function(self) -> "casadi.Function":
        """``(x, torque) -> (xdot, y)``, y = hub angle, hub speed, tip displacement."""
        ...

    def linearize(self, hub_speed: float = 0.0) -> "control.StateSpace":
        """Linear model about steady rotation; input torque, outputs as above."""
        ...

    def steady_state(self, hub_speed: float = 0.0) -> Array:
        """State of steady rotation, hub angle 0."""
        ...

    def residual_energy(self, state: ArrayLike, hub_speed: float = 0.0) -> float:
        """Energy of the deviation from steady rotation, J."""
        ...

    def simulate_torque(
        self,
        function: Callable[..., object],
        timepts: ArrayLike,
        breakpoints: tuple[float, ...] = (),
        initial: ArrayLike | None = None,
        rtol: float = 1e-8,
        atol: float = 1e-10,
    ) -> Any:
        """Motion under a torque: a result with ``states``, ``tip_displacement``, ``hub_angle``, ``hub_speed``."""
        ...

    def with_tip_mass(self, tip_mass: float) -> "SlewMachine":
        """The same model with another tip mass, kg."""
        ...

    def with_stiffness(self, factor: float) -> "SlewMachine":
        """The same model with its bending stiffness multiplied by a factor."""
        ...

    def in_model(self, model: str, modes: int | None = None) -> Any:
        """The same machine in another model."""
        ...

    def shape(self, states: ArrayLike) -> Array:
        """Positions x + i y along the beam for k states, m."""
        ...


@dataclass(frozen=True, eq=False)
class Plant:
    """A plant in coordinates z, states ``x = to_state z``.

    Attributes
    ----------
    A, B : ndarray, n x n and n
        Linear part ``z' = A z + B u``, about rest.
    to_state, from_state : ndarray, n x n
        Change of coordinates.
    rows : dict of str to ndarray
        "angle", "speed", and where the plant has them "tip" [m] and "moment" [N m]: rows over z.
    frequencies : ndarray or None
        For a second-order plant in modal coordinates (m positions, rigid one first, then their rates): undamped
        frequencies, rad/s. None: coordinates as given.
    reach : ndarray of bool, n
        Which coordinates the torque moves in the linear part; the others' end is not prescribed, but reported.
    machine : SlewMachine or None
        The nonlinear beam behind it; None for a linear system.
    """

    A: Array
    B: Array
    to_state: Array
    from_state: Array
    rows: dict[str, Array]
    frequencies: Array | None
    reach: Array
    machine: SlewMachine | None

    @property
    def n(self) -> int:
        """Number of states."""
        return self.A.shape[0]

    @property
    def linear(self) -> bool:
        """Whether the linear part is all there is."""
        return self.machine is None

    @property
    def inertia(self) -> float | None:
        """Rigid inertia: torque over the size of the angular acceleration in the mean, kg m^2; None without one."""
        left = np.linalg.svd(self.A.T)[2][-1]
        try:
            turning = float(left @ self.rest(0.0, 1.0))
        except ValueError:
            return None
        if abs(turning) <= _NOTHING:  # the torque drives the acceleration itself
            return None
        return abs(turning / float(left @ self.B))  # whichever way the angle is counted

    @property
    def slowest(self) -> float:
        """Least size of an eigenvalue that is not zero, 1/s; infinite if there is none. A double zero splits by rounding."""
        sizes = np.abs(np.linalg.eigvals(self.A))
        return float(np.min(sizes, where=sizes > _SPLIT * np.abs(self.A).max(), initial=np.inf))

    def still(self, z: Array) -> bool:
        """Whether nothing moves at z without torque."""
        return bool(np.abs(self.A @ z).max() <= 1e-9 * max(1.0, np.abs(self.A).max() * np.abs(z).max()))

    def rest(self, angle: float, speed: float) -> Array:
        """Coordinates z at an angle [rad] in steady rotation at a speed [rad/s].

        Raises
        ------
        ValueError
            If a linear plant has no such state: ``A x`` is to be the shift of the angle at that speed.
        """
        if self.machine is not None:
            x = np.array(self.machine.steady_state(speed), dtype=float)
            x[0] += angle
            return self.from_state @ x
        unit = _solved(np.vstack([self.A, self.rows["angle"]]), np.append(np.zeros(self.n), 1.0))
        if unit is None:
            raise ValueError("h: expected a system that can rest at any angle (A x = 0 with its first output not zero)")
        if speed == 0.0:
            return angle * unit
        turn = _solved(np.vstack([self.A, self.rows["angle"]]), np.append(unit, 0.0))
        if turn is None:
            raise ValueError("final_speed: expected 0, for the system cannot turn steadily (A x = rest direction)")
        return angle * unit + speed * turn


def plant_of(h: object) -> Plant:
    """Return the plant that a hub-beam or a linear system is.

    Parameters
    ----------
    h : SlewMachine or control.StateSpace
        A linear system's first input is the torque, its first output the angle; an output "tip_displacement" and one
        "root_moment" are known by their names.

    Raises
    ------
    TypeError
        For anything else.
    ValueError
        If the system is discrete, its angle feels the torque directly, or its numbers are not finite.
    """
    if isinstance(h, SlewMachine):
        return _machine_plant(h)
    if all(hasattr(h, name) for name in ("A", "B", "C", "D", "input_labels")):
        return _linear_plant(h)
    raise TypeError(f"h = {type(h).__name__}: expected a hub-beam with an equation of motion, or a control.StateSpace")


def _machine_plant(h: SlewMachine) -> Plant:
    system = h.linearize()
    A, B, C = (np.asarray(each, dtype=float) for each in (system.A, system.B, system.C))
    size = A.shape[0] // 2
    values, vectors = np.linalg.eig(-A[size:, :size])
    squares, shapes = np.real(values), np.real(vectors)
    order = np.argsort(squares)
    shapes, squares = shapes[:, order], squares[order]
    shapes[:, 0], squares[0] = np.eye(size)[0], 0.0
    inverse = np.linalg.inv(shapes)
    push = inverse @ B[size:, 0]
    felt = np.abs(push) * np.linalg.norm(shapes, axis=0) > 1e-12 * np.linalg.norm(B)
    scale = np.where(felt, push / push[0], 1.0)
    shapes, inverse, push = shapes * scale, inverse / scale[:, None], np.where(felt, push / scale, 0.0)
    to_state, from_state = (np.kron(np.eye(2), each) for each in (shapes, inverse))
    modal = from_state @ A @ to_state
    modal[:size, :size], modal[:size, size:] = 0.0, np.eye(size)
    modal[size:, :size] = -np.diag(squares)
    rows = {"angle": C[0], "speed": C[1], "tip": C[2], "moment": np.asarray(h.root_moment_row)}
    rows = {name: row @ to_state for name, row in rows.items()}
    reach = np.concatenate([felt, felt])
    push = np.concatenate([np.zeros(size), push])
    return Plant(modal, push, to_state, from_state, rows, np.sqrt(np.abs(squares)), reach, h)


def _linear_plant(h: Any) -> Plant:
    if getattr(h, "dt", 0) not in (0, None):
        raise ValueError(f"h: expected a continuous-time system, got one with sample time {h.dt}")
    A, B, C, D = (np.atleast_2d(np.asarray(each, dtype=float)) for each in (h.A, h.B, h.C, h.D))
    if not all(np.isfinite(each).all() for each in (A, B, C, D)):
        raise ValueError("h: expected finite matrices A, B, C, D")
    if A.shape[0] == 0 or D[0, 0] != 0.0 or abs(C[0] @ B[:, 0]) > 0.0:
        raise ValueError("h: expected an angle that follows the torque with two integrations (C B = 0 and D = 0)")
    unit = _units(A, B[:, 0], C[0])
    A, b, C = A * unit / unit[:, None], B[:, 0] / unit, C * unit
    rows = {"angle": C[0], "speed": C[0] @ A}
    for name, output in (("tip", "tip_displacement"), ("moment", "root_moment")):
        if output in h.output_labels:
            rows[name] = C[h.output_labels.index(output)]
    _check_controllable(A, b)
    return Plant(A, b, np.diag(unit), np.diag(1.0 / unit), rows, None, np.ones(A.shape[0], dtype=bool), None)


def _units(A: Array, b: Array, c: Array) -> Array:
    """Powers of two in which states are measured, such that it does not matter which units they came in."""
    from scipy.linalg import matrix_balance

    whole = np.block([[A, b[:, None]], [c[None, :], np.zeros((1, 1))]])
    scale = matrix_balance(whole, permute=False, separate=True)[1][0]
    return scale[:-1] / scale[-1]


def _check_controllable(A: Array, b: Array) -> None:
    """Every eigenvector of A^T feels b (Popov, Belevitch, Hautus)."""
    for value in np.linalg.eigvals(A):
        pencil = np.column_stack([A - value * np.eye(A.shape[0]), b])
        scale = np.linalg.norm(pencil, axis=0)
        s = np.linalg.svd(pencil / np.where(scale > 0.0, scale, 1.0), compute_uv=False)
        if s[-1] < 1e-11 * s[0]:
            raise ValueError(f"h: the torque does not move the mode at {value:.4g} 1/s; expected a controllable system")


def _solved(matrix: Array, right: Array) -> Array | None:
    x = np.linalg.lstsq(matrix, right, rcond=None)[0]
    scale = max(np.abs(right).max(), np.abs(matrix).max() * np.abs(x).max())
    return x if np.abs(matrix @ x - right).max() <= 1e-9 * scale else None
