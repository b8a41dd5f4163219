"""A slew with feedback along it: the controller, and what a machine does under it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
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
    Tuning,
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

_FEWEST = 8  # samples of a slew at least: fewer would not follow it
_SETTLE = 4.0  # slowest periods for which the plant is followed after the end, unless it is said how long
_JUDGED = 1.5  # slowest periods after the end in which a vibration is looked for, as after every other slew
_RESERVE = 1.5  # largest torque over that of the planning, unless it is said: a slew of least time leaves none
_DISTURBED = 0.1  # share of the largest torque by which an observer takes it to be disturbed (a choice)
_LEAST_WEIGHT = 1e-9  # of errors beside the torque, and one over the largest: beyond, digits are lost (a choice)
_MOST_SAMPLES = 1e5  # of a slew: each has a matrix of its own (a choice)
_MOST_RUNS = 100_000  # of a study: more do not fit into the memory (a choice)
_KEPT = ("hub_angle", "hub_speed", "tip_displacement", "root_moment")  # outputs of all runs
_CREEP = 0.01  # hub speed at which friction is three quarters of its torque [rad/s]: a hundredth of a slew's (a choice)


@dataclass(frozen=True, repr=False, eq=False)
class TrackedSlew:
    """A planned slew, and the feedback that holds a machine to it.

    Attributes
    ----------
    controller : TimeVaryingController
        Of deviations from the plan, for :func:`boomctl.simulate_loop` with ``reference`` and ``feedforward``.
    gains : ndarray, (k + 1) x n
        Those of the regulator at each sample of the slew, on the machine's states; the last one stays.
    time : ndarray, N
        Instants of the samples, on beyond the end of the slew [s].
    reference : dict of str to ndarray
        Outputs and states in the plan, at ``time``.
    feedforward : dict of str to ndarray
        The torque of the plan, its mean from each sample to the next [N m].
    duration, slowest_period : float
        Of the slew, and of the slowest vibration [s].
    torque_limit : float
        Largest torque, that of the plan and of the feedback together [N m].
    planning_torque_limit : float
        Largest torque of the planning [N m].
    time_constant : float
        Time constant of the slowest pole of the sampled loop at the end, of the machine planned for: computed from its
        linear model, apart from the gains. A loop that is not stable there is refused [s].
    noise : dict of str to float
        Standard deviations of the measurements; empty where the states are known.
    plant : hub-beam
        The one planned for.
    sensors : tuple of BeamSensor
        Its further sensors.
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
        reserve = f"{self.planning_torque_limit:g} N m planned of {self.torque_limit:g}"
        return (
            f"TrackedSlew: {self.duration:.6g} s, sampled every {step:.4g} s\n  {how}\n  torque: {reserve}\n"
            f"  stable at the end, the slowest pole in {self.time_constant:.3g} s"
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
        """Simulate a machine that follows the slew.

        Parameters
        ----------
        plant : hub-beam, optional
            The true machine: ``h.with_tip_mass(0.2)``, ``h.with_stiffness_factor(0.9)``, another model where states
            are not read; by default the one planned for.
        feedback : bool
            Whether the controller reacts; otherwise the torque is that of the plan.
        disturbance : mapping from input to float or (N,) array, optional
            "disturbance_torque" [N m] and "tip_force" [N], at ``time``; a number stays all the time.
        friction, friction_smoothing_speed : float
            Torque of dry friction on the hub [N m], ``friction tanh(speed / creep)`` with the creep in rad/s.
        noise : float or mapping from measurement to float, optional
            Standard deviations at each sample; by default those that the observer was designed for.
        seed : int
            Of the noise.
        delay, rate_limit, quantization, rtol, atol
            As of :func:`boomctl.simulate_loop`.
        initial_state : (n,) array_like, optional
            State at the first instant; by default rest, as of the plan.

        Returns
        -------
        LoopResult
            Outputs, states and the torque over time.

        Raises
        ------
        TypeError, ValueError
            Arguments of another kind or out of range; a machine without a measurement; a loop that diverges.

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
        controller = self.controller if truth("feedback", feedback) else self._still()
        return simulate_loop(
            RubbingMachine(
                true, nonnegative("friction", friction), positive("friction_smoothing_speed", friction_smoothing_speed)
            ),
            controller,
            self.time,
            self._disturbances(disturbance),
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
        """Simulate many machines that follow the slew.

        What differs is drawn evenly from a range, independently. The seed draws the same runs whatever the controller is,
        so that two controllers, or feedback and none, are compared run by run.

        Parameters
        ----------
        runs, seed : int
            How many, and of all that is drawn, noise included.
        tip_mass, friction, disturbance_torque : float, (low, high) or (runs,) array_like, optional
            Tip mass [kg], torque of friction on the hub and a constant torque on it [N m]: a number for all runs, the ends
            of a range, or one for each run; by default as planned, and none. Of two runs, two numbers are one for each.
        stiffness : float, (low, high) or (runs,) array_like, optional
            What multiplies the bending stiffness; a number is the half-width of a range around one: 0.1 is 0.9 to 1.1.
        feedback : bool
            Whether the controller reacts.
        settling_time : float
            Time after the end from which a vibration counts [s].
        friction_smoothing_speed, noise, delay, rate_limit, rtol, atol
            As of `simulate`.
        n_jobs : int
            Number of parallel workers; negative as for `joblib.Parallel`, -1: all cores. The result does not depend on it.

        Returns
        -------
        TrackingStudy
            All runs; ``.plot()`` draws their quantiles.

        Raises
        ------
        TypeError, ValueError
            Arguments of another kind or out of range; a loop that diverges.

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
        given = {
            "tip_mass": drawn("tip_mass", tip_mass, count, rng, None, mass),
            "stiffness": drawn("stiffness", stiffness, count, rng, 1.0, 1.0),
            "friction": drawn("friction", friction, count, rng, None, 0.0),
            "disturbance_torque": drawn("disturbance_torque", disturbance_torque, count, rng, None, 0.0),
        }
        for name, check in (("tip_mass", nonnegative), ("friction", nonnegative), ("stiffness", positive)):
            check(name, float(given[name].min()))
        if (most := float(given["friction"].max())) > self.torque_limit:
            raise ValueError(
                f"`friction` must be at most the torque limit, {self.torque_limit:g} N m, beyond which the hub does not move,"
                f" got {most:g}. Use less friction, or a larger torque limit."
            )
        seeds, reacts = rng.integers(2**32, size=count), truth("feedback", feedback)
        job_count(n_jobs)
        import joblib  # which no other use of a slew needs

        def run(i: int) -> tuple[Array, float]:
            """Outputs of one machine, the torque last, and their error [m]."""
            mass, stiffness, rubbing, push = (float(row[i]) for row in given.values())
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
            return np.array([*(loop[name] for name in _KEPT), loop.controls["torque"]]), loop.error_estimate

        result: list[tuple[Array, float]] = []
        with computing("machines that follow a slew"):
            for item in joblib.Parallel(n_jobs, return_as="generator")(joblib.delayed(run)(i) for i in range(count)):
                result.append(item)
                tell("runs", len(result), count)
        rows = np.array([outputs for outputs, _ in result]).swapaxes(0, 1)
        outputs: dict[str, Array] = dict(zip((*_KEPT, "torque"), rows, strict=True))
        planned = {name: self.reference[name] for name in _KEPT} | self.feedforward
        apart = outputs["tip_displacement"] - planned["tip_displacement"]
        return TrackingStudy(
            time=self.time,
            samples=given,
            outputs=outputs,
            reference=planned,
            residual_vibration=np.abs(apart[:, self._judged(settling_time)]).max(axis=1),
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
            What `simulate` returned.
        wait : float
            Time after the end from which it counts [s].

        Returns
        -------
        float
            m.

        Raises
        ------
        TypeError, ValueError
            No result of a loop; a time beyond the last instant.
        """
        apart = instance("run", run, LoopResult)["tip_displacement"] - self.reference["tip_displacement"]
        return float(np.abs(apart[self._judged(wait)]).max())

    def _judged(self, wait: float) -> Array:
        """Which of the samples lie in the 1.5 slowest periods after the end of the slew and a time [s] more."""
        late = self.time - self.duration - nonnegative("settling_time", wait)
        result = (late >= -0.5 * self.controller.dt) & (late <= _JUDGED * self.slowest_period)
        if not result.any():
            raise ValueError(
                f"settling_time = {wait:g}: expected at most {self.time[-1] - self.duration:g} s, where the motion ends"
            )
        return result

    def _still(self) -> TimeVaryingController:
        """The same signals without feedback."""
        p = len(self.controller.input_labels)
        none = np.zeros((1, 0, 0)), np.zeros((1, 0, p)), np.zeros((1, 1, 0)), np.zeros((1, 1, p))
        return TimeVaryingController(
            *none, self.controller.input_labels, self.controller.output_labels, self.controller.dt
        )

    def _disturbances(self, given: Mapping[str, ArrayLike] | None) -> dict[str, Array] | None:
        if given is None:
            return None
        rows = mapping("disturbance", given, "inputs to numbers or arrays")
        return {name: np.broadcast_to(row, self.time.shape) if np.ndim(row) == 0 else row for name, row in rows.items()}


def tracked_slew(
    history: TorqueProfile,
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
    """Return a plan with feedback along it; the arguments are those of `SlewResult.track`."""
    plant, planned_limit = problem.plants[0], problem.limits.torque
    machine: Any = plant.machine
    if machine is None:
        raise TypeError("slew: expected one of a hub-beam; that of a linear system follows no nonlinear plan")
    rest = _SETTLE * plant.period if dwell_time is None else nonnegative("dwell_time", dwell_time)
    if (history.duration + rest) / positive("sample_time", sample_time) > _MOST_SAMPLES:
        raise ValueError(
            f"sample_time = {sample_time:g}: expected at most {_MOST_SAMPLES:g} samples, settling included"
        )
    count = max(_FEWEST, round(history.duration / sample_time))
    step = history.duration / count
    after = int(np.ceil(rest / step))
    limit = positive("torque_limit", _RESERVE * planned_limit if torque_limit is None else torque_limit)
    if limit < history.peak * (1.0 - ALIKE):  # share of a torque by which the plan may exceed the limit
        raise ValueError(
            f"torque_limit = {limit:g}: expected at least {history.peak:g} N m, the largest torque of the plan"
        )
    time, places = step * np.arange(count + after + 1), sequence("sensors", sensors, "BeamSensor")
    modes = machine._forced_modes(places)
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
    torques = np.concatenate([history.interval_means(time[: count + 1]), np.zeros(after)])
    motion = machine.simulate(history, time)
    states = motion.states @ modes.from_state.T
    along = linearized_along(
        modes, [modes.output_labels.index(name) for name in wanted], states[: count + 1], torques[:count], step
    )
    tuning = Tuning(
        limit=limit,
        error_weight=within("tracking_weight", tracking_weight, _LEAST_WEIGHT, 1.0 / _LEAST_WEIGHT),
        integral_time=None if integral_time is None else positive("integral_time", integral_time),
        noise=None if measurements is None else level,
        disturbance=positive("disturbance", _DISTURBED * limit if disturbance is None else disturbance),
        model_error=within("stiffness_uncertainty", stiffness_uncertainty, 0.0, 1.0),
    )
    with np.errstate(all="ignore"):  # weights beyond all numbers are told below
        K = regulator(along, weights(along, linear.C[[0, 2]] @ modes.to_state, states[: count + 1]), tuning, step)
        F = observer(modes, along, states[: count + 1], tuning, step)
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
        duration=history.duration,
        slowest_period=plant.period,
        torque_limit=limit,
        planning_torque_limit=planned_limit,
        noise={} if measurements is None else dict(zip(wanted, level.tolist(), strict=True)),
        plant=machine,
        sensors=places,
    )
