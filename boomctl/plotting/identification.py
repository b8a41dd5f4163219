"""Plots of fits: measured and computed values, before and after the fit."""

from typing import TYPE_CHECKING, Any

import numpy as np

from boomctl.plotting.canvas import COLORS, few_labels, frequency_axis, legend, line_look, panels

if TYPE_CHECKING:
    from boomctl.identification.fit_result import FitResult
    from boomctl.identification.identify import IdentificationResult
    from boomctl.identification.response import FrequencyResponseEstimate

_TOGETHER = "0.15"  # color of a fit to several data sets, each of which has another color
_BEFORE = "0.6"  # color of the initial model
_NORMAL = 1.96  # deviations to either side of a curve that hold 95 % of normal errors
_SHADE = 0.25  # opacity of an interval
_DASHES = ("-", "--", ":", "-.")  # of the inputs, where outputs differ in color
_NAMED = 12  # entries of a response above which the legend names none


def plot_fit(result: "FitResult", ax: Any = None, **drawn: Any) -> Any:
    """Draw measured values, fitted values and those at the start; return the axes.

    Natural frequencies are drawn over the numbers of their modes with the standard deviation of their errors; responses
    and singular values by magnitude over frequency, each data set in its color.  ``drawn`` is the style of the fit.
    """
    with panels(ax, ("fit",), (6.4, 4.8)) as (axes,):
        (_draw_curves if result.mode_numbers is None else _draw_eigenfrequencies)(result, axes, drawn)
        axes.legend()
    return axes


def _draw_eigenfrequencies(result: "FitResult", ax: Any, drawn: dict[str, Any]) -> None:
    data, modes = result.data, np.array(result.mode_numbers)
    selected = data.kept
    error = np.where(selected, data.spread, 0.0) * (0.0 if np.isnan(result.error_std) else result.error_std)
    if data.errors == "relative":
        error = np.array([data.values * -np.expm1(-error), data.values * np.expm1(error)])[:, selected]
    else:
        error = error[selected]
    for k in range(data.sets):
        own = (np.zeros(len(selected), int) if data.member is None else data.member)[selected] == k
        number = "" if data.member is None else f", data set {k + 1}"
        label = f"measured{number}, ± 1 deviation"
        at, values, bars = modes[selected][own], data.values[selected][own], error[..., own]
        ax.errorbar(at, values, yerr=bars, fmt="o", color=COLORS[_of_set(k)], label=label)
    ax.plot(modes, result.initial_fit, "x", color=_BEFORE, label="start")
    look = {"marker": "s", "linestyle": "none", "fillstyle": "none", "color": COLORS[1], "markersize": 9}
    ax.plot(modes, result.best_fit, **{**look, "label": "fitted", **drawn})
    ax.set_yscale("log")
    ax.set_xticks(modes)
    ax.set(xlabel="mode of the model", ylabel="frequency [Hz]")


def _of_set(k: int) -> int:
    """Return the color index of a data set; index 1 is the color of the fit."""
    return 0 if k == 0 else 2 + (k - 1) % (len(COLORS) - 2)


def _draw_curves(result: "FitResult", ax: Any, drawn: dict[str, Any]) -> None:
    data = result.data
    hz = data.omega / (2.0 * np.pi)  # type: ignore[operator]
    measured = np.where(data.kept, np.abs(data.values), np.nan).reshape(-1, len(hz))
    first = np.unique(hz, return_index=True)[1]  # the model answers the same to every data set
    fitted, initial = (
        np.abs(values).reshape(-1, len(hz))[:, first] for values in (result.best_fit, result.initial_fit)
    )
    what = "singular value" if data.kind == "singular values" else "entry"
    for k, (points, line, before) in enumerate(zip(measured, fitted, initial, strict=True)):
        color = COLORS[k % len(COLORS)] if data.member is None else _TOGETHER
        named = len(measured) <= len(COLORS)
        number = f", {what} {k + 1}" if len(measured) > 1 else ""
        ax.plot(hz[first], before, ":", color=_BEFORE, linewidth=1.0, label="start" if k == 0 else None)
        if data.member is None:
            ax.plot(hz, points, ".", color=color, markersize=3, label=f"measured{number}" if named else None)
        for j in range(data.sets if data.member is not None else 0):
            own, label = data.member == j, f"measured, data set {j + 1}" if k == 0 else None
            ax.plot(hz[own], points[own], ".", color=COLORS[_of_set(j)], markersize=3, label=label)
        ax.plot(hz[first], line, **{"color": color, "label": f"fitted{number}" if named else None, **drawn})
    ax.set_xscale("log" if (hz > 0.0).all() else "linear")
    ax.set_yscale("log")
    ax.set_xlabel("frequency [Hz]")
    ax.set_ylabel("singular values" if data.kind == "singular values" else "magnitude")
    few_labels(ax)


def plot_response(
    response: "FrequencyResponseEstimate", ax: Any = None, *, frequency_unit: str | None = None, **drawn: Any
) -> Any:
    """Draw each entry's magnitude with its 95 % interval and its phase, and each output's coherence; return the axes."""
    size, error = np.abs(response.frdata), _NORMAL * response.deviation
    entries = [(o, i) for o in range(len(size)) for i in range(size.shape[1])]
    with panels(ax, ("magnitude", "phase", "coherence"), (7.0, 6.4)) as axes:
        omega = response.omega / frequency_axis(axes[-1], frequency_unit)
        for o, i in entries:
            name = f"{response.input_labels[i]} -> {response.output_labels[o]}"
            named = name if len(entries) <= _NAMED else None
            dashes = _DASHES[i % len(_DASHES)]
            look = line_look(drawn, color=COLORS[o % len(COLORS)], linestyle=dashes, label=named)
            axes[0].plot(omega, size[o, i], **look)
            low, high = np.maximum(size[o, i] - error[o, i], size[o, i].min() * _SHADE), size[o, i] + error[o, i]
            axes[0].fill_between(omega, low, high, color=look["color"], alpha=_SHADE, linewidth=0.0)
            axes[1].plot(omega, np.angle(response.frdata[o, i], deg=True), **{**look, "label": None})
        for o, coherence in enumerate(response.coherence):
            named = response.output_labels[o] if len(size) <= len(COLORS) else None
            axes[2].plot(omega, coherence, **line_look(drawn, color=COLORS[o % len(COLORS)], label=named))
        axes[0].set(yscale="log", ylabel="magnitude")
        axes[1].set(ylabel="phase [deg]", ylim=(-190.0, 190.0), yticks=(-180.0, -90.0, 0.0, 90.0, 180.0))
        axes[2].set(ylabel="coherence", ylim=(0.0, 1.05))
        for item in axes:
            item.set_xscale("log")
            legend(item)
            few_labels(item)
    return axes


def plot_identification(result: "IdentificationResult", ax: Any = None, **drawn: Any) -> Any:
    """Draw poles over orders with the identified modes, and spectra of validation data and residuals; return the axes."""
    with panels(ax, ("stabilization", "validation"), (7.0, 5.5)) as axes:
        first = {"label": "pole of a model order"}
        for order, poles in result.stabilization_poles.items():
            look = line_look({}, marker=".", linestyle="none", color=_BEFORE, **first)
            axes[0].plot(poles.imag / (2.0 * np.pi), np.full(len(poles), order), **look)
            first = {}
        for k, mode in enumerate(result.modes):
            label = None if k else "mode, 95 % interval" if result.confidence_level == 0.95 else "mode, interval"
            axes[0].axvline(mode.frequency_hz, color=COLORS[1], linewidth=1.0, label=label)
            axes[0].axvspan(*mode.frequency_interval_hz, color=COLORS[1], alpha=_SHADE, linewidth=0.0)
        hz, outputs, left = result.validation_spectra
        axes[1].plot(hz, outputs, **line_look(drawn, color=COLORS[0], label="outputs"))
        axes[1].plot(hz, left, **line_look(drawn, color=COLORS[5], linewidth=0.8, label="residuals"))
        axes[1].set_yscale("log")
        axes[0].set_ylabel("order")
        axes[1].set_ylabel("spectrum / RMS of outputs")
        frequency_axis(axes[1])
        for item in axes:
            item.set_xlim(*result.frequency_range_hz)
            legend(item, loc="upper right")
    return axes
