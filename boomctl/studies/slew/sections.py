"""The report of a slew: words, tables and pictures."""

import re
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from boomctl.plotting.canvas import figure_of, film, picture
from boomctl.plotting.slew import plot_spin_ups
from boomctl.printing import count
from boomctl.report import Picture, Section, Table, number, power
from boomctl.rotating_beam.assumed_modes import AssumedModesBeam
from boomctl.slew.classical.comparison import SlewComparison
from boomctl.slew.least_time.switching_curve import SwitchingCurve
from boomctl.slew.problem import SlewProblem
from boomctl.slew.result import Replay, SlewResult
from boomctl.slew.tracking.tracked import TrackedSlew
from boomctl.studies.findings import tabled
from boomctl.studies.slew.feedback import FeedbackStudy, Followed
from boomctl.studies.slew.spin_up import SpinUpMotion

_LIMITS = {
    "torque_limit": "torque",
    "torque_rate_limit": "torque rate",
    "speed_limit": "hub speed",
    "tip_limit": "tip displacement",
    "moment_limit": "root moment",
}
SPUN = {
    "name": "",
    "duration": "duration [s]",
    "peak_torque": "peak torque [N\u00a0m]",
    "vibration": "vibration [m]",
    "speed_error": "speed error [rad/s]",
}
HELD = {
    "machine": "machine",
    "open_vibration": "vibration, plan alone [m]",
    "vibration": "with feedback [m]",
    "ratio": "times smaller",
    "open_angle_error": "hub off, plan alone [rad]",
    "angle_error": "with feedback [rad]",
}
_MODELS = {"geometrically-exact": "geometrically exact beam", "sfoam-consistent": "SFOAM, consistent"}


def _drawn(name: str, plot: Callable[..., Any], caption: str, **options: Any) -> Picture:
    """Return a picture of curves of many points, which are shown as PNG."""
    return picture(name, figure_of(plot, **options), caption, "png")


def slew_section(h: AssumedModesBeam, slew: SlewResult, notes: tuple[str, ...]) -> Section:
    """Return the section of the slew itself."""
    c, problem = slew.certificate, slew.plan.problem
    if problem.angle is None:
        asked = f"The spin-up to {problem.final_speed:g} rad/s, at whatever angle ({slew.hub_angle[-1]:.3g} rad here),"
    else:
        turn = f"{problem.angle:.5g} rad ({np.degrees(problem.angle):.4g}°)".replace("-", "−")
        asked = f"The slew through {turn}"
    payload = f"a tip mass of {h.parameters.tip_mass:g} kg" if h.parameters.tip_mass else "no tip mass"
    if problem.tip_masses:
        payload += f", and at once {' and '.join(f'{mass:g}' for mass in problem.tip_masses)} kg"
    binding = ", ".join(f"{_LIMITS[name]} (from {when:.3g} s)" for name, when in c.binding.items()) or "none"
    verdict = re.sub(r"\d+e[-+]\d+", lambda found: power(float(found[0]), 1), c.verdict)
    kept = "no limit is exceeded"
    if c.constraint_violation > 0.0:
        kept += f" by more than {power(c.constraint_violation, 1)} of it"
    free = (
        f"; {number(c.prescribed_error, 2)} without axial motion, which planning leaves free" if c.free_errors else ""
    )
    text = [
        f"{asked} with at most {problem.limits.torque:g} N m takes {slew.duration:.7g} s. Model: "
        f"{_name(h.model)} with {count(h.modes, 'mode')} and {payload}.",
        f"Method: {c.method}. Optimality: {verdict}. In the replay the end state is missed by "
        f"{number(c.end_error, 2)} (each part relative to its largest size on the way{free}), "
        f"{number(slew.residual_energy or 0.0, 2)} J remain, and {kept}. Limits reached: {binding}.",
    ]
    if c.switches is not None:
        switches = ", ".join(f"{t:.5f}" for t in slew.history.switches)
        text.append(f"The torque switches {c.switches} times, at {switches} s.")
    caption = (
        "Torque, hub angle and speed, tip displacement and bending moment at the clamp. Broken lines: limits, where they are "
        "near."
    )
    return Section("The slew", (*text, *notes), pictures=(_drawn("slew", slew.plot, caption),))


def film_section(animation: Any, tip_mass: float | None) -> Section:
    """Return the section of the film, and the tip mass where it is chosen [kg]."""
    caption = "Top view, drawn to scale, in real time."
    if tip_mass is not None:
        caption += f" The tip mass is {tip_mass:g} kg."
    return Section("In motion", pictures=(film("slew", animation, caption),))


def switching_section(curve: SwitchingCurve) -> Section:
    """Return the section of Pontryagin's principle."""
    share = "all" if curve.agreement == 1.0 else f"{100.0 * curve.agreement:.2f} %"
    text = (
        "The switching function says how much time a little more torque would save at each instant. In minimum time the "
        "torque has its sign everywhere (Pontryagin's principle), which is necessary, and not sufficient where the problem "
        "is not convex. It is carried back along the nonlinear motion from the multipliers of the end conditions, and has "
        f"the torque's sign on {share} of the duration."
    )
    caption = "Switching function over its largest size, on a scale of cube roots, and torque."
    return Section("The switching function", (text,), pictures=(_drawn("switching", curve.plot, caption),))


def spin_up_section(pair: Sequence[SpinUpMotion], problem: SlewProblem) -> Section:
    """Return the section of a planned spin-up, the first, and the profile of the hub set beside it."""
    text = (
        f"The beam ends in steady rotation at {problem.final_speed:g} rad/s, its hub free. The classical profile of Bai et "
        "al. (2009), Eq. (43), prescribes the hub's motion exactly, then and afterwards, as an ideal speed loop would, "
        "whatever torque that takes. Vibration and speed error are the largest after the end."
    )
    caption = (
        "Torque, hub speed and tip displacement. Broken lines: torque limit and speed asked for; dotted: the ends."
    )
    drawn = plot_spin_ups(pair, problem.limits.torque, problem.final_speed)
    return Section("Into steady rotation", (text,), (tabled(pair, SPUN),), (picture("spin_up", drawn, caption, "png"),))


def comparison_section(comparison: SlewComparison, shown: tuple[str, ...]) -> Section:
    """Return the section that sets slews side by side; some of them, by name, are drawn over time."""
    free = comparison.angle is None
    caption = (
        "Left: torques on one scale, and the tip on the way and afterwards. Right: large markers as planned, small ones "
        "with the beam's frequencies changed. What is below 0.1 mm stands on the lower edge; markers of nearly equal "
        "duration are set side by side."
    )
    if comparison.tip_masses.size:
        caption += " Below: the same over the payload."
    text = (
        "Vibration is the largest tip displacement in one and a half periods after the end. ZV, ZVD and EI are input "
        "shapers, tuned to the first frequency with the hub free."
    )
    if free:
        text += (
            " The smooth torque is what the profile of Eq. (43) asks of a rigid body; here it acts on the beam, whose hub is "
            "free."
        )
    heads = (
        "slew", "duration [s]", "vibration [m]", "vibration, −10\u00a0% [m]", "vibration, +10\u00a0% [m]",
        "speed error [rad/s]" if free else "angle error [rad]", "peak root moment [N\u00a0m]", "effort [10³\u00a0N²m²s]",
    )  # fmt: skip
    keys = ("vibration", "vibration_low", "vibration_high", "speed_error" if free else "angle_error", "peak_moment")
    body = tuple(
        (
            line.name.replace(" ", "\u00a0").replace("-", "\u2011"),
            f"{line.duration:.3f}",
            *(number(getattr(line, key)) for key in keys),
            f"{line.effort / 1e3:.1f}",
        )
        for line in comparison.lines
    )
    table = Table(heads, body, "−10 % and +10 %: with the beam's frequencies changed through its bending stiffness.")
    tables = (table, _loaded(comparison)) if comparison.tip_masses.size else (table,)
    drawn = _drawn("comparison", comparison.plot, caption, names=shown)
    return Section("Beside other spin-ups" if free else "Beside other slews", (text,), tables, (drawn,))


def _loaded(comparison: SlewComparison) -> Table:
    """Return the table of vibrations with several payloads."""
    heads = ("vibration [m] with a payload of", *(f"{mass:g}\u00a0kg" for mass in comparison.tip_masses))
    body = tuple((line.name, *(number(float(left)) for left in line.vibrations)) for line in comparison.lines)
    return Table(heads, body, "The torque is the same for every payload.")


def replay_section(replays: Sequence[Replay], free: bool) -> Section:
    """Return the section of replays, the planned one first; ``free``: no angle is asked for."""
    columns = {
        "angle_error": "angle error [rad]",
        "speed_error": "speed error [rad/s]",
        "tip_swing": "tip swing [m]",
        "residual_energy": "energy left [J]",
    }
    if free:
        del columns["angle_error"]
    names = [_name(each.model) for each in replays]
    masses = ["" if each.tip_mass is None else f", tip mass {each.tip_mass:g} kg" for each in replays]
    masses[0] = ", as planned"
    numbers = tabled(replays, columns)
    lines = tuple((name + mass, *cells) for name, mass, cells in zip(names, masses, numbers.lines, strict=True))
    text = "The models differ in what they neglect. The torque is open loop; errors are those at its end."
    return Section("The same torque on other models", (text,), (Table(("model", *numbers.heads), lines),))


def _name(model: str) -> str:
    return _MODELS.get(model, model.upper())


def tracking_section(planned: float, t: Followed) -> Section:
    """Return the section of feedback with another tip mass than the planned one [kg]."""
    text = (
        f"The tip mass is {t.tip_mass:g} kg, planned was {planned:g} kg. The planned torque is the "
        "feedforward; a time-varying LQR about the trajectory knows all states, and may use half as much torque again "
        "as the plan."
    )
    table = Table(
        ("", "feedforward alone", "with feedback"),
        (
            ("angle error at the end [rad]", number(t.open_final_angle_error), number(t.final_angle_error)),
            ("tip swing at the end [m]", number(t.open_tip_swing), number(t.tip_swing)),
        ),
    )
    return Section("Followed with another payload", (text,), (table,))


def feedback_section(tracked: TrackedSlew, study: FeedbackStudy) -> Section:
    """Return the section of feedback along the slew, beside the plan alone."""
    read = ", ".join(f"{name.replace('_', ' ')} ({number(level, 1)})" for name, level in tracked.noise.items())
    text = (
        f"The plan's torque, up to {tracked.planned_limit:g} N m, is the feedforward; what is measured is compared with the "
        f"plan every {1e3 * tracked.controller.sample_time:.3g} ms, and a time-varying LQG may add to the torque up to "
        f"{tracked.torque_limit:g} N m in all: {100.0 * (1.0 - tracked.planned_limit / tracked.torque_limit):.0f} % are kept "
        f"for it. It reads, with so much noise (standard deviation, SI units): {read}. It knows the planned machine only, "
        "and balances a constant torque that it makes out.",
        "Vibration is the largest distance of the tip from the plan within one and a half of the slowest periods after the "
        "end of the plan, without any time to settle. Noise is there with feedback.",
    )
    lines = [replace(line, machine=line.machine.replace(" ", "\u00a0")) for line in study.lines]
    many = study.closed
    drawn = "; ".join(
        f"{name.replace('_', ' ')} {row.min():.2g} to {row.max():.2g}"
        for name, row in many.drawn.items()
        if np.ptp(row) > 0.0
    )
    caption = (
        f"{many.vibration.size} machines drawn evenly and independently (seed {many.seed}): {drawn}. Bands: the middle half, "
        "and nine of ten. {}."
    )
    pictures = (
        _drawn("held", many.plot, caption.format("With feedback")),
        _drawn("alone", study.open.plot, caption.format("The plan alone")),
    )
    return Section("With feedback, and without", text, (tabled(lines, HELD),), pictures)
