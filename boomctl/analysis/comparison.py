"""Comparison of loops, designs or runs in one table and one plot.

The method ``__figures__`` of a result returns its metrics: numbers by name, units in brackets.  The metrics of a linear
system are the verified peak, the H2 norm and the slowest pole.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from html import escape
from importlib import import_module
from itertools import chain
from typing import TYPE_CHECKING, Any

import numpy as np

from boomctl.analysis.h2 import h2_norm
from boomctl.analysis.margins import Margins
from boomctl.analysis.sigma import (
    ANY_RESULT,
    SelectedSystem,
    SigmaResult,
    between_signals,
    curves_of,
    looked_at,
    matrices,
    naming,
)
from boomctl.checks import known, mapping, shown
from boomctl.lti.modal import resolved
from boomctl.lti.system import Lti
from boomctl.lti.time_series import TimeSeries
from boomctl.printing import DataFrame, between, count, data_frame, listed, table_html, table_text
from boomctl.threads import one_blas_thread

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

TIME, FREQUENCY, MARGINS = "time", "frequency", "margins"  # Plots of a comparison, in order of preference.
_SHOWN = 40  # Smallest width of the metrics' column in a table, in characters.


@dataclass(frozen=True)
class Comparison:
    """Metrics of several systems or results, side by side.

    Attributes
    ----------
    names : tuple of str
        Names of the systems or results.
    metrics : tuple of str
        Names of all metrics, including those that some results lack.
    values : dict of str to dict of str to float
        Metrics of each result by name.
    """

    names: tuple[str, ...]
    metrics: tuple[str, ...]
    values: dict[str, dict[str, float]] = field(repr=False)
    _parts: dict[str, tuple[Any, ...]] = field(repr=False, compare=False)

    def __getitem__(self, name: str) -> dict[str, float]:
        """Return the metrics of a result by its name."""
        return self.values[known("name", name, self.names)]

    def _ipython_key_completions_(self) -> list[str]:
        """Return the names that consoles complete in brackets."""
        return list(self.names)

    def __repr__(self) -> str:
        return f"Comparison: {listed(self.names)}\n  {count(len(self.metrics), 'figure')}: {listed(self.metrics, 70)}"

    def _repr_html_(self) -> str:
        heads, *rows = self._table()
        return table_html("Comparison", heads, rows) + "".join(f"<p>{escape(line)}</p>" for line in self._signals())

    def __str__(self) -> str:
        """Return the metrics as text.

        Returns
        -------
        str
            A table with one row for each metric and one column for each name; below it, the signals between which linear
            systems are compared, and the unstable systems.
        """
        return "\n".join([table_text(self._table(), first=_SHOWN), *self._signals()])

    def _signals(self) -> list[str]:
        """Return the signals of the singular values and norms of each system, and whether it is unstable."""
        return [
            f"{name}: {between(part.input_labels, part.output_labels)}{'' if part.stable else ', unstable'}"
            for name, parts in self._parts.items()
            for part in parts
            if isinstance(part, SigmaResult)
        ]

    def to_dict(self) -> dict[str, dict[str, float]]:
        """Return the metrics as plain dictionaries.

        Returns
        -------
        dict of str to dict of str to float
            Metrics of each result by name.
        """
        return {name: dict(figures) for name, figures in self.values.items()}

    def to_pandas(self) -> DataFrame:
        """Return the metrics as a data frame of pandas.

        Returns
        -------
        pandas.DataFrame
            One row for each metric and one column for each name; NaN for missing metrics.
        """
        return data_frame(self.to_dict(), index=self.metrics)

    def plot(self, ax: Any = None, *, kind: str | None = None, signals: Sequence[str] = (), **style: Any) -> Any:
        """Draw all results in common axes, each in a separate color.

        Parameters
        ----------
        ax : matplotlib Axes, sequence of them, or a figure, optional
            Axes to draw on: one for each signal or loop, one for singular values. If None, a new figure is created.
        kind : {"time", "frequency", "margins"}, optional
            Signals over time, singular values, or Nyquist curves with the critical disks.  If None, the first kind that all
            results have.
        signals : sequence of str, optional
            Signals over time, or signals at which the loop is opened.  If None, at most six that all results have.
        **style
            Line properties, passed to `matplotlib.axes.Axes.plot`; ``label`` is prefixed to the names.

        Returns
        -------
        ndarray of matplotlib.axes.Axes
            The axes.
        """
        there = [item for item in (TIME, FREQUENCY, MARGINS) if all(_of_kind(item, p) for p in self._parts.values())]
        if not there:
            raise ValueError("plot: there is nothing over time, over frequency, or of margins that all of them have")
        chosen = there[0] if kind is None else known("kind", kind, there)
        drawn = {name: _of_kind(chosen, parts) for name, parts in self._parts.items()}
        return import_module("boomctl.plotting.looking").plot_comparison(chosen, drawn, ax, signals=signals, **style)

    def _table(self) -> list[tuple[str, ...]]:
        rows: list[tuple[str, ...]] = [("", *self.names)]
        for figure in self.metrics:
            cells = (self.values[name].get(figure) for name in self.names)
            rows.append((figure, *("–" if cell is None else f"{cell:.4g}" for cell in cells)))
        return rows


@one_blas_thread
def compare(
    results: Mapping[str, Any],
    *,
    omega: ArrayLike | None = None,
    inputs: str | Sequence[str] | None = None,
    outputs: str | Sequence[str] | None = None,
) -> Comparison:
    """Compare metrics of several loops, designs or runs, as a table and as a plot.

    Parameters
    ----------
    results : mapping of str to system or result, or to a sequence of these
        By name: simulated loops (RMS and peak of outputs and of controls), other simulations, linear systems such as
        closed loops (verified peak, H2 norm, slowest pole, minimum damping ratio; for a boom model from platform
        actuators to tips), designs (metrics of the closed loop, and number of controller states), margins, worst
        cases, spray deposits, slews, evaluations of suspensions. A sequence has the metrics of all its items.
    omega : array_like, optional
        Angular frequencies of the plots of linear systems [rad/s].  If None, frequencies that show the peaks of all systems.
    inputs, outputs : str or sequence of str, optional
        Signals of linear systems.  If None, all signals; for a boom model, platform actuators and tips.

    Returns
    -------
    Comparison
        ``comparison["name"]["metric"]``; ``print`` shows a table, ``.plot()`` a plot, ``.to_pandas()`` returns all values.

    Raises
    ------
    TypeError, ValueError
        If `results` is empty, or an item has no metrics or an unsupported type.

    Examples
    --------
    >>> import boomctl as bc
    >>> import numpy as np
    >>> soft, stiff = (bc.lqr(bc.hub_beam(modes=1).linearize(), np.eye(4), weight) for weight in (10.0, 0.1))
    >>> both = bc.compare({"soft": soft, "stiff": stiff})
    >>> both["soft"]["slowest pole [rad/s]"] > both["stiff"]["slowest pole [rad/s]"]
    True
    """
    mapping("results", results, "systems or results by name")
    if not results:
        raise ValueError("results: expected at least one")
    parts: dict[str, tuple[Any, ...]] = {}
    systems: dict[tuple[str, int], SelectedSystem] = {}  # systems without ``__figures__``, by name and index
    for name, item in results.items():
        if not isinstance(name, str):
            raise TypeError(f"name of a result = {shown(name)}: expected a string, got {type(name).__name__}")
        parts[name] = tuple(item) if isinstance(item, list | tuple) else (item,)
        if not parts[name]:
            raise ValueError(f"results[{name!r}]: expected at least one")
        for k, member in enumerate(parts[name]):
            if not hasattr(type(member), "__figures__"):
                with naming(f"results[{name!r}]"):
                    chosen = between_signals(looked_at(member), inputs, outputs, ANY_RESULT)
                    systems[name, k] = SelectedSystem.of(chosen, omega, None, None, None)
    _check_same_scales(systems.values())
    curves = curves_of(systems)
    values: dict[str, dict[str, float]] = {}
    for name, members in parts.items():
        values[name] = {}
        for k, member in enumerate(members):
            with naming(f"results[{name!r}]"):
                curve = curves.get((name, k))
                values[name] |= member.__figures__() if curve is None else _of_system(member, systems[name, k], curve)
        parts[name] = tuple(curves.get((name, k), member) for k, member in enumerate(members))
    metrics = dict.fromkeys(figure for figures in values.values() for figure in figures)
    return Comparison(tuple(results), tuple(metrics), values, parts)


def _check_same_scales(systems: Iterable[SelectedSystem]) -> None:
    """Check that signals of the same name have the same scale in all systems."""
    scales: dict[str, float] = {}
    for selected in systems:
        own = getattr(selected.chosen, "scales", None) or {}
        for label in chain(*selected.labels):
            scale = own.get(label, 1.0)
            if scales.setdefault(label, scale) != scale:
                raise ValueError(
                    f"`results` must be in the same scales, got {label!r} divided by {scales[label]:g} and by {scale:g}."
                    " Compare systems in the units of the machine, or all scaled alike."
                )


def _of_system(source: Any, selected: SelectedSystem, curve: SigmaResult) -> dict[str, float]:
    """Return the metrics of a linear system."""
    figures = {"H-infinity norm" + ("" if curve.verified else ", not verified"): curve.peak}
    figures["H2 norm"] = h2_norm(selected.chosen).value
    rates = matrices(selected.chosen).rates
    rates = rates[np.isfinite(rates)]
    if len(rates):
        figures["slowest pole [rad/s]"] = float(rates.real.max())
    turning = rates[resolved(rates) & (rates.imag > 0.0)]
    if len(turning):
        figures["least damping [%]"] = float(100.0 * (-turning.real / np.abs(turning)).min())
    controller = getattr(source, "_controller", None)
    if isinstance(controller, Lti):
        figures["states of the controller"] = float(len(controller.A))
    return figures


def _of_kind(kind: str, parts: tuple[Any, ...]) -> Any:
    """Return the data of the first part with a plot of a kind, or None."""
    for part in parts:
        run = getattr(part, "run", part)
        if kind == TIME and isinstance(run, TimeSeries):
            return {**run._outputs(), **run._inputs()}, run.time
        if kind == FREQUENCY and hasattr(part, "sigma"):
            return part if hasattr(part, "omega") else part.sigma
        if kind == MARGINS and isinstance(part, Margins):
            return part
    return None
