"""A simulated loop over time: outputs, controls asked for and applied, end stops, friction."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from boomctl.checks import names
from boomctl.plotting.canvas import COLOURS, new_figure, style

if TYPE_CHECKING:
    from boomctl.simulation.result import LoopResult

_MOST = 6  # outputs that are drawn unless some are named: as many as there are colours


def draw_loop(result: "LoopResult", outputs: str | Sequence[str] | None = None) -> Any:
    """Draw a simulated loop, one panel a kind of signal.

    Parameters
    ----------
    result : LoopResult
    outputs : str or sequence of str, optional
        By default the first six that are not strokes.

    Returns
    -------
    matplotlib Figure
    """
    plain = [name for name in result.outputs if name not in result.strokes][:_MOST]
    chosen = list(names("output", outputs, tuple(result.outputs))) if outputs is not None else plain
    panels: list[tuple[str, dict[str, Any]]] = [
        ("outputs", {name: result.outputs[name] for name in chosen}),
        ("strokes", result.strokes),
        ("controls", result.controls),
    ]
    if result.friction is not None:
        panels.append(("friction [N]", {result.friction.input: result.friction.force}))
    shown = [(title, signals) for title, signals in panels if signals]
    with style():
        figure = new_figure(7.4, 1.2 + 1.7 * len(shown))
        axes = np.atleast_1d(figure.subplots(len(shown), 1, sharex=True))
        for ax, (title, signals) in zip(axes, shown, strict=True):
            _lines(ax, result, title, signals)
        axes[-1].set_xlim(result.time[0], result.time[-1])
        axes[-1].set_xlabel("time [s]")
    return figure


def _lines(ax: Any, result: "LoopResult", title: str, signals: dict[str, Any]) -> None:
    """Draw some signals; behind controls what was asked for, on strokes where a stop was met."""
    for k, (name, values) in enumerate(signals.items()):
        color = COLOURS[k % len(COLOURS)]
        if title == "controls" and (result.saturation_share[name] or result.rate_share[name]):
            ax.plot(result.time, result.asked[name], color=color, linewidth=0.8, alpha=0.35, label=f"{name}, asked for")
        ax.plot(result.time, values, color=color, linewidth=1.0, label=name)
        if title == "strokes":
            _stops(ax, result, name, values, color)
    if title == "controls":
        size = max((float(np.abs(values).max()) for values in signals.values()), default=0.0)
        ax.set_ylim(-1.6 * size or -1.0, 1.6 * size or 1.0)
    ax.set_ylabel(title)
    ax.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0))


def _stops(ax: Any, result: "LoopResult", name: str, values: Any, color: str) -> None:
    hits = [hit for hit in result.stops if hit.output == name]
    if hits:
        at = np.array([hit.time for hit in hits])
        label = f"{name}: {len(hits)} hits"
        ax.plot(at, np.interp(at, result.time, values), "v", color=color, markersize=4, label=label)
