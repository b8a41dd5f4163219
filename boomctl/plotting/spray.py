"""Plots of excitation and spray: deposit on the field, motion over time, tracks."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from boomctl.arrays import Array
from boomctl.checks import positive
from boomctl.plotting.canvas import COLORS, legend, line_look, over_time, panels

if TYPE_CHECKING:
    from boomctl.boom.motion import PlatformMotion
    from boomctl.boom.spray import SprayResult
    from boomctl.boom.tracks import Track

# Doses at which the color changes: ±2, 5, 10 and 20 %, then coarser.
_DOSES = (0.0, 0.5, 0.8, 0.9, 0.95, 0.98, 1.02, 1.05, 1.1, 1.2, 1.5, 2.0)
_MORE = "#1a0a3c"


def plot_deposit(
    result: SprayResult, ax: Any = None, *, label: str = "deposit", length: float | None = None, **style: Any
) -> Any:
    """Draw the deposit on the field, on a scale of discrete steps about the nominal dose.

    Parameters
    ----------
    result : SprayResult
    ax : matplotlib Axes or figure, optional
        Axes to draw on. If None, a new figure is created.
    label : str
        The title.
    length : float, optional
        Of field to show [m], from the first cell that counts; by default all cells that count.
    **style
        Of the map, as matplotlib's ``pcolormesh`` takes it.

    Returns
    -------
    matplotlib Axes

    Raises
    ------
    TypeError, ValueError
        A length not above zero; other axes.
    """
    from matplotlib import colormaps
    from matplotlib.colors import BoundaryNorm

    along, across = result.y_slice, result.x_slice
    begin = result.y_edges[along.start]
    end = result.y_edges[along.stop] if length is None else begin + positive("length", length)
    colors = colormaps["RdBu"].resampled(len(_DOSES) - 1).with_extremes(over=_MORE)
    look: dict[str, Any] = {"cmap": colors, "norm": BoundaryNorm(_DOSES, colors.N), "rasterized": True, **style}
    options: dict[str, Any] = {"spacing": "uniform", "ticks": _DOSES, "extend": "max"} if "norm" not in style else {}
    with panels(ax, ("deposit",), (9.0, 2.95)) as (axes,):
        drawn = axes.pcolormesh(result.y_edges, result.x_edges, result.deposit, **look)
        axes.set(xlim=(begin, end), ylim=(result.x_edges[across.start], result.x_edges[across.stop]))
        axes.grid(visible=False)
        axes.set_title(f"{label}\n{_figures(result)}", fontsize=8.5)
        axes.set(xlabel="along the drive [m]  (boom moves to the right)", ylabel="along boom [m]")
        bar = axes.figure.colorbar(drawn, ax=axes, aspect=20, **options)
        if options:
            bar.ax.set_yticklabels([f"{step:g}" for step in _DOSES])
        bar.set_label("deposit over nominal" + ("" if "cmap" in style else "\n(red: too little, blue: too much)"))
    return axes


def _figures(result: SprayResult) -> str:
    return (
        f"CV {100 * result.cv:.1f} %, {_percent(result.share_outside_10)} outside ±10 %,"
        f" {_percent(result.share_outside_20)} outside ±20 %, doses {result.min_dose:.2f} to {result.max_dose:.2f}"
    )


def _percent(value: float) -> str:
    return "none" if value == 0.0 else "< 0.1 %" if value < 0.001 else f"{100 * value:.1f} %"


def plot_track(track: Track, ax: Any = None, **style: Any) -> Any:
    """Draw the height of the ground under the left and the right wheels over the distance.

    Parameters
    ----------
    track : Track
    ax : matplotlib Axes or figure, optional
        Axes to draw on. If None, a new figure is created.
    **style
        Line properties, passed to `matplotlib.axes.Axes.plot`; ``label`` is prefixed to the labels.

    Returns
    -------
    matplotlib Axes
    """
    with panels(ax, ("height",), (7.4, 2.8)) as (axes,):
        for side, heights, color in (("left", track.left, COLORS[0]), ("right", track.right, COLORS[1])):
            axes.plot(track.distance, 1e3 * heights, **line_look(style, color=color, linewidth=1.0, label=side))
        axes.set(xlabel="distance [m]", ylabel="height [mm]", xmargin=0.0)
        axes.legend()
    return axes


def plot_motion(motion: PlatformMotion, ax: Any = None, **style: Any) -> Array:
    """Draw jolt and yaw of the platform over time.

    Parameters
    ----------
    motion : PlatformMotion
    ax : sequence of two matplotlib Axes, or a figure, optional
        Axes to draw on. If None, a new figure is created.
    **style
        Line properties, passed to `matplotlib.axes.Axes.plot`.

    Returns
    -------
    (2,) ndarray of matplotlib Axes
    """
    with panels(ax, ("jolt", "yaw"), (7.4, 4.0)) as axes:
        look = line_look(style, linewidth=1.0)
        for item, values in zip(axes, (1e3 * motion.jolt, 1e3 * motion.yaw), strict=True):
            item.plot(motion.time, values, **look)
        legend(axes[0])
        over_time(axes, ("jolt, ahead [mm]", "yaw [mrad]"))
    return axes
