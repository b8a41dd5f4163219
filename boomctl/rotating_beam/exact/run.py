"""Runs of the geometrically exact beam to a tolerance: the step is halved until two runs agree.

The integrator is symplectic only with equal steps, so the error is estimated for a full run, not step by step: tip
displacement and hub angle at the requested times are compared with a run with twice the step. Between the ends of steps the
motion is interpolated by the Hermite polynomial of degree 11 through six ends.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from typing import final

import numpy as np
from numpy.polynomial.legendre import legder, legvander

from boomctl.arrays import Array
from boomctl.exceptions import SimulationError
from boomctl.lti.rounding import ALIKE
from boomctl.maneuvers import HubProfile, Maneuver, Torque
from boomctl.rotating_beam.exact.dynamics import ExactBeamDynamics
from boomctl.rotating_beam.exact.integrator import StepFailedError, Trajectory, march
from boomctl.rotating_beam.jumps import steps_resolving
from boomctl.rotating_beam.result import HOPELESS, Motion, known_states, small_deformation_until

_WINDOW = 6  # Ends of steps in an interpolation polynomial: degree 11, above the order of the steps.
_LEAST_STEPS = 2 * _WINDOW  # Fewest steps between two breakpoints.
_MOST_STEPS = 300_000  # Most steps of a run.
_PROBES = 513  # Times, in addition to the requested ones, at which two runs must agree.
_LONG = 20_000  # Steps of the first run above which 1/500 of it is run first, to predict the number of steps of the full run.
_PILOT = 500.0
_STUCK = 0.7  # Ratio to the last error above which a refinement counts as without effect.
_MOST_STUCK = 3  # Refinements without effect after which the run ends with an error.


class _TooManyError(SimulationError):
    """Number of steps above the limit."""


@final
@dataclass(frozen=True, eq=False)
class Run:
    """Motion in steps of one length, at the requested times and at probes between them.

    Attributes
    ----------
    probes : ndarray, k
        Times, s.
    tip : ndarray, k
        Position of the free end in the hub's axes, complex, m.
    arm : ndarray, k
        Hub angle times the undeformed free end's radius, m.
    state : pair of ndarray, k x n
        Coordinates and velocities.
    trajectories : list of Trajectory
        From one breakpoint of the drive to the next.
    steps : int
    step : float
        Longest step, s.
    """

    probes: Array
    tip: Array
    arm: Array
    state: tuple[Array, Array]
    trajectories: list[Trajectory]
    steps: int
    step: float

    def distance(self, other: "Run") -> float:
        """Return the largest difference of free end or arm from another run at the same times, m."""
        return float(max(np.max(np.abs(self.tip - other.tip)), np.max(np.abs(self.arm - other.arm))))

    def largest(self, radius: float) -> float:
        """Return the largest displacement of the free end from its undeformed position at a radius, m."""
        return float(np.max(np.abs(self.tip - radius)))


def run_with_step(
    dynamics: ExactBeamDynamics,
    maneuver: Maneuver,
    timepts: Array,
    state: tuple[Array, Array],
    step: float,
    least: int = _LEAST_STEPS,
) -> Run:
    """Integrate from t = 0 in steps of about a length [s], with at least `least` steps between two breakpoints.

    Raises
    ------
    StepFailedError
        If the steps are too long.
    SimulationError
        If there are too many steps.
    """
    end = float(timepts[-1])
    bounds = _bounds(maneuver, end, step)
    counts = [_steps(start, stop, step, timepts, least) for start, stop in pairwise(bounds)]
    if sum(counts) > _MOST_STEPS:
        raise _TooManyError(f"steps of {step:.2g} s: too many")
    trajectories: list[Trajectory] = []
    for (start, stop), count in zip(pairwise(bounds), counts, strict=True):
        trajectories.append(march(dynamics, maneuver, np.linspace(start, stop, count + 1), state))
        state = trajectories[-1].q[-1], trajectories[-1].v[-1]
    probes = np.union1d(timepts, np.linspace(0.0, end, _PROBES))
    q, v = _at(trajectories, probes)
    arm = q[:, 0] * float(np.sum(dynamics.basis.tip_row))
    return Run(probes, dynamics.tip(q), arm, (q, v), trajectories, sum(counts), step)


def _bounds(maneuver: Maneuver, end: float, step: float) -> Array:
    """Return the bounds of parts with equal steps: times at which the drive is not smooth, or changes fast."""
    bounds = np.array([0.0, *(c for c in sorted(maneuver.breakpoints) if 0.0 < c < end), end])
    if not isinstance(maneuver, HubProfile | Torque):
        return bounds
    drive = maneuver.torque if isinstance(maneuver, Torque) else maneuver.acceleration
    parts = [
        np.linspace(start, stop, int(np.ceil((stop - start) / (_LEAST_STEPS * step))), endpoint=False)
        for start, stop in pairwise(bounds)
    ]
    coarse = np.append(np.concatenate(parts), end)
    return np.union1d(bounds, np.setdiff1d(steps_resolving(coarse, drive), coarse))


def run_to_tolerance(
    dynamics: ExactBeamDynamics,
    maneuver: Maneuver,
    timepts: Array,
    state: tuple[Array, Array],
    *,
    first_step: float,
    rtol: float,
    atol: float,
) -> tuple[Motion, Run | None]:
    """Integrate from t = 0 to the last requested time.

    Parameters
    ----------
    dynamics : ExactBeamDynamics
    maneuver : PrescribedMotion or TorqueDriven
    timepts : ndarray, k
        Requested times, ascending, >= 0, s.
    state : pair of ndarray, n
        Coordinates and velocities at t = 0.
    first_step : float
        Longest step, s.
    rtol, atol : float
        Tolerance, relative to the largest tip displacement, and absolute, m.

    Returns
    -------
    Motion, and the run of which it is part
        None instead of a run if the last time is 0.

    Raises
    ------
    SimulationError
        If the tolerance is not reached, or a pilot run predicts far too many steps.
    """
    end = float(timepts[-1])
    if end == 0.0:
        q, v = state[0][None], state[1][None]
        tip, states = dynamics.tip(q), partial(known_states, q, v)
        until = _small_until(dynamics, timepts, tip, (q, v))
        return Motion(np.imag(tip), until, states, 0.0, 0, ("initial state",)), None
    if end / first_step > _LONG:
        options = {"first_step": first_step, "rtol": rtol, "atol": atol}
        pilot, _ = run_to_tolerance(dynamics, maneuver, np.array([end / _PILOT]), state, **options)
        if _PILOT * pilot.steps > HOPELESS * _MOST_STEPS:
            raise SimulationError(
                f"the motion until t = {end:g} s would take about {_PILOT * pilot.steps:.1e} steps; expected at most about "
                f"{end * _MOST_STEPS / (_PILOT * pilot.steps):.2g} s, a larger rtol or atol, or another model"
            )
    radius = float(np.sum(dynamics.basis.tip_row))
    step, previous, error, stuck = first_step, None, np.inf, 0
    while stuck < _MOST_STUCK:
        try:
            least = round(
                _LEAST_STEPS * first_step / step
            )  # as many more: two runs with the same steps agree on anything
            here = run_with_step(dynamics, maneuver, timepts, state, step, least)
        except StepFailedError:
            previous, step = None, 0.5 * step
            continue
        except _TooManyError:
            break
        if previous is not None:
            difference = here.distance(
                previous
            )  # the error with twice the step, an upper bound on the error of this run
            stuck = stuck + 1 if difference > _STUCK * error else 0
            error = difference
            if error <= atol + rtol * here.largest(radius):
                result = _at(here.trajectories, timepts)
                motion = Motion(
                    tip=np.imag(dynamics.tip(result[0])),
                    small_deformation_until=_small_until(dynamics, here.probes, here.tip, here.state),
                    states=partial(known_states, *result),
                    error=error,
                    steps=here.steps,
                    stages=("collocation of momenta",),
                )
                return motion, here
        previous, step = here, 0.5 * step
    raise SimulationError(
        f"rtol = {rtol:g}, atol = {atol:g}: not reached with steps of {2.0 * step:.2g} s "
        f"(error about {error:.2g} m); expected looser tolerances, or a smoother motion"
    )


def _small_until(
    dynamics: ExactBeamDynamics, timepts: Array, tip: Array, state: tuple[Array, Array]
) -> Callable[[], float]:
    """Return what finds the time up to which the deformation is small, from tip positions and states at k times."""
    tip_rate = np.imag(dynamics.tip_rate(*state)).__getitem__
    return partial(small_deformation_until, timepts, np.imag(tip), dynamics.basis.length, tip_rate)


def _steps(start: float, stop: float, step: float, timepts: Array, least: int) -> int:
    """Return the number of steps between two breakpoints; if equal steps can, they end at the requested times."""
    count = max(least, int(np.ceil((stop - start) / step)))
    gaps = np.diff(np.unique([start, *timepts[(timepts > start) & (timepts < stop)], stop]))
    # fraction of a step within which a time coincides with the end of a step
    uniform = np.ptp(gaps) <= ALIKE * gaps[0] and gaps.size <= count
    return -(-count // gaps.size) * gaps.size if uniform else count


def _at(trajectories: list[Trajectory], timepts: Array) -> tuple[Array, Array]:
    """Return coordinates and velocities at ``timepts``; at a breakpoint, from the trajectory that ends there."""
    ends = np.array([item.time[-1] for item in trajectories])
    which = np.minimum(np.searchsorted(ends, timepts), len(trajectories) - 1)
    parts = [interpolate(item, timepts[which == k]) for k, item in enumerate(trajectories)]
    return np.concatenate([q for q, _ in parts]), np.concatenate([v for _, v in parts])


def interpolate(trajectory: Trajectory, times: Array) -> tuple[Array, Array]:
    """Interpolate coordinates and velocities within a run of equal steps.

    Parameters
    ----------
    trajectory
        At least six states, equally spaced in time.
    times
        Times within it, shape ``(m,)`` [s].

    Returns
    -------
    tuple of ndarray
        Shapes ``(m, coordinates)``.
    """
    h = (trajectory.time[-1] - trajectory.time[0]) / (len(trajectory.time) - 1)
    position = (times - trajectory.time[0]) / h
    left = np.clip(np.floor(position).astype(int) - _WINDOW // 2 + 1, 0, len(trajectory.time) - _WINDOW)
    half = 0.5 * (_WINDOW - 1)
    basis = _hermite_basis()
    x = (position - left) / half - 1.0
    values = legvander(x, 2 * _WINDOW - 1) @ basis
    derivatives = legvander(x, 2 * _WINDOW - 2) @ legder(basis) / (half * h)
    within = left[:, None] + np.arange(_WINDOW)
    known = np.concatenate([trajectory.q[within], half * h * trajectory.v[within]], axis=1)
    q, v = (np.einsum("mj,mjn->mn", item, known) for item in (values, derivatives))
    near = np.abs(position - np.rint(position)) < ALIKE
    ends = np.rint(position[near]).astype(int)
    q[near], v[near] = trajectory.q[ends], trajectory.v[ends]
    return q, v


def _hermite_basis() -> Array:
    """Return Legendre coefficients of polynomials with unit value, then unit derivative, at equal spacing on [-1, 1]."""
    points = np.linspace(-1.0, 1.0, _WINDOW)
    degree = 2 * _WINDOW - 1
    derivatives = legvander(points, degree - 1) @ legder(np.eye(degree + 1))
    return np.linalg.inv(np.vstack([legvander(points, degree), derivatives]))
