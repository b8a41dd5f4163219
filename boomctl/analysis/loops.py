"""Continuous or sampled feedback loops ``u = K y``, closed by name, with injection points at controls and measurements."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from boomctl.arrays import Array
from boomctl.checks import frequencies, function_of, known, names, warn_user
from boomctl.exceptions import FeedbackSignWarning
from boomctl.lti.modal import sides
from boomctl.lti.sampled import sampled_plant, time_of_loop
from boomctl.lti.system import Lti, check_scales, controller_of, is_frequency_response, lower_lft, of
from boomctl.printing import compact, listed
from boomctl.structure.model import SecondOrderModel
from boomctl.threads import one_blas_thread

if TYPE_CHECKING:
    import control

    from boomctl.lti.system import Controller

SIGN_ADVICE = "The controller acts as u = +K y: pass -K, which stabilizes the loop."
_MAX_CHECKED_STATES = 200  # Largest number of states of a loop whose poles are computed for a warning: about 20 ms.


@dataclass(frozen=True)
class Loop:
    """Loop ``u = K y`` of a plant and a controller, as one system with all signals of the loop.

    Attributes
    ----------
    disturbances, controls, measurements, outputs : tuple of str
        Names of signals; ``outputs`` are all outputs of the plant.
    system : Lti
        System from the disturbances, the signals injected at the controls, and the signals injected at the measurements, to
        the plant's outputs, the plant's control inputs, and the controller's inputs.  The plant states precede the
        controller's.  In discrete time with a discrete controller.
    plant, controller : Lti
        Plant from controls to measurements, sampled with a discrete controller; controller from measurements to controls.
    """

    disturbances: tuple[str, ...]
    controls: tuple[str, ...]
    measurements: tuple[str, ...]
    outputs: tuple[str, ...]
    system: Lti
    plant: Lti
    controller: Lti

    __repr__ = compact

    @property
    def sensitivity(self) -> Lti:
        """System from the injected signals to the controls and measurements: ``(I - [0 K; G 0])^-1``."""
        first, last, size = len(self.disturbances), len(self.outputs), len(self.controls) + len(self.measurements)
        return self.system.between(range(first, first + size), range(last, last + size)).balanced()

    def injections(self, injection_points: str | Sequence[str]) -> list[int]:
        """Return the indices of the inputs that are the signals injected at some controls and measurements.

        Raises
        ------
        TypeError, ValueError
            If a name is unknown, or an injected signal has the name of another input.
        """
        around = self.controls + self.measurements
        points = names("control or measurement (injection_points)", injection_points, around)
        for label in map(injected, points):
            if self.system.input_labels.count(label) > 1:
                raise ValueError(
                    f"`injection_points` must result in new names, got {label!r}, a name of two inputs. Rename a signal."
                )
        return [len(self.disturbances) + around.index(name) for name in points]

    def closed(self, injection_points: str | Sequence[str] = ()) -> Lti:
        """Return the loop from the disturbances and the injected signals to the plant's outputs and the controls.

        Raises
        ------
        TypeError, ValueError
            As in `injections`, or if the loop has no inputs.
        """
        inputs = [*range(len(self.disturbances)), *self.injections(injection_points)]
        if not inputs:
            raise ValueError(
                "the controller drives every input of the plant, so that the loop has no inputs: `injection_points` must name"
                f" at least one of {listed(self.controls + self.measurements)}."
            )
        return self.system.between(inputs, range(len(self.outputs) + len(self.controls)))


def injected(point: str) -> str:
    """Return the name of the signal injected at a control or a measurement."""
    return f"{point}_injected"


def joined(
    plant: SecondOrderModel | control.StateSpace | control.TransferFunction | Lti,
    controller: control.StateSpace | control.TransferFunction | Lti,
    delay: float | None = None,
) -> Loop:
    """Return the loop of a plant and a controller, with signals matched by name.

    With a delay [s], 0 included, the controller may be discrete, and the loop is then sampled: see :func:`feedback_loop`.
    Without a delay, the loop must be in continuous time.

    Raises
    ------
    TypeError, ValueError
        If a system has an unsupported type or time, signal names do not match, or the loop is not well-posed.
    """
    either = delay is not None
    P = of(plant, "plant", sampled=either)
    K = controller_of(controller, sampled=either, scales=P.scales)
    K = replace(K, state_labels=tuple(f"controller_{label}" for label in K.state_labels))
    acting, measured = signals_of(K, P.input_labels, P.output_labels, P.state_labels, P.scales)
    dt, late = time_of_loop(P, K, 0.0 if delay is None else delay)
    if dt:
        P = sampled_plant(P, acting, dt, [late] * len(acting))
    others = [i for i in range(len(P.input_labels)) if i not in acting]
    disturbances = tuple(P.input_labels[i] for i in others)
    first, m, p, size = len(others), len(acting), len(measured), len(P.C)
    unit, rows = np.eye(P.B.shape[1])[:, [*others, *acting]], np.eye(size)
    into = np.hstack([unit, np.zeros((len(unit), p)), unit[:, first:]])
    out_of = np.vstack([rows, np.zeros((m, size)), rows[measured], rows[measured]])
    D = out_of @ P.D @ into
    D[size : size + m, first : first + m] = D[size : size + m, first + m + p :] = np.eye(m)
    D[size + m :, first + m : first + m + p] = np.tile(np.eye(p), (2, 1))
    inputs = (*disturbances, *map(injected, K.output_labels + K.input_labels), *K.output_labels)
    outputs = P.output_labels + K.output_labels + K.input_labels + K.input_labels
    scales = P.scales and {**P.scales, **{injected(name): value for name, value in P.scales.items()}}
    open_loop = Lti(P.A, P.B @ into, out_of @ P.C, D, inputs, outputs, P.state_labels, dt, scales)
    closed, plant = lower_lft(open_loop, K), P.between(acting, measured)
    return Loop(disturbances, K.output_labels, K.input_labels, P.output_labels, closed, plant, K)


def sign_advice(plant: Lti, controller: Lti, delay: float) -> str:
    """Return the advice to pass ``-K``, for a loop that is unstable with ``K``; empty if ``-K`` does not stabilize it."""
    try:
        loop = joined(plant, replace(controller, C=-controller.C, D=-controller.D), delay).system
    except ValueError:  # The loop with `-K` is not well-posed.
        return ""
    return SIGN_ADVICE if (sides(loop.poles, loop.dt) < 0).all() else ""


def warn_of_sign(advice: str) -> None:
    """Issue the advice on the sign of a controller as a warning, unless it is empty."""
    if advice:
        warn_user(f"The loop is unstable. {advice}", FeedbackSignWarning)


def signals_of(
    controller: Lti,
    inputs: Sequence[str],
    outputs: Sequence[str],
    states: Sequence[str] = (),
    scales: Mapping[str, float] | None = None,
) -> tuple[list[int], list[int]]:
    """Return the indices of the plant's inputs that a controller drives, and of the plant's outputs that it reads, by name.

    Raises
    ------
    ValueError
        If the controller is not in the scales of the plant, or a signal is missing.  For a state of the plant, the message
        explains how it becomes an output, and for a controller without names, how to assign them.
    """
    read, driven = controller.input_labels, controller.output_labels
    unnamed = [*(f"u[{k}]" for k in range(len(read))), *(f"y[{k}]" for k in range(len(driven)))]
    if unnamed == [*read, *driven] and not ({*read} <= {*outputs} and {*driven} <= {*inputs}):
        raise ValueError(
            f"controller: its signals have no names but {listed(unnamed)}: python-control loses them in -K, 2 * K, K1 * K2;"
            f" K.update_names(inputs=[...], outputs=[...]) gives them: what it reads is among {listed(outputs)}, what it"
            f" drives among {listed(inputs)}"
        )
    for label in read:
        if label not in outputs and label in (state.replace(".", "_") for state in states):
            raise ValueError(
                f"plant: the controller reads its state {label!r}, which is no output; "
                "boomctl.with_state_outputs(plant) has it"
            )
        if label not in outputs and label.removeprefix("error_") in outputs:
            names = [name.removeprefix("error_") for name in read]
            raise ValueError(
                f"controller: its input {label!r} is a control error, as in mixed_sensitivity; with this plant, use "
                f"control.ss(-K, inputs={names}, outputs={list(driven)})"
            )
        known("plant output (it is an input of the controller)", label, outputs)
    for label in driven:
        known("plant input (it is an output of the controller)", label, inputs)
    check_scales(controller, scales)
    return [inputs.index(label) for label in driven], [outputs.index(label) for label in read]


@one_blas_thread
def feedback_loop(
    plant: SecondOrderModel | control.StateSpace | control.TransferFunction,
    controller: Controller,
    injection_points: str | Sequence[str] = (),
    *,
    delay: float = 0.0,
) -> control.StateSpace:
    """Return the closed loop ``u = K y``, with signals of plant and controller matched by name.

    A discrete controller defines a sampled loop.  A continuous plant is then discretized exactly, as in
    :func:`boomctl.simulate_loop`: at a sample the controller reads the plant, just before its control changes; the new
    control is applied ``delay`` later, and held until the next one is applied.

    Parameters
    ----------
    plant : SecondOrderModel, control.StateSpace or control.TransferFunction
        Plant with named signals.  A discrete plant requires a discrete controller with the same sampling time.
        :func:`boomctl.with_state_outputs` adds its states as outputs, for controllers that read them.
    controller : control.StateSpace, control.TransferFunction, or a design
        Controller with ``u = K y``, in the scales of the plant. Signals are matched by name.
    injection_points : str or sequence of str, optional
        Controls and measurements at which a signal is injected, ``u = K (y + n) + v``: ``"force_injected"`` at ``"force"``.
    delay : float, optional
        Computation delay [s]: any number of samples, whole if the plant is discrete.  Requires a discrete-time controller.

    Returns
    -------
    control.StateSpace
        Inputs: those of the plant that the controller does not drive, then the injected signals.  Outputs: those of the
        plant, then the control inputs of the plant (under their own names).  A sampled loop is discrete: its inputs are held
        between samples, its outputs are those just before the controls change, and its controls are the controller outputs
        at a sample, which the plant receives ``delay`` later.

    Raises
    ------
    TypeError, ValueError
        If a system has an unsupported type, sampling times differ or are unspecified, the loop cannot have this delay, signal
        names do not match, or the loop has no inputs or is not well-posed.

    Warns
    -----
    FeedbackSignWarning
        If the loop is unstable with ``K`` and stable with ``-K``.  Loops of more than 200 states are not checked.

    Examples
    --------
    >>> import boomctl as bc
    >>> import control
    >>> mass = control.ss([[0.0, 1.0], [0.0, 0.0]], [[0.0], [1.0]], [[1.0, 0.0]], 0.0, inputs="force", outputs="position")
    >>> lead = control.ss([[-20.0]], [[1.0]], [[360.0]], -20.0, inputs="position", outputs="force")
    >>> loop = bc.feedback_loop(mass, bc.discretize(lead, 0.05), "force", delay=0.02)
    >>> loop.input_labels, loop.dt, bool(abs(loop.poles()).max() < 1.0)
    (['force_injected'], 0.05, True)
    """
    P = of(plant, "plant", sampled=True)
    K = controller_of(controller, sampled=True, scales=P.scales)
    closed = joined(P, K, delay).closed(injection_points)
    if len(closed.A) <= _MAX_CHECKED_STATES and (sides(closed.poles, closed.dt) > 0).any():
        warn_of_sign(sign_advice(P, K, delay))
    return closed.statespace("closed loop")


@one_blas_thread
def closed_loop_response(
    plant: Callable[[Array], control.FrequencyResponseData] | control.FrequencyResponseData,
    controller: control.StateSpace,
    omega: ArrayLike | None = None,
) -> control.FrequencyResponseData:
    """Return the frequency response of the loop ``u = K y`` for a plant known by its frequency response.

    Parameters
    ----------
    plant : control.FrequencyResponseData, or function from frequencies [rad/s] to it
        Frequency response with named signals, such as the response of an exact boom.
    controller : control.StateSpace
        Controller with ``u = K y``. Signals are matched by name.
    omega : array_like, optional
        Angular frequencies [rad/s]. Requires a function as `plant`.

    Returns
    -------
    control.FrequencyResponseData
        From the inputs that the controller does not drive to the plant's outputs and the controls.  Stability is not checked:
        see :func:`boomctl.analysis.nyquist_stability`.

    Raises
    ------
    TypeError, ValueError
        If signal names do not match, frequencies are missing or given in addition to those of data, or the loop has a pole at
        a requested frequency.

    Examples
    --------
    >>> import boomctl as bc
    >>> import control
    >>> def boom(omega):  # with an exact beam
    ...     return bc.exact_frequency_response(bc.BoomParameters(), omega)
    >>> spring = control.ss([], [], [], [[-500.0]], inputs="stroke_left", outputs="suspension_left")
    >>> loop = bc.analysis.closed_loop_response(boom, spring, [1.0, 2.0])
    >>> loop.ninputs, loop.output_labels[-1]
    (4, 'suspension_left')
    """
    from boomctl.lti.python_control import control

    data = named_response(plant, omega)
    K = controller_of(controller).balanced()
    grid, G = np.asarray(data.omega, dtype=float), np.asarray(data.frdata).transpose(2, 0, 1)
    acting, measured = signals_of(K, data.input_labels, data.output_labels)
    others = [i for i in range(data.ninputs) if i not in acting]
    if not others:
        raise ValueError("the controller drives every input of the plant, so that the loop has no inputs")
    Kw = K.response(grid).transpose(2, 0, 1)
    try:
        u = np.linalg.solve(np.eye(len(acting)) - Kw @ G[:, measured][:, :, acting], Kw @ G[:, measured][:, :, others])
    except np.linalg.LinAlgError:
        raise ValueError("the loop has a pole at a requested frequency") from None
    z = np.concatenate([G[:, :, others] + G[:, :, acting] @ u, u], axis=1).transpose(1, 2, 0)
    inputs, outputs = [data.input_labels[i] for i in others], [*data.output_labels, *K.output_labels]
    return control.frd(z, grid, inputs=inputs, outputs=outputs, name="closed loop")


def named_response(
    plant: Callable[[Array], control.FrequencyResponseData] | control.FrequencyResponseData,
    omega: ArrayLike | None,
) -> control.FrequencyResponseData:
    """Return the finite frequency response of a plant, from data or a function of frequency."""
    data: Any = plant
    if is_frequency_response(plant) and omega is not None:
        raise ValueError("omega: frequency response data have their own frequencies; leave it out")
    if not is_frequency_response(plant):
        respond = function_of("plant", plant, "the frequency, or FrequencyResponseData")
        if omega is None:
            raise ValueError("omega: expected frequencies at which to evaluate the plant's response")
        data = respond(frequencies("omega", omega))
        if not is_frequency_response(data):
            raise TypeError(f"plant: expected a function that returns FrequencyResponseData, got {type(data).__name__}")
    if not np.isfinite(np.asarray(data.frdata)).all():
        raise ValueError("plant: expected a finite frequency response")
    return data
