"""A slew of the hub-beam that is to be judged, and the judging: other slews, payloads, profiles, feedback."""

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from boomctl.checks import instance
from boomctl.printing import compact
from boomctl.report import Report, Section
from boomctl.rotating_beam.assumed_modes import AssumedModesBeam
from boomctl.rotating_beam.manoeuvres import SpinUp
from boomctl.slew.classical.comparison import SlewComparison, compare_slews
from boomctl.slew.classical.tracking import TrackingResult, track
from boomctl.slew.least_time.arcs import SwitchingCurve, switching_curve
from boomctl.slew.nlp.mesh_study import MeshStudy
from boomctl.slew.payloads import PayloadComparison, compare_payloads
from boomctl.slew.result import Replay, SlewResult
from boomctl.slew.tracking.tracked import TrackedSlew
from boomctl.studies.slew import feedback, sections
from boomctl.studies.slew.feedback import FeedbackStudy, Spread
from boomctl.studies.slew.spin_up import SpinUpMotion, spin_ups

_MORE = 0.1  # by how much the tip mass of the followed beam exceeds the largest planned one [kg]; a choice
_AFTER = 2.5  # how long motions go on after the end [s]: a little longer than the film, which ends after 2 s
_COMPARED = (
    "name", "duration", "vibration", "angle_error", "speed_error", "peak_moment", "effort", "vibration_low", "vibration_high",
)  # fmt: skip
_CARRIED = ("slew", "tip_mass", "planned", "peak_tip", "vibration", "angle_error")
_TRACKED = ("tip_mass", "final_angle_error", "open_final_angle_error", "tip_swing", "open_tip_swing")
_HELD = ("machine", "open_vibration", "vibration", "ratio", "open_angle_error", "angle_error")
_SPUN = ("name", "duration", "peak_torque", "vibration", "speed_error")


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

    @staticmethod
    def scene() -> None:
        """Return the scene of a slew: there is none to choose.

        Returns
        -------
        None
            Nothing.
        """

    def evaluate(self, scene: None = None) -> "SlewEvaluation":
        """Set the slew beside the others, with all payloads, by an integrator that planning does not use.

        Parameters
        ----------
        scene : None
            A slew has no scene.

        Returns
        -------
        SlewEvaluation
            What was found, as text and for a report.
        """
        h, problem = self.beam, self.slew.plan.problem
        comparison = compare_slews(h, problem.angle, problem.limits.torque, self.planned, problem.final_speed)
        payloads, pair = None, ()
        if self.payloads:
            payloads = compare_payloads(self.planned, self.payloads, h.parameters.tip_mass)
        if self.profile is not None:
            pair = spin_ups(h, self.label, self.slew.history, self.profile)
        held = None
        if self.tracked is not None:
            held = feedback.judged(self.tracked, instance("spread", self.spread, Spread), self.runs)
        return SlewEvaluation(self, comparison, payloads, pair, feedback=held)


@dataclass(frozen=True, eq=False)
class SlewEvaluation:
    """What a slew is worth.

    Attributes
    ----------
    design : SlewDesign
        The design that was judged.
    comparison : SlewComparison
        The slew beside the other planned ones and classical ones.
    payloads : PayloadComparison or None
        The planned slews with several payloads; None where the design names none.
    spin_ups : tuple of SpinUpMotion
        The spin-up designed, and the hub's profile; () without a profile.
    meshes : MeshStudy or None
        The error of planning over meshes, to be shown in the report.
    feedback : FeedbackStudy or None
        What feedback along the slew is worth; None where the design has none.
    """

    design: SlewDesign
    comparison: SlewComparison
    payloads: PayloadComparison | None
    spin_ups: tuple[SpinUpMotion, ...]
    meshes: MeshStudy | None = None
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
        if self.payloads is None:
            return said + "."
        masses, left = self.payloads.masses, self.payloads.vibrations
        parts = [f"{_length(float(left[name].max()))} ({name})" for name in self.design.planned]
        return f"{said}; with payloads from {masses[0]:g} to {masses[-1]:g} kg by at most {', '.join(parts)}."

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

    def report(self, tell: Callable[[str], None] = lambda text: None) -> Report:
        """Replay and follow the slew, and return the report.

        Parameters
        ----------
        tell : callable, optional
            Is told in words what comes next.

        Returns
        -------
        Report
            ``.write(folder)`` writes it.
        """
        design, slew, h = self.design, self.design.slew, self.design.beam
        free = slew.plan.problem.angle is None
        tell("other models")
        replays = self.replays
        tell("following with another payload")
        following, held = None, None
        if self.feedback is None or design.tracked is None:
            following = track(slew, max(h.parameters.tip_mass, *design.payloads, 0.0) + _MORE)
            held = sections.tracking_section(h.parameters.tip_mass, following)
        else:
            held = sections.feedback_section(design.tracked, self.feedback)
        tell("pictures")
        switching = switching_curve(slew) if slew.certificate.switches is not None else None
        zv = f"{design.rigid}, ZV"
        shown = tuple(dict.fromkeys((*design.planned, design.rigid, design.rival or zv, zv)))
        film, filmed = self._film()
        parts = [sections.slew_section(h, slew, design.notes), film]
        if switching is not None:
            parts.append(sections.switching_section(switching))
        if self.payloads is not None:
            parts.append(sections.payload_section(h.parameters.tip_mass, self.payloads))
        if self.spin_ups:
            parts.append(sections.spin_up_section(self.spin_ups, slew.plan.problem))
        parts += [
            sections.comparison_section(self.comparison, shown),
            sections.replay_section(replays, free),
        ]
        parts.insert(2 if self.feedback is not None else len(parts), held)
        if self.meshes is not None:
            parts.append(sections.mesh_section(self.meshes))
        tell("report")
        lead = f"{slew.title.capitalize()}: planned, replayed by another integrator, and set beside classical commands."
        if design.name != "slew":
            lead += f" {self.verdict[:1].upper()}{self.verdict[1:]}"
        results = self._results(replays, following, switching) | {"film_tip_mass": filmed}
        return Report(design.title, (lead,), tuple(parts), results)

    def _film(self) -> tuple[Section, float]:
        """The slew and its rival on the same beam, with the payload that the rival suits least; that payload, kg."""
        design, mass = self.design, self.design.beam.parameters.tip_mass
        if self.payloads is not None and design.rival in design.planned:
            mass = self.payloads.worst(design.rival).tip_mass
        beam, curves = design.beam.with_tip_mass(mass), {}
        for name in (design.label, design.rival or design.rigid):
            history = self.comparison.line(name).history
            t = np.linspace(0.0, design.slew.duration + _AFTER, 601)
            label = "rigid body's bang-bang" if name == "bang-bang" else name
            curves[label] = (t, beam.shape(beam.simulate_torque(history, t, history.breakpoints).states))
        return sections.film_section(design.slew, curves, mass if design.payloads else None), mass

    def _results(
        self, replays: tuple[Replay, ...], following: TrackingResult | None, switching: SwitchingCurve | None
    ) -> dict[str, Any]:
        """What results.json holds."""
        design, slew = self.design, self.design.slew
        return {
            "name": design.name,
            "title": design.title,
            "model": design.beam.model,
            "modes": design.beam.modes,
            "parameters": asdict(design.beam.parameters),
            "objective": slew.objective,
            "duration": slew.duration,
            "cost": slew.cost,
            "end_error": slew.end_error,
            "residual_energy": slew.residual_energy,
            "switches": slew.history.switches if slew.certificate.switches is not None else None,
            "switching_agreement": None if switching is None else switching.agreement,
            "certificate": asdict(slew.certificate),
            "verdict": slew.certificate.verdict,
            "worth": self.verdict,
            "replays": [asdict(each) for each in replays],
            "mesh_study": None if self.meshes is None else _mesh_results(self.meshes),
            "comparison": [_attributes(line, _COMPARED) for line in self.comparison.lines],
            "payloads": None if self.payloads is None else _payload_results(self.payloads),
            "spin_ups": [_attributes(each, _SPUN) for each in self.spin_ups],
            "tracking": None if following is None else _attributes(following, _TRACKED),
            "feedback": None if self.feedback is None else _feedback_results(self.feedback),
            "time": slew.time,
            "torque": slew.torque,
            "hub_angle": slew.hub_angle,
            "hub_speed": slew.hub_speed,
            "tip_displacement": slew.tip_displacement,
        }


def _length(value: float) -> str:
    """A length [m] in words, with two digits."""
    if value < 1e-6:
        return "less than 1 µm"
    if value < 1e-3:
        return f"{1e6 * value:.2g} µm"
    return f"{1e3 * value:.2g} mm" if value < 0.1 else f"{value:.2g} m"


def _feedback_results(study: FeedbackStudy) -> dict[str, Any]:
    return {
        "machines": [_attributes(line, _HELD) for line in study.lines],
        "stiffness_ratio": study.stiffness_ratio,
        "runs": [
            {
                "feedback": each.feedback,
                "seed": each.seed,
                "drawn": each.drawn,
                "vibration": each.vibration,
                "angle_error": each.angle_error,
                "error_estimate": each.error_estimate,
            }
            for each in (study.open, study.closed)
        ],
    }


def _attributes(value: object, keys: tuple[str, ...]) -> dict[str, Any]:
    return {key: getattr(value, key) for key in keys}


def _payload_results(payloads: PayloadComparison) -> dict[str, Any]:
    return {
        "lines": [_attributes(line, _CARRIED) for line in payloads.lines],
        "tip_masses": payloads.masses,
        "vibrations": payloads.vibrations,
    }


def _mesh_results(study: MeshStudy) -> dict[str, Any]:
    lines = [
        {
            "name": line.name,
            "errors": [value if np.isfinite(value) else None for value in line.errors],
            "order": line.order if np.isfinite(line.order) else None,
            "theory": line.theory,
        }
        for line in study.lines
    ]
    return {"duration": study.duration, "intervals": study.intervals, "lines": lines}
