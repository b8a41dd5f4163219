"""Evaluation of a slew of the hub-beam: other slews, payloads, other models, feedback."""

from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, fields
from functools import cached_property
from math import inf
from typing import Any

import numpy as np

from boomctl.plotting.canvas import figure_of, film, picture
from boomctl.plotting.slew import animate_slew
from boomctl.printing import compact, count
from boomctl.report import Picture, Section, Table, number
from boomctl.rotating_beam.assumed_modes import AssumedModesBeam
from boomctl.slew.comparison import SlewComparison, compare_slews
from boomctl.slew.result import Replay, SlewResult, SwitchingFunction, switching_function
from boomctl.studies.evaluation import Design, Evaluation, Finding, finding_table, table_of
from boomctl.threads import one_blas_thread

_MORE = 0.1  # excess of the simulated tip mass over the largest planned one, in the tracking test [kg]
_FILMED = 2.0  # duration of the animation after the end of the slew [s]
_REPLAY = "replay by another integrator"
_OPTIMAL = {
    "proved": "duality or Pontryagin's principle",
    "extremal": "Pontryagin's conditions",
    "stationary": "cost on another mesh",
}
_RTOL, _ATOL = 1e-7, 1e-9  # solver tolerances of motions, for errors far below 1 mm
_OF_SLEW = (
    "objective", "duration", "cost", "terminal_error", "residual_energy", "time", "torque", "hub_angle", "hub_speed",
    "tip_displacement",
)  # fmt: skip
_COMPARED = (
    "name", "duration", "residual_vibration", "residual_vibration_low", "residual_vibration_high", "angle_error",
    "speed_error", "max_root_moment", "effort",
)  # fmt: skip
_REPLAYED = ("model", "tip_mass", "angle_error", "speed_error", "residual_vibration", "residual_energy")


@dataclass(frozen=True, eq=False)
class SlewDesign(Design):
    """Planned slew, and slews for comparison.

    Attributes
    ----------
    name, title, synthesis_info, notes, results, sections
        See `Design`.
    beam : AssumedModesBeam
        Beam of the planned slew.
    slews : mapping of str to SlewResult
        Slews of the beam by name: first the one designed, then others to be compared with it. All have the same angle, or
        spin up to the same speed, under the same torque limit. The evaluation adds classical ones.
    reference_slew : str
        The slew that the animation compares with the designed one: planned or classical. "": the slew of a rigid body.
    tip_masses : tuple of float
        Tip masses for additional simulations of the planned slews [kg].
    followed : bool
        If True, the slew is tracked, with all states measured, by a beam with 0.1 kg more at the tip.

    Examples
    --------
    >>> import boomctl as bc
    >>> beam = bc.hub_beam(modes=1)
    >>> fastest = bc.optimal_slew(beam, angle=1.0, torque_limit=200.0)
    >>> bc.studies.SlewDesign("quick", "one radian in least time", beam, {"least time": fastest}).reference_slew
    ''
    """

    beam: AssumedModesBeam
    slews: Mapping[str, SlewResult]
    reference_slew: str = ""
    tip_masses: tuple[float, ...] = ()
    followed: bool = True

    __repr__ = compact

    @property
    def slew(self) -> SlewResult:
        """The slew designed."""
        return next(iter(self.slews.values()))

    @property
    def _label(self) -> str:
        """Its name."""
        return next(iter(self.slews))

    @property
    def _rigid(self) -> str:
        """Name of the fastest torque of a rigid body with the same inertia."""
        return "constant torque" if self.slew.plan.problem.angle is None else "bang-bang"

    @one_blas_thread
    def evaluate(self) -> "SlewEvaluation":
        """Compare the slew with the others, with all payloads, by an integrator that planning does not use.

        Returns
        -------
        SlewEvaluation
            Results, as text and as a report.
        """
        problem, masses = self.slew.plan.problem, self.tip_masses
        arguments = self.beam, problem.angle, problem.limits.torque, self.slews, problem.final_speed
        return SlewEvaluation(self, compare_slews(*arguments, tip_masses=masses))


@dataclass(frozen=True, eq=False)
class SlewEvaluation(Evaluation):
    """The evaluation of a slew.

    Attributes
    ----------
    design : SlewDesign
        The design that was evaluated.
    comparison : SlewComparison
        Comparison with other planned and classical slews, also with the payloads of the design.
    """

    design: SlewDesign
    comparison: SlewComparison

    __repr__ = compact

    @property
    def verdict(self) -> str:
        """The result in a sentence."""
        own, rigid = (self.comparison[name] for name in (self.design._label, self.design._rigid))
        said = (
            f"{own.duration:.5g} s, {own.duration / rigid.duration:.3f} times a rigid body's least time; the tip vibrates by "
            f"{_length(own.residual_vibration)} afterwards, {_length(rigid.residual_vibration)} after a rigid body's "
            "fastest torque"
        )
        masses = self.comparison.tip_masses
        if not masses.size:
            return f"{said}."
        left = {name: float(self.comparison[name].vibrations.max()) for name in self.design.slews}
        parts = ", ".join(f"{_length(most)} ({name})" for name, most in left.items())
        return f"{said}; with payloads from {masses.min():g} to {masses.max():g} kg by at most {parts}."

    @property
    def words(self) -> dict[str, str]:
        """The findings by name."""
        return {**self.design.synthesis_info, "certificate": self.design.slew.certificate.summary}

    @property
    def replays(self) -> tuple[Replay, ...]:
        """The slew on the planning model, with the other payloads, and on other models."""
        design, slew = self.design, self.design.slew
        problem, vibration = slew.plan.problem, self.comparison[design._label].residual_vibration
        angle_error = 0.0 if problem.angle is None else float(slew.hub_angle[-1]) - problem.angle
        speed_error = float(slew.hub_speed[-1]) - problem.final_speed
        return (
            Replay(design.beam.model, None, angle_error, speed_error, vibration, slew.residual_energy),
            *slew.replay(),
        )

    @cached_property
    def following(self) -> dict[str, float] | None:
        """Errors of the slew followed with more at the tip than was planned for, without feedback (open) and with it.

        Angle errors are those at the end [rad], vibrations the largest tip displacements in the last slowest
        period [m].
        """
        if not self.design.followed:
            return None
        tracked = self.design.slew.track(integral_time=None)
        mass = max(self.design.beam.parameters.tip_mass, *self.design.tip_masses, 0.0) + _MORE
        late, result = tracked.time >= tracked.time[-1] - tracked.slowest_period, {"tip_mass": mass}
        for opening in ("", "open_"):
            run = tracked.simulate(tracked.plant.with_tip_mass(mass), feedback=not opening, rtol=_RTOL, atol=_ATOL)
            error = abs(run["hub_angle"][-1] - tracked.reference["hub_angle"][-1])
            result[f"{opening}final_angle_error"] = float(error)
            result[f"{opening}residual_vibration"] = float(np.abs(run["tip_displacement"][late]).max())
        return result

    @cached_property
    def switching(self) -> SwitchingFunction | None:
        """The switching function; None of a torque without switching times."""
        slew = self.design.slew
        return None if slew.certificate.n_switches is None else switching_function(slew)

    @property
    def film_tip_mass(self) -> float:
        """Payload that the film shows: the one that the rival suits least [kg]."""
        masses = self.comparison.tip_masses
        if masses.size and self.design.reference_slew in self.design.slews:
            return float(masses[self.comparison[self.design.reference_slew].vibrations.argmax()])
        return self.design.beam.parameters.tip_mass

    def _results(self) -> dict[str, Any]:
        design, slew, switching = self.design, self.design.slew, self.switching
        return {
            "name": design.name,
            "title": design.title,
            "model": design.beam.model,
            "modes": design.beam.modes,
            "parameters": asdict(design.beam.parameters),
            "certificate": asdict(slew.certificate),
            "verdict": slew.certificate.summary,
            "worth": self.verdict,
            "switching_times": None if switching is None else slew.torque_profile.switching_times,
            "switching_agreement": None if switching is None else switching.sign_agreement,
            "replays": [_scalars(item) for item in self.replays],
            "comparison": [_scalars(item) | {"vibrations": item.vibrations} for item in self.comparison.rows],
            "tip_masses": self.comparison.tip_masses,
            "film_tip_mass": self.film_tip_mass,
            "tracking": self.following,
            **{name: getattr(slew, name) for name in _OF_SLEW},
        }

    def _sections(self) -> Iterator[Section]:
        design, slew, comparison, free = self.design, self.design.slew, self.comparison, self.comparison.angle is None
        caption = "Torque, hub angle and speed, tip displacement and moment at the clamp; broken lines: limits nearby."
        beam, result = design.beam, slew.certificate
        words = [
            f"{beam.model.upper()} with {count(beam.modes, 'mode')} and a tip mass of {beam.parameters.tip_mass:g} kg.",
            *str(slew).removeprefix("SlewResult: ").splitlines(),
            f"Method: {result.method}; {', '.join(line.strip() for line in str(result).splitlines()[2:])}.",
        ]
        if result.n_switches is not None:
            words.append(f"Switching times: {', '.join(f'{t:.5f}' for t in slew.torque_profile.switching_times)} s.")
        certain = {
            "terminal error": (result.terminal_error, _REPLAY),
            "limit violation": (result.constraint_violation, _REPLAY),
            "optimality gap": (result.optimality_gap, _OPTIMAL[result.optimality_status]),
        }
        checked = [
            Finding(f"{name}, relative", number(x, 2), method=how) for name, (x, how) in certain.items() if x < inf
        ]
        drawn = _drawn("slew", slew.plot, caption)
        yield Section("The slew", (*words, *design.notes), (finding_table(checked),), (drawn,))
        beam, motions = design.beam.with_tip_mass(self.film_tip_mass), {}
        time = np.linspace(0.0, slew.duration + _FILMED, 601)
        for name in (design._label, design.reference_slew or design._rigid):
            motions[name] = beam.simulate(comparison[name].torque_profile, time)
        shown = animate_slew(beam, motions, title=slew.title.capitalize())
        caption = f"Top view, drawn to scale, in real time, with {self.film_tip_mass:g} kg at the tip."
        yield Section("In motion", pictures=(film("slew", shown, caption),))
        if self.switching is not None:
            text = (
                "The switching function is the time that additional torque would save at each time. For a minimum-time slew"
                " the torque has its sign everywhere (Pontryagin's principle), which is necessary, and not sufficient where"
                " the problem is not convex. It is computed backwards along the nonlinear motion from the multipliers of the"
                f" end conditions, and has the torque's sign on {100.0 * self.switching.sign_agreement:.4g} % of the "
                "duration."
            )
            caption = "Switching function over its largest size, on a scale of cube roots, and torque."
            yield Section("The switching function", (text,), (), (_drawn("switching", self.switching.plot, caption),))
        text = (
            "SI units. Vibration is the largest tip displacement in one and a half periods after the end, also with the"
            " beam's frequencies 10 % lower and higher. ZV, ZVD and EI: input shapers for the first frequency, hub free."
        )
        loads = [f"{mass:g}\u00a0kg" for mass in comparison.tip_masses]
        rows = [{**vars(line), **dict(zip(loads, line.vibrations, strict=True))} for line in comparison.rows]
        tables = [table_of(rows, _COMPARED)]
        if loads:
            tables.append(table_of(rows, ("name", *loads), "Vibration with each payload."))
        zv = f"{design._rigid}, ZV"
        names = tuple(dict.fromkeys((*design.slews, design._rigid, design.reference_slew or zv, zv)))
        caption = (
            "Torques and tip displacements over time; vibration over duration, small marks with other frequencies."
        )
        drawn = _drawn("comparison", comparison.plot, caption, names=names)
        yield Section(f"Comparison with other {'spin-ups' if free else 'slews'}", (text,), tuple(tables), (drawn,))
        text = "The models differ in what they neglect. The torque is open loop; errors are those at its end."
        rows = [vars(x) | {"tip_mass": "\u2013" if x.tip_mass is None else f"{x.tip_mass:g}"} for x in self.replays]
        table = table_of(rows, _REPLAYED, "SI units; tip mass: of another payload.")
        yield Section("The same torque on other models", (text,), (table,))
        if (t := self.following) is not None:
            text = (
                f"The tip mass is {t['tip_mass']:g} kg, planned was {design.beam.parameters.tip_mass:g} kg. The planned"
                " torque is the feedforward; a time-varying LQR about the trajectory knows all states, and may use half as"
                " much torque again as the plan."
            )
            lines = {
                "angle error at the end [rad]": "final_angle_error",
                "tip vibration at the end [m]": "residual_vibration",
            }
            rows = tuple((name, number(t[f"open_{key}"]), number(t[key])) for name, key in lines.items())
            table = Table(("", "feedforward alone", "with feedback"), rows)
            yield Section("Followed with another payload", (text,), (table,))


def _drawn(name: str, plot: Any, caption: str, **options: Any) -> Picture:
    """Return a figure of curves with many points, which is shown as PNG."""
    return picture(name, figure_of(plot, **options), caption, "png")


def _scalars(record: Any) -> dict[str, Any]:
    """Return the fields of a record that are numbers, words or not there: without curves and other records."""
    values = {item.name: getattr(record, item.name) for item in fields(record)}
    return {name: value for name, value in values.items() if value is None or isinstance(value, (str, int, float))}


def _length(value: float) -> str:
    """Return a length [m] as text, with two digits."""
    if value < 1e-6:
        return "less than 1 µm"
    if value < 1e-3:
        return f"{1e6 * value:.2g} µm"
    return f"{1e3 * value:.2g} mm" if value < 0.1 else f"{value:.2g} m"
