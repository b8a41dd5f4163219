"""Pictures of sweeps: all points, and a line through the medians for each word of a parameter."""

from typing import TYPE_CHECKING, Any

import numpy as np

from boomctl.checks import known
from boomctl.plotting.canvas import COLOURS, legend, line_look, panels

if TYPE_CHECKING:
    from boomctl.studies.sweeps.result import SweepResult


def plot_sweep(
    result: "SweepResult", ax: Any = None, *, column: str | None = None, against: str | None = None, **drawn: Any
) -> Any:
    """Draw a number over a swept parameter; return the axes."""
    numbers = [name for name in result.columns if np.array([_number(row, name) for row in result.table]).any()]
    axes = [name for name in result.swept if all(_number(point, name) for point in result.points)]
    for what, found in (("column", numbers), ("swept parameter", axes)):
        if not found:
            raise ValueError(f"{what}: expected one that is a number, there is none")
    shown = numbers[0] if column is None else known("column that is a number", column, numbers)
    over = axes[0] if against is None else known("swept parameter that is a number", against, axes)
    words = next((name for name in result.swept if name not in axes and name != over), None)
    rows = [row for row in result.table if _number(row, shown)]
    groups = list(dict.fromkeys(row[words] for row in rows)) if words else [None]
    with panels(ax, ["numbers"], (7.0, 4.2)) as (drawn_on,):
        for k, word in enumerate(groups):
            own = [row for row in rows if words is None or row[words] == word]
            x, y = np.array([row[over] for row in own], float), np.array([row[shown] for row in own], float)
            places = np.unique(x)
            name = {} if words is None else {"label": str(word)}
            look = line_look(drawn, color=COLOURS[k % len(COLOURS)], **name)
            (line,) = drawn_on.plot(places, [np.median(y[x == place]) for place in places], **look)
            drawn_on.plot(x, y, ".", color=line.get_color(), alpha=0.5)
        drawn_on.set_xlabel(_with_unit(result, over))
        drawn_on.set_ylabel(_with_unit(result, shown))
        legend(drawn_on, title=words)
    return drawn_on


def _number(row: Any, name: str) -> bool:
    return isinstance(row[name], (int, float)) and not isinstance(row[name], bool)


def _with_unit(result: "SweepResult", name: str) -> str:
    unit = result.units.get(name)
    return f"{name} [{unit}]" if unit else name
