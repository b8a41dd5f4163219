"""A scheduled drive for a hub-beam: proved over hub speed and tip mass, how fast it may change, and a spin-up run with it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from boomctl.analysis.box.loops import BoxLoops
from boomctl.analysis.box.ramp import RampBound, ramp_bound
from boomctl.analysis.box.robustness import RobustStability, robust_stability
from boomctl.arrays import Array
from boomctl.checks import instance, nonnegative, positive, signal_name
from boomctl.lti.controllers.scheduled import ScheduledController
from boomctl.printing import compact
from boomctl.report import Report, Section, Table
from boomctl.rotating_beam.assumed_modes import AssumedModesBeam
from boomctl.rotating_beam.manoeuvres import spin_up
from boomctl.simulation.loop import simulate_loop
from boomctl.structure.families import interval

if TYPE_CHECKING:
    from boomctl.simulation.result import LoopResult

SCHEDULED, FIXED, OPEN = "scheduled", "designed at rest", "torque alone"
_AFTER = 1.0  # durations of the spin-up that are shown after it (a choice)
_GUST = 0.5  # durations after the spin-up at which the gust begins (a choice)
_GUST_TIME = 0.5  # s that it lasts: about the half of a period of the second mode (a choice)
_SETTLED = 3.0  # s after the gust from which the vibration left is told (a choice)
_RAMP_CELLS = 800  # most cells of the bound of the rate: some seconds (a choice)
_PLACES = 61  # hub speeds at which poles are shown (a choice)


@dataclass(frozen=True, eq=False)
class SpinUpDesign:
    """A hub-beam, and a drive scheduled over its hub speed that spins it up.

    Attributes
    ----------
    name, title : str
        A name in one word, and what it is in a line.
    beam : AssumedModesBeam
        What the drive was designed for.
    drive : ScheduledController
        From measurements of the beam to its ``torque``, over ``hub_speed``.
    tip_mass : (float, float)
        Range of point masses [kg] over which it is proved, and at whose ends it is run.
    final_speed, duration : float
        Of the spin-up, Eq. (43) of Bai et al. (2009) [rad/s, s].
    sample_time, torque_limit : float
        Of the drive [s, N m].
    gust : float
        Largest transverse force at the tip, a half sine after the spin-up [N].
    noise : mapping of str to float
        Standard deviation of each measurement.
    notes : tuple of str
        What a reader of the report should know.

    Raises
    ------
    TypeError, ValueError
        Other kinds; numbers out of range.

    Examples
    --------
    >>> import boomctl as bc
    >>> import control
    >>> signals = {"inputs": ["hub_angle", "hub_speed"], "outputs": "torque"}
    >>> drives = [control.ss([], [], [], [[-150.0, -gain]], **signals) for gain in (200.0, 300.0)]
    >>> beam, drive = bc.hub_beam(model="sfoam", modes=1), bc.schedule(drives, [0.0, 6.0])
    >>> bc.studies.SpinUpDesign("mine", "a drive", beam, drive, (0.0, 0.1), final_speed=5.0, duration=15.0).torque_limit
    200.0
    """

    name: str
    title: str
    beam: AssumedModesBeam
    drive: ScheduledController
    tip_mass: tuple[float, float]
    final_speed: float
    duration: float
    sample_time: float = 0.01
    torque_limit: float = 200.0
    gust: float = 0.0
    noise: Mapping[str, float] = field(default_factory=dict)
    notes: tuple[str, ...] = ()

    __repr__ = compact

    def __post_init__(self) -> None:
        signal_name("name", self.name)
        instance("title", self.title, str)
        instance("beam", self.beam, AssumedModesBeam)
        instance("drive", self.drive, ScheduledController)
        object.__setattr__(self, "tip_mass", interval("tip_mass", self.tip_mass))
        for what in ("final_speed", "duration", "sample_time", "torque_limit"):
            positive(what, getattr(self, what))
        nonnegative("gust", self.gust)

    @staticmethod
    def scene(**options: Any) -> None:
        """Return the scene: a spin-up has none.

        Parameters
        ----------
        options
            None are taken.

        Returns
        -------
        None
            Nothing.

        Raises
        ------
        ValueError
            Options are given.
        """
        if options:
            raise ValueError(f"{', '.join(options)}: of suspensions only; expected none for a spin-up")

    def evaluate(self, scene: None = None) -> SpinUpResult:
        """Judge the design: proofs over speed and tip mass, the rate at which the speed may change, and runs.

        Parameters
        ----------
        scene : None
            A spin-up has no scene.

        Returns
        -------
        SpinUpResult
            What was found, as text and for a report.

        Raises
        ------
        TypeError, ValueError
            As for :func:`boomctl.robust_stability` and :func:`boomctl.simulate_loop`.
        """
        low, high = float(self.drive.values[0]), float(self.drive.values[-1])
        family = self.beam.family((low, high), self.tip_mass)
        stability = robust_stability(family, self.drive)
        ramp = ramp_bound(family, self.drive, max_cells=_RAMP_CELLS)
        runs = {(way, mass): self._run(way, mass) for mass in self.tip_mass for way in (SCHEDULED, FIXED, OPEN)}
        fixed = self.drive.at(low)
        decay = {}
        for way, K in ((SCHEDULED, self.drive), (FIXED, fixed)):
            loops = BoxLoops.of(family, K)
            for share, mass in zip((-1.0, 1.0), self.tip_mass, strict=True):
                places = np.linspace(-1.0, 1.0, _PLACES)
                decay[way, mass] = np.array([-loops.at(np.array([place, share])).abscissa for place in places])
        speeds = np.linspace(low, high, _PLACES)
        return SpinUpResult(self, stability, ramp, runs, speeds, decay)

    def _run(self, way: str, mass: float) -> LoopResult:
        manoeuvre = spin_up(self.final_speed, self.duration)
        steps = int(np.ceil((1.0 + _AFTER) * self.duration / self.sample_time))
        time = self.sample_time * np.arange(steps + 1)
        begin = (1.0 + _GUST) * self.duration
        within = (time >= begin) & (time <= begin + _GUST_TIME)
        gust = {"tip_force": np.where(within, self.gust * np.sin(np.pi * (time - begin) / _GUST_TIME), 0.0)}
        torque = self.beam.parameters.rigid_inertia * np.array(manoeuvre.acceleration(time))
        beam = self.beam.with_tip_mass(mass)
        if way == OPEN:
            return simulate_loop(beam, None, {**gust, "torque": torque}, time, sample_time=self.sample_time)
        drive = self.drive if way == SCHEDULED else self.drive.at(float(self.drive.values[0]))
        wanted = {"hub_angle": manoeuvre.angle(time), "hub_speed": manoeuvre.speed(time)}
        return simulate_loop(
            beam,
            drive,
            gust,
            time,
            sample_time=self.sample_time,
            force_limit=self.torque_limit,
            noise=self.noise or None,
            reference={name: row for name, row in wanted.items() if name in self.drive.inputs},
            feedforward={"torque": torque},
        )


@dataclass(frozen=True, eq=False)
class SpinUpResult:
    """What a scheduled drive is worth.

    Attributes
    ----------
    design : SpinUpDesign
        The design that was judged.
    stability : RobustStability
        At every hub speed and tip mass, while they stay.
    ramp : RampBound
        How fast the hub speed may change, whatever the tip mass.
    runs : dict from (way, tip mass) to LoopResult
        The spin-up and what follows: with the drive ("scheduled"), with its controller for the lowest speed throughout
        ("designed at rest"), and with the torque of a rigid beam alone ("torque alone").
    speeds : (n,) ndarray
        Hub speeds [rad/s].
    decay : dict from (way, tip mass) to (n,) ndarray
        Rate at which the slowest mode of the loop decays at each of them, both staying [1/s].
    """

    design: SpinUpDesign
    stability: RobustStability
    ramp: RampBound
    runs: dict[tuple[str, float], LoopResult]
    speeds: Array
    decay: dict[tuple[str, float], Array]

    __repr__ = compact

    @property
    def fastest(self) -> float:
        """Largest acceleration of the hub that is asked for [rad/s^2]."""
        return 2.0 * self.design.final_speed / self.design.duration  # of Eq. (43)

    @property
    def verdict(self) -> str:
        """The result in a sentence."""
        low, high = self.design.tip_mass
        stable = "Proved stable" if self.stability.proved else "NOT proved stable"
        where = f"at every hub speed from {self.speeds[0]:g} to {self.speeds[-1]:g} rad/s with {low:g} to {high:g} kg"
        kept = "below" if self.fastest <= self.ramp.rate else "NOT below"
        rate = f"a speed may change by up to {self.ramp.rate:.3g} rad/s², proved"
        return f"{stable} {where}; {rate}, and the spin-up asks for {self.fastest:.3g} rad/s², {kept} that."

    def numbers(self, way: str, mass: float) -> dict[str, float]:
        """Return what a run came to.

        Parameters
        ----------
        way : str
            "scheduled", "designed at rest" or "torque alone".
        mass : float
            Tip mass [kg].

        Returns
        -------
        dict of str to float
            Largest tip displacement ``tip``, and those ``left`` after the spin-up and ``after_gust`` from 3 s behind the
            gust on [m]; largest deviation of the hub speed after the spin-up ``speed_error`` [rad/s]; ``torque`` [N m].
        """
        run, design = self.runs[way, mass], self.design
        tip, gust = np.abs(run["tip_displacement"]), (1.0 + _GUST) * design.duration
        left = (run.time > design.duration) & (run.time < gust)
        torque = run.controls.get("torque", run.disturbances.get("torque", np.zeros(1)))
        return {
            "tip": float(tip.max()),
            "left": float(tip[left].max()),
            "after_gust": float(tip[run.time > gust + _GUST_TIME + _SETTLED].max()),
            "speed_error": float(np.abs(run["hub_speed"] - design.final_speed)[left].max()),
            "torque": float(np.abs(torque).max()),
        }

    def __str__(self) -> str:
        """Return what a terminal shows."""
        lines = [f"{self.design.title}: {self.verdict}", f"  {self.stability.render()}", f"  {self.ramp.render()}"]
        for way, mass in self.runs:
            n = self.numbers(way, mass)
            lines.append(
                f"  {way}, {mass:g} kg at the tip: tip {n['tip']:.3g} m, {1e3 * n['left']:.2g} mm left, "
                f"{1e3 * n['after_gust']:.2g} mm after the gust, torque {n['torque']:.0f} N m"
            )
        return "\n".join(lines)

    def as_dict(self) -> dict[str, Any]:
        """Return the numbers, for JSON.

        Returns
        -------
        dict
            Names, numbers and texts that JSON can hold.
        """
        return {
            "design": self.design.name,
            "proved": self.stability.proved,
            "slowest_pole": self.stability.abscissa,
            "proved_rate": self.ramp.rate,
            "rate_at_most": self.ramp.at_most,
            "rate_asked": self.fastest,
            "runs": [{"way": way, "tip_mass": mass, **self.numbers(way, mass)} for way, mass in self.runs],
        }

    def report(self, tell: Callable[[str], None] = lambda text: None) -> Report:
        """Return the report: proofs, runs, pictures.

        Parameters
        ----------
        tell : callable, optional
            Is told in words what comes next.

        Returns
        -------
        Report
            ``.write(folder)`` writes it.
        """
        from boomctl.plotting.canvas import figure_of, picture
        from boomctl.plotting.studies.spin_up import plot_decay, plot_spin_up_runs

        tell("pictures")
        design, heavy = self.design, self.design.tip_mass[-1]
        heads = ("drive", "tip mass", "largest tip displacement", "left after the spin-up", "left after the gust")
        lines = []
        for way, mass in self.runs:
            n = self.numbers(way, mass)
            shown = (f"{n['tip']:.3f} m", f"{1e3 * n['left']:.1f} mm", f"{1e3 * n['after_gust']:.1f} mm")
            errors = (f"{1e3 * n['speed_error']:.1f} mrad/s", f"{n['torque']:.0f} N m")
            lines.append((way, f"{mass:g} kg", *shown, *errors))
        runs = Table((*heads, "speed error", "torque"), tuple(lines), align="lr")
        proofs = (
            f"While hub speed and tip mass stay: {self.stability.render()}.",
            f"While the hub speed changes, whatever the tip mass: {self.ramp.render()}. The spin-up asks for at most "
            f"{self.fastest:.3g} rad/s².",
            "Both speak of the linear loop about steady rotation, in continuous time and without the limit of the torque: "
            "what the ramp itself forces, sampling and noise are in the runs below, which are nonlinear.",
        )
        caption = f"The spin-up with {heavy:g} kg at the tip, of which the drive does not know, and a gust after it."
        poles = "Decay of the slowest mode at each hub speed, which stays."
        sections = (
            Section("What it is worth", (self.verdict, *design.notes)),
            Section("What is proved", proofs, (), (picture("decay", figure_of(plot_decay, self), poles),)),
            Section("The spin-up", (), (runs,), (picture("spin_up", figure_of(plot_spin_up_runs, self), caption),)),
        )
        lead = f"{design.title}: a drive scheduled over the hub speed, and a spin-up to {design.final_speed:g} rad/s."
        return Report(f"Spin-up: {design.title}", (lead,), sections, self.as_dict())
