"""Scenes of sampled loops with a limited control: of the boom, which is linear, and of the hub-beam.

Other programs: python-control, and SciPy's ``solve_ivp`` restarted at each sample.
"""

import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

from boomctl.arrays import Array
from boomctl.boom.factory import spray_boom
from boomctl.boom.model import ACTUATORS, TIPS
from boomctl.boom.parameters import BoomParameters
from boomctl.lab.benchmark.exact_steps import extended_maps, extrapolated_step
from boomctl.lab.benchmark.plain_boom import varied
from boomctl.lab.benchmark.scene import Scene, Setting, relative_error, settings, sized
from boomctl.lab.benchmark.scenes.hub_beam import machine
from boomctl.lti.python_control import control
from boomctl.lti.rounding import SUMMED
from boomctl.rotating_beam.assumed_modes import AssumedModesBeam
from boomctl.simulation.loop import simulate_loop
from boomctl.structure.model import SecondOrderModel
from boomctl.structure.response.modes import undamped_modes

_DT, _END = 1e-3, 1.0  # s: between samples, and of the motion; run times are proportional to it
_TIME = np.linspace(0.0, _END, round(_END / _DT) + 1)
_BOOM_MODES, _FORCE = 20, 0.25  # of the boom's plant; limit of the forces [N], so small that it is met
_STROKES, _FORCES = ("stroke_left", "stroke_right"), ("suspension_left", "suspension_right")
_GAINS, _ANGLE, _TORQUE = (-150.0, -250.0), 0.5, 60.0  # N m/rad, N m s/rad; rad; N m
_BEAM_MODES, _TIP_MASS = 5, 0.1  # of SFOAM; kg
_CONTINUOUS = "python-control's controller is continuous, which is an error of its own, at which its settings end."


@dataclass(frozen=True)
class Loop:
    """A sampled loop: the controller reads at each sample, its limited control is held to the next.

    Attributes
    ----------
    rate : callable
        Takes time, state and control to the rate of the state.
    read : callable
        Takes index of the sample and state to what is measured, and what is compared.
    law : control.StateSpace
        The controller, discrete.
    limit : float
        Of each control.
    time : ndarray
        The samples [s].
    states : int
        Number of states of the plant.
    """

    rate: Callable[[float, Any, Any], Any]
    read: Callable[[int, Array], tuple[Array, Array]]
    law: control.StateSpace
    limit: float
    time: Array
    states: int

    def advanced(self, advance: Callable[[int, Array, Array], Array], kind: Any = float) -> Array:
        """Return what is compared; ``advance`` takes index, state and control to the state at the next sample."""
        law, x, state = self.law, np.zeros(self.states, kind), np.zeros(self.law.nstates, kind)
        result = []
        for k in range(len(self.time)):
            measured, compared = self.read(k, x)
            result.append(np.asarray(compared, float))
            if k < len(self.time) - 1:
                u = np.clip(law.C @ state + law.D @ measured, -self.limit, self.limit)
                state = law.A @ state + law.B @ measured
                x = advance(k, x, u)
        return np.array(result)

    def restarted(self, method: str, rtol: float) -> Array:
        """Return what is compared, by ``solve_ivp`` from each sample to the next."""
        options = {"rtol": max(rtol, 3e-14), "atol": 1e-3 * rtol}

        def advance(k: int, x: Array, u: Array) -> Array:
            ends = self.time[k], self.time[k + 1]
            return solve_ivp(lambda t, x: self.rate(t, x, u), ends, x, method, **options).y[:, -1]

        return self.advanced(advance)


def interconnected(
    plant: Any, law: control.StateSpace, limit: float, inputs: list[str], outputs: list[str], *more: Any
) -> control.NonlinearIOSystem:
    """Return python-control's loop of a plant, a controller and a limit of each control.

    Parameters
    ----------
    plant : control.StateSpace or control.NonlinearIOSystem
    law : control.StateSpace
        In the plant's time; its inputs are outputs of the plant or inputs of the loop, its outputs inputs of the plant.
    limit : float
    inputs, outputs : list of str
        Of the loop.
    *more
        Further systems of the loop.
    """
    names = [str(name) for name in law.output_labels]
    commands = [f"asked_{name}" for name in names]
    law = control.ss(law.A, law.B, law.C, law.D, plant.dt, inputs=law.input_labels, outputs=commands, name="law")

    def clipped(t: float, x: Array, u: Array, params: dict[str, Any]) -> Array:
        return np.clip(u, -limit, limit)

    limits = control.nlsys(None, clipped, inputs=commands, outputs=names, dt=plant.dt, name="limits")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # outputs that no one reads
        return control.interconnect(
            [plant, law, limits, *more], inplist=inputs, inputs=inputs, outlist=outputs, outputs=outputs
        )


def responded(loop: control.NonlinearIOSystem, time: Array, inputs: Array, method: str, rtol: float) -> Array:
    """Return the outputs of a loop by ``input_output_response``, (samples, outputs)."""
    options = {"rtol": rtol, "atol": 1e-3 * rtol}
    result = control.input_output_response(loop, time, inputs, solve_ivp_method=method, solve_ivp_kwargs=options)
    return np.asarray(result.outputs).reshape(-1, len(time)).T


def _peers(restarted: Callable[..., Array], continuous: Callable[..., Array]) -> Iterator[Setting]:
    """Yield the settings of SciPy and python-control; both take method, tolerance, problem and change."""
    for method, rtols in (("RK45", (1e-3, 1e-6, 1e-9)), ("DOP853", (1e-3, 1e-6, 1e-9)), ("LSODA", (1e-3, 1e-6))):
        cases = [(method, rtol) for rtol in rtols]
        yield from settings(f"solve_ivp {method}, restarted", "rtol {1:.0e}", cases, restarted)
        yield from settings(f"input_output_response, {method}", "rtol {1:.0e}", cases[:2], continuous)


@dataclass(frozen=True)
class BoomLoop:
    """The boom's lowest modes, a spring and damper law on its strokes, and the motion of all inputs at all samples."""

    plant: control.StateSpace
    law: control.StateSpace
    motion: Array

    @classmethod
    def of(cls, change: float = 0.0, modes: int = _BOOM_MODES) -> "BoomLoop":
        """Return the loop of a boom with other springs."""
        model = spray_boom(varied(BoomParameters(), change), elements=20)
        _, shapes = undamped_modes(model.structure, modes)
        modal = model.structure.projected(shapes, tuple(f"mode{k}" for k in range(modes)))
        plant = SecondOrderModel.of(modal, model.ports.congruent(shapes)).to_statespace()
        names: dict[str, Any] = {"inputs": list(_STROKES), "outputs": list(_FORCES)}
        law = control.ss(-60.0 * np.eye(2), 60.0 * np.eye(2), 300.0 * np.eye(2), -300.0 * np.eye(2), **names)
        motion = np.zeros((plant.ninputs, len(_TIME)))
        motion[[plant.input_labels.index(name) for name in ACTUATORS]] = _rough_ground(_TIME)
        return cls(plant, law, motion)

    def indices(self, names: tuple[str, ...], inputs: bool = False) -> list[int]:
        """Return the places of signals among the plant's outputs, or inputs."""
        labels = self.plant.input_labels if inputs else self.plant.output_labels
        return [labels.index(name) for name in names]

    @property
    def loop(self) -> Loop:
        """The loop as others solve it."""
        P, W = self.plant, self.motion
        driven, rates = P.B[:, self.indices(_FORCES, inputs=True)], np.diff(W, axis=1) / _DT
        strokes, tips = self.indices(_STROKES), self.indices(TIPS)

        def rate(t: float, x: Array, u: Array) -> Array:
            k = min(int(t / _DT + 1e-6), len(_TIME) - 2)
            return P.A @ x + P.B @ (W[:, k] + rates[:, k] * (t - _TIME[k])) + driven @ u

        def read(k: int, x: Array) -> tuple[Array, Array]:
            y = P.C @ x + P.D @ W[:, k]
            return y[strokes], y[tips]

        return Loop(rate, read, self.law.sample(_DT, method="bilinear"), _FORCE, _TIME, P.nstates)

    def exact(self) -> Array:
        """Return the tips by maps from sample to sample in extended precision."""
        Phi, held, ramp = extended_maps(self.plant.A, self.plant.B, _DT)
        forcing = held @ self.motion[:, :-1] + ramp @ np.diff(self.motion, axis=1)
        driven = held[:, self.indices(_FORCES, inputs=True)]
        return self.loop.advanced(lambda k, x, u: Phi @ x + driven @ u + forcing[:, k], np.longdouble)

    def simulated(self, limit: float = _FORCE) -> Array:
        """Return the tips by this package."""
        wheels: dict[str, Array] = dict(zip(ACTUATORS, self.motion[self.indices(ACTUATORS, inputs=True)], strict=True))
        options: dict[str, Any] = {
            "sample_time": _DT,
            "control_limit": limit,
            "anti_windup": False,
        }  # others have none
        result = simulate_loop(self.plant, self.law, _TIME, wheels, **options)
        return np.array([result[name] for name in TIPS]).T

    def responded(self, method: str, rtol: float) -> Array:
        """Return the tips by python-control, whose controller is continuous."""
        P = self.plant
        plant = control.ss(P.A, P.B, P.C, P.D, inputs=P.input_labels, outputs=P.output_labels, name="plant")
        loop = interconnected(plant, self.law, _FORCE, list(ACTUATORS), list(TIPS))
        return responded(loop, _TIME, self.motion[self.indices(ACTUATORS, inputs=True)], method, rtol)


def _rough_ground(time: Array) -> Array:
    """Return the motion of the two actuators [m]: sines from 0.1 to 5 Hz, equal in velocity, of fixed phases."""
    freq_hz = np.arange(0.1, 5.0, 0.1)
    phases = 2.0 * np.pi * np.modf(np.outer([0.618034, 0.414214], np.arange(1, len(freq_hz) + 1) ** 2))[0]
    lines = [(1.5e-3 / freq_hz) @ np.sin(2 * np.pi * np.outer(freq_hz, time) + phase[:, None]) for phase in phases]
    return np.array(lines) - np.array(lines)[:, :1]


def boom_loop() -> Scene:
    """Return the scene of the boom's suspension."""

    def ours(modes: int, problem: BoomLoop, change: float) -> Array:
        return BoomLoop.of(change, modes).simulated()

    def theirs(modes: int, problem: BoomLoop, change: float) -> Array:
        return BoomLoop.of(change, modes).loop.restarted("RK45", 1e-6)

    call = f"bc.simulate_loop(plant, controller, time, motion, sample_time={_DT:g}, control_limit={_FORCE:g})"
    return Scene(
        title=f"Sampled suspension with a force limit, {_END:g} s at 1 kHz",
        question=f"From the boom's parameters to the motion of its tips over rough ground, {_FORCE:g} N at most.",
        measure=f"Largest error over the largest displacement, against extended precision; at least {SUMMED:.0e}.",
        problem=BoomLoop.of,
        reference=lambda problem: problem.exact(),
        error=relative_error(SUMMED),
        methods=(
            *settings("simulate_loop", "exact", (_BOOM_MODES,), ours, ours=True, call=call),
            *_peers(
                lambda method, rtol, problem, change: BoomLoop.of(change).loop.restarted(method, rtol),
                lambda method, rtol, problem, change: BoomLoop.of(change).responded(method, rtol),
            ),
            *sized(
                settings("simulate_loop", "{} modes", (5, 10, 20), ours, ours=True),
                settings("solve_ivp RK45, restarted", "{} modes", (5, 10, 20), theirs),
            ),
        ),
        remarks=(_CONTINUOUS, "The modes of the plant are ours, computed in everybody's calls."),
    )


def beam(change: float = 0.0, modes: int = _BEAM_MODES) -> AssumedModesBeam:
    """Return the hub-beam of the scene."""
    return AssumedModesBeam(replace(machine(change), tip_mass=_TIP_MASS), "sfoam", modes)


def beam_law(dt: float = 0.0) -> control.StateSpace:
    """Return the feedback of angle and speed of the hub."""
    return control.ss([], [], [], [_GAINS], dt, inputs=["hub_angle", "hub_speed"], outputs=["torque"])


def simulated(beam: AssumedModesBeam, time: Array, rtol: float) -> Array:
    """Return the tip's displacement by this package."""
    options: dict[str, Any] = {"control_limit": _TORQUE, "reference": {"hub_angle": np.full(time.size, _ANGLE)}}
    options |= {"sample_time": _DT, "rtol": rtol, "atol": 1e-2 * rtol}
    return simulate_loop(beam, beam_law(_DT), time, None, **options)["tip_displacement"][:, None]


def loop_of(beam: AssumedModesBeam, time: Array) -> Loop:
    """Return the loop as others solve it."""
    size, row = beam.equations.size, beam.equations.tip.transverse

    def rate(t: float, x: Array, u: Array) -> Array:
        return beam.equations.state_derivative(x, float(u[0]))

    def read(k: int, x: Array) -> tuple[Array, Array]:
        return np.array([x[0] - _ANGLE, x[size]]), np.array([row @ x[1:size]])

    return Loop(rate, read, beam_law(_DT), _TORQUE, time, 2 * size)


def beam_reference(beam: AssumedModesBeam, time: Array) -> Array:
    """Return the tip's displacement to rounding: the equations derived from the energies, extrapolated between samples."""
    import casadi as ca

    f, n = beam.to_casadi(), 2 * beam.equations.size
    x, u = ca.SX.sym("x", n), ca.SX.sym("u")
    step = ca.Function("step", [x, u], [extrapolated_step(lambda a, _: f(a, u)[0], x, 0.0, _DT)])
    return loop_of(beam, time).advanced(lambda k, x, u: np.array(step(x, u)).ravel())


def beam_responded(beam: AssumedModesBeam, time: Array, method: str, rtol: float) -> Array:
    """Return the tip's displacement by python-control, whose controller is continuous."""
    law = control.ss([], [], [], [_GAINS], inputs=["error", "hub_speed"], outputs=["torque"])
    compared = control.summing_junction(["hub_angle", "-wanted"], "error", name="compared")
    loop = interconnected(beam.to_nlsys(), law, _TORQUE, ["wanted"], ["tip_displacement"], compared)
    return responded(loop, time, np.full(time.size, _ANGLE), method, rtol)


def beam_loop() -> Scene:
    """Return the scene of the hub-beam that is turned to an angle."""

    def ours(rtol: float, modes: int, problem: Any, change: float) -> Array:
        return simulated(beam(change, modes), _TIME, rtol)

    def theirs(modes: int, problem: Any, change: float) -> Array:
        return loop_of(beam(change, modes), _TIME).restarted("RK45", 1e-6)

    cases = [(rtol, _BEAM_MODES) for rtol in (1e-2, 1e-4, 1e-6, 1e-8, 1e-10)]
    options = f"sample_time={_DT:g}, control_limit={_TORQUE:g}, reference=reference, rtol={{:g}}"
    call = f"bc.simulate_loop(beam, controller, time, None, {options})"
    return Scene(
        title=f"Sampled angle control of the hub-beam with a torque limit, {_END:g} s at 1 kHz",
        question=f"From the beam's parameters, SFOAM, {_BEAM_MODES} modes, to the tip's displacement.",
        measure=f"Largest error over the largest displacement, against extrapolation of order 16; at least {SUMMED:.0e}.",
        reference=lambda problem: beam_reference(beam(), _TIME),
        error=relative_error(SUMMED),
        methods=(
            *settings("simulate_loop", "rtol {:.0e}", cases, ours, ours=True, call=call),
            *_peers(
                lambda method, rtol, problem, change: loop_of(beam(change), _TIME).restarted(method, rtol),
                lambda method, rtol, problem, change: beam_responded(beam(change), _TIME, method, rtol),
            ),
            *sized(
                settings("simulate_loop", "{1} modes", [(1e-6, 2), (1e-6, 4), (1e-6, 8)], ours, ours=True),
                settings("solve_ivp RK45, restarted", "{} modes", (2, 4, 8), theirs),
            ),
        ),
        remarks=(_CONTINUOUS, "The derivative of the state that others integrate is ours."),
    )
