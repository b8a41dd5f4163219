"""Pictures of slew designs: the switching function, one torque with several payloads, spin-ups."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from boomctl.plotting.canvas import COLOURS, new_figure, style

_NOTHING = 1e-4


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
        upper.set_ylabel("switching function")
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
    ticks = [tick for tick in (1e-4, 1e-3, 1e-2, 1e-1, 1.0, 10.0) if tick <= ax.get_ylim()[1]]
    ax.set_yticks(ticks, [r"$\leq 10^{-4}$", *(f"$10^{{{round(np.log10(tick))}}}$" for tick in ticks[1:])])
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
