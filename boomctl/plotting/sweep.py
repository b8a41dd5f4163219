"""Plots of sweeps: all points over one parameter, a color and a line of medians for each value of another one."""

from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib import colormaps

from boomctl.checks import known
from boomctl.plotting.canvas import COLORS, labeled, legend, line_look, panels

if TYPE_CHECKING:
    from boomctl.studies.sweeps.result import SweepResult

_DRAWN = "seed"  # Parameter of random draws, which has no color of its own.


def plot_sweep(
    result: "SweepResult", ax: Any = None, *, column: str | None = None, against: str | None = None, **drawn: Any
) -> Any:
    """Draw a number over a swept parameter; return the axes."""
    numbers = [name for name in result.columns if np.array([_number(row, name) for row in result.table]).any()]
    axes = [name for name in result.swept if all(_number(point, name) for point in result.points)]
    for what, available in (("column", numbers), ("swept parameter", axes)):
        if not available:
            raise ValueError(f"{what}: expected one that is a number, there is none")
    shown = numbers[0] if column is None else known("column that is a number", column, numbers)
    over = axes[0] if against is None else known("swept parameter that is a number", against, axes)
    other = [name for name in result.swept if name not in axes and name != over]
    other += [name for name in axes if name not in (over, _DRAWN)]
    second = other[0] if other else None
    rows = [row for row in result.table if _number(row, shown)]
    groups: list[Any] = list(dict.fromkeys(row[second] for row in rows)) if second else [None]
    if second in axes:
        groups.sort()
    colors = COLORS if len(groups) <= len(COLORS) else colormaps["viridis"](np.linspace(0.0, 0.9, len(groups)))
    named = {groups[k] for k in np.linspace(0, len(groups) - 1, min(len(groups), len(COLORS))).round().astype(int)}
    medians = False
    with panels(ax, ["numbers"], (7.0, 4.2)) as (drawn_on,):
        for color, value in zip(colors, groups, strict=False):
            own = [row for row in rows if second is None or row[second] == value]
            x, y = np.array([row[over] for row in own], float), np.array([row[shown] for row in own], float)
            abscissae = np.unique(x)
            said = f"{value:.4g}" if second in axes else str(value)
            name = {"label": said} if second is not None and value in named else {}
            look = line_look(drawn, color=color, **name)
            (line,) = drawn_on.plot(abscissae, [np.median(y[x == abscissa]) for abscissa in abscissae], **look)
            drawn_on.plot(x, y, ".", color=line.get_color(), alpha=0.5)
            medians |= len(abscissae) < len(x)
        if medians:
            rest = " and ".join(name for name in result.swept if name not in (over, second)) or over
            drawn_on.set_title(f"dots: all points; line: their median over {rest}", fontsize="medium")
        drawn_on.set(xlabel=_with_unit(result, over), ylabel=_with_unit(result, shown))
        legend(drawn_on, title=None if second is None else _with_unit(result, second))
    return drawn_on


def _number(row: Any, name: str) -> bool:
    return isinstance(row[name], (int, float)) and not isinstance(row[name], bool)


def _with_unit(result: "SweepResult", name: str) -> str:
    return labeled(name, result.units.get(name, ""))
