"""Generalized plants of a plant and weights of its signals."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from boomctl.arrays import Array, blocks
from boomctl.checks import exactly, known, mapping, names, real, some_names
from boomctl.lti.bilinear import discrete_image
from boomctl.lti.modal import sides
from boomctl.lti.python_control import control
from boomctl.lti.system import Lti, append, of, series, static
from boomctl.reduction.result import ReductionResult
from boomctl.structure.model import SecondOrderModel
from boomctl.synthesis.plants.full_plant import generalized, plant_within
from boomctl.threads import one_blas_thread

Weight = float | control.StateSpace | control.TransferFunction
_Weights = Mapping[str, Lti]


@one_blas_thread
def generalized_plant(
    plant: control.StateSpace | SecondOrderModel | ReductionResult,
    *,
    disturbances: Mapping[str, Weight],
    performance: Mapping[str, Weight],
    effort: Mapping[str, Weight] | None = None,
    noise: Mapping[str, Weight] | None = None,
    measurements: str | Sequence[str],
    controls: str | Sequence[str],
) -> control.StateSpace:
    """Build a generalized plant of disturbances, performance outputs, measurements and controls, with weights.

    A weight is a number or a stable system with one input and one output (`low_pass`, `high_pass`, `band_pass`,
    `shelf`). Numbers add no states; other inputs and outputs are omitted. Weights of a discrete plant have its sampling time,
    or are in continuous time and discretized by Tustin's rule.

    Parameters
    ----------
    plant : control.StateSpace, SecondOrderModel or ReductionResult
        With labeled signals, in continuous or discrete time (:func:`boomctl.analysis.sample_plant`). Of a result of `reduce`
        the reduced system is used; designs for the generalized plant are also evaluated on the full one. Other operations
        on the generalized plant drop this.
    disturbances : mapping from input to weight
        Weights of disturbances; ``"actuator_sym"`` becomes the input ``"w_actuator_sym"`` in front of its weight.
    performance : mapping from output to weight
        Weights of performance outputs; ``"tip_sym"`` becomes the output ``"z_tip_sym"`` behind its weight.
    effort : mapping from control to weight, optional
        Weights of controls; ``"suspension_sym"`` becomes the output ``"z_suspension_sym"``.
    noise : mapping from measurement to weight, optional
        Noise levels or filters; ``"stroke_sym"`` becomes the input ``"n_stroke_sym"``, added to that measurement.
    measurements, controls : str or sequence of str
        Inputs and outputs of the controller, with their labels.

    Returns
    -------
    control.StateSpace
        Inputs: disturbances, noises, controls.  Outputs: performance, effort, measurements.

    Raises
    ------
    TypeError, ValueError
        If `plant` is not a system, if a label is unknown or repeated, if a weight is not a number or a stable system with one
        input and one output, if its sampling time is not that of the plant, or if there are no disturbances or no
        performance outputs.

    Warns
    -----
    ReductionWarning
        If the error of the reduction exceeds the gain of the reduced plant from disturbances to performance outputs, or from
        controls to measurements.

    Examples
    --------
    >>> import boomctl as bc
    >>> yaw = bc.split_symmetric(bc.spray_boom())[1]
    >>> P = bc.generalized_plant(
    ...     yaw,
    ...     disturbances={"actuator_anti": bc.synthesis.band_pass(0.02, 0.5, 5.0)},
    ...     performance={"tip_anti": 10.0},
    ...     effort={"suspension_anti": 0.01},
    ...     noise={"stroke_anti": 0.001},
    ...     measurements="stroke_anti",
    ...     controls="suspension_anti",
    ... )
    >>> P.input_labels
    ['w_actuator_anti', 'n_stroke_anti', 'suspension_anti']
    >>> P.output_labels
    ['z_tip_anti', 'z_suspension_anti', 'stroke_anti']
    """
    system = plant_within(plant)
    ins, outs, dt = system.input_labels, system.output_labels, system.dt
    read, driven = names("measurement", measurements, outs), names("control", controls, ins)
    w = _weighted("disturbance", "w_", disturbances, ins, dt)
    n = _weighted("noise of measurement", "n_", {} if noise is None else noise, read, dt)
    z = _weighted("performance output", "z_", performance, outs, dt)
    e = _weighted("effort of control", "z_", {} if effort is None else effort, driven, dt)
    signals = {
        "disturbance or noise": w | n,
        "performance output or effort": z | e,
        "measurement": read,
        "control": driven,
    }
    for what, result in signals.items():
        if not result:
            raise ValueError(f"The generalized plant must have at least one {what}, got none.")

    channels = {"disturbances to performance outputs": (tuple(w), tuple(z)), "controls to measurements": (driven, read)}
    return generalized(plant, partial(_weighed, w=w, n=n, z=z, e=e, read=read, driven=driven), channels)


def _weighed(
    system: Lti, *, w: _Weights, n: _Weights, z: _Weights, e: _Weights, read: Sequence[str], driven: Sequence[str]
) -> Lti:
    """Return a plant with weights of disturbances, noise, outputs and efforts, with measurements and controls."""
    ends = [*(("noise", y) for y in n), *(("control", u) for u in driven)]
    causes = [
        *([("plant", i)] for i in w),
        *([("noise", y)] for y in n),
        *([("plant", u), ("control", u)] for u in driven),
    ]
    sums = [
        *([("plant", o)] for o in z),
        *([("control", u)] for u in e),
        *([("plant", y), ("noise", y)] for y in read),
    ]
    entry = _incidence(causes, [*(("plant", i) for i in system.input_labels), *ends]).T
    leave = _incidence(sums, [*(("plant", o) for o in system.output_labels), *ends])
    first = series(append(*w.values(), *n.values(), _through(driven)), static(entry))
    last = series(static(leave), append(*z.values(), *e.values(), _through(read)))
    joined = series(series(first, append(system, _through((*n, *driven)))), last)
    for what, listed in (("input", joined.input_labels), ("output", joined.output_labels)):
        twice = [name for name in listed if listed.count(name) > 1]
        if twice:
            raise ValueError(f"Labels of the generalized plant must be distinct, got the {what} {twice[0]!r} twice.")
    return replace(joined, dt=system.dt, scales=system.scales)


@one_blas_thread
def mixed_sensitivity(
    plant: control.StateSpace | SecondOrderModel | ReductionResult,
    W1: Weight | None = None,
    W2: Weight | None = None,
    W3: Weight | None = None,
) -> control.StateSpace:
    """Build the generalized plant for mixed-sensitivity synthesis: weighted control errors, controls and outputs.

    The controller reads the control errors ``e = r - y``; ``control.ss(-K, inputs=outputs of the plant, outputs=controls)``
    reads the outputs, as functions that connect it to the plant require.  The closed loop is ``[W1 S; W2 K S; W3 T]``, with
    ``S = (I + G K)^-1`` and ``T = G K S``.

    Parameters
    ----------
    plant : control.StateSpace, SecondOrderModel or ReductionResult
        As for `generalized_plant`; all inputs are controls, all outputs are controlled.
    W1, W2, W3 : float, control.StateSpace or control.TransferFunction, optional
        Weights of all errors, controls and outputs. If None, these are omitted.

    Returns
    -------
    control.StateSpace
        Inputs ``"r_<output>"`` and the plant's; outputs ``"z_error_<output>"``, ``"z_<input>"``, ``"z_<output>"`` and
        the measurements ``"error_<output>"``.

    Raises
    ------
    TypeError, ValueError
        If a system or weight is invalid, as for `generalized_plant`, or no weight is given.

    Examples
    --------
    >>> import boomctl as bc
    >>> import control
    >>> lag = control.ss([[-1.0]], [[1.0]], [[1.0]], 0.0, inputs="u", outputs="y")
    >>> P = bc.mixed_sensitivity(lag, W1=bc.shelf(100.0, 0.5, corner=1.0), W2=0.1)
    >>> P.input_labels, P.output_labels
    (['r_y', 'u'], ['z_error_y', 'z_u', 'error_y'])
    >>> design = bc.h_infinity(P, nmeas=1, ncon=1)
    >>> round(design.gamma, 2)
    0.93
    """
    system = plant_within(plant)
    ins, outs = system.input_labels, system.output_labels
    if not (ins and outs):
        raise ValueError("`plant` must have at least one input and one output, got none.")
    errors = tuple(f"error_{name}" for name in outs)
    weights: dict[str, Lti] = {}
    for what, signals, W in (("error", errors, W1), ("control", ins, W2), ("output", outs, W3)):
        if W is not None:
            weighted = _weighted(what, "z_", dict.fromkeys(signals, W), signals, system.dt)
            weights |= {name if what == "error" else f"{what} {name}": weight for name, weight in weighted.items()}
    if not weights:
        raise ValueError("`W1`, `W2` or `W3` must be given, got None for all.")

    return generalized(plant, partial(_with_errors, weights=weights), {"controls to measurements": (ins, outs)})


def _with_errors(system: Lti, *, weights: _Weights) -> Lti:
    """Return a plant with references as inputs, weighted control errors, controls or outputs, and measured control errors."""
    ins, outs, (p, m) = system.input_labels, system.output_labels, system.D.shape
    references, errors, scales = [f"r_{name}" for name in outs], [f"error_{name}" for name in outs], system.scales
    if scales:
        scales = {**scales, **{error: scales.get(name, 1.0) for error, name in zip(errors, outs, strict=True)}}
    O, B, C = np.zeros((p, p)), system.B, system.C
    D = blocks([[np.eye(p), -system.D], [np.zeros((m, p)), np.eye(m)], [O, system.D]])
    labels = (*errors, *(f"control {name}" for name in ins), *(f"output {name}" for name in outs))
    plant = replace(system, B=np.hstack([0.0 * C.T, B]), C=np.vstack([-C, 0.0 * B.T, C]), D=D)
    plant = replace(plant, input_labels=(*references, *ins), output_labels=labels, scales=scales)
    return _weighed(plant, w={r: _through([r]) for r in references}, n={}, z=weights, e={}, read=errors, driven=ins)


def _weighted(what: str, prefix: str, table: Mapping[str, Weight], choices: Sequence[str], dt: float) -> dict[str, Lti]:
    """Return the checked weights of signals, with prefixed labels."""
    result = {}
    for name, weight in mapping(what, table, "signals to weights").items():
        outside = prefix + known(what, name, choices)
        system = _weight(f"weight of {what} {name!r}", weight, dt)
        states = tuple(f"{outside}[{k}]" for k in range(len(system.A)))
        result[name] = replace(system, input_labels=(outside,), output_labels=(outside,), state_labels=states)
    return result


def _weight(what: str, weight: Any, dt: float) -> Lti:
    """Return a checked weight in the time of the plant, whose sampling time is ``dt``."""
    if not isinstance(weight, control.InputOutputSystem):
        return static(np.array([[real(what, weight)]]))
    system = of(weight, what, "a number or a StateSpace", sampled=dt != 0.0)
    if system.D.shape != (1, 1):
        raise ValueError(f"The {what} must have one input and one output, got (outputs, inputs) = {system.D.shape}.")
    if system.dt not in (0.0, dt):
        raise ValueError(
            f"The {what} must be in continuous time or have the sampling time of the plant, {exactly(dt)} s,"
            f" got {exactly(system.dt)} s."
        )
    unstable = system.poles[sides(system.poles, system.dt) >= 0]
    if len(unstable):
        at = f"{unstable[0]:.6g} rad/s" if system.dt == 0.0 else f"z = {unstable[0]:.6g}"
        raise ValueError(f"The {what} must be stable, got a pole at {at}.")
    return discrete_image(system, dt) if system.dt == 0.0 else system


def _through(signals: Sequence[str]) -> Lti:
    """Return a unit gain of some signals."""
    return static(np.eye(len(signals)), signals, signals)


def _incidence(groups: Sequence[list[tuple[str, str]]], signals: Sequence[tuple[str, str]]) -> Array:
    """Return the matrix with a row for each group of signals, 1 for those in the group."""
    return np.array([[float(signal in group) for signal in signals] for group in groups])


def select_channels(
    system: control.StateSpace, inputs: str | Sequence[str] | None = None, outputs: str | Sequence[str] | None = None
) -> control.StateSpace:
    """Select inputs and outputs of a system by label.

    Parameters
    ----------
    system : control.StateSpace
        System with labeled signals.
    inputs, outputs : str or sequence of str, optional
        Labels of the signals, in this order. If None, all.

    Returns
    -------
    control.StateSpace
        System with the same states.

    Raises
    ------
    TypeError, ValueError
        If `system` is not a system, if an entry is not finite, or if a label is unknown or repeated, or there is none.

    Examples
    --------
    >>> import boomctl as bc
    >>> boom = bc.spray_boom().to_statespace()
    >>> small = bc.synthesis.select_channels(boom, inputs="suspension_left", outputs=["stroke_left", "stroke_right"])
    >>> small.ninputs, small.noutputs, small.nstates == boom.nstates
    (1, 2, True)
    """
    plain = of(system, expected="StateSpace", any_time=True)
    some_names("input", inputs, plain.input_labels)
    some_names("output", outputs, plain.output_labels)
    return plain.select(inputs, outputs).statespace(system.name)
