"""The slew report as one HTML document: words, tables and pictures."""

import re
from collections.abc import Sequence
from typing import Any

import numpy as np

from boomctl.hub_beam import HubBeam
from boomctl.reporting import Picture, Section, Table, html_report
from boomctl.slew import SlewResult

__all__ = ["slew_report"]

_ROUNDING = 1e-9
_LIMITS = {
    "torque_limit": "torque",
    "torque_rate_limit": "torque rate",
    "speed_limit": "hub speed",
    "tip_limit": "tip displacement",
    "moment_limit": "root moment",
}
_MODELS = {"geometrically-exact": "geometrically exact beam", "sfoam-consistent": "SFOAM, consistent"}


def slew_report(h: HubBeam, slew: SlewResult, results: dict[str, Any], pictures: dict[str, bytes], film: bytes) -> str:
    """Return the report of a slew.

    Parameters
    ----------
    h : HubBeam
    slew : SlewResult
    results : dict
        What results.json holds.
    pictures : dict of str to bytes
        PNG files: "slew", "comparison", "tracking", and "mesh" where meshes were studied.
    film : bytes
        GIF.
    """
    sections = [
        Section(
            "The slew",
            _slew_text(h, slew),
            (),
            (Picture(pictures["slew"], "png", _slew_caption(slew)),),
        ),
        Section("In motion", (), (), (Picture(film, "gif", "Top view, drawn to scale, in real time."),)),
        _comparison(results["comparison"], pictures["comparison"]),
        Section(
            "The same torque on other models",
            ("The models differ in what they neglect. The torque is open loop; errors are those at its end.",),
            (_replay_table(results["replays"]),),
        ),
        _tracking(h, results["tracking"], pictures["tracking"]),
    ]
    if results["mesh_study"] is not None:
        sections.append(_mesh(results["mesh_study"], pictures["mesh"]))
    lead = f"{slew.title.capitalize()}: planned, replayed by another integrator, and set beside classical commands."
    return html_report("A slew of a flexible beam", lead, sections)


def _slew_text(h: HubBeam, slew: SlewResult) -> tuple[str, ...]:
    c, problem = slew.certificate, slew.plan.problem
    payload = f"a tip mass of {h.parameters.tip_mass:g} kg" if h.parameters.tip_mass else "no tip mass"
    turn = f"{problem.angle:.5g} rad ({np.degrees(problem.angle):.4g}°)".replace("-", "−")
    modes = "1 mode" if h.modes == 1 else f"{h.modes} modes"
    binding = ", ".join(f"{_LIMITS[name]} (from {when:.3g} s)" for name, when in c.binding.items()) or "none"
    verdict = re.sub(r"\d+e[-+]\d+", lambda found: _power(float(found[0]), 1), c.verdict)
    kept = "no limit is exceeded"
    if c.constraint_violation > 0.0:
        kept = f"no limit is exceeded by more than {_power(c.constraint_violation, 1)} of it"
    text = (
        f"The slew through {turn} with at most "
        f"{problem.torque_limit:g} N m takes {slew.duration:.7g} s. Model: {_name(h.model)} with {modes} and {payload}.",
        f"Method: {c.method}. Optimality: {verdict}. In the replay the end state is missed by "
        f"{_number(c.end_error, 2)} (each part relative to its largest size on the way), "
        f"{_number(slew.residual_energy or 0.0, 2)} J remain, and {kept}. Limits reached: {binding}.",
    )
    if c.switches is not None:
        switches = ", ".join(f"{t:.5f}" for t in slew.history.switches)
        text += (f"The torque switches {c.switches} times, at {switches} s.",)
    return text


def _slew_caption(slew: SlewResult) -> str:
    caption = "Torque, hub angle and speed, tip displacement and bending moment at the clamp."
    return f"{caption} Broken lines: limits, where they are near."


def _comparison(lines: Sequence[dict[str, Any]], picture: bytes) -> Section:
    caption = (
        "Left: torques on one scale, and the tip on the way and afterwards. Right: large markers as planned, small ones "
        "with the beam's frequencies changed. What is below 0.1 mm stands on the lower edge; markers of nearly equal "
        "duration are set side by side."
    )
    return Section(
        "Beside other slews",
        (
            "Vibration is the largest tip displacement in one and a half periods after the end. ZV, ZVD and EI are input "
            "shapers, tuned to the first frequency with the hub free.",
        ),
        (_comparison_table(lines),),
        (Picture(picture, "png", caption),),
    )


def _comparison_table(lines: Sequence[dict[str, Any]]) -> Table:
    heads = (
        "slew", "duration [s]", "vibration [m]", "vibration, −10\u00a0% [m]", "vibration, +10\u00a0% [m]",
        "angle error [rad]", "peak root moment [N\u00a0m]", "effort [10³\u00a0N²m²s]",
    )  # fmt: skip
    keys = ("vibration", "vibration_low", "vibration_high", "angle_error", "peak_moment")
    body = tuple(
        (
            line["name"].replace(" ", "\u00a0"),
            f"{line['duration']:.3f}",
            *(_number(line[key]) for key in keys),
            f"{line['effort'] / 1e3:.1f}",
        )
        for line in lines
    )
    return Table(heads, body, "−10 % and +10 %: with the beam's frequencies changed through its bending stiffness.")


def _replay_table(replays: Sequence[dict[str, Any]]) -> Table:
    heads = ("model", "angle error [rad]", "speed error [rad/s]", "tip swing [m]", "energy left [J]")
    keys = ("angle_error", "speed_error", "tip_swing", "residual_energy")
    body = tuple(
        (_name(each["model"]), *("–" if each[key] is None else _number(each[key]) for key in keys)) for each in replays
    )
    return Table(heads, body)


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
            ("angle error at the end [rad]", _number(t["open_final_angle_error"]), _number(t["final_angle_error"])),
            ("tip swing at the end [m]", _number(t["open_tip_swing"]), _number(t["tip_swing"])),
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
    errors = ("–" if not error else _power(error, 2) for error in line["errors"])
    order = "not seen" if line["order"] is None else f"{line['order']:.1f}"
    return (*errors, order, f"{line['theory']:.0f}")


def _number(value: float, digits: int = 3) -> str:
    """A number with few digits, small and large ones with a power of ten; what is rounding is said to be so."""
    if abs(value) < _ROUNDING:
        return f"less than {_power(_ROUNDING, 1)}"
    if 1e-3 <= abs(value) < 1e4:
        return f"{value:#.{digits}g}".rstrip(".").replace("-", "−")
    return _power(value, digits)


def _power(value: float, digits: int) -> str:
    mantissa, exponent = f"{value:.{digits - 1}e}".replace("-", "−").split("e")
    raised = str(int(exponent.replace("−", "-"))).translate(str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"))
    return f"10{raised}" if mantissa == "1" else f"{mantissa}·10{raised}"
