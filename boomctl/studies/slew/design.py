"""A slew of the hub-beam that is to be judged, and the judging: other slews, payloads, profiles of the hub."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from boomctl.rotating_beam import HubBeam
from boomctl.rotating_beam.manoeuvres import SpinUp
from boomctl.rotating_beam.result import SimulationResult
from boomctl.slew import PayloadComparison, SlewComparison, SlewResult, compare_payloads, compare_slews
from boomctl.studies import catalogue


@dataclass(frozen=True, eq=False)
class SlewDesign:
    """A planned slew, and what it is to be compared with.

    Attributes
    ----------
    name, title : str
        In one word, and in a line.
    beam : HubBeam
        What the slew was planned for.
    planned : mapping of str to SlewResult
        Slews of the beam by name: first the one designed, then others to be set beside it. All have the same angle, or
        spin up to the same speed, under the same torque limit. Classical ones are added by `evaluate`.
    rival : str
        The slew that the film shows beside the designed one: planned or classical. "": a rigid body's.
    payloads : tuple of float
        Tip masses with which the planned slews are played, kg.
    profile : SpinUp or None
        Of a spin-up, a course of the hub to be set beside it, prescribed exactly.
    notes : tuple of str
        What a reader should know.
    """

    name: str
    title: str
    beam: HubBeam
    planned: Mapping[str, SlewResult]
    rival: str = ""
    payloads: tuple[float, ...] = ()
    profile: SpinUp | None = None
    notes: tuple[str, ...] = ()

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


@dataclass(frozen=True, eq=False)
class SpinUpMotion:
    """A spin-up, as torque or as prescribed course of the hub.

    Attributes
    ----------
    name : str
    duration : float
        s.
    peak_torque : float
        Largest torque that it takes, N m.
    vibration : float
        Largest tip displacement after the end, m.
    speed_error : float
        Largest deviation of the hub's speed after the end, rad/s.
    motion : SimulationResult
        On the way and afterwards.
    """

    name: str
    duration: float
    peak_torque: float
    vibration: float
    speed_error: float
    motion: SimulationResult


@dataclass(frozen=True, eq=False)
class SlewEvaluation:
    """What a slew is worth.

    Attributes
    ----------
    design : SlewDesign
    comparison : SlewComparison
        Beside the other planned ones and classical ones.
    payloads : PayloadComparison or None
        Where the design names payloads.
    spin_ups : tuple of SpinUpMotion
        The spin-up designed, and the hub's profile; () without a profile.
    """

    design: SlewDesign
    comparison: SlewComparison
    payloads: PayloadComparison | None
    spin_ups: tuple[SpinUpMotion, ...]

    @property
    def verdict(self) -> str:
        """What it is worth, in words."""
        own, rigid = (self.comparison.line(name) for name in (self.design.label, self.design.rigid))
        said = (
            f"{own.duration:.5g} s, {own.duration / rigid.duration:.3f} times a rigid body's least time; the tip vibrates by "
            f"{_length(own.vibration)} afterwards, {_length(rigid.vibration)} after a rigid body's fastest torque"
        )
        if self.payloads is None:
            return said + "."
        masses, left = self.payloads.masses, self.payloads.vibrations
        parts = [f"{_length(float(left[name].max()))} ({name})" for name in self.design.planned]
        return f"{said}; with payloads from {masses[0]:g} to {masses[-1]:g} kg by at most {', '.join(parts)}."

    def __str__(self) -> str:
        return f"{self.design.title}: {self.verdict}\n{self.design.slew.certificate.verdict}"


def _length(value: float) -> str:
    """A length [m] in words, with two digits."""
    if value < 1e-6:
        return "less than 1 µm"
    if value < 1e-3:
        return f"{1e6 * value:.2g} µm"
    return f"{1e3 * value:.2g} mm" if value < 0.1 else f"{value:.2g} m"


def evaluate(design: SlewDesign) -> SlewEvaluation:
    """Set a slew beside the others, with all payloads, by an integrator that planning does not use."""
    problem = design.slew.plan.problem
    comparison = compare_slews(design.beam, problem.angle, problem.limits.torque, design.planned, problem.final_speed)
    payloads = None
    if design.payloads:
        payloads = compare_payloads(design.planned, design.payloads, design.beam.parameters.tip_mass)
    return SlewEvaluation(design, comparison, payloads, _spin_ups(design))


def _spin_ups(design: SlewDesign) -> tuple[SpinUpMotion, ...]:
    if design.profile is None:
        return ()
    h, profile, history = design.beam, design.profile, design.slew.history
    rest = 1.5 / float(h.frequencies_hz().min())
    t = np.linspace(0.0, max(profile.duration, history.duration) + rest, 1201)
    t = np.unique(np.concatenate([t, [profile.duration, history.duration]]))
    speed = profile.final_speed
    return (
        _motion(design.label, history.duration, speed, h.simulate_torque(history, t, history.breakpoints)),
        _motion("profile, Eq. (43)", profile.duration, speed, h.simulate(profile, t)),
    )


def _motion(name: str, duration: float, speed: float, motion: SimulationResult) -> SpinUpMotion:
    late = motion.time >= duration
    return SpinUpMotion(
        name,
        duration,
        float(np.abs(motion.torque).max()),
        float(np.abs(motion.tip_displacement[late]).max()),
        float(np.abs(motion.hub_speed[late] - speed).max()),
        motion,
    )


def load_slew(name: str) -> SlewDesign:
    """Return the slew of a name, or of a Python file whose ``slew()`` returns a :class:`SlewDesign`.

    Raises
    ------
    ValueError
        No such slew; the file has no ``slew()``.
    TypeError
        ``slew()`` returns something else.
    SlewError
        It cannot be planned.
    """
    return catalogue.design_file(name, "slew").made(SlewDesign)
