"""Tracked slews: the controller along a plan, and simulations with it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from boomctl.arrays import Array
from boomctl.checks import (
    instance,
    job_count,
    mapping,
    nonnegative,
    positive,
    sequence,
    some_names,
    truth,
    whole,
    within,
)
from boomctl.lti.rounding import ALIKE
from boomctl.printing import listed
from boomctl.progress import computing, tell
from boomctl.simulation.loop import simulate_loop
from boomctl.simulation.machine.machine import Machine, RubbingMachine, reading_states
from boomctl.simulation.result import LoopResult
from boomctl.simulation.signals import Levels, per_signal
from boomctl.simulation.time_varying import TimeVaryingController
from boomctl.slew.feedback import (
    controller_along,
    linearized_along,
    observer,
    regulator,
    slowest_pole,
    weights,
)
from boomctl.slew.monte_carlo import TrackingStudy, drawn
from boomctl.slew.problem import SlewProblem
from boomctl.slew.torque import TorqueProfile
from boomctl.threads import one_blas_thread

_FEWEST = 8  # samples of a slew at least: fewer would not resolve it
_SETTLE = 4.0  # default dwell time in slowest periods
_VIBRATION_PERIODS = 1.5  # slowest periods after the end in which the residual vibration is evaluated, as for all slews
_RESERVE = 1.5  # default torque limit over that of the planning: a minimum-time slew leaves no reserve
_DISTURBED = 0.1  # default standard deviation of the disturbance torque of the observer, over the torque limit
_LEAST_WEIGHT = 1e-9  # smallest tracking weight, and inverse of the largest: conditioning of the Riccati equation
_MOST_SAMPLES = 1e5  # samples of a slew at most: limits the memory for the time-varying matrices
_MOST_RUNS = 100_000  # runs of a study at most: limits its memory
_OUTPUTS = ("hub_angle", "hub_speed", "tip_displacement", "root_moment")  # stored outputs of all runs
_CREEP = 0.01  # hub speed at which friction is three quarters of its torque [rad/s]: about 1 % of a slew's


@dataclass(frozen=True, repr=False, eq=False)
class TrackedSlew:
    """Planned slew with tracking feedback.

    Attributes
    ----------
    controller : TimeVaryingController
        Controller of the deviations, for :func:`boomctl.simulate_loop` with ``reference`` and ``feedforward``.
    gains : ndarray, (k + 1) x n
        State feedback gains at the samples of the slew, on the machine's states; the last one is held.
    time : ndarray, N
        Sample times, including the dwell time after the slew [s].
    reference : dict of str to ndarray
        Outputs and states in the plan, at ``time``.
    feedforward : dict of str to ndarray
        Torque of the plan, averaged over each sample interval [N m].
    duration, slowest_period : float
        Duration of the slew, and period of the slowest vibration [s].
    torque_limit : float
        Largest torque of plan and feedback together [N m].
    planning_torque_limit : float
        Largest torque of the planning [N m].
    time_constant : float
        Time constant of the slowest pole of the sampled loop at the end, for the planned machine [s]: computed from its
        linear model, independently of the gains.
    noise : dict of str to float
        Standard deviations of the measurements; empty if all states are measured.
    plant : hub-beam
        The planned machine.
    sensors : tuple of BeamSensor
        Its additional sensors.
    """

    controller: TimeVaryingController
    gains: Array
    time: Array
    reference: dict[str, Array]
    feedforward: dict[str, Array]
    duration: float
    slowest_period: float
    torque_limit: float
    planning_torque_limit: float
    time_constant: float
    noise: dict[str, float]
    plant: Any
    sensors: tuple[Any, ...] = ()

    def __repr__(self) -> str:
        step = self.controller.dt
        how = f"LQG from {listed(self.controller.input_labels, 40)}" if self.noise else "LQR of all states"
        reserve = f"{self.planning_torque_limit:g} of {self.torque_limit:g} N m planned"
        return (
            f"TrackedSlew: {self.duration:.6g} s, sampled every {step:.4g} s\n  {how}\n  torque: {reserve}\n"
            f"  stable at the end, slowest time constant {self.time_constant:.3g} s"
        )

    @one_blas_thread
    def simulate(
        self,
        plant: Machine | None = None,
        *,
        feedback: bool = True,
        disturbance: Mapping[str, ArrayLike] | None = None,
        friction: float = 0.0,
        friction_smoothing_speed: float = _CREEP,
        noise: Levels = None,
        seed: int = 0,
        delay: float = 0.0,
        rate_limit: float | None = None,
        quantization: Levels = None,
        initial_state: ArrayLike | None = None,
        rtol: float = 1e-8,
        atol: float = 1e-10,
    ) -> LoopResult:
        """Simulate a machine with feedback along the slew.

        Parameters
        ----------
        plant : hub-beam, optional
            The true machine: ``h.with_tip_mass(0.2)``, ``h.with_stiffness_factor(0.9)``, or another model if states are
            not measured; by default the planned one.
        feedback : bool
            If False, the torque is that of the plan.
        disturbance : mapping from input to float or (N,) array, optional
            "disturbance_torque" [N m] and "tip_force" [N], at ``time``; a number is constant.
        friction, friction_smoothing_speed : float
            Dry friction on the hub [N m], ``friction tanh(speed / friction_smoothing_speed)`` with speeds in rad/s.
        noise : float or mapping from measurement to float, optional
            Standard deviations at each sample; by default the values of the observer design.
        seed : int
            Seed of the noise.
        delay, rate_limit, quantization, rtol, atol
            See :func:`boomctl.simulate_loop`.
        initial_state : (n,) array_like, optional
            Initial state; by default rest, as in the plan.

        Returns
        -------
        LoopResult
            Outputs, states and the torque over time.

        Raises
        ------
        TypeError, ValueError
            If an argument has the wrong type or is out of range, the machine lacks a measurement, or the loop diverges.

        Examples
        --------
        >>> import boomctl as bc
        >>> beam = bc.hub_beam(modes=1)
        >>> tracked = bc.optimal_slew(beam, angle=1.0, torque_limit=160.0).track(torque_limit=200.0)
        >>> softer = beam.with_stiffness_factor(0.9)
        >>> runs = [tracked.simulate(softer, feedback=on) for on in (False, True)]
        >>> [f"{tracked.residual_vibration(run, wait=1.0):.3f} m" for run in runs]
        ['0.534 m', '0.045 m']
        """
        true = self.plant if plant is None else instance("plant", plant, Machine, "a hub-beam")
        controller, pushes = self.controller, {} if disturbance is None else disturbance
        mapping("disturbance", pushes, "inputs to numbers or arrays")
        if not truth("feedback", feedback):
            controller = replace(controller, C=0.0 * controller.C, D=0.0 * controller.D)
        return simulate_loop(
            RubbingMachine(
                true, nonnegative("friction", friction), positive("friction_smoothing_speed", friction_smoothing_speed)
            ),
            controller,
            self.time,
            {name: np.broadcast_to(row, self.time.shape) if np.ndim(row) == 0 else row for name, row in pushes.items()},
            sample_time=controller.dt,
            delay=delay,
            control_limit=self.torque_limit,
            rate_limit=rate_limit,
            quantization=quantization,
            initial_state=initial_state,
            noise=(self.noise or None) if noise is None else noise,
            seed=seed,
            reference={name: self.reference[name] for name in controller.input_labels},
            feedforward=self.feedforward,
            sensors=self.sensors,
            rtol=rtol,
            atol=atol,
        )

    @one_blas_thread
    def monte_carlo(
        self,
        runs: int = 256,
        seed: int = 0,
        *,
        tip_mass: Any = None,
        stiffness: Any = None,
        friction: Any = None,
        disturbance_torque: Any = None,
        feedback: bool = True,
        settling_time: float = 0.0,
        friction_smoothing_speed: float = _CREEP,
        noise: Levels = None,
        delay: float = 0.0,
        rate_limit: float | None = None,
        rtol: float = 1e-6,
        atol: float = 1e-8,
        n_jobs: int = 1,
    ) -> TrackingStudy:
        """Simulate many machines with random parameters along the slew.

        Parameters are independent and uniformly distributed. The samples depend on the seed only, not on the controller,
        so that two controllers, or feedback and none, can be compared run by run.

        Parameters
        ----------
        runs, seed : int
            Number of runs, and seed of all random values, including noise.
        tip_mass, friction, disturbance_torque : float, (low, high) or (runs,) array_like, optional
            Tip mass [kg], friction torque on the hub and a constant torque on it [N m]: a number for all runs, the bounds
            of a range, or one value per run; by default as planned, and zero. With two runs, two numbers are one per run.
        stiffness : float, (low, high) or (runs,) array_like, optional
            Factor of the bending stiffness; a number is the half-width of a range around one: 0.1 is 0.9 to 1.1.
        feedback : bool
            If False, the torque is that of the plan.
        settling_time : float
            Time after the end at which the evaluation of the vibration starts [s].
        friction_smoothing_speed, noise, delay, rate_limit, rtol, atol
            See `simulate`.
        n_jobs : int
            Number of parallel workers; negative as for `joblib.Parallel`, -1: all cores. The result does not depend on it.

        Returns
        -------
        TrackingStudy
            All runs; ``.plot()`` draws their quantiles.

        Raises
        ------
        TypeError, ValueError
            If an argument has the wrong type or is out of range, or the loop diverges.

        Examples
        --------
        >>> import boomctl as bc
        >>> slew = bc.optimal_slew(bc.hub_beam(modes=1), angle=1.0, torque_limit=160.0)
        >>> tracked = slew.track(torque_limit=200.0, sample_time=0.02)
        >>> study = tracked.monte_carlo(16, stiffness=0.1, tip_mass=(0.0, 0.1), settling_time=1.0)
        >>> study["tip_displacement"].shape == (16, study.time.size)
        True
        >>> alone = tracked.monte_carlo(16, stiffness=0.1, tip_mass=(0.0, 0.1), settling_time=1.0, feedback=False)
        >>> bool(study.residual_vibration.max() < 0.1 * alone.residual_vibration.max())
        True
        """
        count, start = whole("runs", runs, most=_MOST_RUNS), whole("seed", seed, least=0)
        rng = np.random.default_rng(start)
        mass = self.plant.parameters.tip_mass
        parameters = {
            "tip_mass": drawn("tip_mass", tip_mass, count, rng, None, mass),
            "stiffness": drawn("stiffness", stiffness, count, rng, 1.0, 1.0),
            "friction": drawn("friction", friction, count, rng, None, 0.0),
            "disturbance_torque": drawn("disturbance_torque", disturbance_torque, count, rng, None, 0.0),
        }
        for name, check in (("tip_mass", nonnegative), ("friction", nonnegative), ("stiffness", positive)):
            check(name, float(parameters[name].min()))
        if (most := float(parameters["friction"].max())) > self.torque_limit:
            raise ValueError(
                f"`friction` must be at most the torque limit, {self.torque_limit:g} N m, beyond which the hub does not move,"
                f" got {most:g}. Use less friction, or a larger torque limit."
            )
        seeds, reacts = rng.integers(2**32, size=count), truth("feedback", feedback)
        job_count(n_jobs)
        import joblib  # imported here: only studies need it

        def run(i: int) -> tuple[Array, float]:
            """Return the outputs of one machine, the torque last, and their error [m]."""
            mass, stiffness, rubbing, push = (float(row[i]) for row in parameters.values())
            loop = self.simulate(
                self.plant.with_tip_mass(mass).with_stiffness_factor(stiffness),
                feedback=reacts,
                disturbance={"disturbance_torque": push},
                friction=rubbing,
                friction_smoothing_speed=friction_smoothing_speed,
                noise=noise,
                seed=int(seeds[i]),
                delay=delay,
                rate_limit=rate_limit,
                rtol=rtol,
                atol=atol,
            )
            return np.array([*(loop[name] for name in _OUTPUTS), loop.controls["torque"]]), loop.error_estimate

        result: list[tuple[Array, float]] = []
        with computing("machines that follow a slew"):
            for item in joblib.Parallel(n_jobs, return_as="generator")(joblib.delayed(run)(i) for i in range(count)):
                result.append(item)
                tell("runs", len(result), count)
        rows = np.array([outputs for outputs, _ in result]).swapaxes(0, 1)
        outputs: dict[str, Array] = dict(zip((*_OUTPUTS, "torque"), rows, strict=True))
        planned = {name: self.reference[name] for name in _OUTPUTS} | self.feedforward
        deviation = outputs["tip_displacement"] - planned["tip_displacement"]
        return TrackingStudy(
            time=self.time,
            samples=parameters,
            outputs=outputs,
            reference=planned,
            residual_vibration=np.abs(deviation[:, self._vibration_window(settling_time)]).max(axis=1),
            angle_error=outputs["hub_angle"][:, -1] - planned["hub_angle"][-1],
            settling_time=settling_time,
            duration=self.duration,
            feedback=reacts,
            seed=start,
            seeds=seeds,
            error_estimate=max(error for _, error in result),
        )

    @one_blas_thread
    def residual_vibration(self, run: LoopResult, wait: float = 0.0) -> float:
        """Return the largest distance of the tip from the plan within 1.5 slowest periods after the end of the slew.

        Parameters
        ----------
        run : LoopResult
            Result of `simulate`.
        wait : float
            Time after the end at which the evaluation starts [s].

        Returns
        -------
        float
            Residual vibration [m].

        Raises
        ------
        TypeError, ValueError
            If `run` is not a LoopResult, or `wait` exceeds the simulated time.
        """
        deviation = instance("run", run, LoopResult)["tip_displacement"] - self.reference["tip_displacement"]
        return float(np.abs(deviation[self._vibration_window(wait)]).max())

    def _vibration_window(self, wait: float) -> Array:
        """Return the mask of samples within 1.5 slowest periods after the end of the slew and a waiting time [s]."""
        late = self.time - self.duration - nonnegative("settling_time", wait)
        result = (late >= -0.5 * self.controller.dt) & (late <= _VIBRATION_PERIODS * self.slowest_period)
        if not result.any():
            raise ValueError(
                f"settling_time = {wait:g}: expected at most {self.time[-1] - self.duration:g} s, where the motion ends"
            )
        return result


def tracked_slew(
    profile: TorqueProfile,
    problem: SlewProblem,
    *,
    sample_time: float,
    torque_limit: float | None,
    dwell_time: float | None,
    measurements: str | Sequence[str] | None,
    sensors: Sequence[Any],
    noise: Levels,
    tracking_weight: float,
    integral_time: float | None,
    disturbance: float | None,
    stiffness_uncertainty: float,
) -> TrackedSlew:
    """Design feedback along a plan; the arguments are those of `SlewResult.track`."""
    plant, planned_limit = problem.plants[0], problem.limits.torque
    machine: Any = plant.machine
    if machine is None:
        raise TypeError("slew: expected one of a hub-beam; that of a linear system follows no nonlinear plan")
    rest = _SETTLE * plant.period if dwell_time is None else nonnegative("dwell_time", dwell_time)
    if (profile.duration + rest) / positive("sample_time", sample_time) > _MOST_SAMPLES:
        raise ValueError(
            f"sample_time = {sample_time:g}: expected at most {_MOST_SAMPLES:g} samples, settling included"
        )
    count = max(_FEWEST, round(profile.duration / sample_time))
    step = profile.duration / count
    after = int(np.ceil(rest / step))
    limit = positive("torque_limit", _RESERVE * planned_limit if torque_limit is None else torque_limit)
    if limit < profile.peak * (1.0 - ALIKE):  # up to rounding error
        raise ValueError(
            f"torque_limit = {limit:g}: expected at least {profile.peak:g} N m, the largest torque of the plan"
        )
    time, extra_sensors = step * np.arange(count + after + 1), sequence("sensors", sensors, "BeamSensor")
    modes = machine._forced_modes(extra_sensors)
    modes = reading_states(modes, modes.state_labels)
    wanted = (
        modes.state_labels if measurements is None else some_names("measurement", measurements, modes.output_labels)
    )
    level = per_signal("noise", noise, wanted, zero=True)
    if measurements is not None and np.isinf(level).any():
        silent = ", ".join(name for name, item in zip(wanted, level, strict=True) if np.isinf(item))
        raise ValueError(
            f"noise: expected a standard deviation above zero for each measurement, there is none for {silent}"
        )
    if measurements is None and noise is not None:
        raise ValueError("noise: expected None without measurements, for the states are known then")
    linear = machine._linear(problem.final_speed)
    torques = np.concatenate([profile.interval_means(time[: count + 1]), np.zeros(after)])
    motion = machine.simulate(profile, time)
    states = motion.states @ modes.from_state.T
    along = linearized_along(
        modes, [modes.output_labels.index(name) for name in wanted], states[: count + 1], torques[:count], step
    )
    weight = within("tracking_weight", tracking_weight, _LEAST_WEIGHT, 1.0 / _LEAST_WEIGHT)
    lasting = None if integral_time is None else positive("integral_time", integral_time)
    pushed = positive("disturbance", _DISTURBED * limit if disturbance is None else disturbance)
    uncertain = within("stiffness_uncertainty", stiffness_uncertainty, 0.0, 1.0)
    measured = None if measurements is None else level
    with np.errstate(all="ignore"):  # overflow is reported below
        Q = weight * weights(along, linear.C[[0, 2]] @ modes.to_state, states[: count + 1])
        K = regulator(along, Q, limit, step)
        F = observer(modes, along, states[: count + 1], measured, pushed, lasting, uncertain, step)
    if not (np.isfinite(K).all() and np.isfinite(F).all()):
        raise ValueError(
            "noise, disturbance, tracking_weight: there are no gains for these; expected numbers nearer to each other"
        )
    push = np.zeros((len(modes.input_labels), len(time)))
    push[0, 1:] = torques
    outputs = np.array(modes.read.map(len(time))(states.T, push)[0])
    controller = controller_along(along, K, F, wanted, modes.input_labels[0], step)
    return TrackedSlew(
        controller=controller,
        time_constant=slowest_pole(modes, along, controller, linear, integral_time is not None),
        gains=K @ modes.from_state[along.moved],
        time=time,
        reference=dict(zip(modes.output_labels, outputs, strict=True)),
        feedforward={modes.input_labels[0]: np.append(torques, 0.0)},
        duration=profile.duration,
        slowest_period=plant.period,
        torque_limit=limit,
        planning_torque_limit=planned_limit,
        noise={} if measurements is None else dict(zip(wanted, level.tolist(), strict=True)),
        plant=machine,
        sensors=extra_sensors,
    )
