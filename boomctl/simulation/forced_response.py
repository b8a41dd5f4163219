"""Response of a linear plant to input signals, exact for signals that are linear between samples.

A structure is projected onto as many modes and static responses as the tolerance requires.  The error is estimated from two
projections, one with fewer modes and responses, or from the rounding errors of two computations over all modes.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from importlib import import_module
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from boomctl.arrays import Array
from boomctl.checks import known, names, positive
from boomctl.lti.hold import lifted_motion
from boomctl.lti.rounding import EPS, ROOT, SOLVED, SUMMED
from boomctl.lti.system import Lti, of
from boomctl.lti.time_series import TimeSeries
from boomctl.printing import count, signals
from boomctl.simulation.plant import ModalPlant, basis
from boomctl.simulation.signals import disturbance_rows, uniform_times
from boomctl.structure.matrices import halves
from boomctl.structure.model import SecondOrderModel
from boomctl.structure.response.modal_form import in_modes
from boomctl.threads import one_blas_thread

if TYPE_CHECKING:
    import control

_FIRST_MODES, _FIRST_ORDER = 13, 3  # First projection: number of undamped modes, order of the static responses.
_COMPLETE = 40  # Coordinates up to which all modes are used: a projection would have as many.
_FEWER_MODES = 11  # Undamped modes of the projection with which the first one is compared.
_GROWTH = 1.6  # Ratio of the numbers of modes of successive projections.
_MARGIN = 3.0  # Ratio of an error estimate to the difference of the responses of two projections.
_STORED = 1e-11  # Relative error of a structure's response by rounding of its stored rows.
_UNITS = 100.0  # Ratio of an error estimate to the change of a response by one unit of rounding of each entry.
_ROUNDING = 30.0  # Ratio of an error estimate to the difference of two responses by rounding.


@dataclass(frozen=True)
class ForcedResponse(TimeSeries):
    """Outputs over time.

    Attributes
    ----------
    time : (n,) ndarray
        Times [s].
    outputs : dict from name to (n,) ndarray
        Values of each output at these times.
    inputs : dict from name to (n,) ndarray
        Values of the input signals.
    error_estimate : float
        Estimated error by truncated modes of a structure and by rounding, relative to the largest value of each output:
        the largest of all outputs.
    modes : int
        Number of modes and static responses used; for a state-space system, of states.
    units : dict from name to str
        Units of the signals of a structure; empty for a ``StateSpace``, which has no units.
    """

    time: Array
    outputs: dict[str, Array] = field(repr=False)
    inputs: dict[str, Array] = field(repr=False)
    error_estimate: float
    modes: int
    units: dict[str, str] = field(default_factory=dict, repr=False)

    def __repr__(self) -> str:
        span = f"{self.time[0]:.6g} to {self.time[-1]:.6g} s, {len(self.time)} samples"
        return (
            f"ForcedResponse: {span}; {count(self.modes, 'mode')}, error estimated {self.error_estimate:.1e}\n"
            f"{signals(list(self.inputs), list(self.outputs))}"
        )

    def plot(self, ax: Any = None, *, outputs: str | Sequence[str] | None = None, **style: Any) -> Array:
        """Draw inputs and outputs over time.

        Parameters
        ----------
        ax : sequence of matplotlib Axes, or a figure, optional
            Axes for inputs and outputs, one axes for each unit; by default a new figure of pyplot.
        outputs : str or sequence of str, optional
            Outputs to draw; by default the first six.
        **style
            Line properties of matplotlib; a ``label`` is prefixed to the curves' names.

        Returns
        -------
        ndarray of matplotlib.axes.Axes
            Axes drawn on, in the order of ``ax``.
        """
        return import_module("boomctl.plotting.loop").plot_forced_response(self, ax, outputs=outputs, **style)

    def _outputs(self) -> dict[str, Array]:
        return self.outputs

    def _inputs(self) -> dict[str, Array]:
        return self.inputs

    def __figures__(self) -> dict[str, float]:
        """Return the values that a comparison shows."""
        sizes = {f"{name}: rms": float(np.sqrt(np.mean(values**2))) for name, values in self.outputs.items()}
        return sizes | {f"{name}: peak": float(np.abs(values).max()) for name, values in self.outputs.items()}


@one_blas_thread
def forced_response(
    plant: SecondOrderModel | control.StateSpace,
    timepts: ArrayLike,
    inputs: Mapping[str, ArrayLike],
    outputs: str | Sequence[str] | None = None,
    rtol: float = 1e-6,
) -> ForcedResponse:
    """Return the response of a plant, initially at rest, to input signals.

    The signals are interpolated linearly between ``timepts``.

    Parameters
    ----------
    plant : SecondOrderModel or control.StateSpace
        The plant, in continuous time.
    timepts : (n,) array_like
        Times in equal steps [s].
    inputs : mapping from input to (n,) array
        Values at ``timepts``; inputs not named stay at zero.
    outputs : str or sequence of str, optional
        Outputs to compute; by default all.
    rtol : float
        Largest error of a structure's response by truncated modes, relative to the largest value of each output.
        Rounding may exceed it; ``error_estimate`` includes both.

    Returns
    -------
    ForcedResponse
        Outputs over time, by name.

    Raises
    ------
    TypeError, ValueError
        If the plant has the wrong type, a signal is unknown, a shape is wrong, a value is not finite, or times are not
        equally spaced.

    Examples
    --------
    >>> import boomctl as bc
    >>> import numpy as np
    >>> time = np.linspace(0.0, 20.0, 401)
    >>> pulled = {"suspension_left": -np.minimum(time, 1.0), "suspension_right": np.minimum(time, 1.0)}  # N
    >>> result = bc.forced_response(bc.spray_boom(), time, pulled, "tip_right")
    >>> (1000.0 * result.outputs["tip_right"][[0, 100, 400]]).round(2)  # mm
    array([0.  , 2.18, 7.  ])
    """
    time, wanted = uniform_times(timepts), positive("rtol", rtol)
    h = float(time[-1] - time[0]) / (len(time) - 1)
    if not isinstance(inputs, Mapping) or not inputs:
        got = "none" if isinstance(inputs, Mapping) else type(inputs).__name__
        raise TypeError(f"inputs: expected a mapping from inputs of the plant to arrays, got {got}")
    if not isinstance(plant, SecondOrderModel):
        system = of(plant, "plant")
        rows = disturbance_rows(inputs, system.input_labels, (), len(time))
        read = names("output", outputs, system.output_labels)
        indices = [system.output_labels.index(name) for name in read]
        y, nearby = (_motion(ModalPlant.of(item), rows, h)[0][indices] for item in (system, _rounded(system)))
        if not np.isfinite(y).all():
            raise ValueError("plant: its outputs overflow before the last of timepts")
        size, change = np.abs(y).max(axis=1), np.abs(y - nearby).max(axis=1)
        estimate = float(np.max(_UNITS * change / np.where(size > 0.0, size, 1.0), initial=0.0) + SOLVED)
        return ForcedResponse(time, dict(zip(read, y, strict=True)), _as_arrays(inputs), estimate, len(system.A))
    for name in inputs:
        known("signal", name, plant.input_labels)
    read = names("output", outputs, plant.output_labels)
    total, errors, sizes, modes = np.zeros((len(read), len(time))), np.zeros(len(read)), np.zeros(len(read)), 0
    for model, U, W in _parts(plant, inputs, read, len(time)):
        y, error, size, used = _structure_response(model, U, h, wanted)
        total += W @ y
        errors += np.abs(W) @ error
        sizes += np.abs(W) @ size
        modes += used
    sizes = _sizes(total, sizes)
    estimate = float(np.max(errors / np.where(sizes > 0.0, sizes, 1.0)))
    return ForcedResponse(time, dict(zip(read, total, strict=True)), _as_arrays(inputs), estimate, modes, plant.units)


def _motion(plant: ModalPlant, U: Array, h: float) -> tuple[Array, Array]:
    """Return the outputs and the states of a plant at the times."""
    step = plant.step(h)
    return lifted_motion((step.Phi, step.first, step.last), plant.C, plant.D, U)


def _rounded(system: Lti) -> Lti:
    """Return a system with each entry perturbed by one unit of rounding, up or down."""
    signs = np.random.default_rng(0)
    A, B, C, D = (
        X * (1.0 + EPS * signs.choice([-1.0, 1.0], X.shape)) for X in (system.A, system.B, system.C, system.D)
    )
    return replace(system, A=A, B=B, C=C, D=D)


def _as_arrays(signals: Mapping[str, ArrayLike]) -> dict[str, Array]:
    return {name: np.asarray(values, dtype=float) for name, values in signals.items()}


def _parts(
    model: SecondOrderModel, signals: Mapping[str, ArrayLike], outputs: tuple[str, ...], n: int
) -> list[tuple[SecondOrderModel, Array, Array]]:
    """Return the subsystems of a symmetric model (or the model), their signals, and the map to the requested outputs."""
    inputs = tuple(signals)
    mirror = model.structure.mirror
    if mirror is not None:
        ins, outs = mirror.completed(inputs, model.input_labels), mirror.completed(outputs, model.output_labels)
        chosen = model.select(ins, outs)
        parts, rows = halves(chosen.structure, chosen.ports), disturbance_rows(signals, ins, (), n)
        if parts is not None:
            indices = [outs.index(name) for name in outputs]
            return [
                (SecondOrderModel.of(part, ports), W_in.T @ rows, W_out[indices]) for part, ports, W_in, W_out in parts
            ]
    return [(model.select(inputs, outputs), disturbance_rows(signals, inputs, (), n), np.eye(len(outputs)))]


def _structure_response(
    model: SecondOrderModel, U: Array, h: float, accuracy: float
) -> tuple[Array, Array, Array, int]:
    """Return outputs, the estimated error of each (outputs,), a bound of its magnitude, and the number of modes."""
    outputs = len(model.output_labels)
    before, last, size = None, np.full(outputs, np.inf), np.zeros(outputs)
    if not U.any():
        return np.zeros((outputs, U.shape[1])), size, size, 0
    modes, order = (model.ncoordinates if model.ncoordinates <= _COMPLETE else _FIRST_MODES), _FIRST_ORDER
    while True:
        frequencies, V = basis(model, min(modes, model.ncoordinates), order)
        y, size = _projected_response(model, frequencies, V, U, h)
        whole = len(frequencies) == model.ncoordinates
        if whole:  # scaled modes, for different rounding errors
            before, _ = _projected_response(model, frequencies, 1.4 * V, U, h)
        elif before is None:
            before, _ = _projected_response(model, *basis(model, _FEWER_MODES, order - 1), U, h)
        least = _sizes(y, size)
        error = (_ROUNDING if whole else _MARGIN) * np.abs(y - before).max(axis=1) + _STORED * least
        # an error below ROOT that is not reduced from one projection to the next is rounding
        if whole or ((error <= accuracy * least) | ((error <= ROOT * least) & (error >= 0.5 * last))).all():
            return y, error, size, len(frequencies)
        last = error if order > _FIRST_ORDER else last
        before, order, modes = y, order + 1, int(np.ceil(_GROWTH * modes))


def _projected_response(
    model: SecondOrderModel, frequencies: Array, V: Array, U: Array, h: float
) -> tuple[Array, Array]:
    """Return the outputs of a structure projected onto ``V``, and a bound of the magnitude of each."""
    plant = ModalPlant.of(in_modes(model.structure, model.ports, frequencies, V))
    y, states = _motion(plant, U, h)
    reach = np.linalg.norm(states, axis=1).max()
    return y, np.linalg.norm(plant.C, axis=1) * reach + np.abs(plant.D) @ np.abs(U).max(axis=1)


def _sizes(y: Array, bound: Array) -> Array:
    """Return the largest value of each output, or its bound if the output is a rounding error."""
    size = np.abs(y).max(axis=1)
    return np.where(size > SUMMED * bound, size, bound)
