"""Generalised plants put together from named pieces, in state space; every name survives."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from boomctl.checks import finite_array, names
from boomctl.lti.system import Lti
from boomctl.structure.model import SecondOrderModel
from boomctl.synthesis.plants.blocks import (
    diagonal,
    named_system,
    rows_of,
    series,
    states_of,
    statespace,
    through,
    weighed,
)

if TYPE_CHECKING:
    import control

    Weight = float | control.StateSpace


def generalized_plant(
    plant: "control.StateSpace | SecondOrderModel",
    *,
    disturbances: "Mapping[str, Weight]",
    performance: "Mapping[str, Weight]",
    effort: "Mapping[str, Weight] | None" = None,
    noises: "Mapping[str, Weight] | None" = None,
    measurements: str | Sequence[str],
    controls: str | Sequence[str],
) -> "control.StateSpace":
    """Return a plant with weighted disturbances and noises, weighted outputs and efforts, measurements and controls.

    A weight is a number or a stable system with one input and one output (`low_pass`, `high_pass`, `band_pass`,
    `shelf`).  Numbers add no states; inputs and outputs that nobody names are left out.

    Parameters
    ----------
    plant : control.StateSpace or SecondOrderModel
        In continuous time, with named signals.
    disturbances : mapping from input to weight
        What drives the plant; ``"actuator_sym"`` becomes the input ``"w_actuator_sym"`` in front of its weight.
    performance : mapping from output to weight
        What shall be small; ``"tip_sym"`` becomes the output ``"z_tip_sym"`` behind its weight.
    effort : mapping from control to weight, optional
        What the controls cost; ``"suspension_sym"`` becomes the output ``"z_suspension_sym"``.
    noises : mapping from measurement to weight, optional
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
        input and one output, in continuous time; nothing to disturb or nothing that shall be small.
    """
    system = statespace(plant)
    ins, outs = list(system.input_labels), list(system.output_labels)
    read, set_ = names("measurement", measurements, outs), names("control", controls, ins)
    w = weighed("disturbance", "w_", disturbances, ins)
    n = weighed("noise of measurement", "n_", {} if noises is None else noises, read)
    z = weighed("performance output", "z_", performance, outs)
    e = weighed("effort of control", "z_", {} if effort is None else effort, set_)
    for what, found in (
        ("disturbance or noise", w + n),
        ("performance output or effort", z + e),
        ("measurement", read),
    ):
        if not found:
            raise ValueError(f"expected at least one {what}")
    if not set_:
        raise ValueError("expected at least one control")
    core = Lti(system.A, system.B, system.C, system.D)
    first = diagonal([*(p.system for p in w + n), through(len(set_))])
    entry = np.hstack([rows_of(ins, [p.signal for p in w]), np.zeros((len(ins), len(n))), rows_of(ins, set_)])
    aside = np.hstack([np.zeros((len(n) + len(set_), len(w))), np.eye(len(n) + len(set_))])
    middle = diagonal([core, through(len(n) + len(set_))])
    shown = rows_of(outs, [p.signal for p in z]).T
    costs = rows_of(list(set_), [p.signal for p in e]).T
    noisy = rows_of(list(read), [p.signal for p in n])
    leave = np.block(
        [
            [shown, np.zeros((len(z), len(n) + len(set_)))],
            [np.zeros((len(e), len(outs) + len(n))), costs],
            [rows_of(outs, read).T, noisy, np.zeros((len(read), len(set_)))],
        ]
    )
    last = diagonal([*(p.system for p in z + e), through(len(read))])
    joined = series(series(first, np.vstack([entry, aside]), middle), leave, last)
    states = [*states_of(w + n), *system.state_labels, *states_of(z + e)]
    return named_system(joined, [p.name for p in w + n] + list(set_), [p.name for p in z + e] + list(read), states)


def mixed_sensitivity(
    plant: "control.StateSpace | SecondOrderModel",
    W1: "Weight | None" = None,
    W2: "Weight | None" = None,
    W3: "Weight | None" = None,
) -> "control.StateSpace":
    """Return the generalised plant of mixed sensitivity: weighted control error, control and output, per reference.

    The controller reads the control errors ``e = r - y``.  The closed loop is ``[W1 S; W2 K S; W3 T]``, with
    ``S = (I + G K)^-1`` and ``T = G K S``.

    Parameters
    ----------
    plant : control.StateSpace or SecondOrderModel
        In continuous time, with named signals; all inputs are controls, all outputs are controlled.
    W1, W2, W3 : float or control.StateSpace, optional
        Weights of errors, controls and outputs, each for every signal of its kind; None leaves them out.

    Returns
    -------
    control.StateSpace
        Inputs ``"r_<output>"`` and the plant's; outputs ``"z_error_<output>"``, ``"z_<input>"``, ``"z_<output>"`` and
        the measurements ``"error_<output>"``.

    Raises
    ------
    TypeError, ValueError
        Another kind of system or weight, as of `generalized_plant`; no weight at all.
    """
    system = statespace(plant)
    ins, outs = list(system.input_labels), list(system.output_labels)
    errors = [f"error_{name}" for name in outs]
    parts = [
        *([] if W1 is None else weighed("error", "z_", dict.fromkeys(errors, W1), errors)),
        *([] if W2 is None else weighed("control", "z_", dict.fromkeys(ins, W2), ins)),
        *([] if W3 is None else weighed("output", "z_", dict.fromkeys(outs, W3), outs)),
    ]
    if not parts:
        raise ValueError("W1, W2, W3: expected at least one weight")
    p, m = len(outs), len(ins)
    core = diagonal([through(p), Lti(system.A, system.B, system.C, system.D), through(m)])
    entry = np.block([[np.eye(p), np.zeros((p, m))], [np.zeros((m, p)), np.eye(m)], [np.zeros((m, p)), np.eye(m)]])
    error = np.hstack([np.eye(p), -np.eye(p), np.zeros((p, m))])
    output = np.hstack([np.zeros((p, p)), np.eye(p), np.zeros((p, m))])
    control_rows = np.hstack([np.zeros((m, 2 * p)), np.eye(m)])
    shown = [rows for rows, weight in ((error, W1), (control_rows, W2), (output, W3)) if weight is not None]
    last = diagonal([*(part.system for part in parts), through(p)])
    joined = series(series(through(p + m), entry, core), np.vstack([*shown, error]), last)
    inputs, outputs = [f"r_{name}" for name in outs] + ins, [part.name for part in parts] + errors
    return named_system(joined, inputs, outputs, [*system.state_labels, *states_of(parts)])


def select_channels(
    system: "control.StateSpace", inputs: str | Sequence[str] | None = None, outputs: str | Sequence[str] | None = None
) -> "control.StateSpace":
    """Return a system between some of its signals, by name; the states and the sampling time stay.

    Raises
    ------
    TypeError, ValueError
        Another kind of system, not finite; an unknown signal, one asked for twice, or none on a side.
    """
    from boomctl.lti.python_control import control

    if not isinstance(system, control.StateSpace):
        raise TypeError(f"system: expected a StateSpace, got {type(system).__name__}")
    for name in "ABCD":
        finite_array(f"{name} of the system", getattr(system, name))
    ins, outs = list(system.input_labels), list(system.output_labels)
    chosen_in, chosen_out = names("input", inputs, ins), names("output", outputs, outs)
    for what, chosen in (("input", chosen_in), ("output", chosen_out)):
        if not chosen:
            raise ValueError(f"{what}s: expected at least one")
    columns, rows = [ins.index(name) for name in chosen_in], [outs.index(name) for name in chosen_out]
    part = Lti(system.A, system.B[:, columns], system.C[rows], system.D[np.ix_(rows, columns)])
    return named_system(part, list(chosen_in), list(chosen_out), list(system.state_labels), system.dt)
