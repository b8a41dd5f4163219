"""The report of a benchmark: promises, what to use, whose front is ahead, every scene, how to reproduce."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import TYPE_CHECKING, Any, get_args

from boomctl.files import plain
from boomctl.lab.benchmark.diagram import Diagram, Kept, Lead, Point, Way
from boomctl.lab.benchmark.recommended import (
    Recommendation,
    duration,
    error_words,
    memory_words,
    page_text,
    recommendation_table,
    recommendations,
)
from boomctl.report import Picture, Report, Section, Table, number

if TYPE_CHECKING:
    from rich.console import Group

_TITLE = "Run time against error"
_WAY_WORDS: dict[Way, str] = {"cold": "from new parameters", "hot": "with the model ready"}
_SHADES = {"NO": "#f9d6d5", "yes": "#e3f4e3"}


@dataclass(frozen=True)
class BenchmarkReport:
    """All that a run measured.

    Attributes
    ----------
    diagrams : tuple of Diagram
    environment : mapping of str to str
        Machine and versions.
    command : str
        What reproduces the run.
    seconds : float
        How long it took [s].
    """

    diagrams: tuple[Diagram, ...]
    environment: Mapping[str, str] = field(default_factory=dict)
    command: str = "boomctl benchmark"
    seconds: float = 0.0

    @property
    def recommended(self) -> tuple[Recommendation, ...]:
        """What to use for each error wanted, of scenes whose fronts are drawn."""
        return recommendations(d for d in self.diagrams if d.shows == "front")

    @property
    def missed(self) -> tuple[str, ...]:
        """The promises that are not held, scene and words."""
        return tuple(f"{d.key}: {kept.text}" for d in self.diagrams for kept in d.kept if kept.held is False)

    @property
    def rows(self) -> list[dict[str, Any]]:
        """All points and promises as rows that another run can be compared with."""
        found = []
        for d in self.diagrams:
            for p in d.points:
                for way, measured in (("cold", p.cold), ("hot", p.hot)):
                    if measured is None:
                        continue
                    taken, error = ("ours", "error") if p.ours else ("peer", "peer_error")
                    job = f"{p.competitor}, {p.label}, {way}"
                    found.append({"section": d.key, "job": job, taken: measured, error: p.error})
            found += [{"section": d.key, "job": kept.text, "value": kept.value, "met": kept.held} for kept in d.kept]
        return found

    def as_dict(self) -> dict[str, Any]:
        """Return what JSON knows."""
        return plain(
            {
                "rows": self.rows,
                "missed": list(self.missed),
                "diagrams": [_diagram_dict(diagram) for diagram in self.diagrams],
                "recommended": [
                    {
                        "scene": r.diagram.key,
                        "wanted": r.wanted,
                        "setting": None if r.point is None else asdict(r.point),
                        "best_other": None if r.other is None else asdict(r.other),
                    }
                    for r in self.recommended
                ],
                "environment": dict(self.environment),
                "command": self.command,
                "seconds": round(self.seconds, 1),
            }
        )

    def report(self) -> Report:
        """Return the report that stands alone."""
        lead = (
            "Run time and error belong together: each point below is one way to answer a question, measured in one run in"
            " which all take turns. First what this package promised itself, and whether it holds; what to use for an error"
            " of 1 %, 0.1 % and 1e-6; then where this package is ahead of others and where it is not; then every scene with"
            " all its points.",
            self._summary,
        )
        drawn = any(d.shows != "promises" for d in self.diagrams)
        sections = [
            Section("Promises", tables=(self._promise_table(),)),
            Section("What to use", tables=(recommendation_table(self.recommended),)) if self.recommended else None,
            Section("Whose front is ahead", (_ahead_words(self._raced),), (_lead_table(self._raced),))
            if drawn
            else None,
            *(_diagram_section(d) for d in self.diagrams),
            self._sizes_section(),
            self._reproduce_section(),
        ]
        return Report(_TITLE, lead, tuple(s for s in sections if s is not None), self.as_dict())

    def page(self) -> str:
        """Return the tables of the page of recommended settings, as Markdown."""
        facts = ("processor", "system", "python", "numpy", "scipy")
        machine = ", ".join(f"{name} {self.environment[name]}" for name in facts if name in self.environment)
        return page_text(self.recommended, machine)

    def render(self) -> "Group":
        """Return promises, recommendations and leads, ready for ``rich.print``."""
        from rich.console import Group
        from rich.text import Text

        shown = [_in_terminal("Promises", self._promise_table())]
        if self.recommended:
            shown.append(_in_terminal("What to use", recommendation_table(self.recommended)))
            shown.append(_in_terminal("Whose front is ahead", _lead_table(self._raced)))
        words = [*([_ahead_words(self._raced)] if self.recommended else []), *_missing(self.diagrams)]
        lines = [Text(f"- {line}") for line in words]
        return Group(*shown, Text(), *lines, Text(self._summary, style="bold"))

    @property
    def _raced(self) -> tuple[Diagram, ...]:
        return tuple(d for d in self.diagrams if d.shows != "promises")

    @property
    def _summary(self) -> str:
        tried = [kept for d in self.diagrams for kept in d.kept if kept.held is not None]
        words = f"{len(tried) - len(self.missed)} of {len(tried)} promises held"
        return words + ("; missed: " + "; ".join(self.missed) if self.missed else ".")

    def _promise_table(self) -> Table:
        lines: list[tuple[str, ...]] = []
        for d in self.diagrams:
            if d.kept:
                lines += [(d.title,), *(_kept_cells(kept) for kept in d.kept)]
        return Table(("What", "Found", "Promised", "Held"), tuple(lines), align="lrll", shades=_SHADES)

    def _sizes_section(self) -> Section | None:
        named = {d.key: d for d in self.diagrams if d.shows == "unknowns"}
        if not named:
            return None
        from boomctl.plotting.canvas import figure_of, picture
        from boomctl.plotting.precision import plot_sizes

        competitors = dict.fromkeys(p.competitor for d in named.values() for p in d.points if p.ours and p.size)
        caption = "Error over the number of unknowns that move with a mass of their own."
        drawn = picture("unknowns", figure_of(plot_sizes, named, tuple(competitors)), caption)
        return Section("Error over unknowns", pictures=(drawn,))

    def _reproduce_section(self) -> Section:
        text = (
            f"{self.command} (this run took {self.seconds:.0f} s). All settings of a scene answer once and are judged;"
            " then they take turns, and the median of each stands for it. Processor time of all threads, that of processes"
            " waited for included; short calls are repeated to 20 ms a turn, behind one that is not timed. Cold: a parameter"
            " is changed in each call, so that nothing kept from a call before serves it. Hot: the model is there, with what"
            " it keeps by itself.",
            "Memory is what Python and NumPy allocate in a call, at its peak; work space of compiled solvers is not in it.",
            *_missing(self.diagrams),
        )
        facts = Table(("", ""), tuple((name, str(value)) for name, value in self.environment.items()), align="ll")
        return Section("Machine, versions, and how to reproduce", text, (facts,))


def _diagram_dict(diagram: Diagram) -> dict[str, Any]:
    return {
        **asdict(diagram),
        "fronts": {way: [f"{p.competitor}, {p.label}" for p in diagram.front(way)] for way in get_args(Way)},
        "leads": {way: [asdict(lead) for lead in diagram.leads(way)] for way in get_args(Way)},
    }


def _diagram_section(diagram: Diagram) -> Section:
    text = (diagram.question, f"Error: {diagram.measure}", *diagram.remarks)
    if diagram.shows != "promises":
        text += tuple(words for way in get_args(Way) if (words := lead_words(diagram, way)))
    text += diagram.missing
    drawn = () if diagram.shows == "promises" else (_picture(diagram),)
    return Section(diagram.title, text, (_point_table(diagram),), drawn)


def _picture(diagram: Diagram) -> Picture:
    from boomctl.plotting.canvas import figure_of, picture
    from boomctl.plotting.precision import plot_precision

    caption = "Lower left is better. Full lines: this package; dashed: others; grey: the front of all."
    return picture(diagram.key, figure_of(plot_precision, diagram), caption)


def _point_table(diagram: Diagram) -> Table:
    fronts = {way: diagram.front(way) for way in get_args(Way)}
    lines = []
    for p in diagram.points:
        on = ", ".join(way for way in get_args(Way) if p in fronts[way])
        error = p.failed or error_words(p.error)
        lines.append((p.competitor, p.label, error, duration(p.cold), duration(p.hot), memory_words(p.memory), on))
    heads = ("Competitor", "Setting", "Error", "Cold", "Hot", "Memory", "On the front")
    return Table(heads, tuple(lines), align="llrrrrl")


def lead_words(diagram: Diagram, way: Way) -> str:
    """Return in a sentence whether our front is ahead of the others', over the whole range of errors."""
    leads = diagram.leads(way)
    if not leads:
        return ""
    behind = [lead for lead in leads if lead.ratio < 1.0]
    if not behind:
        least = min(leads, key=lambda lead: lead.ratio)
        return (
            f"{_WAY_WORDS[way].capitalize()}, our front is ahead of all others over the whole range of their errors, by"
            f" {number(least.ratio, 2)} times at least ({_at(least)})."
        )
    worst = min(behind, key=lambda lead: lead.ratio)
    beyond, at = [lead for lead in behind if lead.ours is None], [lead.error for lead in behind]
    words = (
        f"{_WAY_WORDS[way].capitalize()}, our front is NOT ahead at {len(behind)} of {len(leads)} points of theirs: "
    )
    if beyond:
        return words + f"none of ours is as exact as {_at(beyond[-1])}."
    return words + (
        f"errors from {error_words(min(at))} to {error_words(max(at))}, most at"
        f" {_at(worst)}, where we take {number(1.0 / worst.ratio, 2)} times as long, {_excess(worst, way)} more."
    )


def _at(lead: Lead) -> str:
    return f"{error_words(lead.error)}, {lead.other.competitor}, {lead.other.label}"


def _excess(lead: Lead, way: Way) -> str:
    """Return how much longer ours takes."""
    ours, other = None if lead.ours is None else lead.ours.seconds(way), lead.other.seconds(way)
    return duration((ours or 0.0) - (other or 0.0))


def _ahead_words(diagrams: tuple[Diagram, ...]) -> str:
    """Return on how many diagrams our front is ahead of all others over the whole range of their errors."""
    judged = [(d, way, leads) for d in diagrams for way in get_args(Way) if (leads := d.leads(way))]
    behind = [f"{d.key} ({way})" for d, way, leads in judged if any(lead.ratio < 1.0 for lead in leads)]
    words = f"Our front is ahead of all competitors, over the whole range of their errors, on {len(judged) - len(behind)} of"
    return f"{words} {len(judged)} panels" + (f"; not on {', '.join(behind)}." if behind else ".")


def _lead_table(diagrams: tuple[Diagram, ...]) -> Table:
    lines = []
    for diagram in diagrams:
        for way in get_args(Way):
            leads = diagram.leads(way)
            if not leads:
                continue
            least, most = (pick(leads, key=lambda lead: lead.ratio) for pick in (min, max))
            ends = [lead.error for lead in leads]
            lines.append(
                (
                    diagram.key,
                    way,
                    f"{error_words(max(ends))} to {error_words(min(ends))}",
                    "yes" if least.ratio >= 1.0 else "NO",
                    _times(least.ratio),
                    f"{_at(least)}; ours: {_named(least.ours)}",
                    _times(most.ratio),
                )
            )
    heads = ("Scene", "Panel", "Errors of others", "Ahead", "Least lead", "where", "Largest lead")
    return Table(heads, tuple(lines), align="lllrrlr", shades=_SHADES)


def _times(ratio: float) -> str:
    return f"{ratio:,.0f}" if ratio >= 100 else f"{ratio:.2g}"


def _named(point: Point | None) -> str:
    return "none so exact" if point is None else f"{point.competitor}, {point.label}"


def _kept_cells(kept: Kept) -> tuple[str, ...]:
    bound = "" if kept.bound is None else f"{'at least' if kept.least else 'at most'} {kept.bound:.4g}"
    value = "not measured" if kept.value is None else f"{kept.value:.4g}"
    return kept.text, value, bound, {True: "yes", False: "NO", None: ""}[kept.held]


def _in_terminal(title: str, table: Table) -> Any:
    from rich.markup import escape
    from rich.table import Table as Lines

    shown = Lines(title=title, title_justify="left", pad_edge=False, box=None, padding=(0, 1))
    for head, side in zip(table.heads, table.align, strict=True):
        shown.add_column(escape(head), justify="left" if side == "l" else "right", overflow="fold")
    for line in table.lines:
        cells = (escape(cell) for cell in line)
        shown.add_row(*cells if len(line) > 1 else (f"[bold]{cell}[/bold]" for cell in cells))
    return shown


def _missing(diagrams: tuple[Diagram, ...]) -> tuple[str, ...]:
    return tuple(f"Missing: {words}" for words in dict.fromkeys(words for d in diagrams for words in d.missing))
