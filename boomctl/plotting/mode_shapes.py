"""Plots of mode shapes: the deformed machine, or its coordinates as bars."""

from typing import TYPE_CHECKING, Any

import numpy as np

from boomctl.arrays import Array
from boomctl.plotting.canvas import COLORS, common_legend, in_rows, legend, line_look, panels

if TYPE_CHECKING:
    from boomctl.structure.response.mode_shapes import BodyShape, ModeShapes

_LINE_WIDTH = 0.02  # width over length up to which a machine counts as a line, with a separate scale of its motion
_SCALE = 0.15  # largest plotted motion of other machines, as a fraction of their size
_ACROSS = "along the beam, drawn across"  # Axial motion, which is not visible along the line.
_MOST_NAMED = 30  # largest number of labeled coordinates


def plot_mode_shapes(result: "ModeShapes", ax: Any = None, **style: Any) -> Array:
    """Draw each mode in its own axes, to its own scale.

    Parameters
    ----------
    result : ModeShapes
    ax : sequence of matplotlib Axes, or a figure, optional
        One axes per mode. If None, a new figure is created.
    **style
        Line properties of the beams or the ends of the bars, passed to `matplotlib.axes.Axes.plot`.

    Returns
    -------
    (k,) ndarray of matplotlib Axes
    """
    count = len(result.names)
    rests = np.vstack([line.points for line in result.bodies]) if result.bodies else np.zeros((0, 2))
    flat = bool(len(rests)) and float(np.ptp(rests[:, 1])) <= _LINE_WIDTH * float(np.ptp(rests[:, 0]))
    columns, rows, divide = in_rows(count)
    below = flat or not len(rests)
    size = (6.4, 1.0 + 1.35 * count) if below else (3.0 * columns, 0.4 + 3.0 * rows)
    with panels(ax, result.names, size, None if below else divide) as axes:
        for k, (item, name) in enumerate(zip(axes, result.names, strict=True)):
            if len(rests):
                _machine(item, result.bodies, k, flat, float(np.ptp(rests, axis=0).max()), style)
            else:
                _bars(item, result, k, style)
            item.set_title(name + (f" ({_ACROSS})" if item.get_gid() == _ACROSS else ""))
            item.set_xlabel("" if flat and item is not axes[-1] else "x [m]" if len(rests) else item.get_xlabel())
        if flat:
            legend(axes[0], "above", 4)
        elif len(rests):
            low, high = (np.array([item.viewLim.get_points()[i] for item in axes]) for i in (0, 1))
            for item in axes:  # all of one size
                item.set(xlim=(low[:, 0].min(), high[:, 0].max()), ylim=(low[:, 1].min(), high[:, 1].max()))
            common_legend(ax, axes[0], ncols=6)
    return axes


def _machine(
    ax: Any, lines: "tuple[BodyShape, ...]", mode: int, flat: bool, size: float, style: dict[str, Any]
) -> None:
    """Draw the undeformed machine, dashed, and the mode shape."""
    largest = max(float(np.abs(line.displacement[mode]).max(initial=0.0)) for line in lines) or 1.0
    along = flat and max(float(np.abs(x.displacement[mode, :, 1]).max(initial=0.0)) for x in lines) < 1e-3 * largest
    factor = 1.0 / largest if flat else _SCALE * size / largest
    beams = 0
    if along:
        ax.set_gid(_ACROSS)
    for k, line in enumerate(sorted(lines, key=lambda line: line.is_beam)):
        rest, motion = line.points, factor * line.displacement[mode]
        if along:  # a motion along a line is drawn across it
            motion = motion[:, ::-1] * np.array([0.0, 1.0])
        moved = rest + motion * (np.array([0.0, 1.0]) if flat else 1.0)
        look = {"color": ("0.25", "0.5", "0.7")[k % 3], "linewidth": 2.2, "label": line.name, "solid_capstyle": "round"}
        if line.is_beam:
            look = line_look(style, color=COLORS[beams % len(COLORS)], label=line.name)
            beams += 1
        if len(moved) == 1 and not line.is_beam:
            look |= {"marker": "s", "markersize": 4, "linestyle": "none"}
        ax.plot(rest[:, 0], rest[:, 1], color="0.75", linewidth=0.8, linestyle="--", zorder=0)
        ax.plot(moved[:, 0], moved[:, 1], **look)
    if flat:
        ax.set(ylim=(-1.25, 1.25), ylabel="shape")
    else:
        ax.set_aspect("equal", adjustable="box")
        ax.margins(0.15)
        ax.set_ylabel("y [m]")


def _bars(ax: Any, result: "ModeShapes", mode: int, style: dict[str, Any]) -> None:
    """Draw the coordinates of a shape as bars, the longest of length one."""
    shape = result.shapes[:, mode] / (np.abs(result.shapes[:, mode]).max() or 1.0)
    look = line_look(style, color=COLORS[0], marker="o", markersize=4, linestyle="none")
    here = np.arange(len(shape))
    ax.vlines(here, 0.0, shape, color=look["color"], linewidth=1.2)
    ax.plot(here, shape, **look)
    ax.axhline(0.0, color="0.6", linewidth=0.8, zorder=0)
    ax.set(ylim=(-1.25, 1.25), ylabel="shape")
    if len(here) <= _MOST_NAMED:
        ax.set_xticks(here, result.coordinates, rotation=90 if len(here) > 8 else 0)  # As many labels fit.
    if mode == len(result.names) - 1:
        ax.set_xlabel("coordinate")
