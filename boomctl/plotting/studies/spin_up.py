"""Pictures of a spin-up with a scheduled drive: runs over time, decay over hub speed."""

from typing import Any

import numpy as np

from boomctl.arrays import Array
from boomctl.plotting.canvas import COLOURS, line_look, panels

_DASHES = ("-", "--", ":")
_NEAR = 0.25  # share of the largest displacement after the spin-up that the enlarged panel shows (a choice)


def plot_spin_up_runs(result: Any, ax: Any = None, **style: Any) -> Array:
    """Draw the runs of a spin-up with the larger tip mass.

    Parameters
    ----------
    result : SpinUpResult
    ax : sequence of matplotlib Axes, or a figure, optional
        One for the deviation of the hub speed, the tip displacement, the same enlarged, and the torque; by default a new
        figure of pyplot.
    **style
        Of the curves, as matplotlib's lines take it.

    Returns
    -------
    (4,) ndarray of matplotlib Axes
    """
    from boomctl.rotating_beam.manoeuvres import spin_up

    design, mass = result.design, result.design.tip_mass[-1]
    manoeuvre = spin_up(design.final_speed, design.duration)
    panes = ["speed error [rad/s]", "tip displacement [m]", "tip, enlarged [mm]", "torque [N m]"]
    with panels(ax, panes, (7.4, 7.6)) as axes:
        largest = 0.0
        for k, way in enumerate(way for way, each in result.runs if each == mass):
            run = result.runs[way, mass]
            torque = run.controls.get("torque", run.disturbances.get("torque", np.zeros(len(run.time))))
            tip, late = run["tip_displacement"], run.time > design.duration
            look = line_look(style, color=COLOURS[k % len(COLOURS)], linewidth=1.0, label=way)
            axes[0].plot(run.time, run["hub_speed"] - manoeuvre.speed(run.time), **look)
            axes[1].plot(run.time, tip, **look)
            axes[2].plot(run.time[late], 1e3 * tip[late], **look)
            axes[3].plot(run.time, torque, **look)
            largest = max(largest, 1e3 * float(np.abs(tip[late]).max()))
        for each, name in zip(axes, panes, strict=True):
            each.set_ylabel(name)
        axes[2].set_ylim(-_NEAR * largest, _NEAR * largest)
        axes[0].legend(loc="best")
        axes[-1].set_xlabel("time [s]")
        axes[0].figure.align_ylabels(list(axes))
    return axes


def plot_decay(result: Any, ax: Any = None, **style: Any) -> Any:
    """Draw how fast the slowest mode decays at each hub speed.

    Parameters
    ----------
    result : SpinUpResult
    ax : matplotlib Axes or figure, optional
        By default a new figure of pyplot.
    **style
        Of the curves, as matplotlib's lines take it.

    Returns
    -------
    matplotlib Axes
    """
    with panels(ax, ["decay"], (7.0, 3.6)) as axes:
        ways = list(dict.fromkeys(way for way, _ in result.decay))
        for (way, mass), rates in result.decay.items():
            dash = _DASHES[result.design.tip_mass.index(mass) % len(_DASHES)]
            label = f"{way}, {mass:g} kg at the tip"
            look = line_look(style, color=COLOURS[ways.index(way)], linestyle=dash, linewidth=1.2, label=label)
            axes[0].plot(result.speeds, rates, **look)
        axes[0].set_xlabel("hub speed [rad/s]")
        axes[0].set_ylabel("decay of the slowest mode [1/s]")
        axes[0].set_ylim(bottom=min(0.0, axes[0].get_ylim()[0]))
        axes[0].legend()
    return axes[0]
