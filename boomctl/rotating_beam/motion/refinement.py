"""Steps for a motion: the first ones, and then halved until two solutions agree: the error was measured, not assumed."""

from dataclasses import dataclass
from itertools import pairwise
from math import ceil, log2
from typing import final

import numpy as np

from boomctl.arrays import Array
from boomctl.exceptions import SimulationError
from boomctl.gauss import gauss_method
from boomctl.rotating_beam.modal.equations import Equations
from boomctl.rotating_beam.motion.collocation import Trajectory, march
from boomctl.rotating_beam.motion.problems import Problem

STAGES = 8  # of the collocation, order 16: a choice; 4 and 6 take longer (measured, a torque on FOAM, 5 + 5 modes)

# First step times the lowest frequency of the beam, for vibrations in closed form: nearly a period.  It is shorter for a
# tolerance below `_LOOSE`, by a root of it: steps that are halved once or twice then do (measured)
_PHASE, _LOOSE, _ROOT = 5.5, 1e-6, 7.0
_PHASE_GRADED = 1.4  # likewise for polynomials: a quarter of a period, which eight stages follow

_FIRST_TOLERANCE = 1e-6  # change of a coordinate at which Newton's method stops on the first steps, m: they are a start
_NEWTON_SHARE = 0.05  # of the allowed error that Newton's method may leave
_MOST_STEPS = 40000  # where the run is given up: ten times as many as FOAM takes for a minute and nine digits
_LONG = (
    5000  # first steps from which a hundredth of a motion is solved before, to tell whether the whole can be (a choice)
)
_PILOT = 100
_HOPELESS = (
    2.0  # times the most steps that the pilot has to promise for a motion to be refused: it may be the hardest part
)
_SMOOTH = 0.02  # part of the allowed error below which a step's highest terms leave it as it is


def first_steps(
    equations: Equations, breakpoints: tuple[float, ...], end: float, *, rtol: float, graded: bool
) -> Array:
    """Ends of the coarsest steps: equal between the instants at which the maneuver is not smooth.

    Graded after these, down to the time scale of the highest mode, they catch the vibrations that are excited there.
    Otherwise polynomials on two levels of steps, both too coarse for them, could agree on leaving them out.

    Parameters
    ----------
    equations : Equations
    breakpoints : tuple of float
        Instants at which the maneuver is not smooth, s.
    end : float
        Instant at which the last step ends, s.
    rtol : float
        Of the free end's displacement.
    graded : bool
        Whether to grade the steps, for polynomials; vibrations in closed form may start from longer, equal steps.
    """
    lowest, highest = equations.frequency_range
    phase = _PHASE_GRADED if graded else _PHASE * min(1.0, rtol / _LOOSE) ** (1.0 / _ROOT)
    corners = [0.0, *(item for item in breakpoints if 0.0 < item < end), end]
    edges: list[Array] = [np.zeros(1)]
    for left, right in pairwise(corners):
        count = max(1, ceil((right - left) * lowest / phase))
        if graded:
            halvings = max(0, ceil(log2((right - left) / count * highest / phase)))
            edges.append(left + (right - left) / count * 0.5 ** np.arange(halvings, 0, -1))
        edges.append(right - (right - left) / count * np.arange(count - 1, -1, -1))
    return np.concatenate(edges)


@final
@dataclass(frozen=True)
class Accuracy:
    """How exact a motion has to be.

    Attributes
    ----------
    rtol, atol : float
        The error of each watched displacement is kept below ``atol + rtol max |displacement|`` [m].
    rows : tuple of ndarray, each r x n
        Groups of displacements as rows over the coordinates; a group shares its maximum. The first is the free end.
    modal : tuple of ndarray, n x n, or None
        Where a free vibration follows: rows from coordinates and from rates to the amplitudes of its modes at the free
        end. The error at the last step's end is then measured in them, so that it holds for the vibration too.
    """

    rtol: float
    atol: float
    rows: tuple[Array, ...]
    modal: tuple[Array, Array] | None = None

    def allowed(self, q: Array) -> list[float]:
        """Allowed error of each group along a motion [m]."""
        return [self.atol + self.rtol * float(np.abs(q @ rows.T).max()) for rows in self.rows]

    def errors(self, coarse: Trajectory, fine: Trajectory) -> list[float]:
        """Largest difference of two solutions in each group [m], at the ends and middles of the finer one's steps."""
        middles = 0.5 * (fine.edges[1:] + fine.edges[:-1])
        at_middles = fine.at_places((0.5,))[:, 0]
        difference = coarse(np.concatenate([fine.edges, middles]))[0] - np.concatenate([fine.q, at_middles])
        errors = [float(np.abs(difference @ rows.T).max()) for rows in self.rows]
        if self.modal is not None:
            ends = (self.modal[0] @ (coarse.q[-1] - fine.q[-1]), self.modal[1] @ (coarse.v[-1] - fine.v[-1]))
            errors[0] = max(errors[0], float(np.hypot(*ends).sum()))
        return errors

    def roughness(self, trajectory: Trajectory, allowed: list[float]) -> Array:
        """How far a step's highest Legendre terms move the watched displacements, as a part of what is allowed."""
        moved = trajectory.highest_terms()
        parts = [(moved @ np.abs(rows).T).max(axis=1) / bound for rows, bound in zip(self.rows, allowed, strict=True)]
        return np.max(parts, axis=0)


def refine(problem: Problem, edges: Array, start: tuple[Array, Array], accuracy: Accuracy) -> tuple[Trajectory, float]:
    """Solve on steps halved again and again until the watched displacements are as exact as asked for.

    The difference of two levels is the error of the coarser; the finer is returned. No order of convergence is taken
    for granted: while a faintly excited mode is not resolved, the differences fall at a rate that does not last. Only
    the steps that are not smooth are halved, or all of them if they are smooth but the levels disagree.

    Parameters
    ----------
    problem, edges, start
        As for `march`; `edges` are the first, coarsest steps.
    accuracy : Accuracy

    Returns
    -------
    trajectory : Trajectory
    error : float
        Estimated largest error of the free end's displacement, m; on the safe side.

    Raises
    ------
    SimulationError
        If the tolerance is not reached with the smallest step, the beginning shows that the whole would take far too many
        steps, or the equations have no solution from some instant on.
    """
    if edges.size > _LONG:
        first = edges[: edges.size // _PILOT]
        needed = refine(problem, first, start, accuracy)[0].edges.size / first.size * edges.size
        if needed > _HOPELESS * _MOST_STEPS:
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
        fine = march(problem, method, finer, start, coarse, _NEWTON_SHARE * min(allowed))
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
    """Ends of steps of half the length."""
    result = np.empty(2 * edges.size - 1)
    result[::2], result[1::2] = edges, 0.5 * (edges[1:] + edges[:-1])
    return result
