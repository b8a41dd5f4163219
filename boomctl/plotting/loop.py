"""Pictures over time: a simulated loop with its controls, stops and friction, and a forced response."""

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from boomctl.arrays import Array
from boomctl.checks import names
from boomctl.plotting.canvas import COLOURS, beside, legend, line_look, panels

if TYPE_CHECKING:
    from boomctl.simulation.forced_response import ForcedResponse
    from boomctl.simulation.result import LoopResult

# outputs by how their names end, and the panel that they have to themselves: one with the others would show only some
_APART = {"_acceleration": "accelerations", "_moment": "moments", "_strain": "strains"}
_ABOVE = 1.6  # of the largest control, shown of what was asked for (a choice)


def plot_loop(
    result: "LoopResult", ax: Any = None, *, outputs: str | Sequence[str] | None = None, **style: Any
) -> Array:
    """Draw a simulated loop, one panel a kind of signal.

    Parameters
    ----------
    result : LoopResult
    ax : sequence of matplotlib Axes, or a figure, optional
        One for the outputs, those of accelerations, moments and strains, the strokes, the controls and the friction,
        those that there are; by default a new figure of pyplot.
    outputs : str or sequence of str, optional
        By default the first six that are not strokes.
    **style
        Of the curves, as matplotlib's lines take it; a ``label`` stands before their names.

    Returns
    -------
    (n,) ndarray of matplotlib Axes

    Raises
    ------
    TypeError, ValueError
        Unknown outputs; other axes, or not so many; no property of a line.
    """
    groups: list[tuple[str, dict[str, Any]]] = [
        *_outputs(result.outputs, outputs, without=result.strokes),
        ("strokes", result.strokes),
        ("controls", result.controls),
    ]
    if result.friction is not None:
        groups.append(("friction [N]", {result.friction.input: result.friction.force}))
    shown = [(title, signals) for title, signals in groups if signals]
    if not shown:
        raise ValueError("outputs: expected at least one name, got none, and there is nothing else to draw")
    with panels(ax, [title for title, _ in shown], (7.4, 1.2 + 1.7 * len(shown))) as axes:
        for each, (title, signals) in zip(axes, shown, strict=True):
            _draw(each, result, title, signals, style)
        axes[-1].set_xlabel("time [s]")
        axes[0].figure.align_ylabels(list(axes))
    return axes


def _outputs(
    there: dict[str, Any], asked: str | Sequence[str] | None, without: Iterable[str] = ()
) -> list[tuple[str, dict[str, Any]]]:
    """Return the outputs to draw, those asked for or the first, in panels of about one size."""
    if asked is not None:
        chosen = list(names("output", asked, tuple(there)))
    else:
        chosen = [name for name in there if name not in without][: len(COLOURS)]
    found: dict[str, dict[str, Any]] = {title: {} for title in ("outputs", *_APART.values())}
    for name in chosen:
        title = next((panel for end, panel in _APART.items() if name.endswith(end)), "outputs")
        found[title][name] = there[name]
    return list(found.items())


def _draw(ax: Any, result: "LoopResult", title: str, signals: dict[str, Any], style: dict[str, Any]) -> None:
    """Draw some signals; behind controls what was asked for, on strokes where a stop was met."""
    low, high = ax.get_ylim() if ax.has_data() else (0.0, 0.0)
    for k, (name, values) in enumerate(signals.items()):
        look = line_look(style, color=COLOURS[k % len(COLOURS)], linewidth=1.0, label=name)
        if title == "controls" and (result.saturation_share[name] or result.rate_share[name]):
            behind = look | {"linewidth": 0.8, "alpha": 0.35, "label": f"{look['label']}, asked for"}
            ax.plot(result.time, result.asked[name], **behind)
        ax.plot(result.time, values, **look)
        hits = [hit.time for hit in result.stops if hit.output == name] if title == "strokes" else []
        if hits:
            label = f"{look['label']}: {len(hits)} {'hit' if len(hits) == 1 else 'hits'}"
            at = np.interp(hits, result.time, values)
            ax.plot(hits, at, "v", color=look["color"], markersize=4, label=label)
    if title == "controls":  # what was asked for may be far beyond what was given
        size = _ABOVE * max((float(np.abs(values).max()) for values in signals.values()), default=0.0) or 1.0
        ax.set_ylim(min(low, -size), max(high, size))
    _finish(ax, title)


def _finish(ax: Any, title: str) -> None:
    ax.set_xmargin(0.0)
    ax.set_ylabel(title)
    legend(ax, **({"loc": "upper left", "bbox_to_anchor": (1.0, 1.0)} if beside(ax) else {}))


def plot_forced_response(
    result: "ForcedResponse", ax: Any = None, *, outputs: str | Sequence[str] | None = None, **style: Any
) -> Array:
    """Draw what drives a plant, and its outputs, over time.

    Parameters
    ----------
    result : ForcedResponse
    ax : sequence of matplotlib Axes, or a figure, optional
        One for the inputs, one for the outputs, and those of accelerations, moments and strains among them; by default a
        new figure of pyplot.
    outputs : str or sequence of str, optional
        By default the first six.
    **style
        Of the curves, as matplotlib's lines take it; a ``label`` stands before their names.

    Returns
    -------
    (n,) ndarray of matplotlib Axes
    """
    groups = [("inputs", result.inputs), *_outputs(result.outputs, outputs)]
    shown = [(title, signals) for title, signals in groups if signals]
    with panels(ax, [title for title, _ in shown], (7.4, 1.2 + 1.7 * len(shown))) as axes:
        for each, (title, signals) in zip(axes, shown, strict=True):
            for k, (name, values) in enumerate(signals.items()):
                look = line_look(style, color=COLOURS[k % len(COLOURS)], linewidth=1.0, label=name)
                each.plot(result.time, values, **look)
            _finish(each, title)
        axes[-1].set_xlabel("time [s]")
        axes[0].figure.align_ylabels(list(axes))
    return axes
