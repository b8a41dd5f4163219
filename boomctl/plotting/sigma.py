"""Singular-value (sigma) plots."""

from typing import TYPE_CHECKING, Any

import numpy as np

from boomctl.plotting.canvas import style

if TYPE_CHECKING:
    from boomctl.analysis.measured import MeasuredCurve
    from boomctl.analysis.sigma import SigmaResult


def plot_sigma(
    result: "SigmaResult",
    label: str | None = None,
    ax: Any = None,
    hz: bool = True,
    linestyle: str = "-",
    color: Any = None,
) -> Any:
    """Draw singular values over frequency, both axes logarithmic, and mark a certified peak.

    Of an unstable system, which answers no sine so, the curves are dotted and the picture says why.

    Parameters
    ----------
    result : SigmaResult
    label : str, optional
        For the legend.
    ax : matplotlib Axes, optional
        Where to draw, for instance an axes of one of python-control's own plots (with ``hz=False``); by default a new
        figure.
    hz : bool
        Frequency in Hz, else in rad/s.
    linestyle, color : optional
        As matplotlib takes them.

    Returns
    -------
    matplotlib Axes
    """
    scale = 2.0 * np.pi if hz else 1.0
    if result.unstable:
        linestyle, label = ":", f"{label} (unstable)" if label else label
    with style():
        if ax is None:
            import matplotlib.pyplot as plt

            _, ax = plt.subplots(layout="constrained")
        for k, line in enumerate(result.sigma):
            (drawn,) = ax.loglog(
                result.omega / scale, line, linestyle=linestyle, color=color, label=label if k == 0 else None
            )
            color = drawn.get_color()
        if result.unstable:
            said = f"{label or 'unstable'}: no response to sines, which would grow"
            place = 1.02 + 0.06 * len(ax.texts)  # of the axes: beside all curves, above what is said of other systems
            ax.text(0.5, place, said, transform=ax.transAxes, ha="center", va="bottom", color=color, fontweight="bold")
        if result.certified and np.isfinite(result.peak):
            ax.plot(result.peak_omega / scale, result.peak, "o", color=color, markersize=4, fillstyle="none")
        ax.set_xlabel("frequency [Hz]" if hz else "frequency [rad/s]")
        ax.set_ylabel("singular values")
        if label:
            ax.legend()
    return ax


def plot_measured(curve: "MeasuredCurve", ax: Any, color: Any = "#444444") -> Any:
    """Lay a measured curve over a sigma plot in Hz."""
    with style():
        for label, line in zip(curve.labels, curve.magnitude, strict=True):
            ax.plot(curve.freq_hz, line, ".", color=color, markersize=3, label=label)
        ax.legend()
    return ax
