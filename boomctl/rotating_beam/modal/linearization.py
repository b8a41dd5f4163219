"""The hub-beam as python-control systems: nonlinear, linearised, and a linear family over the hub speed."""

from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from boomctl.arrays import Array
from boomctl.checks import real
from boomctl.rotating_beam.modal.equations import Equations
from boomctl.rotating_beam.modal.frequencies import check_speed, steady_rotation

if TYPE_CHECKING:
    import control

    from boomctl.rotating_beam.beam import HubBeam

INPUTS = ("torque",)
OUTPUTS = ("hub_angle", "hub_speed", "tip_displacement")


def to_nlsys(name: str, equations: Equations, states: tuple[str, ...]) -> "control.NonlinearIOSystem":
    """Return equations of motion as a `control.NonlinearIOSystem`.

    Parameters
    ----------
    name : str
        Of the system.
    equations : Equations
    states : tuple of str
        Names of the states.
    """
    from boomctl.lti.python_control import control

    names = {"inputs": list(INPUTS), "outputs": list(OUTPUTS), "states": list(states), "name": _system_name(name)}
    return control.nlsys(partial(_rates, equations), partial(_outputs, equations), **names)


def _rates(equations: Equations, t: float, x: Array, u: Array, params: dict) -> Array:
    return state_derivative(equations, np.asarray(x, dtype=float), float(np.ravel(u)[0]))


def _outputs(equations: Equations, t: float, x: Array, u: Array, params: dict) -> Array:
    size = equations.size
    return np.array([x[0], x[size], equations.tip.transverse @ np.asarray(x)[1:size]])


def state_derivative(equations: Equations, x: Array, torque: float) -> Array:
    """Derivative of the state (coordinates, rates) under a torque [N m].

    Raises
    ------
    ValueError
        If the mass matrix is not positive definite.
    """
    y, rate = x[None, : equations.size], x[None, equations.size :]
    force = -equations.residual(y, rate, np.zeros_like(y))
    force[0, 0] += torque
    inertia = equations.inertia(y)
    margin = inertia.margin()[0]
    if not margin > 0.0:
        raise ValueError(f"mass matrix margin = {margin:g} kg m^2: expected > 0; the deformation is outside the model")
    turning = (force[0, 0] - inertia.coupling[0] @ inertia.solve_beam(force[:, 1:])[0]) / margin
    bending = inertia.solve_beam(force[:, 1:] - turning * inertia.coupling)[0]
    return np.concatenate([rate[0], [turning], bending])


def linearize(beam: "HubBeam", speed: float) -> "control.StateSpace":
    """Linearise about steady rotation at a hub speed [rad/s]; see `HubBeam.linearize`."""
    from boomctl.lti.python_control import control

    equations = beam.equations
    if beam.has_axial_modes:
        axial = np.sqrt(np.linalg.eigvals(np.linalg.solve(beam.integrals.M1, beam.integrals.K1)).real.min())
        check_speed(beam.model, speed, float(axial))
    _, tangents = steady_rotation(equations, speed)
    mass, damping, stiffness = (each[0] for each in tangents)
    size = equations.size
    A = np.zeros((2 * size, 2 * size))
    A[:size, size:] = np.eye(size)
    A[size:, :size], A[size:, size:] = -np.linalg.solve(mass, stiffness), -np.linalg.solve(mass, damping)
    B = np.zeros((2 * size, 1))
    B[size:, 0] = np.linalg.solve(mass, np.eye(size)[:, 0])
    C = np.zeros((3, 2 * size))
    C[0, 0] = C[1, size] = 1.0
    C[2, 1:size] = equations.tip.transverse
    names = {"inputs": list(INPUTS), "outputs": list(OUTPUTS), "states": list(beam.state_names)}
    return control.StateSpace(A, B, C, np.zeros((3, 1)), **names, name=_system_name(beam.model))


@dataclass(frozen=True)
class HubSpeedFamily:
    """Linear models of a hub-beam over the hub speed.

    Attributes
    ----------
    beam : HubBeam
    """

    beam: "HubBeam"

    def __repr__(self) -> str:
        return f"HubSpeedFamily: linear models over the hub speed\n  {self.beam!r}"

    def at(self, hub_speed: float) -> "control.StateSpace":
        """Linear model at a hub speed [rad/s]; as `HubBeam.linearize`."""
        return self.beam.linearize(hub_speed)

    def affine(self) -> tuple["control.StateSpace", Array]:
        """Return the family as one model and one matrix: ``A(w) = A(0) + w^2 slope``, all else independent of w.

        This holds for the two variants of SFOAM without approximation, for ``D - M2`` enters with the speed squared.

        Returns
        -------
        system : control.StateSpace
            At rest.
        slope : ndarray
            Derivative of A with respect to the speed squared, s^2.

        Raises
        ------
        ValueError
            For models with axial modes: their stretch and gyroscopic terms are not affine in the speed squared.
        """
        if self.beam.has_axial_modes:
            raise ValueError(
                f"model = {self.beam.model!r}: expected 'sfoam' or 'sfoam-consistent' for an affine family"
            )
        rest = self.beam.linearize(0.0)
        return rest, np.asarray(self.beam.linearize(1.0).A) - np.asarray(rest.A)

    def grid(self, hub_speeds: Array) -> tuple["control.StateSpace", ...]:
        """Linear models at several hub speeds [rad/s]."""
        return tuple(self.at(real("hub_speeds", float(each))) for each in np.ravel(hub_speeds))


def _system_name(model: str) -> str:
    return f"hub_beam_{model.replace('-', '_')}"
