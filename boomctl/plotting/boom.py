"""Plots of the spray boom: Fig. 3, convergence, friction in its cradle.

They draw the records of :mod:`boomctl.lab.papers.anthonis_ramon`.
"""

from typing import TYPE_CHECKING, Any

import numpy as np

from boomctl.arrays import Array
from boomctl.plotting.canvas import COLORS, new_figure, style

if TYPE_CHECKING:
    from boomctl.analysis.sigma import SigmaResult
    from boomctl.identification.files.frequency_response import MeasuredFrequencyResponse

_LINES = {"finite": "--", "discrete": ":", "exact": "-"}


def draw_figure_3(
    curves: "dict[str, SigmaResult]",
    measured_hz: Array,
    deviation: dict[str, Array],
    measured: "MeasuredFrequencyResponse | None" = None,
) -> Any:
    """Draw the singular values from platform actuators to tips, line styles as in Anthonis & Ramon (2003), Fig. 3."""
    with style():
        figure = new_figure(7.4, 6.6)
        ax, below = figure.subplots(2, 1, sharex=True, height_ratios=(2.4, 1.0))
        for i, (name, curve) in enumerate(reversed(curves.items())):
            linestyle = next(value for key, value in _LINES.items() if name.startswith(key))
            curve.plot(ax, frequency_unit="Hz", label=name, linestyle=linestyle, color=COLORS[(5, 1, 0)[i]])
        for k, freq in enumerate(measured_hz):
            label = None if k else "measured frequency"
            ax.axvline(freq, color="#777777", linewidth=0.8, dashes=(2, 2), label=label)
        if measured is not None:
            measured.plot(ax, color=COLORS[2])
        ax.set_xlim(0.1, 10.0)
        ax.set_ylim(1e-3, 5e3)
        ax.set_ylabel("singular values, platform actuators to tips [m/m]")
        ax.set_xlabel("")
        ax.legend(loc="lower left")
        freq_hz = curves["exact beam"].omega / (2 * np.pi)
        for name, largest in deviation.items():
            linestyle, color = ("--", COLORS[0]) if name.startswith("finite") else (":", COLORS[1])
            below.loglog(freq_hz, np.maximum(100.0 * largest, 1e-6), linestyle, color=color)
        below.set(ylim=(1e-3, 1e3), ylabel="off the exact\nbeam by [%]", xlabel="frequency [Hz]")
    return figure


def draw_convergence(convergence: "dict[str, dict[str, Array]]") -> Any:
    """Draw the relative error of the first five eigenfrequencies over the mesh, one panel a method."""
    with style():
        figure = new_figure(9.0, 6.0)
        axes = figure.subplots(2, 3, sharey=True).ravel()
        for ax, (name, result) in zip(axes, convergence.items(), strict=False):
            error, orders = result["relative_error"], result.get("order")
            sizes = result["elements"] if orders is None else orders
            for k, values in enumerate(error.T):
                ax.loglog(sizes, np.maximum(values, 1e-16), ".-", label=f"eigenfrequency {k + 1}", linewidth=1.0)
            ax.set_title(name.replace(", nodes", ",\nnodes").replace(", geom", ",\ngeom").replace(", Herm", ",\nHerm"))
            if orders is None:
                ax.set_xlabel("number of elements")
                _slope(ax, sizes, error, 2 if "geometrical" in name else 4)
            else:
                ax.set_xlabel("polynomial order, 4 elements")
                ax.set_xticks(sizes[::2], [str(n) for n in sizes[::2]])
                ax.minorticks_off()
        for ax in (axes[0], axes[3]):
            ax.set_ylabel("relative error of damped frequency")
        axes[5].axis("off")
        axes[5].legend(*axes[0].get_legend_handles_labels(), loc="center")
    return figure


def _slope(ax: Any, sizes: Array, error: Array, order: int) -> None:
    """Draw a line of the expected order next to the error of the second frequency."""
    n = np.array([sizes[1], sizes[len(sizes) * 2 // 3]], dtype=float)
    start = 8.0 * error[1].max()
    ax.loglog(n, start * (n / n[0]) ** -order, "k--", linewidth=0.8)
    ax.annotate(f"order {order}", (n[1], start * (n[1] / n[0]) ** -order), fontsize=8, ha="left", va="bottom")


def draw_friction(study: Any, frequency_range_hz: tuple[float, float] = (2.5, 3.5)) -> Any:
    """Draw the singular values of jolt and yaw, linear and with friction, and the lower one over the linear one."""
    freq_hz = study.omega / (2.0 * np.pi)
    with style():
        figure = new_figure(7.4, 7.6)
        top, below = figure.subplots(2, 1, sharex=True, height_ratios=(1.7, 1.0))
        for ax in (top, below):
            ax.axvspan(*frequency_range_hz, color="#999999", alpha=0.15, linewidth=0)
        top.loglog(freq_hz, study.yaw, color="#999999", linewidth=1.0, label="yaw (not touched by cradle friction)")
        top.loglog(freq_hz, study.jolt, color="#000000", label="jolt, linear (Table 2)")
        top.loglog(freq_hz, study.stuck, "--", color="#000000", linewidth=1.0, label="jolt, cradle stuck to platform")
        below.axhline(1.0, color="#000000", linewidth=1.4)
        below.loglog(freq_hz, study.ratio(study.omega, study.stuck), "--", color="#000000", linewidth=1.0)
        for color, reading in zip(COLORS, study.readings, strict=False):
            _reading(top, below, study, reading, color)
        top.set_ylim(0.05, 100.0)
        top.set_ylabel("singular values,\nplatform actuators to tips [m/m]")
        top.set_title(f"Platform moved by {1e3 * study.amplitude:g} mm; lines with friction: describing function")
        below.set_ylim(0.4, 8.0)
        below.set_yticks([0.5, 1.0, 2.0, 4.0], ["0.5", "1", "2", "4"])
        below.set(ylabel="lower singular value\nover the linear one", xlabel="frequency [Hz]")
        middle = np.sqrt(frequency_range_hz[0] * frequency_range_hz[1])
        top.annotate("measured below\ncomputed here", (middle, 0.055), ha="center", fontsize=7)
        _ticks(below, freq_hz)
        look = {"color": "#444444", "markersize": 3.2, "fillstyle": "none"}
        top.plot([], [], "o", label="stick-slip simulated, stepped sine", **look)
        figure.legend(*top.get_legend_handles_labels(), loc="outside lower center", ncols=2)
    return figure


def _reading(top: Any, below: Any, study: Any, reading: Any, color: str) -> None:
    """Draw one reading: the describing function as a line, the simulated sines as circles."""
    balance, stepped = reading.balance, reading.stepped
    name = f"jolt, {reading.force:.2g} N friction {reading.name}"
    top.plot(balance.omega / (2 * np.pi), balance.gain, color=color, linewidth=1.2, label=name)
    below.plot(balance.omega / (2 * np.pi), study.ratio(balance.omega, balance.gain), color=color, linewidth=1.2)
    look: dict[str, Any] = {"color": color, "markersize": 3.2, "fillstyle": "none"}
    top.plot(stepped.omega / (2 * np.pi), stepped.gain, "o", **look)
    below.plot(stepped.omega / (2 * np.pi), study.ratio(stepped.omega, stepped.gain), "o", **look)


def _ticks(ax: Any, freq_hz: Any) -> None:
    low, high = freq_hz[0] / 1.001, freq_hz[-1] * 1.001
    ticks = [f for f in (0.4, 0.6, 1, 1.5, 2, 2.5, 3, 3.5, 4, 5, 6) if low <= f <= high]
    ax.set_xlim(freq_hz[0], freq_hz[-1])
    ax.set_xticks(ticks, [f"{f:g}" for f in ticks])
    ax.minorticks_off()
