"""The rotating hub-beam in one of the models of Bai et al. (2009), and the factory for all of them."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, partial
from typing import TYPE_CHECKING, Literal, overload

import numpy as np
from numpy.typing import ArrayLike

from boomctl.arrays import Array
from boomctl.checks import positive, real
from boomctl.rotating_beam import slewing
from boomctl.rotating_beam.evaluation import details
from boomctl.rotating_beam.manoeuvres import (
    Free,
    Hold,
    HubProfile,
    PrescribedMotion,
    SineTorque,
    SpinUp,
    Torque,
    TorqueDriven,
)
from boomctl.rotating_beam.modal import frequencies, linearization
from boomctl.rotating_beam.modal.cfoam import cfoam
from boomctl.rotating_beam.modal.equations import Equations
from boomctl.rotating_beam.modal.foam import foam
from boomctl.rotating_beam.modal.integrals import ModalIntegrals, mass_points, modal_integrals
from boomctl.rotating_beam.modal.sfoam import sfoam
from boomctl.rotating_beam.modal.tlam import tlam
from boomctl.rotating_beam.motion.run import prescribed_motion, torque_driven_motion, watched_instants
from boomctl.rotating_beam.parameters import HubBeamParameters, described
from boomctl.rotating_beam.result import SimulationResult, small_deformation_until
from boomctl.rotating_beam.validation import mode_count, state_vector, time_points

if TYPE_CHECKING:
    import casadi
    import control

    from boomctl.rotating_beam.exact.beam import GeometricallyExactBeam

EXACT = "geometrically-exact"
_MAX_MODES_CFOAM = 60


@dataclass(frozen=True)
class HubBeam:
    """A hub-beam in an assumed-modes model.

    Attributes
    ----------
    parameters : HubBeamParameters
    model : str
        "tlam", "sfoam", "sfoam-consistent", "foam" or "cfoam".
    modes : int
        Number n of transverse modes, and of axial ones where the model has them; up to 200, CFOAM up to 60.
    """

    parameters: HubBeamParameters
    model: str
    modes: int

    def __post_init__(self) -> None:
        if not isinstance(self.parameters, HubBeamParameters):
            raise TypeError(f"parameters = {self.parameters!r}: expected HubBeamParameters")
        if self.model not in _EQUATIONS:
            raise ValueError(f"model = {self.model!r}: expected one of {', '.join([*_EQUATIONS, EXACT])}")
        object.__setattr__(self, "modes", mode_count(self.modes))
        if self.model == "cfoam" and self.modes > _MAX_MODES_CFOAM:
            raise ValueError(f"modes = {self.modes}: expected 1 to {_MAX_MODES_CFOAM} for model 'cfoam'")

    def __repr__(self) -> str:
        return described("HubBeam", self.model, self.modes, self.state_names, self.parameters)

    @cached_property
    def integrals(self) -> ModalIntegrals:
        """Modal integrals of beam and point mass."""
        return modal_integrals(self.parameters, self.modes)

    @cached_property
    def equations(self) -> Equations:
        """Equations of motion in closed form."""
        return _EQUATIONS[self.model](self)

    @property
    def has_axial_modes(self) -> bool:
        """Whether the model has axial coordinates."""
        return self.model not in ("sfoam", "sfoam-consistent")

    @property
    def state_names(self) -> tuple[str, ...]:
        """Names of the states of `to_nlsys` and `linearize`: coordinates, hub angle first, then their rates."""
        axial = [f"axial_{i + 1}" for i in range(self.modes)] if self.has_axial_modes else []
        beam = axial + [f"transverse_{i + 1}" for i in range(self.modes)]
        return ("hub_angle", *beam, "hub_speed", *(f"{name}_rate" for name in beam))

    def frequencies_hz(self, hub_speed: float = 0.0, coupled: bool = False) -> Array:
        """Natural frequencies of the beam at a constant, prescribed hub speed.

        Parameters
        ----------
        hub_speed : float
            Hub speed w, rad/s.
        coupled : bool
            False: transverse modes alone, of ``K2 + w^2 (D - M2)`` (Eq. 31; TLAM without D). True: axial and transverse
            modes with their gyroscopic coupling, about the beam stretched by the rotation.

        Returns
        -------
        ndarray, n or 2 n
            Frequencies in Hz, ascending.

        Raises
        ------
        ValueError
            At a hub speed at which the stiffness is lost, or if `coupled` is asked of a model without axial modes.
        """
        speed = real("hub_speed", hub_speed)
        if coupled:
            if not self.has_axial_modes:
                raise ValueError(f"coupled = True: expected False, for model {self.model!r} has no axial modes")
            frequencies.check_speed(self.model, speed, self.critical_speed())
            return frequencies.coupled(self.equations, speed)
        if self.model == "tlam":
            frequencies.check_speed(self.model, speed, self.critical_speed())
            return frequencies.transverse(self.integrals, speed, stiffening=False)
        if self.has_axial_modes:
            frequencies.check_speed(self.model, speed, self.critical_speed())
        return frequencies.transverse(self.integrals, speed, stiffening=True)

    def critical_speed(self) -> float:
        """Hub speed at which some stiffness is first lost, rad/s.

        TLAM loses the transverse stiffness ``K2 - w^2 M2``, FOAM and CFOAM the axial one ``K1 - w^2 M1``; SFOAM loses
        none, for ``D >= M2``: `math.inf`.
        """
        if self.model == "tlam":
            return frequencies.lowest(self.integrals.M2, self.integrals.K2)
        if self.has_axial_modes:
            return frequencies.lowest(self.integrals.M1, self.integrals.K1)
        return math.inf

    def simulate(
        self,
        manoeuvre: PrescribedMotion | TorqueDriven,
        timepts: ArrayLike,
        initial: ArrayLike | None = None,
        rtol: float = 1e-8,
        atol: float = 1e-10,
    ) -> SimulationResult:
        """Simulate a manoeuvre from t = 0.

        Parameters
        ----------
        manoeuvre : PrescribedMotion or TorqueDriven
            As `spin_up`, `hub_profile`, `hold`, `sine_torque`, `torque` or `free` return it.
        timepts : array_like
            Instants at which the motion is wanted, s; ascending, >= 0. The motion starts at t = 0 in any case.
        initial : array_like or None
            State at t = 0 in the order of `state_names`; None is rest. With the hub's motion prescribed its hub angle
            and speed are to be those of the manoeuvre.
        rtol, atol : float
            The error of the free end's displacement is kept below ``atol + rtol max |displacement|`` [m]; that of the
            hub angle times the free end's radius likewise.

        Returns
        -------
        SimulationResult

        Raises
        ------
        TypeError
            If the manoeuvre is none.
        ValueError
            If `timepts`, `initial` or a tolerance is out of its range.
        SimulationError
            If the mass matrix ceases to be positive definite, the deflection overflows, or the tolerance is missed.
        """
        instants = time_points(timepts)
        tolerance = positive("rtol", rtol), positive("atol", atol)
        start = self._start(manoeuvre, initial)
        watched = watched_instants(self.equations, instants)
        if isinstance(manoeuvre, SpinUp | Hold | HubProfile):
            motion = prescribed_motion(self.equations, manoeuvre, watched, start, tolerance)
        else:
            reach = self.parameters.hub_radius + self.parameters.length
            motion = torque_driven_motion(self.equations, manoeuvre, watched, start, tolerance, reach)
        row, length = self.equations.tip.transverse, self.parameters.length
        tip, until = motion.displacement(row), math.inf
        if max(tip.max(), -tip.min()) > 0.1 * length:
            until = small_deformation_until(watched, tip, length, motion.rate[:, 1:] @ row)
        if watched is not instants:
            asked = np.searchsorted(watched, instants)
            motion, tip = motion.at(instants, asked), tip[asked]
        later = partial(details, self.equations, manoeuvre, instants, motion)
        return SimulationResult(self.model, instants, tip, until, motion.error, motion.steps, later)

    def simulate_torque(
        self,
        function: Callable[..., object],
        timepts: ArrayLike,
        breakpoints: tuple[float, ...] = (),
        initial: ArrayLike | None = None,
        rtol: float = 1e-8,
        atol: float = 1e-10,
    ) -> SimulationResult:
        """Simulate a torque [N m] that is a function of time [s]; see `torque` and `simulate`."""
        return self.simulate(Torque(function, breakpoints), timepts, initial, rtol, atol)

    def steady_state(self, hub_speed: float = 0.0) -> Array:
        """State, as `state_names`, of the beam that turns steadily at a hub speed [rad/s], the hub angle 0."""
        return slewing.steady_state(self, real("hub_speed", hub_speed))

    def residual_energy(self, state: ArrayLike, hub_speed: float = 0.0) -> float:
        """Energy of a state's deviation from steady rotation at a hub speed [rad/s], whatever the hub angle, J."""
        return slewing.residual_energy(self, state, real("hub_speed", hub_speed))

    @property
    def root_moment_row(self) -> Array:
        """Row that reads the bending moment at the clamp [N m] off a state in the order of `state_names`."""
        return slewing.root_moment_row(self)

    def shape(self, states: ArrayLike) -> Array:
        """Positions x + i y along the beam in fixed axes, from clamp to free end, for k states: k x 41, m."""
        return slewing.shape(self, states)

    def with_tip_mass(self, tip_mass: float) -> "HubBeam":
        """Return the same model with another tip mass [kg]."""
        return HubBeam(slewing.with_tip_mass(self.parameters, tip_mass), self.model, self.modes)

    def with_stiffness(self, factor: float) -> "HubBeam":
        """Return the same model with the bending stiffness multiplied by a factor."""
        return HubBeam(slewing.with_stiffness(self.parameters, factor), self.model, self.modes)

    def in_model(self, model: str, modes: int | None = None) -> "HubBeam | GeometricallyExactBeam":
        """Return the same machine in another model; `modes` as here unless given."""
        return hub_beam(self.parameters, model, self.modes if modes is None else modes)

    def to_nlsys(self) -> "control.NonlinearIOSystem":
        """Return the model as a nonlinear input-output system.

        Returns
        -------
        control.NonlinearIOSystem
            Input "torque" [N m]; outputs "hub_angle" [rad], "hub_speed" [rad/s], "tip_displacement" [m]; states as
            `state_names`.
        """
        return linearization.to_nlsys(self.model, self.equations, self.state_names)

    def linearize(self, hub_speed: float = 0.0) -> "control.StateSpace":
        """Linearise about steady rotation at a hub speed, the beam stretched as the model has it.

        Parameters
        ----------
        hub_speed : float
            Hub speed, rad/s.

        Returns
        -------
        control.StateSpace
            Signals and states as `to_nlsys`, as deviations from the steady rotation.

        Raises
        ------
        ValueError
            If `hub_speed` is not finite, or at least that at which the axial stiffness is lost.
        """
        return linearization.linearize(self, real("hub_speed", hub_speed))

    def lpv(self) -> linearization.HubSpeedFamily:
        """Return the linear models as a family over the hub speed."""
        return linearization.HubSpeedFamily(self)

    def casadi_function(self) -> "casadi.Function":
        """Return the model as a CasADi function ``(x, torque) -> (xdot, y)``, derived from its energies.

        States and outputs are those of `to_nlsys`; symbolic, hence differentiable to any order.
        """
        from boomctl.rotating_beam.modal.symbolic import state_function

        return state_function(self)

    def _start(self, manoeuvre: PrescribedMotion | TorqueDriven, initial: ArrayLike | None) -> tuple[Array, Array]:
        """Coordinates and rates at t = 0; the hub's only where they are free or given."""
        size = self.equations.size
        state = np.zeros(2 * size) if initial is None else state_vector(initial, 2 * size)
        if isinstance(manoeuvre, SpinUp | Hold | HubProfile):
            for index, name in ((0, "angle"), (size, "speed")) if initial is not None else ():
                given, prescribed = state[index], float(getattr(manoeuvre, name)(0.0))
                if abs(given - prescribed) > 1e-12 * max(1.0, abs(prescribed)):
                    raise ValueError(
                        f"initial hub {name} = {given:g}: expected {prescribed:g}, as the manoeuvre has it"
                    )
                state[index] = prescribed
        elif not isinstance(manoeuvre, SineTorque | Torque | Free):
            raise TypeError(f"manoeuvre = {manoeuvre!r}: expected one as spin_up, sine_torque, hold, ... return it")
        return state[:size], state[size:]


_EQUATIONS: dict[str, Callable[[HubBeam], Equations]] = {
    "tlam": lambda beam: tlam(beam.integrals),
    "sfoam": lambda beam: sfoam(beam.integrals),
    "sfoam-consistent": lambda beam: sfoam(beam.integrals, consistent=True),
    "foam": lambda beam: foam(beam.integrals),
    "cfoam": lambda beam: cfoam(beam.integrals, mass_points(beam.parameters, beam.modes), beam.parameters.hub_inertia),
}


@overload
def hub_beam(
    parameters: HubBeamParameters | None = None,
    model: Literal["tlam", "sfoam", "sfoam-consistent", "foam", "cfoam"] = "sfoam",
    modes: int = 5,
) -> HubBeam: ...
@overload
def hub_beam(
    parameters: HubBeamParameters | None = None, *, model: Literal["geometrically-exact"], modes: int = 5
) -> "GeometricallyExactBeam": ...
@overload
def hub_beam(
    parameters: HubBeamParameters | None = None, model: str = "sfoam", modes: int = 5
) -> "HubBeam | GeometricallyExactBeam": ...
def hub_beam(
    parameters: HubBeamParameters | None = None, model: str = "sfoam", modes: int = 5
) -> "HubBeam | GeometricallyExactBeam":
    """Return the hub-beam in a model.

    Parameters
    ----------
    parameters : HubBeamParameters or None
        None: Table 1 of Bai et al. (2009) without tip mass.
    model : str
        "tlam", "sfoam" (as printed, Eq. 40), "sfoam-consistent" (with ``Q_theta``: it conserves energy and angular
        momentum), "foam", "cfoam" or "geometrically-exact".
    modes : int
        Number of transverse modes and, where the model has them, of axial ones.

    Returns
    -------
    HubBeam or GeometricallyExactBeam

    Raises
    ------
    TypeError
        If `parameters` or `modes` is of another kind.
    ValueError
        If the model is unknown, or `modes` less than 1 or too many.
    """
    chosen = HubBeamParameters() if parameters is None else parameters
    if model != EXACT:
        return HubBeam(chosen, model, modes)
    if not isinstance(chosen, HubBeamParameters):
        raise TypeError(f"parameters = {parameters!r}: expected HubBeamParameters")
    from boomctl.rotating_beam.exact.beam import GeometricallyExactBeam

    return GeometricallyExactBeam(chosen, mode_count(modes))
