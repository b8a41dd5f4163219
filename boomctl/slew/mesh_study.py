"""How the error of a planned slew falls with the number of intervals."""

from dataclasses import dataclass
from importlib import import_module
from typing import Any

import numpy as np

from boomctl.arrays import Array
from boomctl.slew.problem import slew_problem
from boomctl.slew.programme import prepare
from boomctl.slew.reference import cheapest, guess_from, typical_sizes
from boomctl.slew.replay import end_error, played
from boomctl.slew.transcription import Scheme, transcribe

__all__ = ["MeshLine", "MeshStudy", "mesh_study"]


@dataclass(frozen=True, eq=False)
class MeshLine:
    """Errors of one scheme, relative: of the end state in the replay, or of the cost against the finest mesh."""

    name: str
    errors: Array
    order: float


@dataclass(frozen=True, eq=False)
class MeshStudy:
    """Errors over numbers of intervals."""

    intervals: Array
    lines: tuple[MeshLine, ...]

    def plot(self) -> Any:
        """Draw the errors; returns a matplotlib figure."""
        return import_module("boomctl.plotting").plot_mesh_study(self)


def mesh_study(
    h: object,
    angle: float,
    torque_limit: float,
    duration: float,
    schemes: tuple[tuple[str, int], ...] = (("shooting", 1), ("collocation", 2), ("radau", 2), ("collocation", 3)),
    intervals: tuple[int, ...] = (50, 100, 200, 400, 800),
) -> MeshStudy:
    """Solve a least-effort slew on several meshes.

    Parameters
    ----------
    h, angle, torque_limit, duration
        As in `optimal_slew`.
    schemes : tuple of (method, order)
        Order is the number of collocation points, or of substeps.
    intervals : tuple of int
        Ascending.

    Returns
    -------
    MeshStudy
        One line a scheme for the end state, and one for the cost of the last scheme: what holding the torque costs.
    """
    lines, cost = [], np.zeros(len(intervals))
    for method, order in schemes:
        problem = slew_problem(h, angle, torque_limit, "effort", duration, method=method)
        errors = np.empty(len(intervals))
        for k, count in enumerate(intervals):
            guess = guess_from(problem, cheapest(problem, duration, count).history, count, False)
            scheme = Scheme(method, "effort", count, order, False, False, ())
            units = typical_sizes(guess)
            parts = transcribe(problem.plants, scheme, units, torque_limit, duration, problem.ends)
            solution = prepare(parts, 1e-9).solve(problem, guess)
            errors[k], cost[k] = end_error(problem, played(problem, solution.history, 3)), solution.history.effort
        points = "substeps" if method == "shooting" else "points"
        lines.append(MeshLine(f"end state, {method}, {order} {points}", errors, _order(intervals, errors)))
    best = cost[-1] - (cost[-2] - cost[-1]) / 3.0
    held = np.abs(cost / best - 1.0)[:-1]
    lines.append(MeshLine("cost of holding the torque", np.append(held, 0.0), _order(intervals[:-1], held)))
    return MeshStudy(np.array(intervals), tuple(lines))


def _order(intervals: tuple[int, ...], errors: Array) -> float:
    """Slope of the errors that are above the floor of the replay's accuracy."""
    kept = errors > 3e-9
    kept &= np.arange(errors.size) >= 1
    if kept.sum() < 2:
        kept = np.arange(errors.size) < 2
    return float(-np.polyfit(np.log(np.array(intervals)[kept]), np.log(errors[kept]), 1)[0])
