"""Nyquist curves of loops around the critical point, with the margins marked."""

from typing import TYPE_CHECKING, Any

import numpy as np

from boomctl.arrays import Array
from boomctl.plotting.canvas import COLORS, in_rows, legend, line_look, panels

if TYPE_CHECKING:
    from boomctl.analysis.margins import DiskMargin, LoopMargin, Margins

# smallest (unit circle and critical point) and largest half-width of the plotted square
NARROW, WIDE = 1.7, 4.0
MARGIN = 1.15  # half-width of the plotted square over the distance of the farthest margin
_HALF_PLANE_GAIN = 1e3  # gain of a disk margin above which the disk is drawn as a half-plane
SHADE = "#f3d9c9"


def plot_margins(result: "Margins", ax: Any = None, **style: Any) -> Array:
    """Draw the Nyquist curve of each loop, opened at one signal with all others closed, and its margins.

    Parameters
    ----------
    result : Margins
    ax : sequence of matplotlib Axes, or a figure, optional
        One axes per loop. If None, a new figure is created.
    **style
        Line properties, passed to `matplotlib.axes.Axes.plot`.

    Returns
    -------
    (n,) ndarray of matplotlib Axes
    """
    columns, rows, divide = in_rows(len(result.loops))
    names = [f"{loop.location} {loop.signal}" for loop in result.loops]
    with panels(ax, names, (3.4 * columns, 4.3 * rows), divide) as axes:
        for item, loop in zip(axes, result.loops, strict=True):
            _draw(item, loop, style)
    return axes


def plot_loop_margin(result: "LoopMargin", ax: Any = None, **style: Any) -> Any:
    """Draw the Nyquist curve of a loop around the critical point, and its margins.

    The loop ``u = K y`` has the response ``L``, and ``-L`` must not meet -1.  Shaded is the disk that ``-L`` does not enter
    by its disk margin.

    Parameters
    ----------
    result : LoopMargin
    ax : matplotlib Axes or figure, optional
        Axes to draw on. If None, a new figure is created.
    **style
        Line properties, passed to `matplotlib.axes.Axes.plot`.

    Returns
    -------
    matplotlib Axes
    """
    with panels(ax, ("Nyquist curve",), (4.4, 5.4)) as (axes,):
        _draw(axes, result, style)
    return axes


def draw_critical(ax: Any, disk: "DiskMargin | None", *, outlined: Any = None) -> None:
    """Draw the unit circle, the critical point, and the disk that a loop does not enter: shaded, or its edge in a color."""
    angle = np.linspace(0.0, 2.0 * np.pi, 181)
    across, up = np.cos(angle), np.sin(angle)
    if disk is not None and disk.gain_margin < _HALF_PLANE_GAIN:
        gain = disk.gain_margin
        middle, radius = -0.5 * (gain + 1.0 / gain), 0.5 * (gain - 1.0 / gain)
        if outlined is None:
            ax.fill(middle + radius * across, radius * up, color=SHADE, zorder=0)
        else:
            ax.plot(middle + radius * across, radius * up, color=outlined, linewidth=0.8, linestyle="--")
    elif disk is not None and outlined is None:
        ax.axvspan(-WIDE * 10.0, 0.0, color=SHADE, zorder=0)
    ax.plot(across, up, color="0.6", linewidth=0.8, linestyle=":")
    ax.plot([-1.0], [0.0], "+", color="black", markersize=9, markeredgewidth=1.6)


def draw_curve(ax: Any, curve: Array, half: float, name: str, look: dict[str, Any]) -> None:
    """Draw a curve, its mirror image pale, in a square of a half-width; `name` is what is drawn."""
    ax.plot(curve.real, curve.imag, **look)
    ax.plot(curve.real, -curve.imag, **(look | {"alpha": 0.35, "linewidth": 0.8, "label": None}))
    frame(ax, half, name)


def frame(ax: Any, half: float, name: str) -> None:
    """Set the limits and labels of a square in the complex plane."""
    ax.set(xlim=(-half, half), ylim=(-half, half), aspect="equal", xlabel=f"Re({name})", ylabel=f"Im({name})")


def farthest(loop: "LoopMargin") -> float:
    """Return the half-width of the square that shows the gain margins of a loop."""
    far = [1.0, *(1.0 / factor for factor in loop.gain_margin if 0.0 < factor < np.inf)]
    return float(np.clip(MARGIN * max(far), NARROW, WIDE))


def _draw(ax: Any, loop: "LoopMargin", style: dict[str, Any]) -> None:
    omega, L = loop.loop_gain
    curve, disk = -L, loop.disk_margin
    look = line_look(style, color=COLORS[0], marker="." if len(L) == 1 else "none")  # a static loop is a point
    draw_critical(ax, disk)
    draw_curve(ax, curve, farthest(loop), "−L", look)
    for words, marked, marker, color in _marks(loop, omega, curve):
        look = {"marker": marker, "color": color, "markersize": 5, "markerfacecolor": "white", "linestyle": "none"}
        ax.plot(np.real(marked), np.imag(marked), label=words, **look)
    legend(ax, "above left", title=f"Opened at {loop.signal}", title_fontsize=8, fontsize=7, alignment="left")


def _marks(loop: "LoopMargin", omega: Array, curve: Array) -> list[tuple[str, list[complex], str, str]]:
    """Return the margins as text, and their points on the curve."""

    def points(at: float) -> list[complex]:
        return [complex(curve[np.argmin(np.abs(omega - at))])] if np.isfinite(at) else []

    def hz(at: float) -> str:
        return f" at {at / (2.0 * np.pi):.3g} Hz" if np.isfinite(at) else ""

    def text(name: str, sign: str, value: float, unit: str, at: float) -> str:
        return f"{name} {sign}{value:.3g}{unit}{hz(at)}" if np.isfinite(value) else f"{name}: any"

    gains, disk = [complex(-1.0 / factor) for factor in loop.gain_margin if 0.0 < factor < np.inf], loop.disk_margin
    high = f"{loop.gain_margin[1]:.3g}" if np.isfinite(loop.gain_margin[1]) else "∞"
    phase = text("phase", "±", loop.phase_margin_deg, "°", loop.phase_margin_omega)
    delay = text("delay", "", loop.delay_margin, " s", loop.delay_margin_omega)
    status = "" if disk.verified else ", not verified"
    return [
        (f"gain {loop.gain_margin[0]:.3g} to {high}", gains, "s", COLORS[1]),
        (phase, points(loop.phase_margin_omega), "o", COLORS[2]),
        (delay, points(loop.delay_margin_omega), "^", COLORS[3]),
        (f"disk {disk.alpha:.3g}{status}{hz(disk.omega)}", points(disk.omega), "D", COLORS[5]),
    ]
