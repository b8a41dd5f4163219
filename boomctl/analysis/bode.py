"""Magnitude and phase of frequency responses, on a grid that includes every peak."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from importlib import import_module
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from boomctl.analysis.sigma import NO_SINES, SelectedSystem, drawn_grid, exclude_undamped, finite, looked_at
from boomctl.arrays import Array
from boomctl.checks import known
from boomctl.lti.frequency import ABOVE, with_peaks
from boomctl.printing import between
from boomctl.threads import one_blas_thread

if TYPE_CHECKING:
    import control

    from boomctl.structure.model import SecondOrderModel


@dataclass(frozen=True, eq=False)
class BodeResult:
    """Frequency responses as magnitude and phase.

    Attributes
    ----------
    omega : (n,) ndarray
        Angular frequencies [rad/s].
    frdata : (p, m, n) complex ndarray
        Responses: outputs by inputs by frequencies.
    input_labels, output_labels : tuple of str
        Names of the signals.
    frequency_unit : str
        Unit of the requested frequencies, "Hz" without any; used by plots.
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
        """True if the system has an unstable pole; None if unknown."""
        return None if self._of is None else self._of.unstable

    def __getitem__(self, pair: tuple[str, str]) -> Array:
        """Return the complex response of an output to an input: ``result["output", "input"]``."""
        if not isinstance(pair, tuple) or len(pair) != 2:
            raise ValueError(f"{pair!r}: expected an output and an input, as result['output', 'input']")
        output, entry = known("output", pair[0], self.output_labels), known("input", pair[1], self.input_labels)
        return self.frdata[self.output_labels.index(output), self.input_labels.index(entry)]

    def _ipython_key_completions_(self) -> list[tuple[str, str]]:
        """Return the pairs that consoles complete in brackets."""
        return [(output, entry) for output in self.output_labels for entry in self.input_labels]

    @property
    def magnitude(self) -> Array:
        """Magnitudes, shape (outputs, inputs, frequencies)."""
        return np.abs(self.frdata)

    @property
    def phase_deg(self) -> Array:
        """Phases [degrees], unwrapped, the first from -180 to 180."""
        return np.degrees(np.unwrap(np.angle(self.frdata), axis=2))

    @property
    def frequency_hz(self) -> Array:
        """The frequencies of ``omega`` in Hz."""
        return self.omega / (2.0 * np.pi)

    @property
    def response(self) -> control.FrequencyResponseData:
        """Frequency response of python-control with signal names; its ``.plot()`` is python-control's."""
        from boomctl.lti.python_control import control

        labels = {"inputs": list(self.input_labels), "outputs": list(self.output_labels)}
        return control.frd(self.frdata, self.omega, **labels, name="response")

    def plot(self, ax: Any = None, *, frequency_unit: str | None = None, **style: Any) -> Array:
        """Draw magnitudes above phases, one curve for each pair of signals.

        Parameters
        ----------
        ax : sequence of matplotlib Axes, or a figure, optional
            Axes for magnitude and phase. If None, a new figure is created.
        frequency_unit : {"Hz", "rad/s"}, optional
            Unit of the frequency axis.  If None, the unit of the existing axes, or of the requested frequencies.
        **style
            Line properties, passed to `matplotlib.axes.Axes.plot`; ``label`` is prefixed to the labels.

        Returns
        -------
        ndarray of matplotlib.axes.Axes
            The axes.
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
    """Return magnitude and phase of a system's frequency responses.

    The name is python-control's short name of ``bode_plot``.  The default grid includes every peak of every response in its
    range, and the range includes the highest peak, so that the largest value is the maximum of the response.
    Undamped modes, at which the response is infinite, are omitted.

    Parameters
    ----------
    system : SecondOrderModel, control.StateSpace, TransferFunction or FrequencyResponseData, or a result
        System to evaluate.  For a design (``lqr``, ``lqg``, ``h2``, ``h_infinity``) the closed loop, for a reduction the
        reduced system.
    omega : array_like, optional
        Angular frequencies [rad/s], at most ``pi/dt`` for a discrete system.
    inputs, outputs : str or sequence of str, optional
        Signals.  If None, all signals; for a boom model, platform actuators and tips.
    frequency_hz : array_like, optional
        Frequencies [Hz], instead of ``omega``.

    Returns
    -------
    BodeResult
        Frequencies and complex responses; ``.plot()`` draws them, ``.response`` is python-control's.

    Raises
    ------
    TypeError, ValueError
        If `system` has an unsupported type, a signal is unknown, a frequency is above half the sampling rate, negative or not
        finite, both `omega` and `frequency_hz` or frequencies of measured data are passed, or the response is infinite.

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
            lambda w: selected.response(w, quiet=True), drawn_grid(band, [peak]), lambda w: exclude_undamped(band, w)
        )
    return BodeResult(grid, finite(grid, values), *selected.labels, selected.unit, selected)
