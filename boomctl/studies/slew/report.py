"""The slew report as one HTML document: words, tables and pictures."""

import re
from collections.abc import Sequence
from typing import Any

import numpy as np

from boomctl.report import Picture, Section, Table, html_report, number, power
from boomctl.rotating_beam import HubBeam
from boomctl.slew import SlewResult
from boomctl.studies.slew.design import SlewDesign
from boomctl.studies.slew.sections import payload_section, spin_up_section, switching_section

_LIMITS = {
    "torque_limit": "torque",
    "torque_rate_limit": "torque rate",
    "speed_limit": "hub speed",
    "tip_limit": "tip displacement",
    "moment_limit": "root moment",
}
_MODELS = {"geometrically-exact": "geometrically exact beam", "sfoam-consistent": "SFOAM, consistent"}


def slew_report(design: SlewDesign, results: dict[str, Any], pictures: dict[str, bytes], film: bytes) -> str:
    """Return the report of a slew.

    Parameters
    ----------
    design : SlewDesign
    results : dict
        What results.json holds.
    pictures : dict of str to bytes
        PNG files: "slew", "comparison", "tracking", and where there is such a section "switching", "payloads", "spin_up",
        "mesh".
    film : bytes
        GIF.
    """
    h, slew = design.beam, design.slew
    sections = [
        Section(
            "The slew",
            (*_slew_text(h, slew), *design.notes),
            (),
            (Picture(pictures["slew"], "png", _slew_caption(slew)),),
        ),
        Section("In motion", (), (), (Picture(film, "gif", _film_caption(results.get("film_tip_mass", 0.0), design)),)),
    ]
    if "switching" in pictures:
        sections.append(switching_section(results, pictures["switching"]))
    if results["payloads"] is not None:
        sections.append(payload_section(h.parameters.tip_mass, results["payloads"]["lines"], pictures["payloads"]))
    if results["spin_ups"]:
        sections.append(spin_up_section(results["spin_ups"], slew, pictures["spin_up"]))
    free = slew.plan.problem.angle is None
    sections += [
        _comparison(results["comparison"], pictures["comparison"], free),
        Section(
            "The same torque on other models",
            ("The models differ in what they neglect. The torque is open loop; errors are those at its end.",),
            (_replay_table(results["replays"], free),),
        ),
        _tracking(h, results["tracking"], pictures["tracking"]),
    ]
    if results["mesh_study"] is not None:
        sections.append(_mesh(results["mesh_study"], pictures["mesh"]))
    lead = f"{slew.title.capitalize()}: planned, replayed by another integrator, and set beside classical commands."
    if results.get("worth") and design.name != "slew":
        lead += f" {results['worth'][:1].upper()}{results['worth'][1:]}"
    return html_report(design.title, lead, sections)


def _film_caption(tip_mass: float, design: SlewDesign) -> str:
    caption = "Top view, drawn to scale, in real time."
    return f"{caption} The tip mass is {tip_mass:g} kg." if design.payloads else caption


def _slew_text(h: HubBeam, slew: SlewResult) -> tuple[str, ...]:
    c, problem = slew.certificate, slew.plan.problem
    payload = f"a tip mass of {h.parameters.tip_mass:g} kg" if h.parameters.tip_mass else "no tip mass"
    if problem.tip_masses:
        payload += f", and at once {' and '.join(f'{mass:g}' for mass in problem.tip_masses)} kg"
    modes = "1 mode" if h.modes == 1 else f"{h.modes} modes"
    binding = ", ".join(f"{_LIMITS[name]} (from {when:.3g} s)" for name, when in c.binding.items()) or "none"
    verdict = re.sub(r"\d+e[-+]\d+", lambda found: power(float(found[0]), 1), c.verdict)
    kept = "no limit is exceeded"
    if c.constraint_violation > 0.0:
        kept = f"no limit is exceeded by more than {power(c.constraint_violation, 1)} of it"
    text = (
        f"{_asked(slew)} with at most {problem.limits.torque:g} N m takes {slew.duration:.7g} s. Model: "
        f"{_name(h.model)} with {modes} and {payload}.",
        f"Method: {c.method}. Optimality: {verdict}. In the replay the end state is missed by "
        f"{number(c.end_error, 2)} (each part relative to its largest size on the way), "
        f"{number(slew.residual_energy or 0.0, 2)} J remain, and {kept}. Limits reached: {binding}.",
    )
    if c.switches is not None:
        switches = ", ".join(f"{t:.5f}" for t in slew.history.switches)
        text += (f"The torque switches {c.switches} times, at {switches} s.",)
    return text


def _asked(slew: SlewResult) -> str:
    """What is asked of the hub."""
    problem = slew.plan.problem
    if problem.angle is None:
        return f"The spin-up to {problem.final_speed:g} rad/s, at whatever angle ({slew.hub_angle[-1]:.3g} rad here),"
    turn = f"{problem.angle:.5g} rad ({np.degrees(problem.angle):.4g}°)".replace("-", "−")
    return f"The slew through {turn}"


def _slew_caption(slew: SlewResult) -> str:
    caption = "Torque, hub angle and speed, tip displacement and bending moment at the clamp."
    return f"{caption} Broken lines: limits, where they are near."


def _comparison(lines: Sequence[dict[str, Any]], picture: bytes, free: bool) -> Section:
    caption = (
        "Left: torques on one scale, and the tip on the way and afterwards. Right: large markers as planned, small ones "
        "with the beam's frequencies changed. What is below 0.1 mm stands on the lower edge; markers of nearly equal "
        "duration are set side by side."
    )
    text = (
        "Vibration is the largest tip displacement in one and a half periods after the end. ZV, ZVD and EI are input "
        "shapers, tuned to the first frequency with the hub free."
    )
    if free:
        text += (
            " The smooth torque is what the course of Eq. (43) asks of a rigid body; here it acts on the beam, whose hub is "
            "free."
        )
    return Section(
        "Beside other spin-ups" if free else "Beside other slews",
        (text,),
        (_comparison_table(lines, free),),
        (Picture(picture, "png", caption),),
    )


def _comparison_table(lines: Sequence[dict[str, Any]], free: bool) -> Table:
    heads = (
        "slew", "duration [s]", "vibration [m]", "vibration, −10\u00a0% [m]", "vibration, +10\u00a0% [m]",
        "speed error [rad/s]" if free else "angle error [rad]", "peak root moment [N\u00a0m]", "effort [10³\u00a0N²m²s]",
    )  # fmt: skip
    keys = ("vibration", "vibration_low", "vibration_high", "speed_error" if free else "angle_error", "peak_moment")
    body = tuple(
        (
            line["name"].replace(" ", "\u00a0").replace("-", "\u2011"),
            f"{line['duration']:.3f}",
            *(number(line[key]) for key in keys),
            f"{line['effort'] / 1e3:.1f}",
        )
        for line in lines
    )
    return Table(heads, body, "−10 % and +10 %: with the beam's frequencies changed through its bending stiffness.")


def _replay_table(replays: Sequence[dict[str, Any]], free: bool) -> Table:
    columns = {
        "angle_error": "angle error [rad]",
        "speed_error": "speed error [rad/s]",
        "tip_swing": "tip swing [m]",
        "residual_energy": "energy left [J]",
    }
    if free:
        del columns["angle_error"]
    body = tuple(
        (_replayed(each, k), *("–" if each[key] is None else number(each[key]) for key in columns))
        for k, each in enumerate(replays)
    )
    return Table(("model", *columns.values()), body)


def _replayed(replay: dict[str, Any], k: int) -> str:
    """The model of a replay; the planned one is the first."""
    name = _name(replay["model"])
    if replay["tip_mass"] is not None:
        return f"{name}, tip mass {replay['tip_mass']:g} kg"
    return f"{name}, as planned" if k == 0 else name


def _name(model: str) -> str:
    return _MODELS.get(model, model.upper())


def _tracking(h: HubBeam, t: dict[str, float], picture: bytes) -> Section:
    text = (
        f"The tip mass is {t['tip_mass']:g} kg, planned was {h.parameters.tip_mass:g} kg. The planned torque is the "
        "feedforward; a time-varying LQR about the trajectory knows all states, and may use half as much torque again "
        "as the plan."
    )
    table = Table(
        ("", "feedforward alone", "with feedback"),
        (
            ("angle error at the end [rad]", number(t["open_final_angle_error"]), number(t["final_angle_error"])),
            ("tip swing at the end [m]", number(t["open_tip_swing"]), number(t["tip_swing"])),
        ),
    )
    caption = "Hub angle, tip displacement and torque: as planned, with the feedforward alone, and with feedback."
    return Section("Followed with another payload", (text,), (table,), (Picture(picture, "png", caption),))


def _mesh(study: dict[str, Any], picture: bytes) -> Section:
    intervals, lines = [int(n) for n in study["intervals"]], study["lines"]
    text = [
        f"The slew of least effort in {study['duration']:.3g} s, 1.1 times the least time, planned on meshes of equal "
        "intervals, on each of which the torque is held. The end state is that of the replay; the cost is compared with "
        "the limit of ever finer meshes. Orders are slopes over the meshes whose error is above the replay's accuracy; a "
        "mesh too coarse for the fastest vibration does not show the order yet.",
    ]
    gaps = [
        f"{line['name']} ({', '.join(str(n) for n, error in zip(intervals, line['errors'], strict=True) if error is None)})"
        for line in lines
        if None in line["errors"]
    ]
    if gaps:
        text.append(f"No solution on these numbers of intervals, or none to compare with: {'; '.join(gaps)}.")
    heads = ("relative error of", *(f"{n} intervals" for n in intervals), "order", "order in theory")
    body = tuple((line["name"], *_mesh_cells(line)) for line in lines)
    caption = "Relative error over the number of intervals, and the order of each scheme."
    return Section("Error against mesh size", tuple(text), (Table(heads, body),), (Picture(picture, "png", caption),))


def _mesh_cells(line: dict[str, Any]) -> tuple[str, ...]:
    errors = ("–" if not error else power(error, 2) for error in line["errors"])
    order = "not seen" if line["order"] is None else f"{line['order']:.1f}"
    return (*errors, order, f"{line['theory']:.0f}")
