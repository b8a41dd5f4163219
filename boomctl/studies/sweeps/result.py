"""The result of a sweep: a table of points and of what was found there, with units."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib import import_module
from typing import TYPE_CHECKING, Any

import numpy as np

from boomctl.arrays import Array
from boomctl.checks import known, mapping, sequence
from boomctl.printing import LINES, WIDTH, compact, count, listed, table_html, value
from boomctl.studies.sweeps.points import GRID, Label

if TYPE_CHECKING:
    import pandas  # type: ignore[import-not-found]
    import xarray  # type: ignore[import-not-found]
    from matplotlib.axes import Axes

_HTML_ROWS = 20  # of a table in a notebook
_POINT = "point"  # dimension of values that are zipped


@dataclass(frozen=True)
class FailedPoint:
    """A point at which the function failed.

    Attributes
    ----------
    point : dict
        Its parameters.
    error : str
        What was raised, in one line.
    trace : str
        The calls that led there.
    """

    point: dict[str, Label]
    error: str
    trace: str

    __repr__ = compact

    @property
    def text(self) -> str:
        """Point and error in one line."""
        return f"{_called(self.point)}: {self.error}"


@dataclass(frozen=True, eq=False)
class SweepResult:
    """What a function answered at many points.

    Attributes
    ----------
    labels : dict of str to tuple
        The values of each parameter: numbers and words.
    fixed : tuple of str
        Parameters that have one value at all points.
    combine : str
        "grid" or "zip".
    points : tuple of dict
        The parameters of each point, in order; of a grid the last parameter runs fastest.
    values : tuple of dict or None
        What the function answered at each point, by name; what is no mapping is called ``value``.  None where it failed.
    failures : tuple of FailedPoint
        Where it failed, and by what.
    seconds : (n,) ndarray
        How long each point took [s].
    units : dict of str to str
        Units of parameters and answers.
    dims : dict of str to tuple of str
        Names of the own dimensions of answers that are arrays, where a study says them.
    resumed : int
        Number of points that a checkpoint held.
    """

    labels: dict[str, tuple[Label, ...]]
    fixed: tuple[str, ...]
    combine: str
    points: tuple[dict[str, Label], ...]
    values: tuple[dict[str, Any] | None, ...]
    failures: tuple[FailedPoint, ...]
    seconds: Array
    units: dict[str, str]
    dims: dict[str, tuple[str, ...]]
    resumed: int

    @property
    def swept(self) -> tuple[str, ...]:
        """The parameters that have more than one value, or a row of one."""
        return tuple(name for name in self.labels if name not in self.fixed)

    @property
    def shape(self) -> tuple[int, ...]:
        """How many values each swept parameter has; zipped, how many points there are."""
        return tuple(len(self.labels[name]) for name in self.swept) if self.combine == GRID else (len(self.points),)

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of what the function answered."""
        return tuple(dict.fromkeys(name for found in self.values if found is not None for name in found))

    @property
    def table(self) -> list[dict[str, Any]]:
        """One row a point: its parameters and what was found there; None where the function failed."""
        empty = dict.fromkeys(self.columns)
        for name in empty:
            if name in self.labels:
                raise ValueError(f"the function answers {name!r}, which is swept; expected another name for the answer")
        return [
            {**point, **empty, **({} if found is None else found)}
            for point, found in zip(self.points, self.values, strict=True)
        ]

    def __len__(self) -> int:
        return len(self.points)

    def __getitem__(self, name: str) -> Array:
        """Return one answer at all points, in the shape of the grid; its own dimensions, if it is an array, come last.

        Where the function failed stands NaN (None for what is no number).
        """
        known("column", name, self.columns)
        found = [None if row is None else row.get(name) for row in self.values]
        numbers = [np.asarray(cell) for cell in found if isinstance(cell, (bool, int, float, complex, np.ndarray))]
        alike = len(numbers) == sum(cell is not None for cell in found) and len({cell.shape for cell in numbers}) == 1
        if not alike or any(cell.dtype.kind not in "biufc" for cell in numbers):
            values = np.empty(len(found), dtype=object)
            values[:] = found
            return values.reshape(self.shape)
        missing = np.full(numbers[0].shape, np.nan)
        return np.array([missing if cell is None else cell for cell in found]).reshape(self.shape + missing.shape)

    def _ipython_key_completions_(self) -> list[str]:
        """Return the names that consoles complete in brackets."""
        return list(self.columns)

    def to_pandas(self) -> pandas.DataFrame:
        """Return the table as a data frame of pandas, one row a point; units in its ``attrs["units"]``.

        Returns
        -------
        pandas.DataFrame
            Columns as of ``table``; missing where the function failed.

        Raises
        ------
        ImportError
            pandas is not installed.
        ValueError
            An answer is called as a parameter.
        """
        pd = _imported("pandas")
        frame = pd.DataFrame(self.table, columns=[*self.labels, *self.columns])
        frame.attrs["units"] = dict(self.units)
        return frame

    def to_xarray(self, dims: Mapping[str, Sequence[str]] | None = None) -> xarray.Dataset:
        """Return the answers as a data set of xarray over the swept parameters; units in each one's ``attrs``.

        Parameters
        ----------
        dims : mapping of str to sequence of str, optional
            Names of the own dimensions of answers that are arrays, by default those that a study gives, or
            ``NAME_0``, ``NAME_1``, and so on.  An answer that is named as its only dimension and is the same at all points
            becomes its coordinate.

        Returns
        -------
        xarray.Dataset
            Parameters with one value stand in its ``attrs``.

        Raises
        ------
        ImportError
            xarray is not installed.
        TypeError, ValueError
            Dimensions of what is no answer, or not as many as it has; an answer is called as a parameter.
        """
        xr = _imported("xarray")
        asked = {} if dims is None else mapping("dims", dims, "answers to names of dimensions")
        for name in asked:
            known("column", name, self.columns)
        given = {**self.dims, **{name: sequence(f"dims[{name!r}]", own, "names") for name, own in asked.items()}}
        outer = self.swept if self.combine == GRID else (_POINT,)
        coordinates: dict[str, Any] = {
            name: ((name if self.combine == GRID else _POINT,), _labels(self.labels[name]), self._unit(name))
            for name in self.swept
        }
        answers: dict[str, Any] = {}
        _ = self.table  # refuses an answer that is called as a parameter
        for name in self.columns:
            cells = self[name]
            own = tuple(given.get(name, [f"{name}_{k}" for k in range(cells.ndim - len(self.shape))]))
            if len(own) != cells.ndim - len(self.shape):
                raise ValueError(f"dims[{name!r}] = {own}: expected {cells.ndim - len(self.shape)} names")
            flat = cells.reshape(-1, *cells.shape[len(self.shape) :])
            if own == (name,) and (flat == flat[0]).all():
                coordinates[name] = (own, flat[0], self._unit(name))
            else:
                answers[name] = (outer + own, cells, self._unit(name))
        return xr.Dataset(answers, coordinates, attrs={name: self.labels[name][0] for name in self.fixed})

    def plot(
        self, ax: Axes | None = None, *, column: str | None = None, against: str | None = None, **style: Any
    ) -> Axes:
        """Draw a number over a swept parameter: all points, and a line through them.

        Where there are several points at a value, the line is their median, and the picture says over which parameters.

        Parameters
        ----------
        ax : matplotlib Axes, optional
            Where to draw; by default a new figure of pyplot.
        column : str, optional
            Which answer; by default the first that is a number.
        against : str, optional
            Over which parameter; by default the first that is swept and a number.  Each value of another one has a colour
            and a line of its own: the first that holds words, otherwise the next number but a ``seed``.
        **style
            Of the lines, as matplotlib takes it.

        Returns
        -------
        matplotlib.axes.Axes
            Those drawn on.

        Raises
        ------
        ValueError
            No such answer or parameter, or no numbers.
        """
        return import_module("boomctl.plotting.sweep").plot_sweep(self, ax, column=column, against=against, **style)

    def _unit(self, name: str) -> dict[str, str]:
        return {"units": self.units[name]} if self.units.get(name) else {}

    def _ranges(self) -> list[str]:
        """Return each answer with its range, or what it is, in words."""
        told = []
        for name in self.columns:
            cells, unit = self[name], f" [{self.units[name]}]" if self.units.get(name) else ""
            finite = cells[np.isfinite(cells)] if cells.dtype.kind in "if" else cells[:0]
            if finite.size and cells.ndim == len(self.shape):
                told.append(f"{name}{unit} {finite.min():.4g} to {finite.max():.4g}")
            else:
                told.append(f"{name}{unit} ({' x '.join(map(str, cells.shape[len(self.shape) :])) or cells.dtype})")
        return told

    def __repr__(self) -> str:
        axes = [f"{count(len(self.labels[name]), 'value')} of {name}" for name in self.swept]
        how = (" x " if self.combine == GRID else ", ").join(axes) or "no parameter varies"
        lines = [f"SweepResult: {count(len(self.points), 'point')} ({how})", f"  {listed(self._ranges(), WIDTH - 2)}"]
        lines += [f"  {len(self.failures)} failed: {failure.text}" for failure in self.failures[:1]]
        resumed = f", {self.resumed} of them from the checkpoint" if self.resumed else ""
        lines.append(f"  {self.seconds.sum():.3g} s of computing{resumed}")
        return "\n".join(line if len(line) <= WIDTH else line[: WIDTH - 3] + "..." for line in lines[:LINES])

    def _repr_html_(self) -> str:
        rows = [[value(cell) for cell in row.values()] for row in self.table[:_HTML_ROWS]]
        more = f", the first {_HTML_ROWS} of {count(len(self.points), 'point')}" if len(self.points) > len(rows) else ""
        names = [
            f"{name} [{self.units[name]}]" if self.units.get(name) else name for name in (*self.labels, *self.columns)
        ]
        return table_html(f"SweepResult{more}, {len(self.failures)} failed", names, rows)


def _called(point: Mapping[str, Label]) -> str:
    return ", ".join(f"{name} = {value(label)}" for name, label in point.items())


def _labels(labels: Sequence[Label]) -> Array:
    found = np.array(labels)
    return (
        found
        if found.dtype.kind in "biufU" and len({type(label) for label in labels}) == 1
        else np.array(labels, object)
    )


def _imported(name: str) -> Any:
    try:
        return import_module(name)
    except ImportError:
        raise ImportError(f"{name} is not installed: pip install 'boomctl[tables]'") from None
