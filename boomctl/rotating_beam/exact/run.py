"""Runs of the geometrically exact beam to a tolerance: the step is halved until two runs agree.

Equal steps keep the integrator symplectic, so the accuracy is not judged step by step but on the whole run: its tip
displacement and hub angle at the instants asked for, against those of a run with twice the step. Between the ends of
steps the motion is interpolated by the Hermite polynomial of degree 11 through six of them.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.polynomial.legendre import legder, legvander

from boomctl.arrays import Array
from boomctl.rotating_beam.exact.dynamics import ExactBeamDynamics
from boomctl.rotating_beam.exact.integrator import Drive, StepFailedError, Trajectory, march
from boomctl.rotating_beam.motion.run import SimulationError

_WINDOW = 6
_LEAST_STEPS = 2 * _WINDOW
_COINCIDENT = 1e-9  # fraction of a step within which an instant is the end of a step
_MOST_STEPS = 300_000
_CAUTION = 3.0  # a halved step is taken to divide the error by no more than 4; the order of the rule gives 256
_PROBES = 513  # instants, besides those asked for, at which two runs must agree
_MOST_STUCK = 3  # refinements that do not lower the error before the run is given up


@dataclass(frozen=True, eq=False)
class Motion:
    """A run to its tolerance.

    Attributes
    ----------
    q, v : ndarray, k x coordinates
        Coordinates and velocities at the instants asked for.
    watched : ndarray, m
        More instants over the whole run, those asked for among them, s.
    watched_tip, watched_rate : ndarray, m
        Transverse displacement [m] and rate [m/s] of the free end there.
    error_estimate : float
        Of tip displacement and hub, m.
    steps : int
        Number of steps.
    """

    q: Array
    v: Array
    watched: Array
    watched_tip: Array
    watched_rate: Array
    error_estimate: float
    steps: int


def run_to_tolerance(
    dynamics: ExactBeamDynamics,
    drive: Drive,
    corners: tuple[float, ...],
    timepts: Array,
    state: tuple[Array, Array],
    first_step: float,
    tolerance: tuple[float, float],
) -> Motion:
    """Integrate from t = 0 to the last of ``timepts``.

    Parameters
    ----------
    dynamics, drive
        The beam, and what moves its hub.
    corners
        Instants at which the drive is not smooth [s].
    timepts
        Instants at which the motion is wanted, ascending, >= 0 [s].
    state
        Coordinates and velocities at t = 0.
    first_step
        Longest step tried [s].
    tolerance
        Relative (to the largest tip displacement) and absolute [m].

    Returns
    -------
    Motion
        At ``timepts``.

    Raises
    ------
    SimulationError
        The tolerance was not reached.
    """
    end = float(timepts[-1])
    if end == 0.0:
        q, v = state[0][None], state[1][None]
        return Motion(q, v, timepts, np.imag(dynamics.tip(q)), np.imag(dynamics.tip_rate(q, v)), 0.0, 0)
    bounds = np.array([0.0, *(c for c in sorted(corners) if 0.0 < c < end), end])
    probes = np.union1d(timepts, np.linspace(0.0, end, _PROBES))
    radius = float(np.sum(dynamics.basis.tip_row))
    step, previous, error, stuck = float(first_step), None, np.inf, 0
    while stuck < _MOST_STUCK:
        counts = [_steps(start, stop, step, timepts) for start, stop in pairwise(bounds)]
        if sum(counts) > _MOST_STEPS:
            break
        try:
            pieces = _run(dynamics, drive, bounds, counts, state)
        except StepFailedError:
            previous, step = None, 0.5 * step
            continue
        q, v = _at(pieces, probes)
        tip, arm = dynamics.tip(q), q[:, 0] * radius
        if previous is not None:
            difference = float(max(np.max(np.abs(tip - previous[0])), np.max(np.abs(arm - previous[1]))))
            stuck = stuck + 1 if difference / _CAUTION > 0.7 * error else 0
            error = difference / _CAUTION
            if error <= tolerance[1] + tolerance[0] * float(np.max(np.abs(tip - radius))):
                rate = np.imag(dynamics.tip_rate(q, v))
                return Motion(*_at(pieces, timepts), probes, np.imag(tip), rate, error, sum(counts))
        previous, step = (tip, arm), 0.5 * step
    raise SimulationError(
        f"rtol = {tolerance[0]:g}, atol = {tolerance[1]:g}: not reached with steps of {2.0 * step:.2g} s "
        f"(error about {error:.2g} m); expected looser tolerances, or a smoother motion"
    )


def _steps(start: float, stop: float, step: float, timepts: Array) -> int:
    """Number of steps between two corners; if equal steps can, they end at the instants wanted."""
    count = max(_LEAST_STEPS, int(np.ceil((stop - start) / step)))
    gaps = np.diff(np.unique([start, *timepts[(timepts > start) & (timepts < stop)], stop]))
    uniform = np.ptp(gaps) <= 1e-9 * gaps[0] and gaps.size <= count
    return -(-count // gaps.size) * gaps.size if uniform else count


def _run(dynamics, drive: Drive, bounds: Array, counts: list[int], state) -> list[Trajectory]:
    pieces, (q, v) = [], state
    for (start, end), count in zip(pairwise(bounds), counts, strict=True):
        pieces.append(march(dynamics, drive, float(start), float(end), count, q, v))
        q, v = pieces[-1].q[-1], pieces[-1].v[-1]
    return pieces


def _at(pieces: list[Trajectory], timepts: Array) -> tuple[Array, Array]:
    """Coordinates and velocities at ``timepts``; at a corner, those of the piece that ends there."""
    ends = np.array([piece.time[-1] for piece in pieces])
    which = np.minimum(np.searchsorted(ends, timepts), len(pieces) - 1)
    parts = [interpolate(piece, timepts[which == k]) for k, piece in enumerate(pieces)]
    return np.concatenate([q for q, _ in parts]), np.concatenate([v for _, v in parts])


def interpolate(piece: Trajectory, times: Array) -> tuple[Array, Array]:
    """Coordinates and velocities within a run of equal steps.

    Parameters
    ----------
    piece
        At least six states at equal distances in time.
    times
        Instants within it, shape ``(m,)`` [s].

    Returns
    -------
    tuple of ndarray
        Shapes ``(m, coordinates)``.
    """
    h = piece.time[1] - piece.time[0]
    place = (times - piece.time[0]) / h
    left = np.clip(np.floor(place).astype(int) - _WINDOW // 2 + 1, 0, len(piece.time) - _WINDOW)
    half = 0.5 * (_WINDOW - 1)
    basis = _hermite_basis()
    x = (place - left) / half - 1.0
    values = legvander(x, 2 * _WINDOW - 1) @ basis
    slopes = legvander(x, 2 * _WINDOW - 2) @ legder(basis) / (half * h)
    q, v = np.zeros((len(times), piece.q.shape[1])), np.zeros((len(times), piece.q.shape[1]))
    for j in range(_WINDOW):
        q += values[:, j, None] * piece.q[left + j] + values[:, _WINDOW + j, None] * (half * h) * piece.v[left + j]
        v += slopes[:, j, None] * piece.q[left + j] + slopes[:, _WINDOW + j, None] * (half * h) * piece.v[left + j]
    near = np.abs(place - np.rint(place)) < _COINCIDENT
    ends = np.rint(place[near]).astype(int)
    q[near], v[near] = piece.q[ends], piece.v[ends]
    return q, v


def _hermite_basis() -> Array:
    """Legendre coefficients of the polynomials with unit value, then unit slope, at equal distances on [-1, 1]."""
    points = np.linspace(-1.0, 1.0, _WINDOW)
    degree = 2 * _WINDOW - 1
    slopes = legvander(points, degree - 1) @ legder(np.eye(degree + 1))
    return np.linalg.inv(np.vstack([legvander(points, degree), slopes]))
