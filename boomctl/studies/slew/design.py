"""A slew of the hub-beam that is to be judged, and the judging: beside other slews, with payloads, profiles, feedback."""

from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass
from functools import cached_property
from typing import Any

import numpy as np

from boomctl.checks import instance
from boomctl.plotting.slew import animate_slew
from boomctl.printing import compact
from boomctl.report import Section
from boomctl.rotating_beam.assumed_modes import AssumedModesBeam
from boomctl.rotating_beam.manoeuvres import SpinUp
from boomctl.slew.classical.comparison import SlewComparison, compare_slews
from boomctl.slew.least_time.switching_curve import SwitchingCurve, switching_curve
from boomctl.slew.result import Replay, SlewResult
from boomctl.slew.tracking.tracked import TrackedSlew
from boomctl.studies.findings import Finding, Judged, picked, scalars
from boomctl.studies.slew import feedback, sections
from boomctl.studies.slew.feedback import FeedbackStudy, Followed, Spread
from boomctl.studies.slew.spin_up import SpinUpMotion, spin_ups
from boomctl.threads import one_blas_thread

_MORE = 0.1  # by how much the tip mass of the followed beam exceeds the largest planned one [kg]; a choice
_AFTER = 2.0  # how long the film goes on after the end [s] (a choice)
_OF_SLEW = (
    "objective", "duration", "cost", "end_error", "residual_energy", "time", "torque", "hub_angle", "hub_speed",
    "tip_displacement",
)  # fmt: skip
_DRAWN = ("feedback", "seed", "drawn", "vibration", "angle_error", "error_estimate")


@dataclass(frozen=True, eq=False)
class SlewDesign:
    """A planned slew, and what it is to be compared with.

    Attributes
    ----------
    name, title : str
        A name in one word, and what it is in a line.
    beam : AssumedModesBeam
        What the slew was planned for.
    planned : mapping of str to SlewResult
        Slews of the beam by name: first the one designed, then others to be set beside it. All have the same angle, or
        spin up to the same speed, under the same torque limit. Judging adds classical ones.
    rival : str
        The slew that the film shows beside the designed one: planned or classical. "": a rigid body's.
    payloads : tuple of float
        Tip masses with which the planned slews are played [kg].
    profile : SpinUp or None
        For a spin-up: a profile of the hub to be set beside it, prescribed exactly.
    tracked : TrackedSlew or None
        The slew with feedback along it, to be judged beside the plan alone.
    spread : Spread or None
        How the machines that follow it may differ; needed with ``tracked``.
    runs : int
        How many of them are drawn.
    notes : tuple of str
        What a reader of the report should know.

    Examples
    --------
    >>> import boomctl as bc
    >>> beam = bc.hub_beam(modes=1)
    >>> fastest = bc.optimal_slew(beam, angle=1.0, torque_limit=200.0)
    >>> bc.studies.SlewDesign("quick", "one radian in least time", beam, {"least time": fastest}).rival
    ''
    """

    name: str
    title: str
    beam: AssumedModesBeam
    planned: Mapping[str, SlewResult]
    rival: str = ""
    payloads: tuple[float, ...] = ()
    profile: SpinUp | None = None
    tracked: TrackedSlew | None = None
    spread: Spread | None = None
    runs: int = 256
    notes: tuple[str, ...] = ()

    __repr__ = compact

    @property
    def slew(self) -> SlewResult:
        """The slew designed."""
        return next(iter(self.planned.values()))

    @property
    def label(self) -> str:
        """Its name."""
        return next(iter(self.planned))

    @property
    def rigid(self) -> str:
        """Name of the fastest torque of a rigid body with the same inertia."""
        return "constant torque" if self.slew.plan.problem.angle is None else "bang-bang"

    @one_blas_thread
    def evaluate(self) -> "SlewEvaluation":
        """Set the slew beside the others, with all payloads, by an integrator that planning does not use.

        Returns
        -------
        SlewEvaluation
            What was found, as text and for a report.
        """
        h, problem = self.beam, self.slew.plan.problem
        asked = h, problem.angle, problem.limits.torque, self.planned, problem.final_speed
        comparison, pair = compare_slews(*asked, tip_masses=self.payloads), ()
        if self.profile is not None:
            pair = spin_ups(h, self.label, self.slew.history, self.profile)
        held = None
        if self.tracked is not None:
            held = feedback.judged(self.tracked, instance("spread", self.spread, Spread), self.runs)
        return SlewEvaluation(self, comparison, pair, held)


@dataclass(frozen=True, eq=False)
class SlewEvaluation(Judged):
    """What a slew is worth.

    Attributes
    ----------
    design : SlewDesign
        The design that was judged.
    comparison : SlewComparison
        The slew beside the other planned ones and classical ones, with the payloads of the design too.
    spin_ups : tuple of SpinUpMotion
        The spin-up designed, and the hub's profile; () without a profile.
    feedback : FeedbackStudy or None
        What feedback along the slew is worth; None where the design has none.
    """

    kind = ""

    design: SlewDesign
    comparison: SlewComparison
    spin_ups: tuple[SpinUpMotion, ...]
    feedback: FeedbackStudy | None = None

    __repr__ = compact

    @property
    def verdict(self) -> str:
        """What it is worth, in words."""
        own, rigid = (self.comparison.line(name) for name in (self.design.label, self.design.rigid))
        said = (
            f"{own.duration:.5g} s, {own.duration / rigid.duration:.3f} times a rigid body's least time; the tip vibrates by "
            f"{_length(own.vibration)} afterwards, {_length(rigid.vibration)} after a rigid body's fastest torque"
        )
        if self.feedback is not None:
            said += f"; {self.feedback.verdict}"
        masses = self.comparison.tip_masses
        if not masses.size:
            return said + "."
        left = {name: float(self.comparison.line(name).vibrations.max()) for name in self.design.planned}
        parts = [f"{_length(most)} ({name})" for name, most in left.items()]
        return f"{said}; with payloads from {masses.min():g} to {masses.max():g} kg by at most {', '.join(parts)}."

    @property
    def lead(self) -> str:
        """What the report is about, and what the slew is worth."""
        said = (
            f"{self.design.slew.title.capitalize()}: planned, replayed by another integrator, and set beside classical"
        )
        return f"{said} commands. {self.verdict[:1].upper()}{self.verdict[1:]}"

    def __str__(self) -> str:
        return f"{self.design.title}: {self.verdict}\n{self.design.slew.certificate.verdict}"

    @property
    def replays(self) -> tuple[Replay, ...]:
        """The slew on the planning model, with the other payloads, and on other models."""
        design, slew = self.design, self.design.slew
        problem = slew.plan.problem
        planned = Replay(
            model=design.beam.model,
            tip_mass=None,
            angle_error=0.0 if problem.angle is None else float(slew.hub_angle[-1]) - problem.angle,
            speed_error=float(slew.hub_speed[-1]) - problem.final_speed,
            tip_swing=self.comparison.line(design.label).vibration,
            residual_energy=slew.residual_energy,
        )
        return (planned, *slew.replays)

    @cached_property
    def following(self) -> Followed | None:
        """The slew followed with more at the tip than was planned for; None where feedback was judged."""
        if self.feedback is not None:
            return None
        mass = max(self.design.beam.parameters.tip_mass, *self.design.payloads, 0.0) + _MORE
        return feedback.followed(self.design.slew.track(integral_time=None), mass)

    @cached_property
    def switching(self) -> SwitchingCurve | None:
        """The switching function; None of a torque without switching times."""
        slew = self.design.slew
        return None if slew.certificate.switches is None else switching_curve(slew)

    @property
    def film_tip_mass(self) -> float:
        """Payload that the film shows: the one that the rival suits least [kg]."""
        masses = self.comparison.tip_masses
        if masses.size and self.design.rival in self.design.planned:
            return float(masses[self.comparison.line(self.design.rival).vibrations.argmax()])
        return self.design.beam.parameters.tip_mass

    @property
    def findings(self) -> tuple[Finding, ...]:
        """What was found, in the order in which it is told."""
        said = self.design.slew.certificate.verdict
        return (Finding("certificate", said, text=said, key="verdict"), Finding("", self.verdict, key="worth"))

    def as_dict(self) -> dict[str, Any]:
        """Return the numbers, for JSON; other models are run, and the slew is followed, where they were not yet.

        Returns
        -------
        dict
            Names, numbers and texts that JSON can hold.
        """
        design, slew, switching = self.design, self.design.slew, self.switching
        found = {
            "name": design.name,
            "title": design.title,
            "model": design.beam.model,
            "modes": design.beam.modes,
            "parameters": asdict(design.beam.parameters),
            "certificate": asdict(slew.certificate),
            "switches": None if switching is None else slew.history.switches,
            "switching_agreement": None if switching is None else switching.agreement,
            "replays": [scalars(each) for each in self.replays],
            "comparison": [scalars(each) | {"vibrations": each.vibrations} for each in self.comparison.lines],
            "tip_masses": self.comparison.tip_masses,
            "spin_ups": [scalars(each) for each in self.spin_ups],
            "film_tip_mass": self.film_tip_mass,
            **dict.fromkeys(("tracking", "feedback")),
            **picked([slew], _OF_SLEW)[0],
        }
        if self.following is not None:
            found["tracking"] = scalars(self.following)
        if (study := self.feedback) is not None:
            machines, runs = picked(study.lines, sections.HELD), picked((study.open, study.closed), _DRAWN)
            found["feedback"] = {"machines": machines, "stiffness_ratio": study.stiffness_ratio, "runs": runs}
        return found | super().as_dict()

    def _sections(self, files: tuple[str, ...]) -> Iterator[Section]:
        design, slew, h = self.design, self.design.slew, self.design.beam
        planned_mass = h.parameters.tip_mass
        replays = self.replays
        following = self.following
        yield sections.slew_section(h, slew, design.notes)
        yield self._film()
        if design.tracked is not None and self.feedback is not None:
            yield sections.feedback_section(design.tracked, self.feedback)
        if self.switching is not None:
            yield sections.switching_section(self.switching)
        if self.spin_ups:
            yield sections.spin_up_section(self.spin_ups, slew.plan.problem)
        zv = f"{design.rigid}, ZV"
        shown = tuple(dict.fromkeys((*design.planned, design.rigid, design.rival or zv, zv)))
        yield sections.comparison_section(self.comparison, shown)
        yield sections.replay_section(replays, slew.plan.problem.angle is None)
        if following is not None:
            yield sections.tracking_section(planned_mass, following)

    def _film(self) -> Section:
        """The slew and its rival on the same beam."""
        design, beam = self.design, self.design.beam.with_tip_mass(self.film_tip_mass)
        last, motions = design.slew.duration + _AFTER, {}
        for name in (design.label, design.rival or design.rigid):
            label = "rigid body's bang-bang" if name == "bang-bang" else name
            motions[label] = beam.simulate(self.comparison.line(name).history, np.linspace(0.0, last, 601))
        shown = animate_slew(beam, motions, title=design.slew.title.capitalize())
        return sections.film_section(shown, self.film_tip_mass if design.payloads else None)


def _length(value: float) -> str:
    """A length [m] in words, with two digits."""
    if value < 1e-6:
        return "less than 1 µm"
    if value < 1e-3:
        return f"{1e6 * value:.2g} µm"
    return f"{1e3 * value:.2g} mm" if value < 0.1 else f"{value:.2g} m"
