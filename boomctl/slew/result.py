"""What a planned slew returns, and what is raised when none can be vouched for."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from importlib import import_module
from math import inf, isfinite
from typing import TYPE_CHECKING, Any

from boomctl.arrays import Array
from boomctl.lti.time_series import TimeSeries
from boomctl.printing import Summarized, compact
from boomctl.slew.objectives import OBJECTIVES
from boomctl.slew.plant import LABELS
from boomctl.slew.torque import TorqueProfile
from boomctl.threads import one_blas_thread

if TYPE_CHECKING:
    from boomctl.simulation.signals import Levels
    from boomctl.slew.tracked import TrackedSlew


@dataclass(frozen=True)
class Replay:
    """What a model does under the planned torque, by an integrator that the planning does not use.

    Attributes
    ----------
    model : str
        Name of the model.
    tip_mass : float or None
        The tip mass, where it is another than the planned one [kg].
    angle_error : float
        Hub angle at the end less the wanted one [rad]; 0 where the angle is free.
    speed_error : float
        Hub speed at the end less the wanted one [rad/s].
    residual_vibration : float
        Largest tip displacement in the 1.5 slowest periods after the end [m].
    residual_energy : float or None
        Energy of the deviation from steady rotation at the wanted speed [J].

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
    """How close a slew is to what was asked and to the best there is, computed apart from its planning.

    Attributes
    ----------
    method : str
        "switching times", "least effort" or "collocation".
    terminal_error : float
        Largest deviation of the end state in the replay, of all coordinates of the model, each relative to its largest size
        on the way.
    prescribed_terminal_error : float
        The same for what planning prescribes: all but axial motion. This is held to the tolerance.
    free_terminal_errors : dict of str to float
        The same for the axial coordinates and rates of a beam, which planning leaves free, by their names.
    constraint_violation : float
        Largest relative excess over any limit in the replay, local maxima between its times included; 0 if there is none.
    active_constraints : dict of str to float
        Limits that are met within 0.1 %, and the first instant at which they are, s.
    optimality_gap : float
        Distance from the least cost there is, relative; what it rests on stands in ``optimality_status``.  With axial modes
        it is that of the same beam without them, which is planned.
    optimality_status : str
        "proved": a duality bound or Pontryagin's principle on a convex problem; "extremal": Pontryagin's conditions hold on
        a problem that is not convex; "stationary": the conditions of an optimum hold on the mesh, and the gap is
        that of halving the mesh, where one mesh of least effort was asked for to first order.
    n_switches : int or None
        Number of sign changes of a bang-bang torque.
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
        met = f"; limits met: {', '.join(self.active_constraints)}" if self.active_constraints else ""
        free = (
            f" ({self.prescribed_terminal_error:.1e} without axial motion, left free)"
            if self.free_terminal_errors
            else ""
        )
        errors = f"end error {self.terminal_error:.1e}{free}, limits exceeded by {self.constraint_violation:.1e}{met}"
        return f"SlewCertificate: {self.method}\n  {self.summary}\n  {errors}"

    @property
    def summary(self) -> str:
        """What is known about the optimum, in words."""
        return f"{self._optimum}; of the beam without axial modes" if self.free_terminal_errors else self._optimum

    @property
    def _optimum(self) -> str:
        gap = abs(self.optimality_gap)
        if self.optimality_status == "proved":
            return f"proved optimal within {max(gap, 1e-15):.0e} of the cost"
        if self.optimality_status == "extremal":
            within = f" within {gap:.0e}" if gap > 0.0 else ""
            return f"Pontryagin's conditions hold{within}, on a problem that is not convex"
        mesh = f"stationary on its mesh of {self.intervals} intervals"
        if gap == float("inf"):
            return f"{mesh}; no other mesh tells how near that is to the best"
        return f"{mesh}; one half or twice as fine changes the cost by {gap:.0e}"


@dataclass(frozen=True, eq=False)
class SlewResult(Summarized, TimeSeries):
    """A slew: the torque, what the plant does under it, and the certificate.

    Attributes
    ----------
    objective : str
        What was made small: "time", "effort", "jerk", "torque-rate" or "tip".
    duration : float
        How long the slew takes [s].
    cost : float
        Value of the objective: s for "time", N^2 m^2 s for "effort", rad^2/s^5 for "jerk", N^2 m^2/s for "torque-rate",
        m for "tip".  Of a linear system other than a hub-beam's, all of these are in the units of its own signals.
    time : ndarray, k
        Instants of the dense replay, s.
    torque, hub_angle, hub_speed : ndarray, k
        Torque [N m], hub angle [rad] and hub speed [rad/s] then.
    tip_displacement : ndarray, k, or None
        Tip displacement [m]; None of a linear system without an output of this name.
    root_moment : ndarray, k, or None
        Bending moment at the clamp [N m]; None likewise.
    states : ndarray, k x n
        States of the plant, in its own order.
    residual_energy : float or None
        Energy left after the end [J]; None of a linear system.
    terminal_error : float
        Largest relative deviation of the end state, as in the certificate: of all coordinates of the model, also of
        those that planning does not prescribe.
    certificate : SlewCertificate
        How close the slew is to what was asked and to the best there is.
    torque_profile : TorqueProfile
        The torque as a function of time.
    plan : object
        What `replan` and `track` start from.
    stages : tuple of str
        The ways that were tried to find it, in order, each in words; the last one found it.
    small_deformation_until : float
        Instant at which the tip of a hub-beam first exceeds a tenth of its length [s], up to one and a half of the slowest
        periods after the end: beyond it, only the geometrically exact model holds. inf if it never does, and of a linear
        system, whose length nobody says.
    elapsed : float
        Time that the search took, its replay included [s].
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
    _others: Callable[[], tuple[Replay, ...]] = field(repr=False, default=tuple)
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
            tip += f", beyond a tenth of the length after {self.small_deformation_until:.4g} s"
        free = (
            f" ({self.certificate.prescribed_terminal_error:.1e} without axial motion)"
            if self.certificate.free_terminal_errors
            else ""
        )
        left = f"{free}, {self.residual_energy:.1e} J left" if self.residual_energy is not None else free
        name, unit = self._labels["torque"]
        torque = f"{name} up to {f'{self.torque_profile.peak:.6g} {unit}'.rstrip()}{tip}"
        return (
            f"SlewResult: {self.title}, {turned}\n  {torque}\n"
            f"  end error {self.terminal_error:.1e}{left}\n  {self.certificate.summary}"
        )

    @property
    def _labels(self) -> Mapping[str, tuple[str, str]]:
        """Names and units of what it is said in, by kind."""
        return LABELS if self.plan is None else self.plan.problem.plants[0].labels

    @property
    def success(self) -> bool:
        """Whether the search ended by itself; False where time ran out before the cost was known to be that of any mesh."""
        return self.certificate.optimality_status != "stationary" or "out of time" not in "; ".join(self.stages)

    @property
    def nit(self) -> int | None:
        """Iterations of the solver on the final mesh; None where the torque was found without one."""
        return getattr(getattr(self.plan, "solution", None), "nit", None)

    @property
    def title(self) -> str:
        """The objective in words, as "minimum time"."""
        return OBJECTIVES[self.objective].title

    @cached_property
    @one_blas_thread
    def _replays(self) -> tuple[Replay, ...]:
        return self._others()

    def replay(self) -> tuple[Replay, ...]:
        """Play the torque on the other payloads of the plan, on the FOAM and on the geometrically exact beam.

        Any other beam plays it by ``beam.simulate(slew)``, and returns its whole motion.

        Returns
        -------
        tuple of Replay
            One for each: how far it is off at the end, and how much it vibrates then.  None of a linear system.

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
        """Return the slew with feedback along it: a time-varying LQR, or LQG, about its trajectory.

        The plan's torque is the feedforward, and what is measured is compared with the plan.  The nonlinear model is
        linearized along the plan, sampled as the torque is held; Riccati's recursion runs back from the rest at the end.

        Parameters
        ----------
        sample_time : float
            Between samples [s]; rounded such that the slew has a whole number of them.
        torque_limit : float, optional
            Largest torque of plan and feedback together [N m]; by default half as much again as that of the planning. A
            slew of least time takes all that it is planned with, so plan it with less than there is.
        dwell_time : float, optional
            Time for which the end is held [s]; by default four of the slowest periods.
        measurements : str or sequence of str, optional
            Outputs of the machine that are read, as :func:`boomctl.simulate_loop` names them; by default all states.
        sensors : sequence of BeamSensor
            Further outputs.
        noise : float or mapping from measurement to float, optional
            Standard deviation of each measurement, at each sample.
        tracking_weight : float
            Weight of the deviations of hub angle, tip and their rates over the span of each in the plan, squared, beside
            that of the torque over its limit; larger follows more tightly.
        integral_time : float, optional
            Time in which a constant torque that disturbs is made out and balanced [s]; None: it is not.
        disturbance : float, optional
            Standard deviation of a torque that the observer takes to disturb, anew at each sample [N m]; by default 10 % of
            the largest torque.
        stiffness_uncertainty : float
            Share by which the observer takes the stiffness to be wrong.

        Returns
        -------
        TrackedSlew
            ``.simulate()`` follows the slew, ``.monte_carlo()`` many times, by machines that differ.

        Raises
        ------
        TypeError, ValueError
            Arguments of another kind or out of range; a slew of a linear system.

        Examples
        --------
        >>> import boomctl as bc
        >>> slew = bc.optimal_slew(bc.hub_beam(modes=1), angle=1.0, torque_limit=160.0)
        >>> slew.track(torque_limit=200.0)
        TrackedSlew: 2.69713 s, sampled every 0.005004 s
          LQR of all states
          torque: 160 N m planned of 200
          stable at the end, the slowest pole in 1.56 s
        """
        from boomctl.slew.tracked import tracked_slew  # which only a slew that is followed needs

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
        """Return what a comparison shows."""
        own = self._labels is not LABELS  # units of its own, which nobody says
        result = {
            "duration [s]": self.duration,
            f"{self._labels['torque'][0]}: peak{'' if own else ' [N m]'}": self.torque_profile.peak,
        }
        result["effort" if own else "effort [N^2 m^2 s]"] = self.torque_profile.effort
        if self.tip_displacement is not None:
            result[f"tip displacement: peak{'' if own else ' [m]'}"] = float(abs(self.tip_displacement).max())
        if self.residual_energy is not None:
            result["energy left [J]"] = self.residual_energy
        return result | {"end error": self.terminal_error}

    def plot(self, ax: Any = None, **style: Any) -> Array:
        """Draw torque, hub and tip over time, with the limits near them.

        Parameters
        ----------
        ax : sequence of matplotlib Axes, or a figure, optional
            Where to draw: torque, hub angle, hub speed, tip displacement and root moment, those that there are; by default
            a new figure of pyplot.
        **style
            Of the curves, as matplotlib's lines take it; a ``label`` stands before their names.

        Returns
        -------
        ndarray of matplotlib.axes.Axes
            Those drawn on, in the order in which ``ax`` names them.
        """
        return import_module("boomctl.plotting.slew").plot_slew(self, ax, **style)
