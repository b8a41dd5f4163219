"""Run time against error of everything that a user does: the table of scenes, and a run of them."""

import os
import platform
import time
from collections.abc import Callable, Sequence
from functools import partial
from importlib import import_module
from pathlib import Path

from boomctl.checks import known
from boomctl.lab.benchmark.precision.growth import growths
from boomctl.lab.benchmark.precision.limits import limits
from boomctl.lab.benchmark.precision.measure import measured
from boomctl.lab.benchmark.precision.report import PrecisionReport
from boomctl.lab.benchmark.precision.scene import Extent, SceneMaker
from boomctl.lab.benchmark.precision.scenes.lumped_masses import RATIOS, key_of
from boomctl.lab.benchmark.report import Tell
from boomctl.lab.benchmark.timing import environment

# name of a scene -> module in scenes/ and the function that makes it
SCENES: dict[str, str] = {
    "boom-sigma": "boom_sigma:boom_sigma",
    "boom-peak": "boom_peak:boom_peak",
    "boom-time": "boom_time:boom_time",
    "boom-reduction": "boom_reduction:boom_reduction",
    "boom-loop": "sampled_loop:boom_loop",
    "h-infinity": "h_infinity:h_infinity_design",
    "h-infinity-si": "h_infinity:h_infinity_si",
    "hub-beam-motion": "hub_beam_motion:hub_beam_motion",
    "hub-beam-models": "hub_beam_motion:hub_beam_models",
    "hub-beam-torque": "hub_beam_torque:hub_beam_torque",
    "hub-beam-torque-models": "hub_beam_torque:hub_beam_torque_models",
    "beam-loop": "sampled_loop:beam_loop",
    "slew-effort": "slews:least_effort",
    "slew-time": "slews:fastest",
}
STUDIES = ("lumped-masses", "growth", "limits")
"""What is no single diagram."""

_SECONDS: dict[Extent, float] = {
    "quick": 1.0,
    "whole": 15.0,
}  # of turns of a scene: with all that comes on top, a minute and a quarter of an hour
_SHARE = 0.2  # of that, for each of the small diagrams of lumped masses


def names() -> tuple[str, ...]:
    """Return what can be measured."""
    return (*SCENES, *STUDIES)


def run(chosen: Sequence[str] = (), quick: bool = False, tell: Tell | None = None) -> PrecisionReport:
    """Measure scenes; all by default.

    Raises
    ------
    ValueError
        An unknown scene.
    """
    extent: Extent = "quick" if quick else "whole"
    wanted = [known("scene", name, names()) for name in chosen] or list(names())
    told: Tell = tell or (lambda text: None)
    start = time.perf_counter()
    diagrams = []
    for key, maker, seconds in _makers(wanted, extent):
        told(f"{key}: reference")
        diagrams.append(measured(maker(extent), seconds, told))
    grown = growths(extent, told) if "growth" in wanted else ()
    rates, found = limits(extent, told) if "limits" in wanted else (None, ())
    words = ["boomctl benchmark precision", *(chosen or ()), *(["--quick"] if quick else [])]
    return PrecisionReport(
        tuple(diagrams),
        grown,
        rates,
        found,
        {"processor": _processor(), **environment(_PACKAGES)},
        " ".join(words),
        time.perf_counter() - start,
    )


def steps(chosen: Sequence[str] = (), quick: bool = False) -> int:
    """Return about how often a run tells what comes next: for a progress bar.

    Raises
    ------
    ValueError
        An unknown scene.
    """
    wanted = [known("scene", name, names()) for name in chosen] or list(names())
    small = len(RATIOS["quick" if quick else "whole"])
    told = {"lumped-masses": small * (_TOLD["quick"] if quick else _TOLD["whole"]) // 2, "growth": 7, "limits": 6}
    return sum(told.get(name, _TOLD["quick" if quick else "whole"]) for name in wanted)


_TOLD: dict[Extent, int] = {"quick": 16, "whole": 45}  # settings of a scene, about
_PACKAGES = ("boomctl", "numpy", "scipy", "control", "slycot", "pymor", "casadi", "exudyn", "mpmath")


def _makers(wanted: Sequence[str], extent: Extent) -> list[tuple[str, SceneMaker, float]]:
    made: list[tuple[str, SceneMaker, float]] = []
    for key in wanted:
        if key in SCENES:
            module, name = SCENES[key].split(":")
            maker: Callable[[Extent], object] = getattr(import_module(f"{__package__}.scenes.{module}"), name)
            made.append((key, maker, _SECONDS[extent]))  # type: ignore[arg-type]
        elif key == "lumped-masses":
            maker_of = import_module(f"{__package__}.scenes.lumped_masses").lumped_masses
            made += [(key_of(r), partial(maker_of, ratio=r), _SHARE * _SECONDS[extent]) for r in RATIOS[extent]]
    return made


def _processor() -> str:
    """Return the processor's name, and how busy the machine is."""
    name = platform.processor() or platform.machine()
    listed = Path("/proc/cpuinfo")
    if listed.is_file():
        lines = (line for line in listed.read_text(encoding="utf-8").splitlines() if line.startswith("model name"))
        name = next(lines, f":{name}").split(":", 1)[1].strip()
    load = f", load {os.getloadavg()[0]:.1f}" if hasattr(os, "getloadavg") else ""
    return name + load
