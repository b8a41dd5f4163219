"""Results of planned slews, with their certificates, and the switching function of a minimum-time slew."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from importlib import import_module
from math import inf, isfinite
from typing import TYPE_CHECKING, Any

import numpy as np

from boomctl.arrays import Array
from boomctl.checks import instance
from boomctl.lti.time_series import TimeSeries
from boomctl.printing import Summarized, compact, count
from boomctl.progress import Listener, computing, tell
from boomctl.slew.end_map import end_map
from boomctl.slew.objectives import OBJECTIVES
from boomctl.slew.plant import LABELS, is_machine
from boomctl.slew.torque import TorqueProfile
from boomctl.threads import one_blas_thread

if TYPE_CHECKING:
    from boomctl.simulation.signals import Levels
    from boomctl.slew.tracked import TrackedSlew


_CURVE = 1500  # steps of a switching function at least: resolution of its plot
_AFTER = 96  # samples in 1.5 slowest periods after the end
_EXACT_MODES = 6  # modes of the geometrically exact beam
_COARSE = {"rtol": 1e-5, "atol": 1e-7}  # solver tolerances for other models, whose differences are larger


@dataclass(frozen=True)
class Replay:
    """Response of another model or payload to the planned torque, in addition to what is certified.

    Attributes
    ----------
    model : str
        Name of the model.
    tip_mass : float or None
        Tip mass, if it differs from the planned one [kg].
    angle_error : float
        Error of the hub angle at the end [rad]; 0 if the angle is free.
    speed_error : float
        Error of the hub speed at the end [rad/s].
    residual_vibration : float
        Largest tip displacement in the 1.5 slowest periods after the end [m].
    residual_energy : float or None
        Energy of the deviation from steady rotation at the prescribed speed [J].

    Examples
    --------
    >>> import boomctl as bc
    >>> slew = bc.optimal_slew(bc.hub_beam(modes=1), angle=1.0, torque_limit=160.0)
    >>> [run.model for run in slew.replay()]
    ['foam', 'geometrically-exact']
    >>> round(slew.replay()[0].angle_error, 5)  # [rad]
    0.0005
    """

    model: str
    tip_mass: float | None
    angle_error: float
    speed_error: float
    residual_vibration: float
    residual_energy: float | None

    __repr__ = compact


@dataclass(frozen=True)
class SlewCertificate:
    """Errors of a simulation of a slew by another integrator, and the optimality that the planning method found.

    Attributes
    ----------
    method : str
        "switching times", "least effort" or "collocation".
    terminal_error : float
        Largest deviation from the terminal state in the replay, over all coordinates, each relative to its largest value
        along the motion.
    prescribed_terminal_error : float
        The same for the prescribed coordinates, all except axial motion. At most `rtol`.
    free_terminal_errors : dict of str to float
        The same for the axial coordinates and rates of a beam, which planning leaves free, by their names.
    constraint_violation : float
        Largest relative excess over any limit in the replay, local maxima between its times included; 0 if there is none.
    active_constraints : dict of str to float
        Limits that are reached within 0.1 %, and the first time at which they are, s.
    optimality_gap : float
        Relative difference from the least cost, in the sense of ``optimality_status``.  With axial modes it is the gap of
        the same beam without them, as planned. inf if it is not estimated: the slew was planned on one mesh only.
    optimality_status : str
        "proved": a duality bound or Pontryagin's principle on a convex problem; "extremal": Pontryagin's conditions hold on
        a problem that is not convex; "stationary": the optimality conditions hold on the mesh, and the gap is the change
        of the cost on another mesh, to first order for minimum effort on a specified mesh.
    n_switches : int or None
        Number of switches of a bang-bang torque; None for other torques.
    intervals : int or None
        Number of intervals of the mesh; None without one.

    Examples
    --------
    >>> import boomctl as bc
    >>> slew = bc.optimal_slew(bc.hub_beam(modes=1), angle=1.0, torque_limit=160.0)
    >>> slew.certificate.method, slew.certificate.optimality_status, slew.certificate.n_switches
    ('switching times', 'extremal', 3)
    """

    method: str
    terminal_error: float
    prescribed_terminal_error: float
    free_terminal_errors: dict[str, float]
    constraint_violation: float
    active_constraints: dict[str, float]
    optimality_gap: float
    optimality_status: str
    n_switches: int | None
    intervals: int | None

    def __repr__(self) -> str:
        active = f"; active: {', '.join(self.active_constraints)}" if self.active_constraints else ""
        limits = f"limit violation {self.constraint_violation:.1e}{active}"
        return f"SlewCertificate: by {self.method}\n  {self.summary}\n  {self._errors}\n  {limits}"

    @property
    def _errors(self) -> str:
        """Error of the prescribed coordinates, and with the axial motion."""
        text = f"terminal error {self.prescribed_terminal_error:.1e}"
        if not self.free_terminal_errors:
            return text
        return f"{text} without, {self.terminal_error:.1e} with axial motion (not constrained)"

    @property
    def summary(self) -> str:
        """Statement on the optimality of the slew."""
        return f"{self._optimum}; without axial modes" if self.free_terminal_errors else self._optimum

    @property
    def _optimum(self) -> str:
        gap = abs(self.optimality_gap)
        if self.optimality_status == "proved":
            return f"proved optimal within {max(gap, 1e-15):.0e} of the cost"
        if self.optimality_status == "extremal":
            within = f" within {gap:.0e}" if gap > 0.0 else ""
            return f"Pontryagin's conditions hold{within}; optimality not proved"
        mesh = f"stationary on {count(self.intervals or 0, 'interval')}"
        if gap == float("inf"):
            return f"{mesh}; no other mesh to estimate the optimality gap"
        return f"{mesh}; relative cost change {gap:.0e} on another mesh"


@dataclass(frozen=True, eq=False)
class SlewResult(Summarized, TimeSeries):
    """Planned slew: torque, motion and certificate.

    Attributes
    ----------
    objective : str
        Minimized quantity: "time", "effort", "jerk", "torque-rate" or "tip".
    duration : float
        Duration of the slew [s].
    cost : float
        Value of the objective: s for "time", N^2 m^2 s for "effort", rad^2/s^5 for "jerk", N^2 m^2/s for "torque-rate",
        m for "tip".  For a linear system with other signal names, in the units of its signals.
    time : ndarray, k
        Times of the dense replay, s.
    torque, hub_angle, hub_speed : ndarray, k
        Torque [N m], hub angle [rad] and hub speed [rad/s] at these times.
    tip_displacement : ndarray, k, or None
        Tip displacement [m]; None for a linear system without an output of this name.
    root_moment : ndarray, k, or None
        Bending moment at the clamp [N m]; None for a linear system without an output of this name.
    states : ndarray, k x n
        States of the plant.
    residual_energy : float or None
        Energy of the deviation from steady rotation after the end [J]; None for a linear system.
    terminal_error : float
        Largest relative deviation from the terminal state, as in the certificate: over all coordinates of the model,
        including those that planning does not prescribe.
    certificate : SlewCertificate
        Verified errors and optimality.
    torque_profile : TorqueProfile
        The torque as a function of time.
    plan : object
        Data for `replan` and `track`.
    stages : tuple of str
        Methods used, in order; the last one computed the slew.
    small_deformation_until : float
        Time at which the tip of a hub-beam first exceeds a tenth of its length [s], up to 1.5 slowest periods after the
        end: later, only the geometrically exact model is valid. inf if it never does, and for a linear system.
    elapsed : float
        Run time of the search, including the replay [s].
    """

    _made_by = "optimal_slew(...)"

    objective: str
    duration: float
    cost: float
    time: Array = field(repr=False)
    torque: Array = field(repr=False)
    hub_angle: Array = field(repr=False)
    hub_speed: Array = field(repr=False)
    tip_displacement: Array | None = field(repr=False)
    root_moment: Array | None = field(repr=False)
    states: Array = field(repr=False)
    residual_energy: float | None
    terminal_error: float
    certificate: SlewCertificate
    torque_profile: TorqueProfile = field(repr=False)
    plan: Any = field(repr=False, default=None)
    stages: tuple[str, ...] = field(repr=False, default=())
    small_deformation_until: float = inf
    elapsed: float = field(repr=False, default=0.0)

    def __repr__(self) -> str:
        name, unit = self._labels["angle"]
        turned = f"{self.hub_angle[-1] - self.hub_angle[0]:.6g}"
        turned = f"{f'{turned} {unit}' if unit else f'{name} by {turned}'} in {self.duration:.6g} s"
        tip = ""
        if self.tip_displacement is not None:
            tip = f", tip up to {abs(self.tip_displacement).max():.4g} {self._labels['tip'][1]}".rstrip()
        if isfinite(self.small_deformation_until):
            tip += f", small-deformation model invalid after {self.small_deformation_until:.4g} s"
        residual = f", residual energy {self.residual_energy:.1e} J" if self.residual_energy is not None else ""
        name, unit = self._labels["torque"]
        torque = f"{name} up to {f'{self.torque_profile.peak:.6g} {unit}'.rstrip()}{tip}"
        return (
            f"SlewResult: {self.title}, {turned}\n  {torque}\n"
            f"  {self.certificate._errors}{residual}\n  {self.certificate.summary}"
        )

    @property
    def _labels(self) -> Mapping[str, tuple[str, str]]:
        """Names and units of the quantities, by kind."""
        return LABELS if self.plan is None else self.plan.problem.plants[0].labels

    @property
    def success(self) -> bool:
        """True if the search terminated normally; False if the time limit stopped mesh refinement."""
        return self.certificate.optimality_status != "stationary" or "out of time" not in "; ".join(self.stages)

    @property
    def nit(self) -> int | None:
        """Iterations of the solver on the final mesh; None without a nonlinear program."""
        return getattr(getattr(self.plan, "solution", None), "nit", None)

    @property
    def title(self) -> str:
        """Name of the objective, such as "minimum time"."""
        return OBJECTIVES[self.objective].title

    @cached_property
    @one_blas_thread
    def _replays(self) -> tuple[Replay, ...]:
        problem, profile = self.plan.problem, self.torque_profile
        machine = problem.plants[0].machine
        if machine is None:
            return ()
        others: list[tuple[Any, float | None]] = [(machine.with_tip_mass(mass), mass) for mass in problem.tip_masses]
        if machine.model != "foam":
            others.append((machine.with_model("foam"), None))
        others.append((machine.with_model("geometrically-exact", _EXACT_MODES), None))
        after, replays = profile.duration + np.linspace(0.0, 1.5 * problem.plants[0].period, _AFTER + 1), []
        for k, (other, mass) in enumerate(others):
            tell(other.model, k, len(others))
            r = other.simulate(profile, after, **_COARSE)
            energy = other.residual_energy(r.states[0], problem.final_speed) if is_machine(other) else None
            if energy is None and problem.final_speed == 0.0:
                energy = float(r.energy[0])
            replays.append(
                Replay(
                    model=other.model,
                    tip_mass=mass,
                    angle_error=0.0 if problem.angle is None else float(r.hub_angle[0]) - problem.angle,
                    speed_error=float(r.hub_speed[0]) - problem.final_speed,
                    residual_vibration=float(np.abs(r.tip_displacement).max()),
                    residual_energy=energy,
                )
            )
        return tuple(replays)

    def replay(self, *, progress: Listener | None = None) -> tuple[Replay, ...]:
        """Simulate the torque on the other payloads of the plan, on the FOAM and on the geometrically exact beam.

        The geometrically exact beam takes most of the run time: seconds to minutes, longer for torques with many
        intervals.  A further call returns the same records.  For other beams use ``beam.simulate(slew)``, which returns the
        motion.

        Parameters
        ----------
        progress : callable, optional
            Called with a `Progress` at each model.

        Returns
        -------
        tuple of Replay
            Errors at the end and residual vibration of each model; empty for a linear system.

        Examples
        --------
        >>> import boomctl as bc
        >>> slew = bc.optimal_slew(bc.hub_beam(modes=1), 1.0, 200.0, "effort", 4.0, intervals=20)
        >>> [each.model for each in slew.replay()]
        ['foam', 'geometrically-exact']
        >>> heavier = bc.hub_beam(tip_mass=0.5, modes=1).simulate(slew)
        >>> round(float(heavier.hub_angle[-1]), 2)
        0.87
        """
        with computing("replay", progress):
            return self._replays

    @one_blas_thread
    def track(
        self,
        *,
        sample_time: float = 0.005,
        torque_limit: float | None = None,
        dwell_time: float | None = None,
        measurements: str | Sequence[str] | None = None,
        sensors: Sequence[Any] = (),
        noise: Levels = None,
        tracking_weight: float = 1000.0,
        integral_time: float | None = 0.3,
        disturbance: float | None = None,
        stiffness_uncertainty: float = 0.1,
    ) -> TrackedSlew:
        """Design feedback along the slew: a time-varying LQR, or LQG, about its trajectory.

        The plan's torque is the feedforward, and measurements are compared with the plan.  The nonlinear model is linearized
        along the plan and sampled with the torque held; the Riccati recursion runs backward from the rest at the end.

        Parameters
        ----------
        sample_time : float
            Sample time [s]; rounded to an integer number of samples of the slew.
        torque_limit : float, optional
            Largest torque of plan and feedback together [N m]; by default 1.5 times that of the planning. A minimum-time
            slew uses all of its planning limit, so plan it with less torque than is available.
        dwell_time : float, optional
            Time for which the terminal state is held [s]; by default four slowest periods.
        measurements : str or sequence of str, optional
            Measured outputs of the machine, as named by :func:`boomctl.simulate_loop`; by default all states.
        sensors : sequence of BeamSensor
            Further outputs.
        noise : float or mapping from measurement to float, optional
            Standard deviation of each measurement, at each sample.
        tracking_weight : float
            Weight of the squared deviations of hub angle, tip and their rates, over their spans in the plan, relative to the
            weight of the squared torque over its limit. Larger weights reduce the tracking error.
        integral_time : float, optional
            Time constant of the estimate and compensation of a constant disturbance torque [s]. If None, disabled.
        disturbance : float, optional
            Standard deviation of the disturbance torque assumed by the observer, independent at each sample [N m]; by
            default 10 % of the largest torque.
        stiffness_uncertainty : float
            Relative stiffness error assumed by the observer.

        Returns
        -------
        TrackedSlew
            ``.simulate()`` simulates the tracked slew, ``.monte_carlo()`` many times with random machine parameters.

        Raises
        ------
        TypeError, ValueError
            If an argument has the wrong type or is out of range, or the slew is that of a linear system.

        Examples
        --------
        >>> import boomctl as bc
        >>> slew = bc.optimal_slew(bc.hub_beam(modes=1), angle=1.0, torque_limit=160.0)
        >>> slew.track(torque_limit=200.0)
        TrackedSlew: 2.69713 s, sampled every 0.005004 s
          LQR of all states
          torque: 160 of 200 N m planned
          stable at the end, slowest time constant 1.56 s
        """
        from boomctl.slew.tracked import tracked_slew  # imported here: only tracking needs it

        if self.plan is None:
            raise ValueError("slew: expected one that was planned by optimal_slew")
        return tracked_slew(
            self.torque_profile,
            self.plan.problem,
            sample_time=sample_time,
            torque_limit=torque_limit,
            dwell_time=dwell_time,
            measurements=measurements,
            sensors=sensors,
            noise=noise,
            tracking_weight=tracking_weight,
            integral_time=integral_time,
            disturbance=disturbance,
            stiffness_uncertainty=stiffness_uncertainty,
        )

    def _outputs(self) -> dict[str, Array]:
        names = ("hub_angle", "hub_speed", "tip_displacement", "root_moment")
        return {name: values for name in names if (values := getattr(self, name)) is not None}

    def _inputs(self) -> dict[str, Array]:
        return {"torque": self.torque}

    def __figures__(self) -> dict[str, float]:
        """Return the metrics of a comparison."""
        own = self._labels is not LABELS  # unspecified units
        result = {
            "duration [s]": self.duration,
            f"{self._labels['torque'][0]}: peak{'' if own else ' [N m]'}": self.torque_profile.peak,
        }
        result["effort" if own else "effort [N^2 m^2 s]"] = self.torque_profile.effort
        if self.tip_displacement is not None:
            result[f"tip displacement: peak{'' if own else ' [m]'}"] = float(abs(self.tip_displacement).max())
        if self.residual_energy is not None:
            result["residual energy [J]"] = self.residual_energy
        return result | {"terminal error": self.terminal_error}

    def plot(self, ax: Any = None, **style: Any) -> Array:
        """Draw torque, hub and tip over time, with limits that are nearly reached.

        Parameters
        ----------
        ax : sequence of matplotlib Axes, or a figure, optional
            Axes to draw on: torque, hub angle, hub speed, tip displacement and root moment, if available. If None, a new
            figure is created.
        **style
            Line properties, passed to `matplotlib.axes.Axes.plot`; ``label`` is prefixed to the line labels.

        Returns
        -------
        ndarray of matplotlib.axes.Axes
            The axes, in the order of ``ax``.
        """
        return import_module("boomctl.plotting.slew").plot_slew(self, ax, **style)


@dataclass(frozen=True, eq=False)
class SwitchingFunction(TimeSeries):
    """Switching function of a slew: time saved per unit of torque, over its maximum. Its sign is the torque's.

    Attributes
    ----------
    time : ndarray, k
        Time points [s].
    values : ndarray, k
        The switching function, between -1 and 1.
    torque : ndarray, k
        The torque [N m].
    switching_times : ndarray
        Times at which the torque changes its sign [s].
    torque_limit : float
        Largest absolute torque [N m].
    """

    time: Array
    values: Array
    torque: Array
    switching_times: Array
    torque_limit: float

    def __repr__(self) -> str:
        agree = f"{self.sign_agreement:.4%} of the time the torque has its sign"
        return (
            f"SwitchingFunction: {count(len(self.switching_times), 'switch', 'switches')} in {self.time[-1]:.6g} s; "
            f"{agree}"
        )

    def _outputs(self) -> dict[str, Array]:
        return {"values": self.values}

    def _inputs(self) -> dict[str, Array]:
        return {"torque": self.torque}

    @property
    def sign_agreement(self) -> float:
        """Fraction of the duration on which the torque has the sign of the switching function."""
        return float(np.mean(self.values * self.torque > 0.0))

    def plot(self, ax: Any = None, **style: Any) -> Array:
        """Draw the switching function above the torque.

        Parameters
        ----------
        ax : sequence of matplotlib Axes, or a figure, optional
            Axes to draw on: switching function and torque. If None, a new figure is created.
        **style
            Line properties, passed to `matplotlib.axes.Axes.plot`; ``label`` is prefixed to the line labels.

        Returns
        -------
        ndarray of matplotlib.axes.Axes
            The axes, in the order of ``ax``.
        """
        return import_module("boomctl.plotting.slew").plot_switching(self, ax, **style)


@one_blas_thread
def switching_function(result: SlewResult) -> SwitchingFunction:
    """Return the switching function of a minimum-time slew.

    By Pontryagin's principle, the torque has the sign of this function.  It follows from the costate, propagated backward
    along the motion.

    Parameters
    ----------
    result : SlewResult
        Slew with a bang-bang torque.

    Returns
    -------
    SwitchingFunction
        Switching function and torque over time; ``.plot()`` draws both.

    Raises
    ------
    ValueError
        If the torque is not bang-bang.

    Examples
    --------
    >>> import boomctl as bc
    >>> fast = bc.optimal_slew(bc.hub_beam(modes=1), angle=1.0, torque_limit=200.0)
    >>> curve = bc.slew.switching_function(fast)
    >>> curve.switching_times.round(2), round(curve.sign_agreement, 2)  # s; fraction of the time with the right sign
    (array([0.82, 1.26, 1.69]), 1.0)
    """
    instance("result", result, SlewResult)
    profile, problem = result.torque_profile, result.plan.problem
    if result.certificate.n_switches is None:
        raise ValueError(
            "result: expected a slew with a bang-bang torque; plan one of minimum time without other limits"
        )
    durations, ends = np.diff(profile.edges), end_map(problem, profile)
    frequency = max(ends.step_frequency, _CURVE / profile.duration)
    counts = np.maximum(2, np.ceil(durations * frequency)).astype(int)
    steps = ends.steps(float(np.sign(profile.start_values[0])), durations, counts)
    values = ends.sensitivity(steps).switching_function
    middle = np.cumsum(steps.h) - 0.5 * steps.h
    return SwitchingFunction(
        middle, values / np.abs(values).max(), steps.u, profile.switching_times, problem.limits.torque
    )
