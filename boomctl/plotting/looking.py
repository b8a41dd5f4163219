"""Plots of systems and loops as python-control names them: Bode, Nyquist, step and impulse, poles and zeros."""

from collections.abc import Iterable
from itertools import cycle
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator

from boomctl.arrays import Array
from boomctl.checks import names
from boomctl.lti.frequency import MODES
from boomctl.lti.rounding import SUMMED
from boomctl.plotting.canvas import COLORS, few_labels, frequency_axis, in_rows, legend, line_look, over_time, panels
from boomctl.plotting.margins import MARGIN, NARROW, SHADE, WIDE, draw_critical, draw_curve, farthest, frame

if TYPE_CHECKING:
    from boomctl.analysis.bode import BodeResult
    from boomctl.analysis.margins import DiskMargin
    from boomctl.analysis.modes import ModeTable, PoleZeroResult
    from boomctl.analysis.nyquist import NyquistResult, NyquistStability
    from boomctl.analysis.transients import TimeResponse

_STYLES = ("-", "--", ":", "-.")  # line styles, changed after each cycle of the colors
_ANGLE_STEPS = [1.0, 1.5, 3.0, 4.5, 9.0, 10.0]  # tick spacings of angles, which include 45, 90 and 180 degrees
_DAMPINGS = (0.0005, 0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5)  # damping ratios with a line
_BETWEEN = 6  # interpolated points per computed point of a curve
_LINES = 4  # lines of equal damping at most: labels of more would overlap


def _looks(style: dict[str, Any], curves: Iterable[str], named: bool = False, **default: Any) -> list[dict[str, Any]]:
    """Return how several curves look: colors first, then other lines; one alone carries no name unless ``named``."""
    names, result = list(curves), []
    kinds = cycle([(color, line) for line in _STYLES for color in COLORS])
    for name, (color, line) in zip(names, kinds, strict=False):
        own = {"label": name} if named or len(names) > 1 else {}
        look = line_look(style, color=color, linestyle=line, **default, **own)
        result.append({"label": name} | look)
    return result


def plot_bode(result: "BodeResult", ax: Any = None, *, frequency_unit: str | None = None, **style: Any) -> Array:
    """Draw sizes above phases over frequency, one curve for each pair of signals.

    Parameters
    ----------
    result : BodeResult
    ax : sequence of two matplotlib Axes, or a figure, optional
        Axes of magnitude and phase. If None, a new figure is created.
    frequency_unit : {"Hz", "rad/s"}, optional
        Unit of the frequency axis. If None, the unit of the existing axes.
    **style
        Line properties, passed to `matplotlib.axes.Axes.plot`; ``label`` is prefixed to the labels.

    Returns
    -------
    (2,) ndarray of matplotlib Axes
    """
    with panels(ax, ("magnitude", "phase"), (6.4, 5.4)) as axes:
        upper, lower = axes
        scale = frequency_axis(lower, frequency_unit, result.frequency_unit)
        shown = result.omega > 0.0  # there is no zero on a logarithmic axis
        x, pairs = result.omega[shown] / scale, list(np.ndindex(result.frdata.shape[:2]))
        pair_names = [f"{result.input_labels[i]} → {result.output_labels[o]}" for o, i in pairs]
        phase = result.phase_deg
        for (o, i), look in zip(pairs, _looks(style, pair_names), strict=True):
            size = np.abs(result.frdata[o, i])[shown]
            (upper.loglog if (size > 0.0).any() else upper.semilogx)(x, size, **look)
            lower.semilogx(x, phase[o, i][shown], **look)
        if result._unstable:
            said = "unstable: no steady-state response"
            upper.text(0.5, 1.02, said, transform=upper.transAxes, ha="center", va="bottom", fontweight="bold")
        upper.set_ylabel("magnitude")
        lower.set_ylabel("phase [deg]")
        lower.yaxis.set_major_locator(MaxNLocator(6, steps=_ANGLE_STEPS))
        few_labels(upper)
        few_labels(lower)
        legend(upper)
        upper.figure.align_ylabels(list(axes))
    return axes


def plot_nyquist(result: "NyquistResult", ax: Any = None, **style: Any) -> Any:
    """Draw a Nyquist curve around -1: positive frequencies with their direction, negative ones pale; the critical disk.

    Parameters
    ----------
    result : NyquistResult
    ax : matplotlib Axes or figure, optional
        Axes to draw on. If None, a new figure is created.
    **style
        Line properties, passed to `matplotlib.axes.Axes.plot`.

    Returns
    -------
    matplotlib Axes
    """
    with panels(ax, ("Nyquist curve",), (4.8, 5.4)) as (axes,):
        turns = f"{result.encirclements} encirclements, {result.open_loop_unstable_poles} unstable open-loop poles: "
        said = turns + ("stable" if result.stable else f"{result.closed_loop_unstable_poles} unstable")
        name = "L" if len(result.signals) == 1 else "det(I + L) − 1"
        _around(axes, result.curve, result.disk_margin, said, name, style)
    return axes


def _around(ax: Any, curve: Array, disk: "DiskMargin | None", said: str, name: str, style: dict[str, Any]) -> None:
    """Draw a curve around -1, with its direction, label and critical disk."""
    fresh = not ax.has_data()
    look = line_look(style, color=COLORS[0], marker="." if len(np.unique(curve)) == 1 else "none", label=said)
    draw_critical(ax, disk if fresh else None)
    half = float(np.clip(MARGIN * np.percentile(np.abs(curve), 90), NARROW, WIDE))
    half = half if fresh else max(half, ax.get_xlim()[1])
    draw_curve(ax, curve, half, name, look)
    _arrows(ax, curve, half, look["color"])
    if disk is not None and fresh:
        status = "" if disk.verified else ", not verified"
        ax.plot([], [], color=SHADE, linewidth=6, label=f"critical disk: margin {disk.alpha:.3g}{status}")
    legend(ax, "above left", fontsize=7, alignment="left")


def _smooth(curve: Array) -> Array:
    """Return a smooth curve through points at less than 30 degrees distance."""
    from scipy.interpolate import CubicSpline  # long to import

    steps = np.abs(np.diff(curve))
    distinct = np.append(True, steps > SUMMED * np.abs(curve).max())
    # Square roots of the lengths avoid loops next to long steps.
    along = np.cumsum(np.append(0.0, np.sqrt(np.abs(np.diff(curve[distinct])))))
    if len(along) < 3:
        return curve
    t = np.interp(np.arange(_BETWEEN * (len(along) - 1) + 1) / _BETWEEN, np.arange(len(along)), along)
    return CubicSpline(along, curve[distinct])(t)


def _arrows(ax: Any, curve: Array, half: float, color: Any) -> None:
    """Draw the direction of the visible part of a curve, at two points."""
    inside = np.flatnonzero((np.abs(curve[:-1].real) < half) & (np.abs(curve[:-1].imag) < half))
    if len(inside) < 3:
        return
    along = np.cumsum(np.abs(np.diff(curve))[inside])
    for fraction in (0.3, 0.7):  # Fractions of the visible length.
        k = int(inside[np.searchsorted(along, fraction * along[-1])])
        step = curve[k + 1] - curve[k]
        if step == 0.0:
            continue
        start, end = curve[k], curve[k] + 1e-3 * half * step / abs(step)
        ax.annotate(
            "", (end.real, end.imag), (start.real, start.imag),
            arrowprops={"arrowstyle": "-|>", "color": color, "mutation_scale": 12},
        )  # fmt: skip


def plot_transient(result: "TimeResponse", ax: Any = None, **style: Any) -> Array:
    """Draw step or impulse responses over time, one panel an output, one curve an input.

    Parameters
    ----------
    result : TimeResponse
    ax : sequence of matplotlib Axes, or a figure, optional
        One axes per output. If None, a new figure is created.
    **style
        Line properties, passed to `matplotlib.axes.Axes.plot`; ``label`` is prefixed to the labels.

    Returns
    -------
    (p,) ndarray of matplotlib Axes
    """
    with panels(ax, result.output_labels, (6.4, 1.2 + 1.7 * len(result.output_labels))) as axes:
        steps = [f"{result.kind} of {name}" for name in result.input_labels]
        for item, rows in zip(axes, result.outputs, strict=True):
            for look, row in zip(_looks(style, steps, linewidth=1.0), rows, strict=True):
                draw = item.step if result.dt else item.plot
                draw(result.time, row, **(look | ({"where": "post"} if result.dt else {})))
        legend(axes[0], "above", 2)
        over_time(axes, result.output_labels)
    return axes


def plot_pole_zero(result: "PoleZeroResult", ax: Any = None, **style: Any) -> Any:
    """Draw poles as crosses and zeros as circles: of the slowest modes, with lines of equal damping, or in the unit circle.

    Parameters
    ----------
    result : PoleZeroResult
    ax : matplotlib Axes or figure, optional
        Axes to draw on. If None, a new figure is created.
    **style
        Line properties of the markers, passed to `matplotlib.axes.Axes.plot`.

    Returns
    -------
    matplotlib Axes
    """
    with panels(ax, ("poles and zeros",), (5.4, 5.0)) as (axes,):
        fresh = not axes.has_data()
        top = _top(result)
        poles, zeros = (values[np.abs(values) <= top] for values in (result.poles, result.zeros))
        hidden = len(result.poles) - len(poles)
        said = f"poles ({hidden} faster ones not shown)" if hidden else "poles"
        for values, marker, words in ((poles, "x", said), (zeros, "o", "zeros")):
            look = line_look(style, color=COLORS[0], markersize=7, label=words)
            axes.plot(values.real, values.imag, **(look | {"marker": marker, "linestyle": "none", "fillstyle": "none"}))
        unit = "" if result.dt else " [rad/s]"
        axes.set(xlabel=f"real part{unit}", ylabel=f"imaginary part{unit}")
        if result.dt:
            angle = np.linspace(0.0, 2.0 * np.pi, 361)
            axes.plot(np.cos(angle), np.sin(angle), color="0.6", linewidth=0.8, linestyle=":", zorder=0)
            axes.set_aspect("equal")
        else:
            axes.axvline(0.0, color="0.6", linewidth=0.8, zorder=0)
            if fresh:
                _damping_lines(axes)
        legend(axes, "above", 2)
    return axes


def _top(result: "PoleZeroResult") -> float:
    """Return the largest modulus of the poles shown: that of the slowest modes."""
    size = np.sort(np.abs(result.poles))
    return float("inf") if result.dt or len(size) <= 2 * MODES else 1.05 * float(size[2 * MODES - 1])


def _damping_lines(ax: Any) -> None:
    """Draw lines of equal damping within the axes, each with its ratio at the edge."""
    (left, right), (low, high) = ax.get_xlim(), ax.get_ylim()
    ax.set(xlim=(left, right), ylim=(low, high), autoscale_on=False)
    reach = max(-left, 0.0)
    if reach == 0.0 or high <= 0.0:
        return
    steep = reach / high  # ratio of real to imaginary part of the diagonal of the plot
    # Lines that are distinguishable.
    near = [z for z in _DAMPINGS if 0.15 * steep < z / np.sqrt(1.0 - z * z) < 6.0 * steep]
    for ratio in near[:: max(1, -(-len(near) // _LINES))]:
        slope = ratio / np.sqrt(1.0 - ratio * ratio)
        x = max(left, -slope * high)
        for sign in (1.0, -1.0):
            line = Line2D([0.0, x], [0.0, -sign * x / slope], color="0.8", linewidth=0.7, linestyle="--", zorder=0)
            ax.add_line(line)
        ax.annotate(
            f"{100.0 * ratio:g} %", (x, -x / slope), xytext=(3, -8), textcoords="offset points", fontsize=7, color="0.45"
        )  # fmt: skip


def plot_comparison(what: str, drawn: dict[str, Any], ax: Any = None, *, signals: Any = (), **style: Any) -> Array:
    """Draw several systems or results over each other, each in a separate color.

    Parameters
    ----------
    what : {"time", "frequency", "margins"}
    drawn : dict
        By name: signals by name and times; singular values; margins.
    ax : matplotlib Axes, sequence of them, or a figure, optional
        One axes per signal or loop, or one for singular values. If None, a new figure is created.
    signals : sequence of str
        Signals or loops; by default the common ones, at most six.
    **style
        Line properties, passed to `matplotlib.axes.Axes.plot`; ``label`` is prefixed to the labels.

    Returns
    -------
    (n,) ndarray of matplotlib Axes
    """
    if what == "frequency":
        with panels(ax, ("singular values",), (6.4, 4.2)) as axes:
            for curve, look in zip(drawn.values(), _looks(style, drawn, named=True), strict=True):
                curve.plot(axes[0], **look)
        return axes
    there = {name: list(part[0]) if what == "time" else [x.signal for x in part.loops] for name, part in drawn.items()}
    common = [name for name in next(iter(there.values())) if all(name in available for available in there.values())]
    if what == "time":  # equal signals, such as disturbances, are omitted
        shapes = {name: [np.asarray(part[0][name]) for part in drawn.values()] for name in common}
        differing = [name for name, (one, *rest) in shapes.items() if not all(np.array_equal(one, x) for x in rest)]
        common = common if len(signals) or not differing else differing
    chosen = common[: len(COLORS)] if not len(signals) else list(names("signal", signals, common))
    if not chosen:
        raise ValueError("signals: all of them have none in common")
    if what == "time":
        with panels(ax, chosen, (7.0, 1.2 + 1.5 * len(chosen))) as axes:
            for item, signal in zip(axes, chosen, strict=True):
                for (values, time), look in zip(drawn.values(), _looks(style, drawn, True, linewidth=1.0), strict=True):
                    item.plot(time, values[signal], **look)
            over_time(axes, chosen)
            legend(axes[0], "above", 4)
        return axes
    columns, rows, divide = in_rows(len(chosen))
    with panels(ax, chosen, (3.6 * columns, 4.2 * rows), divide) as axes:
        for item, signal in zip(axes, chosen, strict=True):
            half = NARROW
            for margins, look in zip(drawn.values(), _looks(style, drawn, named=True), strict=True):
                loop = margins[signal]
                L = -loop.loop_gain[1]
                draw_critical(item, loop.disk_margin, outlined=look["color"])
                words = f"{look['label']}: disk {loop.disk_margin.alpha:.3g}"
                item.plot(L.real, L.imag, **(look | {"label": words}))
                half = max(half, farthest(loop))
            frame(item, half, "−L")
            legend(item, "above left", title=f"opened at {signal}", title_fontsize=8, fontsize=7, alignment="left")
    return axes


def plot_exact_loop(result: "NyquistStability", ax: Any = None, **style: Any) -> Any:
    """Draw the Nyquist curve of a loop around a plant that is known by its response.

    Parameters
    ----------
    result : NyquistStability
    ax : matplotlib Axes or figure, optional
        Axes to draw on. If None, a new figure is created.
    **style
        Line properties, passed to `matplotlib.axes.Axes.plot`.

    Returns
    -------
    matplotlib Axes
    """
    verdict = "stable" if result.stable else f"{result.unstable_poles} unstable"
    said = (
        f"{result.encirclements} encirclements, {result.unstable_controller_poles} unstable controller poles: {verdict}"
    )
    with panels(ax, ("Nyquist curve",), (4.8, 5.4)) as (axes,):
        _around(axes, _smooth(result.curve), None, said, "det(I − G K) − 1", style)
    return axes


def plot_mode_table(result: "ModeTable", ax: Any = None, **style: Any) -> Any:
    """Draw the damping of each mode over its frequency, both logarithmic; the legend counts modes without damping.

    Parameters
    ----------
    result : ModeTable
    ax : matplotlib Axes or figure, optional
        Axes to draw on. If None, a new figure is created.
    **style
        Line properties of the markers, passed to `matplotlib.axes.Axes.plot`.

    Returns
    -------
    matplotlib Axes
    """
    with panels(ax, ("damping",), (6.0, 3.8)) as (axes,):
        shown = [row for row in result.rows if row.damping_ratio > 0.0 and np.isfinite(row.omega) and row.omega > 0.0]
        missing = len(result.rows) - len(shown)
        said = f"modes ({missing} without damping not shown)" if missing else "modes"
        look = line_look(style, color=COLORS[0], marker="o", markersize=4, linestyle="none", label=said)
        axes.loglog([row.omega / (2.0 * np.pi) for row in shown], [100.0 * row.damping_ratio for row in shown], **look)
        axes.set(xlabel="natural frequency [Hz]", ylabel="damping [%]")
        few_labels(axes)
        axes.legend()
    return axes
