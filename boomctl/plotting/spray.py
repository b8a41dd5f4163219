"""Pictures of excitation and spray: deposit on the field, motion over time, tracks beside their class."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from boomctl.arrays import Array
from boomctl.checks import finite_array, positive, real
from boomctl.plotting.canvas import COLOURS, divided, legend, line_look, over_time, panels

if TYPE_CHECKING:
    from boomctl.boom.motion import PlatformMotion
    from boomctl.boom.spray import SprayResult
    from boomctl.boom.tracks import Track

# doses at which the colour changes: ±2, 5, 10 and 20 % as deposits are judged by, then coarser
_STEPS = (0.0, 0.5, 0.8, 0.9, 0.95, 0.98, 1.02, 1.05, 1.1, 1.2, 1.5, 2.0)
_SHADES = (
    "#67001f",
    "#b2182b",
    "#d6604d",
    "#f4a582",
    "#fddbc7",
    "#f7f7f7",
    "#d1e5f0",
    "#92c5de",
    "#4393c3",
    "#2166ac",
    "#053061",
)
_MORE = "#1a0a3c"


def plot_deposit(result: SprayResult, ax: Any = None, *, label: str = "deposit", **style: Any) -> Any:
    """Draw the deposit on the field.

    Parameters
    ----------
    result : SprayResult
    ax : matplotlib Axes or figure, optional
        By default a new figure of pyplot.
    label : str
        The title.
    **style
        Of the map, as matplotlib's ``pcolormesh`` takes it.

    Returns
    -------
    matplotlib Axes
    """
    return draw_deposit({label: result}, ax=ax, **style)[0]


def draw_deposit(
    results: Mapping[str, SprayResult],
    length: float | None = None,
    start: float | None = None,
    ax: Any = None,
    **style: Any,
) -> Array:
    """Draw the deposit on the field, one panel a result, all on one scale of discrete steps about the nominal dose.

    Parameters
    ----------
    results : mapping of str to SprayResult
        By title, for instance of the passive and of the active suspension.
    length : float, optional
        Of field to show [m]; by default all that is judged.
    start : float, optional
        Where it begins [m]; by default where judging does.
    ax : sequence of matplotlib Axes, or a figure, optional
        One a result; by default a new figure of pyplot.
    **style
        Of the maps, as matplotlib's ``pcolormesh`` takes it.

    Returns
    -------
    (n,) ndarray of matplotlib Axes

    Raises
    ------
    TypeError, ValueError
        No results by title; a length not above zero, a start that is no number; other axes, or not so many.
    """
    from matplotlib.colors import BoundaryNorm, ListedColormap

    if not isinstance(results, Mapping):
        raise TypeError(f"results: expected a mapping from title to SprayResult, got {type(results).__name__}")
    if not results:
        raise ValueError("results: expected at least one")
    extent = None if length is None else positive("length", length)
    begin = None if start is None else real("start", start)
    colours = ListedColormap(list(_SHADES), over=_MORE)
    look: dict[str, Any] = {"cmap": colours, "norm": BoundaryNorm(_STEPS, len(_SHADES)), "rasterized": True, **style}
    divide = divided(len(results), 1, sharex=True, sharey=True)
    with panels(ax, list(results), (9.0, 1.2 + 1.75 * len(results)), divide) as axes:
        drawn: Any = None
        for each, (title, result) in zip(axes, results.items(), strict=True):
            drawn = each.pcolormesh(result.y_edges, result.x_edges, result.deposit, **look)
            _frame(each, result, extent, begin)
            each.set_title(f"{title}: {_figures(result)}", fontsize=8.5)
            each.set_ylabel("along boom [m]")
        axes[-1].set_xlabel("along the drive [m]  (boom moves to the right)")
        options: dict[str, Any] = (
            {"spacing": "uniform", "ticks": _STEPS, "extend": "max"} if "norm" not in style else {}
        )
        bar = axes[0].figure.colorbar(drawn, ax=list(axes), aspect=12 + 8 * len(results), **options)
        if options:
            bar.ax.set_yticklabels([f"{step:g}" for step in _STEPS])
        bar.set_label("deposit over nominal" + ("" if "cmap" in style else "\n(red: too little, blue: too much)"))
    return axes


def _frame(ax: Any, result: SprayResult, length: float | None, start: float | None) -> None:
    """Show the part of the field that is judged."""
    along, across = result.y_judged, result.x_judged
    begin = result.y_edges[along.start] if start is None else start
    end = result.y_edges[along.stop] if length is None else begin + length
    ax.set_xlim(begin, end)
    ax.set_ylim(result.x_edges[across.start], result.x_edges[across.stop])
    ax.grid(visible=False)


def _figures(result: SprayResult) -> str:
    return (
        f"CV {100 * result.cv:.1f} %, {_share(result.share_outside_10)} outside ±10 %,"
        f" {_share(result.share_outside_20)} outside ±20 %, doses {result.lowest_dose:.2f} to {result.highest_dose:.2f}"
    )


def _share(value: float) -> str:
    return "none" if value == 0.0 else "< 0.1 %" if value < 0.001 else f"{100 * value:.1f} %"


def draw_motion(
    motion: PlatformMotion,
    tips: Mapping[str, ArrayLike],
    span: tuple[float, float] | None = None,
    ax: Any = None,
    **style: Any,
) -> Array:
    """Draw the platform's jolt and yaw over time, and the tips' motion below it.

    Parameters
    ----------
    motion : PlatformMotion
    tips : mapping of str to (2, n) array_like
        Forward displacements of the left and the right tip [m] at the motion's times, by title; one panel each, all on
        one scale.
    span : (float, float), optional
        Times to show [s].
    ax : sequence of matplotlib Axes, or a figure, optional
        One for the platform and one for each of the tips' motions; by default a new figure of pyplot.
    **style
        Of the curves, as matplotlib's lines take it.

    Returns
    -------
    (n,) ndarray of matplotlib Axes

    Raises
    ------
    TypeError, ValueError
        Tips that are not two rows of finite numbers, one a time of the motion; a span without two of these times.
    """
    moved = {title: 1e3 * finite_array(f"tips[{title!r}]", value, ndim=2) for title, value in tips.items()}
    for title, lines in moved.items():
        if lines.shape != (2, len(motion.time)):
            raise ValueError(f"tips[{title!r}]: expected shape {(2, len(motion.time))}, got {lines.shape}")
    shown = np.ones(len(motion.time), dtype=bool)
    if span is not None:
        begin, end = (real("span", value) for value in span)
        shown = (motion.time >= begin) & (motion.time <= end)
        if shown.sum() < 2:
            raise ValueError(
                f"span = ({begin:g}, {end:g}): expected times within {motion.time[0]:g} to {motion.time[-1]:g} s,"
                " the earlier first"
            )
    with panels(ax, ["platform", *moved], (8.0, 2.2 + 1.6 * len(tips))) as axes:
        turned = 0.5e3 * motion.actuator_distance * motion.yaw
        for line, name, colour in ((1e3 * motion.jolt, "jolt", 0), (turned, "yaw, at an actuator", 1)):
            axes[0].plot(motion.time, line, **line_look(style, color=COLOURS[colour], linewidth=1.0, label=name))
        axes[0].set_title("platform")
        if span is not None:
            axes[0].set_xlim(*span)
        largest = 0.0
        for each, (title, lines) in zip(axes[1:], moved.items(), strict=True):
            for side, line, colour in zip(("left tip", "right tip"), lines, COLOURS[2:4], strict=True):
                each.plot(motion.time, line, **line_look(style, color=colour, linewidth=1.0, label=side))
            largest = max(largest, float(np.abs(lines[:, shown]).max()))
            each.set_title(title)
        for each in axes:
            each.set_ylabel("ahead [mm]")
            each.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), borderaxespad=0.1, ncols=2)
        for each in axes[1:] if largest > 0.0 else ():
            each.set_ylim(-1.25 * largest, 1.25 * largest)
        axes[-1].set_xlabel("time [s]")
    return axes


def plot_track(track: Track, ax: Any = None, **style: Any) -> Any:
    """Draw the height of the ground under the left and the right wheels over the distance.

    Parameters
    ----------
    track : Track
    ax : matplotlib Axes or figure, optional
        By default a new figure of pyplot.
    **style
        Of the curves, as matplotlib's lines take it; a ``label`` stands before their names.

    Returns
    -------
    matplotlib Axes
    """
    with panels(ax, ("height",), (7.4, 2.8)) as (axes,):
        for side, heights, colour in (("left", track.left, COLOURS[0]), ("right", track.right, COLOURS[1])):
            axes.plot(track.distance, 1e3 * heights, **line_look(style, color=colour, linewidth=1.0, label=side))
        axes.set(xlabel="distance [m]", ylabel="height [mm]")
        axes.set_xmargin(0.0)
        axes.legend()
    return axes


def plot_motion(motion: PlatformMotion, ax: Any = None, **style: Any) -> Array:
    """Draw jolt and yaw of the platform over time.

    Parameters
    ----------
    motion : PlatformMotion
    ax : sequence of two matplotlib Axes, or a figure, optional
        By default a new figure of pyplot.
    **style
        Of the curves, as matplotlib's lines take it.

    Returns
    -------
    (2,) ndarray of matplotlib Axes
    """
    with panels(ax, ("jolt", "yaw"), (7.4, 4.0)) as axes:
        look = line_look(style, linewidth=1.0)
        for each, values in zip(axes, (1e3 * motion.jolt, 1e3 * motion.yaw), strict=True):
            each.plot(motion.time, values, **look)
        legend(axes[0])
        over_time(axes, ("jolt, ahead [mm]", "yaw [mrad]"))
    return axes
