"""The table of scenes, and a run."""

import time
from collections.abc import Callable, Iterable, Sequence

from boomctl.checks import known
from boomctl.lab.benchmark.measure import measured
from boomctl.lab.benchmark.report import BenchmarkReport, environment

SCENES = {
    key: f"boomctl.lab.benchmark.scenes.{place}"
    for key, place in {
        "boom-sigma": "boom:boom_sigma",
        "boom-peak": "boom:boom_peak",
        "boom-time": "boom:boom_time",
        "boom-reduction": "boom:boom_reduction",
        "boom-loop": "loops:boom_loop",
        "beam-loop": "loops:beam_loop",
        "h-infinity": "synthesis:h_infinity_scene",
        "tuning": "synthesis:tuning",
        "hub-spin-up": "hub_beam:hub_spin_up",
        "hub-torque": "hub_beam:hub_torque",
        "slew-time": "slews:slew_time",
        "slew-effort": "slews:slew_effort",
        "identification": "identification:identification",
    }.items()
}
"""What makes each scene, "module:function"."""

_GROUPS = ("boom", "hub", "slew")  # names of all scenes that begin so
_TIME_LIMIT = 300.0  # of one setting [s]; the slowest takes a minute and a half


def run(
    chosen: Sequence[str] = (), *, quick: bool = False, progress: Callable[[str], None] = lambda text: None
) -> BenchmarkReport:
    """Measure scenes.

    Parameters
    ----------
    chosen : sequence of str
        Names of scenes, or their first word ("boom", "hub", "slew"); all scenes if there is none.
    quick : bool
        A third of the settings, one process for each.
    progress : callable
        Is told in words what comes next.

    Returns
    -------
    BenchmarkReport

    Raises
    ------
    ValueError
        An unknown name.
    """
    begin = time.perf_counter()
    diagrams = tuple(
        measured(key, SCENES[key], quick=quick, time_limit=_TIME_LIMIT, progress=progress) for key in wanted(chosen)
    )
    command = " ".join(["boomctl benchmark", *chosen, *(["--quick"] if quick else [])])
    return BenchmarkReport(diagrams, environment(), command, time.perf_counter() - begin)


def wanted(chosen: Iterable[str]) -> tuple[str, ...]:
    """Return the scenes of some names, in the order of the table.

    Raises
    ------
    ValueError
        An unknown name.
    """
    names = [known("benchmark", name, (*_GROUPS, *SCENES)) for name in chosen]
    return tuple(key for key in SCENES if not names or any(key == name or key.startswith(f"{name}-") for name in names))
