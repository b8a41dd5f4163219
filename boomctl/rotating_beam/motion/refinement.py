"""Halve steps until two solutions agree: the error that is returned was measured, not assumed."""

from dataclasses import dataclass

import numpy as np

from boomctl.arrays import Array
from boomctl.gauss import CollocationMethod
from boomctl.rotating_beam.motion.collocation import Problem, march
from boomctl.rotating_beam.motion.trajectory import Trajectory

_MOST_STEPS = 40000
_SMOOTH = 0.02
"""A step is smooth if its highest terms contribute less than this part of the allowed error."""


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
        parts = [np.abs(moved @ rows.T).max(axis=1) / bound for rows, bound in zip(self.rows, allowed, strict=True)]
        return np.max(parts, axis=0)


class NotConverged(Exception):
    """The tolerance was not reached with the smallest step."""

    def __init__(self, error: float) -> None:
        super().__init__(f"the error stays at {error:g} m")
        self.error = error


def refine(
    problem: Problem,
    method: CollocationMethod,
    edges: Array,
    start: tuple[Array, Array],
    accuracy: Accuracy,
    window: int,
) -> tuple[Trajectory, float]:
    """Solve on steps halved again and again until the watched displacements are as exact as asked for.

    The difference of two levels is the error of the coarser; the finer is returned. No order of convergence is taken
    for granted: while a faintly excited mode is not resolved, the differences fall at a rate that does not last. Only
    the steps that are not smooth are halved, or all of them if they are smooth but the levels disagree.

    Parameters
    ----------
    problem, method, edges, start, window
        As for `march`; `edges` are the first, coarsest steps.
    accuracy : Accuracy

    Returns
    -------
    trajectory : Trajectory
    error : float
        Estimated largest error of the free end's displacement, m; on the safe side.

    Raises
    ------
    NotConverged
        If the tolerance is not reached.
    StepTooSmall
        If the equations have no solution from some instant on.
    """
    coarse = march(problem, method, edges, start, None, 1e-6, window)
    error = np.inf
    while coarse.edges.size <= _MOST_STEPS:
        allowed = accuracy.allowed(coarse.q)
        finer = _split(coarse.edges, accuracy.roughness(coarse, allowed) > _SMOOTH)
        fine = march(problem, method, finer, start, coarse, 0.05 * min(allowed), window)
        errors = accuracy.errors(coarse, fine)
        error = errors[0]
        if all(each <= bound for each, bound in zip(errors, allowed, strict=True)):
            return fine, error
        coarse = fine
    raise NotConverged(error)


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
