"""Pictures of slews: one, several side by side, feedback, meshes, switching function, payloads, spin-ups, the film."""

from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from boomctl.arrays import Array
from boomctl.plotting.canvas import COLOURS, new_figure, style

_SHAPES = "osDPXph*d<>"
_NEAR = 0.7  # share of a limit from which a curve is near it, and the limit drawn (a choice)
# slope of an error from which it is said to fall: on coarse meshes fast vibration is not seen (a choice)
_FALLING = 0.5
_NOTHING = 1e-4  # vibration that is drawn as none [m]: 0.1 mm of a beam of 8 m is not to be seen


def plot_slew(result: Any) -> Figure:
    """Draw torque, hub angle and speed, tip displacement and root moment of a slew over time, with the limits near them.

    Parameters
    ----------
    result : SlewResult
    """
    limits = result.plan.problem.limits.given
    curves = [
        ("torque [N m]", result.torque, limits["torque"]),
        ("hub angle [rad]", result.hub_angle, None),
        ("hub speed [rad/s]", result.hub_speed, limits.get("speed")),
        ("tip displacement [m]", result.tip_displacement, limits.get("tip")),
        ("root moment [N m]", result.root_moment, limits.get("moment")),
    ]
    curves = [curve for curve in curves if curve[1] is not None]
    with style():
        figure = new_figure(7.0, 1.45 * len(curves) + 0.4)
        axes = np.atleast_1d(figure.subplots(len(curves), 1, sharex=True))
        limited = False
        for ax, (label, values, limit) in zip(axes, curves, strict=True):
            limited |= _draw_limit(ax, limit, values)
            if label.startswith("torque"):
                _draw_torque(ax, result.history, COLOURS[0])
            else:
                ax.plot(result.time, values)
            ax.set_ylabel(label)
        axes[0].set_title(
            f"{result.title.capitalize()}: {result.duration:.4g} s" + ("; broken lines: limits" if limited else "")
        )
        axes[-1].set_xlabel("time [s]")
        axes[-1].set_xlim(-0.01 * result.duration, 1.01 * result.duration)
        figure.align_ylabels(axes)
    return figure


def _draw_limit(ax: Any, limit: float | None, values: Any) -> bool:
    """Draw both signs of a limit where the curve comes near them, and return whether it does."""
    levels = [] if limit is None else [level for level in (limit, -limit) if np.max(values / level) > _NEAR]
    for level in levels:
        ax.axhline(level, color="0.45", linewidth=2.4, alpha=0.5, linestyle="--")
    return bool(levels)


def _draw_torque(ax: Any, history: Any, colour: str) -> None:
    t = np.repeat(history.edges, 2)
    values = np.concatenate([[0.0], np.column_stack([history.left, history.right]).ravel(), [0.0]])
    ax.plot(t, values, color=colour)


def plot_slew_comparison(comparison: Any, names: tuple[str, ...] = ()) -> Figure:
    """Draw torque and tip displacement of several slews, and duration against vibration at three frequencies.

    Parameters
    ----------
    comparison : SlewComparison
    names : tuple of str
        Which slews to draw over time; all stand in the right-hand panel. () draws the first four.
    """
    shown = [line for line in comparison.lines if line.name in names] if names else list(comparison.lines[:4])
    # those drawn over time come first, for colours repeat
    ranked = [*shown, *(line for line in comparison.lines if line not in shown)]
    looks = {line.name: _line_style(k) for k, line in enumerate(ranked)}
    with style():
        figure = new_figure(10.5, 0.75 * len(shown) + 3.6)
        figure.set_layout_engine("constrained", h_pad=0.03)
        grid = figure.add_gridspec(len(shown) + 1, 2, width_ratios=(1.2, 1.0), height_ratios=[1.0] * len(shown) + [2.6])
        _draw_over_time(figure, grid, comparison, shown, looks)
        right = figure.add_subplot(grid[:, 1])
        _draw_vibration(right, comparison.lines, looks)
        figure.legend(*right.get_legend_handles_labels(), loc="outside lower center", ncols=4, columnspacing=1.2)
    return figure


def _line_style(k: int) -> dict[str, Any]:
    """Colour and marker of the k-th slew: the second round of colours is hollow."""
    colour = COLOURS[k % len(COLOURS)]
    filled = k < len(COLOURS)
    return {"color": colour, "marker": _SHAPES[k % len(_SHAPES)], "markerfacecolor": colour if filled else "white"}


def _draw_over_time(figure: Figure, grid: Any, comparison: Any, shown: list[Any], looks: dict[str, Any]) -> None:
    """One strip of torque a slew, for bang-bang torques hide each other, and all tips below."""
    tip = figure.add_subplot(grid[len(shown), 0])
    limit = comparison.torque_limit
    for k, line in enumerate(shown):
        strip = figure.add_subplot(grid[k, 0], sharex=tip)
        _draw_torque(strip, line.history, looks[line.name]["color"])
        strip.set(ylim=(-1.25 * limit, 1.25 * limit), yticks=(-limit, 0.0, limit))
        strip.tick_params(labelbottom=False)
        strip.text(0.99, 0.92, line.name, transform=strip.transAxes, ha="right", va="top", fontsize=8)
        if k == 0:
            strip.set_title("Torque [N m]")
        tip.plot(line.time, line.tip_displacement, color=looks[line.name]["color"])
    tip.set(xlabel="time [s]", xlim=(0.0, 1.02 * max(line.time[-1] for line in shown)))
    tip.set_title("Tip displacement [m]")


def _draw_vibration(ax: Any, lines: tuple[Any, ...], looks: dict[str, Any]) -> None:
    """Vibration over duration; less than 0.1 mm counts as nothing and stands on the lower edge."""
    for line, x in zip(lines, _apart([line.duration for line in lines]), strict=True):
        look = looks[line.name]
        low, planned, high = np.maximum([line.vibration_low, line.vibration, line.vibration_high], _NOTHING)
        ax.plot([x] * 3, sorted((low, planned, high)), color=look["color"], linewidth=0.8, zorder=1)
        for value, marker in ((low, "v"), (high, "^")):
            ax.plot(x, value, linestyle="none", marker=marker, color=look["color"], markersize=3.5)
        ax.plot(x, planned, linestyle="none", markersize=7, clip_on=False, label=line.name, zorder=3, **look)
    ax.set(yscale="log", xlabel="duration [s]")
    ax.set_ylim(bottom=_NOTHING)
    _vibration_ticks(ax)
    for marker, change in (("v", "−10 %"), ("^", "+10 %")):
        ax.plot([], [], linestyle="none", marker=marker, color="0.3", markersize=3.5, label=f"frequencies {change}")
    ax.set_title("Tip vibration afterwards [m]")


def _vibration_ticks(ax: Any) -> None:
    ticks = [tick for tick in (_NOTHING, 1e-3, 1e-2, 1e-1, 1.0, 10.0) if tick <= ax.get_ylim()[1]]
    ax.set_yticks(ticks, [r"$\leq 10^{-4}$", *(f"$10^{{{round(np.log10(tick))}}}$" for tick in ticks[1:])])


def _apart(values: list[float]) -> Array:
    """Abscissae of markers: equal ones are moved a little aside."""
    places = np.array(values)
    step = 0.025 * max(float(np.ptp(places)), 1e-9)
    order = np.argsort(places, kind="stable")
    for before, k in pairwise(order):
        places[k] = max(places[k], places[before] + step)
    return places


def plot_tracking(result: Any) -> Figure:
    """Draw hub angle, tip displacement and torque with and without feedback.

    Parameters
    ----------
    result : TrackingResult
    """
    rows = (
        ("hub angle [rad]", result.reference_angle, result.open_hub_angle, result.hub_angle),
        ("tip displacement [m]", result.reference_tip, result.open_tip_displacement, result.tip_displacement),
        ("torque [N m]", None, result.open_torque, result.torque),
    )
    with style():
        figure = new_figure(7.0, 5.4)
        axes = figure.subplots(3, 1, sharex=True)
        for ax, (label, planned, free, closed) in zip(axes, rows, strict=True):
            if planned is not None:
                ax.plot(result.time, planned, color="0.6", linewidth=2.6, label="planned")
            ax.plot(result.time, free, color=COLOURS[1], label="feedforward alone")
            ax.plot(result.time, closed, color=COLOURS[0], label="with feedback")
            ax.set_ylabel(label)
        axes[0].legend(loc="lower right")
        axes[0].set_title(f"The plan followed with a tip mass of {result.tip_mass:g} kg")
        axes[-1].set_xlabel("time [s]")
        axes[-1].set_xlim(0.0, result.time[-1])
    return figure


def plot_mesh_study(study: Any) -> Figure:
    """Draw errors over the number of intervals, each with its order.

    Parameters
    ----------
    study : MeshStudy
    """
    with style():
        figure = new_figure(7.0, 4.4)
        ax = figure.add_subplot()
        for k, line in enumerate(study.lines):
            kept = line.errors > 0.0
            order = f"order {line.order:.1f}" if line.order > _FALLING else "order not seen"
            ax.loglog(
                study.intervals[kept], line.errors[kept], markersize=5, label=f"{line.name}: {order}", **_line_style(k),
            )  # fmt: skip
        ticks = [int(n) for n in study.intervals]
        ax.set_xlim(0.92 * ticks[0], 1.09 * ticks[-1])
        ax.set_xticks(ticks, [str(n) for n in ticks])
        ax.set_xticks([], minor=True)
        ax.set(xlabel="number of intervals", ylabel="relative error")
        ax.set_title(f"Minimum effort, {study.duration:.3g} s: error against mesh size")
        figure.legend(loc="outside lower center", ncols=2)
    return figure


def plot_switching(curve: Any) -> Figure:
    """Draw the switching function above the torque, which is to have its sign.

    Parameters
    ----------
    curve : SwitchingCurve
    """
    with style():
        figure = new_figure(7.0, 3.6)
        upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(1.6, 1.0))
        for ax in (upper, lower):
            for t in curve.switches:
                ax.axvline(t, color="0.7", linewidth=0.7, zorder=0)
        upper.axhline(0.0, color="0.3", linewidth=0.8)
        for sign, colour in ((1.0, COLOURS[0]), (-1.0, COLOURS[1])):
            inside = np.maximum(sign * curve.values, 0.0) * sign
            upper.fill_between(curve.time, 0.0, inside, color=colour, alpha=0.18, linewidth=0.0)
        upper.plot(curve.time, curve.values, color="0.15")
        # most switches stand where the function is small
        upper.set_yscale("function", functions=(np.cbrt, lambda root: root**3))
        ticks = (-1.0, -0.1, -0.01, 0.0, 0.01, 0.1, 1.0)
        upper.set_yticks(ticks, [f"{tick:g}".replace("-", "−") for tick in ticks])
        upper.set_ylabel("switching function\n(cube-root scale)")
        upper.set_title("The sign of the switching function, and the torque")
        lower.step(curve.time, curve.torque, where="mid", color=COLOURS[0])
        limit = curve.torque_limit
        lower.set(ylabel="torque [N m]", xlabel="time [s]", ylim=(-1.2 * limit, 1.2 * limit))
        lower.set_yticks((-limit, 0.0, limit))
        lower.set_xlim(0.0, float(curve.time[-1]))
        figure.align_ylabels((upper, lower))
    return figure


def plot_payloads(comparison: Any) -> Figure:
    """Draw tip displacements over time, one panel a slew, and the vibration left over the payload.

    Parameters
    ----------
    comparison : PayloadComparison
    """
    names = list(comparison.durations)
    masses = sorted({line.tip_mass for line in comparison.lines})
    shades = dict(zip(masses, _shades(len(masses)), strict=True))
    with style():
        figure = new_figure(10.5, 2.3 * len(names) + 0.5)
        grid = figure.add_gridspec(len(names), 2, width_ratios=(1.35, 1.0))
        first = None
        for k, name in enumerate(names):
            first = figure.add_subplot(grid[k, 0], sharex=first, sharey=first)
            _draw_tips(first, comparison, name, shades)
            first.tick_params(labelbottom=k == len(names) - 1)
        figure.axes[-1].set_xlabel("time [s]")
        figure.axes[0].legend(ncols=2, loc="lower right", title="payload", title_fontsize=8)
        right = figure.add_subplot(grid[:, 1])
        _draw_sweep(right, comparison, names)
        figure.legend(*right.get_legend_handles_labels(), loc="outside lower right", ncols=len(names))
    return figure


def _shades(count: int) -> list[tuple[float, ...]]:
    """Colours from light to heavy."""
    import matplotlib as mpl

    return [tuple(colour) for colour in mpl.colormaps["viridis"](np.linspace(0.0, 0.88, count))]


def _draw_tips(ax: Any, comparison: Any, name: str, shades: dict[float, Any]) -> None:
    ax.axvspan(0.0, comparison.durations[name], color="0.94", zorder=0)
    for line in comparison.lines:
        if line.slew == name:
            dash = "-" if line.planned else (0, (4, 1.5))
            label = f"{line.tip_mass:g} kg"
            ax.plot(line.time, line.tip_displacement, color=shades[line.tip_mass], linestyle=dash, label=label)
    ax.set_title(name[:1].upper() + name[1:])
    ax.set_ylabel("tip displacement [m]")
    ax.set_xlim(0.0, max(float(line.time[-1]) for line in comparison.lines))


def _draw_sweep(ax: Any, comparison: Any, names: Sequence[str]) -> None:
    """Vibration over payload; less than 0.1 mm counts as nothing and stands on the lower edge."""
    for k, name in enumerate(names):
        ax.plot(comparison.masses, np.maximum(comparison.vibrations[name], _NOTHING), color=COLOURS[k], label=name)
        for planned, face in ((True, COLOURS[k]), (False, "white")):
            lines = [line for line in comparison.lines if line.slew == name and line.planned is planned]
            x, y = [line.tip_mass for line in lines], [max(line.vibration, _NOTHING) for line in lines]
            ax.plot(
                x, y, linestyle="none", marker="os"[k % 2], color=COLOURS[k], markerfacecolor=face, clip_on=False, zorder=3,
            )  # fmt: skip
    ax.set(yscale="log", xlabel="payload [kg]")
    top = max(float(values.max()) for values in comparison.vibrations.values())
    ax.set_ylim(_NOTHING, 2.0 * max(top, 10.0 * _NOTHING))
    _vibration_ticks(ax)
    masses = sorted({line.tip_mass for line in comparison.lines})
    ax.set_xticks(masses, [f"{mass:g}" for mass in masses])
    ax.set_xlim(float(comparison.masses[0]), float(comparison.masses[-1]))
    ax.set_title("Tip vibration afterwards [m]")


def plot_spin_ups(spin_ups: Sequence[Any], torque_limit: float, final_speed: float) -> Figure:
    """Draw torque, hub speed and tip displacement of spin-ups on one time axis.

    Parameters
    ----------
    spin_ups : sequence of SpinUpMotion
    torque_limit, final_speed : float
        N m, rad/s.
    """
    rows = (
        ("torque [N m]", "torque", (-torque_limit, torque_limit)),
        ("hub speed [rad/s]", "hub_speed", (final_speed,)),
        ("tip displacement [m]", "tip_displacement", ()),
    )
    with style():
        figure = new_figure(7.0, 5.8)
        axes = figure.subplots(3, 1, sharex=True)
        for ax, (label, key, levels) in zip(axes, rows, strict=True):
            for level in levels:
                ax.axhline(level, color="0.45", linewidth=2.4, alpha=0.5, linestyle="--")
            for k, each in enumerate(spin_ups):
                values = getattr(each.motion, key)
                ax.plot(each.motion.time, values, color=COLOURS[k], label=each.name, zorder=3 - k)
                ax.axvline(each.duration, color=COLOURS[k], linewidth=0.8, linestyle=":")
            ax.set_ylabel(label)
        axes[1].legend(loc="lower right")
        axes[0].set_title(f"Spun up to {final_speed:g} rad/s")
        axes[-1].set_xlabel("time [s]")
        axes[-1].set_xlim(0.0, float(spin_ups[0].motion.time[-1]))
        figure.align_ylabels(axes)
    return figure


def slew_film(result: Any, others: dict[str, tuple[Any, Any]], seconds_after: float = 2.0) -> bytes:
    """Draw a slew as a GIF in real time.

    Parameters
    ----------
    result : SlewResult
        Of a hub-beam.
    others : dict of str to (ndarray, ndarray)
        For each curve instants [s] and positions along the beam, complex, k x m [m].
    seconds_after : float
        How long it goes on after the end, s.
    """
    from boomctl.plotting.rotating_beam import Film, film_bytes

    time = np.arange(0.0, result.duration + seconds_after, 0.05)
    shapes = []
    for name, (t, positions) in others.items():
        k = np.clip(np.searchsorted(t, time), 0, t.size - 1)
        shapes.append((name, positions[k]))
    radius = float(np.abs(shapes[0][1][0, 0]))
    return film_bytes(Film(time, tuple(shapes), radius, result.title.capitalize()))
