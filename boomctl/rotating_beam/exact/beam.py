"""The geometrically exact hub-beam: the model against which the others are measured."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from typing import TYPE_CHECKING, final

import numpy as np
from numpy.typing import ArrayLike

from boomctl.arrays import Array
from boomctl.progress import computing
from boomctl.rotating_beam.beam import Enough, HubBeam, SmallMotion, lowest_rate, natural_hz
from boomctl.rotating_beam.chosen import ModelChoice
from boomctl.rotating_beam.exact.basis import StrainBasis, place_rows, strain_basis
from boomctl.rotating_beam.exact.dynamics import ExactBeamDynamics
from boomctl.rotating_beam.exact.integrator import CHUNK
from boomctl.rotating_beam.exact.polynomials import (
    MOST_POLYNOMIALS,
    Followed,
    Stepped,
    left_out,
    resized,
    with_enough_polynomials,
)
from boomctl.rotating_beam.exact.run import Run, run_to_tolerance, run_with_step
from boomctl.rotating_beam.manoeuvres import Manoeuvre, TorqueDriven
from boomctl.rotating_beam.parameters import HubBeamParameters
from boomctl.rotating_beam.result import Details, Dynamics, Motion
from boomctl.threads import one_blas_thread

if TYPE_CHECKING:
    import casadi

    from boomctl.lti.machine_modes import MachineModes
    from boomctl.rotating_beam.modal.energy import Lagrangian
    from boomctl.rotating_beam.modal.forced import Place, Places
    from boomctl.rotating_beam.sensors import BeamSensor

_FIRST_STEP = 0.25  # of the second bending period: the coarsest step of a run, a choice
_FIRST_STEP_ALONE = 0.0625  # of the first bending period, where there is no second one, which is about 6 times as fast


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
        Number of polynomials of curvature, and of stretch, on each span; 1 to 60. A motion has as many as are given, and
        its error says what they leave out; where none are given it takes more until its tolerance holds, of which its
        states have the first.
    chosen : record, optional
        What was chosen for its accuracy in a manoeuvre, and what was tried: see `hub_beam`.

    Attributes
    ----------
    model : str
        ``"geometrically-exact"``.

    Raises
    ------
    TypeError, ValueError
        If ``modes`` is no whole number, or out of range.
    """

    parameters: HubBeamParameters
    modes: int = Enough(8)
    model: str = field(default="geometrically-exact", init=False)
    chosen: ModelChoice | None = None

    @property
    def most_modes(self) -> int:
        return MOST_POLYNOMIALS

    @property
    def has_axial_modes(self) -> bool:
        return True

    @cached_property
    def basis(self) -> StrainBasis:
        """The discretised beam."""
        return strain_basis(self.parameters, self.modes)

    @cached_property
    def dynamics(self) -> ExactBeamDynamics:
        """Its energies, momenta and forces."""
        return ExactBeamDynamics(self.basis, _damping_matrix(self.basis, self.parameters.damping_ratio))

    @property
    def state_names(self) -> tuple[str, ...]:
        """Names of the states: hub angle, curvatures, stretches, then their rates."""
        count = (self._size - 1) // 2
        strains = [f"{kind}_{k + 1}" for kind in ("curvature", "stretch") for k in range(count)]
        return ("hub_angle", *strains, "hub_speed", *(f"{name}_rate" for name in strains))

    @one_blas_thread
    def critical_speed(self) -> float:
        return self.steady_limit

    def _steady_limit(self) -> float:
        stiffness, mass, _ = self._axial
        return lowest_rate(mass, stiffness)

    @cached_property
    def _axial(self) -> tuple[Array, Array, Array]:
        """Stiffness and mass of the straight beam over the stretches, and the pull ``V`` of a unit speed squared.

        A straight beam that turns at ``w`` is at rest where ``(K - w^2 M) b = w^2 V``.
        """
        basis = self.basis
        positions = basis.integration @ basis.stretch[:, basis.stretching]
        weighted = basis.point_masses[:, None] * positions
        stiffness = np.diag(basis.stiffness[basis.stretching])
        return stiffness, positions.T @ weighted, weighted.T @ basis.integration.sum(axis=1)

    def shape(self, states: ArrayLike) -> Array:
        """Return where the beam is, in fixed axes.

        Parameters
        ----------
        states : (k, n) array_like
            States in the order of `state_names`; one state, or one a row.

        Returns
        -------
        (k, points) complex ndarray
            Positions ``x + i y`` from the clamp through the Gauss points to the free end [m].

        Raises
        ------
        TypeError, ValueError
            Not finite, or not as many numbers as states.
        """
        return self.dynamics.positions(self._states(states)[:, : self._size])

    @property
    def _size(self) -> int:
        return self.basis.coordinates

    def _transverse_hz(self, speed: float) -> Array:
        mass, _, stiffness = self._linearised(speed)
        own = self.basis.bending
        return natural_hz(mass[own, own], stiffness[own, own])

    def _steady_coordinates(self, speed: float) -> Array:
        (stiffness, mass, pull), stretching = self._axial, self.basis.stretching
        q = np.zeros(self._size)
        q[stretching] = np.linalg.solve(stiffness - speed**2 * mass, speed**2 * pull)
        return q[1:]

    def _linearised(self, speed: float) -> tuple[Array, Array, Array]:
        """Derivatives of momentum and force in steady rotation, see `ExactBeamDynamics.linearisation`."""
        q, v = np.append(0.0, self._steady_coordinates(speed)), np.zeros(self._size)
        v[0] = speed
        return self.dynamics.linearisation(q, v)

    def _small_motion(self, speed: float) -> SmallMotion:
        mass, coupling, stiffness = self._linearised(speed)
        damping = coupling - coupling.T
        if self.dynamics.damping is not None:
            damping = damping + self.dynamics.damping
        tip = np.imag(self.dynamics.tip_row(np.append(0.0, self._steady_coordinates(speed))))
        return SmallMotion(mass, damping, stiffness, tip)

    def _lagrangian(self) -> Lagrangian:
        """Energies as CasADi expressions; the kinetic one in the frame of the hub, whose angle it does not depend on."""
        import casadi as ca

        from boomctl.rotating_beam.modal.energy import Lagrangian

        basis, damping, size = self.basis, self.dynamics.damping, self._size
        kernel = ca.DM(basis.integration.T @ (basis.point_masses[:, None] * basis.integration))
        rotation, stretch = (ca.sparsify(ca.DM(each)) for each in (basis.rotation, basis.stretch))

        def kinetic(y: casadi.SX, rate: casadi.SX) -> casadi.SX:
            angle = ca.mtimes(rotation[:, 1:], y[1:])
            long, longer = 1.0 + ca.mtimes(stretch, y), ca.mtimes(stretch, rate)
            turned, cosine, sine = ca.mtimes(rotation, rate) * long, ca.cos(angle), ca.sin(angle)
            along, across = longer * cosine - turned * sine, longer * sine + turned * cosine
            energy = ca.bilin(kernel, along, along) + ca.bilin(kernel, across, across)
            return 0.5 * (energy + basis.hub_inertia * rate[0] ** 2)

        return Lagrangian(
            kinetic=kinetic,
            stiffness=np.diag(basis.stiffness[1:]),
            damping=np.zeros((size - 1, size - 1)) if damping is None else damping[1:, 1:],
            tip=np.zeros(size - 1),
            keeps_inertia_torque=True,
        )

    def _places(self) -> Places:
        """Return the points of the beam's axis as CasADi expressions."""
        import casadi as ca

        from boomctl.rotating_beam.modal.forced import Place

        basis = self.basis

        def place(q: casadi.SX, x: float) -> Place:
            here = place_rows(self.parameters, self.modes, x)
            angle = ca.mtimes(ca.DM(basis.rotation[:, 1:]), q)
            long = 1.0 + ca.mtimes(ca.DM(basis.stretch[:, 1:]), q)
            row = ca.DM(here.integration[None])
            return Place(
                along=ca.mtimes(row, long * ca.cos(angle)),
                across=ca.mtimes(row, long * ca.sin(angle)),
                slope=ca.mtimes(ca.DM(here.rotation[None]), q),
                curvature=ca.mtimes(ca.DM(here.curvature[None]), q),
                stretch=ca.mtimes(ca.DM(here.stretch[None]), q),
            )

        return place

    def _built_modes(self, sensors: tuple[BeamSensor, ...]) -> MachineModes:
        from boomctl.rotating_beam.modal import forced  # which only a loop needs

        p, places = self.parameters, self._places()
        law = forced.lagrangian_law(self._lagrangian(), places, p.length)
        return forced.forced_modes(self._small_motion(0.0), law, places, p, self.state_names, sensors)

    def _state_derivative(self, x: Array, torque: float) -> Array:
        y, rate = x[: self._size], x[self._size :]
        return np.concatenate([rate, self.dynamics.acceleration(y, rate, torque)])

    def _tip_displacement(self, y: Array) -> float:
        return float(np.imag(self.dynamics.tip(y)))

    def _motion(
        self, manoeuvre: Manoeuvre, timepts: Array, start: tuple[Array, Array], tolerance: tuple[float, float]
    ) -> Motion:
        followed, stepped = self._followed(manoeuvre, timepts, start, tolerance[1])
        if not isinstance(self.modes, Enough):
            return followed(self.modes, tolerance[0])[0]
        radius = float(np.sum(self.basis.tip_row))
        return with_enough_polynomials(followed, stepped, self.modes, tolerance, radius)

    def _error(self, manoeuvre: Manoeuvre, timepts: Array, start: tuple[Array, Array], motion: Motion) -> float:
        if isinstance(self.modes, Enough) or timepts[-1] == 0.0:
            return motion.error
        with computing("error of a motion"):
            return motion.error + left_out(*self._followed(manoeuvre, timepts, start, motion.error), self.modes)

    def _followed(
        self, manoeuvre: Manoeuvre, timepts: Array, start: tuple[Array, Array], atol: float
    ) -> tuple[Followed, Stepped]:
        """Return what follows a motion with any number of polynomials: to a tolerance, and in given steps."""
        bending = self.frequencies_hz()
        first_step = float(_FIRST_STEP / bending[1] if bending.size > 1 else _FIRST_STEP_ALONE / bending[0])

        def state(modes: int) -> tuple[Array, Array]:
            return resized(start[0], self.modes, modes), resized(start[1], self.modes, modes)

        def followed(modes: int, rtol: float) -> tuple[Motion, Run | None]:
            dynamics, begin = self._of(modes).dynamics, state(modes)
            tried = {"first_step": first_step, "rtol": rtol, "atol": atol}
            return run_to_tolerance(dynamics, manoeuvre, timepts, begin, **tried)

        def stepped(modes: int, step: float) -> Run:
            return run_with_step(self._of(modes).dynamics, manoeuvre, timepts, state(modes), step)

        return followed, stepped

    def _of(self, modes: int) -> GeometricallyExactBeam:
        """Return this beam with a number of polynomials."""
        return self if modes == self.modes else replace(self, modes=modes)

    def _details(self, manoeuvre: Manoeuvre, timepts: Array, motion: Motion) -> Details:
        q, v = motion.states()
        modes = self.modes * (q.shape[1] - 1) // (self._size - 1)  # a motion may have more polynomials than its states
        dynamics = self._of(modes).dynamics
        extension = dynamics.extension(q)
        return Details(
            axial_tip_displacement=extension,
            foreshortening=np.real(dynamics.tip(q)) - np.sum(self.basis.tip_row) - extension,
            hub_angle=q[:, 0],
            hub_speed=v[:, 0],
            states=np.hstack([resized(y, modes, self.modes) for y in (q, v)]),
            dynamics=partial(_forces, dynamics, manoeuvre, timepts, q, v),
        )


def _forces(dynamics: ExactBeamDynamics, manoeuvre: Manoeuvre, timepts: Array, q: Array, v: Array) -> Dynamics:
    """What a motion's forces and inertias come to."""
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
    if isinstance(manoeuvre, TorqueDriven):
        torque = np.array(manoeuvre.torque(timepts))
        turning = (torque + inner[:, 0] - pull) / margin
    else:
        turning = np.array(manoeuvre.acceleration(timepts))
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
