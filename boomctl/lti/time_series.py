"""Base class of all results over time: signals by name, and conversion to python-control's time response."""

from __future__ import annotations

from collections.abc import Mapping
from importlib import import_module
from typing import TYPE_CHECKING, Any

import numpy as np

from boomctl.arrays import Array
from boomctl.checks import known
from boomctl.printing import DataFrame, data_frame

if TYPE_CHECKING:
    import control


class TimeSeries:
    """Signals over one time axis.

    Attributes
    ----------
    time : (n,) ndarray
        Times [s].
    """

    time: Array

    def _outputs(self) -> Mapping[str, Array]:
        """Return the outputs by name."""
        raise NotImplementedError

    def _inputs(self) -> Mapping[str, Array]:
        """Return the inputs by name."""
        return {}

    def _columns(self) -> Mapping[str, Array]:
        """Return the columns of its table, by name."""
        return {**self._inputs(), **self._outputs()}

    def __getitem__(self, name: str) -> Array:
        """Return a signal by name."""
        there = {**self._inputs(), **self._outputs()}
        return there[known("signal", name, tuple(there))]

    def _ipython_key_completions_(self) -> list[str]:
        """Return the names that consoles complete in brackets."""
        return [*self._inputs(), *self._outputs()]

    @property
    def response(self) -> control.TimeResponseData:
        """Named time response of python-control with the same data."""
        from boomctl.lti.python_control import control

        outputs, inputs, count = self._outputs(), self._inputs(), len(self.time)
        return control.TimeResponseData(
            self.time,
            np.array(list(outputs.values())).reshape(-1, count),
            inputs=np.array(list(inputs.values())).reshape(-1, count) if inputs else None,
            output_labels=list(outputs),
            input_labels=list(inputs) if inputs else None,
            issiso=False,
            sysname=type(self).__name__,
        )

    def to_pandas(self) -> DataFrame:
        """Return the signals as a data frame of pandas.

        Returns
        -------
        pandas.DataFrame
            One row per time [s] and one column per signal, for loops also commanded signals; known units are in
            ``attrs["units"]``.
        """
        return data_frame(self._columns(), "time [s]", getattr(self, "units", None), index=self.time)

    def plot(self, ax: Any = None, **style: Any) -> Array:
        """Draw each signal over time.

        Parameters
        ----------
        ax : sequence of matplotlib Axes, or a figure, optional
            One axes per signal.  If None, a new figure is created.
        **style
            Line properties, passed to `matplotlib.axes.Axes.plot`.

        Returns
        -------
        ndarray of matplotlib.axes.Axes
            The axes.
        """
        drawn = {getattr(self, "name", type(self).__name__): ({**self._outputs(), **self._inputs()}, self.time)}
        return import_module("boomctl.plotting.looking").plot_comparison("time", drawn, ax, **style)
