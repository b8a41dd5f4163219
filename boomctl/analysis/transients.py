"""Step and impulse responses, exact at their time points, over a duration and with a step that resolve the modes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from importlib import import_module
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from boomctl.analysis.sigma import Signals, matrices
from boomctl.arrays import Array, blocks
from boomctl.checks import finite_array, known, no_signals, plain_array, positive
from boomctl.lti.hold import BLOCK, matrix_expm1, motion_coordinates, observability
from boomctl.lti.modal import partial_fractions, side_of_axis, sides
from boomctl.lti.rounding import ALIKE, ROOT
from boomctl.lti.system import Lti
from boomctl.printing import between
from boomctl.threads import one_blas_thread

if TYPE_CHECKING:
    import control

    from boomctl.structure.model import SecondOrderModel

_SETTLED = 5.0  # Default duration in time constants of the slowest mode: 1 % of the response remains.
_PERIODS = 30.0  # Largest default duration in periods of the slowest vibration: more periods are a filled band.
_EXPLODED = 7.0  # Default duration in time constants of the fastest unstable mode: a growth by a factor of 1000.
_PER_PERIOD = 20  # Time points per period of the fastest visible vibration.
_PER_CONSTANT = 10  # Time points per time constant of the fastest visible mode.
_VISIBLE = 1e-3  # Smallest contribution of a visible mode, relative to the largest modal contribution.
_GROWN = 2.0  # Growth of a stable system within the simulated time above which rounding error decides its response.
_FEWEST, _MOST = 200, 20_000  # Smallest and largest number of time points of a plot.
# Default duration with integrators: in time constants of the fastest other mode, or in seconds without one.
_LONG = 10.0


@dataclass(frozen=True, eq=False)
class TimeResponse:
    """Response of a system at rest to a step or an impulse of each input.

    Attributes
    ----------
    kind : str
        "step" or "impulse".
    time : (n,) ndarray
        Equally spaced time points from 0 [s].
    outputs : (p, m, n) ndarray
        Outputs by inputs by time points.
    input_labels, output_labels : tuple of str
        Names of the signals.
    dt : float
        Sampling time [s]; 0 for continuous time.
    """

    kind: str
    time: Array = field(repr=False)
    outputs: Array = field(repr=False)
    input_labels: tuple[str, ...]
    output_labels: tuple[str, ...]
    dt: float = 0.0
    _of: Lti | None = field(default=None, repr=False, compare=False)

    def __repr__(self) -> str:
        span = f"to {self.time[-1]:.6g} s, {len(self.time)} time points"
        o, i, k = np.unravel_index(int(np.abs(self.outputs).argmax()), self.outputs.shape)
        at = f"{self.outputs[o, i, k]:.6g} at {self.time[k]:.6g} s, {self.input_labels[i]} -> {self.output_labels[o]}"
        unstable = self._of is not None and (sides(self._of.poles, self._of.dt) > 0).any()
        grows = "\n  unstable: the response grows without bound" if unstable else ""
        return f"TimeResponse: {self.kind}, {between(self.input_labels, self.output_labels)}\n  {span}; largest {at}{grows}"

    def __getitem__(self, name: str | tuple[str, str]) -> Array:
        """Return an output over time by name; ``result["output", "input"]`` if there are several inputs."""
        output, entry = name if isinstance(name, tuple) and len(name) == 2 else (name, None)
        row = self.outputs[self.output_labels.index(known("output", output, self.output_labels))]
        if entry is None and len(self.input_labels) > 1:
            raise ValueError(f"{name!r}: expected an output and an input, as result['output', 'input']")
        return row[0] if entry is None else row[self.input_labels.index(known("input", entry, self.input_labels))]

    def _ipython_key_completions_(self) -> list[str] | list[tuple[str, str]]:
        """Return the names, or pairs, that consoles complete in brackets."""
        pairs = [(output, entry) for output in self.output_labels for entry in self.input_labels]
        return list(self.output_labels) if len(self.input_labels) == 1 else pairs

    @property
    def response(self) -> control.TimeResponseData:
        """Time response of python-control with signal names."""
        from boomctl.lti.python_control import control

        height = np.full(len(self.time), float(self.kind == "step"))
        if self.kind == "impulse" and self.dt:
            height[0] = 1.0 / self.dt
        return control.TimeResponseData(
            self.time,
            self.outputs,
            inputs=np.eye(len(self.input_labels))[:, :, None] * height,
            output_labels=list(self.output_labels),
            input_labels=list(self.input_labels),
            trace_labels=[f"From {name}" for name in self.input_labels],
            trace_types=[self.kind] * len(self.input_labels),
            issiso=False,
            sysname=self.kind,
            plot_inputs=False,
        )

    def plot(self, ax: Any = None, **style: Any) -> Array:
        """Draw the outputs over time, one panel for each output, one curve for each input.

        Parameters
        ----------
        ax : sequence of matplotlib Axes, or a figure, optional
            Axes to draw on, one for each output. If None, a new figure is created.
        **style
            Line properties, passed to `matplotlib.axes.Axes.plot`; ``label`` is prefixed to the labels.

        Returns
        -------
        ndarray of matplotlib.axes.Axes
            The axes.
        """
        return import_module("boomctl.plotting.looking").plot_transient(self, ax, **style)


@one_blas_thread
def step(
    system: SecondOrderModel | control.StateSpace | control.TransferFunction | Any,
    timepts: ArrayLike | float | None = None,
    inputs: str | Sequence[str] | None = None,
    outputs: str | Sequence[str] | None = None,
) -> TimeResponse:
    """Return the response of a system at rest to a unit step of each input.

    Parameters
    ----------
    system : SecondOrderModel, control.StateSpace or TransferFunction, or a result
        System to evaluate.  For a design (``lqr``, ``lqg``, ``h2``, ``h_infinity``) the closed loop, for a reduction the
        reduced system.
    timepts : array_like or float, optional
        Equally spaced time points from 0, or the last time point [s].  If None, until the slowest mode has settled, but at
        most 30 of the slowest periods, in steps that resolve the fastest visible mode.
    inputs, outputs : str or sequence of str, optional
        Signals.  If None, all signals; for a boom model, platform actuators and tips.

    Returns
    -------
    TimeResponse
        Exact at these time points except for rounding error; ``.plot()`` draws it, ``.response`` is python-control's.

    Raises
    ------
    TypeError, ValueError
        If `system` has an unsupported type, a signal is unknown, the time points are not equally spaced from 0, or the
        outputs of an unstable system overflow.
    ArithmeticError
        If the response of a stable system would grow by rounding error of its entries.

    Examples
    --------
    >>> import boomctl as bc
    >>> import control
    >>> oscillator = control.ss([[0.0, 1.0], [-1.0, -0.1]], [[0.0], [1.0]], [[1.0, 0.0]], 0.0, outputs="position")
    >>> round(float(bc.step(oscillator)["position"].max()), 2)
    1.85
    """
    return _moved("step", system, timepts, inputs, outputs)


@one_blas_thread
def impulse(
    system: SecondOrderModel | control.StateSpace | control.TransferFunction | Any,
    timepts: ArrayLike | float | None = None,
    inputs: str | Sequence[str] | None = None,
    outputs: str | Sequence[str] | None = None,
) -> TimeResponse:
    """Return the response of a system at rest to a unit impulse of each input.

    The impulse that a feedthrough ``D`` adds is not among the values, as in python-control.  In discrete time the input is
    ``1/dt`` at the first sample, so that its area is also one.

    Parameters
    ----------
    system, timepts, inputs, outputs
        See :func:`step`.

    Returns
    -------
    TimeResponse
        Exact at these time points except for rounding error; ``.plot()`` draws it, ``.response`` is python-control's.

    Raises
    ------
    TypeError, ValueError, ArithmeticError
        As in :func:`step`.

    Examples
    --------
    >>> import boomctl as bc
    >>> import control
    >>> oscillator = control.ss([[0.0, 1.0], [-1.0, -0.1]], [[0.0], [1.0]], [[1.0, 0.0]], 0.0, outputs="position")
    >>> round(float(bc.impulse(oscillator)["position"].max()), 2)
    0.93
    """
    return _moved("impulse", system, timepts, inputs, outputs)


def _moved(
    kind: str, system: object, timepts: ArrayLike | float | None, inputs: Signals, outputs: Signals
) -> TimeResponse:
    """Compute the free motion of a system whose inputs are also states: constant, or zero after one sample."""
    plain = matrices(system, inputs, outputs)
    L = plain if plain.dt else motion_coordinates(plain)[0]
    time = _time_points(plain, timepts)
    (n, m), count, unit = L.B.shape, len(time), np.eye(L.B.shape[1])
    is_step, at_once = kind == "step", kind == "impulse" and not L.dt
    A = blocks([[L.A, L.B], [np.zeros((m, n)), unit if is_step and L.dt else 0.0 * unit]])
    X = np.vstack([L.B * at_once, unit * (1.0 if is_step else 0.0 if at_once else 1.0 / L.dt)])
    with np.errstate(over="ignore", invalid="ignore"):
        Phi = A if L.dt else np.eye(n + m) + matrix_expm1(A * (time[1] - time[0]))
        radius = np.abs(np.linalg.eigvals(Phi[:n, :n])).max(initial=0.0) if np.isfinite(Phi).all() else np.inf
        if radius**count > _GROWN and (sides(plain.poles, plain.dt) < 0).all():
            raise ArithmeticError(
                "system: rounding of its entries makes its response grow although all poles are stable. Use another"
                " realization, such as a modal one."
            )
        rows, power = observability(Phi, np.hstack([L.C, L.D]), min(BLOCK, count))
        parts = []
        for _ in range(-(-count // len(rows))):
            parts.append(rows @ X)
            X = power @ X
        values = np.concatenate(parts)[:count].transpose(1, 2, 0)
    if not np.isfinite(values).all():
        raise ValueError(f"system: its outputs overflow within {time[-1]:g} s; it is unstable")
    return TimeResponse(kind, time, values, plain.input_labels, plain.output_labels, plain.dt, plain)


def _time_points(system: Lti, timepts: ArrayLike | float | None) -> Array:
    """Return equally spaced time points from 0, as requested or by default."""
    no_signals("timepts", timepts, "time points [s]")
    if timepts is None or plain_array("timepts", timepts).ndim == 0:
        span, width = _shown(system)
        span = span if timepts is None else positive("timepts", timepts)
        if system.dt:
            return system.dt * np.arange(max(2, 1 + min(int(np.ceil(span / system.dt - ALIKE)), _MOST)))
        return np.linspace(0.0, span, 1 + int(np.clip(np.ceil(span / width - ALIKE), _FEWEST, _MOST)))
    time = finite_array("timepts", timepts, ndim=1)
    if len(time) < 2 or time[0] != 0.0:
        raise ValueError("timepts: expected two time points or more, from 0 on")
    width = time[-1] / (len(time) - 1)
    if not width > 0.0 or np.abs(time - width * np.arange(len(time))).max() > ALIKE * time[-1]:
        raise ValueError("timepts: expected time points in equal steps")
    if system.dt and abs(width - system.dt) > ALIKE * system.dt * len(time):
        raise ValueError(f"timepts: expected steps of the sampling time, {system.dt:g} s, got {width:g} s")
    return time


def _shown(system: Lti) -> tuple[float, float]:
    """Return the default duration of a response, and a step that resolves its fastest part [s]."""
    rates = _visible_rates(system)
    if not len(rates):
        return _LONG, _LONG / _FEWEST
    side, vibrating = side_of_axis(rates), np.abs(rates.imag) > np.abs(rates.real)
    with np.errstate(divide="ignore"):
        constants, periods = 1.0 / np.abs(rates.real), 2.0 * np.pi / np.abs(rates.imag)
    if (side > 0).any():
        span = _EXPLODED * constants[side > 0].min()
    else:
        settled, creeping = (constants[which].max(initial=0.0) for which in (side < 0, (side < 0) & ~vibrating))
        slowest = periods[vibrating].max(initial=0.0)
        span = min(_SETTLED * settled or np.inf, max(_PERIODS * slowest or np.inf, _SETTLED * creeping))
        if not vibrating.any() and (side == 0).any():  # integrators never settle
            span = max(span if np.isfinite(span) else 0.0, _LONG / float(np.abs(rates).max() or 1.0))
    return float(span), float(min(span / _FEWEST, periods.min() / _PER_PERIOD, constants.min() / _PER_CONSTANT))


def _visible_rates(system: Lti) -> Array:
    """Return the rates of the modes that are visible in a response [rad/s], and the rates of all rigid-body modes."""
    if not len(system.A):
        return np.zeros(0)
    rates, modes = system.rates, partial_fractions(system)
    there, fastest = np.isfinite(rates.real), np.abs(rates[np.isfinite(rates)]).max(initial=0.0)
    moving = there & (np.abs(rates) > ROOT * fastest)
    inside, moved = system.distances
    rates = np.where(there & ~moving & (np.abs(inside) <= moved), 0.0, rates)  # Rounding moves repeated poles off zero.
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        part = np.abs(modes.C).max(axis=0) * np.abs(modes.B).max(axis=1) / np.abs(rates)
    comparable = moving & np.isfinite(part)
    return rates[there & (~comparable | (part > _VISIBLE * part[comparable].max(initial=0.0)))]
