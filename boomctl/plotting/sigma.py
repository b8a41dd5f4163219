"""Plots over frequency: singular values, of one system or several, and measured ones."""

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

import numpy as np

from boomctl.plotting.canvas import few_labels, frequency_axis, labeled, legend, line_look, panels

if TYPE_CHECKING:
    from boomctl.analysis.sigma import SigmaComparison, SigmaResult
    from boomctl.identification.files.frequency_response import MeasuredFrequencyResponse

_PEAK = "verified peak"
_SIZE = (6.4, 4.2)  # in: a column and a half of a paper


def plot_sigma(result: "SigmaResult", ax: Any = None, *, frequency_unit: str | None = None, **style: Any) -> Any:
    """Draw singular values over frequency, both axes logarithmic, and mark a verified peak.

    For an unstable system, which has no steady response to sines, the curves are dotted and labeled.

    Parameters
    ----------
    result : SigmaResult
    ax : matplotlib Axes, Figure or SubFigure, optional
        Axes to draw on, for instance of a plot of python-control. If None, a new figure is created.
    frequency_unit : {"Hz", "rad/s"}, optional
        Unit of the frequency axis. If None, that of the existing axes, otherwise that of the requested frequencies,
        or Hz.
    **style
        Line properties, passed to `matplotlib.axes.Axes.plot`: ``label``, ``color``, ``linestyle``, ...

    Returns
    -------
    matplotlib Axes

    Raises
    ------
    TypeError, ValueError
        If the axes have another type, the unit is unknown or differs from that of existing curves, or a property is unknown.
    """
    return _plot([(result, style)], ax, frequency_unit)


def _plot(curves: Iterable[tuple["SigmaResult", dict[str, Any]]], ax: Any, frequency_unit: str | None) -> Any:
    """Draw singular values with their styles, and the legend, with the entry of the circles last."""
    with panels(ax, ("singular values",), _SIZE) as (axes,):
        for result, style in curves:
            _draw(result, axes, frequency_unit, style)
        entries = sorted(zip(*axes.get_legend_handles_labels(), strict=True), key=lambda entry: entry[1] == _PEAK)
        if entries:
            axes.legend(*zip(*entries, strict=True))
    return axes


def _draw(result: "SigmaResult", ax: Any, frequency_unit: str | None, style: dict[str, Any]) -> None:
    look = line_look(style)
    scale, label = frequency_axis(ax, frequency_unit, result.frequency_unit), look.pop("label", None)
    if not result.stable:
        look["linestyle"], label = ":", f"{label} (unstable)" if label else label
    positive = result.omega > 0.0  # there is no zero on a logarithmic axis
    draw = ax.loglog if (result.sigma[:, positive] > 0.0).any() or ax.has_data() else ax.semilogx
    for k, line in enumerate(result.sigma):
        (drawn,) = draw(result.omega[positive] / scale, line[positive], label=label if k == 0 else None, **look)
        look["color"] = drawn.get_color()
    color = look.get("color")
    if not result.stable:
        said = f"{label or 'unstable'}: no steady-state response"
        height = 1.02 + 0.06 * len(ax.texts)  # In axes units: right of the curves, above the notes of other systems.
        ax.text(0.5, height, said, transform=ax.transAxes, ha="center", va="bottom", color=color, fontweight="bold")
    if result.verified and np.isfinite(result.peak) and result.peak_omega > 0.0:
        said = None if _PEAK in ax.get_legend_handles_labels()[1] else _PEAK
        x, y = result.peak_omega / scale, result.peak
        ax.plot(x, y, "o", color=color, markersize=4, fillstyle="none", label=said)
    if result.magnitude_unit or not ax.get_ylabel():
        ax.set_ylabel(labeled("singular values", result.magnitude_unit))
    few_labels(ax)


def plot_sigma_comparison(
    comparison: "SigmaComparison", ax: Any = None, *, frequency_unit: str | None = None, **style: Any
) -> Any:
    """Draw the singular values of several systems, each in a separate color, on one frequency axis.

    Parameters
    ----------
    comparison : SigmaComparison
    ax, frequency_unit, **style
        See :func:`plot_sigma`; ``style`` applies to all curves.

    Returns
    -------
    matplotlib Axes
    """
    looks = ((result, line_look(style, label=name)) for name, result in comparison.curves.items())
    return _plot(looks, ax, frequency_unit)


def plot_measured(
    curve: "MeasuredFrequencyResponse", ax: Any = None, *, frequency_unit: str | None = None, **style: Any
) -> Any:
    """Draw a measured curve, by dots; on a sigma plot it lies over the computed ones.

    Parameters
    ----------
    curve : MeasuredFrequencyResponse
    ax, frequency_unit, **style
        See :func:`plot_sigma`; by default in Hz, as measured.

    Returns
    -------
    matplotlib Axes
    """
    with panels(ax, ("measured",), _SIZE) as (axes,):
        fresh = not axes.has_data()
        scale = frequency_axis(axes, frequency_unit)
        for label, line in zip(curve.labels, curve.magnitude, strict=True):
            look = line_look(style, label=label, color="#444444", linestyle="none", marker=".", markersize=4)
            shown = (curve.frequency_hz > 0.0) & (line > 0.0) if fresh else slice(None)
            axes.plot(2.0 * np.pi * curve.frequency_hz[shown] / scale, line[shown], **look)
        if fresh:
            axes.set(xscale="log", yscale="log", ylabel="measured magnitude")
            few_labels(axes)
        legend(axes)
    return axes
