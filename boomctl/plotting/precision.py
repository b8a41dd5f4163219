"""Plots of run time against error: all methods, and their common front."""

from collections.abc import Iterable, Mapping, Sequence
from itertools import cycle
from math import isfinite
from typing import Any

from matplotlib.lines import Line2D

from boomctl.plotting.canvas import COLORS, divided, few_labels, panels

_MARKERS = ("o", "s", "^", "D", "v", "P", "X", "<", ">", "p", "h")  # Markers of the methods of one color.
_FLOOR = 1e-17  # ordinate of a zero error: below double precision
_USELESS = 10.0  # relative error above which a result is not drawn
_CALLS = {"cold": "cold: first call in a new process", "hot": "hot: later calls"}


def plot_precision(diagram: Any, ax: Any = None) -> Any:
    """Draw run time over error, cold and hot, on two axes; return them.

    Solid lines are boomctl, dashed lines other programs; the gray line is the front of all.
    """
    divide = divided(1, 2, sharex=True, sharey=True)
    # One line of the legend for four methods.
    with panels(ax, list(_CALLS), (10.5, 4.8 + 0.18 * (len(diagram.methods) // 4)), divide) as axes:
        looks = _looks(diagram.methods)
        for calls, drawn_on in zip(_CALLS, axes, strict=True):
            for name, points in diagram.methods.items():
                coordinates = _coordinates(points, calls)
                if coordinates:
                    drawn_on.plot(*zip(*coordinates, strict=True), label=name, **looks[name])
            drawn_on.set(xscale="log", yscale="log")
            _draw_front(drawn_on, _coordinates(diagram.front(calls), calls))
            drawn_on.set(title=_CALLS[calls], xlabel="relative error")
        axes[0].set_ylabel("run time of a call [s]")
        for drawn_on in axes:
            few_labels(drawn_on)
        if axes[0].figure.get_layout_engine() is not None:
            handles = [Line2D([], [], label=name, **look) for name, look in looks.items()]
            handles.append(Line2D([], [], color="#bbbbbb", linewidth=5.0, label="front of all"))
            axes[0].figure.legend(handles=handles, loc="outside lower center", ncols=4)
    return axes


def _looks(methods: Mapping[str, Sequence[Any]]) -> dict[str, dict[str, Any]]:
    marks = zip(methods.items(), cycle(COLORS), cycle(_MARKERS))
    return {
        name: {"color": color, "marker": marker, "linestyle": "-" if points[0].ours else "--"}
        for (name, points), color, marker in marks
    }


def _coordinates(points: Iterable[Any], calls: str) -> list[tuple[float, float]]:
    """Return error and run time of the points that have both, in their order."""
    timed = ((max(point.error, _FLOOR), point.elapsed(calls)) for point in points if isfinite(point.error))
    return [(error, elapsed) for error, elapsed in timed if elapsed is not None and error < _USELESS]


def _draw_front(ax: Any, coordinates: list[tuple[float, float]]) -> None:
    """Draw the front as steps behind the curves: the least run time over error."""
    if not coordinates:
        return
    errors, seconds = zip(*sorted(coordinates), strict=True)
    right = max(ax.get_xlim()[1], errors[-1])
    look = {"color": "#bbbbbb", "linewidth": 5.0, "zorder": 0, "solid_capstyle": "butt"}
    ax.step([*errors, right], [*seconds, seconds[-1]], where="post", **look)
