"""The report of a benchmark: whose front leads, what to use for 0.1 %, every scene with its picture, how to repeat it."""

import os
import platform
import re
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import TYPE_CHECKING, Any, get_args

from boomctl.files import Page, plain
from boomctl.lab.benchmark.diagram import Diagram, Lead, Point, Way
from boomctl.report import Report, Section, Table, power

if TYPE_CHECKING:
    from rich.console import Group

WANTED = 1e-3
"""Error for which a setting is recommended."""

PAGE = Page(
    "<!-- what follows is written by `boomctl benchmark --page` -->",
    "<!-- what precedes is written by `boomctl benchmark --page` -->",
)
_PACKAGES = ("boomctl", "numpy", "scipy", "control", "slycot", "pymor", "casadi", "ctrlsys", "mpmath")
_SHADES = {"NO": "#f9d6d5", "yes": "#e3f4e3"}


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

    def as_dict(self) -> dict[str, Any]:
        """Return the results for JSON."""
        found = [
            {**asdict(d), "leads": {way: [asdict(lead) for lead in d.leads(way)] for way in get_args(Way)}}
            for d in self.diagrams
        ]
        facts = {"environment": dict(self.environment), "command": self.command, "elapsed": round(self.elapsed, 1)}
        return plain({"scenes": found, **facts})

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
            Section("What to use for an error of 0.1 %", (), (self._recommended(),)),
            *map(_scene_section, self.diagrams),
            Section("Machine, versions, and how to repeat this", text, (facts,)),
        )
        return Report("Run time against error", (lead,), sections, self.as_dict())

    def page(self) -> str:
        """Return the table of recommended settings, as Markdown."""
        table = self._recommended()
        facts = ", ".join(f"{name} {self.environment[name]}" for name in ("processor", "numpy", "scipy"))
        rows = (table.heads, ["---"] * len(table.heads), *((a, f"`{b}`", *rest) for a, b, *rest in table.lines))
        lines = (f"| {' | '.join(cells)} |" for cells in rows)
        return f"Measured on {facts}.\n\n" + "\n".join(lines) + "\n"

    def render(self) -> "Group":
        """Return the leads and the recommended settings, ready for ``rich.print``."""
        from rich.console import Group

        return Group(_in_terminal(self._lead_table()), _in_terminal(self._recommended()))

    def _lead_table(self) -> Table:
        lines = []
        for diagram in self.diagrams:
            for way in get_args(Way):
                leads = sorted(diagram.leads(way), key=lambda lead: lead.ratio)
                if leads:
                    ahead = "yes" if leads[0].ratio >= 1.0 else "NO"
                    lines.append((diagram.key, way, ahead, *_lead_cells(leads[0]), *_lead_cells(leads[-1])[:1]))
        heads = ("Scene", "Calls", "Leads", "Least", "where", "Largest")
        caption = "Run time of each point of the others' front over that of our fastest setting with no larger error."
        return Table(heads, tuple(lines), caption, align="lllrlr", shades=_SHADES)

    def _recommended(self) -> Table:
        lines = []
        for diagram in self.diagrams:
            ours, other = (diagram.fastest(WANTED, "hot", ours) for ours in (True, False))
            write = ours.call if ours else "none of ours"
            cells = (error_words(ours.error), duration(ours.cold), duration(ours.hot)) if ours else ("", "", "")
            lines.append((diagram.title, write, *cells, f"{_name(other)}: {duration(other.hot)}" if other else "none"))
        heads = ("Question", "Write", "Error", "First call", "Later calls", "Fastest other")
        return Table(heads, tuple(lines), align="llrrrl")


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
        front = ", ".join(way for way in get_args(Way) if p in diagram.front(way))
        verified = "yes" if p.verified else "no"
        lines.append(
            (p.method, p.label, p.failed or error_words(p.error), duration(p.cold), duration(p.hot), verified, front)
        )
    heads = ("Method", "Setting", "Error", "Cold", "Hot", "Verified", "On the front")
    caption = "Verified: the method checks its answer by an independent computation within the run time shown."
    return Table(heads, tuple(lines), caption, align="llrrrll")


def _lead_cells(lead: Lead) -> tuple[str, str]:
    ratio = f"{lead.ratio:,.0f}" if lead.ratio >= 100 else f"{lead.ratio:.2g}"
    ours = "none of ours has so small an error" if lead.ours is None else f"ours: {_name(lead.ours)}"
    return ratio, f"{error_words(lead.other.error)}, {_name(lead.other)}; {ours}"


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


def _in_terminal(table: Table) -> Any:
    from rich.markup import escape
    from rich.table import Table as Lines

    shown = Lines(pad_edge=False, box=None, padding=(0, 1))
    for head, side in zip(table.heads, table.align, strict=True):
        shown.add_column(escape(head), justify="left" if side == "l" else "right", overflow="fold")
    for line in table.lines:
        shown.add_row(*map(escape, line))
    return shown


def environment() -> dict[str, str]:
    """Return processor, versions, cores and BLAS threads."""
    from threadpoolctl import threadpool_info

    listed = Path("/proc/cpuinfo")
    models = re.findall(r"model name\s*: (.*)", listed.read_text(encoding="utf-8")) if listed.is_file() else []
    facts = {"processor": (models or [platform.processor()])[0], "python": platform.python_version()}
    facts |= {"cores": str(os.cpu_count() or 1), **{name: _version(name) for name in _PACKAGES}}
    return facts | {
        "BLAS": "; ".join(sorted({f"{pool['internal_api']} {pool['version']}" for pool in threadpool_info()}))
    }


def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return "not installed"
