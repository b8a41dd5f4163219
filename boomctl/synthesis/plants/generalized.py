"""Generalized plants put together from a plant and weights at its signals, in state space; every name survives."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
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
from boomctl.synthesis.plants.full_plant import carrying, plant_within, warn_of_lost_channels
from boomctl.threads import one_blas_thread

Weight = float | control.StateSpace | control.TransferFunction


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
    """Return a generalized plant: what disturbs, what shall be small, what is measured and what is set, with weights.

    A weight is a number or a stable system with one input and one output (`low_pass`, `high_pass`, `band_pass`,
    `shelf`).  Numbers add no states; inputs and outputs that nobody names are left out.  Of a discrete plant a weight has the
    same sampling time; one in continuous time stands for its Tustin discretisation.

    Parameters
    ----------
    plant : control.StateSpace, SecondOrderModel or ReductionResult
        With named signals, in continuous or discrete time (:func:`boomctl.analysis.sample_plant`).  Of a reduction, what
        `reduce` returns, the reduced system is taken; the generalized plant remembers its error, and `h_infinity` says
        what the design is worth on the full one.  Other operations on the generalized plant forget it.
    disturbances : mapping from input to weight
        What drives the plant; ``"actuator_sym"`` becomes the input ``"w_actuator_sym"`` in front of its weight.
    performance : mapping from output to weight
        What shall be small; ``"tip_sym"`` becomes the output ``"z_tip_sym"`` behind its weight.
    effort : mapping from control to weight, optional
        What the controls cost; ``"suspension_sym"`` becomes the output ``"z_suspension_sym"``.
    noise : mapping from measurement to weight, optional
        Noise levels or filters; ``"stroke_sym"`` becomes the input ``"n_stroke_sym"``, added to that measurement.
    measurements, controls : str or sequence of str
        Outputs that the controller reads and inputs that it sets; they keep their names.

    Returns
    -------
    control.StateSpace
        Inputs: disturbances, noises, controls.  Outputs: performance, effort, measurements.

    Raises
    ------
    TypeError, ValueError
        Another kind of system; unknown or repeated signals; a weight that is not a number or a stable system with one
        input and one output, or has another sampling time than the plant; nothing to disturb or nothing that shall be small.

    Warns
    -----
    ReductionWarning
        The error of the reduction is as large as all that the reduced plant does from disturbances to performance
        outputs, or from controls to measurements.

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
    ins, outs = system.input_labels, system.output_labels
    read, set_ = names("measurement", measurements, outs), names("control", controls, ins)
    dt = system.dt
    w = _weighted("disturbance", "w_", disturbances, ins, dt)
    n = _weighted("noise of measurement", "n_", {} if noise is None else noise, read, dt)
    z = _weighted("performance output", "z_", performance, outs, dt)
    e = _weighted("effort of control", "z_", {} if effort is None else effort, set_, dt)
    for what, result in (
        ("disturbance or noise", w | n),
        ("performance output or effort", z | e),
        ("measurement", read),
        ("control", set_),
    ):
        if not result:
            raise ValueError(f"expected at least one {what}")
    ways = {
        "disturbances to performance outputs": (tuple(w), tuple(z)),
        "controls to measurements": (set_, read),
    }
    warn_of_lost_channels(plant, ways)
    around = partial(_weighed, w=w, n=n, z=z, e=e, read=read, set_=set_)
    return carrying(around(system).statespace("generalized_plant"), plant, around)


def _weighed(
    system: Lti,
    *,
    w: dict[str, Lti],
    n: dict[str, Lti],
    z: dict[str, Lti],
    e: dict[str, Lti],
    read: tuple[str, ...],
    set_: tuple[str, ...],
) -> Lti:
    """Return a plant with weights: of disturbances, noises, outputs and efforts, then measurements and controls."""
    ins, outs = system.input_labels, system.output_labels
    # disturbances and noises pass their weights; the plant takes its inputs, beside it pass noises and controls;
    # what is shown, costs and is read is picked and passes its weights
    first = append(*w.values(), *n.values(), _through(set_))
    middle = append(system, _through((*n, *set_)))
    last = append(*z.values(), *e.values(), _through(read))
    entry = blocks(
        [
            [_selection(ins, w).T, np.zeros((len(ins), len(n))), _selection(ins, set_).T],
            [np.zeros((len(n) + len(set_), len(w))), np.eye(len(n) + len(set_))],
        ]
    )
    leave = blocks(
        [
            [_selection(outs, z), np.zeros((len(z), len(n) + len(set_)))],
            [np.zeros((len(e), len(outs) + len(n))), _selection(set_, e)],
            [_selection(outs, read), _selection(read, n).T, np.zeros((len(read), len(set_)))],
        ]
    )
    return replace(_joined(first, entry, middle, leave, last), dt=system.dt, scales=system.scales)


@one_blas_thread
def mixed_sensitivity(
    plant: control.StateSpace | SecondOrderModel | ReductionResult,
    W1: Weight | None = None,
    W2: Weight | None = None,
    W3: Weight | None = None,
) -> control.StateSpace:
    """Return the generalized plant of mixed sensitivity: weighted control errors, controls and outputs, for references.

    The controller reads the control errors ``e = r - y``.  The closed loop is ``[W1 S; W2 K S; W3 T]``, with
    ``S = (I + G K)^-1`` and ``T = G K S``.

    Parameters
    ----------
    plant : control.StateSpace, SecondOrderModel or ReductionResult
        As for `generalized_plant`; all inputs are controls, all outputs are controlled.
    W1, W2, W3 : float, control.StateSpace or control.TransferFunction, optional
        Weights of errors, controls and outputs, each for every signal of its kind; None leaves them out.

    Returns
    -------
    control.StateSpace
        Inputs ``"r_<output>"`` and the plant's; outputs ``"z_error_<output>"``, ``"z_<input>"``, ``"z_<output>"`` and
        the measurements ``"error_<output>"``.

    Raises
    ------
    TypeError, ValueError
        Another kind of system or weight, as for `generalized_plant`; no weight at all.

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
    0.92
    """
    system = plant_within(plant)
    ins, outs = system.input_labels, system.output_labels
    errors = tuple(f"error_{name}" for name in outs)
    weights = [
        *([] if W1 is None else _weighted("error", "z_", dict.fromkeys(errors, W1), errors, system.dt).values()),
        *([] if W2 is None else _weighted("control", "z_", dict.fromkeys(ins, W2), ins, system.dt).values()),
        *([] if W3 is None else _weighted("output", "z_", dict.fromkeys(outs, W3), outs, system.dt).values()),
    ]
    if not weights:
        raise ValueError("W1, W2, W3: expected at least one weight")
    around = partial(_weighed_sensitivity, weights=weights, given=[W is not None for W in (W1, W2, W3)])
    warn_of_lost_channels(plant, {"controls to measurements": (ins, outs)})
    return carrying(around(system).statespace("generalized_plant"), plant, around)


def _weighed_sensitivity(system: Lti, *, weights: list[Lti], given: list[bool]) -> Lti:
    """Return a plant under control errors, with the weights of errors, controls and outputs that are given."""
    ins, outs = system.input_labels, system.output_labels
    errors = tuple(f"error_{name}" for name in outs)
    p, m = len(outs), len(ins)
    first = _through((*(f"r_{name}" for name in outs), *ins))
    middle = append(_through(outs), system, _through(ins))
    entry = blocks([[np.eye(p), np.zeros((p, m))], [np.zeros((m, p)), np.eye(m)], [np.zeros((m, p)), np.eye(m)]])
    error = np.hstack([np.eye(p), -np.eye(p), np.zeros((p, m))])
    output = np.hstack([np.zeros((p, p)), np.eye(p), np.zeros((p, m))])
    effort = np.hstack([np.zeros((m, 2 * p)), np.eye(m)])
    shown = [rows for rows, there in zip((error, effort, output), given, strict=True) if there]
    joined = _joined(first, entry, middle, np.vstack([*shown, error]), append(*weights, _through(errors)))
    scales = system.scales
    if scales:
        scales = {**scales, **{f"error_{name}": scales.get(name, 1.0) for name in outs}}
    return replace(joined, dt=system.dt, scales=scales)


def _joined(first: Lti, entry: Array, middle: Lti, leave: Array, last: Lti) -> Lti:
    """Return what is driven by weights, mixed into the plant, mixed again and weighed; no name may come twice."""
    joined = series(series(series(series(first, static(entry)), middle), static(leave)), last)
    for what, listed in (("input", joined.input_labels), ("output", joined.output_labels)):
        twice = [name for name in listed if listed.count(name) > 1]
        if twice:
            raise ValueError(f"{what} {twice[0]!r} would exist twice")
    return joined


def _weighted(what: str, prefix: str, given: Mapping[str, Weight], choices: Sequence[str], dt: float) -> dict[str, Lti]:
    """Return the weight of each signal in ``given``, named as outside; signals unknown and weights that fail are refused."""
    result = {}
    for name, weight in mapping(what, given, "signals to weights").items():
        outside = prefix + known(what, name, choices)
        system = _weight(f"weight of {what} {name!r}", weight, dt)
        states = tuple(f"{outside}[{k}]" for k in range(len(system.A)))
        result[name] = replace(system, input_labels=(outside,), output_labels=(outside,), state_labels=states)
    return result


def _weight(what: str, weight: Any, dt: float) -> Lti:
    """Return a weight in the time of the plant, whose sampling time is ``dt``."""
    if not isinstance(weight, control.InputOutputSystem):
        return static(np.array([[real(what, weight)]]))
    system = of(weight, what, "a number or a StateSpace", sampled=dt != 0.0)
    outputs, inputs = system.D.shape
    if (outputs, inputs) != (1, 1):
        shape = f"{inputs} input(s) and {outputs} output(s)"
        raise ValueError(f"{what}: expected a system with one input and one output, got {shape}")
    if system.dt not in (0.0, dt):
        raise ValueError(
            f"{what}: expected continuous time or the plant's sampling time, {exactly(dt)} s, got {exactly(system.dt)} s"
        )
    lasting = system.poles[sides(system.poles, system.dt) >= 0]
    if len(lasting):
        worst = lasting[np.argmax(lasting.real if system.dt == 0.0 else np.abs(lasting))]
        at = f"{worst:.6g} rad/s" if system.dt == 0.0 else f"z = {worst:.6g}"
        raise ValueError(f"{what}: expected a stable system, this one has a pole at {at}")
    return discrete_image(system, dt) if system.dt == 0.0 else system


def _through(signals: Sequence[str]) -> Lti:
    """Return signals that pass unchanged."""
    return static(np.eye(len(signals)), signals, signals)


def _selection(choices: Sequence[str], wanted: Iterable[str]) -> Array:
    """Return the matrix that picks the wanted signals, its rows, from all."""
    return np.eye(len(choices))[[choices.index(name) for name in wanted]]


def select_channels(
    system: control.StateSpace, inputs: str | Sequence[str] | None = None, outputs: str | Sequence[str] | None = None
) -> control.StateSpace:
    """Return a system between some of its signals, found by name; the states and the sampling time stay.

    Parameters
    ----------
    system : control.StateSpace
        The system, signals named.
    inputs, outputs : str or sequence of str, optional
        Names of the signals to keep, in this order; by default all.

    Returns
    -------
    control.StateSpace
        The same states with fewer signals.

    Raises
    ------
    TypeError, ValueError
        Another kind of system, not finite; an unknown signal, one asked for twice, or none on a side.

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
