"""Common interface of all models of the hub-beam.

A model is a final subclass of :class:`HubBeam` in a separate file; ``assumed_modes`` registers all models in :data:`MODELS`.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import fields, replace
from functools import cached_property, lru_cache, partial
from textwrap import fill, indent
from typing import TYPE_CHECKING, Any, NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike

from boomctl.arrays import Array, blocks
from boomctl.checks import (
    FASTEST,
    exactly,
    finite_array,
    instance,
    positive,
    sequence,
    shown,
    truth,
    up_to,
    whole,
    within,
)
from boomctl.lti.rounding import ROOT, SUMMED
from boomctl.maneuvers import (
    HubProfile,
    Maneuver,
    PlannedSlew,
    PrescribedMotion,
    TorqueDriven,
)
from boomctl.printing import WIDTH, count, listed
from boomctl.progress import computing
from boomctl.rotating_beam.campbell import CampbellDiagram, campbell_diagram
from boomctl.rotating_beam.parameters import HubBeamParameters
from boomctl.rotating_beam.result import Details, Motion, SimulationResult
from boomctl.rotating_beam.selection import ModelChoice
from boomctl.rotating_beam.sensors import BeamSensor, checked_sensors
from boomctl.threads import one_blas_thread
from boomctl.units import warn_of_units

if TYPE_CHECKING:
    import control

    from boomctl.lti.machine_modes import MachineModes
    from boomctl.lti.system import Lti
    from boomctl.structure.response.mode_shapes import ModeShapes

INPUTS = ("torque",)
OUTPUTS = ("hub_angle", "hub_speed", "tip_displacement")
_LATEST = 1e9  # Longest motion [s]: 30 years.

_SHIFT = 1e-6  # Perturbation of coordinates, relative to the length, for mode shapes: its square is a rounding error.
_JUST_BELOW = 1.0 - 1e-6  # End of a diagram relative to the divergence speed, where a frequency is nearly 0.
_STEEP = 12  # Speeds added to a diagram just below its end.
_TOLERANCE = 1e-8, 1e-10  # Default rtol and atol [m] of a simulation.


class SmallMotion(NamedTuple):
    """Small motion ``mass y'' + damping y' + stiffness y = (torque, 0)`` about steady rotation.

    Attributes
    ----------
    mass, damping, stiffness : ndarray, N x N
        Over all coordinates, hub angle first; the damping has the gyroscopic terms too.
    tip : ndarray, N
        Row that reads the transverse displacement of the free end off the coordinates.
    """

    mass: Array
    damping: Array
    stiffness: Array
    tip: Array


class HubBeam(ABC):
    """A flexible beam on a hub, in one of its models.

    Attributes
    ----------
    parameters : HubBeamParameters
        The machine.
    model : str
        Name of the model, as in `hub_beam`.
    modes : int
        Number of shape functions, see `hub_beam`.
    selection : record or None
        Result of the selection by accuracy in a maneuver, with the tested candidates; None if the model was specified.

    Raises
    ------
    TypeError
        If `parameters` or `modes` has the wrong type.
    ValueError
        If `modes` is less than 1 or too many.

    Examples
    --------
    >>> import boomctl as bc
    >>> beam = bc.hub_beam(modes=2)
    >>> isinstance(beam, bc.rotating_beam.HubBeam), beam.model, beam.modes
    (True, 'sfoam', 2)
    >>> beam.eigenfrequencies_hz(hub_speed=2.0).round(4)
    array([0.4935, 3.0065])
    """

    parameters: HubBeamParameters
    model: str
    modes: int
    selection: ModelChoice | None

    def __post_init__(self) -> None:
        instance("parameters", self.parameters, HubBeamParameters)
        modes = whole("modes", self.modes)
        if modes > self.max_modes:
            raise ValueError(f"modes = {modes}: expected 1 to {self.max_modes} for model {self.model!r}")
        object.__setattr__(self, "modes", modes)

    def __repr__(self) -> str:
        values = ((field, getattr(self.parameters, field.name)) for field in fields(self.parameters))
        others = [f"{field.name} {value:.6g}" for field, value in values if value != field.default]
        chosen = "" if self.selection is None else "\n" + indent(fill(str(self.selection), WIDTH - 2), "  ")
        return (
            f"{type(self).__name__}: {self.model}, {count(self.modes, 'mode')}, {len(self.state_labels)} states\n"
            f"  torque -> hub_angle, hub_speed, tip_displacement\n"
            f"  Table 1, {listed(others) if others else 'no tip mass'}{chosen}"
        )

    @property
    @abstractmethod
    def max_modes(self) -> int:
        """Largest number of modes."""

    @property
    @abstractmethod
    def has_axial_modes(self) -> bool:
        """True if the model has axial coordinates."""

    @property
    @abstractmethod
    def state_labels(self) -> tuple[str, ...]:
        """Names of the states: coordinates, hub angle first, then their rates."""

    @abstractmethod
    def divergence_speed(self) -> float:
        """Return the hub speed at which a stiffness vanishes (divergence).

        For TLAM it is the transverse stiffness ``K2 - w^2 M2``, for FOAM, CFOAM and the geometrically exact beam the
        axial stiffness ``K1 - w^2 M1``. SFOAM has no such speed, because ``D >= M2``.

        Returns
        -------
        float
            Hub speed [rad/s]; `math.inf` if there is none.
        """

    @cached_property
    @abstractmethod
    def max_steady_speed(self) -> float:
        """Hub speed at which the axial stiffness is lost and a straight beam has no steady rotation, rad/s, or inf."""

    @one_blas_thread
    def eigenfrequencies_hz(self, hub_speed: float = 0.0, coupled: bool = False) -> Array:
        """Return the natural frequencies of the beam at a constant, prescribed hub speed.

        Parameters
        ----------
        hub_speed : float
            Hub speed w [rad/s], below the divergence speed.
        coupled : bool
            If False, transverse modes alone, for the assumed-modes models with the stiffness ``K2 + w^2 (D - M2)``
            (Eq. 31; TLAM without D). If True, axial and transverse modes with gyroscopic coupling.

        Returns
        -------
        ndarray
            Frequencies [Hz], ascending: one per transverse mode, and one per axial mode if `coupled`. The highest are not
            converged.

        Raises
        ------
        TypeError, ValueError
            If the stiffness is lost at the hub speed, `coupled` is True for a model without axial modes, or an argument
            has the wrong type.

        Warns
        -----
        BoomctlWarning
            If the frequencies suggest units other than SI: the lowest is below 1e-4 Hz and none is above 0.01 Hz, or
            the lowest is above 1e5 Hz.
        """
        if isinstance(hub_speed, (list, tuple, np.ndarray)):
            raise TypeError("hub_speed: expected one speed [rad/s]; .campbell(speeds) takes many")
        if truth("coupled", coupled) and not self.has_axial_modes:
            raise ValueError(f"coupled = True: expected False, for model {self.model!r} has no axial modes")
        speed = self._speed_below(hub_speed, self.divergence_speed())
        result = self._coupled_hz(speed) if coupled else self._transverse_hz(speed)
        warn_of_units(result)
        return result

    @one_blas_thread
    def mode_shapes(self, count: int = 3) -> ModeShapes:
        """Return the lowest undamped modes at rest with the hub fixed, and their shapes.

        Parameters
        ----------
        count : int
            Number of modes, from the lowest.

        Returns
        -------
        ModeShapes
            Frequencies, mass-normalized shapes over the beam's coordinates, with the kind of motion, bending or axial;
            ``.plot()`` draws the beam.

        Raises
        ------
        TypeError, ValueError
            If ``count`` is not a whole number up to the number of coordinates.
        """
        from scipy.linalg import eigh

        from boomctl.structure.response.mode_shapes import BodyShape, ModeShapes, signed

        small, size = self._small_motion(0.0), self._size
        wanted = whole("count", count, most=size - 1)
        M, K = (0.5 * (matrix + matrix.T)[1:, 1:] for matrix in (small.mass, small.stiffness))
        slowness, shapes = eigh(M, K)  # upside down: the slow modes keep their digits
        slowness, shapes = slowness[::-1][:wanted], shapes[:, ::-1][:, :wanted]
        shapes = signed(shapes / np.sqrt(slowness))
        rest = self.deformed_shape(np.zeros(2 * size))[0]
        states = np.zeros((wanted, 2 * size))
        states[:, 1:size] = _SHIFT * self.parameters.length * (shapes / np.abs(shapes).max(axis=0)).T
        moved = (self.deformed_shape(states) - self.deformed_shape(-states)) / (2.0 * _SHIFT * self.parameters.length)
        moved = moved * np.abs(shapes).max(axis=0)[:, None]
        kinds = ["bending" if sideways else "axial" for sideways in np.ptp(moved.imag, 1) > np.ptp(moved.real, 1)]
        points, displacement = np.stack([rest.real, rest.imag], 1), np.stack([moved.real, moved.imag], 2)
        return ModeShapes(
            1.0 / (2.0 * np.pi * np.sqrt(slowness)),
            shapes,
            self.state_labels[1:size],
            tuple(kinds),
            (BodyShape("beam", True, points, displacement),),
        )

    @one_blas_thread
    def campbell(
        self,
        speeds: ArrayLike,
        *,
        count: int = 3,
        orders: Sequence[float] = (1.0, 2.0, 3.0),
        coupled: bool = False,
    ) -> CampbellDiagram:
        """Return the natural frequencies over the hub speed, and the speeds at which a multiple of it equals a frequency.

        Parameters
        ----------
        speeds : array_like
            Hub speeds, ascending, from 0 on [rad/s]; speeds at which the stiffness is lost are replaced by speeds just
            below the divergence speed.
        count : int
            Number of frequencies, from the lowest; fewer if the model has fewer.
        orders : sequence of float
            Multiples of the hub speed, above zero.
        coupled : bool
            As for `eigenfrequencies_hz`.

        Returns
        -------
        CampbellDiagram
            ``.critical_speeds`` are the critical speeds, to rounding; ``.plot()`` draws the diagram.

        Raises
        ------
        TypeError, ValueError
            If the speeds do not ascend, are negative, or the stiffness is lost at all of them; as `eigenfrequencies_hz`.
        """
        requested = finite_array("speeds", speeds, ndim=1)
        if len(requested) < 2 or requested[0] < 0.0 or not (np.diff(requested) > 0.0).all():
            raise ValueError("speeds: expected two hub speeds or more, ascending, from 0 on [rad/s]")
        multiples = tuple(positive("orders", order) for order in sequence("orders", orders, "numbers"))
        most, lost = whole("count", count), self.divergence_speed()
        below = requested[requested < lost * _JUST_BELOW]
        if not len(below):
            raise ValueError(f"speeds: expected some below {up_to(lost)} rad/s, where {self.model} loses its stiffness")
        if len(below) < len(requested):
            steep = lost * np.sqrt(
                1.0 - np.linspace(0.0, 1.0, _STEEP + 1)[::-1] ** 2
            )  # a frequency falls as a circle does
            below = np.concatenate([below, steep[(steep > below[-1]) & (steep < lost)], [lost * _JUST_BELOW]])
        return campbell_diagram(
            self.model, lambda speed: self.eigenfrequencies_hz(speed, coupled)[:most], below, multiples, lost
        )

    @one_blas_thread
    def simulate(
        self,
        maneuver: Maneuver | PlannedSlew,
        timepts: ArrayLike | None = None,
        initial_state: ArrayLike | None = None,
        rtol: float | None = None,
        atol: float | None = None,
    ) -> SimulationResult:
        """Simulate a maneuver from t = 0.

        Parameters
        ----------
        maneuver : PrescribedMotion, TorqueDriven, SlewResult or TorqueProfile
            As `spin_up`, `sine_torque` or a function of `boomctl.maneuvers` returns it; or a planned slew, for this beam or
            another one, whose torque is applied, or its ``torque_profile``.
        timepts : array_like, optional
            Times at which the motion is returned, s; ascending, >= 0. The motion always starts at t = 0. By default the
            times of the slew.
        initial_state : array_like or None
            State at t = 0 in the order of `state_labels`; None is rest. If the hub's motion is prescribed, hub angle and
            speed must be equal to those of the maneuver.
        rtol, atol : float, optional
            Limit ``atol + rtol max |displacement|`` [m] on the error of the free end's displacement, and on the error of
            the hub angle times the free end's radius. By default 1e-8 and 1e-10 m; the tolerance of ``selection`` in its
            maneuver, from rest, if the model was selected by accuracy.

        Returns
        -------
        SimulationResult
            Motion of hub and beam at the requested times.

        Raises
        ------
        TypeError
            If `maneuver` is not a maneuver.
        ValueError
            If `timepts`, `initial_state` or a tolerance is out of its range, the functions of a hub profile are
            inconsistent, or a slew does not begin at rest and no `initial_state` is given.
        SimulationError
            If the mass matrix ceases to be positive definite, the deflection overflows, or the tolerance is not reached.
        """
        if timepts is None:
            timepts = getattr(maneuver, "time", None)
            if timepts is None:
                raise TypeError("timepts: expected times [s], got none")
        times = _checked_times(timepts)
        maneuver = _as_maneuver(maneuver, initial_state)
        tolerance = self._tolerance(maneuver, initial_state, rtol, atol)
        start = self._start(maneuver, initial_state)
        maneuver = _checked(maneuver, float(times[-1]))
        with computing("motion"):
            return self._result(maneuver, times, start, self._motion(maneuver, times, start, tolerance))

    @one_blas_thread
    def steady_state(self, hub_speed: float = 0.0) -> Array:
        """Return the state of the beam that turns steadily.

        Parameters
        ----------
        hub_speed : float
            Hub speed [rad/s].

        Returns
        -------
        ndarray
            In the order of `state_labels`; the hub angle is 0.

        Raises
        ------
        TypeError, ValueError
            If there is no steady rotation at that speed, or it is not a finite number.
        """
        speed = self._speed_below(hub_speed, self.max_steady_speed)
        size = self._size
        state = np.zeros(2 * size)
        state[1:size], state[size] = self._steady_coordinates(speed), speed
        return state

    @abstractmethod
    def deformed_shape(self, states: ArrayLike) -> Array:
        """Return the positions of points of the beam, in fixed axes.

        Parameters
        ----------
        states : (k, n) array_like
            States in the order of `state_labels`; one state, or one a row.

        Returns
        -------
        (k, points) complex ndarray
            Positions ``x + i y`` from the clamp to the free end [m].

        Raises
        ------
        TypeError, ValueError
            If ``states`` is not finite, or does not have as many numbers a row as there are states.
        """

    def _states(self, states: ArrayLike) -> Array:
        """Return states that a user passes, one a row."""
        rows = np.atleast_2d(finite_array("states", states))
        if rows.ndim != 2 or rows.shape[1] != 2 * self._size:
            raise ValueError(f"states: expected {2 * self._size} numbers a state, got shape {np.shape(states)}")
        return rows

    def with_tip_mass(self, tip_mass: float) -> Self:
        """Return the same model with another tip mass.

        Parameters
        ----------
        tip_mass : float
            The point mass [kg].

        Returns
        -------
        HubBeam
            Of the same class.

        Raises
        ------
        TypeError, ValueError
            If the value is not finite, or is negative.
        """
        return self._with(tip_mass=tip_mass)

    def with_stiffness_factor(self, factor: float) -> Self:
        """Return the same model with another bending stiffness; the axial stiffness stays.

        Parameters
        ----------
        factor : float
            By which the bending stiffness is multiplied.

        Returns
        -------
        HubBeam
            Of the same class.

        Raises
        ------
        TypeError, ValueError
            If the value is not a positive number.
        """
        return self._with(second_moment=positive("factor", factor) * self.parameters.second_moment)

    def with_model(self, model: str, modes: int | None = None) -> HubBeam:
        """Return the same machine in another model.

        Parameters
        ----------
        model : str
            Name of the model, as of `hub_beam`.
        modes : int or None
            Number of modes; None: as many as here.

        Returns
        -------
        HubBeam
            Of the class that the model needs.

        Raises
        ------
        TypeError, ValueError
            As of `hub_beam`.
        """
        return in_model(self.parameters, model, self.modes if modes is None else modes)

    def to_nlsys(self) -> control.NonlinearIOSystem:
        """Return the model as a nonlinear input-output system.

        Axial modes make it stiff: give ``control.input_output_response`` an implicit ``solve_ivp_method`` then.

        Returns
        -------
        control.NonlinearIOSystem
            Input "torque" [N m]; outputs "hub_angle" [rad], "hub_speed" [rad/s], "tip_displacement" [m]; states as
            `state_labels`.
        """
        from boomctl.lti.python_control import control

        names = {"inputs": list(INPUTS), "outputs": list(OUTPUTS), "states": list(self.state_labels)}
        return control.nlsys(self._update, self._output, **names, name=self._system_name)

    def _update(self, t: float, x: Array, u: Array, params: dict[str, object]) -> Array:
        return self._state_derivative(np.asarray(x, dtype=float), float(np.ravel(u)[0]))

    def _output(self, t: float, x: Array, u: Array, params: dict[str, object]) -> Array:
        x, size = np.asarray(x, dtype=float), self._size
        return np.array([x[0], x[size], self._tip_displacement(x[:size])])

    @one_blas_thread
    def linearize(self, hub_speed: float = 0.0, sensors: Sequence[BeamSensor] | None = None) -> control.StateSpace:
        """Linearize about steady rotation at a hub speed, with a free hub.

        Parameters
        ----------
        hub_speed : float
            Hub speed, rad/s.
        sensors : sequence of BeamSensor or None
            If None, the input is the torque, and the outputs are hub angle, hub speed and tip displacement. If a
            sequence, which may be empty, all inputs and outputs of the beam in `simulate_loop`, including these
            sensors.

        Returns
        -------
        control.StateSpace
            Signals and states as deviations from the steady rotation.

        Raises
        ------
        TypeError, ValueError
            If `hub_speed` is not a finite number, or is at or above the speed at which the axial stiffness vanishes.
        """
        if sensors is None:
            return self._linear(self._speed_below(hub_speed, self.max_steady_speed)).statespace(self._system_name)
        from boomctl.rotating_beam.modal.forced import linearized  # brings casadi

        state = self.steady_state(hub_speed)
        result = linearized(self._forced_modes(sequence("sensors", sensors, "BeamSensor")), state)
        return result.statespace(self._system_name)

    @property
    def _system_name(self) -> str:
        return f"hub_beam_{self.model.replace('-', '_')}"

    def _with(self, **changes: float) -> Self:
        copy: Any = self  # every model is a dataclass
        return replace(copy, parameters=replace(self.parameters, **changes), selection=None)

    def _tolerance(
        self, maneuver: Maneuver, initial: ArrayLike | None, rtol: float | None, atol: float | None
    ) -> tuple[float, float]:
        """Return the tolerance of the beam's selection in its maneuver, otherwise the default tolerance."""
        chosen, usual = self.selection, _TOLERANCE
        if chosen is not None and initial is None and maneuver == chosen.maneuver:
            usual = chosen.rtol, chosen.atol
        return (
            usual[0] if rtol is None else positive("rtol", rtol),
            usual[1] if atol is None else positive("atol", atol),
        )

    def _linear(self, speed: float) -> Lti:
        from boomctl.lti.system import Lti  # brings scipy.linalg, which a simulation may do without

        motion = self._small_motion(speed)
        size = motion.tip.size
        A, B, C = np.zeros((2 * size, 2 * size)), np.zeros((2 * size, 1)), np.zeros((3, 2 * size))
        A[:size, size:] = np.eye(size)
        A[size:, :size] = -np.linalg.solve(motion.mass, motion.stiffness)
        A[size:, size:] = -np.linalg.solve(motion.mass, motion.damping)
        B[size:, 0] = np.linalg.solve(motion.mass, np.eye(size)[:, 0])
        C[0, 0] = C[1, size] = 1.0
        C[2, :size] = motion.tip
        return Lti(
            A,
            B,
            C,
            np.zeros((3, 1)),
            input_labels=INPUTS,
            output_labels=OUTPUTS,
            state_labels=self.state_labels,
            scales={},
        )

    def _speed_below(self, hub_speed: float, critical: float) -> float:
        speed = within("hub_speed", hub_speed, -FASTEST, FASTEST, "rad/s")
        if abs(speed) >= critical:
            raise ValueError(
                f"hub_speed = {exactly(speed)}: expected less than {up_to(critical)} rad/s, where "
                f"{self.model} loses its stiffness"
            )
        return speed

    def _solved(self, maneuver: Maneuver, times: Array, tolerance: tuple[float, float]) -> Motion:
        """Motion from rest, with the error of its solver alone."""
        start = self._start(maneuver, None)
        return self._motion(_checked(maneuver, float(times[-1])), times, start, tolerance)

    def _result(self, maneuver: Maneuver, times: Array, start: tuple[Array, Array], motion: Motion) -> SimulationResult:
        return SimulationResult(
            model=self.model,
            time=times,
            tip_displacement=motion.tip,
            n_steps=motion.steps,
            _error=partial(self._error, maneuver, times, start, motion),
            _small_until=motion.small_deformation_until,
            details=partial(self._details, maneuver, times, motion),
            stages=motion.stages,
        )

    def _start(self, maneuver: Maneuver, initial: ArrayLike | None) -> tuple[Array, Array]:
        """Coordinates and rates at t = 0, the hub's as the maneuver has them."""
        instance("maneuver", maneuver, (PrescribedMotion, TorqueDriven), "a maneuver, such as spin_up(...)")
        size = self._size
        state = np.zeros(2 * size) if initial is None else _initial_state(initial, 2 * size)
        if isinstance(maneuver, PrescribedMotion):
            for index, name in ((0, "angle"), (size, "speed")):
                prescribed = float(getattr(maneuver, name)(0.0))
                difference = abs(state[index] - prescribed)
                # an initial hub angle or speed equals the maneuver's to rounding error, relative or in rad, rad/s
                if initial is not None and difference > SUMMED * max(1.0, abs(prescribed)):
                    raise ValueError(
                        f"initial hub {name} = {exactly(state[index])}: expected {exactly(prescribed)}, as "
                        f"the maneuver has it"
                    )
                state[index] = prescribed
        return state[:size], state[size:]

    @property
    @abstractmethod
    def _size(self) -> int:
        """Number of coordinates N."""

    @abstractmethod
    def _transverse_hz(self, speed: float) -> Array:
        """See `eigenfrequencies_hz`; the speed is known to be below the critical one."""

    def _coupled_hz(self, speed: float) -> Array:
        """Compute the frequencies of `_transverse_hz` over all coordinates of the beam, with gyroscopic terms.

        With ``M = L L^T`` and ``K = R R^T`` the periods are eigenvalues of a skew-symmetric matrix, so that low frequencies
        are accurate to rounding error although axial frequencies are 1e4 times higher.
        """
        from scipy.linalg import cholesky, solve_triangular

        small = self._small_motion(speed)
        mass, damping, stiffness = (item[1:, 1:] for item in (small.mass, small.damping, small.stiffness))
        try:
            root = cholesky(0.5 * (stiffness + stiffness.T), lower=True)
        except np.linalg.LinAlgError:
            raise ValueError(f"hub_speed = {speed:g}: expected a speed at which the beam keeps its stiffness") from None
        cross = solve_triangular(root, cholesky(mass, lower=True), lower=True)
        half = solve_triangular(root, 0.5 * (damping - damping.T), lower=True)
        gyroscopic = solve_triangular(root, half.T, lower=True).T
        periods = np.linalg.eigvalsh(1j * blocks([[np.zeros_like(cross), -cross.T], [cross, gyroscopic]]))
        return 1.0 / (2.0 * np.pi * periods[periods > 0.0][::-1])

    @abstractmethod
    def _steady_coordinates(self, speed: float) -> Array:
        """Coordinates of the beam in steady rotation, N - 1."""

    @abstractmethod
    def _small_motion(self, speed: float) -> SmallMotion:
        """Small motion about steady rotation at a hub speed [rad/s]."""

    def _forced_modes(self, sensors: Sequence[object]) -> MachineModes:
        """Equations under forces on hub and tip, in modes at rest, with sensors among the outputs."""
        return _cached_modes(self, checked_sensors(sensors, self.parameters.length))

    @abstractmethod
    def _built_modes(self, sensors: tuple[BeamSensor, ...]) -> MachineModes:
        """Compute the result of `_forced_modes`, which caches it."""

    @abstractmethod
    def _state_derivative(self, x: Array, torque: float) -> Array:
        """Return the derivative of a state under a torque [N m]."""

    @abstractmethod
    def _tip_displacement(self, y: Array) -> float:
        """Transverse displacement of the free end, of one set of coordinates, m."""

    @abstractmethod
    def _motion(
        self, maneuver: Maneuver, timepts: Array, start: tuple[Array, Array], tolerance: tuple[float, float]
    ) -> Motion:
        """Motion from coordinates and rates at t = 0, to rtol and atol of the free end's displacement."""

    def _error(self, maneuver: Maneuver, timepts: Array, start: tuple[Array, Array], motion: Motion) -> float:
        """Return the estimated largest error of a motion's tip displacement [m]."""
        return motion.error

    @abstractmethod
    def _details(self, maneuver: Maneuver, timepts: Array, motion: Motion) -> Details:
        """Evaluate a motion."""


@lru_cache(maxsize=16)  # beams around which loops are closed repeatedly
def _cached_modes(beam: HubBeam, sensors: tuple[BeamSensor, ...]) -> MachineModes:
    return beam._built_modes(sensors)


MODELS: dict[str, Callable[..., HubBeam]] = {}
"""Constructors of the models by name, with arguments `parameters` and `modes`; `assumed_modes` fills it."""


def in_model(parameters: HubBeamParameters, model: str, modes: int) -> HubBeam:
    """Return a machine in a model; see `hub_beam`."""
    if not isinstance(model, str) or model not in MODELS:
        raise ValueError(f"model = {shown(model)}: expected one of {', '.join(MODELS)}")
    return MODELS[model](parameters=parameters, modes=modes)


def _checked_times(value: ArrayLike) -> Array:
    """Return the times of a simulation, checked: one-dimensional, finite, strictly ascending, from 0 on."""
    timepts = finite_array("timepts", value, ndim=1)
    if not timepts.size:
        raise ValueError("timepts: expected at least one time [s], got none")
    if timepts[0] < 0.0:
        raise ValueError(f"timepts[0] = {exactly(timepts[0])}: expected times >= 0; a maneuver starts at 0")
    gap = float((timepts[1:] - timepts[:-1]).min(initial=np.inf))
    if gap <= 0.0:
        raise ValueError("timepts: expected strictly ascending times")
    if timepts[-1] > _LATEST:
        raise ValueError(f"timepts[-1] = {exactly(timepts[-1])}: expected at most {_LATEST:g} s")
    if gap < 1.0 / FASTEST:
        raise ValueError(f"timepts: expected a spacing of at least {1.0 / FASTEST:g} s, got {gap:g} s")
    return timepts


def _as_maneuver(maneuver: Any, initial: ArrayLike | None) -> Maneuver:
    """Return the torque of a slew as a maneuver; return a maneuver unchanged."""
    if not hasattr(maneuver, "torque_profile"):
        return maneuver
    size = np.abs(getattr(maneuver, "states", np.zeros((1, 1))))
    if initial is None and (size[0] > ROOT * size.max(axis=0)).any():
        raise ValueError("initial_state: expected the state that the slew begins with, which is not at rest, got none")
    return maneuver.torque_profile


def _checked(maneuver: Maneuver, end: float) -> Maneuver:
    """Return a maneuver, or a hub profile checked up to a time [s]."""
    return maneuver.checked_until(end) if isinstance(maneuver, HubProfile) and end > 0.0 else maneuver


def _initial_state(value: ArrayLike, size: int) -> Array:
    """Return an initial state of `size` finite numbers."""
    state = finite_array("initial_state", value)
    if state.shape != (size,):
        raise ValueError(
            f"initial_state of shape {state.shape}: expected ({size},), the states of to_nlsys() in their order"
        )
    return state


def natural_hz(mass: Array, stiffness: Array) -> Array:
    """Return the natural frequencies of a positive definite pair, ascending [Hz], computed from its periods."""
    from scipy.linalg import eigh

    return 1.0 / (2.0 * np.pi * np.sqrt(eigh(mass, stiffness, eigvals_only=True)[::-1]))


def lowest_rate(mass: Array, stiffness: Array) -> float:
    """Return the lowest natural frequency, rad/s; for a mass on a rotating hub the speed at which the stiffness is lost."""
    return 2.0 * np.pi * float(natural_hz(mass, stiffness)[0])
