"""Pictures of Coulomb friction: singular values of a boom whose cradle sticks and slips."""

from typing import TYPE_CHECKING, Any

import numpy as np

from boomctl.plotting.canvas import COLOURS, new_figure, style

if TYPE_CHECKING:
    from boomctl.papers.anthonis_ramon.friction import BoomFriction, FrictionReading


def draw_friction(study: "BoomFriction", band_hz: tuple[float, float] = (2.5, 3.5)) -> Any:
    """Draw the singular values of jolt and yaw, linear and with friction, and the lower one over the linear one."""
    freq_hz = study.omega / (2.0 * np.pi)
    with style():
        figure = new_figure(7.4, 7.6)
        top, below = figure.subplots(2, 1, sharex=True, height_ratios=(1.7, 1.0))
        for ax in (top, below):
            ax.axvspan(*band_hz, color="#999999", alpha=0.15, linewidth=0)
        top.loglog(freq_hz, study.yaw, color="#999999", linewidth=1.0, label="yaw (not touched by cradle friction)")
        top.loglog(freq_hz, study.jolt, color="#000000", label="jolt, linear (Table 2)")
        top.loglog(freq_hz, study.stuck, "--", color="#000000", linewidth=1.0, label="jolt, cradle stuck to platform")
        below.axhline(1.0, color="#000000", linewidth=1.4)
        below.loglog(freq_hz, study.ratio(study.omega, study.stuck), "--", color="#000000", linewidth=1.0)
        for color, reading in zip(COLOURS, study.readings, strict=False):
            _reading(top, below, study, reading, color)
        top.set_ylim(0.05, 100.0)
        top.set_ylabel("singular values,\nplatform actuators to tips [m/m]")
        top.set_title(f"Platform moved by {1e3 * study.amplitude:g} mm; lines with friction: describing function")
        below.set_ylim(0.4, 8.0)
        below.set_yticks([0.5, 1.0, 2.0, 4.0], ["0.5", "1", "2", "4"])
        below.set_ylabel("lower singular value\nover the linear one")
        below.set_xlabel("frequency [Hz]")
        top.annotate(
            "measured below\ncomputed here", (np.sqrt(band_hz[0] * band_hz[1]), 0.055), ha="center", fontsize=7
        )
        _ticks(below, freq_hz)
        top.plot(
            [], [], "o", color="#444444", markersize=3.2, fillstyle="none", label="stick-slip simulated, stepped sine"
        )
        figure.legend(*top.get_legend_handles_labels(), loc="outside lower center", ncols=2)
    return figure


def _reading(top: Any, below: Any, study: "BoomFriction", reading: "FrictionReading", color: str) -> None:
    """Draw one reading: the describing function as a line, the simulated sines as circles."""
    balance, swept = reading.balance, reading.swept
    name = f"jolt, {reading.force:.2g} N friction {reading.name}"
    top.plot(balance.omega / (2 * np.pi), balance.gain, color=color, linewidth=1.2, label=name)
    below.plot(balance.omega / (2 * np.pi), study.ratio(balance.omega, balance.gain), color=color, linewidth=1.2)
    look: dict[str, Any] = {"color": color, "markersize": 3.2, "fillstyle": "none"}
    top.plot(swept.omega / (2 * np.pi), swept.gain, "o", **look)
    below.plot(swept.omega / (2 * np.pi), study.ratio(swept.omega, swept.gain), "o", **look)


def _ticks(ax: Any, freq_hz: Any) -> None:
    ticks = [
        f for f in (0.4, 0.6, 1, 1.5, 2, 2.5, 3, 3.5, 4, 5, 6) if freq_hz[0] <= f * 1.001 and f <= freq_hz[-1] * 1.001
    ]
    ax.set_xlim(freq_hz[0], freq_hz[-1])
    ax.set_xticks(ticks, [f"{f:g}" for f in ticks])
    ax.minorticks_off()
