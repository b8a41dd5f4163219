"""Plots of suspensions: singular values before and after, weights, a run over the field."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from boomctl.arrays import Array
from boomctl.plotting.canvas import COLORS, new_figure, style

if TYPE_CHECKING:
    import control

    from boomctl.analysis.sigma import SigmaResult
    from boomctl.simulation.result import LoopResult

_PASSIVE, _CONTROLLED, _FAMILY = COLORS[1], COLORS[0], "#9bb8d3"


def draw_suspension_sigma(
    passive: "SigmaResult",
    active: "SigmaResult",
    labels: tuple[str, str],
    exact: "SigmaResult | None" = None,
    others: "Sequence[SigmaResult]" = (),
) -> Any:
    """Draw singular values from platform to tips before and after, on the exact boom, and over the uncertainty.

    Parameters
    ----------
    passive, active : SigmaResult
    labels : (str, str)
        Of the two.
    exact : SigmaResult, optional
        Of the closed loop with the exact beam.
    others : sequence of SigmaResult, optional
        Of the closed loop on other members of the family, drawn faintly.

    Returns
    -------
    matplotlib Figure
    """
    with style():
        figure = new_figure(7.4, 4.6)
        ax = figure.add_subplot()
        for k, item in enumerate(others):
            label = "uncertain springs and mass" if k == 0 else None
            ax.loglog(item.omega / (2 * np.pi), item.sigma[0], color=_FAMILY, linewidth=0.8, label=label)
        passive.plot(ax, frequency_unit="Hz", label=labels[0], color=_PASSIVE)
        active.plot(ax, frequency_unit="Hz", label=labels[1], color=_CONTROLLED)
        if exact is not None:
            dots = {"color": "black", "markersize": 2.8, "markevery": 0.01}  # sparse: the line below is visible
            for k, line in enumerate(exact.sigma):
                label = f"{labels[1]}, exact boom" if k == 0 else None
                ax.loglog(exact.omega / (2 * np.pi), line, ".", label=label, **dots)
        ax.set_xlim(0.03, 20.0)
        ax.set_ylim(1e-3, max((1.6 * item.peak for item in (passive, active) if np.isfinite(item.peak)), default=None))
        ax.set_title("Platform to tips; circles: verified peaks")
        ax.legend(loc="lower left")
    return figure


def draw_weights(weights: "Mapping[str, control.StateSpace]", omega: Array) -> Any:
    """Draw the gains of weights over frequency [rad/s]; return the figure."""
    with style():
        figure = new_figure(6.4, 3.2)
        ax = figure.add_subplot()
        for name, weight in weights.items():
            gain = np.abs(np.asarray(weight(1j * omega, squeeze=False))[0, 0])
            ax.loglog(omega / (2 * np.pi), gain, label=name)
        ax.set(xlabel="frequency [Hz]", ylabel="weight", title="Weights, in the units of the design")
        ax.legend()
    return figure


def draw_run(
    passive: "LoopResult",
    active: "LoopResult",
    labels: tuple[str, str],
    limits: tuple[float, float],
    span: tuple[float, float],
) -> Any:
    """Draw platform, tips, strokes and forces over time.

    Parameters
    ----------
    passive, active : LoopResult
    labels : (str, str)
    limits : (float, float)
        Of force [N] and stroke [m]; drawn where the curves come near them.
    span : (float, float)
        Times to show [s].

    Returns
    -------
    matplotlib Figure
    """
    runs = ((passive, labels[0], _PASSIVE), (active, labels[1], _CONTROLLED))
    rows = 4 if active.controls else 3
    inside = (active.time >= span[0]) & (active.time <= span[1])
    t = active.time[inside]
    with style():
        figure = new_figure(7.4, 1.7 * rows + 0.5)
        axes = figure.subplots(rows, 1, sharex=True)
        left, right = (active.disturbances[f"actuator_{side}"][inside] for side in ("left", "right"))
        axes[0].plot(t, 1e3 * left, color="black", label="left")
        axes[0].plot(t, 1e3 * right, color=COLORS[4], label="right", linewidth=1.0)
        axes[0].set_ylabel("platform [mm]")
        for run, label, color in runs:
            axes[1].plot(t, 1e3 * run["tip_left"][inside], color=color, label=label)
            axes[2].plot(t, 1e3 * run["stroke_left"][inside], color=color, label=label)
        axes[1].set_ylabel("left tip [mm]")
        axes[2].set_ylabel("left stroke [mm]")
        _limit(axes[2], 1e3 * limits[1])
        if active.controls:
            for side, color in (("left", _CONTROLLED), ("right", COLORS[3])):
                axes[3].plot(t, active.controls[f"suspension_{side}"][inside], color=color, label=side)
            axes[3].set_ylabel("force [N]")
            _limit(axes[3], limits[0])
        for ax in axes:
            ax.legend(loc="upper right", ncols=3)
            low, high = ax.get_ylim()
            ax.set_ylim(low, high + 0.25 * (high - low))
        axes[-1].set_xlabel("time [s]")
        axes[-1].set_xlim(*span)
    return figure


def _limit(ax: Any, value: float) -> None:
    """Mark a limit, unless the curves stay so far below it that it would only squeeze them."""
    low, high = ax.get_ylim()
    if max(-low, high) > 0.4 * value:
        for sign in (-1.0, 1.0):
            ax.axhline(sign * value, color="#777777", linewidth=0.9, dashes=(4, 2), label="limit" if sign > 0 else None)
