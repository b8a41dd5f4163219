"""Response of a linear plant to given signals: exact for signals that are linear between samples.

A structure answers with as many modes as a wanted accuracy needs; the modes left out answer as they do at rest, and
what the highest modes kept do beyond that estimates the error.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from importlib import import_module
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from boomctl.arrays import Array
from boomctl.checks import known, names, positive
from boomctl.lti.block_diagonal import block_diagonal
from boomctl.lti.hold import lifted_response
from boomctl.lti.time_series import TimeSeries
from boomctl.printing import count, signals
from boomctl.simulation.plant import ModalPlant, modal_plant, realized, truncated
from boomctl.simulation.signals import disturbance_rows, uniform_times
from boomctl.structure.matrices import halves
from boomctl.structure.model import SecondOrderModel
from boomctl.threads import one_blas_thread

if TYPE_CHECKING:
    import control

_FIRST_MODES = 16  # modes tried first: enough for 1e-3 of a boom's motion; more are taken as the witnesses ask
# of the number of modes from one trial to the next: all trials together cost less than three times the last
_GROWTH = 1.6
_CONDITION = 1e6  # Largest condition of the modal coordinates in which the error is estimated.
_WITNESSES = 2  # highest modes kept whose motion beyond rest stands for that of the modes left out: one may be hidden


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
        Values of the signals given.
    error_estimate : float
        Estimated error by the modes left out, relative to the largest output; 0 where none were.
    modes : int
        Number of modes used; of a state-space system, of states.
    units : dict from name to str
        Units of the signals of a structure; empty of a ``StateSpace``, which does not say them.
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
            Where to draw: inputs and outputs, one axes for each unit, which its label says where it is known; by default a
            new figure of pyplot.
        outputs : str or sequence of str, optional
            By default the first six.
        **style
            Of the curves, as matplotlib's lines take it; a ``label`` stands before their names.

        Returns
        -------
        ndarray of matplotlib.axes.Axes
            Those drawn on, in the order in which ``ax`` names them.
        """
        return import_module("boomctl.plotting").plot_forced_response(self, ax, outputs=outputs, **style)

    def _outputs(self) -> dict[str, Array]:
        return self.outputs

    def _inputs(self) -> dict[str, Array]:
        return self.inputs

    def __figures__(self) -> dict[str, float]:
        """Return what a comparison shows."""
        sizes = {f"{name}: rms": float(np.sqrt(np.mean(values**2))) for name, values in self.outputs.items()}
        return sizes | {f"{name}: peak": float(np.abs(values).max()) for name, values in self.outputs.items()}


@one_blas_thread
def forced_response(
    plant: SecondOrderModel | control.StateSpace,
    signals: Mapping[str, ArrayLike],
    timepts: ArrayLike,
    outputs: str | Sequence[str] | None = None,
    accuracy: float = 1e-6,
) -> ForcedResponse:
    """Return the response of a plant at rest to given signals.

    Between the instants given the signals run along straight lines.

    Parameters
    ----------
    plant : SecondOrderModel or control.StateSpace
        The plant, in continuous time.
    signals : mapping from input to (n,) array
        Values at ``timepts``; inputs not named stay at zero.
    timepts : (n,) array_like
        Times in equal steps [s].
    outputs : str or sequence of str, optional
        Outputs that are read; by default all.
    accuracy : float
        Largest error wanted of a structure's response, relative to the largest value of each output.

    Returns
    -------
    ForcedResponse
        Outputs over time, by name.

    Raises
    ------
    TypeError, ValueError
        Another kind of plant, unknown signals, shapes, gaps, times not even.

    Examples
    --------
    >>> import boomctl as bc
    >>> import numpy as np
    >>> time = np.linspace(0.0, 20.0, 401)
    >>> pulled = {"suspension_left": -np.minimum(time, 1.0), "suspension_right": np.minimum(time, 1.0)}  # N
    >>> result = bc.forced_response(bc.spray_boom(), pulled, time, "tip_right")
    >>> (1000.0 * result.outputs["tip_right"][[0, 100, 400]]).round(2)  # mm
    array([0.  , 2.18, 7.  ])
    """
    time, wanted = uniform_times(timepts), positive("accuracy", accuracy)
    h = float(time[-1] - time[0]) / (len(time) - 1)
    if not isinstance(signals, Mapping) or not signals:
        raise TypeError("signals: expected a mapping from inputs of the plant to arrays, not empty")
    if not isinstance(plant, SecondOrderModel):
        modal = modal_plant(plant)
        rows = disturbance_rows(signals, modal.inputs, (), len(time))
        read = names("output", outputs, modal.outputs)
        places = [modal.outputs.index(name) for name in read]
        found = lifted_response(modal.step(h).of_signals, modal.C, modal.D, rows)[places]
        if not np.isfinite(found).all():
            raise ValueError("plant: its outputs grow beyond all numbers before the last of timepts")
        return ForcedResponse(time, dict(zip(read, found, strict=True)), _given(signals), 0.0, len(modal.A))
    for name in signals:
        known("signal", name, plant.inputs)
    read = names("output", outputs, plant.outputs)
    total, errors, modes = np.zeros((len(read), len(time))), np.zeros(len(read)), 0
    for model, U, W in _parts(plant, signals, read, len(time)):
        y, error, used = _structure_response(model, U, h, wanted)
        total += W @ y
        errors += np.abs(W) @ error
        modes += used
    sizes = np.abs(total).max(axis=1)
    estimate = float(np.max(errors / np.where(sizes > 0.0, sizes, 1.0)))
    return ForcedResponse(time, dict(zip(read, total, strict=True)), _given(signals), estimate, modes, plant.units)


def _given(signals: Mapping[str, ArrayLike]) -> dict[str, Array]:
    return {name: np.asarray(values, dtype=float) for name, values in signals.items()}


def _parts(
    model: SecondOrderModel, signals: Mapping[str, ArrayLike], outputs: tuple[str, ...], n: int
) -> list[tuple[SecondOrderModel, Array, Array]]:
    """Return the symmetric halves of a model (or the model), their signals, and how their outputs make up the wanted."""
    inputs = tuple(signals)
    if model.mirror is not None:
        ins, outs = model.mirror.completed(inputs, model.inputs), model.mirror.completed(outputs, model.outputs)
        chosen = model.select(ins, outs)
        parts, rows = halves(chosen.structure, chosen.ports), disturbance_rows(signals, ins, (), n)
        if parts is not None:
            place = [outs.index(name) for name in outputs]
            return [
                (SecondOrderModel.of(part.structure, part.ports), part.W_in.T @ rows, part.W_out[place])
                for part in parts
            ]
    return [(model.select(inputs, outputs), disturbance_rows(signals, inputs, (), n), np.eye(len(outputs)))]


def _structure_response(model: SecondOrderModel, U: Array, h: float, accuracy: float) -> tuple[Array, Array, int]:
    """Return outputs, the estimated error of each (outputs,), and the number of modes."""
    if not U.any():
        return np.zeros((len(model.outputs), U.shape[1])), np.zeros(len(model.outputs)), 0
    modes = min(_FIRST_MODES, model.n)
    while True:
        small, rest = truncated(model, modes)
        plant = ModalPlant.of(realized(small, rest).balanced())
        count = len(plant.C)
        if small.n == model.n:
            y = lifted_response(plant.step(h).of_signals, plant.C, plant.D, U)
            return y, np.zeros(count), model.n
        C, D = _witness(plant, np.array(small.ports.integrators) == 0)
        both = lifted_response(plant.step(h).of_signals, np.vstack([plant.C, C]), np.vstack([plant.D, D]), U)
        y, error = both[:count], np.abs(both[count:]).max(axis=1)
        if (error <= accuracy * np.abs(y).max(axis=1)).all():
            return y, error, modes
        modes = min(model.n, int(np.ceil(_GROWTH * modes)))


def _witness(plant: ModalPlant, direct: Array) -> tuple[Array, Array]:
    """Return rows that read how far the highest modes are from their answer at rest: the error of leaving others out.

    Inputs are ``direct`` or integrated; the answer at rest to an integral belongs to the integrator's block, not to the
    modes' own.
    """
    A, T, sizes = block_diagonal(plant.A, _CONDITION)
    back = np.linalg.inv(T)
    parts = [slice(end - size, end) for end, size in zip(np.cumsum(sizes), sizes, strict=True)]
    speed = [float(np.abs(np.linalg.eigvals(A[part, part])).min()) for part in parts]
    C, D = np.zeros_like(plant.C), np.zeros_like(plant.D)
    for k in np.argsort(speed)[-_WITNESSES:]:
        part = parts[k]
        rows = plant.C @ T[:, part]
        C += rows @ back[part]
        D += rows @ np.linalg.solve(A[part, part], back[part] @ (plant.B * direct))
    return C, D
