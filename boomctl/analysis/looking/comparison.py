"""Several loops, designs or runs in one table and in one picture.

What a result has to show beside others is what its method ``__figures__`` returns: numbers by name, units in brackets.  Of a
linear system it is the verified peak, the H2 norm and the slowest pole.
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
from boomctl.analysis.looking.given import EXPECTED, looked_at, matrices
from boomctl.analysis.margins import Margins
from boomctl.analysis.sigma import SelectedSystem, SigmaResult, between_signals, curves_of, naming
from boomctl.checks import known, mapping, shown
from boomctl.lti.modal import resolved
from boomctl.lti.system import Lti
from boomctl.lti.time_series import TimeSeries
from boomctl.printing import DataFrame, between, count, data_frame, listed, table_html, table_text
from boomctl.threads import one_blas_thread

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

TIME, FREQUENCY, MARGINS = "time", "frequency", "margins"  # the pictures of a comparison, in the order tried
_SHOWN = 40  # letters of a figure's name in a table at least (a choice)


@dataclass(frozen=True)
class Comparison:
    """Figures of several systems or results, side by side.

    Attributes
    ----------
    names : tuple of str
        What is compared.
    metrics : tuple of str
        Names of the figures, those that some have and others not included.
    values : dict of str to dict of str to float
        For each name the figures that it has.
    """

    names: tuple[str, ...]
    metrics: tuple[str, ...]
    values: dict[str, dict[str, float]] = field(repr=False)
    _parts: dict[str, tuple[Any, ...]] = field(repr=False, compare=False)

    def __getitem__(self, name: str) -> dict[str, float]:
        """Return the figures of one of them by its name."""
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
        """Return the figures as text.

        Returns
        -------
        str
            A table, one line a figure, one column a name; below it, between which signals linear systems are compared, and
            which of them are unstable.
        """
        return "\n".join([table_text(self._table(), first=_SHOWN), *self._signals()])

    def _signals(self) -> list[str]:
        """Return between which signals the singular values and norms of each are, and which of them are unstable."""
        return [
            f"{name}: {between(part.input_labels, part.output_labels)}{'' if part.stable else ', unstable'}"
            for name, parts in self._parts.items()
            for part in parts
            if isinstance(part, SigmaResult)
        ]

    def to_dict(self) -> dict[str, dict[str, float]]:
        """Return the figures as plain dictionaries.

        Returns
        -------
        dict of str to dict of str to float
            For each name the figures that it has.
        """
        return {name: dict(figures) for name, figures in self.values.items()}

    def to_pandas(self) -> DataFrame:
        """Return the figures as a data frame of pandas.

        Returns
        -------
        pandas.DataFrame
            One row a figure, one column a name; NaN for what one lacks.
        """
        return data_frame(self.to_dict(), index=self.metrics)

    def plot(self, ax: Any = None, *, kind: str | None = None, signals: Sequence[str] = (), **style: Any) -> Any:
        """Draw all of them over each other, each in a color of its own.

        Parameters
        ----------
        ax : matplotlib Axes, sequence of them, or a figure, optional
            Where to draw: one axes a signal or loop, one for singular values; by default a new figure of pyplot.
        kind : {"time", "frequency", "margins"}, optional
            Signals over time, singular values, or Nyquist curves with the critical disks.  By default the first that all of
            them have.
        signals : sequence of str, optional
            Which signals over time, or at which the loop is opened; by default those that all have, six at most.
        **style
            Of all curves, as matplotlib's lines take it; a ``label`` stands before the names.

        Returns
        -------
        ndarray of matplotlib.axes.Axes
            Those drawn on.
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
    """Return figures of several loops, designs or runs side by side, to be printed as a table and drawn over each other.

    Parameters
    ----------
    results : mapping of str to system or result, or to a sequence of these
        By name: simulated loops (rms and peak of outputs and of controls), other runs, linear systems such as closed loops
        (verified peak, H2 norm, slowest pole, least damping; of a boom model from platform actuators to tips), designs (of
        their closed loops, and the controller's states), margins, worst cases, sprays, slews, performances.  A sequence
        gives all figures of its members.
    omega : array_like, optional
        Angular frequencies at which linear systems are drawn [rad/s]; by default those that show the peaks of all.
    inputs, outputs : str or sequence of str, optional
        Between which signals of linear systems; by default all, of a boom model platform actuators and tips.

    Returns
    -------
    Comparison
        ``comparison["name"]["figure"]``; ``print`` shows a table, ``.plot()`` a picture, ``.to_pandas()`` gives all numbers.

    Raises
    ------
    TypeError, ValueError
        Nothing to compare; something that has no figures, with its name; unknown kinds of system.

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
    systems: dict[tuple[str, int], SelectedSystem] = {}  # those that give no figures themselves, by their places
    for name, given in results.items():
        if not isinstance(name, str):
            raise TypeError(f"name of a result = {shown(name)}: expected a string, got {type(name).__name__}")
        parts[name] = tuple(given) if isinstance(given, list | tuple) else (given,)
        if not parts[name]:
            raise ValueError(f"results[{name!r}]: expected at least one")
        for k, member in enumerate(parts[name]):
            if not hasattr(type(member), "__figures__"):
                with naming(f"results[{name!r}]"):
                    chosen = between_signals(looked_at(member), inputs, outputs, EXPECTED)
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
    """Check that signals of one name have one scale in all systems."""
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


def _of_system(given: Any, selected: SelectedSystem, curve: SigmaResult) -> dict[str, float]:
    """Return what a linear system has to show."""
    figures = {"H-infinity norm" + ("" if curve.verified else ", not verified"): curve.peak}
    figures["H2 norm"] = h2_norm(selected.chosen).value
    rates = matrices(selected.chosen).rates
    rates = rates[np.isfinite(rates)]
    if len(rates):
        figures["slowest pole [rad/s]"] = float(rates.real.max())
    turning = rates[resolved(rates) & (rates.imag > 0.0)]
    if len(turning):
        figures["least damping [%]"] = float(100.0 * (-turning.real / np.abs(turning)).min())
    controller = getattr(given, "_controller", None)
    if isinstance(controller, Lti):
        figures["states of the controller"] = float(len(controller.A))
    return figures


def _of_kind(kind: str, parts: tuple[Any, ...]) -> Any:
    """Return the first part that a picture of a kind is drawn of; None without one."""
    for part in parts:
        run = getattr(part, "run", part)
        if kind == TIME and isinstance(run, TimeSeries):
            return {**run._outputs(), **run._inputs()}, run.time
        if kind == FREQUENCY and hasattr(part, "sigma"):
            return part if hasattr(part, "omega") else part.sigma
        if kind == MARGINS and isinstance(part, Margins):
            return part
    return None
