"""Results of a simulated loop."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from importlib import import_module
from typing import Any

import numpy as np

from boomctl.arrays import Array
from boomctl.lti.modal import sides
from boomctl.lti.time_series import TimeSeries
from boomctl.printing import count, listed
from boomctl.simulation.contact.stops import StopContact


@dataclass(frozen=True)
class FrictionResult:
    """Friction in a simulated loop.

    Attributes
    ----------
    force : (n,) ndarray
        Mean friction force between each time and the previous one [N]; 0 at the first time.
    stick_fraction : float
        Fraction of the time spent sticking.
    dissipated_energy : float
        Energy dissipated by friction [J].
    force_input, slip_output : str
        Names of the force input through which friction acts, and of the slip.
    """

    force: Array = field(repr=False)
    stick_fraction: float
    dissipated_energy: float
    force_input: str
    slip_output: str

    def __repr__(self) -> str:
        stuck = f"stuck {100.0 * self.stick_fraction:.3g} % of the time"
        return f"FrictionResult: {stuck}, {self.dissipated_energy:.4g} J dissipated"


@dataclass(frozen=True)
class LoopResult(TimeSeries):
    """Time response of a closed loop.

    Attributes
    ----------
    time : (n,) ndarray
        Times [s].
    outputs : dict from name to (n,) ndarray
        Outputs of the plant.
    controls : dict from name to (n,) ndarray
        Controls that act on the plant just after each time, including the last; after limits and delay.
    commanded : dict from name to (n,) ndarray
        Commands of the controller at its latest sample, before the limits.
    disturbances : dict from name to (n,) ndarray
        Disturbances of the plant; inputs without disturbance are not listed.
    saturation_fraction, rate_limit_fraction : dict from name to float
        Fraction of the samples at which a control is at its limit, and at its rate limit.
    stop_contacts : tuple of StopContact
        Contacts with end stops, in order.
    friction : FrictionResult or None
        Friction; None if the plant has none.
    sample_time, delay : float
        Sampling time of the controller, and delay from a sample until its control acts [s].
    method : str
        Solution method: "blocks", "steps", "stops not reached" or "contacts", all exact between samples, or
        "exponential steps" for a hub-beam.
    error_estimate : float
        Estimated largest error, m.  For a hub-beam, of its tip displacement and its hub angle times the radius of the free
        end: the difference from the run with steps twice as long.  With friction, of the slip: from runs with fewer
        substeps, or with two instead of one.  0 for other linear plants.
    states : (n, states) ndarray or None
        States of a hub-beam, named as in ``to_nlsys()``; None for linear plants.
    units : dict from name to str
        Units of structural models' and hub-beams' signals; empty for a ``StateSpace``, which has no units.
    """

    _made_by = "simulate_loop(...)"

    time: Array
    outputs: dict[str, Array] = field(repr=False)
    controls: dict[str, Array] = field(repr=False)
    commanded: dict[str, Array] = field(repr=False)
    disturbances: dict[str, Array] = field(repr=False)
    saturation_fraction: dict[str, float]
    rate_limit_fraction: dict[str, float]
    stop_contacts: tuple[StopContact, ...]
    friction: FrictionResult | None
    sample_time: float
    delay: float
    method: str = "steps"
    error_estimate: float = 0.0
    states: Array | None = field(default=None, repr=False)
    units: dict[str, str] = field(default_factory=dict, repr=False)
    _sampled: Array | None = field(
        default=None, repr=False, compare=False
    )  # the loop from sample to sample, no limit met

    def __repr__(self) -> str:
        span = f"{self.time[0]:.6g} to {self.time[-1]:.6g} s, {len(self.time)} samples"
        late = f", delay {self.delay:.4g} s" if self.delay else ""
        controls = f"controls {listed(list(self.controls), 50)}{late}" if self.controls else "no controller"
        limited = [f"{count(len(self.stop_contacts), 'hit')} of a stop"] if self.stop_contacts else []
        limited += [
            f"{name} at its limit {100.0 * fraction:.3g} % of the time"
            for name, fraction in self.saturation_fraction.items()
            if fraction
        ]
        if self.friction is not None:
            limited.append(f"stuck {100.0 * self.friction.stick_fraction:.3g} % of the time")
        last = f"\n  {listed(limited)}" if limited else ""
        last += "" if self.success else f"\n  {self.message}"
        known_error = self.states is not None or self.friction is not None
        last += f"\n  error estimated {self.error_estimate:.1e} m" if known_error else ""
        return f"LoopResult: {span}; {controls}\n  outputs: {listed(list(self.outputs))}{last}"

    @property
    def success(self) -> bool:
        """False if the loop of a linear plant is known to be unstable without limits and stops."""
        return self._sampled is None or not (sides(np.linalg.eigvals(self._sampled), self.sample_time) > 0).any()

    @property
    def message(self) -> str:
        """Statement in one sentence that the loop is unstable, or by which method it was run."""
        unstable = "unstable: the loop grows without bound, unless limits or stops hold it"
        return f"run to {self.time[-1]:.6g} s by {self.method}" if self.success else unstable

    @property
    def _strokes(self) -> dict[str, Array]:
        """Outputs named ``stroke_*``."""
        return {name: values for name, values in self.outputs.items() if name.startswith("stroke_")}

    def _outputs(self) -> dict[str, Array]:
        return self.outputs

    def _inputs(self) -> dict[str, Array]:
        """Return disturbances and controls, summed for inputs that have both."""
        moved = {name: np.zeros(len(self.time)) for name in (*self.disturbances, *self.controls)}
        for signals in (self.disturbances, self.controls):
            for name, values in signals.items():
                moved[name] = moved[name] + values
        return moved

    def _columns(self) -> dict[str, Array]:
        return {**self._inputs(), **{f"commanded_{k}": v for k, v in self.commanded.items()}, **self.outputs}

    def __figures__(self) -> dict[str, float]:
        """Return the values that a comparison shows."""
        result = {}
        for kind, signals in (("", self.outputs), ("control ", self.controls)):
            for name, values in signals.items():
                result[f"{kind}{name}: rms"] = float(np.sqrt(np.mean(values**2)))
                result[f"{kind}{name}: peak"] = float(np.abs(values).max())
        limited = {name: fraction for name, fraction in self.saturation_fraction.items() if fraction}
        result |= {f"control {name}: at its limit [%]": 100.0 * fraction for name, fraction in limited.items()}
        return result | ({"hits of stops": float(len(self.stop_contacts))} if self.stop_contacts else {})

    def plot(self, ax: Any = None, *, outputs: str | Sequence[str] | None = None, **style: Any) -> Array:
        """Draw outputs, commanded and applied controls, stops and friction over time.

        Parameters
        ----------
        ax : sequence of matplotlib Axes, or a figure, optional
            Axes for outputs, strokes, controls and friction, if any, one axes for each unit; by default a new figure of
            pyplot.
        outputs : str or sequence of str, optional
            Outputs to draw; by default the first six that are not strokes.
        **style
            Line properties of matplotlib; a ``label`` is prefixed to the curves' names.

        Returns
        -------
        ndarray of matplotlib.axes.Axes
            Axes drawn on, in the order of ``ax``.
        """
        return import_module("boomctl.plotting.loop").plot_loop(self, ax, outputs=outputs, **style)
