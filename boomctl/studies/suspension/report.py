"""The report of a suspension: pictures, tables, ``results.json`` and ``report.html``."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from boomctl.files import prepared_folder, write_json, write_whole
from boomctl.report import Picture, Section, Table, html_report
from boomctl.studies.suspension.evaluate import SuspensionResult

_SPAN = 15.0
_FIELD = 60.0


def write_report(
    result: SuspensionResult, out: str | Path, tell: Callable[[str], None] = lambda text: None
) -> dict[str, Any]:
    """Write pictures, ``results.json`` and ``report.html`` of a suspension into ``out``; return the results.

    Raises
    ------
    OSError
        ``out`` cannot be written to.
    """
    folder = prepared_folder(out)
    tell("pictures")
    svg = _pictures(result, folder)
    found = result.as_dict()
    write_json(folder / "results.json", found)
    lead = f"{result.design.title}: what it does to the boom's motion and to the spray, beside the boom as it is."
    write_whole(folder / "report.html", html_report(f"Suspension: {result.design.title}", lead, _sections(result, svg)))
    return found


def _pictures(result: SuspensionResult, folder: Path) -> dict[str, bytes]:
    """Draw all pictures, write each as SVG and PNG, and return the SVGs (PNG of the deposit map, which has many cells)."""
    from boomctl.plotting import figure_bytes
    from boomctl.plotting.spray import draw_deposit
    from boomctl.plotting.suspension import draw_run, draw_suspension_sigma, draw_weights

    before, after, scene = result.passive, result.active, result.scene
    labels = (before.title, after.title)
    start = scene.run_in + 0.25 * scene.duration
    figures = {
        "sigma": draw_suspension_sigma(before.sigma, after.sigma, labels, result.exact_sigma, result.family_sigma),
        "run": draw_run(
            before.run,
            after.run,
            labels,
            (scene.force_limit, scene.stroke_limit),
            (start, start + min(_SPAN, 0.75 * scene.duration)),
        ),
        "deposit": draw_deposit({before.title: before.spray, after.title: after.spray}, length=_FIELD),
    }
    if result.design.weights:
        figures["weights"] = draw_weights(result.design.weights, np.geomspace(0.05, 500.0, 400))
    drawn = {}
    for name, figure in figures.items():
        png, svg = figure_bytes(figure, "png"), figure_bytes(figure, "svg")
        write_whole(folder / f"{name}.png", png)
        write_whole(folder / f"{name}.svg", svg)
        drawn[name] = png if name == "deposit" else svg
    return drawn


def _picture(drawn: Mapping[str, bytes], name: str, caption: str) -> Picture:
    return Picture(drawn[name], "png" if name == "deposit" else "svg", caption)


def _sections(result: SuspensionResult, drawn: Mapping[str, bytes]) -> list[Section]:
    design, scene = result.design, result.scene
    sections = [
        Section("What it is worth", (result.verdict, *design.notes), (_comparison(result),)),
        Section("Plant and synthesis", (_plant_text(result),), (_parameter_table(result), _fact_table(design.facts))),
    ]
    if "weights" in drawn:
        sections.append(
            Section(
                "Weights", pictures=(_picture(drawn, "weights", "Weights over frequency, in the units of the design."),)
            )
        )
    caption = (
        "Singular values from the two platform actuators to the two tips, before and after; circles mark certified peaks:"
        " no singular value exceeds them at any frequency."
    )
    if result.exact_sigma is not None:
        caption += " Dots: the same controller on the exact Euler-Bernoulli boom, without discretisation."
    if result.family_sigma:
        caption += " Faint: springs and boom mass at corners and middles of the edges of their uncertainty."
    sections.append(Section("Singular values", pictures=(_picture(drawn, "sigma", caption),)))
    if result.assurance:
        text = "Stability and margins; each line is computed apart from the synthesis."
        sections.append(Section("Assurance", (text,), (_fact_table(result.assurance, "check", "found"),)))
    sections.append(
        Section(
            "A run over the field",
            (_scene_text(result),),
            (_limit_table(result),),
            (
                _picture(
                    drawn, "run", f"Platform, left tip, left stroke and forces, {_SPAN:g} s of {scene.duration:g} s."
                ),
            ),
        )
    )
    text = (
        "Deposit relative to the nominal dose, in cells of 0.1 m by 0.1 m. The footprint of a nozzle is a triangle of 1 m"
        " along the boom, nozzles 0.5 m apart, and an even 0.1 m along the drive; both are assumptions, and so is the track."
    )
    sections.append(
        Section("Spray on the field", (text,), pictures=(_picture(drawn, "deposit", "Deposit, passive and active."),))
    )
    return sections


def _comparison(result: SuspensionResult) -> Table:
    before, after = result.passive, result.active
    lines = [
        ("certified peak, platform to tips", f"{before.sigma.peak:.4g}", f"{after.sigma.peak:.4g}"),
        ("certified peak of the yaw", f"{before.yaw.lower:.4g}", f"{after.yaw.lower:.4g}"),
        ("certified peak of the jolt", f"{before.jolt.lower:.4g}", f"{after.jolt.lower:.4g}"),
    ]
    for name, pick in (
        ("deposit CV [%]", lambda s: f"{100 * s.cv:.2f}"),
        ("share outside ±10 % [%]", lambda s: f"{100 * s.share_outside_10:.2f}"),
        ("share outside ±20 % [%]", lambda s: f"{100 * s.share_outside_20:.2f}"),
        ("doses", lambda s: f"{s.lowest_dose:.2f} to {s.highest_dose:.2f}"),
        ("RMS tip speed over driving speed [%]", lambda s: f"{100 * s.relative_tip_speed:.2f}"),
    ):
        lines.append((name, pick(before.spray), pick(after.spray)))
    lines += [
        ("deposit CV by jolt alone [%]", f"{100 * before.spray_by_jolt.cv:.2f}", f"{100 * after.spray_by_jolt.cv:.2f}"),
        ("deposit CV by yaw alone [%]", f"{100 * before.spray_by_yaw.cv:.2f}", f"{100 * after.spray_by_yaw.cv:.2f}"),
        ("largest stroke [mm]", f"{1e3 * before.stroke:.1f}", f"{1e3 * after.stroke:.1f}"),
        ("largest force [N]", "-", f"{after.force:.1f}" if after.run.controls else "-"),
    ]
    return Table(("", before.title, after.title), tuple(lines))


def _plant_text(result: SuspensionResult) -> str:
    p = result.design.parameters
    return (
        f"The boom of Anthonis & Ramon (2003), Table 2: {p.length:g} m, hinged on a cradle that slides on a platform driven"
        f" by two actuators; {result.scene.elements} finite elements here. Sensors: strokes of the suspension and tip"
        f" accelerometers of {result.scene.accelerometer_hz:g} Hz. Static gain from yaw of the platform to the tips:"
        f" {p.length / p.actuator_distance:.3f}; a suspension that centres the boom behind the tractor cannot go below that"
        " at zero frequency."
    )


def _parameter_table(result: SuspensionResult) -> Table:
    base, chosen = result.passive_parameters, result.design.parameters
    rows = (
        ("spring stiffness k_s [N/m]", "spring_stiffness"),
        ("cradle damping c_g [N s/m]", "cradle_damping"),
        ("hinge damping c_t [N m s/rad]", "hinge_damping"),
        ("boom mass m_3 [kg]", "boom_mass"),
    )
    lines = tuple((label, f"{getattr(base, key):g}", f"{getattr(chosen, key):g}") for label, key in rows)
    return Table(("passive parts", result.passive.title, result.active.title), lines)


def _fact_table(facts: Mapping[str, str], *heads: str) -> Table:
    return Table(heads or ("synthesis", "says"), tuple(facts.items()), prose=True)


def _scene_text(result: SuspensionResult) -> str:
    s = result.scene
    return (
        f"Track of class {s.road_class} (ISO 8608), seed {s.seed}, driven at {s.speed:g} m/s for {s.duration:g} s after"
        f" {s.run_in:g} s of run-in, through the stated tractor model to jolt and yaw of the platform. Controller sampled"
        f" every {1e3 * s.sample_time:g} ms, its forces {1e3 * s.delay:g} ms late; strokes resolved to"
        f" {1e3 * s.stroke_step:g} mm, accelerations to {s.acceleration_step:g} m/s². Force limit {s.force_limit:g} N, stroke"
        f" ±{1e3 * s.stroke_limit:g} mm (a design assumption)."
    )


def _limit_table(result: SuspensionResult) -> Table:
    lines = []
    for each in (result.passive, result.active):
        saturated = max(each.run.saturation_share.values(), default=0.0)
        force = f"{each.force:.1f} of {result.scene.force_limit:g} N" if each.run.controls else "no actuator"
        lines.append(
            (
                each.title,
                f"{1e3 * each.stroke:.1f} of {1e3 * result.scene.stroke_limit:g} mm",
                str(len(each.run.stops)),
                force,
                f"{100 * saturated:.2f} %",
                f"{each.force_rate:.0f} N/s" if each.run.controls else "-",
            )
        )
    heads = ("", "largest stroke", "end stops hit", "largest force", "time at the force limit", "largest force rate")
    return Table(heads, tuple(lines))
