"""Plots of slews: one, several side by side, feedback, switching function, spin-ups, an animation."""

from collections.abc import Iterable, Mapping, Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from matplotlib.animation import FuncAnimation
from matplotlib.axes import Axes
from matplotlib.figure import FigureBase
from matplotlib.patches import Circle

from boomctl.arrays import Array
from boomctl.checks import known
from boomctl.plotting.canvas import (
    COLORS,
    common_legend,
    divided,
    labeled,
    legend,
    line_look,
    new_figure,
    over_time,
    panels,
    style,
)
from boomctl.plotting.rotating_beam import mark_large

_SHAPES = "osDPXph*d<>"
_BANDS = 0.05, 0.25, 0.5, 0.75, 0.95  # quantiles drawn: median, quartiles, and the central 90 %
_CLOSE_TO = 0.7  # fraction of a limit above which the limit is drawn
_LOWEST = 1e-4  # Vibration that is drawn as zero [m].
_EDGES = 0.01  # margin of the time axis on both sides, as a fraction, so that vertical steps are visible


def plot_slew(result: Any, ax: Any = None, **style: Any) -> Array:
    """Draw torque, hub angle and speed, tip displacement and root moment of a slew over time, with the limits near them.

    Parameters
    ----------
    result : SlewResult
    ax : sequence of matplotlib Axes, or a figure, optional
        One for each available quantity. If None, a new figure is created.
    **style
        Line properties, passed to `matplotlib.axes.Axes.plot`.

    Returns
    -------
    (n,) ndarray of matplotlib Axes
    """
    limits = result.plan.problem.limits.by_kind
    there = {
        "torque": result.torque,
        "angle": result.hub_angle,
        "speed": result.hub_speed,
        "tip": result.tip_displacement,
        "moment": result.root_moment,
    }
    curves = [(kind, values, limits.get(kind)) for kind, values in there.items() if values is not None]
    with panels(ax, [kind for kind, _, _ in curves], (7.0, 1.45 * len(curves) + 0.4)) as axes:
        first, limited, look = not axes[0].has_data(), False, line_look(style)
        for item, (kind, values, limit) in zip(axes, curves, strict=True):
            limited |= _draw_limit(item, limit, values)
            if kind == "torque":
                _draw_torque(item, result.torque_profile, look)
            else:
                item.plot(result.time, values, **look)
            if kind == "tip":
                mark_large(item, result)
        if first:
            note = "; broken lines: limits" if limited else ""
            axes[0].set_title(f"{result.title.capitalize()}: {result.duration:.4g} s{note}")
        legend(axes[0])
        names = [
            labeled(*result._labels[kind]).replace(" [", "\n[") for kind, _, _ in curves
        ]  # Two lines fit the axes.
        over_time(axes, names, _EDGES)
    return axes


def plot_torque(profile: Any, ax: Any = None, **style: Any) -> Any:
    """Draw a torque over time.

    Parameters
    ----------
    profile : TorqueProfile
    ax : matplotlib Axes or figure, optional
        Axes to draw on. If None, a new figure is created.
    **style
        Line properties, passed to `matplotlib.axes.Axes.plot`.

    Returns
    -------
    matplotlib Axes
    """
    with panels(ax, ("torque",), (6.4, 2.6)) as (axes,):
        look = line_look(style)
        _draw_torque(axes, profile, look)
        axes.set(xlabel="time [s]", ylabel=labeled("torque", profile.unit), xmargin=_EDGES)
        legend(axes)
    return axes


def _draw_limit(ax: Any, limit: float | None, values: Any) -> bool:
    """Draw both signs of a limit where the curve comes near them, and return whether it does."""
    levels = [] if limit is None else [level for level in (limit, -limit) if np.max(values / level) > _CLOSE_TO]
    for level in levels:
        ax.axhline(level, color="0.45", linewidth=2.4, alpha=0.5, linestyle="--")
    return bool(levels)


def _draw_torque(ax: Any, profile: Any, look: dict[str, Any]) -> None:
    t = np.repeat(profile.edges, 2)
    values = np.concatenate([[0.0], np.column_stack([profile.start_values, profile.end_values]).ravel(), [0.0]])
    ax.plot(t, values, **look)


def plot_slew_comparison(comparison: Any, ax: Any = None, *, names: Sequence[str] = (), **style: Any) -> Array:
    """Draw torque and tip displacement of several slews, and duration against vibration at three frequencies.

    Parameters
    ----------
    comparison : SlewComparison
    ax : sequence of matplotlib Axes, or a figure, optional
        One for the torque of each slew drawn over time, one for their tips, one for the vibration, and one for the
        vibration over tip masses, if any. If None, a new figure is created.
    names : sequence of str
        Slews to draw over time, the first four if empty. The vibration of all slews is drawn.
    **style
        Line properties, passed to `matplotlib.axes.Axes.plot`.

    Returns
    -------
    (n,) ndarray of matplotlib Axes
    """
    for name in names:
        known("slew", name, [line.name for line in comparison.rows])
    shown = [line for line in comparison.rows if line.name in names] if names else list(comparison.rows[:4])
    # slews drawn over time come first, since colors repeat
    ranked = [*shown, *(line for line in comparison.rows if line not in shown)]
    looks, loads = {line.name: _line_style(k) for k, line in enumerate(ranked)}, comparison.tip_masses

    def divide(figure: FigureBase) -> Iterable[Axes]:
        heights = [1.0] * len(shown) + [2.6]
        grid = figure.add_gridspec(len(shown) + 1, 2, width_ratios=(1.2, 1.0), height_ratios=heights)
        tip = figure.add_subplot(grid[len(shown), 0])
        strips = [figure.add_subplot(grid[k, 0], sharex=tip) for k in range(len(shown))]
        if not loads.size:
            return [*strips, tip, figure.add_subplot(grid[:, 1])]
        right = grid[:, 1].subgridspec(2, 1)
        return [*strips, tip, figure.add_subplot(right[0]), figure.add_subplot(right[1])]

    titles = [*(f"torque of {line.name}" for line in shown), "tips", "vibration"]
    titles += ["vibration over tip masses"] if loads.size else []
    with panels(ax, titles, (10.5, 0.75 * len(shown) + 3.6), divide) as axes:
        _draw_over_time(axes, comparison, shown, looks, style)
        _draw_vibration(axes[len(shown) + 1], comparison.rows, looks)
        if loads.size:
            _draw_loaded(axes[-1], comparison, looks)
        common_legend(ax, axes[len(shown) + 1], ncols=4, columnspacing=1.2)
    return axes


def _line_style(k: int) -> dict[str, Any]:
    """Color and marker of the k-th slew: the second round of colors is hollow."""
    color = COLORS[k % len(COLORS)]
    filled = k < len(COLORS)
    return {"color": color, "marker": _SHAPES[k % len(_SHAPES)], "markerfacecolor": color if filled else "white"}


def _draw_over_time(
    axes: Array, comparison: Any, shown: list[Any], looks: dict[str, Any], style: dict[str, Any]
) -> None:
    """One strip of torque a slew, for bang-bang torques hide each other, and all tips below."""
    tip, limit = axes[len(shown)], comparison.torque_limit
    for k, line in enumerate(shown):
        strip, look = axes[k], line_look(style, color=looks[line.name]["color"])
        _draw_torque(strip, line.torque_profile, look)
        strip.set(ylim=(-1.25 * limit, 1.25 * limit), yticks=(-limit, 0.0, limit))
        strip.tick_params(labelbottom=False)
        strip.text(0.99, 0.92, line.name, transform=strip.transAxes, ha="right", va="top", fontsize=8)
        if k == 0:
            strip.set_title("Torque [N m]")
        tip.plot(line.time, line.tip_displacement, **look)
    tip.set(xlabel="time [s]", xlim=(0.0, 1.02 * max(line.time[-1] for line in shown)))
    for strip in axes[: len(shown)]:
        strip.set_xlim(tip.get_xlim())
    tip.set_title("Tip displacement [m]")


def _draw_vibration(ax: Any, lines: tuple[Any, ...], looks: dict[str, Any]) -> None:
    """Vibration over duration; less than 0.1 mm is drawn on the lower edge."""
    for line, x in zip(lines, _separated([line.duration for line in lines]), strict=True):
        look = looks[line.name]
        low, planned, high = np.maximum(
            [line.residual_vibration_low, line.residual_vibration, line.residual_vibration_high], _LOWEST
        )
        ax.plot([x] * 3, sorted((low, planned, high)), color=look["color"], linewidth=0.8, zorder=1)
        for value, marker in ((low, "v"), (high, "^")):
            ax.plot(x, value, linestyle="none", marker=marker, color=look["color"], markersize=3.5)
        ax.plot(x, planned, linestyle="none", markersize=7, clip_on=False, label=line.name, zorder=3, **look)
    ax.set(yscale="log", xlabel="duration [s]")
    ax.set_ylim(bottom=_LOWEST)
    _vibration_ticks(ax)
    for marker, change in (("v", "−10 %"), ("^", "+10 %")):
        ax.plot([], [], linestyle="none", marker=marker, color="0.3", markersize=3.5, label=f"frequencies {change}")
    ax.set_title("Tip vibration afterwards [m]")


def _draw_loaded(ax: Any, comparison: Any, looks: dict[str, Any]) -> None:
    """Vibration over tip mass; less than 0.1 mm is drawn on the lower edge."""
    for line in comparison.rows:
        left = np.maximum(line.vibrations, _LOWEST)
        ax.plot(comparison.tip_masses, left, linewidth=0.8, markersize=5, clip_on=False, **looks[line.name])
    ax.set(yscale="log", xlabel="tip mass [kg]", title="Tip vibration afterwards [m]")
    ax.set_ylim(bottom=_LOWEST)
    _vibration_ticks(ax)


def _vibration_ticks(ax: Any) -> None:
    ticks = [tick for tick in (_LOWEST, 1e-3, 1e-2, 1e-1, 1.0, 10.0) if tick <= ax.get_ylim()[1]]
    ax.set_yticks(ticks, [r"$\leq 10^{-4}$", *(f"$10^{{{round(np.log10(tick))}}}$" for tick in ticks[1:])])


def _separated(values: list[float]) -> Array:
    """Return abscissae of markers, with equal ones separated."""
    positions = np.array(values)
    step = 0.025 * max(float(np.ptp(positions)), 1e-9)
    order = np.argsort(positions, kind="stable")
    for before, k in pairwise(order):
        positions[k] = max(positions[k], positions[before] + step)
    return positions


def plot_tracking_study(study: Any, ax: Any = None, **style: Any) -> Array:
    """Draw the runs of a tracked slew: hub angle less the plan, tip, torque, and distribution of the residual vibration.

    Parameters
    ----------
    study : TrackingStudy
    ax : sequence of four matplotlib Axes, or a figure, optional
        Axes to draw on. If None, a new figure is created.
    **style
        Line properties, passed to `matplotlib.axes.Axes.plot`.

    Returns
    -------
    (4,) ndarray of matplotlib Axes
    """
    deviation = study.outputs["hub_angle"] - study.reference["hub_angle"]
    rows = (
        ("hub angle error [rad]", deviation, None),
        ("tip displacement [m]", study.outputs["tip_displacement"], study.reference["tip_displacement"]),
        ("torque [N m]", study.outputs["torque"], study.reference["torque"]),
    )
    names = [*(row[0] for row in rows), "fraction of runs"]
    with panels(ax, names, (7.0, 7.2), divided(4, 1)) as axes:
        for item, (label, runs, planned) in zip(axes, rows, strict=False):
            low, quarter, middle, most, high = np.quantile(runs, _BANDS, axis=0)
            look = line_look(style, linewidth=1.0, label="median")
            (line,) = item.plot(study.time, middle, **look)
            color = line.get_color()
            item.fill_between(study.time, low, high, color=color, alpha=0.18, linewidth=0.0, label="5 to 95 %")
            item.fill_between(study.time, quarter, most, color=color, alpha=0.35, linewidth=0.0, label="25 to 75 %")
            if planned is not None:
                item.plot(study.time, planned, color="0.35", linewidth=0.8, linestyle="--", label="planned")
            item.axvline(study.duration, color="0.7", linewidth=0.8)
            item.set(ylabel=label, xmargin=0.0)
        axes[1].legend(loc="upper right", ncols=2)
        axes[2].set_xlabel("time [s]")
        left = np.maximum(np.sort(study.residual_vibration), _LOWEST)
        fraction = np.arange(1, left.size + 1) / left.size
        axes[3].semilogx(np.append(left[0], left), np.append(0.0, fraction), **line_look(style, drawstyle="steps-post"))
        axes[3].set(ylim=(0.0, 1.02), ylabel="fraction of runs", xlabel="residual vibration [m]")
        how = "with feedback" if study.feedback else "feedforward only"
        axes[0].set_title(f"{study.residual_vibration.size} runs, {how}")
        axes[0].figure.align_ylabels(list(axes))
    return axes


def plot_switching(curve: Any, ax: Any = None, **style: Any) -> Array:
    """Draw the switching function above the torque, which is to have its sign.

    Parameters
    ----------
    curve : SwitchingFunction
    ax : sequence of two matplotlib Axes, or a figure, optional
        Axes to draw on. If None, a new figure is created.
    **style
        Line properties, passed to `matplotlib.axes.Axes.plot`.

    Returns
    -------
    (2,) ndarray of matplotlib Axes
    """
    divide = divided(2, 1, sharex=True, height_ratios=(1.6, 1.0))
    with panels(ax, ("switching function", "torque"), (7.0, 3.6), divide) as axes:
        upper, lower = axes
        for item in axes:
            for t in curve.switching_times:
                item.axvline(t, color="0.7", linewidth=0.7, zorder=0)
            item.set_xmargin(0.0)
        upper.axhline(0.0, color="0.3", linewidth=0.8)
        for sign, color in ((1.0, COLORS[0]), (-1.0, COLORS[1])):
            inside = np.maximum(sign * curve.values, 0.0) * sign
            upper.fill_between(curve.time, 0.0, inside, color=color, alpha=0.18, linewidth=0.0)
        upper.plot(curve.time, curve.values, **line_look(style, color="0.15"))
        # Most switches are where the function is small.
        upper.set_yscale("function", functions=(np.cbrt, lambda root: root**3))
        ticks = (-1.0, -0.1, -0.01, 0.0, 0.01, 0.1, 1.0)
        upper.set_yticks(ticks, [f"{tick:g}".replace("-", "−") for tick in ticks])
        upper.set_ylabel("switching function\n(cube-root scale)")
        upper.set_title("The sign of the switching function, and the torque")
        lower.step(curve.time, curve.torque, where="mid", **line_look(style, color=COLORS[0]))
        limit = curve.torque_limit
        lower.set(ylabel="torque [N m]", xlabel="time [s]", ylim=(-1.2 * limit, 1.2 * limit))
        lower.set_yticks((-limit, 0.0, limit))
        upper.figure.align_ylabels((upper, lower))
    return axes


def animate_slew(
    h: Any, motions: Mapping[str, Any], *, title: str = "", until: float | None = None, time_step: float = 0.05
) -> FuncAnimation:
    """Animate motions of a hub-beam in real time, in top view.

    Parameters
    ----------
    h : hub-beam
        Result of `hub_beam`, or a geometrically exact beam, for the shape of its states.
    motions : mapping of str to SimulationResult
        Motions by name, as from ``h.simulate(slew, timepts)``.
    title : str
        Title, above the time.
    until : float, optional
        End time [s]. If None, the end of the first motion.
    time_step : float
        Time between frames [s].

    Returns
    -------
    matplotlib.animation.FuncAnimation
        ``.save("slew.gif")`` writes it, ``.to_jshtml()`` shows it in a notebook.

    Examples
    --------
    >>> import boomctl as bc
    >>> import numpy as np
    >>> beam = bc.hub_beam(modes=1)
    >>> fast = bc.optimal_slew(beam, angle=1.0, torque_limit=200.0)
    >>> moved = beam.simulate(fast, np.linspace(0.0, 1.5 * fast.duration, 201))
    >>> bc.plotting.animate_slew(beam, {"least time": moved}, time_step=0.5).save("slew.gif")  # doctest: +SKIP
    """
    first = next(iter(motions.values()))
    time = np.arange(0.0, first.time[-1] if until is None else until, time_step)
    frames = {name: np.clip(np.searchsorted(m.time, time), 0, m.time.size - 1) for name, m in motions.items()}
    shapes = [h.deformed_shape(m.states[frames[name]]) for name, m in motions.items()]
    radius, extent = h.parameters.hub_radius, max(float(np.abs(shape).max()) for shape in shapes)
    axis = extent * np.exp(1j * first.hub_angle[next(iter(frames.values()))])
    with style():
        figure = new_figure(4.4, 4.6)
        ax = figure.add_subplot()
        ax.set(xlim=(-1.06 * extent, 1.06 * extent), ylim=(-1.06 * extent, 1.06 * extent), aspect="equal")
        ax.set(xlabel="x [m]", ylabel="y [m]")
        ax.add_patch(Circle((0.0, 0.0), radius, color="0.75"))
        (spoke,) = ax.plot([], [], ":", color="0.6", linewidth=1.0, label="hub's axis")
        lines = [
            ax.plot([], [], color=COLORS[k % len(COLORS)], linewidth=1.8, label=name)[0]
            for k, name in enumerate(motions)
        ]
        ax.legend(loc="lower left")
        caption = ax.set_title(" ")
        figure.draw_without_rendering()
        figure.set_layout_engine("none")  # the layout is constant and slower than drawing

    def draw(k: int) -> list[Any]:
        spoke.set_data([0.0, axis[k].real], [0.0, axis[k].imag])
        for line, shape in zip(lines, shapes, strict=True):
            line.set_data(shape[k].real, shape[k].imag)
        caption.set_text(f"{title}{', ' if title else ''}t = {time[k]:.1f} s")
        return [spoke, *lines, caption]

    return FuncAnimation(figure, draw, frames=time.size, interval=1000.0 * time_step)


def plot_shaper(result: Any, ax: Any = None, **style: Any) -> Array:
    """Draw the impulses of a shaper over time, and its residual vibration over frequency.

    Parameters
    ----------
    result : Shaper
    ax : sequence of two matplotlib Axes, or a figure, optional
        Axes of impulses and residual vibration. If None, a new figure is created.
    **style
        Line properties, passed to `matplotlib.axes.Axes.plot`.

    Returns
    -------
    (2,) ndarray of matplotlib Axes
    """
    with panels(ax, ("impulses", "vibration left"), (7.2, 3.0), divided(1, 2)) as axes:
        look = line_look(style, color=COLORS[0], label=result.name)
        times, sizes = result.times, result.amplitudes
        axes[0].vlines(times, 0.0, sizes, color=look["color"], linewidth=1.4)
        axes[0].plot(times, sizes, **(look | {"marker": "o", "markersize": 4, "linestyle": "none"}))
        axes[0].set(xlabel="time [s]", ylabel="share of the command", ylim=(0.0, 1.1))
        # Without damping the impulses are separated by half a period.
        designed = np.pi / times[1] if len(times) > 1 else 1.0
        omega = np.linspace(0.0, 2.0 * designed, 401)
        axes[1].plot(omega, [100.0 * result.residual_vibration(float(w)) for w in omega], **look)
        axes[1].set(xlabel="frequency of the vibration [rad/s]", ylabel="vibration left [%]", ylim=(0.0, 105.0))
        axes[1].set_xmargin(0.0)
        axes[1].legend()
    return axes
