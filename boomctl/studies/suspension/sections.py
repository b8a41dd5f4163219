"""The report of a suspension: words, tables and pictures."""

from collections.abc import Mapping
from math import inf
from typing import TYPE_CHECKING, Any

import numpy as np

from boomctl.analysis.box.worst_case import WorstCase
from boomctl.boom.parameters import BoomParameters
from boomctl.checks import from_on
from boomctl.plotting.canvas import figure_of, picture
from boomctl.plotting.spray import draw_deposit
from boomctl.plotting.suspension import draw_run, draw_suspension_sigma, draw_weights
from boomctl.report import Section, Table, number
from boomctl.studies.findings import files_section, word_table
from boomctl.studies.suspension.assurance import Assurance
from boomctl.studies.suspension.performance import PEAK_DIGITS, Performance
from boomctl.studies.suspension.scene import FAMILY_ELEMENTS, FieldScene

if TYPE_CHECKING:
    import control

_SPAN = 15.0  # of the run that is drawn [s]: some periods of the slowest motion, each of them still to be seen
_FIELD = 60.0  # length of field that is drawn [m]: its cells of 0.1 m are still to be seen


def weight_section(weights: "Mapping[str, control.StateSpace]") -> Section:
    """Return the section of the weights."""
    drawn = draw_weights(weights, np.geomspace(0.05, 500.0, 400))
    caption = "Weights over frequency, in the units of the design."
    return Section("Weights", pictures=(picture("weights", drawn, caption),))


def sigma_section(before: Performance, after: Performance, assured: Assurance | None) -> Section:
    """Return the section of singular values, with those of the exact boom and of others of the family where there are."""
    exact, family = (None, ()) if assured is None else (assured.exact_sigma, assured.family_sigma)
    caption = (
        "Singular values from the two platform actuators to the two tips, before and after; circles mark certified peaks:"
        " no singular value exceeds them at any frequency."
    )
    if exact is not None:
        same = "the same controller" if after.run.controls else "the same springs and dampers"
        caption += f" Dots: {same} on the exact Euler-Bernoulli boom, without discretisation."
    if family:
        caption += " Faint: springs and boom mass at corners and middles of the edges of their uncertainty."
    if after.sampled:
        caption += (
            f" After: at the samples, every {1e3 * after.run.sample_time:g} ms, for a platform held from one to the next; the"
            " curve ends at half the sampling rate."
        )
    drawn = draw_suspension_sigma(before.sigma, after.sigma, (before.title, after.title), exact, family)
    return Section("Singular values", pictures=(picture("sigma", drawn, caption),))


def assurance_section(found: Mapping[str, str], scene: FieldScene, own: bool) -> Section:
    """Return the section of what was checked; ``own``: whether on a plant of its own."""
    mesh = (
        "the boom is the design's own plant"
        if own
        else f"the boom has {FAMILY_ELEMENTS} elements, so that peaks of the middle are not quite those of"
        f" {scene.elements} elements"
    )
    text = (
        "Each line is computed apart from the synthesis. Springs and boom mass are relative to those of the middle; there"
        f" {mesh}."
    )
    return Section("Assurance", (text,), (word_table(found, ("check", "found")),))


def run_section(before: Performance, after: Performance, scene: FieldScene) -> Section:
    """Return the section of the run over the field."""
    s, active = scene, bool(after.run.controls)
    sampled = (
        f" Controller sampled every {1e3 * after.run.sample_time:g} ms, its forces {1e3 * after.run.delay:g} ms late; strokes"
        f" resolved to {1e3 * s.stroke_step:g} mm, accelerations to {s.acceleration_step:g} m/s². Force limit"
        f" {s.force_limit:g} N."
    )
    text = (
        f"Track of class {s.road_class} (ISO 8608), seed {s.seed}, driven at {s.speed:g} m/s for {s.duration:g} s after"
        f" {s.run_in:g} s of run-in, through the model of a tractor ({s.tractor.mass:g} kg, wheelbase"
        f" {s.tractor.wheelbase:g} m, track {s.tractor.track_width:g} m; all of it in boomctl.boom.TractorParameters) to jolt"
        " and yaw of the platform."
        f"{sampled if active else ''} End stops at ±{1e3 * s.stroke_limit:g} mm (a design assumption)."
    )
    heads = (
        "",
        "largest stroke",
        "end stops hit",
        "largest force",
        "time at the force limit",
        "largest force rate after the run-in",
    )
    lines = []
    for each in (before, after):
        forces = ("no actuator", "-", "-")
        if each.run.controls:
            saturated = max(each.run.saturation_share.values(), default=0.0)
            force = f"{each.force:.1f} of {s.force_limit:g} N"
            forces = (force, f"{100 * saturated:.2f} %", f"{each.force_rate:.0f} N/s")
        stroke = f"{1e3 * each.stroke:.1f} of {1e3 * s.stroke_limit:g} mm"
        lines.append((each.title, stroke, str(len(each.run.stops)), *forces))
    start, length = s.run_in + 0.25 * s.duration, min(_SPAN, 0.75 * s.duration)
    drawn = draw_run(
        before.run,
        after.run,
        labels=(before.title, after.title),
        limits=(s.force_limit, s.stroke_limit),
        span=(start, start + length),
    )
    shown = "Platform, left tip, left stroke and forces" if active else "Platform, left tip and left stroke"
    pictures = (picture("run", drawn, f"{shown}, {length:g} s of {s.duration:g} s."),)
    return Section("A run over the field", (text,), (Table(heads, tuple(lines)),), pictures)


def spray_section(before: Performance, after: Performance) -> Section:
    """Return the section of the deposit, whose map has so many cells that it is shown as PNG."""
    text = (
        "Deposit relative to the nominal dose, in cells of 0.1 m by 0.1 m. The footprint of a nozzle is a triangle of 1 m"
        " along the boom, nozzles 0.5 m apart, and an even 0.1 m along the drive; both are assumptions, and so is the track."
    )
    drawn = figure_of(draw_deposit, {before.title: before.spray, after.title: after.spray}, length=_FIELD)
    pictures = (picture("deposit", drawn, "Deposit before and after.", "png", "svg"),)
    return Section("Spray on the field", (text,), pictures=pictures)


def comparison_table(before: Performance, after: Performance, worst: Mapping[str, WorstCase]) -> Table:
    """Return what a suspension does beside what the boom does as it is, and at worst over the box where that is bounded."""
    lines = []
    for one, other in zip(before.findings, after.findings, strict=True):
        if one.text:
            lines.append((f"{one.name} [{one.unit}]" if one.unit else one.name, one.text, other.text))
    bounds = []
    for name, found in worst.items():
        if found.upper_bound < inf:
            bound = number(float(from_on(found.upper_bound, PEAK_DIGITS)), PEAK_DIGITS)  # not rounded downwards
            said = f"{bound} at most (gap {100 * found.gap:.2g} %)"
            bounds.append((f"worst peak of the {name}, springs ±30 %, boom mass ±20 %: proved", "-", said))
    peaks = sum(one.proved is True for one in before.findings)
    return Table(("", before.title, after.title), (*lines[:peaks], *bounds, *lines[peaks:]))


def plant_section(titles: tuple[str, str], base: BoomParameters, design: Any, scene: FieldScene) -> Section:
    """Return the section of the machine, its passive parts beside those of the boom as it is, and the synthesis."""
    p, own = design.parameters, design.own_plant
    mesh = f"{scene.elements} finite elements here. "
    if own is not None:
        mesh = f"{scene.elements} finite elements here as it is. The design has a plant of its own, of {own.nstates} states. "
    elif design.controller is not None:
        mesh += f"Sensors: strokes of the suspension and tip accelerometers of {scene.accelerometer_hz:g} Hz. "
    text = (
        f"The boom of Anthonis & Ramon (2003), Table 2: {p.length:g} m, hinged on a cradle that slides on a platform driven"
        f" by two actuators; {mesh}Static gain from yaw of the platform to the"
        f" tips: {p.length / p.actuator_distance:.3f}; a suspension that centres the boom behind the tractor cannot go below"
        " that at zero frequency."
    )
    rows = (
        ("spring stiffness k_s [N/m]", "spring_stiffness"),
        ("cradle damping c_g [N s/m]", "cradle_damping"),
        ("hinge damping c_t [N m s/rad]", "hinge_damping"),
        ("boom mass m_3 [kg]", "boom_mass"),
    )
    lines = tuple((label, f"{getattr(base, key):g}", f"{getattr(p, key):g}") for label, key in rows)
    synthesis = (word_table(design.facts),) if design.facts else ()
    return Section("Plant and synthesis", (text,), (Table(("passive parts", *titles), lines), *synthesis))


def controller_section(names: tuple[str, ...], scene: FieldScene, sample_time: float) -> Section:
    """Return what lies beside the report for other programs."""
    c = (
        f"boomctl.read_controller reads the JSON file. The C code runs every {sample_time:g} s, holds forces within "
        f"{scene.force_limit:g} N and corrects its states where it meets that limit, as the run on the field above."
        if "controller.c" in names
        else "There is no C code: the controller is too fast for the sampling of the field run."
    )
    return files_section(names, c)
