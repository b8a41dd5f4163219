"""Plots over time: a simulated loop with its controls, stops and friction, and a forced response."""

from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from boomctl.arrays import Array
from boomctl.checks import names
from boomctl.plotting.canvas import COLORS, labeled, legend, line_look, over_time, panels

if TYPE_CHECKING:
    from boomctl.simulation.forced_response import ForcedResponse
    from boomctl.simulation.result import LoopResult

# suffixes of outputs with a separate panel, since their scales differ from those of others
_SEPARATE_PANELS = {"_acceleration": "accelerations", "_moment": "moments", "_strain": "strains"}
_HEADROOM = 1.6  # Upper limit of the axis for requested controls, relative to the largest control.


def plot_loop(
    result: "LoopResult", ax: Any = None, *, outputs: str | Sequence[str] | None = None, **style: Any
) -> Array:
    """Draw a simulated loop, one panel a kind of signal and unit.

    Parameters
    ----------
    result : LoopResult
    ax : sequence of matplotlib Axes, or a figure, optional
        One for the outputs of each unit, the strokes, the controls and the friction, those that there are; accelerations,
        moments and strains are drawn separately if units are unknown.  Axes to draw on. If None, a new figure is created.
    outputs : str or sequence of str, optional
        By default the first six that are not strokes.
    **style
        Line properties, passed to `matplotlib.axes.Axes.plot`; ``label`` is prefixed to the labels.

    Returns
    -------
    (n,) ndarray of matplotlib Axes

    Raises
    ------
    TypeError, ValueError
        If an output is unknown, the axes or their number do not match, or a property of a line is invalid.
    """
    groups = [
        *_panels("outputs", _chosen(result.outputs, outputs, without=result._strokes), result.units),
        *_panels("strokes", result._strokes, result.units),
        *_panels("controls", result.controls, result.units),
    ]
    if result.friction is not None:
        groups.append(("friction", "friction [N]", {result.friction.force_input: result.friction.force}))
    if not groups:
        raise ValueError("outputs: expected at least one name, got none, and there is nothing else to draw")
    return _draw_groups(result, groups, ax, style)


def _draw_groups(result: Any, groups: list[tuple[str, str, dict[str, Any]]], ax: Any, style: dict[str, Any]) -> Array:
    """Draw groups of signals, of a kind and with a label, one panel for each group."""
    labels = [label for _, label, _ in groups]
    with panels(ax, labels, (7.4, 1.2 + 1.7 * len(groups))) as axes:
        for axis, (kind, _, signals) in zip(axes, groups, strict=True):
            _draw(axis, result, kind, signals, style)
            legend(axis, "right")
        over_time(axes, labels)
    return axes


def _chosen(
    there: dict[str, Any], requested: str | Sequence[str] | None, without: Iterable[str] = ()
) -> dict[str, Any]:
    """Return the outputs to draw: the requested ones, or the first."""
    if requested is not None:
        return {name: there[name] for name in names("output", requested, tuple(there))}
    return {name: there[name] for name in [name for name in there if name not in without][: len(COLORS)]}


def _panels(kind: str, signals: dict[str, Any], units: Mapping[str, str]) -> list[tuple[str, str, dict[str, Any]]]:
    """Return kind, label and signals of each panel: one for each unit, or for each kind of signal without a unit."""
    result: dict[str, dict[str, Any]] = {}
    for name, values in signals.items():
        whole = name.removesuffix("_sym").removesuffix("_anti")
        group = next(
            (panel for end, panel in _SEPARATE_PANELS.items() if kind == "outputs" and whole.endswith(end)), kind
        )
        result.setdefault(labeled(group, units.get(name, "")), {})[name] = values
    return [(kind, label, item) for label, item in result.items()]


def _draw(ax: Any, result: Any, kind: str, signals: dict[str, Any], style: dict[str, Any]) -> None:
    """Draw signals; with controls also the requested ones, with strokes also the contacts with stops."""
    low, high = ax.get_ylim() if ax.has_data() else (0.0, 0.0)
    for k, (name, values) in enumerate(signals.items()):
        look = line_look(style, color=COLORS[k % len(COLORS)], linewidth=1.0, label=name)
        if kind == "controls" and (result.saturation_fraction[name] or result.rate_limit_fraction[name]):
            behind = look | {"linewidth": 0.8, "alpha": 0.35, "label": f"{look['label']}, requested"}
            ax.plot(result.time, result.commanded[name], **behind)
        ax.plot(result.time, values, **look)
        hits = [hit.time for hit in result.stop_contacts if hit.output == name] if kind == "strokes" else []
        if hits:
            label = f"{look['label']}: {len(hits)} {'hit' if len(hits) == 1 else 'hits'}"
            at = np.interp(hits, result.time, values)
            ax.plot(hits, at, "v", color=look["color"], markersize=4, label=label)
    if kind == "controls":  # Requested controls may be much larger.
        size = _HEADROOM * max((float(np.abs(values).max()) for values in signals.values()), default=0.0) or 1.0
        ax.set_ylim(min(low, -size), max(high, size))


def plot_forced_response(
    result: "ForcedResponse", ax: Any = None, *, outputs: str | Sequence[str] | None = None, **style: Any
) -> Array:
    """Draw inputs and outputs of a plant over time.

    Parameters
    ----------
    result : ForcedResponse
    ax : sequence of matplotlib Axes, or a figure, optional
        Axes for the inputs, and for the outputs of each unit. If None, a new figure is created.
    outputs : str or sequence of str, optional
        By default the first six.
    **style
        Line properties, passed to `matplotlib.axes.Axes.plot`; ``label`` is prefixed to the labels.

    Returns
    -------
    (n,) ndarray of matplotlib Axes
    """
    groups = [
        *_panels("inputs", result.inputs, result.units),
        *_panels("outputs", _chosen(result.outputs, outputs), result.units),
    ]
    return _draw_groups(result, groups, ax, style)
