"""The hub-beam with assumed modes: the models of Bai et al. (2009), from the linear one to the complete one."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache, partial
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any, final

import numpy as np
from numpy.typing import ArrayLike

from boomctl.arrays import Array
from boomctl.checks import finite_array
from boomctl.maneuvers import Maneuver, TorqueDriven
from boomctl.rotating_beam.beam import MODELS, HubBeam, SmallMotion, lowest_rate, natural_hz
from boomctl.rotating_beam.exact.beam import GeometricallyExactBeam
from boomctl.rotating_beam.modal import energy
from boomctl.rotating_beam.modal.cfoam import cfoam
from boomctl.rotating_beam.modal.equations import Equations, block_diagonal
from boomctl.rotating_beam.modal.first_order import FirstOrderEquations, foam, sfoam, tlam, without_axial_modes
from boomctl.rotating_beam.modal.integrals import MassPoints, ModalIntegrals, mass_points, modal_integrals
from boomctl.rotating_beam.modal.shapes import axial_modes, transverse_modes
from boomctl.rotating_beam.motion.run import motion_of
from boomctl.rotating_beam.motion.simulation import Simulation
from boomctl.rotating_beam.parameters import HubBeamParameters
from boomctl.rotating_beam.result import CHUNK, Details, Dynamics, Motion
from boomctl.rotating_beam.selection import ModelChoice
from boomctl.symbolic import Places, lifted, symbols
from boomctl.threads import one_blas_thread

if TYPE_CHECKING:
    import casadi

    from boomctl.lti.machine_modes import MachineModes
    from boomctl.rotating_beam.sensors import BeamSensor
    from boomctl.structure.families import PolynomialFamily
    from boomctl.structure.model import SecondOrderModel

ASSUMED_MODES = ("tlam", "sfoam", "sfoam-consistent", "foam", "cfoam")

_MOST_MODES = 200  # the modal integrals are known to keep 1e-12 relative up to there
_MOST_MODES_CFOAM = 60  # its sums over points of mass take n^3 numbers, 0.8 million there
_POINTS = 41  # Points along the beam at which its deformed shape is evaluated.


@final
@dataclass(frozen=True, repr=False)
class AssumedModesBeam(HubBeam):
    """A hub-beam in an assumed-modes model.

    Attributes
    ----------
    parameters : HubBeamParameters
        The machine.
    model : str
        "tlam", "sfoam", "sfoam-consistent", "foam" or "cfoam"; see `hub_beam`.
    modes : int
        Number n of transverse modes, and of axial modes if the model has them; at most 200, for CFOAM 60.
    selection : record, optional
        Result of the selection by accuracy in a maneuver, with the tested candidates: see `hub_beam`.
    """

    parameters: HubBeamParameters
    model: str
    modes: int
    selection: ModelChoice | None = field(default=None, compare=False)
    _stretches: bool = True  # Whether axial modes move where the model has them.

    def __post_init__(self) -> None:
        if self.model not in ASSUMED_MODES:
            raise ValueError(f"model = {self.model!r}: expected one of {', '.join(ASSUMED_MODES)}")
        super().__post_init__()

    @property
    def max_modes(self) -> int:
        return _MOST_MODES_CFOAM if self.model == "cfoam" else _MOST_MODES

    @cached_property
    def _integrals(self) -> ModalIntegrals:
        """Modal integrals of beam and point mass."""
        return modal_integrals(self.parameters, self.modes)

    @cached_property
    def _points(self) -> MassPoints:
        points = mass_points(self.parameters, self.modes)
        return points if self._stretches else replace(points, f1=points.f1[:, :0])

    @cached_property
    def equations(self) -> Equations:
        """Equations of motion in closed form."""
        m = self._integrals
        if self.model == "cfoam":
            return cfoam(m, self._points, self.parameters.hub_inertia)
        if self.model in ("sfoam", "sfoam-consistent"):
            return sfoam(m, consistent=self.model == "sfoam-consistent")
        whole = tlam(m) if self.model == "tlam" else foam(m)
        return whole if self._stretches else without_axial_modes(whole)

    @property
    def has_axial_modes(self) -> bool:
        return self.model not in ("sfoam", "sfoam-consistent") and self._stretches

    def _without_axial_modes(self) -> AssumedModesBeam:
        """Return the model of a beam that does not stretch."""
        return replace(self, _stretches=False) if self.has_axial_modes else self

    @property
    def state_labels(self) -> tuple[str, ...]:
        axial = [f"axial_{i + 1}" for i in range(self.modes)] if self.has_axial_modes else []
        beam = axial + [f"transverse_{i + 1}" for i in range(self.modes)]
        return ("hub_angle", *beam, "hub_speed", *(f"{name}_rate" for name in beam))

    @one_blas_thread
    def divergence_speed(self) -> float:
        if self.model == "tlam":
            return lowest_rate(self._integrals.M2, self._integrals.K2)
        return self.max_steady_speed

    @cached_property
    @one_blas_thread
    def max_steady_speed(self) -> float:
        return lowest_rate(self._integrals.M1, self._integrals.K1) if self.has_axial_modes else math.inf

    def residual_energy(self, state: ArrayLike, hub_speed: float = 0.0) -> float:
        """Return the energy of a state's deviation from steady rotation, independent of the hub angle.

        It is ``1/2 r^T M r + 1/2 q^T K q`` with the differences r of the rates and q of the beam's coordinates.

        Parameters
        ----------
        state : (n,) array_like
            In the order of `state_labels`.
        hub_speed : float
            Hub speed of the steady rotation [rad/s].

        Returns
        -------
        float
            Energy [J].

        Raises
        ------
        TypeError, ValueError
            If a value is not finite, there are not as many values as states, or there is no steady rotation at this speed.
        """
        equations, size = self.equations, self._size
        x = finite_array("state", state, ndim=1)
        if len(x) != 2 * size:
            raise ValueError(f"state: expected {2 * size} numbers, got {len(x)}")
        deviation = x - self.steady_state(hub_speed)
        rate, q = deviation[None, size:], deviation[1:size]
        momenta = equations.inertia(x[None, :size]).momenta(rate)
        return float(0.5 * np.sum(momenta * rate) + 0.5 * q @ equations.K @ q)

    @one_blas_thread
    def family(
        self,
        hub_speed: tuple[float, float] | float = 0.0,
        tip_mass: tuple[float, float] | None = None,
        sensors: Sequence[BeamSensor] = (),
        **ranges: tuple[float, float],
    ) -> PolynomialFamily:
        """Return the linear models about steady rotation over ranges of hub speed, tip mass and other parameters.

        Parameters
        ----------
        hub_speed : (float, float) or float
            Minimum and maximum hub speed [rad/s], or a single speed.
        tip_mass : (float, float), optional
            Minimum and maximum point mass [kg]; by default the mass of the parameters.
        sensors : sequence of BeamSensor
            Further outputs; none of acceleration.
        **ranges : (float, float)
            Minimum and maximum of any other parameter of the beam, by name.

        Returns
        -------
        PolynomialFamily
            Family over ``"hub_speed"``, ``"tip_mass"`` and the named parameters, with inputs and outputs as in
            `simulate_loop` except ``"tip_acceleration"``, and the states by name; for example for
            :func:`boomctl.robust_stability`.  Proofs omit the hub angle, an integrator, if the controller does not read it.

        Raises
        ------
        TypeError, ValueError
            If a range is not two ascending numbers, there is none, there is no steady rotation at a speed, or a
            sensor measures acceleration.

        Examples
        --------
        >>> import boomctl as bc
        >>> import control
        >>> family = bc.hub_beam(model="sfoam", modes=3).family(hub_speed=(0.0, 6.0), tip_mass=(0.0, 0.1))
        >>> signals = {"inputs": ["hub_angle", "hub_speed"], "outputs": "torque"}
        >>> pd = control.ss([], [], [], [[-150.0, -250.0]], **signals)
        >>> bc.robust_stability(family, pd).proved
        True
        """
        from boomctl.rotating_beam.families import hub_beam_family  # which a simulation does not need

        return hub_beam_family(
            self, hub_speed, sensors, {**({} if tip_mass is None else {"tip_mass": tip_mass}), **ranges}
        )

    @one_blas_thread
    def to_second_order(self, hub_speed: float = 0.0, sensors: Sequence[BeamSensor] = ()) -> SecondOrderModel:
        """Return the linear model about steady rotation as a structure, to which drives and friction may be added.

        Parameters
        ----------
        hub_speed : float
            Hub speed [rad/s].
        sensors : sequence of BeamSensor
            Further outputs; none of acceleration.

        Returns
        -------
        SecondOrderModel
            Signals as of `family`.

        Raises
        ------
        TypeError, ValueError
            A speed at which there is no steady rotation; a sensor of acceleration.

        Examples
        --------
        >>> import boomctl as bc
        >>> bc.hub_beam(model="sfoam", modes=2).to_second_order().input_labels
        ('torque', 'disturbance_torque', 'tip_force')
        """
        from boomctl.rotating_beam.families import read_by, structure_of  # as above

        return structure_of(self, self._speed_below(hub_speed, self.max_steady_speed), read_by(self, sensors))

    @property
    def _root_moment_row(self) -> Array:
        """Row that reads the bending moment ``EI v''(0)`` at the clamp [N m] off a state."""
        p, size, n = self.parameters, self._size, self.modes
        row = np.zeros(2 * size)
        row[size - n : size] = p.bending_stiffness * transverse_modes(n, p.length)(0.0, 2)
        return row

    def deformed_shape(self, states: ArrayLike) -> Array:
        p, size, n = self.parameters, self._size, self.modes
        y = self._states(states)[:, :size]
        x = np.linspace(0.0, p.length, _POINTS)
        bending, shapes = y[:, size - n :], transverse_modes(n, p.length)
        across = bending @ shapes(x).T
        along = np.broadcast_to(x, across.shape).copy()
        if self.model != "tlam":
            along -= 0.5 * np.einsum("ki,pij,kj->kp", bending, shapes.shortening(x), bending)
        if self.has_axial_modes:
            along += y[:, 1 : n + 1] @ axial_modes(n, p.length)(x).T
        return (p.hub_radius + along + 1j * across) * np.exp(1j * y[:, :1])

    @cached_property
    def _lagrangian(self) -> energy.Lagrangian:
        """Energies and damping, from which CasADi derives the equations of motion."""
        m, axial = self._integrals, self.has_axial_modes
        stiffness, damping = (block_diagonal(m.K1, m.K2), block_diagonal(m.C1, m.C2)) if axial else (m.K2, m.C2)
        if self.model == "cfoam":
            kinetic = partial(energy.complete_energy, self._points, self.parameters.hub_inertia)
            return energy.Lagrangian(kinetic, stiffness, damping, self.equations.tip.transverse, True)
        return _lagrangian(self.model, m, stiffness, damping, self.equations.tip.transverse, axial)

    def to_casadi(self) -> casadi.Function:
        """Return the model as a CasADi function ``(x, torque) -> (xdot, y)``, derived from its energies.

        States and outputs as in `to_nlsys`; symbolic, hence differentiable to any order.

        Returns
        -------
        casadi.Function
            From state and torque [N m] to the state's rate and the outputs.
        """
        import casadi as ca

        function, constants = self._casadi_equations()
        x, torque = ca.SX.sym("x", 2 * self._size), ca.SX.sym("torque")
        names = ["x", "torque"], ["xdot", "y"]
        return ca.Function(self._system_name, [x, torque], function.call([x, torque, constants]), *names)

    def _casadi_equations(self) -> tuple[casadi.Function, Array]:
        """Return a CasADi function ``(x, torque, constants) -> (xdot, y)`` and this model's constants.

        Models that differ only in their constants share the function, and with it everything built on it; except CFOAM,
        whose function contains its constants.
        """
        if self.model == "cfoam":
            return energy.state_function(self._lagrangian, "equations"), np.zeros(0)
        m, lagrangian = self._integrals, self._lagrangian
        names = ("inertia", "M1", "V1", "R", "M2", "V2", "D") if self.has_axial_modes else ("inertia", "M2", "V2", "D")
        arguments: tuple[Any, ...] = (
            *(getattr(m, name) for name in names),
            lagrangian.stiffness,
            lagrangian.damping,
            lagrangian.tip,
        )
        patterns, constants = lifted(arguments)
        return _equations(self.model, names, patterns), constants

    def _built_modes(self, sensors: tuple[BeamSensor, ...]) -> MachineModes:
        from boomctl.rotating_beam.modal import forced  # which only a loop needs

        p, equations = self.parameters, self.equations
        point_at = forced.shape_points(p, self.modes, axial=self.has_axial_modes, shortening=self.model != "tlam")
        closed = isinstance(equations, FirstOrderEquations)
        law = (
            forced.first_order_law(equations) if closed else forced.lagrangian_law(self._lagrangian, point_at, p.length)
        )
        return forced.forced_modes(self._small_motion(0.0), law, point_at, p, self.state_labels, sensors)

    @property
    def _size(self) -> int:
        return self.equations.size

    def _transverse_hz(self, speed: float) -> Array:
        m = self._integrals
        softening = m.M2 if self.model == "tlam" else m.M2 - m.D
        return natural_hz(m.M2, m.K2 - speed**2 * softening)

    def _steady_coordinates(self, speed: float) -> Array:
        return _steady(self, speed)[0]

    def _small_motion(self, speed: float) -> SmallMotion:
        mass, damping, stiffness = (item[0] for item in _steady(self, speed)[1])
        return SmallMotion(mass, damping, stiffness, np.append(0.0, self.equations.tip.transverse))

    def _state_derivative(self, x: Array, torque: float) -> Array:
        return self.equations.state_derivative(x, torque)

    def _tip_displacement(self, y: Array) -> float:
        return float(self.equations.tip.transverse @ y[1:])

    def _motion(
        self, maneuver: Maneuver, timepts: Array, start: tuple[Array, Array], tolerance: tuple[float, float]
    ) -> Motion:
        length, (rtol, atol) = self.parameters.length, tolerance
        radius = self.parameters.hub_radius + length
        return motion_of(Simulation(self.equations, maneuver, timepts, start, rtol, atol, length, radius))

    def _details(self, maneuver: Maneuver, timepts: Array, motion: Motion) -> Details:
        y, rate = motion.states()
        q, tip = y[:, 1:], self.equations.tip
        return Details(
            tip_extension=q @ tip.axial,
            foreshortening=-0.5 * np.sum((q @ tip.shortening) * q, axis=1),
            hub_angle=y[:, 0],
            hub_speed=rate[:, 0],
            states=np.hstack([y, rate]),
            dynamics=partial(_dynamics, self.equations, maneuver, timepts, y, rate),
        )


@lru_cache(maxsize=16)  # pairs of beam and speed that are evaluated repeatedly
def _steady(beam: AssumedModesBeam, speed: float) -> tuple[Array, tuple[Array, Array, Array]]:
    """Beam coordinates at which the beam is at rest in the hub's frame, and the equations' derivatives there.

    The beam is straight then, so that its equations are linear in its coordinates; the derivatives are those with
    respect to accelerations, rates and coordinates, 1 x N x N each.
    """
    equations = beam.equations
    y, rate, none = (np.zeros((1, equations.size)) for _ in range(3))
    rate[0, 0] = speed
    stiffness = equations.tangents(y, rate, none).stiffness[0, 1:, 1:]
    y[0, 1:] = -np.linalg.solve(stiffness, equations.residual(y, rate, none)[0, 1:])
    return y[0, 1:], equations.tangents(y, rate, none)


MODELS.update({name: partial(AssumedModesBeam, model=name) for name in ASSUMED_MODES})
# here, so that each of these beams knows it, from wherever it comes
MODELS["geometrically-exact"] = GeometricallyExactBeam


def _dynamics(equations: Equations, maneuver: Maneuver, timepts: Array, y: Array, rate: Array) -> Dynamics:
    """Evaluate forces and inertias of a motion, a chunk of times at once."""
    parts = [
        _part(equations, maneuver, timepts[at], y[at], rate[at])
        for at in (slice(first, first + CHUNK) for first in range(0, timepts.size, CHUNK))
    ]
    return Dynamics(*(np.concatenate(item) for item in zip(*parts, strict=True)))


def _part(equations: Equations, maneuver: Maneuver, timepts: Array, y: Array, rate: Array) -> Dynamics:
    inertia = equations.inertia(y)
    free = -equations.residual(y, rate, np.zeros_like(y))
    if isinstance(maneuver, TorqueDriven):
        torque = maneuver.torque(timepts)
        free[:, 0] += torque
        loose = free[:, 0] - np.sum(inertia.coupling * inertia.solve_beam(free[:, 1:]), axis=1)
        turning = loose / inertia.margin()
    else:
        turning = maneuver.acceleration(timepts)
        bending = inertia.solve_beam(free[:, 1:] - inertia.coupling * turning[:, None])
        torque = inertia.hub * turning + np.sum(inertia.coupling * bending, axis=1) - free[:, 0]
    momenta = inertia.momenta(rate)
    q = y[:, 1:]
    total = 0.5 * np.sum(momenta * rate, axis=1) + 0.5 * np.sum((q @ equations.K) * q, axis=1)
    return Dynamics(turning, torque, equations.inertia_torque(y, rate), total, momenta[:, 0], inertia.margin())


def _lagrangian(model: str, integrals: Any, stiffness: Any, damping: Any, tip: Any, axial: bool) -> energy.Lagrangian:
    """Energies of a first-order model, from numbers or symbols."""
    kinetic = partial(energy.first_order_energy, integrals, stiffening=model != "tlam", axial=axial)
    return energy.Lagrangian(kinetic, stiffness, damping, tip, model != "sfoam")


@lru_cache(maxsize=32)  # structures: each model with a few numbers of modes
def _equations(model: str, names: tuple[str, ...], patterns: tuple[Places, ...]) -> casadi.Function:
    """Return the equations of all beams whose matrices have the same nonzero pattern."""
    vector, matrices = symbols(patterns)
    integrals = SimpleNamespace(**dict(zip(names, matrices, strict=False)))
    stiffness, damping, tip = matrices[len(names) :]
    lagrangian = _lagrangian(model, integrals, stiffness, damping, tip, "M1" in names)
    return energy.state_function(lagrangian, "equations", vector)
