"""Pictures of trade-offs: peaks, spray and force over what was asked for, and peaks over the force they take."""

from collections.abc import Sequence
from math import isfinite
from typing import TYPE_CHECKING, Any

from boomctl.plotting.canvas import COLOURS, line_look, panels

if TYPE_CHECKING:
    from boomctl.studies.suspension.trade_curves import TradeLine, TradePoint

_MIDDLE, _WORST, _GREY = COLOURS[0], COLOURS[1], COLOURS[5]
_ROOM = 1.15  # of the abscissa beyond the last point, for its name (a choice)
_OFF = 5.0  # points between a mark and its name (a choice)


def plot_trade_line(line: "TradeLine", ax: Any = None, **style: Any) -> Any:
    """Draw what was found along a curve; see `TradeLine.plot`."""
    return _over_asked(line, ax, style) if line.over == "asked" else _over_found(line, ax, style)


def _over_asked(line: "TradeLine", ax: Any, style: dict[str, Any]) -> Any:
    """Draw peaks, deposit CV and force over the values asked for, and the designs beside to the right of them."""
    points = (*line.points, *line.beside)
    names = ("peak, platform to tips", "deposit CV [%]", "largest force [N]")
    with panels(ax, names, (7.0, 6.4)) as axes:
        places, asked = list(range(len(points))), len(line.points)
        _curve(axes[0], places, [p.of(line.half).peak for p in points], asked, style, _MIDDLE, "o", "middle of the box")
        worst = [p.of(line.half).worst for p in points]
        _curve(axes[0], places, worst, asked, style, _WORST, "s", "worst over the box")
        _mark_unproved(axes[0], places, line, points)
        if line.static:
            axes[0].axhline(line.static, color=_GREY, linewidth=0.9, dashes=(4, 2), label="static gain")
        _curve(axes[1], places, [100.0 * p.deposit_cv for p in points], asked, style, _MIDDLE, "o", None)
        _curve(axes[2], places, [p.force for p in points], asked, style, _MIDDLE, "o", None)
        for each, name in zip(axes, names, strict=True):
            each.set_ylabel(name)
            if line.chosen is not None:
                for place, point in zip(places, points, strict=True):
                    if point.asked == line.chosen:
                        each.axvline(place, color="#dddddd", linewidth=7.0, zorder=0)
        axes[0].set_ylim(bottom=0.0)
        axes[1].set_ylim(bottom=0.0)
        axes[2].set_ylim(bottom=0.0)
        axes[0].legend(loc="best")
        ticks = [
            point.label if point.asked is not None else f"{point.label}\n{point.states} states" for point in points
        ]
        axes[-1].set_xticks(places, ticks)
        axes[-1].set_xlim(-0.5, len(points) - 0.5)
        axes[-1].set_xlabel(line.asked)
        axes[0].figure.align_ylabels(list(axes))
    return axes


def _curve(
    ax: Any,
    places: Sequence[float],
    values: Sequence[float | None],
    asked: int,
    style: dict[str, Any],
    colour: str,
    mark: str,
    label: str | None,
) -> None:
    """Draw a line through the points asked for, and marks alone for the designs beside."""
    y = [value if value is not None and isfinite(value) else float("nan") for value in values]
    named = {} if label is None else {"label": label}
    ax.plot(places[:asked], y[:asked], **line_look(style, color=colour, marker=mark, markersize=5.0, **named))
    ax.plot(places[asked:], y[asked:], color=colour, marker=mark, markersize=5.0, linestyle="none")


def _mark_unproved(ax: Any, places: Sequence[float], line: "TradeLine", points: "Sequence[TradePoint]") -> None:
    """Say where a worst peak is infinite, and where it was found but not proved."""
    for place, point in zip(places, points, strict=True):
        found = point.of(line.half)
        if found.worst_found is None:
            continue
        if not isfinite(found.worst_found):
            text = ax.annotate(
                "unstable\nin the box", (place, 1.0), xycoords=("data", "axes fraction"), ha="center", va="top"
            )
            text.set(color=_WORST, fontsize=8)
        elif found.worst_bound is None or not isfinite(found.worst_bound):
            ax.plot(place, found.worst_found, marker="s", markersize=5.0, color=_WORST, markerfacecolor="white")


def _over_found(line: "TradeLine", ax: Any, style: dict[str, Any]) -> Any:
    """Draw peaks over effort or force; a number beside a mark is what was asked for."""
    whose = "" if line.half is None else f" of the {line.half}"
    with panels(ax, ["peaks"], (7.0, 4.6)) as (drawn_on,):
        points, others = ([p for p in each if isfinite(line.place(p))] for each in (line.points, line.beside))
        x = [line.place(point) for point in points]
        for pick, colour, mark, label in (
            ("peak", _MIDDLE, "o", "middle of the box"),
            ("worst", _WORST, "s", "worst over the box"),
        ):
            y = [_finite(getattr(point.of(line.half), pick)) for point in points]
            drawn_on.plot(x, y, **line_look(style, color=colour, marker=mark, markersize=5.0, label=label))
            there = [(line.place(point), _finite(getattr(point.of(line.half), pick))) for point in others]
            if there:
                drawn_on.plot(*zip(*there, strict=True), color=colour, marker=mark, markersize=5.0, linestyle="none")
        for point in (*points, *others):
            _name(drawn_on, line, point)
        if line.static:
            drawn_on.axhline(line.static, color=_GREY, linewidth=0.9, dashes=(4, 2), label="static gain")
        drawn_on.set_ylim(bottom=0.0)
        right = max((line.place(point) for point in (*points, *others)), default=0.0)
        if right > 0.0:
            drawn_on.set_xlim(-0.02 * right, _ROOM * right)
        drawn_on.set_xlabel(line.abscissa)
        drawn_on.set_ylabel(f"peak{whose}, platform to tips")
        drawn_on.legend(loc="best")
    return drawn_on


def _name(ax: Any, line: "TradeLine", point: "TradePoint") -> None:
    """Write what a point is called above its highest mark, and join its marks."""
    found, x = point.of(line.half), line.place(point)
    heights = [y for y in (found.peak, found.worst) if y is not None and isfinite(y)]
    if not heights:
        return
    ax.plot([x, x], [min(heights), max(heights)], color=_GREY, linewidth=0.7, zorder=1)
    weight = "bold" if point.asked is not None and point.asked == line.chosen else "normal"
    ax.annotate(
        point.label, (x, max(heights)), (_OFF, _OFF), textcoords="offset points",
        fontsize=8, fontweight=weight,
    )  # fmt: skip


def _finite(value: float | None) -> float:
    return value if value is not None and isfinite(value) else float("nan")
