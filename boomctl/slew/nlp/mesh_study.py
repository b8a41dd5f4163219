"""How the error of a planned slew falls with the number of intervals."""

from dataclasses import dataclass
from importlib import import_module
from typing import TYPE_CHECKING, Any

import numpy as np

from boomctl.arrays import Array
from boomctl.checks import known, sequence, shown, whole
from boomctl.printing import compact, listed
from boomctl.progress import Listener, computing, tell
from boomctl.slew.linear import guess_from, least_effort
from boomctl.slew.nlp.programme import prepare
from boomctl.slew.nlp.transcription import Scheme
from boomctl.slew.problem import MESHES, METHODS, Limits, slew_problem
from boomctl.slew.replay import played, prescribed_error
from boomctl.slew.result import SlewError
from boomctl.threads import one_blas_thread

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_FLOOR = 3e-9  # error below which a replay, to 1e-10, does not tell schemes apart
_HIGHEST_ORDER = 9  # of a scheme: CasADi knows as many collocation points (a limit of theirs)
_TOLERANCE = 1e-9  # of the end, for which IPOPT is to leave nothing of its own


@dataclass(frozen=True, eq=False)
class MeshLine:
    """One curve of errors over meshes.

    Attributes
    ----------
    name : str
        What is in error, and of which scheme.
    errors : ndarray, k
        Relative: of the end state in the replay, or of the cost against the finest mesh. NaN where the mesh has no
        solution, 0 where the error is measured from.
    order : float
        Slope of the errors above the floor of the replay's accuracy; NaN if fewer than two are.
    theory : float
        The order in the limit of fine meshes.
    """

    name: str
    errors: Array
    order: float
    theory: float

    __repr__ = compact


@dataclass(frozen=True, eq=False)
class MeshStudy:
    """Errors over numbers of intervals, of a slew of least effort.

    Attributes
    ----------
    duration : float
        How long the slew takes [s].
    intervals : ndarray, k
        Numbers of intervals.
    lines : tuple of MeshLine
        One curve of errors for the end state of each scheme, and one for the cost of the last.
    """

    duration: float
    intervals: Array
    lines: tuple[MeshLine, ...]

    def __repr__(self) -> str:
        orders = [f"{line.name}: order {line.order:.3g} (in theory {line.theory:.3g})" for line in self.lines]
        meshes = f"{self.intervals[0]} to {self.intervals[-1]} intervals"
        return f"MeshStudy: a slew of {self.duration:.6g} s on {meshes}\n  {listed(orders, 94)}"

    def plot(self, ax: "Axes | None" = None, **style: Any) -> "Axes":
        """Draw the errors over the number of intervals.

        Parameters
        ----------
        ax : matplotlib Axes, optional
            Where to draw; by default a new figure of pyplot.
        **style
            Of the curves, as matplotlib's lines take it; a ``label`` stands before their names.

        Returns
        -------
        matplotlib.axes.Axes
            Those drawn on.
        """
        return import_module("boomctl.plotting").plot_mesh_study(self, ax, **style)


@one_blas_thread
def mesh_study(
    h: object,
    angle: float,
    torque_limit: float,
    duration: float,
    schemes: tuple[tuple[str, int], ...] = (("shooting", 1), ("collocation", 2), ("radau", 2), ("collocation", 3)),
    intervals: tuple[int, ...] = MESHES,
    *,
    progress: "Listener | None" = None,
) -> MeshStudy:
    """Solve a slew of least effort on several meshes, and measure how the error falls.

    Parameters
    ----------
    h, angle, torque_limit, duration
        As in `optimal_slew`.
    schemes : tuple of (method, order)
        Methods of `optimal_slew`; the order is the number of collocation points, or of substeps.
    intervals : tuple of int
        Numbers of intervals, ascending.
    progress : callable, optional
        Is told a `Progress` at each stage.  Without one, after three seconds a line on a terminal or in a notebook says
        what goes on; `listening` hears whatever runs within it.

    Returns
    -------
    MeshStudy
        One line a scheme for the end state, and one for the cost of the last scheme: what holding the torque costs. A
        mesh without a solution leaves a gap.

    Raises
    ------
    TypeError, ValueError, SlewError
        As for `optimal_slew`.

    Examples
    --------
    >>> import boomctl as bc
    >>> found = bc.slew.mesh_study(bc.hub_beam(modes=1), 1.0, 200.0, 4.0, (("collocation", 2),), intervals=(20, 40))
    >>> round(found.lines[0].order, 1), found.lines[0].theory
    (3.9, 4.0)
    """
    meshes = [whole("intervals", number, 4) for number in sequence("intervals", intervals, "whole numbers")]
    if len(meshes) < 2 or not (np.diff(meshes) > 0).all():
        raise ValueError(f"intervals = {shown(intervals)}: expected two whole numbers at least, ascending")
    for scheme in sequence("schemes", schemes, "pairs (method, order)"):
        if len(sequence("schemes", scheme, "pairs (method, order)")) != 2:
            raise ValueError(f"schemes: expected pairs (method, order), got {shown(scheme)}")
        known("method of a scheme", scheme[0], METHODS)
        whole("order of a scheme", scheme[1], most=_HIGHEST_ORDER)
    lines, cost = [], np.zeros(len(intervals))
    with computing("mesh study", progress):
        for method, order in schemes:
            problem = slew_problem(h, angle, Limits(torque_limit), "effort", duration, method=method)
            errors = np.full(len(intervals), np.nan)
            cost = np.full(len(intervals), np.nan)
            for k, count in enumerate(intervals):
                tell(
                    f"{_label(method, order)}, {count} intervals",
                    len(lines) * len(intervals) + k,
                    len(schemes) * len(intervals),
                )
                guess = guess_from(problem, least_effort(problem, duration, count).history, count)
                programme = prepare(problem, Scheme(method, "effort", count, order), guess, _TOLERANCE)
                try:
                    history = programme.solve(problem, guess).history
                except SlewError:
                    continue
                errors[k], cost[k] = prescribed_error(problem, played(problem, history, 3)), history.effort
            theory = {"shooting": 4.0, "collocation": 2.0 * order, "radau": 2.0 * order - 1.0}[method]
            lines.append(MeshLine(_label(method, order), errors, _slope(intervals, errors), theory))
    best = cost[-1] - (cost[-2] - cost[-1]) / 3.0
    held = np.append(np.abs(cost / best - 1.0)[:-1], 0.0)
    lines.append(MeshLine("least effort, torque held on each interval", held, _slope(intervals, held), 2.0))
    return MeshStudy(duration, np.array(intervals), tuple(lines))


def _label(method: str, order: int) -> str:
    rule = {"shooting": "shooting", "collocation": "Gauss collocation", "radau": "Radau collocation"}[method]
    part = "substep" if method == "shooting" else "point"
    return f"end state, {rule}, {order} {part}{'s' if order > 1 else ''}"


def _slope(intervals: tuple[int, ...], errors: Array) -> float:
    """Slope of the errors above the floor; the coarsest mesh counts only where it is needed."""
    above = np.flatnonzero(errors > _FLOOR)
    kept = above[above > 0] if above.size > 2 else above
    if kept.size < 2:
        return float("nan")
    return float(-np.polyfit(np.log(np.array(intervals)[kept]), np.log(errors[kept]), 1)[0])
