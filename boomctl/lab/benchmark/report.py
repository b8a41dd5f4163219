"""The scenes of the benchmark, a run of them, and its report: whose front leads, every scene with its picture."""

import os
import platform
import re
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from importlib.metadata import distributions
from pathlib import Path
from typing import Any, get_args

from boomctl.checks import known
from boomctl.files import plain
from boomctl.lab.benchmark.diagram import Calls, Diagram, Point, by_method, exponent
from boomctl.lab.benchmark.measure import measured
from boomctl.report import Report, Section, Table, power

_PACKAGES = ("boomctl", "numpy", "scipy", "control", "slycot", "pymor", "casadi", "ctrlsys", "mpmath")
_PAGE_HEADS = ("Problem", "Call", "Error", "First call", "Repeated", "Fastest other program", "Smallest speedup")
_SIZE_HEADS = ("Problem", "Method", "Sizes", "Run time", "Exponent")
_SHADES = {"NO": "#f9d6d5", "yes": "#e3f4e3"}
SCENES = {
    key: f"boomctl.lab.benchmark.scenes.{location}"
    for key, location in {
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
"""Function that builds each scene, "module:function"."""

_GROUPS = ("boom", "hub", "slew")  # names of all scenes that begin so
_NO_POINT = Point("", "", False, False)
_SHOWN_ERROR = 1e-3  # largest error of the settings on the page of the documentation
_TIME_LIMIT = 300.0  # of one setting [s]; the slowest takes a minute and a half


@dataclass(frozen=True)
class BenchmarkReport:
    """All that a run has measured.

    Attributes
    ----------
    diagrams : tuple of Diagram
    environment : mapping of str to str
        Machine and versions.
    command : str
        What repeats the run.
    elapsed : float
        Its duration [s].
    """

    diagrams: tuple[Diagram, ...]
    environment: Mapping[str, str] = field(default_factory=dict)
    command: str = "boomctl benchmark"
    elapsed: float = 0.0

    def to_dict(self) -> dict[str, Any]:
        """Return the results for JSON."""
        facts = {"environment": dict(self.environment), "command": self.command, "elapsed": round(self.elapsed, 1)}
        return plain({"scenes": [asdict(item) for item in self.diagrams], **facts})

    def report(self) -> Report:
        """Return the report with all tables and pictures."""
        lead = "Run time and error belong together: each point below is one method at one setting."
        text = (
            f"{self.command} (this run took {self.elapsed:.0f} s). Each setting runs in a new process with the default number"
            " of BLAS threads. Cold: the first call there, with what it imports; hot: median of later calls, each with"
            " another value of a parameter. Both include everything that is built from the parameters.",
        )
        facts = Table(("", ""), tuple(self.environment.items()), align="ll")
        sections = (
            Section("Whose front leads", (), (self._lead_table(),)),
            *map(_scene_section, self.diagrams),
            Section(
                "Run time versus problem size", (), (Table(_SIZE_HEADS, tuple(self._size_lines()), align="lllrr"),)
            ),
            Section("Machine, versions, and how to repeat this", text, (facts,)),
        )
        files = {"accuracy.md": self.page()} if self.environment else {}
        return Report("Run time against error", (lead,), sections, self.to_dict(), files)

    def page(self) -> str:
        """Return the page of the documentation on accuracy and run time, in Markdown."""
        scenes = _markdown(_PAGE_HEADS, map(_page_line, self.diagrams))
        text = (Path(__file__).parent / "accuracy.md").read_text(encoding="utf-8")
        return text.format(scenes=scenes, **self.environment)

    def _size_lines(self) -> list[tuple[str, ...]]:
        """Return a line of each method whose run time is measured over size."""
        result = []
        for diagram in self.diagrams:
            for method, points in by_method(diagram.sized).items():
                sizes, times = " / ".join(p.label for p in points), " / ".join(duration(p.hot) for p in points)
                slope = exponent(points)
                result.append((diagram.title, method, sizes, times, "" if slope is None else f"{slope:.1f}"))
        return result

    def __str__(self) -> str:
        """Return whose front leads, for a terminal."""
        rows = [(*line[:4], line[5]) for table in (self._lead_table(),) for line in (table.heads, *table.lines)]
        widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
        return "\n".join("  ".join(map(str.ljust, row, widths)).rstrip() for row in rows)

    def _lead_table(self) -> Table:
        lines = []
        for diagram in self.diagrams:
            for calls in get_args(Calls):
                if leads := diagram.leads(calls):
                    (least, other, ours), (largest, *_) = leads[0], leads[-1]
                    lead = f"ours: {_name(ours)}" if ours else "none of ours has so small an error"
                    where = f"{error_words(other.error)}, {_name(other)}; {lead}"
                    ahead = "yes" if least >= 1.0 else "NO"
                    lines.append((diagram.key, calls, ahead, _ratio(least), where, _ratio(largest)))
        heads = ("Scene", "Calls", "Leads", "Least", "where", "Largest")
        caption = "Run time of each point of the others' front over that of our fastest setting with no larger error."
        return Table(heads, tuple(lines), caption, align="lllrlr", shades=_SHADES)


def _scene_section(diagram: Diagram) -> Section:
    from boomctl.plotting.canvas import figure_of, picture
    from boomctl.plotting.precision import plot_precision

    caption = "Lower left is better. Solid lines: this package; dashed: others; gray: the front of all."
    drawn = picture(diagram.key, figure_of(plot_precision, diagram), caption)
    text = (diagram.question, f"Error: {diagram.measure}", *diagram.remarks)
    return Section(diagram.title, text, (_point_table(diagram),), (drawn,))


def _point_table(diagram: Diagram) -> Table:
    lines = []
    for p in diagram.points:
        front = ", ".join(calls for calls in get_args(Calls) if p in diagram.front(calls))
        measures = duration(p.cold), duration(p.hot), _megabytes(p.memory), "yes" if p.verified else "no", front
        lines.append((p.method, p.label, p.failed or error_words(p.error), *measures))
    heads = ("Method", "Setting", "Error", "Cold", "Hot", "Memory", "Verified", "On the front")
    caption = "Verified: the method checks its answer by an independent computation within the run time shown."
    return Table(heads, tuple(lines), caption, align="llrrrrll")


def _page_line(diagram: Diagram) -> tuple[str, ...]:
    """Return the line of a scene on the page of the documentation: fastest settings with an error small enough."""
    fronts = (diagram.front("hot", ours=whose) for whose in (True, False))
    ours, other = (next((p for p in front if p.error <= _SHOWN_ERROR), _NO_POINT) for front in fronts)
    leads = ", ".join(_ratio(diagram.leads(calls)[0][0]) for calls in get_args(Calls) if diagram.leads(calls))
    error = error_words(ours.error) if ours.method else ""
    peer = f"{_name(other)}: {duration(other.hot)}" if other.method else "none"
    return (diagram.title, f"`{ours.call}`", error, duration(ours.cold), duration(ours.hot), peer, leads)


def _markdown(heads: Sequence[str], lines: Iterable[Sequence[str]]) -> str:
    """Return a table in Markdown."""
    return "\n".join(f"| {' | '.join(row)} |" for row in (heads, ("---",) * len(heads), *lines))


def _megabytes(memory: float | None) -> str:
    return "" if memory is None else f"{memory / 1e6:.0f}\u00a0MB"


def _ratio(value: float) -> str:
    return f"{value:,.0f}" if value >= 100.0 else f"{value:.2g}"


def _name(point: Point) -> str:
    return f"{point.method}, {point.label}"


def error_words(error: float) -> str:
    """Return an error with two digits."""
    return power(error, 2) if error else "0"


def duration(elapsed: float | None) -> str:
    """Return a run time with its unit."""
    if elapsed is None:
        return ""
    scale, unit = (1.0, "s") if elapsed >= 1.0 else (1e3, "ms") if elapsed >= 1e-3 else (1e6, "µs")
    return f"{scale * elapsed:.3g}\u00a0{unit}"


def environment() -> dict[str, str]:
    """Return processor, versions, cores and BLAS threads."""
    from threadpoolctl import threadpool_info

    listed = Path("/proc/cpuinfo")
    models = re.findall(r"model name\s*: (.*)", listed.read_text(encoding="utf-8")) if listed.is_file() else []
    result = {item.name.lower(): item.version for item in distributions()}
    return {
        "processor": (models or [platform.processor()])[0],
        "python": platform.python_version(),
        "cores": str(os.cpu_count() or 1),
        **{name: result.get(name, "not installed") for name in _PACKAGES},
        "BLAS": "; ".join(sorted({f"{pool['internal_api']} {pool['version']}" for pool in threadpool_info()})),
    }


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
        Called with the name of the next step.

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
