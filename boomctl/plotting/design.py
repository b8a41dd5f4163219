"""Frequency plots of reductions, H-infinity and tuned loops."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes

from boomctl.arrays import Array
from boomctl.lti.rounding import VISIBLE
from boomctl.plotting.canvas import COLORS, few_labels, frequency_axis, legend, line_look, panels

if TYPE_CHECKING:
    from boomctl.analysis.sigma import SigmaResult
    from boomctl.reduction.result import ReductionResult
    from boomctl.synthesis.hinf.h_infinity import HInfinityResult
    from boomctl.tuning.result import TuneResult

_MOST_LOOPS = 8  # loops drawn at most: those with the highest peaks


def plot_reduction(
    result: "ReductionResult", ax: Any = None, *, frequency_unit: str | None = None, **style: Any
) -> Any:
    """Draw singular values before and after a reduction, the error, and the levels it is proven not to exceed.

    Parameters
    ----------
    result : ReductionResult
    ax : matplotlib Axes or figure, optional
        Axes to draw on. If None, a new figure is created.
    frequency_unit : {"Hz", "rad/s"}, optional
        Unit of the frequency axis. If None, the unit of the existing axes, or Hz.
    **style
        Line properties, passed to `matplotlib.axes.Axes.plot`; ``label`` is prefixed to the labels.

    Returns
    -------
    matplotlib Axes
    """
    curves = result.curves
    looks: list[tuple[str, Array, dict[str, Any]]] = [
        ("full", curves.full, {"color": "0.6", "linewidth": 2.6}),
        (f"reduced, {result.order} states", curves.reduced, {"color": COLORS[0]}),
        ("largest error", curves.error[None, :], {"color": COLORS[1]}),
    ]
    with panels(ax, ("singular values",), (6.4, 4.4)) as (axes,):
        x = curves.omega / frequency_axis(axes, frequency_unit)
        for name, lines, default in looks:
            for k, line in enumerate(lines):
                if line.any():  # lines that are zero everywhere are omitted
                    axes.loglog(x, line, **line_look(style, **default, **({} if k else {"label": name})))
        ends = np.array(result.omega_range if result.omega_range is not None else (curves.omega[0], curves.omega[-1]))
        ends = np.maximum(ends, curves.omega[0]) * x[0] / curves.omega[0]
        where = "in the band" if result.omega_range is not None else "everywhere"
        levels = [("verified", where, result.error_norm, "--", ends)]
        levels += [("bound beforehand", "everywhere", result.error_bound, ":", x[[0, -1]])]
        for name, extent, level, dash, across in levels:
            if 0.0 < level < np.inf:
                text = f"{name}: at most {level:.3g} {extent}"
                axes.plot(across, [level, level], linestyle=dash, color="0.2", linewidth=1.0, label=text)
        if (largest := float(curves.error.max())) > 0.0:
            low, high = axes.get_ylim()
            axes.set_ylim(max(low, VISIBLE * largest), high)
        axes.set_ylabel("singular values")
        few_labels(axes)
        axes.set_title(f"Reduction by the method {result.method!r}")
        axes.legend()
    return axes


def plot_h_infinity(
    result: "HInfinityResult", curves: "SigmaResult", ax: Any = None, *, frequency_unit: str | None = None, **style: Any
) -> Any:
    """Draw the singular values of a closed loop, its verified norm, and the lower bound for all controllers.

    Parameters
    ----------
    result : HInfinityResult
    curves : SigmaResult
        Singular values of its closed loop.
    ax : matplotlib Axes or figure, optional
        Axes to draw on. If None, a new figure is created.
    frequency_unit : {"Hz", "rad/s"}, optional
        Unit of the frequency axis. If None, the unit of the existing axes.
    **style
        Line properties, passed to `matplotlib.axes.Axes.plot`; ``label`` is prefixed to the labels.

    Returns
    -------
    matplotlib Axes
    """
    with panels(ax, ("singular values",), (6.4, 4.2)) as (axes,):
        look = line_look(style, color=COLORS[0], label="closed loop")
        curves.plot(axes, frequency_unit=frequency_unit, **look)
        _level(axes, result.gamma, f"norm {result.gamma:.4g}, verified", look["color"])
        _least(axes, result.certificate.lower_bound)
        legend(axes)
    return axes


def plot_tune(
    result: "TuneResult",
    curves: "Mapping[str, SigmaResult]",
    ax: Any = None,
    *,
    frequency_unit: str | None = None,
    **style: Any,
) -> Any:
    """Draw the singular values of tuned loops, and the peaks that keep the largest norm from going lower.

    Parameters
    ----------
    result : TuneResult
    curves : mapping of str to SigmaResult
        Singular values of its closed loops, by model.
    ax : matplotlib Axes or figure, optional
        Axes to draw on. If None, a new figure is created.
    frequency_unit : {"Hz", "rad/s"}, optional
        Unit of the frequency axis. If None, the unit of the existing axes.
    **style
        Line properties, passed to `matplotlib.axes.Axes.plot`; ``label`` is prefixed to the labels.

    Returns
    -------
    matplotlib Axes
    """
    with panels(ax, ("singular values",), (6.4, 4.2)) as (axes,):
        for k, (name, curve) in enumerate(list(curves.items())[:_MOST_LOOPS]):
            look = line_look(style, color=COLORS[k % len(COLORS)], label=name or "closed loop")
            curve.plot(axes, frequency_unit=frequency_unit, **look)
        whole = [p for p in result.certificate.active_peaks if p.channel.inputs is None and p.channel.outputs is None]
        shown = [p for p in whole if p.channel.norm == "hinf" and 0.0 < p.omega < np.inf]
        if shown:
            scale = frequency_axis(axes, frequency_unit)
            at, heights = [p.omega / scale for p in shown], [p.value for p in shown]
            axes.plot(at, heights, "o", color="0.2", markersize=4.0, label="active peaks")
        if all(p.channel.norm == "hinf" for p in result.certificate.active_peaks):
            _level(axes, result.gamma, f"largest norm {result.gamma:.4g}, verified", "0.2")
        _least(axes, result.certificate.lower_bound)
        legend(axes)
    return axes


def _level(ax: Axes, value: float, said: str, color: str, dash: str = "--") -> None:
    ax.axhline(value, color=color, linewidth=0.9, linestyle=dash, label=said)


def _least(ax: Axes, value: float) -> None:
    """Draw the lower bound for all controllers, if known."""
    if value > 0.0:
        _level(ax, value, f"lower bound {value:.4g}", "0.4", ":")
