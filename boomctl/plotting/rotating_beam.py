"""Pictures of the hub-beam: curves in panels, and the animation of a slew. Data in, matplotlib figures out."""

import io
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from boomctl.arrays import Array

if TYPE_CHECKING:
    from collections.abc import Callable

    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from boomctl.rotating_beam.campbell import CampbellDiagram
    from boomctl.rotating_beam.result import SimulationResult

Place = Literal["", "best", "upper left", "upper right", "lower left", "lower right"]
"""Where a legend stands; "" is nowhere."""

COLOURS = {
    "TLAM": "#d55e00",
    "SFOAM": "#0072b2",
    "SFOAM, consistent": "#56b4e9",
    "FOAM": "#009e73",
    "CFOAM": "#cc79a7",
    "exact": "#000000",
}
"""One colour a model, told apart by colour-blind readers too (Okabe & Ito 2008)."""

_CYCLE = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#000000")


_CRITICAL = "critical speed"


def plot_simulation(result: "SimulationResult", ax: Any = None, **style: Any) -> Array:
    """Draw torque, hub angle, hub speed and tip displacement of the hub-beam over time.

    Where the tip exceeds a tenth of the length, the beginning of that is marked.

    Parameters
    ----------
    result : SimulationResult
    ax : sequence of four matplotlib Axes, or a figure, optional
        By default a new figure of pyplot.
    **style
        Of the curves, as matplotlib's lines take it.

    Returns
    -------
    (4,) ndarray of matplotlib Axes
    """
    from boomctl.plotting.canvas import line_look, panels

    rows = (
        ("torque [N m]", result.torque),
        ("hub angle [rad]", result.hub_angle),
        ("hub speed [rad/s]", result.hub_speed),
        ("tip displacement [m]", result.tip_displacement),
    )
    with panels(ax, [label for label, _ in rows], (7.0, 6.2)) as axes:
        first, look = not axes[0].has_data(), line_look(style)
        for each, (label, values) in zip(axes, rows, strict=True):
            each.plot(result.time, values, **look)
            each.set_ylabel(label)
            each.set_xmargin(0.0)
        mark_large(axes[-1], result)
        if first:
            axes[0].set_title(f"Hub-beam, model {result.model}")
        if "label" in look:
            axes[0].legend()
        axes[-1].set_xlabel("time [s]")
        axes[0].figure.align_ylabels(list(axes))
    return axes


def mark_large(ax: Any, result: Any) -> None:
    """Mark the instant from which on the tip is beyond a tenth of the length."""
    until = result.small_deformation_until
    if result.time[0] <= until <= result.time[-1]:
        ax.axvline(until, color="0.4", linewidth=0.9, linestyle="--")
        below = np.interp(until, result.time, result.tip_displacement) < 0.0  # the curve: words stand above it then
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
        By default a new figure of pyplot; on a diagram that is there already the multiples are not drawn again.
    **style
        Of the frequencies, as matplotlib's lines take it.

    Returns
    -------
    matplotlib Axes
    """
    from boomctl.plotting import canvas

    with canvas.panels(ax, ("Campbell diagram",), (6.6, 4.4)) as (axes,):
        fresh = not axes.has_data()
        before = [name for name in axes.get_legend_handles_labels()[1] if name != _CRITICAL]
        look = canvas.line_look(style, color=canvas.COLOURS[len(before) % len(canvas.COLOURS)])
        label, speeds = look.pop("label", result.model), result.hub_speeds
        for k, line in enumerate(result.frequencies_hz.T):
            axes.plot(speeds, line, **(look | {"label": label if k == 0 else None}))
        top = 1.08 * float(result.frequencies_hz.max())
        if fresh:
            axes.set(xlim=(speeds[0], speeds[-1]), ylim=(0.0, top), xlabel="hub speed [rad/s]", ylabel="frequency [Hz]")
            _orders(axes, result.orders, float(speeds[-1]), top)
        else:
            axes.set(xlim=(0.0, max(speeds[-1], axes.get_xlim()[1])), ylim=(0.0, max(top, axes.get_ylim()[1])))
        met = [(c.hub_speed, c.frequency_hz) for c in result.crossings]
        if met:
            x, y = np.array(met).T
            said = None if _CRITICAL in axes.get_legend_handles_labels()[1] else _CRITICAL
            axes.plot(x, y, "o", color=look["color"], markersize=5, fillstyle="none", label=said)
        if speeds[0] <= result.stiffness_lost <= 1.05 * axes.get_xlim()[1]:
            axes.axvline(result.stiffness_lost, color=look["color"], linewidth=0.8, linestyle=":")
            axes.annotate(
                f"{result.model}: stiffness lost", (result.stiffness_lost, 0.5), xytext=(3, 0), rotation=90,
                xycoords=("data", "axes fraction"), textcoords="offset points", va="center", fontsize=7, color=look["color"],
            )  # fmt: skip
        axes.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=4) if canvas.beside(axes) else axes.legend()
    return axes


def _orders(ax: "Axes", orders: tuple[float, ...], right: float, top: float) -> None:
    """Draw multiples of the hub speed, each named where it leaves the picture."""
    for order in orders:
        end = min(right, 2.0 * np.pi * top / order)
        ax.plot([0.0, end], [0.0, order * end / (2.0 * np.pi)], color="0.65", linewidth=0.8, zorder=0)
        side = (
            {"ha": "left", "va": "center", "xytext": (3, 0)}
            if end == right
            else {"ha": "right", "va": "top", "xytext": (-3, -3)}
        )
        ax.annotate(
            f"{order:g}×", (end, order * end / (2.0 * np.pi)), textcoords="offset points", fontsize=7, color="0.4",
            annotation_clip=False, **side,
        )  # fmt: skip


@dataclass(frozen=True, eq=False)
class Line:
    """A curve: label, abscissae and ordinates, matplotlib line style, and colour (None: next of the cycle)."""

    label: str
    x: Array
    y: Array
    style: str = "-"
    colour: str | None = None


@dataclass(frozen=True, eq=False)
class Panel:
    """Curves in one pair of axes.

    Attributes
    ----------
    title, xlabel, ylabel : str
        Texts; the labels carry the units.
    lines : tuple of Line
    logarithmic : str
        "", "x", "y" or "xy".
    ylim : tuple of float, optional
        Range of the ordinate.
    levels : tuple of (float, str)
        Horizontal lines and what they mean.
    legend : Place
        Where the legend stands; "" for none.
    xticks : tuple of float
        Marks on a logarithmic abscissa, written out; () for matplotlib's.
    """

    title: str
    xlabel: str
    ylabel: str
    lines: tuple[Line, ...]
    logarithmic: str = ""
    ylim: tuple[float, float] | None = None
    levels: tuple[tuple[float, str], ...] = ()
    legend: Place = "best"
    xticks: tuple[float, ...] = ()


@dataclass(frozen=True, eq=False)
class Chart:
    """Panels of curves in one figure: file name without ending, caption, panels, and how many of them stand in a row."""

    name: str
    caption: str
    panels: tuple[Panel, ...]
    columns: int = field(default=1)


def draw(chart: Chart) -> "Figure":
    """Draw a chart.

    Parameters
    ----------
    chart : Chart

    Returns
    -------
    matplotlib.figure.Figure
    """
    from matplotlib.figure import Figure

    rows = -(-len(chart.panels) // chart.columns)
    figure = Figure(figsize=(6.4 if chart.columns == 1 else 10.0, 3.1 * rows + 0.3), layout="constrained")
    axes = np.atleast_1d(figure.subplots(rows, chart.columns)).ravel()
    for ax, panel in zip(axes, chart.panels, strict=False):
        _fill(ax, panel)
    for ax in axes[len(chart.panels) :]:
        ax.set_axis_off()
    return figure


def _fill(ax: "Axes", panel: Panel) -> None:
    cycle = iter(_CYCLE * 3)
    for line in panel.lines:
        colour = line.colour or next(cycle)
        ax.plot(line.x, line.y, line.style, color=colour, label=line.label, linewidth=1.3, markersize=4)
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
    if "y" in panel.logarithmic:
        ax.set_yscale("log")
    if panel.ylim is not None:
        ax.set_ylim(*panel.ylim)
    ax.set_title(panel.title, fontsize=10, loc="left")
    ax.set_xlabel(panel.xlabel, fontsize=9)
    ax.set_ylabel(panel.ylabel, fontsize=9)
    ax.tick_params(labelsize=8)
    ax.grid(visible=True, which="major", color="0.92", linewidth=0.6)
    if panel.legend and any(line.label for line in panel.lines):
        ax.legend(fontsize=8, loc=panel.legend, framealpha=0.9)


def chart_files(chart: Chart, *endings: str) -> dict[str, bytes]:
    """A chart as the bytes of a file of each kind, drawn and laid out once.

    Parameters
    ----------
    chart : Chart
    endings : str
        "png", "svg".

    Raises
    ------
    ValueError
        For another ending.
    """
    for ending in endings:
        if ending not in ("png", "svg"):
            raise ValueError(f"ending = {ending!r}: expected 'png' or 'svg'")
    from matplotlib import rc_context

    files = {}
    with rc_context({"svg.hashsalt": chart.name}):
        figure = draw(chart)
        for ending in endings:
            target = io.BytesIO()
            figure.savefig(target, format=ending, dpi=130, metadata={"Date": None} if ending == "svg" else None)
            figure.set_layout_engine("none")  # places are found now, and take as long as drawing
            files[ending] = target.getvalue()
    return files


@dataclass(frozen=True, eq=False)
class Film:
    """Beams that move in the plane of the hub.

    Attributes
    ----------
    time : ndarray, k
        Instants of the frames, s; equally spaced.
    shapes : tuple of (label, ndarray)
        Positions of points along the beam from the clamp to the free end, complex, k x m, m.
    hub_radius : float
        Radius of the hub, m.
    caption : str
    """

    time: Array
    shapes: tuple[tuple[str, Array], ...]
    hub_radius: float
    caption: str


def film_bytes(film: Film) -> bytes:
    """A film as the bytes of a GIF that runs in real time and repeats.

    Parameters
    ----------
    film : Film
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure
    from PIL import Image

    figure = Figure(figsize=(4.4, 4.6), dpi=80)
    canvas = FigureCanvasAgg(figure)
    moving, frame = _stage(figure, film)
    canvas.draw()
    # axes and texts that stay are drawn once, for they take most of the time
    still = canvas.copy_from_bbox(figure.bbox)
    images = []
    for k in range(film.time.size):
        canvas.restore_region(still)
        frame(k)
        for artist in moving:
            figure.draw_artist(artist)
        images.append(Image.fromarray(np.array(canvas.buffer_rgba())).convert("RGB"))
    target = io.BytesIO()
    interval = round(1000.0 * float(film.time[1] - film.time[0]))
    images[0].save(target, "GIF", save_all=True, append_images=images[1:], duration=interval, loop=0)
    return target.getvalue()


def _stage(figure: "Figure", film: Film) -> "tuple[list[Artist], Callable[[int], None]]":
    """Draw what stays; return what moves, in the order of drawing, and what moves it."""
    from matplotlib.patches import Circle

    ax = figure.subplots()
    figure.subplots_adjust(left=0.17, right=0.97, bottom=0.11, top=0.93)
    extent = 1.06 * max(float(np.max(np.abs(shape))) for _, shape in film.shapes)
    ax.set(xlim=(-extent, extent), ylim=(-extent, extent), aspect="equal", xlabel="x [m]", ylabel="y [m]")
    ax.add_patch(Circle((0.0, 0.0), film.hub_radius, color="0.75"))
    (spoke,) = ax.plot([], [], ":", color="0.6", linewidth=1.0, label="hub's axis", animated=True)
    lines = [
        ax.plot([], [], color=COLOURS.get(label, _CYCLE[k % len(_CYCLE)]), label=label, linewidth=1.8, animated=True)[0]
        for k, (label, _) in enumerate(film.shapes)
    ]
    legend, title = ax.legend(fontsize=8, loc="lower left"), ax.set_title("", fontsize=9, animated=True)
    legend.set_animated(True)
    first = film.shapes[0][1]

    def frame(k: int) -> None:
        for line, (_, shape) in zip(lines, film.shapes, strict=True):
            line.set_data(shape[k].real, shape[k].imag)
        radial = first[k, 0] / abs(first[k, 0]) * np.array([0.0, abs(first[k, 0]) + abs(first[0, -1] - first[0, 0])])
        spoke.set_data(radial.real, radial.imag)
        title.set_text(f"{film.caption}, t = {film.time[k]:.1f} s")

    return [spoke, *lines, legend, title], frame
