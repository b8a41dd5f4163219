"""The slew report: plans for one hub-beam and one angle, classical commands beside them, following, pictures and a film."""

from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from boomctl.hub_beam import HubBeam
from boomctl.output import prepared_folder, write_json, write_whole
from boomctl.plotting import figure_bytes, plot_slew_comparison, slew_film
from boomctl.reproduce.slew_report import slew_report
from boomctl.slew import MeshStudy, SlewComparison, SlewResult, compare_slews, mesh_study, optimal_slew, track

__all__ = ["STEPS", "run"]

STEPS = 7

_SCHEMES = (("shooting", 1), ("collocation", 3), ("radau", 3))
_ROOM = 1.1


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
    comparison = compare_slews(h, angle, torque_limit, planned)
    tell("other models")
    replays = [asdict(each) for each in slew.replays]
    tell("following with another payload")
    following = track(slew, h.parameters.tip_mass + 0.1)
    tell("errors over meshes")
    study = _mesh_study(h, angle, torque_limit, _ROOM * planned["minimum time"].duration, meshes)
    tell("pictures")
    shown = (*planned, "bang-bang", "bang-bang, ZV")
    figures = {"slew": slew.plot(), "comparison": plot_slew_comparison(comparison, shown), "tracking": following.plot()}
    figures |= {"mesh": study.plot()} if study is not None else {}
    pictures = {name: figure_bytes(figure, "png") for name, figure in figures.items()}
    for name, content in pictures.items():
        write_whole(target / f"{name}.png", content)
    film = _film(h, slew, comparison)
    write_whole(target / "slew.gif", film)
    results = _results(h, slew, comparison, replays, study)
    results["tracking"] = {
        key: getattr(following, key)
        for key in ("tip_mass", "final_angle_error", "open_final_angle_error", "tip_swing", "open_tip_swing")
    }
    write_json(target / "results.json", results)
    tell("report")
    write_whole(target / "report.html", slew_report(h, slew, results, pictures, film))
    return results


def _title(slew: SlewResult) -> str:
    """What sets a slew apart from others of the same beam."""
    limited = ", with limits" if slew.plan.problem.limits else ""
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


def _film(h: HubBeam, slew: SlewResult, comparison: SlewComparison) -> bytes:
    """The slew, and a rigid body's bang-bang on the same beam."""
    rigid = next(line for line in comparison.lines if line.name == "bang-bang")
    curves = {}
    for name, history in ((slew.title, slew.history), ("rigid body's bang-bang", rigid.history)):
        t = np.linspace(0.0, slew.duration + 2.5, 601)
        curves[name] = (t, h.shape(h.simulate_torque(history, t, history.breakpoints).states))
    return slew_film(slew, curves)


def _results(
    h: HubBeam, slew: SlewResult, comparison: SlewComparison, replays: list[dict[str, Any]], study: MeshStudy | None
) -> dict[str, Any]:
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
        "verdict": slew.certificate.verdict,
        "replays": replays,
        "mesh_study": None if study is None else _mesh_results(study),
        "comparison": [{key: getattr(line, key) for key in keys} for line in comparison.lines],
        "time": slew.time,
        "torque": slew.torque,
        "hub_angle": slew.hub_angle,
        "tip_displacement": slew.tip_displacement,
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
