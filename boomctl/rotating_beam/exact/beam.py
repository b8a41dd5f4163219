"""The geometrically exact hub-beam: the model against which the others are measured."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from typing import TYPE_CHECKING, final

import numpy as np
from numpy.typing import ArrayLike

from boomctl.arrays import Array
from boomctl.exceptions import SimulationError
from boomctl.maneuvers import Maneuver, TorqueDriven
from boomctl.progress import computing, tell
from boomctl.rotating_beam.beam import HubBeam, SmallMotion, lowest_rate, natural_hz
from boomctl.rotating_beam.exact.basis import StrainBasis, strain_basis
from boomctl.rotating_beam.exact.dynamics import ExactBeamDynamics
from boomctl.rotating_beam.exact.integrator import StepFailedError
from boomctl.rotating_beam.exact.run import Run, run_to_tolerance, run_with_step
from boomctl.rotating_beam.parameters import HubBeamParameters
from boomctl.rotating_beam.result import CHUNK, Details, Dynamics, Motion
from boomctl.rotating_beam.selection import ModelChoice
from boomctl.threads import one_blas_thread

if TYPE_CHECKING:
    from boomctl.lti.machine_modes import MachineModes
    from boomctl.rotating_beam.sensors import BeamSensor

_FIRST_STEP = 0.25  # Coarsest step of a run, in periods of the second bending mode.
_MOST_POLYNOMIALS = 60  # Most polynomials on a span: the series has converged to rounding error with fewer.
_MORE = 1.4  # Factor on the number of polynomials to estimate the truncation error: about the square root of 2.
_COMPARED = 43  # Most polynomials that are multiplied by this factor: 1.4 times as many are 60.
_LOOSE = 1e-4  # Relative tolerance of the steps with which numbers of polynomials are compared.
_LEFT = 1.5  # Truncation error over the change by the next polynomials: later changes fall by half or more each time.
_FIRST_STEP_ALONE = 0.0625  # Coarsest step in periods of the first bending mode, if there is no second one.


@final
@dataclass(frozen=True, eq=False, repr=False)
class GeometricallyExactBeam(HubBeam):
    """A planar beam of finite strain and rotation, without shear, on a hub that turns in its plane.

    Stretch and curvature (per undeformed arc length) are Legendre series on each span between clamp, tip mass and free
    end; energies are exact in them. The rotary inertia of the section is neglected (Simo & Vu-Quoc 1986, without
    shear and rotary inertia; the same neglect as in Bai et al. 2009).

    Parameters
    ----------
    parameters : HubBeamParameters
        The machine. Its damping ratio holds for small motion of the clamped beam at rest; the force is linear in
        the rates of strain.
    modes : int
        Number of polynomials of curvature, and of stretch, on each span; 1 to 60. The error of a motion includes the
        truncation of the series.
    selection : record, optional
        Result of the selection by accuracy in a maneuver, with the tested candidates: see `hub_beam`.

    Attributes
    ----------
    model : str
        ``"geometrically-exact"``.

    Raises
    ------
    TypeError, ValueError
        If ``modes`` is not a whole number, or out of range.
    """

    parameters: HubBeamParameters
    modes: int = 8
    model: str = field(default="geometrically-exact", init=False)
    selection: ModelChoice | None = None

    @property
    def max_modes(self) -> int:
        return _MOST_POLYNOMIALS

    @property
    def has_axial_modes(self) -> bool:
        return True

    @cached_property
    def _basis(self) -> StrainBasis:
        """Discretized beam."""
        return strain_basis(self.parameters, self.modes)

    @cached_property
    def dynamics(self) -> ExactBeamDynamics:
        """Its energies, momenta and forces."""
        return ExactBeamDynamics(self._basis, _damping_matrix(self._basis, self.parameters.damping_ratio))

    @property
    def state_labels(self) -> tuple[str, ...]:
        """Names of the states: hub angle, curvatures, stretches, then their rates."""
        count = (self._size - 1) // 2
        strains = [f"{kind}_{k + 1}" for kind in ("curvature", "stretch") for k in range(count)]
        return ("hub_angle", *strains, "hub_speed", *(f"{name}_rate" for name in strains))

    @one_blas_thread
    def divergence_speed(self) -> float:
        return self.max_steady_speed

    @cached_property
    @one_blas_thread
    def max_steady_speed(self) -> float:
        stiffness, mass, _ = self._axial
        return lowest_rate(mass, stiffness)

    @cached_property
    def _axial(self) -> tuple[Array, Array, Array]:
        """Stiffness and mass of the straight beam over the stretches, and the pull ``V`` of a unit speed squared.

        A straight beam that turns at ``w`` is at rest where ``(K - w^2 M) b = w^2 V``.
        """
        basis = self._basis
        positions = basis.integration @ basis.stretch[:, basis.stretching]
        weighted = basis.point_masses[:, None] * positions
        stiffness = np.diag(basis.stiffness[basis.stretching])
        return stiffness, positions.T @ weighted, weighted.T @ basis.integration.sum(axis=1)

    def deformed_shape(self, states: ArrayLike) -> Array:
        """Return where the beam is, in fixed axes.

        Parameters
        ----------
        states : (k, n) array_like
            States in the order of `state_labels`; one state, or one a row.

        Returns
        -------
        (k, points) complex ndarray
            Positions ``x + i y`` from the clamp through the Gauss points to the free end [m].

        Raises
        ------
        TypeError, ValueError
            If a value is not finite, or there are not as many values as states.
        """
        return self.dynamics.positions(self._states(states)[:, : self._size])

    @property
    def _size(self) -> int:
        return self._basis.coordinates

    def _transverse_hz(self, speed: float) -> Array:
        mass, _, stiffness = self._linearized(speed)
        own = self._basis.bending
        return natural_hz(mass[own, own], stiffness[own, own])

    def _steady_coordinates(self, speed: float) -> Array:
        (stiffness, mass, pull), stretching = self._axial, self._basis.stretching
        q = np.zeros(self._size)
        q[stretching] = np.linalg.solve(stiffness - speed**2 * mass, speed**2 * pull)
        return q[1:]

    def _linearized(self, speed: float) -> tuple[Array, Array, Array]:
        """Return the derivatives of momentum and force in steady rotation, see `ExactBeamDynamics.linearization`."""
        q, v = np.append(0.0, self._steady_coordinates(speed)), np.zeros(self._size)
        v[0] = speed
        return self.dynamics.linearization(q, v)

    def _small_motion(self, speed: float) -> SmallMotion:
        mass, coupling, stiffness = self._linearized(speed)
        damping = coupling - coupling.T
        if self.dynamics.damping is not None:
            damping = damping + self.dynamics.damping
        tip = np.imag(self.dynamics.tip_row(np.append(0.0, self._steady_coordinates(speed))))
        return SmallMotion(mass, damping, stiffness, tip)

    def _built_modes(self, sensors: tuple[BeamSensor, ...]) -> MachineModes:
        raise ValueError(
            "`plant` must be a hub-beam with assumed modes, got a geometrically exact one. Pass plant.with_model('foam')."
        )

    def _state_derivative(self, x: Array, torque: float) -> Array:
        y, rate = x[: self._size], x[self._size :]
        return np.concatenate([rate, self.dynamics.acceleration(y, rate, torque)])

    def _tip_displacement(self, y: Array) -> float:
        return float(np.imag(self.dynamics.tip(y)))

    def _motion(
        self, maneuver: Maneuver, timepts: Array, start: tuple[Array, Array], tolerance: tuple[float, float]
    ) -> Motion:
        return self._followed(maneuver, timepts, start, tolerance)[0]

    def _error(self, maneuver: Maneuver, timepts: Array, start: tuple[Array, Array], motion: Motion) -> float:
        if timepts[-1] == 0.0:
            return motion.error
        with computing("error of a motion"):
            return motion.error + self._left_out(maneuver, timepts, start, motion.error)

    def _followed(
        self, maneuver: Maneuver, timepts: Array, start: tuple[Array, Array], tolerance: tuple[float, float]
    ) -> tuple[Motion, Run | None]:
        bending = self.eigenfrequencies_hz()
        return run_to_tolerance(
            self.dynamics,
            maneuver,
            timepts,
            start,
            first_step=float(_FIRST_STEP / bending[1] if bending.size > 1 else _FIRST_STEP_ALONE / bending[0]),
            rtol=tolerance[0],
            atol=tolerance[1],
        )

    def _left_out(self, maneuver: Maneuver, timepts: Array, start: tuple[Array, Array], atol: float) -> float:
        """Estimate the truncation error of the series [m] by a motion with 1.4 times as many polynomials in the same steps.

        The difference is due to the polynomials, for the errors of the steps are nearly the same; coarse steps suffice.
        """
        few = self._of(min(self.modes, _COMPARED))
        more = self._of(max(math.ceil(_MORE * few.modes), few.modes + 2))

        def stepped(beam: GeometricallyExactBeam, step: float) -> Run:
            state = resized(start[0], self.modes, beam.modes), resized(start[1], self.modes, beam.modes)
            return run_with_step(beam.dynamics, maneuver, timepts, state, step)

        try:
            begin = resized(start[0], self.modes, few.modes), resized(start[1], self.modes, few.modes)
            before = few._followed(maneuver, timepts, begin, (_LOOSE, atol))[1]
            if before is None:
                return 0.0
            tell(f"{more.modes} polynomials")
            step = before.step
            while True:
                try:
                    return _LEFT * stepped(more, step).distance(before)
                except StepFailedError:
                    step *= 0.5
                    before = stepped(few, step)
        except SimulationError:
            return math.inf

    def _of(self, modes: int) -> GeometricallyExactBeam:
        """Return this beam with a number of polynomials."""
        return self if modes == self.modes else replace(self, modes=modes)

    def _details(self, maneuver: Maneuver, timepts: Array, motion: Motion) -> Details:
        q, v = motion.states()
        dynamics = self.dynamics
        extension = dynamics.extension(q)
        return Details(
            tip_extension=extension,
            foreshortening=np.real(dynamics.tip(q)) - np.sum(self._basis.tip_row) - extension,
            hub_angle=q[:, 0],
            hub_speed=v[:, 0],
            states=np.hstack([q, v]),
            dynamics=partial(_forces, dynamics, maneuver, timepts, q, v),
        )


def _forces(dynamics: ExactBeamDynamics, maneuver: Maneuver, timepts: Array, q: Array, v: Array) -> Dynamics:
    """Evaluate forces and inertias of a motion."""
    force = -dynamics.convective_force(q, v)
    inner = force - dynamics.basis.stiffness * q
    if dynamics.damping is not None:
        inner -= v @ dynamics.damping
    margin, pull = np.empty(len(timepts)), np.empty(len(timepts))
    for part in np.array_split(np.arange(len(timepts)), len(timepts) // CHUNK + 1):
        mass = dynamics.mass_matrix(q[part])
        column = mass[:, 1:, :1]
        solved = np.linalg.solve(mass[:, 1:, 1:], np.concatenate([column, inner[part, 1:, None]], axis=2))
        margin[part] = mass[:, 0, 0] - np.sum(column * solved[:, :, :1], axis=(1, 2))
        pull[part] = np.sum(column * solved[:, :, 1:], axis=(1, 2))
    if isinstance(maneuver, TorqueDriven):
        torque = np.array(maneuver.torque(timepts))
        turning = (torque + inner[:, 0] - pull) / margin
    else:
        turning = np.array(maneuver.acceleration(timepts))
        torque = margin * turning + pull - force[:, 0]
    momentum = dynamics.momentum_and_force(q, v)[0][:, 0]
    return Dynamics(turning, torque, force[:, 0], dynamics.energy(q, v), momentum, margin)


def _damping_matrix(basis: StrainBasis, ratio: float) -> Array | None:
    """Damping that gives every clamped mode of the beam at rest the same ``ratio``; None for a ratio of 0."""
    if ratio == 0.0:
        return None
    from scipy.linalg import eigh

    mass = ExactBeamDynamics(basis).rest_mass[1:, 1:]
    squares, shapes = eigh(np.diag(basis.stiffness[1:]), mass)
    weighted = mass @ shapes
    damping = np.zeros((basis.coordinates, basis.coordinates))
    damping[1:, 1:] = (weighted * (2.0 * ratio * np.sqrt(squares))) @ weighted.T
    return damping


def resized(y: Array, modes: int, wanted: int) -> Array:
    """Return coordinates, or their rates, of another number of polynomials: truncated, or extended by zeros."""
    strains = y[..., 1:].reshape(*y.shape[:-1], -1, modes)
    result = np.zeros((*strains.shape[:-1], wanted))
    least = min(modes, wanted)
    result[..., :least] = strains[..., :least]
    return np.concatenate([y[..., :1], result.reshape(*y.shape[:-1], -1)], axis=-1)
