"""Pictures of slews: one slew, several side by side, the following of one, errors over meshes, and the film."""

from typing import Any

import numpy as np
from matplotlib.figure import Figure

from boomctl.plotting.canvas import COLOURS, new_figure, style

__all__ = ["plot_mesh_study", "plot_slew", "plot_slew_comparison", "plot_tracking", "slew_film"]


def plot_slew(result: Any) -> Figure:
    """Draw torque, hub angle and speed, tip displacement and root moment of a slew over time.

    Parameters
    ----------
    result : SlewResult
    """
    curves = [
        ("torque [N m]", result.torque),
        ("hub angle [rad]", result.hub_angle),
        ("hub speed [rad/s]", result.hub_speed),
        ("tip displacement [m]", result.tip_displacement),
        ("root moment [N m]", result.root_moment),
    ]
    curves = [(label, values) for label, values in curves if values is not None]
    with style():
        figure = new_figure(7.0, 1.45 * len(curves) + 0.4)
        axes = np.atleast_1d(figure.subplots(len(curves), 1, sharex=True))
        for ax, (label, values) in zip(axes, curves, strict=True):
            if label.startswith("torque"):
                _draw_torque(ax, result.history, None, COLOURS[0])
            else:
                ax.plot(result.time, values)
            ax.set_ylabel(label)
        axes[0].set_title(f"{result.objective}, {result.duration:.4g} s; {_said(result)}")
        axes[-1].set_xlabel("time [s]")
        axes[-1].set_xlim(0.0, result.duration)
        figure.align_ylabels(axes)
    return figure


def _said(result: Any) -> str:
    c = result.certificate
    what = "proved optimal" if c.optimality == "proved" else c.optimality
    return f"{what} within {abs(c.optimality_gap):.0e}; end missed by {c.end_error:.0e}"


def _draw_torque(ax: Any, history: Any, label: str | None, colour: str) -> None:
    t = np.repeat(history.edges, 2)
    values = np.concatenate([[0.0], np.column_stack([history.left, history.right]).ravel(), [0.0]])
    ax.plot(t, values, color=colour, label=label)


def plot_slew_comparison(comparison: Any, names: tuple[str, ...] = ()) -> Figure:
    """Draw torque and tip displacement of several slews, and duration against vibration at three frequencies.

    Parameters
    ----------
    comparison : SlewComparison
    names : tuple of str
        Which slews to draw over time; all stand in the right-hand panel. () draws the first four.
    """
    shown = [line for line in comparison.lines if not names or line.name in names]
    shown = shown if names else shown[:4]
    with style():
        figure = new_figure(10.5, 5.4)
        grid = figure.add_gridspec(2, 2, width_ratios=(1.25, 1.0))
        torque, tip, right = (figure.add_subplot(each) for each in (grid[0, 0], grid[1, 0], grid[:, 1]))
        for line, colour in zip(shown, COLOURS, strict=False):
            _draw_torque(torque, line.history, line.name, colour)
            tip.plot(line.time, line.tip_displacement, color=colour, label=line.name)
        torque.set(ylabel="torque [N m]", title="On the way, and afterwards", xlim=tip.get_xlim())
        tip.set(ylabel="tip displacement [m]", xlabel="time [s]")
        torque.legend(*tip.get_legend_handles_labels(), loc="upper right", fontsize=7)
        for line, k in zip(comparison.lines, range(len(comparison.lines)), strict=True):
            colour = COLOURS[k % len(COLOURS)]
            values = np.maximum([line.vibration_low, line.vibration, line.vibration_high], 1e-9)
            right.plot([line.duration] * 3, values, "-", color=colour, linewidth=0.8)
            right.plot([line.duration] * 3, values, linestyle="none", marker="_", color=colour)
            right.plot(line.duration, values[1], "os^vDP*Xh<>"[k % 11], color=colour, label=line.name)
        right.set(yscale="log", xlabel="duration [s]", ylabel="tip vibration afterwards [m]")
        right.set_title("Marker: as planned; dashes: frequencies ±10 %")
        right.legend(loc="lower right", fontsize=7)
    return figure


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
        axes[0].set_title(f"Tip mass {result.tip_mass:g} kg instead of the planned one")
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
        for line, colour, marker in zip(study.lines, COLOURS * 2, "os^vDP*o", strict=False):
            kept = line.errors > 0.0
            label = f"{line.name}: order {line.order:.2g}"
            ax.loglog(study.intervals[kept], line.errors[kept], marker=marker, color=colour, label=label, markersize=4)
        ticks = [int(n) for n in study.intervals]
        ax.set_xticks(ticks, [str(n) for n in ticks])
        ax.set_xticks([], minor=True)
        ax.set(xlabel="intervals", ylabel="relative error", title="Error against mesh size")
        ax.legend()
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
    from boomctl.plotting.hub_beam import Film, film_bytes

    time = np.arange(0.0, result.duration + seconds_after, 0.05)
    shapes = []
    for name, (t, positions) in others.items():
        k = np.clip(np.searchsorted(t, time), 0, t.size - 1)
        shapes.append((name, positions[k]))
    radius = float(np.abs(shapes[0][1][0, 0]))
    return film_bytes(Film(time, tuple(shapes), radius, f"{result.objective} slew"))
