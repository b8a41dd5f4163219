"""From a manoeuvre to the motion at the instants asked for: which solver, which steps, and what its failures mean."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from boomctl.arrays import Array
from boomctl.gauss import gauss_method
from boomctl.rotating_beam.manoeuvres import HubProfile, PrescribedMotion, Torque, TorqueDriven
from boomctl.rotating_beam.modal.equations import BeamSpeedTerms, Equations
from boomctl.rotating_beam.motion.collocation import StepTooSmall
from boomctl.rotating_beam.motion.first_steps import first_steps, resolving
from boomctl.rotating_beam.motion.modal_collocation import ModalTrajectory, modal_refine
from boomctl.rotating_beam.motion.prescribed import PrescribedProblem
from boomctl.rotating_beam.motion.refinement import Accuracy, NotConverged, refine
from boomctl.rotating_beam.motion.steady_rotation import steady_motion, vibration_amplitudes
from boomctl.rotating_beam.motion.torque_driven import TorqueDrivenProblem
from boomctl.rotating_beam.motion.trajectory import Trajectory

_STAGES = 8
_WINDOW = 64


class SimulationError(RuntimeError):
    """A motion that the model cannot be followed through: why, and from which instant."""


@dataclass(frozen=True)
class Motion:
    """Coordinates and rates of hub and beam at the instants asked for, each k x N; error of the free end [m]."""

    y: Array
    rate: Array
    error: float
    steps: int

    def displacement(self, row: Array) -> Array:
        """``row q`` of the beam's coordinates, k."""
        return self.y[:, 1:] @ row

    def at(self, timepts: Array, which: Array) -> "Motion":
        """The motion at some of its instants, those of the given indices."""
        return Motion(self.y[which], self.rate[which], self.error, self.steps)


@dataclass(frozen=True)
class ModalMotion:
    """A motion with exact vibrations, of which coordinates and rates are evaluated when first asked for."""

    trajectory: ModalTrajectory
    manoeuvre: PrescribedMotion
    timepts: Array
    error: float

    @property
    def steps(self) -> int:
        """Number of integration steps."""
        return self.trajectory.edges.size - 1

    @property
    def y(self) -> Array:
        """Coordinates of hub and beam, k x N."""
        return np.column_stack([self.manoeuvre.angle(self.timepts), self._beam[0]])

    @property
    def rate(self) -> Array:
        """Rates of hub and beam, k x N."""
        return np.column_stack([self.manoeuvre.speed(self.timepts), self._beam[1]])

    @cached_property
    def _beam(self) -> tuple[Array, Array]:
        return self.trajectory(self.timepts)

    def displacement(self, row: Array) -> Array:
        """``row q`` of the beam's coordinates, k."""
        return self.trajectory.displacement(row, self.timepts)

    def at(self, timepts: Array, which: Array) -> "ModalMotion":
        """The motion at some of its instants."""
        return ModalMotion(self.trajectory, self.manoeuvre, timepts, self.error)


@dataclass(frozen=True)
class _Piece:
    """A motion up to `end`, found by collocation; empty if the hub's speed is constant from the start."""

    trajectory: Trajectory | None
    error: float

    @property
    def steps(self) -> int:
        return 0 if self.trajectory is None else self.trajectory.edges.size - 1


def watched_instants(equations: Equations, timepts: Array) -> Array:
    """The instants asked for, and enough others that no swing of the lowest mode passes unseen, from 0 on."""
    gap = 2.0 * np.pi / equations.frequency_range[0] / 16.0
    if max(timepts[0], (timepts[1:] - timepts[:-1]).max(initial=0.0)) <= gap:
        return timepts
    return np.union1d(timepts, np.linspace(0.0, timepts[-1], int(np.ceil(timepts[-1] / gap)) + 1))


def prescribed_motion(
    equations: Equations,
    manoeuvre: PrescribedMotion,
    timepts: Array,
    start: tuple[Array, Array],
    tolerance: tuple[float, float],
) -> Motion | ModalMotion:
    """Motion of the beam with the hub's prescribed: collocation, then the closed form once the hub's speed is constant.

    Parameters
    ----------
    equations : Equations
    manoeuvre : PrescribedMotion
    timepts : ndarray, k
        Instants, s.
    start : pair of ndarray, N
        Coordinates and rates of hub and beam at t = 0.
    tolerance : pair of float
        rtol and atol of the free end's displacement.

    Raises
    ------
    ValueError
        If the functions of a profile do not belong together.
    SimulationError
        If the motion grows out of bounds or the tolerance is not reached.
    """
    if isinstance(manoeuvre, HubProfile):
        manoeuvre.check_until(float(timepts[-1]))
    terms, tip = equations.beam_speed_terms, equations.tip
    steady_from = manoeuvre.steady_from if terms is not None else np.inf
    end = min(float(timepts[-1]), steady_from)
    beam = start[0][1:], start[1][1:]
    accuracy = Accuracy(*tolerance, (np.stack([tip.transverse, tip.axial]),))
    if equations.normal_form is not None and end > 0.0:
        edges = first_steps(equations, manoeuvre.breakpoints, end, graded=False)
        goes_on = end < timepts[-1]
        found = modal_refine(equations.normal_form, manoeuvre, edges, beam, accuracy, goes_on)
        if found is not None:
            return ModalMotion(found[0], manoeuvre, timepts, found[1])
    if terms is not None and end < timepts[-1]:
        modal = vibration_amplitudes(terms, float(manoeuvre.speed(end)), tip.transverse)
        accuracy = replace(accuracy, modal=modal)
    piece = _collocate(PrescribedProblem(equations, manoeuvre), equations, manoeuvre, beam, end, accuracy)
    q, v = _with_steady(terms, manoeuvre, piece, beam, timepts, end)
    y = np.column_stack([manoeuvre.angle(timepts), q])
    return Motion(y, np.column_stack([manoeuvre.speed(timepts), v]), piece.error, piece.steps)


def torque_driven_motion(
    equations: Equations,
    manoeuvre: TorqueDriven,
    timepts: Array,
    start: tuple[Array, Array],
    tolerance: tuple[float, float],
    reach: float,
) -> Motion:
    """Motion of hub and beam under a torque on the hub.

    Parameters
    ----------
    equations, manoeuvre, timepts, start, tolerance
        As for `prescribed_motion`.
    reach : float
        Distance of the free end from the axis, m: what the error of the hub's angle is multiplied by.

    Raises
    ------
    SimulationError
        If the mass matrix ceases to be positive definite, or the tolerance is not reached.
    """
    tip, end = equations.tip, float(timepts[-1])
    rows = np.zeros((3, equations.size))
    rows[0, 1:], rows[1, 1:], rows[2, 0] = tip.transverse, tip.axial, reach
    accuracy = Accuracy(*tolerance, (rows[:2], rows[2:]))
    problem = TorqueDrivenProblem(equations, manoeuvre)
    piece = _collocate(problem, equations, manoeuvre, start, end, accuracy)
    if piece.trajectory is None:
        return Motion(start[0][None], start[1][None], 0.0, 0)
    y, rate = piece.trajectory(timepts)
    return Motion(y, rate, piece.error, piece.steps)


def _with_steady(
    terms: BeamSpeedTerms | None,
    manoeuvre: PrescribedMotion,
    piece: _Piece,
    beam: tuple[Array, Array],
    timepts: Array,
    end: float,
) -> tuple[Array, Array]:
    """Coordinates and rates of the beam: of the piece up to `end`, then in closed form."""
    early = timepts[timepts <= end]
    q, v = (np.empty((timepts.size, beam[0].size)) for _ in range(2))
    if piece.trajectory is not None:
        q[: early.size], v[: early.size] = piece.trajectory(early)
        beam = piece.trajectory.end()
    else:
        q[: early.size], v[: early.size] = beam
    if terms is not None and early.size < timepts.size:
        late = timepts[early.size :]
        q[early.size :], v[early.size :] = _steady(terms, float(manoeuvre.speed(end)), beam, late, end)
    return q, v


def _collocate(
    problem: PrescribedProblem | TorqueDrivenProblem,
    equations: Equations,
    manoeuvre: PrescribedMotion | TorqueDriven,
    start: tuple[Array, Array],
    end: float,
    accuracy: Accuracy,
) -> _Piece:
    if end <= 0.0:
        return _Piece(None, 0.0)
    edges = first_steps(equations, manoeuvre.breakpoints, end, graded=True)
    if isinstance(manoeuvre, HubProfile):
        edges = resolving(edges, manoeuvre.acceleration)
    elif isinstance(manoeuvre, Torque):
        edges = resolving(edges, manoeuvre.torque)
    try:
        trajectory, error = refine(problem, gauss_method(_STAGES), edges, start, accuracy, _WINDOW)
    except StepTooSmall as failure:
        raise SimulationError(_why(problem, failure.time)) from None
    except NotConverged as failure:
        raise SimulationError(
            f"the tip displacement's error stays at {failure.error:.1e} m: raise rtol or atol"
        ) from None
    return _Piece(trajectory, error)


def _why(problem: PrescribedProblem | TorqueDrivenProblem, time: float) -> str:
    if isinstance(problem, TorqueDrivenProblem):
        return (
            f"the model's mass matrix ceases to be positive definite at t = {time:.6g} s: the torque drives it out of "
            "the deformations it is valid for; use less torque or model='geometrically-exact'"
        )
    return f"the deflection grows beyond all bounds from t = {time:.6g} s on: the model has lost its stiffness"


def _steady(
    terms: BeamSpeedTerms, speed: float, beam: tuple[Array, Array], late: Array, end: float
) -> tuple[Array, Array]:
    q, v = steady_motion(terms, speed, beam, late - end)
    finite = np.isfinite(q).all(axis=1) & np.isfinite(v).all(axis=1)
    if not finite.all():
        time = late[np.argmin(finite)]
        raise SimulationError(
            f"the deflection exceeds every number by t = {time:.6g} s: the model has lost its stiffness"
        )
    return q, v
