"""The slew report: plans for one hub-beam and one angle, classical commands beside them, following, pictures and a film."""

from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from boomctl.hub_beam import HubBeam
from boomctl.output import prepared_folder, write_json, write_whole
from boomctl.plotting import figure_bytes, slew_film
from boomctl.reporting import Picture, Section, Table, html_report
from boomctl.slew import SlewComparison, SlewResult, compare_slews, optimal_slew, track

__all__ = ["STEPS", "run"]

STEPS = 6


def run(
    folder: Path,
    h: HubBeam,
    angle: float = np.pi / 2,
    torque_limit: float = 200.0,
    objective: str = "time",
    duration: float | None = None,
    progress: Callable[[str], None] | None = None,
    **limits: float,
) -> dict[str, Any]:
    """Plan a slew, compare and replay it, and write report.html, results.json, pictures and a film into a folder.

    Parameters
    ----------
    folder : Path
    h : HubBeam
    angle, torque_limit, objective, duration
        As in `optimal_slew`.
    progress : callable, optional
        Told in words what comes next.
    limits : float
        Further limits by the names that `optimal_slew` has for them.

    Returns
    -------
    dict
        What results.json holds.
    """
    tell = progress or (lambda text: None)
    target = prepared_folder(folder)
    tell("the slew asked for")
    slew = optimal_slew(h, angle, torque_limit, objective, duration, **limits)  # pyright: ignore[reportArgumentType]
    tell("slews to compare")
    planned = _planned(h, slew, angle, torque_limit)
    comparison = compare_slews(h, angle, torque_limit, planned)
    tell("other models")
    replays = [asdict(each) for each in slew.replays]
    tell("following with another payload")
    mass = h.parameters.tip_mass + 0.1
    following = track(slew, mass)
    tell("pictures")
    pictures = {
        "slew": figure_bytes(slew.plot(), "png"),
        "comparison": figure_bytes(comparison.plot(), "png"),
        "tracking": figure_bytes(following.plot(), "png"),
    }
    for name, content in pictures.items():
        write_whole(target / f"{name}.png", content)
    film = _film(h, slew, comparison)
    write_whole(target / "slew.gif", film)
    results = _results(h, slew, comparison, replays)
    results["tracking"] = {
        key: getattr(following, key)
        for key in ("tip_mass", "final_angle_error", "open_final_angle_error", "tip_swing", "open_tip_swing")
    }
    write_json(target / "results.json", results)
    tell("report")
    write_whole(target / "report.html", _report(h, slew, results, pictures, film))
    return results


def _planned(h: HubBeam, slew: SlewResult, angle: float, torque_limit: float) -> dict[str, SlewResult]:
    """The slew asked for, the fastest one, and the cheapest in the time of ZV-shaped bang-bang."""
    named = {f"asked: {slew.objective}": slew}
    if slew.objective != "time" or slew.plan.problem.limits:
        named["minimum time"] = optimal_slew(h, angle, torque_limit)
    fastest = named.get("minimum time", slew)
    effort = optimal_slew(h, angle, torque_limit, "effort", 1.1 * fastest.duration, method="shooting", intervals=200)
    return named | {"minimum effort, 1.1 times the least time": effort}


def _film(h: HubBeam, slew: SlewResult, comparison: SlewComparison) -> bytes:
    """The slew, and a rigid body's bang-bang on the same beam."""
    rigid = next(line for line in comparison.lines if line.name == "bang-bang")
    curves = {}
    for name, history in ((f"optimal, {slew.objective}", slew.history), ("rigid bang-bang", rigid.history)):
        t = np.linspace(0.0, slew.duration + 2.5, 601)
        curves[name] = (t, h.shape(h.simulate_torque(history, t, history.breakpoints).states))
    return slew_film(slew, curves)


def _results(h: HubBeam, slew: SlewResult, comparison: SlewComparison, replays: list[dict[str, Any]]) -> dict[str, Any]:
    keys = (
        "name", "duration", "vibration", "angle_error", "peak_moment", "effort", "vibration_low", "vibration_high",
    )  # fmt: skip
    return {
        "model": h.model,
        "modes": h.modes,
        "parameters": asdict(h.parameters),
        "objective": slew.objective,
        "duration": slew.duration,
        "cost": slew.cost,
        "end_error": slew.end_error,
        "residual_energy": slew.residual_energy,
        "switches": slew.history.switches if slew.certificate.switches is not None else None,
        "certificate": asdict(slew.certificate),
        "replays": replays,
        "comparison": [{key: getattr(line, key) for key in keys} for line in comparison.lines],
        "time": slew.time,
        "torque": slew.torque,
        "hub_angle": slew.hub_angle,
        "tip_displacement": slew.tip_displacement,
    }


def _report(h: HubBeam, slew: SlewResult, results: dict[str, Any], pictures: dict[str, bytes], film: bytes) -> str:
    c = slew.certificate
    angle, problem = slew.hub_angle[-1] - slew.hub_angle[0], slew.plan.problem
    binding = ", ".join(f"{name} from {when:.4g} s" for name, when in c.binding.items()) or "none"
    text = (
        f"{h.model.upper()}, {h.modes} modes, {angle:.6g} rad under {problem.torque_limit:g} N m: {slew.duration:.9g} s.",
        f"Planned by {c.method}; {c.optimality}, distance from optimality {abs(c.optimality_gap):.1e}. In the replay by "
        f"another integrator the end state is missed by {c.end_error:.1e}, {slew.residual_energy:.1e} J are left, and no "
        f"limit is exceeded by more than {c.constraint_violation:.1e}. Binding: {binding}.",
    )
    if c.switches is not None:
        switches = ", ".join(f"{t:.6f}" for t in slew.history.switches)
        text += (f"The torque switches {c.switches} times, at {switches} s.",)
    sections = (
        Section("The slew", text, (), (Picture(pictures["slew"], "png", "Torque, hub, tip and root moment."),)),
        Section("In motion", (), (), (Picture(film, "gif", "Drawn to scale, in real time."),)),
        Section(
            "Beside other slews",
            ("Vibration is the largest tip displacement in one and a half periods after the end.",),
            (_comparison_table(results["comparison"]),),
            (Picture(pictures["comparison"], "png", "Slews over time, and their sensitivity to the frequencies."),),
        ),
        Section(
            "The same torque on other models",
            ("The models differ in what they neglect; the torque is open loop.",),
            (_replay_table(results["replays"]),),
        ),
        Section(
            "Followed with another payload",
            (
                f"Tip mass {results['tracking']['tip_mass']:g} kg instead of {h.parameters.tip_mass:g} kg. The planned "
                "torque is the feedforward; a time-varying LQR about the trajectory knows all states and may use half as "
                "much torque again.",
            ),
            (_tracking_table(results["tracking"]),),
            (Picture(pictures["tracking"], "png", "Planned, open loop and with feedback."),),
        ),
    )
    return html_report("A slew of a flexible beam", "Planned, replayed, and set beside classical commands.", sections)


def _comparison_table(lines: list[dict[str, Any]]) -> Table:
    heads = (
        "slew", "duration [s]", "vibration [m]", "angle error [rad]", "peak moment [N m]", "effort [N²m²s]",
        "vibration, -10 % [m]", "vibration, +10 % [m]",
    )  # fmt: skip
    body = tuple((line["name"], *(f"{value:.4g}" for key, value in line.items() if key != "name")) for line in lines)
    return Table(heads, body, "Minus and plus 10 %: of the beam's frequencies, through its bending stiffness.")


def _replay_table(replays: list[dict[str, Any]]) -> Table:
    heads = ("model", "angle error [rad]", "speed error [rad/s]", "tip swing [m]", "energy left [J]")
    keys = ("angle_error", "speed_error", "tip_swing", "residual_energy")
    body = tuple(
        (each["model"], *("" if each[key] is None else f"{each[key]:.3g}" for key in keys)) for each in replays
    )
    return Table(heads, body)


def _tracking_table(t: dict[str, float]) -> Table:
    return Table(
        ("", "feedforward alone", "with feedback"),
        (
            ("angle error at the end [rad]", f"{t['open_final_angle_error']:.3g}", f"{t['final_angle_error']:.3g}"),
            ("tip swing at the end [m]", f"{t['open_tip_swing']:.3g}", f"{t['tip_swing']:.3g}"),
        ),
    )
