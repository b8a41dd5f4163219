"""The table of scenes, the names of groups of them, and a run."""

import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from functools import partial
from importlib import import_module

from boomctl.checks import known
from boomctl.lab.benchmark.measure import measured
from boomctl.lab.benchmark.report import BenchmarkReport
from boomctl.lab.benchmark.scene import Extent, SceneMaker, Tell
from boomctl.lab.benchmark.timing import environment

# name of a scene -> module in scenes/ and the function that makes it; its argument, where it has one
SCENES: dict[str, str] = {
    "boom-sigma": "boom_sigma:boom_sigma",
    "boom-rounding": "boom_sigma:boom_rounding",
    "boom-peak": "boom_peak:boom_peak",
    "boom-time": "boom_time:boom_time",
    "first-calls": "first_calls:first_calls",
    "boom-reduction": "boom_reduction:boom_reduction",
    "boom-reduction-fine": "boom_reduction:boom_reduction_fine",
    "boom-loop": "sampled_loop:boom_loop",
    "h-infinity": "h_infinity:design:h-infinity",
    "h-infinity-si": "h_infinity:design:h-infinity-si",
    "h-infinity-cheap": "h_infinity:design:h-infinity-cheap",
    "hub-beam-motion": "hub_beam:integrators:spin-up",
    "hub-beam-models": "hub_beam:models:spin-up",
    "hub-beam-torque": "hub_beam:integrators:torque",
    "hub-beam-torque-models": "hub_beam:models:torque",
    "hub-beam-modes": "hub_beam_modes:hub_beam_modes",
    "hub-beam-stiff-modes": "hub_beam_modes:hub_beam_stiff_modes",
    "hub-beam-many": "hub_beam_many:many_torques",
    "hub-beam-followers": "hub_beam_many:followers",
    "beam-loop": "sampled_loop:beam_loop",
    "slew-effort": "slews:least_effort",
    "slew-time": "slews:fastest:slew-time",
    "slew-time-one-mode": "slews:fastest:slew-time-one-mode",
    "slew-certified": "slews:certified",
    "tuning": "tuning:tuning",
    "tuning-all": "tuning:tuning_all",
    "designs": "tuning:designs",
    "steel-frame": "steel_frame:steel_frame",
    "rotary-days": "rotary_days:rotary_days",
    "lumped-masses-0": "lumped_masses:lumped_masses:0",
    "lumped-masses-1": "lumped_masses:lumped_masses:1",
    "lumped-masses-10": "lumped_masses:lumped_masses:10",
    "lumped-masses-100": "lumped_masses:lumped_masses:100",
    "lumped-masses-1000": "lumped_masses:lumped_masses:1000",
    **{f"growth-{name}": f"growth:growth:{name}" for name in ("elements", "fine-meshes", "frequencies", "outputs")},
    **{f"growth-{name}": f"growth:growth:{name}" for name in ("duration", "models", "order", "modes", "intervals")},
    "limits": "limits:limits",
}
GROUPS: dict[str, tuple[str, ...]] = {
    "boom": ("boom-sigma", "boom-rounding", "boom-peak", "boom-time", "first-calls"),
    "hub-beam": (*(name for name in SCENES if name.startswith("hub-beam")), "beam-loop"),
    "suspension": (
        *("boom-reduction", "boom-reduction-fine", "boom-loop"),
        *("h-infinity", "h-infinity-si", "h-infinity-cheap"),
    ),
    "slew": tuple(name for name in SCENES if name.startswith("slew")),
    "tune": ("tuning", "tuning-all", "designs"),
    "identify": ("steel-frame", "rotary-days"),
    "lumped-masses": tuple(name for name in SCENES if name.startswith("lumped-masses")),
    "growth": tuple(name for name in SCENES if name.startswith("growth")),
    "all": tuple(SCENES),
}
LONG = ("hub-beam-stiff-modes", "tuning-all", "designs")
"""Scenes that take minutes: of a group only in a full run."""

_SECONDS: dict[Extent, float] = {"quick": 1.0, "whole": 15.0}
"""Of turns of a scene; first answers and references come on top."""
_TOLD: dict[Extent, int] = {"quick": 12, "whole": 30}  # settings of a scene, about


def run(
    chosen: Sequence[str] = ("all",), extent: Extent = "whole", full: bool = False, tell: Tell | None = None
) -> BenchmarkReport:
    """Measure scenes.

    Parameters
    ----------
    chosen : sequence of str
        Names of scenes and groups.
    extent : "quick" or "whole"
        A quick run judges no promises of run times: its sizes are small.
    full : bool
        Scenes of groups that take minutes too.
    tell : callable, optional
        Told in words what comes next.

    Raises
    ------
    ValueError
        An unknown name.
    """
    told: Tell = tell or (lambda text: None)
    start = time.perf_counter()
    diagrams = []
    for scene in (maker(key)(extent) for key in wanted(chosen, full)):
        promises = tuple(p for p in scene.promises if extent == "whole" or not p.of_time)
        diagrams.append(measured(replace(scene, promises=promises), _SECONDS[extent], told))
    options = [word for word, given in (("--quick", extent == "quick"), ("--full", full)) if given]
    command = " ".join(["boomctl benchmark", *chosen, *options])
    return BenchmarkReport(tuple(diagrams), environment(), command, time.perf_counter() - start)


def wanted(chosen: Iterable[str], full: bool = False) -> tuple[str, ...]:
    """Return the scenes of names and groups, in the order of the table.

    Raises
    ------
    ValueError
        An unknown name.
    """
    found: set[str] = set()
    for name in chosen:
        known("benchmark", name, (*GROUPS, *SCENES))
        found |= {name} if name in SCENES else {key for key in GROUPS[name] if full or key not in LONG}
    return tuple(key for key in SCENES if key in found)


def steps(chosen: Iterable[str], extent: Extent, full: bool = False) -> int:
    """Return about how often a run tells what comes next: for a progress bar."""
    return len(wanted(chosen, full)) * _TOLD[extent]


def maker(key: str) -> SceneMaker:
    """Return what makes a scene."""
    module, name, *argument = SCENES[key].split(":")
    made: Callable[..., object] = getattr(import_module(f"{__package__}.scenes.{module}"), name)
    return partial(made, *argument)  # type: ignore[return-value]
