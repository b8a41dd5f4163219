"""Size and phase of each response over frequency, on a grid that has every peak."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from importlib import import_module
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from boomctl.analysis.looking.given import looked_at
from boomctl.analysis.sigma import NO_SINES, SelectedSystem, beside_undamped, drawn_grid, finite
from boomctl.arrays import Array
from boomctl.checks import known
from boomctl.lti.frequency import ABOVE, with_peaks
from boomctl.printing import between
from boomctl.threads import one_blas_thread

if TYPE_CHECKING:
    import control

    from boomctl.structure.model import SecondOrderModel


@dataclass(frozen=True)
class BodeResult:
    """Frequency responses, size and phase.

    Attributes
    ----------
    omega : (n,) ndarray
        Angular frequencies [rad/s].
    frdata : (p, m, n) complex ndarray
        Responses: outputs by inputs by frequencies.
    input_labels, output_labels : tuple of str
        Names of the signals.
    frequency_unit : str
        Unit in which the frequencies were asked for, "Hz" where none were; pictures use it.
    """

    omega: Array
    frdata: Array = field(repr=False)
    input_labels: tuple[str, ...]
    output_labels: tuple[str, ...]
    frequency_unit: str = "Hz"
    _of: SelectedSystem | None = field(default=None, repr=False, compare=False)

    def __repr__(self) -> str:
        span = f"{len(self.omega)} frequencies, {self.omega[0]:.4g} to {self.omega[-1]:.4g} rad/s"
        o, i, k = np.unravel_index(int(np.abs(self.frdata).argmax()), self.frdata.shape)
        at = f"{self.omega[k]:.6g} rad/s, {self.input_labels[i]} -> {self.output_labels[o]}"
        peak = f"{abs(self.frdata[o, i, k]):.6g} at {at}"
        span += f"\n  {NO_SINES}" if self._unstable else ""
        return f"BodeResult: {between(self.input_labels, self.output_labels)}\n  {span}\n  largest {peak}"

    @property
    def _unstable(self) -> bool | None:
        """Whether the system has an unstable pole; None where that is not known."""
        return None if self._of is None else self._of.unstable

    def __getitem__(self, pair: tuple[str, str]) -> Array:
        """Return the complex response of an output to an input: ``result["output", "input"]``."""
        if not isinstance(pair, tuple) or len(pair) != 2:
            raise ValueError(f"{pair!r}: expected an output and an input, as result['output', 'input']")
        output, given = known("output", pair[0], self.output_labels), known("input", pair[1], self.input_labels)
        return self.frdata[self.output_labels.index(output), self.input_labels.index(given)]

    def _ipython_key_completions_(self) -> list[tuple[str, str]]:
        """Return the pairs that consoles complete in brackets."""
        return [(output, given) for output in self.output_labels for given in self.input_labels]

    @property
    def magnitude(self) -> Array:
        """Sizes, shape (outputs, inputs, frequencies)."""
        return np.abs(self.frdata)

    @property
    def phase_deg(self) -> Array:
        """Phases [degrees], without jumps, the first from -180 to 180."""
        return np.degrees(np.unwrap(np.angle(self.frdata), axis=2))

    @property
    def frequency_hz(self) -> Array:
        """The frequencies of ``omega`` in Hz."""
        return self.omega / (2.0 * np.pi)

    @property
    def response(self) -> control.FrequencyResponseData:
        """The same as python-control's named frequency response, whose ``.plot()`` draws it as python-control does."""
        from boomctl.lti.python_control import control

        labels = {"inputs": list(self.input_labels), "outputs": list(self.output_labels)}
        return control.frd(self.frdata, self.omega, **labels, name="response")

    def plot(self, ax: Any = None, *, frequency_unit: str | None = None, **style: Any) -> Array:
        """Draw sizes above phases, one curve for each pair of signals.

        Parameters
        ----------
        ax : sequence of matplotlib Axes, or a figure, optional
            Where to draw: size and phase; by default a new figure of pyplot.
        frequency_unit : {"Hz", "rad/s"}, optional
            Of the frequency axis.  By default that of the curves that are there already, otherwise that in which the
            frequencies were asked for.
        **style
            Of the curves, as matplotlib's lines take it; a ``label`` stands before their names.

        Returns
        -------
        ndarray of matplotlib.axes.Axes
            Those drawn on, in the order in which ``ax`` names them.
        """
        return import_module("boomctl.plotting.looking").plot_bode(self, ax, frequency_unit=frequency_unit, **style)


@one_blas_thread
def bode(
    system: SecondOrderModel | control.StateSpace | control.TransferFunction | Any,
    omega: ArrayLike | None = None,
    inputs: str | Sequence[str] | None = None,
    outputs: str | Sequence[str] | None = None,
    *,
    frequency_hz: ArrayLike | None = None,
) -> BodeResult:
    """Return size and phase of a system's responses over frequency.

    It has the short name that python-control gives to its ``bode_plot``.  The default grid has every peak of every response
    in its band, and the band has the highest peak: the largest value is that of the response, not of a grid beside it.
    Undamped modes, where the response is infinite, are left out.

    Parameters
    ----------
    system : SecondOrderModel, control.StateSpace, TransferFunction or FrequencyResponseData, or a result
        What is looked at.  Of a design (``lqr``, ``lqg``, ``h2``, ``h_infinity``) it is the closed loop; of a reduction the
        reduced system.
    omega : array_like, optional
        Angular frequencies [rad/s], of a discrete system at most ``pi/dt``.
    inputs, outputs : str or sequence of str, optional
        Between which signals.  By default all; of a boom model, platform actuators and tips.
    frequency_hz : array_like, optional
        Frequencies in Hz, in place of ``omega``.

    Returns
    -------
    BodeResult
        Frequencies and complex responses; ``.plot()`` draws them, ``.response`` is python-control's.

    Raises
    ------
    TypeError, ValueError
        Another kind of system; unknown signals; frequencies above half the sampling rate, negative or not finite, given
        twice, or given for measured data; a frequency at which the response is infinite.

    Examples
    --------
    >>> import boomctl as bc
    >>> found = bc.bode(bc.spray_boom(), inputs="actuator_left", outputs="tip_left")
    >>> round(float(found.magnitude.max())), round(bc.sigma(bc.spray_boom(), None, "actuator_left", "tip_left").peak)
    (1236, 1236)
    """
    selected = SelectedSystem.of(looked_at(system), omega, frequency_hz, inputs, outputs)
    grid = selected.omega
    if grid is not None:
        values = selected.response(grid)
    else:
        band, peak = selected.resonances(), selected.norm.peak_omega
        if band.high < ABOVE * peak < np.inf:
            band = selected.resonances(ABOVE * peak)
        grid, values = with_peaks(
            lambda w: selected.response(w, quiet=True), drawn_grid(band, [peak]), lambda w: beside_undamped(band, w)
        )
    return BodeResult(grid, finite(grid, values), *selected.labels, selected.unit, selected)
