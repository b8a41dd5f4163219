"""Pictures of excitation and spray: deposit on the field, motion over time, tracks beside their class."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from boomctl.checks import finite_array, positive, real
from boomctl.plotting.canvas import COLOURS, new_figure, style

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


def draw_deposit(results: "Mapping[str, SprayResult]", length: float | None = None, start: float | None = None) -> Any:
    """Draw the deposit on the field, one panel a result, all on one scale of discrete steps about the nominal dose.

    Parameters
    ----------
    results : mapping of str to SprayResult
        By title, for instance of the passive and of the active suspension.
    length : float, optional
        Of field to show [m]; by default all that is judged.
    start : float, optional
        Where it begins [m]; by default where judging does.

    Returns
    -------
    matplotlib Figure

    Raises
    ------
    TypeError, ValueError
        No results by title; a length not above zero, a start that is no number.
    """
    from matplotlib.colors import BoundaryNorm, ListedColormap

    if not isinstance(results, Mapping):
        raise TypeError(f"results: expected a mapping from title to SprayResult, got {type(results).__name__}")
    if not results:
        raise ValueError("results: expected at least one")
    extent = None if length is None else positive("length", length)
    begin = None if start is None else real("start", start)
    colours = ListedColormap(list(_SHADES), over=_MORE)
    norm = BoundaryNorm(_STEPS, len(_SHADES))
    with style():
        figure = new_figure(9.0, 1.2 + 1.75 * len(results))
        axes = np.atleast_1d(figure.subplots(len(results), 1, sharex=True, sharey=True))
        drawn: Any = None
        for ax, (title, result) in zip(axes, results.items(), strict=True):
            drawn = ax.pcolormesh(
                result.y_edges, result.x_edges, result.deposit, cmap=colours, norm=norm, rasterized=True
            )
            _frame(ax, result, extent, begin)
            ax.set_title(f"{title}: {_figures(result)}", fontsize=8.5)
            ax.set_ylabel("along boom [m]")
        axes[-1].set_xlabel("along the drive [m]  (boom moves to the right)")
        bar = figure.colorbar(
            drawn, ax=list(axes), extend="max", spacing="uniform", ticks=_STEPS, aspect=12 + 8 * len(results)
        )
        bar.ax.set_yticklabels([f"{step:g}" for step in _STEPS])
        bar.set_label("deposit over nominal\n(red: too little, blue: too much)")
    return figure


def _frame(ax: Any, result: "SprayResult", length: float | None, start: float | None) -> None:
    """Show the part of the field that is judged."""
    along, across = result.y_judged, result.x_judged
    begin = result.y_edges[along.start] if start is None else start
    end = result.y_edges[along.stop] if length is None else begin + length
    ax.set_xlim(begin, end)
    ax.set_ylim(result.x_edges[across.start], result.x_edges[across.stop])
    ax.grid(visible=False)


def _figures(result: "SprayResult") -> str:
    return (
        f"CV {100 * result.cv:.1f} %, {_share(result.share_outside_10)} outside ±10 %,"
        f" {_share(result.share_outside_20)} outside ±20 %, doses {result.lowest_dose:.2f} to {result.highest_dose:.2f}"
    )


def _share(value: float) -> str:
    return "none" if value == 0.0 else "< 0.1 %" if value < 0.001 else f"{100 * value:.1f} %"


def draw_motion(
    motion: "PlatformMotion", tips: "Mapping[str, ArrayLike]", span: tuple[float, float] | None = None
) -> Any:
    """Draw the platform's jolt and yaw over time, and the tips' motion below it.

    Parameters
    ----------
    motion : PlatformMotion
    tips : mapping of str to (2, n) array_like
        Forward displacements of the left and the right tip [m] at the motion's times, by title; one panel each, all on
        one scale.
    span : (float, float), optional
        Times to show [s].

    Returns
    -------
    matplotlib Figure

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
    with style():
        figure = new_figure(8.0, 2.2 + 1.6 * len(tips))
        axes = np.atleast_1d(figure.subplots(1 + len(tips), 1, sharex=True))
        axes[0].plot(motion.time, 1e3 * motion.jolt, color=COLOURS[0], label="jolt", linewidth=1.0)
        turned = 0.5e3 * motion.actuator_distance * motion.yaw
        axes[0].plot(motion.time, turned, color=COLOURS[1], label="yaw, at an actuator", linewidth=1.0)
        axes[0].set_title("platform")
        if span is not None:
            axes[0].set_xlim(*span)
        largest = 0.0
        for ax, (title, lines) in zip(axes[1:], moved.items(), strict=True):
            for side, line, colour in zip(("left tip", "right tip"), lines, COLOURS[2:4], strict=True):
                ax.plot(motion.time, line, color=colour, label=side, linewidth=1.0)
            largest = max(largest, float(np.abs(lines[:, shown]).max()))
            ax.set_title(title)
        for ax in axes:
            ax.set_ylabel("ahead [mm]")
            ax.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), borderaxespad=0.1, ncols=2)
        for ax in axes[1:] if largest > 0.0 else ():
            ax.set_ylim(-1.25 * largest, 1.25 * largest)
        axes[-1].set_xlabel("time [s]")
    return figure


def draw_track_density(tracks: "Mapping[str, Sequence[Track]]", band: tuple[float, float] = (0.01, 3.0)) -> Any:
    """Draw the density of tracks over the wave number, beside the line of their class.

    Parameters
    ----------
    tracks : mapping of str to sequence of Track
        Periodic ones of equal length and step, by the letter of their class; densities are averaged over the tracks of
        a class and, times the squared wave number, over a twelfth of an octave.
    band : (float, float)
        Of wave numbers [1/m].

    Returns
    -------
    matplotlib Figure

    Raises
    ------
    ValueError
        A class without tracks; tracks that do not go round, or differ in length or step; none of their waves in the band.
    """
    from boomctl.boom.tracks import averaged_density, road_density

    densities = {letter: averaged_density(several, band, f"tracks[{letter!r}]") for letter, several in tracks.items()}
    with style():
        figure = new_figure(6.4, 4.4)
        ax = figure.subplots()
        line = np.geomspace(*band, 50)
        for i, (letter, points) in enumerate(densities.items()):
            colour = COLOURS[i % len(COLOURS)]
            ax.loglog(*points, ".-", color=colour, linewidth=0.7, markersize=3, alpha=0.8)
            ax.loglog(line, road_density(letter, line), color=colour, linewidth=1.6, label=f"class {letter}")
        ax.loglog([], [], ".-", color="#555555", linewidth=0.7, markersize=3, label="tracks")
        ax.set_xlabel("wave number n [1/m]")
        ax.set_ylabel("one-sided density G$_d$(n) [m³]")
        ax.legend()
        figure.suptitle("Random tracks beside ISO 8608", x=0.01, ha="left", fontsize=10, fontweight="bold")
    return figure
