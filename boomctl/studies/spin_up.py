"""A scheduled drive for a hub-beam: proved over hub speed and tip mass, how fast it may change, and a spin-up run with it."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
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
from boomctl.report import Section, Table
from boomctl.rotating_beam.assumed_modes import AssumedModesBeam
from boomctl.rotating_beam.manoeuvres import spin_up
from boomctl.simulation.loop import simulate_loop
from boomctl.structure.families import interval
from boomctl.studies.findings import Finding, Judged, WithoutScene, stored
from boomctl.threads import one_blas_thread

if TYPE_CHECKING:
    from boomctl.simulation.result import LoopResult

SCHEDULED, FIXED, OPEN = "scheduled", "designed at rest", "torque alone"
_RAMP_CELLS = 800  # most cells of the bound of the rate: some seconds (a choice)
_COLUMNS = {  # of the table of runs: head, unit, its size in SI, digits behind the point
    "tip": ("largest tip displacement", "m", 1.0, 3),
    "left": ("left after the spin-up", "mm", 1e-3, 1),
    "after_gust": ("left after the gust", "mm", 1e-3, 1),
    "speed_error": ("speed error", "mrad/s", 1e-3, 1),
    "torque": ("torque", "N m", 1.0, 0),
}
_PLACES = 61  # hub speeds at which poles are shown (a choice)


@dataclass(frozen=True, eq=False)
class SpinUpDesign(WithoutScene):
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
        Largest transverse force at the tip, a half sine that begins half a duration after the spin-up [N].
    noise : mapping of str to float
        Standard deviation of each measurement.
    notes : tuple of str
        What a reader of the report should know.
    gust_time, settling : float
        How long the gust lasts, by default about the half of a period of the second mode, and the time after it from which
        on the vibration left is told [s].

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
    gust_time: float = 0.5
    settling: float = 3.0

    __repr__ = compact

    def __post_init__(self) -> None:
        signal_name("name", self.name)
        instance("title", self.title, str)
        instance("beam", self.beam, AssumedModesBeam)
        instance("drive", self.drive, ScheduledController)
        object.__setattr__(self, "tip_mass", interval("tip_mass", self.tip_mass))
        for what in ("final_speed", "duration", "sample_time", "torque_limit", "gust_time"):
            positive(what, getattr(self, what))
        for what in ("gust", "settling"):
            nonnegative(what, getattr(self, what))

    @one_blas_thread
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

    @property
    def _gust(self) -> tuple[float, float]:
        """When the gust begins and ends [s]."""
        begin = 1.5 * self.duration
        return begin, begin + self.gust_time

    def _run(self, way: str, mass: float) -> LoopResult:
        manoeuvre = spin_up(self.final_speed, self.duration)
        begin, gust_ends = self._gust
        last = max(2.0 * self.duration, gust_ends + 2.0 * self.settling + self.gust_time)
        time = self.sample_time * np.arange(int(np.ceil(last / self.sample_time)) + 1)
        within = (time >= begin) & (time <= gust_ends)
        gust = {"tip_force": np.where(within, self.gust * np.sin(np.pi * (time - begin) / self.gust_time), 0.0)}
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
class SpinUpResult(Judged):
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

    kind = "Spin-up: "

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

    @property
    def lead(self) -> str:
        """What the report is about, in a sentence."""
        design = self.design
        return f"{design.title}: a drive scheduled over the hub speed, and a spin-up to {design.final_speed:g} rad/s."

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
            Largest tip displacement ``tip``, and those ``left`` after the spin-up and ``after_gust`` once it has settled
            [m]; largest deviation of the hub speed after the spin-up ``speed_error`` [rad/s]; ``torque`` [N m].
        """
        run, design = self.runs[way, mass], self.design
        tip, (gust, gust_ends) = np.abs(run["tip_displacement"]), design._gust
        left = (run.time > design.duration) & (run.time < gust)
        torque = run.controls.get("torque", run.disturbances.get("torque", np.zeros(1)))
        found = {
            "tip": tip,
            "left": tip[left],
            "after_gust": tip[run.time > gust_ends + design.settling],
            "speed_error": np.abs(run["hub_speed"] - design.final_speed)[left],
            "torque": np.abs(torque),
        }
        return {key: float(values.max()) for key, values in found.items()}

    @property
    def findings(self) -> tuple[Finding, ...]:
        """What was found, in the order in which it is told."""
        stability, ramp, runs, said = self.stability, self.ramp, [], []
        for way, mass in self.runs:
            runs.append({"way": way, "tip_mass": mass, **self.numbers(way, mass)})
            n = _in_words(runs[-1])
            text = f"tip {n['tip']}, {n['left']} left, {n['after_gust']} after the gust, torque {n['torque']}"
            said.append(Finding(f"{way}, {mass:g} kg at the tip", text=text))
        return (
            *stored(design=self.design.name),
            Finding("", stability.proved, proved=stability.proved, text=stability.render(), key="proved"),
            *stored(slowest_pole=stability.abscissa),
            Finding("", ramp.rate, proved=ramp.proved, text=ramp.render(), key="proved_rate"),
            *stored(rate_at_most=ramp.at_most, rate_asked=self.fastest, runs=runs),
            *said,
        )

    def _sections(self, tell: Callable[[str], None], files: tuple[str, ...]) -> Iterator[Section]:
        from boomctl.plotting.canvas import figure_of, picture
        from boomctl.plotting.rotating_beam import plot_decay, plot_spin_up_runs

        tell("pictures")
        proofs = (
            f"While hub speed and tip mass stay: {self.stability.render()}.",
            f"While the hub speed changes, whatever the tip mass: {self.ramp.render()}. The spin-up asks for at most "
            f"{self.fastest:.3g} rad/s².",
            "Both speak of the linear loop about steady rotation, in continuous time and without the limit of the torque: "
            "what the ramp itself forces, sampling and noise are in the runs below, which are nonlinear.",
        )
        poles = "Decay of the slowest mode at each hub speed, which stays."
        heads = ("drive", "tip mass", *(head for head, *_ in _COLUMNS.values()))
        lines = ((way, f"{mass:g} kg", *_in_words(self.numbers(way, mass)).values()) for way, mass in self.runs)
        heavy = self.design.tip_mass[-1]
        caption = f"The spin-up with {heavy:g} kg at the tip, of which the drive does not know, and a gust after it."
        yield Section("What it is worth", (self.verdict, *self.design.notes))
        yield Section("What is proved", proofs, (), (picture("decay", figure_of(plot_decay, self), poles),))
        runs = picture("spin_up", figure_of(plot_spin_up_runs, self), caption)
        yield Section("The spin-up", (), (Table(heads, tuple(lines)),), (runs,))


def _in_words(found: Mapping[str, Any]) -> dict[str, str]:
    """Return what a run came to as text, in the units of the table."""
    return {key: f"{found[key] / size:.{digits}f} {unit}" for key, (_, unit, size, digits) in _COLUMNS.items()}
