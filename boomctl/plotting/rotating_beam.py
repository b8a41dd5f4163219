"""Plots of the hub-beam: its motion, spin-ups, curves in panels."""

from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from boomctl.arrays import Array
from boomctl.plotting.canvas import COLORS, legend, line_look, new_figure, over_time, panels, style

if TYPE_CHECKING:
    from boomctl.rotating_beam.campbell import CampbellDiagram
    from boomctl.rotating_beam.result import SimulationResult

_CRITICAL = "critical speed"


def plot_simulation(result: "SimulationResult", ax: Any = None, **style: Any) -> Array:
    """Draw torque, hub angle, hub speed and tip displacement of the hub-beam over time.

    Where the tip exceeds a tenth of the length, the beginning of that is marked.

    Parameters
    ----------
    result : SimulationResult
    ax : sequence of four matplotlib Axes, or a figure, optional
        Axes to draw on. If None, a new figure is created.
    **style
        Line properties, passed to `matplotlib.axes.Axes.plot`.

    Returns
    -------
    (4,) ndarray of matplotlib Axes
    """
    rows = {
        "torque [N m]": result.torque,
        "hub angle [rad]": result.hub_angle,
        "hub speed [rad/s]": result.hub_speed,
        "tip displacement [m]": result.tip_displacement,
    }
    with panels(ax, list(rows), (7.0, 6.2)) as axes:
        first, look = not axes[0].has_data(), line_look(style)
        for item, values in zip(axes, rows.values(), strict=True):
            item.plot(result.time, values, **look)
        mark_large(axes[-1], result)
        if first:
            axes[0].set_title(f"Hub-beam, model {result.model}")
        legend(axes[0])
        over_time(axes, rows)
    return axes


def mark_large(ax: Any, result: Any) -> None:
    """Mark the time at which the tip displacement exceeds a tenth of the length."""
    until = result.small_deformation_until
    if result.time[0] <= until <= result.time[-1]:
        ax.axvline(until, color="0.4", linewidth=0.9, linestyle="--")
        below = np.interp(until, result.time, result.tip_displacement) < 0.0  # The label is above the curve then.
        y, upright = (0.96, "top") if below else (0.04, "bottom")
        ax.annotate(
            "beyond a tenth\nof the length", (until, y), xycoords=("data", "axes fraction"),
            xytext=(4, 0), textcoords="offset points", fontsize=7, color="0.3", va=upright,
        )  # fmt: skip


def plot_campbell(result: "CampbellDiagram", ax: Any = None, **style: Any) -> Any:
    """Draw natural frequencies over the hub speed, its multiples, and circles where they meet.

    Parameters
    ----------
    result : CampbellDiagram
    ax : matplotlib Axes or figure, optional
        Axes to draw on. If None, a new figure is created. The multiples are not drawn again on an existing diagram.
    **style
        Line properties, passed to `matplotlib.axes.Axes.plot`.

    Returns
    -------
    matplotlib Axes
    """
    with panels(ax, ("Campbell diagram",), (6.6, 4.4)) as (axes,):
        fresh = not axes.has_data()
        before = [name for name in axes.get_legend_handles_labels()[1] if name != _CRITICAL]
        look = line_look(style, color=COLORS[len(before) % len(COLORS)])
        label, speeds = look.pop("label", result.model), result.hub_speeds
        for k, line in enumerate(result.eigenfrequencies_hz.T):
            axes.plot(speeds, line, **(look | {"label": label if k == 0 else None}))
        top = 1.08 * float(result.eigenfrequencies_hz.max())
        if fresh:
            axes.set(xlim=(speeds[0], speeds[-1]), ylim=(0.0, top), xlabel="hub speed [rad/s]", ylabel="frequency [Hz]")
            _orders(axes, result.orders, float(speeds[-1]), top)
        else:
            axes.set(xlim=(0.0, max(speeds[-1], axes.get_xlim()[1])), ylim=(0.0, max(top, axes.get_ylim()[1])))
        met = [(c.hub_speed, c.frequency_hz) for c in result.critical_speeds]
        if met:
            x, y = np.array(met).T
            said = None if _CRITICAL in axes.get_legend_handles_labels()[1] else _CRITICAL
            axes.plot(x, y, "o", color=look["color"], markersize=5, fillstyle="none", label=said)
        if speeds[0] <= result.divergence_speed <= 1.05 * axes.get_xlim()[1]:
            axes.axvline(result.divergence_speed, color=look["color"], linewidth=0.8, linestyle=":")
            axes.annotate(
                f"{result.model}: stiffness lost", (result.divergence_speed, 0.5), xytext=(3, 0), rotation=90,
                xycoords=("data", "axes fraction"), textcoords="offset points", va="center", fontsize=7, color=look["color"],
            )  # fmt: skip
        legend(axes, "above left", 4)
    return axes


def _orders(ax: Axes, orders: tuple[float, ...], right: float, top: float) -> None:
    """Draw multiples of the hub speed, each labeled where it leaves the plot."""
    for order in orders:
        end = min(right, 2.0 * np.pi * top / order)
        ax.plot([0.0, end], [0.0, order * end / (2.0 * np.pi)], color="0.65", linewidth=0.8, zorder=0)
        across, upright, offset = ("left", "center", (3, 0)) if end == right else ("right", "top", (-3, -3))
        ax.annotate(
            f"{order:g}×", (end, order * end / (2.0 * np.pi)), textcoords="offset points", fontsize=7, color="0.4",
            annotation_clip=False, ha=across, va=upright, xytext=offset,
        )  # fmt: skip


def draw_chart(part: Any) -> Figure:
    """Return the panels of a part of :mod:`boomctl.lab.papers.bai` as a figure that belongs to no window."""
    rows = -(-len(part.panels) // part.columns)
    with style():
        figure = new_figure(6.4 if part.columns == 1 else 10.0, 3.1 * rows + 0.3)
        axes = np.ravel(figure.subplots(rows, part.columns, squeeze=False))
        for ax, panel in zip(axes, part.panels, strict=True):
            _fill(ax, panel)
    return figure


def _fill(ax: Axes, panel: Any) -> None:
    for line in panel.lines:
        ax.plot(line.x, line.y, line.look, label=line.label, markersize=4)
    for height, meaning in panel.levels:
        ax.axhline(height, color="0.6", linewidth=0.8, zorder=0)
        ax.annotate(
            meaning, (1.0, height), xycoords=("axes fraction", "data"), xytext=(3, 0), textcoords="offset points",
            ha="left", va="center", fontsize=7, color="0.35",
        )  # fmt: skip
    if "x" in panel.logarithmic:
        ax.set_xscale("log")
        if panel.xticks:
            ax.set_xticks(panel.xticks, [f"{tick:g}" for tick in panel.xticks])
            ax.set_xticks([], minor=True)
    else:
        ax.margins(x=0.0)
    scale = "log" if "y" in panel.logarithmic else "linear"
    ax.set(title=panel.title, xlabel=panel.xlabel, ylabel=panel.ylabel, yscale=scale)
    if panel.ylim is not None:
        ax.set_ylim(*panel.ylim)
    if panel.legend:
        legend(ax, loc=panel.legend)
