"""The slew report: plans for one hub-beam, classical commands beside them, following, pictures and a film."""

from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from boomctl.files import prepared_folder, write_json, write_whole
from boomctl.plotting import figure_bytes, plot_slew_comparison, plot_spin_ups, slew_film
from boomctl.rotating_beam import HubBeam
from boomctl.slew import (
    MeshStudy,
    PayloadComparison,
    SlewResult,
    SwitchingCurve,
    TrackingResult,
    mesh_study,
    optimal_slew,
    switching_curve,
    track,
)
from boomctl.studies.slew.design import SlewDesign, SlewEvaluation, evaluate
from boomctl.studies.slew.report import slew_report

STEPS = 7
"""Steps of `run` that it tells of."""

_SCHEMES = (("shooting", 1), ("collocation", 3), ("radau", 3))
_ROOM = 1.1
_MORE = 0.1
_COMPARED = (
    "name", "duration", "vibration", "angle_error", "speed_error", "peak_moment", "effort", "vibration_low", "vibration_high",
)  # fmt: skip
_TRACKED = ("tip_mass", "final_angle_error", "open_final_angle_error", "tip_swing", "open_tip_swing")
_SPUN = ("name", "duration", "peak_torque", "vibration", "speed_error")


def run(
    folder: Path,
    h: HubBeam,
    angle: float = np.pi / 2,
    torque_limit: float = 200.0,
    objective: str = "time",
    duration: float | None = None,
    meshes: tuple[int, ...] | None = None,
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
    meshes : tuple of int
        Numbers of intervals, ascending, on which the report shows the error of planning; None: three, by the fastest
        bending vibration; () leaves that out.
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
    evaluation = evaluate(SlewDesign("slew", "A slew of a flexible beam", h, planned))
    least = _ROOM * planned["minimum time"].duration

    def study() -> MeshStudy | None:
        return _mesh_study(h, angle, torque_limit, least, meshes)

    return write_report(evaluation, target, tell, study)


def write_report(
    evaluation: SlewEvaluation,
    folder: str | Path,
    tell: Callable[[str], None] = lambda text: None,
    study: Callable[[], MeshStudy | None] = lambda: None,
) -> dict[str, Any]:
    """Replay and follow a slew, and write report.html, results.json, pictures and a film into a folder.

    Parameters
    ----------
    evaluation : SlewEvaluation
    folder : str or Path
    tell : callable
        Told in words what comes next.
    study : callable
        Computes the error over meshes; by default none is shown.

    Returns
    -------
    dict
        What results.json holds.

    Raises
    ------
    OSError
        The folder cannot be written to.
    """
    design, target = evaluation.design, prepared_folder(folder)
    tell("other models")
    replays = _replays(evaluation)
    tell("following with another payload")
    following = track(design.slew, max(design.beam.parameters.tip_mass, *design.payloads, 0.0) + _MORE)
    tell("errors over meshes")
    errors = study()
    tell("pictures")
    switching = switching_curve(design.slew) if design.slew.certificate.switches is not None else None
    pictures = _pictures(evaluation, following, errors, switching)
    for name, content in pictures.items():
        write_whole(target / f"{name}.png", content)
    film, filmed = _film(evaluation)
    write_whole(target / "slew.gif", film)
    results = _results(evaluation, replays, following, errors, switching) | {"film_tip_mass": filmed}
    write_json(target / "results.json", results)
    tell("report")
    write_whole(target / "report.html", slew_report(design, results, pictures, film))
    return results


def _pictures(
    evaluation: SlewEvaluation, following: TrackingResult, errors: MeshStudy | None, switching: SwitchingCurve | None
) -> dict[str, bytes]:
    """All pictures by name, as PNG files."""
    design, problem = evaluation.design, evaluation.design.slew.plan.problem
    zv = f"{design.rigid}, ZV"
    shown = tuple(dict.fromkeys((*design.planned, design.rigid, design.rival or zv, zv)))
    figures = {
        "slew": design.slew.plot(),
        "comparison": plot_slew_comparison(evaluation.comparison, shown),
        "tracking": following.plot(),
    }
    if switching is not None:
        figures["switching"] = switching.plot()
    if evaluation.payloads is not None:
        figures["payloads"] = evaluation.payloads.plot()
    if evaluation.spin_ups:
        figures["spin_up"] = plot_spin_ups(evaluation.spin_ups, problem.limits.torque, problem.final_speed)
    if errors is not None:
        figures["mesh"] = errors.plot()
    return {name: figure_bytes(figure, "png") for name, figure in figures.items()}


def _replays(evaluation: SlewEvaluation) -> list[dict[str, Any]]:
    """The slew on the planning model, with the other payloads, and on other models."""
    design, slew = evaluation.design, evaluation.design.slew
    problem, own = slew.plan.problem, evaluation.comparison.line(design.label)
    planned = {
        "model": design.beam.model,
        "tip_mass": None,
        "angle_error": 0.0 if problem.angle is None else float(slew.hub_angle[-1]) - problem.angle,
        "speed_error": float(slew.hub_speed[-1]) - problem.final_speed,
        "tip_swing": own.vibration,
        "residual_energy": slew.residual_energy,
    }
    return [planned, *(asdict(each) for each in slew.replays)]


def _title(slew: SlewResult) -> str:
    """What sets a slew apart from others of the same beam."""
    limited = ", with limits" if slew.plan.problem.limits.beside_torque else ""
    return f"{slew.title}{limited}" if slew.objective == "time" else f"{slew.title}, {slew.duration:.3g} s{limited}"


def _planned(h: HubBeam, slew: SlewResult, angle: float, torque_limit: float) -> dict[str, SlewResult]:
    """The slew asked for, the fastest one, and the cheapest in a little more than the least time."""
    named = {_title(slew): slew}
    if "minimum time" not in named:
        named["minimum time"] = optimal_slew(h, angle, torque_limit)
    roomy = _ROOM * named["minimum time"].duration
    effort = optimal_slew(h, angle, torque_limit, "effort", roomy, method="shooting", intervals=200)
    named.setdefault(_title(effort), effort)
    return named


def _mesh_study(
    h: HubBeam, angle: float, torque_limit: float, duration: float, meshes: tuple[int, ...] | None
) -> MeshStudy | None:
    """Errors of planning over meshes; no shooting where axial vibrations are too fast for any of them."""
    counts = _meshes(h, duration) if meshes is None else meshes
    if not counts:
        return None
    schemes = tuple(scheme for scheme in _SCHEMES if scheme[0] != "shooting" or not h.has_axial_modes)
    return mesh_study(h, angle, torque_limit, duration, schemes, counts)


def _meshes(h: HubBeam, duration: float) -> tuple[int, ...]:
    """Three meshes: the coarsest has four intervals a period of the fastest bending vibration, or as many as are cheap."""
    bending = HubBeam(h.parameters, "sfoam", h.modes)
    needed = 4.0 * duration * float(bending.frequencies_hz().max())
    first = 10 * min(max(round(needed / 10.0), 2), 10)
    return (first, 2 * first, 4 * first)


def _film(evaluation: SlewEvaluation) -> tuple[bytes, float]:
    """The slew and its rival on the same beam, with the payload that the rival suits least; that payload, kg."""
    design, mass = evaluation.design, evaluation.design.beam.parameters.tip_mass
    if evaluation.payloads is not None and design.rival in design.planned:
        mass = evaluation.payloads.worst(design.rival).tip_mass
    beam, curves = design.beam.with_tip_mass(mass), {}
    for name in (design.label, design.rival or design.rigid):
        history = evaluation.comparison.line(name).history
        t = np.linspace(0.0, design.slew.duration + 2.5, 601)
        label = "rigid body's bang-bang" if name == "bang-bang" else name
        curves[label] = (t, beam.shape(beam.simulate_torque(history, t, history.breakpoints).states))
    return slew_film(design.slew, curves), mass


def _results(
    evaluation: SlewEvaluation,
    replays: list[dict[str, Any]],
    following: TrackingResult,
    errors: MeshStudy | None,
    switching: SwitchingCurve | None,
) -> dict[str, Any]:
    design, slew = evaluation.design, evaluation.design.slew
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
        "worth": evaluation.verdict,
        "replays": replays,
        "mesh_study": None if errors is None else _mesh_results(errors),
        "comparison": [_picked(line, _COMPARED) for line in evaluation.comparison.lines],
        "payloads": None if evaluation.payloads is None else _payload_results(evaluation.payloads),
        "spin_ups": [_picked(each, _SPUN) for each in evaluation.spin_ups],
        "tracking": _picked(following, _TRACKED),
        "time": slew.time,
        "torque": slew.torque,
        "hub_angle": slew.hub_angle,
        "hub_speed": slew.hub_speed,
        "tip_displacement": slew.tip_displacement,
    }


def _picked(value: object, keys: tuple[str, ...]) -> dict[str, Any]:
    return {key: getattr(value, key) for key in keys}


def _payload_results(payloads: PayloadComparison) -> dict[str, Any]:
    keys = ("slew", "tip_mass", "planned", "peak_tip", "vibration", "angle_error")
    return {
        "lines": [_picked(line, keys) for line in payloads.lines],
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
