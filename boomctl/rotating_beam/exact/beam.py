"""The geometrically exact hub-beam: the model against which the others are measured."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, final

import numpy as np
from numpy.typing import ArrayLike

from boomctl.arrays import Array
from boomctl.progress import computing
from boomctl.rotating_beam.beam import Enough, HubBeam, SmallMotion
from boomctl.rotating_beam.chosen import ModelChoice
from boomctl.rotating_beam.exact.basis import StrainBasis, strain_basis
from boomctl.rotating_beam.exact.dynamics import ExactBeamDynamics
from boomctl.rotating_beam.exact.polynomials import (
    MOST_POLYNOMIALS,
    Followed,
    Stepped,
    left_out,
    resized,
    with_enough_polynomials,
)
from boomctl.rotating_beam.exact.run import Run, run_to_tolerance, run_with_step
from boomctl.rotating_beam.exact.statics import (
    coupled_frequencies,
    critical_speed,
    damping_matrix,
    small_motion,
    steady_rotation,
    transverse_frequencies,
)
from boomctl.rotating_beam.manoeuvres import Manoeuvre, TorqueDriven
from boomctl.rotating_beam.parameters import HubBeamParameters
from boomctl.rotating_beam.result import Details, Motion

if TYPE_CHECKING:
    from boomctl.rotating_beam.modal.forced import ForcedModes

_FIRST_STEP = 0.25  # of the second bending period: the coarsest step of a run, a choice
_FIRST_STEP_ALONE = 0.0625  # of the first bending period, where there is no second one, which is about 6 times as fast
_CHUNK = 500  # mass matrices held at once: a choice, to bound the memory


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
        return ExactBeamDynamics(self.basis, damping_matrix(self.basis, self.parameters.damping_ratio))

    @property
    def state_names(self) -> tuple[str, ...]:
        """Names of the states: hub angle, curvatures, stretches, then their rates."""
        count = (self._size - 1) // 2
        strains = [f"{kind}_{k + 1}" for kind in ("curvature", "stretch") for k in range(count)]
        return ("hub_angle", *strains, "hub_speed", *(f"{name}_rate" for name in strains))

    def critical_speed(self) -> float:
        return self.steady_limit

    def _steady_limit(self) -> float:
        return critical_speed(self.basis)

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

    def _frequencies_hz(self, speed: float, coupled: bool) -> Array:
        frequencies = coupled_frequencies if coupled else transverse_frequencies
        return frequencies(self.dynamics, speed) / (2.0 * np.pi)

    def _steady_coordinates(self, speed: float) -> Array:
        return steady_rotation(self.basis, speed)[1:]

    def _small_motion(self, speed: float) -> SmallMotion:
        tip = np.imag(self.dynamics.tip_row(steady_rotation(self.basis, speed)))
        return SmallMotion(*small_motion(self.dynamics, speed), tip)

    def _forced_modes(self, sensors: Sequence[object]) -> ForcedModes:
        from boomctl.rotating_beam.exact.forced import exact_lagrangian, exact_places  # which only a loop needs
        from boomctl.rotating_beam.modal import forced

        p = self.parameters
        places = exact_places(p, self.basis, self.modes)
        law = forced.lagrangian_law(exact_lagrangian(self.basis, self.dynamics.damping), places, p.length)
        small = self._small_motion(0.0)
        modes = forced.rest_modes(small.mass, small.damping, small.stiffness)
        return forced.forced_modes(modes, law, places, p, self.state_names, sensors)

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
        acceleration, torque, margin = _accelerations(dynamics, manoeuvre, timepts, q, v)
        extension = dynamics.extension(q)
        return Details(
            axial_tip_displacement=extension,
            foreshortening=np.real(dynamics.tip(q)) - np.sum(self.basis.tip_row) - extension,
            hub_angle=q[:, 0],
            hub_speed=v[:, 0],
            hub_acceleration=acceleration,
            torque=torque,
            inertia_torque=-dynamics.convective_force(q, v)[:, 0],
            energy=dynamics.energy(q, v),
            angular_momentum=dynamics.momentum_and_force(q, v)[0][:, 0],
            mass_matrix_margin=margin,
            states=np.hstack([resized(y, modes, self.modes) for y in (q, v)]),
        )


def _accelerations(
    dynamics: ExactBeamDynamics, manoeuvre: Manoeuvre, timepts: Array, q: Array, v: Array
) -> tuple[Array, Array, Array]:
    """Acceleration of the hub, torque on it, and margin of the mass matrix, each k."""
    force = -dynamics.convective_force(q, v)
    inner = force - dynamics.basis.stiffness * q
    if dynamics.damping is not None:
        inner -= v @ dynamics.damping
    margin, pull = np.empty(len(timepts)), np.empty(len(timepts))
    for part in np.array_split(np.arange(len(timepts)), len(timepts) // _CHUNK + 1):
        mass = dynamics.mass_matrix(q[part])
        column = mass[:, 1:, :1]
        solved = np.linalg.solve(mass[:, 1:, 1:], np.concatenate([column, inner[part, 1:, None]], axis=2))
        margin[part] = mass[:, 0, 0] - np.sum(column * solved[:, :, :1], axis=(1, 2))
        pull[part] = np.sum(column * solved[:, :, 1:], axis=(1, 2))
    if isinstance(manoeuvre, TorqueDriven):
        torque = np.array(manoeuvre.torque(timepts))
        return (torque + inner[:, 0] - pull) / margin, torque, margin
    turning = np.array(manoeuvre.acceleration(timepts))
    return turning, margin * turning + pull - force[:, 0], margin
