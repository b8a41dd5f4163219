"""The result of a sweep: a table of points and of the values of the function there, with units."""

from __future__ import annotations

from dataclasses import dataclass
from importlib import import_module
from typing import TYPE_CHECKING, Any

import numpy as np

from boomctl.arrays import Array
from boomctl.checks import known
from boomctl.printing import LINES, WIDTH, DataFrame, compact, count, data_frame, listed, value

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Label = bool | int | float | str | None
"""The name of a parameter's value: the value itself if it is a number or a string."""


@dataclass(frozen=True)
class FailedPoint:
    """A point at which the function failed.

    Attributes
    ----------
    point : dict
        Its parameters.
    error : str
        The exception in one line.
    trace : str
        The calls that led to it.
    """

    point: dict[str, Label]
    error: str
    trace: str

    __repr__ = compact

    @property
    def text(self) -> str:
        """Point and error in one line."""
        return f"{', '.join(f'{name} = {value(label)}' for name, label in self.point.items())}: {self.error}"


@dataclass(frozen=True, eq=False)
class SweepResult:
    """The values of a function at many points.

    Attributes
    ----------
    labels : dict of str to tuple
        The values of each parameter: numbers and names.
    swept : tuple of str
        The parameters with several values, or with a sequence of one.
    shape : tuple of int
        Number of values of each swept parameter; zipped, the number of points.
    points : tuple of dict
        The parameters of each point, in order; of a grid the last parameter varies fastest.
    values : tuple of dict or None
        Results of the function at each point, by name; ``value`` if it returns no mapping.  None if it failed.
    failures : tuple of FailedPoint
        The points at which it failed.
    elapsed : (n,) ndarray
        Run time of each point [s].
    units : dict of str to str
        Units of parameters and results.
    resumed : int
        Number of points that a checkpoint held.
    """

    labels: dict[str, tuple[Label, ...]]
    swept: tuple[str, ...]
    shape: tuple[int, ...]
    points: tuple[dict[str, Label], ...]
    values: tuple[dict[str, Any] | None, ...]
    failures: tuple[FailedPoint, ...]
    elapsed: Array
    units: dict[str, str]
    resumed: int

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of the results of the function."""
        return tuple(dict.fromkeys(name for result in self.values if result is not None for name in result))

    @property
    def table(self) -> list[dict[str, Any]]:
        """One row for each point: its parameters and results; None where the function failed."""
        for name in self.columns:
            if name in self.labels:
                raise ValueError(f"`function` must return names that are not swept, got {name!r}. Rename that result.")
        empty = dict.fromkeys(self.columns)
        return [{**point, **empty, **(result or {})} for point, result in zip(self.points, self.values, strict=True)]

    def __len__(self) -> int:
        return len(self.points)

    def __getitem__(self, name: str) -> Array:
        """Return one result at all points, in the shape of the grid; its own dimensions, if it is an array, come last.

        Entries are NaN (None if not a number) where the function failed.
        """
        known("column", name, self.columns)
        cells = [None if result is None else result.get(name) for result in self.values]
        numbers = [np.asarray(cell) for cell in cells if isinstance(cell, (bool, int, float, complex, np.ndarray))]
        alike = len(numbers) == sum(cell is not None for cell in cells) and len({cell.shape for cell in numbers}) == 1
        if not alike or any(cell.dtype.kind not in "biufc" for cell in numbers):
            return np.fromiter(cells, object, len(cells)).reshape(self.shape)
        missing = np.full(numbers[0].shape, np.nan)
        return np.array([missing if cell is None else cell for cell in cells]).reshape(self.shape + missing.shape)

    def _ipython_key_completions_(self) -> list[str]:
        """Return the names that consoles complete in brackets."""
        return list(self.columns)

    def to_pandas(self) -> DataFrame:
        """Return the table as a data frame of pandas, one row for each point; units in its ``attrs["units"]``.

        Returns
        -------
        pandas.DataFrame
            Columns as of ``table``; missing where the function failed.

        Raises
        ------
        ImportError
            pandas is not installed.
        ValueError
            A result is called as a parameter.
        """
        return data_frame(self.table, units=self.units, columns=[*self.labels, *self.columns])

    def plot(
        self, ax: Axes | None = None, *, column: str | None = None, against: str | None = None, **style: Any
    ) -> Axes:
        """Draw a number over a swept parameter: all points, and a line through them.

        Where there are several points at a value, the line is their median, and the title names the other parameters.

        Parameters
        ----------
        ax : matplotlib Axes, optional
            Axes to draw on. If None, a new figure is created.
        column : str, optional
            Name of the result; by default the first that is a number.
        against : str, optional
            Over which parameter; by default the first that is swept and a number.  Each value of another one has a color
            and a line of its own: the first that holds names, otherwise the next number but a ``seed``.
        **style
            Of the lines, as matplotlib takes it.

        Returns
        -------
        matplotlib.axes.Axes
            The axes.

        Raises
        ------
        ValueError
            If there is no such result or parameter, or it is not numeric.
        """
        return import_module("boomctl.plotting.sweep").plot_sweep(self, ax, column=column, against=against, **style)

    def __repr__(self) -> str:
        axes = [f"{count(len(self.labels[name]), 'value')} of {name}" for name in self.swept]
        lines = [f"SweepResult: {count(len(self), 'point')}, {', '.join(axes) or 'no parameter varies'}"]
        lines.append(f"  {listed([f'{name} {value(self[name])}' for name in self.columns], WIDTH - 2)}")
        lines += [f"  {len(self.failures)} failed: {failure.text}" for failure in self.failures[:1]]
        resumed = f", {self.resumed} points from the checkpoint" if self.resumed else ""
        lines.append(f"  {self.elapsed.sum():.3g} s of computing{resumed}")
        return "\n".join(line if len(line) <= WIDTH else line[: WIDTH - 3] + "..." for line in lines[:LINES])
