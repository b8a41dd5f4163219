"""Pictures of fits: what was measured beside what the model answers, before and after."""

from typing import TYPE_CHECKING, Any

import numpy as np

from boomctl.plotting.canvas import COLOURS, style

if TYPE_CHECKING:
    from boomctl.identification.result import FitResult

_BEFORE = "0.6"  # grey of what the start gave (a choice)


def plot_fit(result: "FitResult", ax: Any = None, **drawn: Any) -> Any:
    """Draw measured values beside fitted ones and those at the start; return the axes.

    Eigenfrequencies stand over the numbers of their modes with the confidence limit of their errors; responses and singular
    values by magnitude over frequency.  ``drawn`` is the style of what is fitted.
    """
    with style():
        if ax is None:
            import matplotlib.pyplot as plt

            _, ax = plt.subplots(layout="constrained")
        if result.modes is not None:
            _draw_eigenfrequencies(result, ax, drawn)
        else:
            _draw_curves(result, ax, drawn)
        ax.legend()
    return ax


def _draw_eigenfrequencies(result: "FitResult", ax: Any, drawn: dict[str, Any]) -> None:
    data, modes = result.measured, np.array(result.modes)
    kept = data.kept
    error = np.where(kept, data.spread, 0.0) * (0.0 if np.isnan(result.deviation) else result.deviation)
    if data.errors == "relative":
        error = np.array([data.values * -np.expm1(-error), data.values * np.expm1(error)])[:, kept]
    else:
        error = error[kept]
    ax.errorbar(modes[kept], data.values[kept], yerr=error, fmt="o", color=COLOURS[0], label="measured, ± 1 deviation")
    ax.plot(modes, result.begun, "x", color=_BEFORE, label="start")
    look = {"marker": "s", "linestyle": "none", "fillstyle": "none", "color": COLOURS[1], "markersize": 9}
    ax.plot(modes, result.fitted, **{**look, "label": "fitted", **drawn})
    ax.set_yscale("log")
    ax.set_xticks(modes)
    ax.set_xlabel("mode of the model")
    ax.set_ylabel("frequency [Hz]")


def _draw_curves(result: "FitResult", ax: Any, drawn: dict[str, Any]) -> None:
    data = result.measured
    hz = data.omega / (2.0 * np.pi)  # type: ignore[operator]
    measured = np.where(data.kept, np.abs(data.values), np.nan).reshape(-1, len(hz))
    fitted, begun = (np.abs(given).reshape(-1, len(hz)) for given in (result.fitted, result.begun))
    for k, (seen, line, before) in enumerate(zip(measured, fitted, begun, strict=True)):
        colour = COLOURS[k % len(COLOURS)]
        named = len(measured) <= len(COLOURS)
        what = "singular value" if data.kind == "singular values" else "entry"
        number = f", {what} {k + 1}" if len(measured) > 1 else ""
        ax.plot(hz, before, ":", color=_BEFORE, linewidth=1.0, label="start" if k == 0 else None)
        ax.plot(hz, seen, ".", color=colour, markersize=3, label=f"measured{number}" if named else None)
        ax.plot(hz, line, **{"color": colour, "label": f"fitted{number}" if named else None, **drawn})
    ax.set_xscale("log" if (hz > 0.0).all() else "linear")
    ax.set_yscale("log")
    ax.set_xlabel("frequency [Hz]")
    ax.set_ylabel("singular values" if data.kind == "singular values" else "magnitude")
