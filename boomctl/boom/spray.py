"""Spray deposit of moving nozzles on the field, and its uniformity.

Each nozzle is driven at ``V`` with the displacement ``y(t)`` relative to that.  Its spray falls on a footprint of the
ground: along the boom a triangle (or a box), along the driving direction a box; both are defined in :class:`Footprint`.  The
deposit is integrated in closed form for paths that are straight between samples, and averaged over the cells of a grid on the
ground, so the total is preserved.  Where a nozzle moves back over the ground (``y' < -V``) its passes add up.

Under a point footprint the dose is ``1/(1 + y'/V)`` times the nominal one; small motion varies it by ``sigma(y')/V``.
"""

from __future__ import annotations

from dataclasses import dataclass
from importlib import import_module
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from boomctl.arrays import Array
from boomctl.boom.motion import check_even
from boomctl.boom.parameters import BoomParameters
from boomctl.boom.tracks import SPEEDS
from boomctl.checks import exactly, finite_array, instance, known, nonnegative, positive, within
from boomctl.parameters import or_default
from boomctl.threads import one_blas_thread

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_SHAPES = ("triangle", "box")
_MOST_CELLS = 20_000_000  # Limit on the cells of a field: 160 MB.
_PORTION = 2_000_000  # Number of edges processed at once: some 100 MB of arrays.


@dataclass(frozen=True)
class Footprint:
    """Distribution of the spray of a nozzle on the ground.

    The model is a flat fan whose pattern overlaps with that of the next nozzle.

    Attributes
    ----------
    width : float
        Base of the pattern along the boom [m]; a triangle gives a uniform swath if it is twice the nozzles' spacing.
    thickness : float
        Length along the driving direction [m], with uniform density; may be zero, a line.
    shape : "triangle" or "box"
        Density of the spray along the boom.

    Raises
    ------
    TypeError, ValueError
        If `width` is not above zero, if `thickness` is negative, or if `shape` is unknown.

    Examples
    --------
    >>> import boomctl as bc
    >>> float(bc.boom.Footprint(width=1.0).cumulative(0.25))  # of the triangle
    0.875
    >>> float(bc.boom.Footprint(width=1.0, shape="box").cumulative(0.25))
    0.75
    """

    width: float = 1.0
    thickness: float = 0.1
    shape: str = "triangle"

    def __post_init__(self) -> None:
        positive("width", self.width)
        nonnegative("thickness", self.thickness)
        known("shape", self.shape, _SHAPES)

    def cumulative(self, offset: ArrayLike) -> Array:
        """Return the fraction of a nozzle's spray that falls left of ``x_nozzle + offset``.

        Parameters
        ----------
        offset : float or ndarray
            Position along the boom, relative to the nozzle [m].

        Returns
        -------
        float or ndarray
            From 0 to 1, in the shape of ``offset``.
        """
        s = np.clip(np.divide(offset, self.width), -0.5, 0.5)
        return 0.5 + (s if self.shape == "box" else 2.0 * s * (1.0 - np.abs(s)))


@dataclass(frozen=True, eq=False)
class SprayResult:
    """Spray on the field.

    Attributes
    ----------
    deposit : (nx, ny) ndarray
        Mean deposit of each cell over the nominal one; ``x`` along the boom from left to right, ``y`` along the drive.
    x_edges, y_edges : ndarray
        Edges of the cells [m].
    x_slice, y_slice : slice
        Evaluated cells: between the outermost nozzles, as far inside as a wide footprint needs for all
        neighbors to spray, and away from the ends of the run, on ground that no nozzle passed outside the record
        (if its displacement there was within that of the record).
    rms_tip_speed : float
        RMS of ``y'`` at the outermost points, the larger of the two [m/s].
    speed : float
        Driving speed [m/s].
    footprint : Footprint
        Footprint of each nozzle.
    """

    deposit: Array
    x_edges: Array
    y_edges: Array
    x_slice: slice
    y_slice: slice
    rms_tip_speed: float
    speed: float
    footprint: Footprint

    def __repr__(self) -> str:
        size = f"{self.evaluated_deposit.shape[0]} x {self.evaluated_deposit.shape[1]} cells evaluated"
        doses = f"doses {self.min_dose:.3f} to {self.max_dose:.3f} of the nominal one"
        outside = f"{100.0 * self.share_outside_10:.3g} % of the field outside 10 %"
        return f"SprayResult: CV {100.0 * self.cv:.4g} %, {size}\n  {doses}, {outside}"

    @property
    def evaluated_deposit(self) -> Array:
        """Deposit in the evaluated cells."""
        return self.deposit[self.x_slice, self.y_slice]

    @property
    def cv(self) -> float:
        """Coefficient of variation of the deposit: standard deviation over mean."""
        return float(self.evaluated_deposit.std() / self.evaluated_deposit.mean())

    @property
    def share_outside_10(self) -> float:
        """Fraction of the field whose deposit differs from the nominal one by more than 10 %."""
        return self.fraction_outside(0.1)

    @property
    def share_outside_20(self) -> float:
        """Fraction of the field whose deposit differs from the nominal one by more than 20 %."""
        return self.fraction_outside(0.2)

    def __figures__(self) -> dict[str, float]:
        """Return the metrics of a comparison."""
        return {
            "deposit: CV [%]": 100.0 * self.cv,
            "deposit: outside 10 % [% of field]": 100.0 * self.share_outside_10,
            "deposit: lowest dose": self.min_dose,
            "deposit: highest dose": self.max_dose,
        }

    def fraction_outside(self, tolerance: float) -> float:
        """Return the fraction of the field whose deposit differs from the nominal one by more than a tolerance.

        Parameters
        ----------
        tolerance : float
            Relative to the nominal deposit: 0.1 for 10 %.

        Returns
        -------
        float
            Fraction of the evaluated cells, from 0 to 1.

        Raises
        ------
        TypeError, ValueError
            If `tolerance` is not a number or negative.
        """
        return float((np.abs(self.evaluated_deposit - 1.0) > nonnegative("tolerance", tolerance)).mean())

    @property
    def min_dose(self) -> float:
        """Minimum deposit of a cell relative to the nominal one."""
        return float(self.evaluated_deposit.min())

    @property
    def max_dose(self) -> float:
        """Largest deposit of a cell over the nominal one."""
        return float(self.evaluated_deposit.max())

    def plot(
        self, ax: Axes | None = None, *, label: str = "deposit", length: float | None = None, **style: Any
    ) -> Axes:
        """Draw the deposit on the field with its color scale, which is the same for all deposits.

        Parameters
        ----------
        ax : matplotlib Axes, optional
            Axes to draw on.  If None, a new figure is created.
        label : str, default: "deposit"
            The title.
        length : float, optional
            Length of field to show [m], from the first evaluated cell.  If None, all evaluated cells.
        **style
            Properties of the map, passed to `matplotlib.axes.Axes.pcolormesh`.

        Returns
        -------
        matplotlib.axes.Axes
            Those drawn on.
        """
        return import_module("boomctl.plotting.spray").plot_deposit(self, ax, label=label, length=length, **style)

    @property
    def relative_tip_speed(self) -> float:
        """RMS tip speed over driving speed."""
        return self.rms_tip_speed / self.speed

    @property
    def worst_dose(self) -> float:
        """The dose furthest from the nominal one, in ratio: the highest, or the lowest if its inverse is larger."""
        farther_low = self.min_dose <= 0.0 or 1.0 / self.min_dose > self.max_dose
        return self.min_dose if farther_low else self.max_dose


def nozzle_positions(parameters: BoomParameters | None = None, spacing: float = 0.5) -> Array:
    """Return the positions of equally spaced nozzles along a boom.

    Parameters
    ----------
    parameters : BoomParameters, optional
        The boom; by default that of Anthonis & Ramon (2003), Table 2.
    spacing : float
        Distance between nozzles [m].

    Returns
    -------
    (n,) ndarray
        Positions from left to right, 0 at the center [m]; the maximum number that fits the length.  If ``spacing``
        divides the length, the outermost nozzles are half a spacing from the tips.

    Raises
    ------
    TypeError, ValueError
        If a value is not above zero, or if the spacing is longer than the boom or gives too many nozzles.

    Examples
    --------
    >>> import boomctl as bc
    >>> bc.nozzle_positions(spacing=2.0)
    array([-5., -3., -1.,  1.,  3.,  5.])
    """
    length = or_default(BoomParameters, "parameters", parameters).length
    count = int(length / within("spacing", spacing, length / _MOST_CELLS, length, "m") + 1e-9)
    return spacing * (np.arange(count) - 0.5 * (count - 1))


@one_blas_thread
def spray_deposit(
    time: ArrayLike,
    displacement: ArrayLike,
    positions: ArrayLike,
    speed: float,
    *,
    nozzles: ArrayLike | None = None,
    footprint: Footprint | None = None,
    cell_size: float | tuple[float, float] = 0.1,
) -> SprayResult:
    """Return the spray deposit of the nozzles of a moving boom.

    Parameters
    ----------
    time : (n,) array_like
        Times, equally spaced [s].
    displacement : (k, n) array_like
        Forward displacement of ``k`` points of the boom from uniform driving [m].
    positions : (k,) array_like
        Positions of these points along the boom, ascending [m].
    speed : float
        Driving speed [m/s].
    nozzles : array_like, optional
        Positions of the nozzles, equally spaced, between the first and the last point [m], with linear interpolation
        between the points.  By default there is a nozzle at each point.
    footprint : Footprint, optional
        By default a triangle along the boom, twice the nozzle spacing wide, and 0.1 m in the driving direction.
    cell_size : float or (float, float)
        Size of the cells of the field along the boom and in the driving direction [m].

    Returns
    -------
    SprayResult
        The deposit of each cell relative to the nominal one, its coefficient of variation ``cv`` and its extremes.

    Raises
    ------
    TypeError, ValueError
        If shapes do not match, if values are not finite, if times are not equally spaced, if nozzles are outside the points
        or not equally spaced, if the run is too short or the footprint too wide to evaluate a cell, or if the motion or
        footprint is too large for the size of the cells.

    Examples
    --------
    >>> import boomctl as bc
    >>> import numpy as np
    >>> time, positions = np.arange(0.0, 20.0, 0.01), [-6.0, 6.0]
    >>> yaw = np.outer([-1.0, 1.0], 0.1 * np.sin(2.0 * np.pi * 0.25 * time))  # tip amplitude 0.1 m
    >>> spray = bc.spray_deposit(time, yaw, positions, speed=2.5, nozzles=bc.nozzle_positions())
    >>> round(spray.cv, 4), round(spray.min_dose, 3), round(spray.max_dose, 3)
    (0.0245, 0.944, 1.063)
    """
    t, x, moved = _points(time, displacement, positions)
    V = within("speed", speed, *SPEEDS, "m/s")
    at, spacing = _nozzles(nozzles, x)
    pattern = Footprint(2.0 * spacing) if footprint is None else instance("footprint", footprint, Footprint)
    sizes = cell_size if isinstance(cell_size, tuple) else (cell_size, cell_size)
    if len(sizes) != 2:
        raise ValueError(
            f"`cell_size` must be one size, or those along the boom and along the drive, got {cell_size!r}."
        )
    dx, dy = (positive("cell_size", size) for size in sizes)
    weights = np.array([np.interp(at, x, unit) for unit in np.eye(len(x))])
    offset, driven = weights.T @ moved, V * (t - t[0])
    path, half = offset + driven, 0.5 * pattern.thickness
    _check_size(path, (dx, dy), (at[-1] - at[0] + pattern.width) / dx, pattern.thickness)
    x_edges = _edges(at[0] - 0.5 * pattern.width, at[-1] + 0.5 * pattern.width, dx, origin=at[0])
    y_edges = _edges(path.min() - half, path.max() + half, dy)
    widths = np.diff(pattern.cumulative(x_edges[:, None] - at), axis=0) * (spacing / dx)
    stays = np.array([np.diff(_stay_below(y_edges, line, t, pattern.thickness)) for line in path])
    lacking = max(0.5 * pattern.width - spacing, 0.0)
    lacks = f"footprint: no cell of {dx:g} m between the nozzles at {at[0]:g} and {at[-1]:g} m is sprayed by all"
    lacks += f" neighbors {pattern.width:g} m wide"
    across = _within(x_edges, at[0] + lacking, at[-1] - lacking, lacks)
    short = f"time: the run of {t[-1] - t[0]:g} s is too short to evaluate a cell"
    along = _within(y_edges, offset.max() + half, driven[-1] + offset.min() - half, short)
    tips = np.sqrt(np.mean((np.diff(moved[[0, -1]]) / np.diff(t)) ** 2, axis=1)).max()
    return SprayResult(
        deposit=widths @ stays * (V / dy),
        x_edges=x_edges,
        y_edges=y_edges,
        x_slice=across,
        y_slice=along,
        rms_tip_speed=float(tips),
        speed=V,
        footprint=pattern,
    )


def _check_size(path: Array, cell: tuple[float, float], columns: float, thickness: float) -> None:
    """Raise ValueError if the field has too many cells, as for the motion of an unstable loop."""
    extent, travel = np.ptp(path) + thickness, np.abs(np.diff(path)).sum(axis=1).max()
    if max(extent / cell[1], 1.0) * max(columns, 1.0) > _MOST_CELLS or travel / cell[1] > _MOST_CELLS:
        raise ValueError(
            f"displacement: nozzles travel {travel:.3g} m over {extent:.3g} m of ground, too much for cells of"
            f" {cell[0]:g} by {cell[1]:g} m"
        )


def split_jolt_yaw(displacement: ArrayLike, positions: ArrayLike) -> tuple[Array, Array]:
    """Return the symmetric (jolt) and the antisymmetric (yaw) part of the motion of points of a boom.

    Parameters
    ----------
    displacement : (k, n) array_like
        Displacements of ``k`` points [m].
    positions : (k,) array_like
        Where they are along the boom, ascending and symmetric about ``x = 0`` [m].

    Returns
    -------
    jolt, yaw : (k, n) ndarray
        The two parts [m]; they add up to ``displacement``.

    Raises
    ------
    TypeError, ValueError
        Shapes that do not fit; values that are not finite; points that have no mirror image.

    Examples
    --------
    >>> import boomctl as bc
    >>> jolt, yaw = bc.boom.split_jolt_yaw([[0.0, 0.0], [0.0, 0.2]], positions=[-6.0, 6.0])  # only the right tip moves
    >>> jolt[:, 1], yaw[:, 1]
    (array([0.1, 0.1]), array([-0.1,  0.1]))
    """
    x = finite_array("positions", positions, ndim=1)
    moved = finite_array("displacement", displacement, ndim=2)
    if len(x) != len(moved):
        raise ValueError(f"displacement: expected {len(x)} rows, one a position, got shape {moved.shape}")
    if np.abs(x + x[::-1]).max(initial=0.0) > 1e-9 * np.abs(x).max(initial=0.0):
        raise ValueError("positions: expected points that lie symmetrically about x = 0")
    return 0.5 * (moved + moved[::-1]), 0.5 * (moved - moved[::-1])


@one_blas_thread
def spray_deposit_components(
    time: ArrayLike,
    displacement: ArrayLike,
    positions: ArrayLike,
    speed: float,
    *,
    nozzles: ArrayLike | None = None,
    footprint: Footprint | None = None,
    cell: float | tuple[float, float] = 0.1,
) -> tuple[SprayResult, SprayResult, SprayResult]:
    """Return the spray of the total motion, of its jolt alone and of its yaw alone.

    The comparison shows which of the two dominates the error of the deposit.

    Parameters
    ----------
    time, displacement, positions, speed, nozzles, footprint, cell
        See :func:`spray_deposit`; the points must be symmetric about ``x = 0``.

    Returns
    -------
    total, jolt, yaw : SprayResult
        Results of :func:`spray_deposit`.

    Raises
    ------
    TypeError, ValueError
        See :func:`spray_deposit`; also if a point has no mirror image.

    Examples
    --------
    >>> import boomctl as bc
    >>> import numpy as np
    >>> time = np.arange(0.0, 20.0, 0.01)
    >>> right = np.outer([0.0, 1.0], 0.1 * np.sin(2.0 * np.pi * 0.25 * time))  # only the right tip moves
    >>> results = bc.spray_deposit_components(time, right, [-6.0, 6.0], speed=2.5, nozzles=bc.nozzle_positions())
    >>> [round(result.cv, 4) for result in results]
    [0.0253, 0.0222, 0.0123]
    """
    total, jolt, yaw = (
        spray_deposit(time, part, positions, speed, nozzles=nozzles, footprint=footprint, cell_size=cell)
        for part in (displacement, *split_jolt_yaw(displacement, positions))
    )
    return total, jolt, yaw


def _points(time: ArrayLike, displacement: ArrayLike, positions: ArrayLike) -> tuple[Array, Array, Array]:
    t, x = finite_array("time", time, ndim=1), finite_array("positions", positions, ndim=1)
    moved = finite_array("displacement", displacement, ndim=2)
    if len(t) < 2 or moved.shape != (len(x), len(t)):
        raise ValueError(
            f"displacement: expected {len(x)} positions by {len(t)} times, at least two, got shape {moved.shape}"
        )
    if len(x) < 2 or not (np.diff(x) > 0.0).all():
        raise ValueError("positions: expected at least two points, ascending")
    check_even(t)
    return t, x, moved


def _nozzles(nozzles: ArrayLike | None, x: Array) -> tuple[Array, float]:
    """Return the positions of the nozzles between the points ``x``, and their spacing."""
    at = x if nozzles is None else finite_array("nozzles", nozzles, ndim=1)
    gaps = np.diff(at)
    if len(at) < 2 or gaps.min() <= 0.0 or np.ptp(gaps) > 1e-6 * gaps.max():
        raise ValueError("`nozzles` must be at least two positions, ascending and equally spaced.")
    if at[0] < x[0] - 1e-9 or at[-1] > x[-1] + 1e-9:
        raise ValueError(f"`nozzles` must be between the points given, {exactly(x[0])} to {exactly(x[-1])} m.")
    return at, float(gaps.mean())


def _edges(low: float, high: float, size: float, origin: float = 0.0) -> Array:
    """Return edges with spacing ``size``, one of them at ``origin``, that cover ``low`` to ``high``."""
    first, last = np.floor((low - origin) / size - 1e-9), np.ceil((high - origin) / size + 1e-9)
    return origin + size * np.arange(first, last + 1)


def _within(edges: Array, low: float, high: float, message: str) -> slice:
    """Return the cells that are entirely between two positions; raise ValueError with ``message`` if there are none."""
    slack = 1e-9 * (edges[1] - edges[0])
    inside = np.flatnonzero((edges[:-1] >= low - slack) & (edges[1:] <= high + slack))
    if not len(inside):
        raise ValueError(message)
    return slice(int(inside[0]), int(inside[-1]) + 1)


def _stay_below(edges: Array, path: Array, time: Array, thickness: float) -> Array:
    """Return the duration for which the spray of a nozzle falls behind each edge [s].

    During a step of ``dt`` from ``Y0`` to ``Y1`` the spray is spread over ground as the convolution of two boxes, the
    distance and the thickness; a step counts in full at the edges ahead of that and in part at those within.
    """
    dt, travel = np.diff(time), np.abs(np.diff(path))
    begin = np.minimum(path[1:], path[:-1]) - 0.5 * thickness
    size = edges[1] - edges[0]
    first = np.ceil((begin - edges[0]) / size).astype(np.intp)
    done = np.ceil((begin + travel + thickness - edges[0]) / size).astype(np.intp)
    count = np.maximum(done - first, 0)
    narrow, broad = np.minimum(travel, thickness), np.maximum(travel, thickness)
    parts = np.zeros(len(edges))
    cuts = np.searchsorted(np.cumsum(count), np.arange(_PORTION, count.sum(), _PORTION))
    for some in np.split(np.arange(len(dt)), cuts):
        many = count[some]
        step, before = np.repeat(some, many), np.cumsum(many) - many
        edge = np.arange(len(step)) - np.repeat(before - first[some], many)
        part = _two_boxes(edges[edge] - begin[step], narrow[step], broad[step])
        parts += np.bincount(edge, dt[step] * part, minlength=len(edges))
    whole = np.cumsum(np.bincount(done, dt, minlength=len(edges)))[: len(edges)]
    return whole + parts


def _two_boxes(u: Array, narrow: Array, broad: Array) -> Array:
    """Return the fraction below ``u`` of the convolution of two boxes that begin at zero, one of them of nonzero breadth."""
    least = np.finfo(float).tiny
    slim, wide = np.maximum(narrow, least), np.maximum(broad, least)
    left, rest = np.clip(u, 0.0, narrow), np.clip(narrow + broad - u, 0.0, narrow)
    rise, level = 0.5 * left * (left / slim) / wide, (np.minimum(u, broad) - 0.5 * narrow) / wide
    return np.where(u < narrow, rise, np.where(u < broad, level, 1.0 - 0.5 * rest * (rest / slim) / wide))
