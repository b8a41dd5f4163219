"""The sampled-data closed loop: exact plant, discrete controller, delay, limits, stops, friction.

A loop around a linear plant is run by the first applicable of four methods, a loop around a hub-beam by a fifth; the result's
``method`` names the method:

=====================  ==============================================================================================
"blocks"               no contact, sampled at every step, no quantized sensors, nothing added to signals: linear
                       between its limits, so that 32 samples are one product
"steps"                no contact, otherwise: step by step
"stops not reached"    end stops and no friction: run without stops by one of the methods above; accepted if no stroke
                       passes its stop at any of the finer steps that stops need
"contacts"             step by step, with stops and friction solved in each step
"exponential steps"    a hub-beam: its nonlinear equations in steps that are halved until the tolerance is reached
=====================  ==============================================================================================
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from boomctl.analysis.loops import SIGN_ADVICE, warn_of_sign
from boomctl.arrays import Array
from boomctl.checks import exactly, finite_array, instance, nonnegative, positive, sequence, truth
from boomctl.lti.machine_modes import MachineModes
from boomctl.lti.modal import sides
from boomctl.progress import computing
from boomctl.simulation.blocks import LONGEST_QUEUE, in_blocks, run_fast, run_without_contact
from boomctl.simulation.contact.contacts import StrokeLimit, contacts_of, parse_stops
from boomctl.simulation.contact.friction import CoulombFriction
from boomctl.simulation.contact.stepping import ContactLog, run_contact
from boomctl.simulation.contact.stops import merged_hits
from boomctl.simulation.controller import corrected, sampled_controller
from boomctl.simulation.machine.machine import Machine, reading_states
from boomctl.simulation.plant import ModalPlant, modal_plant
from boomctl.simulation.result import FrictionResult, LoopResult
from boomctl.simulation.signals import disturbance_rows, per_signal, sampled_noise, sampled_signals, time_grid
from boomctl.simulation.stepping import Added, ControlLog, Limits, LoopProblem, SampledRun, linear_loop, whole_steps
from boomctl.structure.model import SecondOrderModel
from boomctl.threads import one_blas_thread

if TYPE_CHECKING:
    import control

    from boomctl.simulation.controller import Controller
    from boomctl.simulation.machine.run import MachineLoop

_STOP_SUBSTEPS = 4  # Fewest steps between two requested times with stops: strokes between the times are checked.
# Factor on the error estimated from another number of substeps; the error varies with where in a step a slip ends.
_CAUTION = 3.0


@one_blas_thread
def simulate_loop(
    plant: control.StateSpace | control.TransferFunction | SecondOrderModel | Machine,
    controller: Controller | None,
    timepts: ArrayLike,
    disturbances: Mapping[str, ArrayLike] | ArrayLike | None,
    *,
    sample_time: float,
    delay: float = 0.0,
    control_limit: float | Mapping[str, float] | None = None,
    rate_limit: float | Mapping[str, float] | None = None,
    end_stop: StrokeLimit = None,
    quantization: float | Mapping[str, float] | None = None,
    anti_windup: bool = True,
    friction: CoulombFriction | None = None,
    method: str = "tustin",
    initial_state: ArrayLike | None = None,
    noise: float | Mapping[str, float] | None = None,
    seed: int = 0,
    reference: Mapping[str, ArrayLike] | None = None,
    feedforward: Mapping[str, ArrayLike] | None = None,
    sensors: Sequence[Any] = (),
    rtol: float = 1e-8,
    atol: float = 1e-10,
) -> LoopResult:
    """Simulate a plant under a sampled controller.

    Between samples, controls are held and disturbances are interpolated linearly.  A linear plant is discretized exactly, a
    hub-beam is integrated to ``rtol`` and ``atol``.  At each sample, the controller reads the outputs before the control
    update and computes a command, which is saturated at ``control_limit``, then limited in its rate to
    ``rate_limit``, and acts after ``delay``.

    Parameters
    ----------
    plant : control.StateSpace, control.TransferFunction, SecondOrderModel or AssumedModesBeam
        Continuous time, with named signals.  :func:`boomctl.with_state_outputs` adds a linear plant's states to its outputs.
        A model of more than 60 coordinates is truncated to its lowest 60 modes, with static correction.  A hub-beam has the
        inputs ``torque``, ``disturbance_torque`` (both on the hub) and ``tip_force`` (normal to the undeformed beam, in the
        frame of the hub), and the outputs ``hub_angle``, ``hub_speed``, ``tip_displacement``, ``root_moment``,
        ``tip_acceleration`` (absolute, normal to the undeformed beam), its ``sensors``, and each state named among the
        controller's inputs, as for :func:`boomctl.lqr`.
    controller : control.StateSpace, TransferFunction, a design, ScheduledController, TimeVaryingController or None
        ``u = K y``: its inputs are named as outputs of the plant, its outputs as inputs of the plant.  A discrete controller
        must have the time step ``sample_time``; a continuous controller is discretized.  A scheduled controller
        (:func:`boomctl.gain_schedule`) is discretized at each value, and scheduled on the measurement itself, not on its
        difference from the reference.  A :class:`boomctl.simulation.TimeVaryingController` has matrices for each sample.
        ``None``: open loop.
    timepts : (n,) array_like
        Times in equal steps [s]; the step must be a whole multiple of ``sample_time``, or vice versa.
    disturbances : mapping from input to (n,) array, (k, n) array or None
        Values at ``timepts``.  An array has one row for each input of the plant that the controller does not drive.
    sample_time : float
        Time between samples of the controller [s].
    delay : float
        Time from a sample until its control acts [s]; need not be a multiple of the sample time.
    control_limit, rate_limit : float or mapping from control to float, optional
        Maximum absolute control, and its maximum absolute rate of change [per second].
    end_stop : float or mapping, optional
        Hard, inelastic end stops: a limit on the outputs ``stroke_*``, with contact forces at the inputs
        ``suspension_*`` of the same suffix; or a mapping from output to a limit or to ``(limit, input)``.
    quantization : float or mapping from measurement to float, optional
        Resolution of the measurements.
    anti_windup : bool
        Correct the controller's state by the difference between applied and commanded control (back-calculation), with
        a gain proved to keep the state bounded if one control or all controls saturate. If no gain is found, there
        is no anti-windup and a warning is issued.
    friction : CoulombFriction, optional
        Dry friction in the plant.
    method : "tustin" or "zoh"
        Discretization of a continuous controller.
    initial_state : (states,) array_like, optional
        States of a ``StateSpace`` or a hub-beam at the first time; by default zero.
    noise : float or mapping from measurement to float, optional
        Standard deviation of the noise added to each measurement at each sample: normal, independent, before quantization.
    seed : int
        Seed of the noise.
    reference : mapping from measurement to (n,) array, optional
        Values at ``timepts``; the input of the controller is the measurement minus its reference.
    feedforward : mapping from control to (n,) array, optional
        Values at ``timepts``; added to the controller's commands, before the limits.
    sensors : sequence of BeamSensor
        Additional outputs of a hub-beam.
    rtol, atol : float
        Limit ``atol + rtol max |displacement|`` [m] on the error of a hub-beam's tip displacement, and on the error of the
        hub angle times the tip radius.  Linear plants are exact.

    Returns
    -------
    LoopResult
        Outputs, controls and disturbances over time by name, and the activity of limits and stops.

    Raises
    ------
    TypeError, ValueError
        If a shape is wrong, a signal is unknown, a value is not finite, times are not equally spaced, or the sampling rate is
        too low for the controller's poles.

    Warns
    -----
    FeedbackSignWarning
        If the loop is unstable with ``K`` and stable with ``-K``.

    Examples
    --------
    A hub turned to 0.5 rad, with a tip mass that the controller was not designed for:

    >>> import boomctl as bc
    >>> import control
    >>> import numpy as np
    >>> beam = bc.hub_beam(model="sfoam", modes=3)
    >>> gains = [[-150.0, -250.0]]
    >>> pd = control.ss([], [], [], gains, 0.01, inputs=["hub_angle", "hub_speed"], outputs=["torque"])
    >>> time = np.linspace(0.0, 20.0, 2001)
    >>> wanted = {"hub_angle": np.full(time.size, 0.5)}
    >>> run = bc.simulate_loop(beam.with_tip_mass(0.1), pd, time, None, sample_time=0.01, reference=wanted)
    >>> bool(abs(run["hub_angle"][-1] - 0.5) < 0.01)
    True
    """
    late = nonnegative("delay", delay)
    tolerance = positive("rtol", rtol), positive("atol", atol)
    if friction is not None:
        instance("friction", friction, CoulombFriction)
    modal: ModalPlant | MachineModes
    if isinstance(plant, Machine):
        for name, value in (("friction", friction), ("end_stop", end_stop)):
            if value is not None:
                raise ValueError(f"{name}: expected None for a hub-beam, which has no contacts")
        modal = plant._forced_modes(sequence("sensors", sensors, "BeamSensor"))
        modal = reading_states(modal, getattr(controller, "input_labels", ()))
        stops = []
    else:
        if sequence("sensors", sensors, "BeamSensor"):
            raise ValueError("sensors: expected none for a linear plant, which has outputs of its own")
        modal = modal_plant(plant)
        stops = parse_stops(end_stop, modal)
    grid = time_grid(timepts, sample_time)
    K = sampled_controller(controller, modal, float(sample_time), method)
    rows = disturbance_rows(disturbances, modal.input_labels, K.outputs, len(grid.time))
    limits = Limits(
        per_signal("control_limit", control_limit, K.outputs),
        per_signal("rate_limit", rate_limit, K.outputs) * float(sample_time),
        per_signal("quantization", quantization, K.inputs, zero=True),
    )
    K = corrected(K, limits.force, limits.rate, truth("anti_windup", anti_windup))
    added = Added(
        sampled_noise(noise, seed, K.inputs, grid.steps // grid.per_sample + 1),
        sampled_signals("reference", reference, K.inputs, grid),
        sampled_signals("feedforward", feedforward, K.outputs, grid),
    )
    if not isinstance(modal, ModalPlant):
        from boomctl.simulation.machine.run import MachineLoop  # brings casadi

        loop = MachineLoop(
            machine=modal,
            controller=K,
            grid=grid,
            W=grid.refined(rows),
            delay=late,
            limits=limits,
            start=_start(initial_state, modal.from_state),
            added=added,
        )
        with computing("closed loop"):
            return _machine_result(loop, *tolerance)
    start = _start(initial_state, modal.from_state)
    _check_strokes(stops, modal.C @ start + modal.D @ rows[:, 0], modal.output_labels)

    def problem(finer: int, touching: bool = True) -> LoopProblem:
        """Return the loop in steps finer by a factor."""
        steps = grid if finer == 1 else time_grid(timepts, sample_time, finer)
        maps = modal.step(steps.h, whole_steps(late, steps.h)[1])
        contacts = contacts_of(modal, maps, friction, stops, K.outputs) if touching else None
        return LoopProblem(
            plant=modal, maps=maps, contacts=contacts, controller=K, grid=steps, W=steps.refined(rows), delay=late,
            limits=limits, start=start, added=added,
        )  # fmt: skip

    substeps = _substeps(friction, bool(stops))
    p = problem(substeps)
    if stops and friction is None:
        whole = problem(1, touching=False)
        free = run_without_contact(whole, p)
        if free is not None:
            moving, log = free
            return _result(whole, log, moving[:, :: whole.grid.per_point], None, "stops not reached")
    log = p.new_log()
    if p.contacts is not None:
        moving, contact_log = run_contact(p, log, p.contacts)
        result = _result(p, log, moving, contact_log, "contacts")
        if friction is None:
            return result
        error = _friction_error(problem, substeps, friction.slip_output, moving, order=1 if contact_log.touched else 2)
        return replace(result, error_estimate=error)
    method = "blocks" if in_blocks(p) else "steps"
    return _result(p, log, run_fast(p, log)[:, :: p.grid.per_point], None, method)


def _check_strokes(stops: list[tuple[str, str, float]], outputs: Array, names: tuple[str, ...]) -> None:
    for output, _, limit in stops:
        value = float(outputs[names.index(output)])
        if abs(value) > limit:
            raise ValueError(
                f"end_stop: {output!r} is {exactly(value)} m at the first time, beyond its stop at {exactly(limit)} m"
            )


def _substeps(friction: CoulombFriction | None, stops: bool) -> int:
    """Return the number of steps between two requested times."""
    wanted = 1 if friction is None else friction.substeps
    return max(wanted, _STOP_SUBSTEPS) if stops else wanted


def _friction_error(
    problem: Callable[[int], LoopProblem], substeps: int, slip: str, moving: Array, order: int
) -> float:
    """Return the estimated error of a slip [m], from runs with fewer substeps, or with two instead of one.

    Errors are of second order in the step, where stops are touched of first order: an impact acts at the start of a step.
    """
    error = 0.0
    for number in {substeps // 2, 1} if substeps > 1 else {2}:
        try:
            other = problem(number)
        except ValueError:  # steps too long for the motion at the contact
            number = 2 * substeps
            other = problem(number)
        assert other.contacts is not None
        change = (run_contact(other, other.new_log(), other.contacts)[0] - moving)[
            other.plant.output_labels.index(slip)
        ]
        fraction = 1.0 / abs((substeps / number) ** order - 1.0)  # of the change
        error = max(error, _CAUTION * fraction * float(np.abs(change).max()))
    return error


def _start(initial: ArrayLike | None, from_state: Array) -> Array:
    if initial is None:
        return np.zeros(len(from_state))
    state, n = finite_array("initial_state", initial, ndim=1), from_state.shape[1]
    if state.shape != (n,):
        raise ValueError(f"initial_state has shape {state.shape}; expected {(n,)}, one a state")
    return from_state @ state


def _result(p: LoopProblem, log: ControlLog, moving: Array, contacts: ContactLog | None, method: str) -> LoopResult:
    """Return signals by name; ``moving`` is the outputs' dependence on the states, at the requested times."""
    plant, grid, controls = p.plant, p.grid, p.at_points(log)
    outputs = moving + plant.D @ p.W[:, :: grid.per_point] + plant.D[:, p.controller.driven] @ controls[0]
    sampled = _from_sample_to_sample(p)
    advice = _sign_advice(p, sampled)
    if not np.isfinite(outputs).all():
        raise ValueError(f"the loop diverges: its outputs overflow before the last of timepts. {advice}".rstrip())
    warn_of_sign(advice)
    friction = None
    if contacts is not None and p.contacts is not None and p.contacts.law is not None:
        mean = contacts.friction.reshape(-1, grid.per_point).mean(axis=1)
        friction = FrictionResult(
            force=np.concatenate([[0.0], mean]),
            stick_fraction=float(contacts.stuck.mean()),
            dissipated_energy=float(contacts.dissipated.sum()),
            force_input=p.contacts.law.force_input,
            slip_output=p.contacts.law.slip_output,
        )
    names = [] if p.contacts is None else [stop.output for stop in p.contacts.stops]
    touched = [] if contacts is None else contacts.touched
    return replace(
        _loop_result(p, plant, log, outputs, controls),
        stop_contacts=merged_hits(names, grid.h, float(grid.time[0]), touched),
        friction=friction,
        method=method,
        _sampled=sampled,
    )


def _loop_result(
    p: SampledRun, plant: ModalPlant | MachineModes, log: ControlLog, outputs: Array, controls: tuple[Array, Array]
) -> LoopResult:
    """Return signals of any run by name: outputs, applied controls and commands at the requested times."""
    K, rows = p.controller, p.W[:, :: p.grid.per_point]
    applied, commanded = (dict(zip(K.outputs, item, strict=True)) for item in controls)
    return LoopResult(
        time=p.grid.time,
        outputs=dict(zip(plant.output_labels, outputs, strict=True)),
        controls=applied,
        commanded=commanded,
        disturbances={name: row for name, row in zip(plant.input_labels, rows, strict=True) if row.any()},
        saturation_fraction=dict(zip(K.outputs, log.saturated.mean(axis=0).tolist(), strict=True)),
        rate_limit_fraction=dict(zip(K.outputs, log.slewed.mean(axis=0).tolist(), strict=True)),
        stop_contacts=(),
        friction=None,
        sample_time=p.grid.per_sample * p.grid.h,
        delay=p.delay,
        units=dict(plant.units),
    )


def _from_sample_to_sample(p: LoopProblem) -> Array | None:
    """Return the loop's matrix from one sample to the next without limits; None if it changes or the delay is long."""
    dt = p.grid.per_sample * p.grid.h
    late = whole_steps(p.delay, dt)
    if p.controller.laws is not None or late[0] >= LONGEST_QUEUE:
        return None
    loop = p.linear if p.grid.per_sample == 1 else linear_loop(p, p.plant.step(dt, late[1]), late)
    return loop.Phi


def _sign_advice(p: LoopProblem, sampled: Array | None) -> str:
    """Return the advice to pass ``-K`` if the loop is unstable with ``K`` and stable with ``-K``, otherwise nothing."""
    dt, K = p.grid.per_sample * p.grid.h, p.controller
    if sampled is None or not (sides(np.linalg.eigvals(sampled), dt) > 0).any():
        return ""
    negative = _from_sample_to_sample(replace(p, controller=replace(K, C=-K.C, D=-K.D)))
    assert negative is not None
    return SIGN_ADVICE if (sides(np.linalg.eigvals(negative), dt) < 0).all() else ""


def _machine_result(p: MachineLoop, rtol: float, atol: float) -> LoopResult:
    """Run a loop around a hub-beam and return its signals by name."""
    from boomctl.simulation.machine.run import measured, run_to_tolerance

    moving, log, error = run_to_tolerance(p, rtol, atol)
    states, controls = moving[:, :: p.grid.per_point], p.at_points(log)
    return replace(
        _loop_result(p, p.machine, log, measured(p, states, controls[0]), controls),
        method="exponential steps",
        error_estimate=error,
        states=(p.machine.to_state @ states).T,
    )
