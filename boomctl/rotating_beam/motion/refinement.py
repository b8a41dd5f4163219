"""Steps for a motion, halved until two solutions agree, whose difference is the error estimate."""

from dataclasses import dataclass
from typing import final

import numpy as np

from boomctl.arrays import Array
from boomctl.exceptions import SimulationError
from boomctl.gauss import gauss_method
from boomctl.rotating_beam.motion.collocation import Trajectory, march
from boomctl.rotating_beam.motion.problems import Problem
from boomctl.rotating_beam.result import HOPELESS

STAGES = 8  # Stages of the collocation, order 16; 4 and 6 take longer for a torque on FOAM with 5 + 5 modes.

_FIRST_TOLERANCE = 1e-6  # Change of a coordinate [m] at which Newton's method stops on the first steps.
_NEWTON_FRACTION = 0.05  # Fraction of the allowed error at which Newton's method stops on finer steps.
_MOST_STEPS = 40000  # Most steps of a run: ten times the number for FOAM over a minute with nine digits.
# First steps above which 1/100 of the motion is solved first, to predict the number of steps of the full motion.
_LONG = 5000
_PILOT = 100
_SMOOTH = 0.02  # Contribution of a step's highest terms, over the allowed error, below which it is not halved.


@final
@dataclass(frozen=True)
class Accuracy:
    """Required accuracy of a motion.

    Attributes
    ----------
    rtol, atol : float
        Limit ``atol + rtol max |displacement|`` [m] on the error of each watched displacement.
    rows : tuple of ndarray, each r x n
        Groups of displacements as rows over the coordinates; a group shares its maximum. The first is the free end.
    modal : tuple of ndarray, n x n, or None
        If a free vibration follows: rows from coordinates and from rates to the amplitudes of its modes at the free end.
        The error at the last step's end is then expressed in amplitudes, so that it holds for the vibration too.
    """

    rtol: float
    atol: float
    rows: tuple[Array, ...]
    modal: tuple[Array, Array] | None = None

    def allowed(self, q: Array) -> list[float]:
        """Return the allowed error of each group along a motion [m]."""
        return [self.atol + self.rtol * float(np.abs(q @ rows.T).max()) for rows in self.rows]

    def errors(self, coarse: Trajectory, fine: Trajectory) -> list[float]:
        """Return the largest difference of two solutions in each group [m], at ends and midpoints of the finer steps."""
        middles = 0.5 * (fine.edges[1:] + fine.edges[:-1])
        at_middles = fine.at_positions((0.5,))[:, 0]
        difference = coarse(np.concatenate([fine.edges, middles]))[0] - np.concatenate([fine.q, at_middles])
        errors = [float(np.abs(difference @ rows.T).max()) for rows in self.rows]
        if self.modal is not None:
            ends = (self.modal[0] @ (coarse.q[-1] - fine.q[-1]), self.modal[1] @ (coarse.v[-1] - fine.v[-1]))
            errors[0] = max(errors[0], float(np.hypot(*ends).sum()))
        return errors

    def roughness(self, trajectory: Trajectory, allowed: list[float]) -> Array:
        """Return the contribution of a step's highest Legendre terms to the watched displacements, over the limit."""
        moved = trajectory.highest_terms()
        parts = [(moved @ np.abs(rows).T).max(axis=1) / bound for rows, bound in zip(self.rows, allowed, strict=True)]
        return np.max(parts, axis=0)


def refine(problem: Problem, edges: Array, start: tuple[Array, Array], accuracy: Accuracy) -> tuple[Trajectory, float]:
    """Solve on steps halved repeatedly until the watched displacements reach the required accuracy.

    The difference of two levels is the error of the coarser level; the finer solution is returned. No order of convergence
    is assumed: while a weakly excited mode is not resolved, the differences fall at a rate that does not last. Only steps
    that are not smooth are halved, or all steps if all are smooth but the levels disagree.

    Parameters
    ----------
    problem, edges, start
        As for `march`; `edges` are the first, coarsest steps.
    accuracy : Accuracy

    Returns
    -------
    trajectory : Trajectory
    error : float
        Estimated largest error of the free end's displacement, m; conservative.

    Raises
    ------
    SimulationError
        If the tolerance is not reached with the smallest step, a pilot run predicts far too many steps, or the equations
        have no solution from some time on.
    """
    if edges.size > _LONG:
        first = edges[: edges.size // _PILOT]
        needed = refine(problem, first, start, accuracy)[0].edges.size / first.size * edges.size
        if needed > HOPELESS * _MOST_STEPS:
            raise SimulationError(
                f"the motion until t = {edges[-1]:g} s would take about {needed:.1e} steps; expected at most about "
                f"{edges[-1] * _MOST_STEPS / needed:.2g} s, a larger rtol or atol, or a model without axial motion"
            )
    method = gauss_method(STAGES)
    coarse = march(problem, method, edges, start, None, _FIRST_TOLERANCE)
    error = np.inf
    while coarse.edges.size <= _MOST_STEPS:
        allowed = accuracy.allowed(coarse.q)
        finer = _split(coarse.edges, accuracy.roughness(coarse, allowed) > _SMOOTH)
        fine = march(problem, method, finer, start, coarse, _NEWTON_FRACTION * min(allowed))
        errors = accuracy.errors(coarse, fine)
        error = errors[0]
        if all(item <= bound for item, bound in zip(errors, allowed, strict=True)):
            return fine, error
        coarse = fine
    raise SimulationError(f"the tip displacement's error stays at {error:.1e} m: raise rtol or atol")


def _split(edges: Array, rough: Array) -> Array:
    """Halve the rough steps; all of them if none is."""
    if not rough.any():
        return halved(edges)
    return np.sort(np.concatenate([edges, 0.5 * (edges[1:] + edges[:-1])[rough]]))


def halved(edges: Array) -> Array:
    """Return the ends of steps of half the length."""
    result = np.empty(2 * edges.size - 1)
    result[::2], result[1::2] = edges, 0.5 * (edges[1:] + edges[:-1])
    return result
