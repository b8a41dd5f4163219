"""The geometrically exact hub-beam: the model against which the others are measured."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, partial
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from boomctl.arrays import Array
from boomctl.checks import positive, real
from boomctl.rotating_beam.exact.basis import StrainBasis, strain_basis
from boomctl.rotating_beam.exact.dynamics import ExactBeamDynamics
from boomctl.rotating_beam.exact.integrator import Drive
from boomctl.rotating_beam.exact.run import Motion, run_to_tolerance
from boomctl.rotating_beam.exact.statics import (
    coupled_frequencies,
    critical_speed,
    damping_matrix,
    small_motion,
    steady_rotation,
    transverse_frequencies,
)
from boomctl.rotating_beam.manoeuvres import PrescribedMotion, Torque, TorqueDriven
from boomctl.rotating_beam.parameters import HubBeamParameters, described
from boomctl.rotating_beam.result import Details, SimulationResult, small_deformation_until
from boomctl.rotating_beam.validation import mode_count, state_vector, time_points

if TYPE_CHECKING:
    import control

MOST_MODES = 60
"""Largest number of polynomials a span; the series has converged to rounding long before."""


@dataclass(frozen=True, eq=False)
class GeometricallyExactBeam:
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
        Number of polynomials of curvature, and of stretch, on each span; 1 to 60.

    Raises
    ------
    TypeError, ValueError
        If ``modes`` is no whole number, or out of range.
    """

    parameters: HubBeamParameters
    modes: int = 8

    def __post_init__(self) -> None:
        if mode_count(self.modes) > MOST_MODES:
            raise ValueError(f"modes = {self.modes!r}: expected 1 to {MOST_MODES} polynomials a span")

    def __repr__(self) -> str:
        return described("GeometricallyExactBeam", self.model, self.modes, self.state_names, self.parameters)

    @property
    def model(self) -> str:
        """Name of the model, as in `hub_beam`."""
        return "geometrically-exact"

    @cached_property
    def basis(self) -> StrainBasis:
        """The discretised beam."""
        return strain_basis(self.parameters, self.modes)

    @cached_property
    def dynamics(self) -> ExactBeamDynamics:
        """Its energies, momenta and forces."""
        return ExactBeamDynamics(self.basis, damping_matrix(self.basis, self.parameters.damping_ratio))

    @property
    def state_names(self) -> tuple[str, ...]:
        """Names of the states: hub angle, curvatures, stretches, then their rates."""
        count = (self.basis.coordinates - 1) // 2
        strains = [f"{kind}_{k + 1}" for kind in ("curvature", "stretch") for k in range(count)]
        return ("hub_angle", *strains, "hub_speed", *(f"{name}_rate" for name in strains))

    def critical_speed(self) -> float:
        """Hub speed at which the axial stiffness is lost and a straight beam has no steady rotation, rad/s."""
        return critical_speed(self.basis)

    def steady_state(self, hub_speed: float = 0.0) -> Array:
        """State of the straight, stretched beam that turns steadily, the hub angle 0.

        Parameters
        ----------
        hub_speed : float
            Speed, rad/s, below the critical one.

        Returns
        -------
        ndarray
            In the order of ``state_names``; may be given to :meth:`simulate`.
        """
        self._check_speed(hub_speed)
        rates = np.zeros(self.basis.coordinates)
        rates[0] = hub_speed
        return np.concatenate([steady_rotation(self.basis, hub_speed), rates])

    def shape(self, states: ArrayLike) -> Array:
        """Where the beam is, in fixed axes.

        Parameters
        ----------
        states : array_like, k x n
            As ``SimulationResult.states``.

        Returns
        -------
        ndarray, k x m
            Positions x + i y from the clamp through the Gauss points to the free end, m.
        """
        q = np.atleast_2d(np.asarray(states, dtype=float))[:, : self.basis.coordinates]
        return self.dynamics.positions(q)

    def frequencies_hz(self, hub_speed: float = 0.0, coupled: bool = False) -> Array:
        """Undamped frequencies of small motion about steady rotation, the hub's motion prescribed.

        Parameters
        ----------
        hub_speed : float
            Speed, rad/s, below the critical one.
        coupled : bool
            False: bending alone, on the stretched beam. True: bending and stretching with the Coriolis terms.

        Returns
        -------
        ndarray
            Ascending, Hz; those of the highest modes have not converged.
        """
        self._check_speed(hub_speed)
        frequencies = coupled_frequencies if coupled else transverse_frequencies
        return frequencies(self.dynamics, hub_speed) / (2.0 * np.pi)

    def simulate(
        self,
        manoeuvre: PrescribedMotion | TorqueDriven,
        timepts: ArrayLike,
        initial: ArrayLike | None = None,
        rtol: float = 1e-8,
        atol: float = 1e-10,
    ) -> SimulationResult:
        """Motion from t = 0 under a manoeuvre.

        Parameters
        ----------
        manoeuvre : PrescribedMotion or TorqueDriven
            What is done to the hub.
        timepts : array_like, k
            Instants of the output, ascending, >= 0, s.
        initial : array_like, optional
            State at t = 0 in the order of ``state_names``; None is the undeformed beam at rest on the hub. With the
            hub's motion prescribed its hub angle and speed are to be those of the manoeuvre.
        rtol, atol : float
            Tolerance of tip displacement and of the hub angle times the radius of the tip over the run, relative to the
            largest tip displacement, and absolute, m.

        Returns
        -------
        SimulationResult
            ``axial_tip_displacement`` is the integral of the stretch.

        Raises
        ------
        TypeError, ValueError
            Of a bad argument, one line.
        SimulationError
            If the tolerance could not be reached.
        """
        times = time_points(timepts)
        tolerance = positive("rtol", rtol), positive("atol", atol)
        drive = _drive(manoeuvre)
        motion = run_to_tolerance(
            self.dynamics,
            drive,
            manoeuvre.breakpoints,
            times,
            self._start(drive, initial),
            self._first_step(),
            tolerance,
        )
        return self._result(manoeuvre, times, motion)

    def simulate_torque(
        self,
        function: Callable[..., object],
        timepts: ArrayLike,
        breakpoints: tuple[float, ...] = (),
        initial: ArrayLike | None = None,
        rtol: float = 1e-8,
        atol: float = 1e-10,
    ) -> SimulationResult:
        """Motion under a torque [N m] that is a function of time [s]; see :meth:`simulate`."""
        return self.simulate(Torque(function, breakpoints), timepts, initial, rtol, atol)

    def _start(self, drive: Drive, initial: ArrayLike | None) -> tuple[Array, Array]:
        """Coordinates and velocities at t = 0."""
        size = self.basis.coordinates
        state = np.zeros(2 * size) if initial is None else state_vector(initial, 2 * size)
        for index, name, prescribed in ((0, "angle", drive.angle), (size, "speed", drive.speed)):
            if prescribed is not None:
                wanted = float(prescribed(np.zeros(1))[0])
                if initial is not None and abs(state[index] - wanted) > 1e-12 * max(1.0, abs(wanted)):
                    raise ValueError(
                        f"initial hub {name} = {state[index]:g}: expected {wanted:g}, as the manoeuvre has it"
                    )
                state[index] = wanted
        return state[:size], state[size:]

    def _first_step(self) -> float:
        """A quarter of the second bending period, or a sixteenth of the first, s."""
        frequencies = self.frequencies_hz()
        return 0.25 / frequencies[1] if frequencies.size > 1 else 0.0625 / frequencies[0]

    def _check_speed(self, hub_speed: float) -> None:
        critical = self.critical_speed()
        if abs(real("hub_speed", hub_speed)) >= critical:
            raise ValueError(
                f"hub_speed = {hub_speed!r}: expected less than {critical:.6g} rad/s, where axial stiffness is lost"
            )

    def _result(self, manoeuvre: PrescribedMotion | TorqueDriven, times: Array, motion: Motion) -> SimulationResult:
        until = small_deformation_until(motion.watched, motion.watched_tip, self.parameters.length, motion.watched_rate)
        tip = np.imag(self.dynamics.tip(motion.q))
        later = partial(self._details, manoeuvre, times, motion.q, motion.v)
        return SimulationResult(self.model, times, tip, until, motion.error_estimate, motion.steps, later)

    def _details(self, manoeuvre: PrescribedMotion | TorqueDriven, times: Array, q: Array, v: Array) -> Details:
        dynamics = self.dynamics
        acceleration, torque, margin = _accelerations(dynamics, manoeuvre, times, q, v)
        extension = dynamics.extension(q)
        return Details(
            axial_tip_displacement=extension,
            foreshortening=np.real(dynamics.tip(q)) - np.sum(self.basis.tip_row) - extension,
            hub_angle=q[:, 0],
            hub_speed=v[:, 0],
            hub_acceleration=acceleration[:, 0],
            torque=torque,
            inertia_torque=-dynamics.convective_force(q, v)[:, 0],
            energy=dynamics.energy(q, v),
            angular_momentum=dynamics.momentum_and_force(q, v)[0][:, 0],
            mass_matrix_margin=margin,
            states=np.hstack([q, v]),
        )

    def linearize(self, hub_speed: float = 0.0) -> "control.StateSpace":
        """Small motion about steady rotation, the hub free.

        Parameters
        ----------
        hub_speed : float
            Speed of the steady rotation, rad/s, below the critical one.

        Returns
        -------
        control.StateSpace
            Input ``torque``; outputs ``hub_angle``, ``hub_speed`` and ``tip_displacement``, all as deviations.
        """
        from boomctl.lti.python_control import control

        state = self.steady_state(hub_speed)
        mass, gyroscopic, stiffness = small_motion(self.dynamics, hub_speed)
        size = self.basis.coordinates
        free = np.zeros((size, 1))
        free[0] = 1.0
        solved = np.linalg.solve(mass, np.hstack([-stiffness, -gyroscopic, free]))
        a = np.vstack([np.hstack([np.zeros((size, size)), np.eye(size)]), solved[:, :-1]])
        c = np.zeros((3, 2 * size))
        c[0, 0] = c[1, size] = 1.0
        c[2, :size] = np.imag(self.dynamics.tip_row(state[:size]))
        return control.StateSpace(
            a,
            np.vstack([np.zeros((size, 1)), solved[:, -1:]]),
            c,
            np.zeros((3, 1)),
            inputs=["torque"],
            outputs=["hub_angle", "hub_speed", "tip_displacement"],
            states=list(self.state_names),
            name="hub_beam_geometrically_exact",
        )

    def to_nlsys(self) -> "control.NonlinearIOSystem":
        """The beam on a free hub as a nonlinear input/output system.

        Returns
        -------
        control.NonlinearIOSystem
            Input ``torque``; outputs ``hub_angle``, ``hub_speed`` and ``tip_displacement``. Axial motion
            makes it stiff: give ``control.input_output_response`` an implicit ``solve_ivp_method``.
        """
        from boomctl.lti.python_control import control

        return control.nlsys(
            self._rates,
            self._outputs,
            inputs=["torque"],
            outputs=["hub_angle", "hub_speed", "tip_displacement"],
            states=list(self.state_names),
            name="hub_beam_geometrically_exact",
        )

    def _rates(self, t: float, x: Array, u: Array, params: dict[str, object]) -> Array:
        size = self.basis.coordinates
        return np.concatenate([x[size:], self.dynamics.acceleration(x[:size], x[size:], float(np.ravel(u)[0]))])

    def _outputs(self, t: float, x: Array, u: Array, params: dict[str, object]) -> Array:
        size = self.basis.coordinates
        return np.array([x[0], x[size], np.imag(self.dynamics.tip(x[:size]))])


def _drive(manoeuvre: PrescribedMotion | TorqueDriven) -> Drive:
    if isinstance(manoeuvre, TorqueDriven):
        return Drive(torque=manoeuvre.torque)
    if isinstance(manoeuvre, PrescribedMotion):
        return Drive(angle=manoeuvre.angle, speed=manoeuvre.speed)
    raise TypeError(f"manoeuvre = {manoeuvre!r}: expected spin_up, hold, hub_profile, sine_torque, torque or free")


def _accelerations(
    dynamics: ExactBeamDynamics,
    manoeuvre: PrescribedMotion | TorqueDriven,
    times: Array,
    q: Array,
    v: Array,
) -> tuple[Array, Array, Array]:
    """Accelerations of the coordinates, torque on the hub, and margin of the mass matrix."""
    force = -dynamics.convective_force(q, v)
    inner = force - dynamics.basis.stiffness * q
    if dynamics.damping is not None:
        inner -= v @ dynamics.damping
    acceleration, margin = np.empty_like(q), np.empty(len(times))
    free = isinstance(manoeuvre, TorqueDriven)
    given = np.asarray(
        manoeuvre.torque(times) if isinstance(manoeuvre, TorqueDriven) else manoeuvre.acceleration(times)
    )
    torque = given.copy()
    for part in np.array_split(np.arange(len(times)), len(times) // 500 + 1):
        mass = dynamics.mass_matrix(q[part])
        column = mass[:, 1:, :1]
        solved = np.linalg.solve(mass[:, 1:, 1:], np.concatenate([column, inner[part, 1:, None]], axis=2))
        margin[part] = mass[:, 0, 0] - np.sum(column * solved[:, :, :1], axis=(1, 2))
        pull = np.sum(column * solved[:, :, 1:], axis=(1, 2))
        hub = (given[part] + inner[part, 0] - pull) / margin[part] if free else given[part]
        acceleration[part, 0] = hub
        acceleration[part, 1:] = solved[:, :, 1] - solved[:, :, 0] * hub[:, None]
        if not free:
            torque[part] = margin[part] * hub + pull - force[part, 0]
    return acceleration, torque, margin
