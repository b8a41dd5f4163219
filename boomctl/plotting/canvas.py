"""Axes and figures to draw on, and their style: axes of the user, figures of pyplot, or plain figures of a report.

Every function ``plot_*`` passes ``ax`` to :func:`panels`, the only function in the package that uses pyplot.
"""

import io
import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from difflib import get_close_matches
from pathlib import Path
from re import search
from tempfile import TemporaryDirectory
from threading import RLock
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.cbook import normalize_kwargs
from matplotlib.figure import Figure, FigureBase
from matplotlib.lines import Line2D
from matplotlib.ticker import LogFormatterSciNotation

from boomctl.arrays import Array
from boomctl.checks import shown
from boomctl.report import Picture

_LOOK = mpl.rc_params_from_file(Path(__file__).with_name("look.mplstyle"), use_default_template=False)
COLORS: tuple[str, ...] = tuple(_LOOK["axes.prop_cycle"].by_key()["color"])

UNITS = {"Hz": 2.0 * np.pi, "rad/s": 1.0}
"""Units of a frequency axis, with the value of each in rad/s."""

IN_A_ROW = 3  # panels in a row
_DECADES = 0.9, 0.4  # decades below which some minor ticks are labeled, and below which all are
_SETTINGS = RLock()  # matplotlib's settings belong to the whole process: one thread at a time may change them


if hasattr(os, "register_at_fork"):  # a process that is forked off must not wait for a thread that it does not have
    os.register_at_fork(before=_SETTINGS.acquire, after_in_parent=_SETTINGS.release, after_in_child=_SETTINGS.release)


@contextmanager
def style() -> Iterator[None]:
    """Draw with the package's style; the caller's settings are restored afterwards, also with several threads.

    ``plt.style.use("boomctl.plotting.look")`` applies the style to all plots of a script.
    """
    with _SETTINGS, mpl.rc_context(_LOOK):
        yield


_OF_OTHERS: dict[str, str] = dict.fromkeys(
    ("dB", "deg", "Hz", "omega_limits", "display_margins"),
    "; bode(...).response.plot(...) is python-control's picture and takes it",
)
"""Plot options of python-control, and the plot that accepts them."""


def new_figure(width: float = 7.0, height: float = 4.2) -> Figure:
    """Return an empty figure of ``width`` by ``height`` inches without a window."""
    return Figure(figsize=(width, height), layout="constrained")


class Sheet(Figure):
    """Figure without a window that takes the size of its plot."""


def figure_of(plot: Callable[..., Any], *arguments: Any, **options: Any) -> Figure:
    """Return a plot as a figure without a window; pyplot is not used.

    For reports and servers that draw many plots in threads and processes.

    Parameters
    ----------
    plot : callable
        A function ``plot_*`` or a result's method ``plot``.
    *arguments, **options
        Its arguments, except ``ax``.

    Examples
    --------
    >>> import boomctl as bc
    >>> figure_of(bc.iso_track(length=50.0).plot, color="black").axes[0].get_xlabel()
    'distance [m]'
    """
    sheet = Sheet(layout="constrained")
    plot(*arguments, ax=sheet, **options)
    return sheet


Divide = Callable[[FigureBase], Iterable[Axes]]
"""Function that divides a figure into the axes of a plot."""


@contextmanager
def panels(ax: Any, names: Sequence[str], size: tuple[float, float], divide: Divide | None = None) -> Iterator[Array]:
    """Provide the axes of a plot, with the package's style.

    Parameters
    ----------
    ax : None, Axes, sequence of Axes, Figure or SubFigure
        If None, a new pyplot figure is created; a figure is divided; axes are used unchanged.
    names : sequence of str
        Quantities of the axes; their number is the number of axes.
    size : (float, float)
        Size of a new figure [in].
    divide : callable, optional
        Divides a figure into the axes; by default stacked, with a common abscissa.

    Yields
    ------
    (n,) ndarray of Axes

    Raises
    ------
    TypeError, ValueError
        If ``ax`` has another type or number of axes.
    """
    if ax is not None:
        with style():
            yield _axes(ax, names, size, divide)
        return
    import matplotlib.pyplot as plt  # imported here only: pyplot retains its figures, which reports must not

    # before the look, whose end takes settings back: a notebook's backend sets some when it meets its first figure
    figure = plt.figure(figsize=size, layout="constrained")
    try:
        with style():
            yield _axes(figure, names, size, divide)
    except BaseException:
        plt.close(figure)
        raise


def _axes(ax: Any, names: Sequence[str], size: tuple[float, float], divide: Divide | None) -> Array:
    if isinstance(ax, FigureBase):
        if isinstance(ax, Sheet):
            ax.set_size_inches(*size)
        parts: Any = ax.subplots(len(names), 1, sharex=True) if divide is None else divide(ax)
        axes = list(np.ravel(np.asarray(parts, dtype=object)))
    else:
        axes = [ax] if isinstance(ax, Axes) else list(np.ravel(np.asarray(ax, dtype=object)))
        if not all(isinstance(item, Axes) for item in axes):
            many = f"a sequence of {len(names)} ({', '.join(names)})" if len(names) > 1 else "a figure"
            raise TypeError(f"ax = {shown(ax)}: expected matplotlib axes, or {many}")
        if len(axes) != len(names):
            raise ValueError(f"ax: expected {len(names)} axes ({', '.join(names)}), got {len(axes)}")
    return np.fromiter(axes, object, len(axes))


def line_look(style: Mapping[str, Any], **default: Any) -> dict[str, Any]:
    """Return line properties: the defaults, updated by properties of matplotlib in long or short form.

    A label is prefixed to the default label: "LQG: tip_left".

    Raises
    ------
    TypeError
        If a property is not one of a line.
    """
    properties = normalize_kwargs(dict(style), Line2D)
    for name in properties:
        if not hasattr(Line2D, f"set_{name}"):
            there = [word.removeprefix("set_") for word in dir(Line2D) if word.startswith("set_")]
            close = get_close_matches(name, there, n=1, cutoff=0.6)
            hint = f"; did you mean {close[0]!r}?" if close else _OF_OTHERS.get(name, "")
            raise TypeError(f"plot() got an unexpected keyword argument {name!r}, which is no property of a line{hint}")
    given, own = properties.pop("label", None), default.get("label")
    named = {} if given is None else {"label": given if own is None else f"{given}: {own}"}
    return default | properties | named


def in_rows(count: int) -> tuple[int, int, Divide]:
    """Return the number of columns and rows for a number of panels, and the grid."""
    columns = min(count, IN_A_ROW)
    rows = -(-count // columns)

    def divide(figure: FigureBase) -> list[Axes]:
        return [figure.add_subplot(rows, columns, k + 1) for k in range(count)]

    return columns, rows, divide


def divided(rows: int, columns: int, **options: Any) -> Divide:
    """Return a function that divides a figure into rows and columns of axes, with options of ``subplots``."""
    return lambda figure: np.ravel(figure.subplots(rows, columns, **options))


def over_time(axes: Array, labels: Iterable[str], margin: float = 0.0) -> None:
    """Label stacked panels over time, with a margin at both ends as a fraction of the duration."""
    for item, label in zip(axes, labels, strict=True):
        item.set(ylabel=label, xmargin=margin)
    axes[-1].set_xlabel("time [s]")
    axes[0].figure.align_ylabels(list(axes))


def legend(ax: Any, outside: str = "", columns: int = 1, **look: Any) -> None:
    """Draw a legend if a curve has a label, within the axes or outside them ("above", "above left", "right")."""
    if ax.get_legend_handles_labels()[1]:
        ax.legend(**look, **(_OUTSIDE[outside] | {"ncols": columns} if outside and reserves_space(ax) else {}))


_OUTSIDE: dict[str, dict[str, Any]] = {
    "above": {"loc": "lower right", "bbox_to_anchor": (1.0, 1.0)},
    "above left": {"loc": "lower left", "bbox_to_anchor": (-0.05, 1.0)},
    "right": {"loc": "upper left", "bbox_to_anchor": (1.0, 1.0)},
}
"""Positions of legends outside the axes."""


def labeled(name: str, unit: str) -> str:
    """Return the label of an axis with its unit, where that is known."""
    plain, _, half = unit.partition(" (")
    said = f"[{plain.replace('^2', '²')}{', orthonormal' if half else ''}]"
    return f"{name}{chr(10) if half else ' '}{said}" if unit else name


def few_labels(ax: Any) -> None:
    """Label the ticks between the decades of logarithmic axes only where there are few decades, so that none touch."""
    for axis in (ax.xaxis, ax.yaxis):
        if axis.get_scale() == "log":
            axis.set_minor_formatter(LogFormatterSciNotation(minor_thresholds=_DECADES))


def reserves_space(ax: Any) -> bool:
    """Return True if the layout of the figure reserves space outside the axes."""
    return ax.figure.get_layout_engine() is not None


def common_legend(ax: Any, axes: Any, location: str = "lower center", **options: Any) -> None:
    """Draw the legend of one of the axes: below the plot if it has a separate figure, otherwise inside.

    ``ax`` is the argument of the user.
    """
    if ax is None or isinstance(ax, FigureBase):
        axes.figure.legend(*axes.get_legend_handles_labels(), loc=f"outside {location}", **options)
    else:
        axes.legend()


def frequency_axis(ax: Any, frequency_unit: str | None = None, natural: str = "Hz") -> float:
    """Label a frequency axis, and return its unit in rad/s.

    Parameters
    ----------
    ax : Axes
    frequency_unit : {"Hz", "rad/s"}, optional
        If None, the unit of existing curves, also from python-control; otherwise ``natural``.
    natural : str

    Raises
    ------
    ValueError
        If the unit is unknown, or differs from that of existing curves.
    """
    if frequency_unit is not None and frequency_unit not in UNITS:
        raise ValueError(f"frequency_unit = {shown(frequency_unit)}: expected 'Hz' or 'rad/s'")
    there = None
    for item in [ax, *ax.get_shared_x_axes().get_siblings(ax)]:
        words = item.get_xlabel() if item.has_data() else ""
        there = there or ("Hz" if search(r"(?<![A-Za-z])Hz\b", words) else "rad/s" if "rad/s" in words else None)
    if frequency_unit is not None and there not in (None, frequency_unit):
        raise ValueError(
            f"frequency_unit = {frequency_unit!r}: the curves on these axes are in {there}; leave it out, or use other axes"
        )
    chosen = frequency_unit or there or natural
    if there is None:
        ax.set_xlabel(f"frequency [{chosen}]")
    return UNITS[chosen]


def picture(name: str, figure: Any, caption: str, *kinds: str) -> Picture:
    """Return a figure of a report, with a file of each kind, by default SVG and PNG; the first is shown."""
    files = {}
    for kind in kinds or ("svg", "png"):
        files[kind] = figure_bytes(figure, kind)
        figure.set_layout_engine("none")  # the layout is known now and is as slow as drawing
    return Picture(name, caption, files)


def film(name: str, animation: Any, caption: str) -> Picture:
    """Return an animation of matplotlib as a GIF of a report."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / "film.gif"
        animation.save(path, "pillow", dpi=80)
        return Picture(name, caption, {"gif": path.read_bytes()})


def figure_bytes(figure: Any, kind: str) -> bytes:
    """Return a figure as a file's content, ``kind`` ``"png"`` or ``"svg"``: the same one whenever it is drawn."""
    buffer = io.BytesIO()
    metadata = {"Date": None} if kind == "svg" else {}
    # Names within an SVG are otherwise drawn by lot.
    with _SETTINGS, mpl.rc_context({"svg.hashsalt": _LOOK["svg.hashsalt"]}):
        figure.savefig(buffer, format=kind, metadata=metadata)
    return buffer.getvalue()
